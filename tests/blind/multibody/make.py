"""Write blind cases: `python -m tests.blind.multibody.make DIR --seed N --kind null|known|unknown|compound|mixed --count K`.

Each case is a folder `case_0001` with `drive.mf4`, `held.mf4` (another drive of the same car with the same hidden cause),
`vehicle.toml` and the sealed `truth.bin`. Read the truth by `seal.open_truth(folder, verdict)` after the verdict.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from itertools import count
from pathlib import Path

import numpy as np

from aqualog.core.vehicle import vehicle_toml
from aqualog.io.write_log import LogGroup, write_log

from .cases import KIND_NAMES, Z_LEAST, draw_plan, make_case
from .hidden import HELD_BACK
from .seal import seal_truth
from .sensors import UNITS, Message

__all__ = ["main", "write_messages"]

START_NS = 1_700_000_000_000_000_000  # of every log, so that it says nothing
AGAIN = 10_000  # added to a case's number when all but its form is drawn again


def write_messages(path: Path, messages: Sequence[Message]) -> None:
    """A log as a logger writes it; formats that are one table get all signals at 100 Hz."""
    if path.suffix == ".parquet":
        t = np.arange(0.02, messages[0].t[-1] - 0.02, 0.01)
        resampled = {s: np.interp(t, m.t, x) for m in messages for s, x in m.columns.items()}
        messages = [Message("log", t, resampled)]
    groups = [
        LogGroup(m.name, {s: (UNITS[s.split("_")[0]], "", x) for s, x in m.columns.items()},
                 None if path.suffix == ".parquet" else np.rint(m.t * 1e9).astype(np.int64))
        for m in messages
    ]  # fmt: skip
    times = np.rint(messages[0].t * 1e9).astype(np.int64)
    write_log(path, times, groups, suffix=path.suffix, start_ns=START_NS, comment="", written_ns=START_NS)


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the cases, print the folders."""
    parser = argparse.ArgumentParser(prog="python -m tests.blind.multibody.make", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, required=True, help="below 1000: development")
    parser.add_argument("--kind", choices=KIND_NAMES, required=True)
    parser.add_argument("--count", type=int, default=1)
    parser.add_argument("--first", type=int, default=1, help="number of the first case")
    parser.add_argument("--duration", type=float, default=300.0, help="of each drive [s]")
    parser.add_argument("--scale", type=float, default=1.0, help="of the hidden sizes; below 1 they are not enlarged")
    parser.add_argument("--wet", action="store_true", help="known: effects of water")
    parser.add_argument("--held-back", action="store_true", help="unknown: forms that no development has seen")
    parser.add_argument("--suffix", choices=(".mf4", ".parquet"), default=".mf4")
    given = parser.parse_args(arguments)
    if given.held_back and given.seed < 1000:
        parser.error("--held-back is for seeds from 1000 on: never for development")
    for number in range(given.first, given.first + given.count):
        plans = (draw_plan(given.seed, n, given.kind, wet=given.wet, held_back=given.held_back, scale=given.scale,
                           duration_s=given.duration) for n in count(number, AGAIN))  # fmt: skip
        plan = next(plans)
        names = [h.name for h in plan.hidden]
        as_drawn = bool(set(names) & set(HELD_BACK))
        case = make_case(plan, z_least=0.0 if as_drawn or given.scale < 1.0 else Z_LEAST)
        while as_drawn and given.scale >= 1.0 and min(h["z_own"] for h in case.truth["hidden"]) < Z_LEAST:
            case = make_case(next(p for p in plans if [h.name for h in p.hidden] == names), z_least=0.0)
        folder = given.folder / f"case_{number:04d}"
        folder.mkdir(parents=True)
        write_messages(folder / f"drive{given.suffix}", case.drive)
        write_messages(folder / f"held{given.suffix}", case.held)
        (folder / "vehicle.toml").write_text(vehicle_toml(case.vehicle), encoding="utf-8")
        seal_truth(folder, case.truth)
        print(folder)
    return 0


if __name__ == "__main__":
    sys.exit(main())
