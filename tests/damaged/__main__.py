"""All damaged logs through `detect`: `python -m tests.damaged [FORMAT ...] [--keep DIR] [--verdicts FILE]`; ends with 1 if one
is misread. Two files of verdicts show whether two versions judge every log alike.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from collections import Counter
from pathlib import Path

from aqualog.guard.worker import Crashed, Limits, work_on
from tests.damaged.damage import DAMAGES, bombs
from tests.damaged.judge import LEGEND, OUTCOMES, Seen, attempt, outcome, samples_of, verdict
from tests.damaged.logs import FORMATS, folder_of
from tests.record.values import digest

LIMITS = Limits(seconds=30.0, memory_mb=2000)


def main() -> int:
    """Make, look, print."""
    parser = argparse.ArgumentParser(prog="python -m tests.damaged", description=__doc__)
    parser.add_argument("formats", nargs="*", metavar="FORMAT", help=", ".join(FORMATS))
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--keep", type=Path, help="folder for the damaged logs")
    parser.add_argument("--verdicts", type=Path, help="file for the verdict of every log, as JSON lines")
    given = parser.parse_args()
    names = given.formats or list(FORMATS)
    with tempfile.TemporaryDirectory() as scratch:
        folder = given.keep or Path(scratch)
        made, sound = _made(folder, names)
        found: dict[Path, str] = {}
        lines: dict[Path, dict[str, object]] = {}

        def record(path: Path, seen: Seen | str | Crashed) -> None:
            name, damage = made[path]
            if isinstance(seen, Seen):
                found[path] = verdict(name, damage, sound[name], seen)
            else:
                found[path] = f"! over limit after {seen.seconds:.0f} s" if isinstance(seen, Crashed) else seen
            lines[path] = {"log": digest([path.read_bytes()]), "verdict": found[path], **_facts(seen)}
            if found[path].startswith("!"):
                print(
                    f"{name}: {damage.fault} {damage.number}: {found[path]}  {getattr(seen, 'words', '')[:300]}",
                    flush=True,
                )

        work_on({p: (p,) for p in made}, attempt, jobs=given.jobs, record=record, limits=LIMITS)
        if given.verdicts:
            heads = {p: {"format": name, "fault": d.fault, "number": d.number} for p, (name, d) in made.items()}
            given.verdicts.write_text("".join(json.dumps(heads[p] | lines[p]) + "\n" for p in made), encoding="utf-8")
    _print(names, {made[p]: v for p, v in found.items()})
    return int(any(v.startswith("!") for v in found.values()))


def _facts(seen: Seen | str | Crashed) -> dict[str, object]:
    """What was seen of a log, its samples as a digest."""
    if not isinstance(seen, Seen):
        return {}
    samples = digest(
        part for name, (t, x) in sorted(seen.samples.items()) for part in (name.encode(), t.tobytes(), x.tobytes())
    )
    return {"code": seen.code, "told": seen.told, "lost": seen.lost, "samples": samples, "words": seen.words}


def _made(folder, names):  # type: ignore[no-untyped-def]
    made, sound = {}, {}
    for name in names:
        place = folder / folder_of(name)
        place.mkdir(parents=True)
        source = FORMATS[name](place)
        sound[name], _ = samples_of(source)
        data = source.read_bytes()
        for damage in (*DAMAGES, *bombs(name)):
            path = place / f"{damage.fault}_{damage.number}".replace(" ", "_") / source.name
            path.parent.mkdir()
            path.write_bytes(damage.make(data))
            made[path] = name, damage
    return made, sound


def _print(names, found):  # type: ignore[no-untyped-def]
    by_format = {n: Counter(outcome(v) for (name, _), v in found.items() if name == n) for n in names}
    faults = dict.fromkeys(d.fault for _, d in found)
    by_fault = {f: Counter(outcome(v) for (_, d), v in found.items() if d.fault == f) for f in faults}
    print(f"\n{len(found)} damaged logs\n\n| format | {' | '.join(OUTCOMES)} |\n|---" + "|---:" * len(OUTCOMES) + "|")
    _print_rows(by_format)
    print(f"| **damage** |{' |' * len(OUTCOMES)}")
    _print_rows(by_fault)
    _print_rows({"**all**": sum(by_format.values(), Counter())})
    print(f"\n{LEGEND}")


def _print_rows(rows):  # type: ignore[no-untyped-def]
    for name, counts in rows.items():
        print(f"| {name} | {' | '.join(str(counts[o] or '') for o in OUTCOMES)} |")


if __name__ == "__main__":
    os.environ.setdefault("NO_COLOR", "1")
    sys.exit(main())
