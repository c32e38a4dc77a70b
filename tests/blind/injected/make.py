"""Cases of measured drives with effects in them.

`python -m tests.blind.injected.make DIR --car bmw|porsche|rav4 --seed N --count K` writes folders of `drive.parquet` (canonical
names with units), `vehicle.toml` and a sealed truth. Beside the cases stand the drives as they are, `base-*`: aqualog
diagnoses them here for its limits of detection, and the judge for what the car has by itself. A null is such a drive from
another moment on.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tests.blind.injected.drives import TRIPS, Drive, measured, real_folder, window, write_drive
from tests.blind.injected.physics import UNKNOWN, inject, speed
from tests.blind.injected.plan import Planned, planned
from tests.blind.judge import answer_in
from tests.blind.judging.answers import Answer
from tests.blind.judging.run import Place, diagnose_all
from tests.blind.sealed import KINDS, seal

__all__ = ["main", "write_case"]

SHIFT_S = 40.0  # how much later a null begins than its base
LEAST_HELD_S = 120.0
SHARES = {"null": 0.15, "known": 0.5, "unknown": 0.2, "compound": 0.15}


class Base(NamedTuple):
    """Part of a measured drive, the same from `SHIFT_S` later on, and another part of that drive if it is long enough."""

    name: str
    drive: Drive
    later: Drive
    other: Drive | None


def bases(car: str, seed: int, count: int, duration_s: float, folder: Path) -> list[Base]:
    """Trips drawn by seed, parts in which the car drives."""
    rng = np.random.default_rng([seed, 51])
    out = []
    trips = [TRIPS[car][i] for i in rng.permutation(len(TRIPS[car]))]
    for k in range(count):
        drive = measured(car, trips[k % len(trips)], folder)
        end = float(drive.columns["t"][-1])
        length = min(duration_s, end - SHIFT_S if end > 3.0 * SHIFT_S else end)
        starts = np.arange(0.0, max(end - length - SHIFT_S, 0.0) + 1.0, 10.0)
        moving = [float(np.mean(speed(window(drive, s, length)) > 5.0)) for s in starts]
        good = starts[np.asarray(moving) >= np.quantile(moving, 0.7)]
        start = float(rng.choice(good))
        later = min(SHIFT_S, 0.1 * length)
        before, after = start - SHIFT_S, end - start - length - 2.0 * SHIFT_S
        held = None
        if max(before, after) > LEAST_HELD_S:
            begin = start + length + 2.0 * SHIFT_S if after >= before else 0.0
            held = window(drive, begin, min(max(before, after), length))
        parts = window(drive, start, length), window(drive, start + later, length)
        out.append(Base(f"base-{k + 1}", *parts, held))
    return out


def write_case(folder: Path, drive: Drive, truth: dict[str, Any]) -> None:
    """A case as the judge wants it; `is_sure`: with a vehicle file without `[spread]`."""
    write_drive(drive.columns, folder / "drive.parquet")
    car = drive.vehicle_file.read_text(encoding="utf-8")
    (folder / "vehicle.toml").write_text(car.split("[spread]")[0] if truth.get("is_sure") else car, encoding="utf-8")
    common = {"world": f"injected {drive.car}", "drive_type": f"{drive.car} {drive.trip}", "noise": "measured"}
    seal(folder, {**common, "effects": [], "unknown": None, **truth})


def filled_case(drive: Drive, later: Drive, plan: Planned) -> tuple[Drive, dict[str, Any]]:
    """The drive with what is planned in it, and its truth."""
    if plan.kind == "null":
        return later, {"kind": "null"}
    if plan.form is not None:
        name, values = plan.form
        how = UNKNOWN[name]
        unknown = {
            "mechanism": how.mechanism, "depends_on": list(how.depends_on), "also": [list(a) for a in how.also],
            "kind": name, "held_back": False, "parameters": values,
        }  # fmt: skip
        return inject(drive, name, None, values), {"kind": "unknown", "unknown": unknown}
    effects = []
    for effect, where, values, z in plan.effects:
        drive = inject(drive, effect, where, values)
        effects.append({"effect": effect, "where": where, "parameters": values, "detectability": z})
    return drive, {"kind": plan.kind, "effects": effects}


def kinds_of(kind: str, count: int, rng: np.random.Generator) -> list[str]:
    """Kinds of the cases in an order that says nothing."""
    if kind != "mixed":
        return [kind] * count
    exact = np.repeat(list(SHARES), np.diff(np.rint(np.cumsum([0.0, *SHARES.values()]) * count).astype(int)))
    return [str(k) for k in rng.permutation(exact)]


def main(arguments: Sequence[str] | None = None) -> int:
    """Write bases, diagnose them for their limits, write cases."""
    given = _parsed(arguments)
    real = given.real_logs or real_folder()
    if real is None or not real.is_dir():
        raise SystemExit("error: no measured drives: name their folder with --real-logs or AQUALOG_REAL_LOGS")
    own = {"seed": given.seed, "is_sure": given.no_spread}
    made = bases(given.car, given.seed, given.bases, given.duration, real)
    for b in made:
        if not (given.folder / b.name / "truth.bin").is_file():
            write_case(given.folder / b.name, b.drive, {**own, "kind": "null", "is_baseline": True})
    sizes = [Place(given.folder / b.name, given.folder / "limits" / "of" / b.name) for b in made]
    diagnose_all(sizes, jobs=given.jobs, timeout_s=3600.0)
    said = [_stated(p) for p in sizes]
    rng = np.random.default_rng([given.seed, 52])
    kinds, counts = kinds_of(given.kind, given.count, rng), dict.fromkeys(KINDS, 0)
    for i, kind in enumerate(kinds):
        k = i % len(made)
        base = made[k]
        plan = planned(base.drive, said[k], kind, given.seed + counts[kind], rng)
        counts[kind] += 1
        filled, truth = filled_case(base.drive, base.later, plan)
        case = given.folder / f"case-{i + 1:04d}"
        write_case(case, filled, {**own, **truth, "clean": base.name})
        if given.held and base.other is not None:
            write_drive(filled_case(base.other, base.other, plan)[0].columns, case / "held.parquet")
    print(f"{len(kinds)} cases and {len(made)} measured drives as they are in {given.folder}")
    return 0


def _stated(place: Place) -> Answer:
    answer = answer_in(place.out)
    if answer is None or answer.error or not answer.limits:
        why = "no verdict" if answer is None else answer.error or f"{answer.verdict} without limits of detection"
        raise SystemExit(f"error: {place.case}: {why}: remove {place.out} and take another seed")
    return answer


def _parsed(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m tests.blind.injected.make", description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.add_argument("folder", type=Path, metavar="DIR")
    parser.add_argument("--car", choices=list(TRIPS), required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=12)
    parser.add_argument("--kind", choices=["mixed", *KINDS], default="mixed")
    parser.add_argument("--bases", type=int, default=1, help="measured drives that the cases are made from")
    parser.add_argument("--duration", type=float, default=600.0, help="seconds of a drive")
    parser.add_argument(
        "--no-spread", action="store_true",
        help="vehicle files without what one more drive of the car may differ by: smaller limits, so smaller effects",
    )  # fmt: skip
    parser.add_argument(
        "--held", action="store_true",
        help="another part of the drive with the same effect as held-out drive; hills and waves are then on another road",
    )  # fmt: skip
    parser.add_argument("--jobs", type=int, default=2, help="processes for the limits")
    parser.add_argument("--real-logs", type=Path, help="folder of the measured drives")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
