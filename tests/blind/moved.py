"""Whether a name survives a vehicle file that is off by what its sources allow.

`python -m tests.blind.moved make DIR FROM --seed N` copies the cases of FROM with another vehicle file: radii off by 1.5 %,
torque gain by 20 % (standard deviations), both said to be guesses. `python -m tests.blind.moved count RUN_A RUN_B` compares
the verdicts of `tests.blind.judge` on both: a name that becomes another one is a fault, one that is not given any more is not.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import tomllib
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

__all__ = ["changes", "main", "make"]

MOVED = {"wheels.r_e_f": 0.015, "wheels.r_e_r": 0.015, "torque_gain": 0.20}


def make(folder: Path, cases: Path, seed: int) -> int:
    """Write the moved cases; their number."""
    every = sorted(p.parent for p in cases.glob("*/truth.bin"))
    for number, case in enumerate(every):
        out = folder / case.name
        shutil.copytree(case, out)
        rng = np.random.default_rng((seed, number))
        text = (case / "vehicle.toml").read_text(encoding="utf-8")
        document = tomllib.loads(text)
        for key, sd in MOVED.items():
            table, _, name = key.rpartition(".")
            value = (document[table] if table else document)[name]
            # a guess is rarely off by more than two standard deviations
            factor = 1.0 + sd * float(np.clip(rng.standard_normal(), -2.0, 2.0))
            text = _replaced(text, name, value, value * factor)
        said = "\n".join(f'"{key}" = "guess"' for key in MOVED)
        others = "\n".join(f'"{k}" = "measured"' for k in _keys(document) if k not in MOVED)
        (out / "vehicle.toml").write_text(f"{text}\n[provenance]\n{said}\n{others}\n", encoding="utf-8")
    return len(every)


def _keys(document: dict[str, object]) -> list[str]:
    out = []
    for name, value in document.items():
        if isinstance(value, dict) and name != "spread":
            out += [f"{name}.{k}" for k in value]
        elif isinstance(value, float) and name not in ("l_f", "l_r"):
            out.append(name)
    return out


def _replaced(text: str, name: str, old: float, new: float) -> str:
    lines = text.splitlines()
    # the first line of this name: `[spread]` has a share of it further down
    at = next(i for i, line in enumerate(lines) if line.startswith(f"{name} = {old}"))
    lines[at] = f"{name} = {new:.6f}"
    return "\n".join(lines)


def changes(one: Path, other: Path) -> tuple[Counter[str], list[str]]:
    """How the verdicts of two runs differ, and the cases whose single name is another one."""
    count: Counter[str] = Counter()
    faults = []
    for path in sorted(one.glob("*/verdict.json")):
        second = other / path.parent.name / "verdict.json"
        if not second.is_file():
            continue
        a, b = (json.loads(p.read_text(encoding="utf-8")) for p in (path, second))
        names = [{(c["effect"], c.get("where")) for c in d.get("causes", ())} for d in (a, b)]
        if a["verdict"] == b["verdict"] == "named" and names[0] != names[1]:
            faults.append(f"{path.parent.name}: {names[0]} -> {names[1]}")
        count[f"{a['verdict']} -> {b['verdict']}"] += 1
    return count, faults


def main(arguments: Sequence[str] | None = None) -> int:
    """Make cases or compare runs; 1 if a name became another one."""
    parser = argparse.ArgumentParser(prog="python -m tests.blind.moved", description=__doc__.partition("\n")[0])
    what = parser.add_subparsers(dest="what", required=True)
    making = what.add_parser("make")
    making.add_argument("folder", type=Path)
    making.add_argument("cases", type=Path)
    making.add_argument("--seed", type=int, required=True)
    counting = what.add_parser("count")
    counting.add_argument("one", type=Path)
    counting.add_argument("other", type=Path)
    given = parser.parse_args(arguments)
    if given.what == "make":
        print(f"{make(given.folder, given.cases, given.seed)} cases")
        return 0
    count, faults = changes(given.one, given.other)
    for text, n in sorted(count.items()):
        print(f"{n:4d} {text}")
    print("\n".join([f"{len(faults)} of {sum(count.values())} names became another one", *faults]))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
