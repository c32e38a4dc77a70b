"""All damaged logs through `detect`: `python -m tests.damaged [FORMAT ...] [--keep DIR]`; ends with 1 if one is misread."""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections import Counter
from pathlib import Path

from aqualog.workers import Crashed, Limits, work_on
from tests.damaged.damage import DAMAGES
from tests.damaged.judge import Seen, attempt, samples_of, verdict
from tests.damaged.logs import FORMATS

LIMITS = Limits(seconds=30.0, memory_mb=4000)


def main() -> int:
    """Make, look, print."""
    parser = argparse.ArgumentParser(prog="python -m tests.damaged", description=__doc__)
    parser.add_argument("formats", nargs="*", metavar="FORMAT", help=", ".join(FORMATS))
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--keep", type=Path, help="folder for the damaged logs")
    given = parser.parse_args()
    names = given.formats or list(FORMATS)
    with tempfile.TemporaryDirectory() as scratch:
        folder = given.keep or Path(scratch)
        made, sound = _made(folder, names)
        found: dict[Path, str] = {}

        def record(path: Path, seen: Seen | str | Crashed) -> None:
            name, damage = made[path]
            if isinstance(seen, Seen):
                found[path] = verdict(name, damage, sound[name], seen)
            else:
                found[path] = (
                    f"! crashed or out of time after {seen.seconds:.0f} s" if isinstance(seen, Crashed) else seen
                )
            if found[path].startswith("!"):
                print(
                    f"{name}: {damage.fault} {damage.number}: {found[path]}  {getattr(seen, 'words', '')[:300]}",
                    flush=True,
                )

        work_on({p: (p,) for p in made}, attempt, jobs=given.jobs, record=record, limits=LIMITS)
    _print(names, {made[p]: v for p, v in found.items()})
    return int(any(v.startswith("!") for v in found.values()))


def _made(folder, names):  # type: ignore[no-untyped-def]
    made, sound = {}, {}
    for name in names:
        place = folder / name.replace(" ", "_").replace(",", "")
        place.mkdir(parents=True)
        source = FORMATS[name](place)
        sound[name], _ = samples_of(source)
        data = source.read_bytes()
        for damage in DAMAGES:
            path = place / f"{damage.fault}_{damage.number}".replace(" ", "_") / source.name
            path.parent.mkdir()
            path.write_bytes(damage.make(data))
            made[path] = name, damage
    return made, sound


def _print(names, found):  # type: ignore[no-untyped-def]
    faults = list(dict.fromkeys(d.fault for d in DAMAGES))
    print(
        f"\n{len(found)} damaged logs\n\n| format | " + " | ".join(faults) + " |\n|---" * 1 + "|---" * len(faults) + "|"
    )
    for name in names:
        cells = []
        for fault in faults:
            counts = Counter(v.split(":")[0] for (n, d), v in found.items() if n == name and d.fault == fault)
            cells.append(", ".join(f"{c} {v}" for v, c in counts.most_common()))
        print(f"| {name} | " + " | ".join(cells) + " |")
    print("\nall: " + ", ".join(f"{c} {v}" for v, c in Counter(v.split(":")[0] for v in found.values()).most_common()))


if __name__ == "__main__":
    os.environ.setdefault("NO_COLOR", "1")
    sys.exit(main())
