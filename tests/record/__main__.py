"""A record of what every command prints and writes.

`python -m tests.record make DIR` runs every command of this checkout on the sample logs, the measured drives and a simulated
campaign; `--tool PLACE` takes another Python or `aqualog`. `python -m tests.record compare OLD NEW` ends with 1 if a result
has changed; wording is listed apart.
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

from tests.record.cases import CASES
from tests.record.compare import Change, case_changes
from tests.record.make import DRIVES, make, tool_of


def main(arguments: list[str] | None = None) -> int:
    """Make or compare; the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.record", description=__doc__)
    steps = parser.add_subparsers(dest="step", required=True)
    making = steps.add_parser("make")
    making.add_argument("folder", type=Path)
    making.add_argument("--tool", help="Python or aqualog command; default: this checkout with this Python")
    making.add_argument("--only", default="", help="pattern of case names; what these read must be among them")
    making.add_argument("--long", action="store_true", help="also cases that take minutes")
    making.add_argument("--drives", type=Path, default=DRIVES, help="folder of the measured drives")
    comparing = steps.add_parser("compare")
    comparing.add_argument("old", type=Path)
    comparing.add_argument("new", type=Path)
    comparing.add_argument("--all", action="store_true", help="list every change of wording")
    given = parser.parse_args(arguments)
    if given.step == "compare":
        return _compare(given.old, given.new, is_all=given.all)
    chosen = [c for c in CASES if re.search(given.only, c.name) and (given.long or not c.is_long)]
    for case, seconds in make(chosen, given.folder, tool_of(given.tool), given.drives):
        print(f"{seconds:6.1f} s  {case.name}", file=sys.stderr, flush=True)
    return 0


def _compare(old: Path, new: Path, *, is_all: bool) -> int:
    names = sorted({p.name for p in (*old.glob("*.json"), *new.glob("*.json"))})
    both = [n for n in names if (old / n).exists() and (new / n).exists()]
    found = {n.removesuffix(".json"): case_changes(old / n, new / n) for n in both}
    results = {n: [c for c in cs if not c.is_wording] for n, cs in found.items()}
    wording = {n: [c for c in cs if c.is_wording] for n, cs in found.items()}
    _listed("Changed results", results, most=20)
    _listed(
        "Wording with other numbers", {n: [c for c in w if c.has_other_numbers] for n, w in wording.items()}, most=20
    )
    if is_all:
        _listed("Wording", wording, most=10**6)
    print("\n| case | results changed | wording changed |\n|---|---|---|")
    for name, cs in found.items():
        if cs:
            print(f"| {name} | {len(results[name])} | {len(wording[name])} |")
    for name in set(names) - set(both):
        print(f"| {name.removesuffix('.json')} | in one record only | |")
    changed, words = sum(map(bool, results.values())), sum(bool(wording[n]) and not results[n] for n in found)
    print(
        f"\n{len(found)} cases: {len(found) - changed - words} equal, {words} wording only, {changed} changed results"
    )
    return 1 if changed or len(both) < len(names) else 0


def _listed(title: str, by_case: dict[str, list[Change]], most: int) -> None:
    """Changes below a heading; more than `most` of a case are counted."""
    if not any(by_case.values()):
        return
    print(f"\n{title}\n")
    for name, cs in by_case.items():
        for change in cs[:most]:
            print(f"{name}: {change}")
        if len(cs) > most:
            print(f"{name}: and {len(cs) - most} more")


if __name__ == "__main__":
    sys.exit(main())
