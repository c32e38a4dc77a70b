"""`python -m tests.breaks ROOT [--count 40] [--seed 1]`: applies breaks drawn at random, one at a time, and runs the tests on each.

ROOT is a checkout that nobody else uses: its files change while this runs, and are put back. The tests nearest to the break run
first; the first failure ends a run. Ends with 1 if a break was not found.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path

from tests.breaks.draw import Break, drawn


def main() -> int:
    """Draw, break, test, put back."""
    parser = argparse.ArgumentParser(prog="python -m tests.breaks", description=__doc__)
    parser.add_argument("root", type=Path)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--first", type=Path, help="JSON: tests that run a line, as {'aqualog/x.py:12': ['tests/test_x.py::test_y']}"
    )
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--list", action="store_true", help="only say what would be broken")
    parser.add_argument("--skip", type=int, default=0, help="leave out the first ones")
    given = parser.parse_args()
    breaks = drawn(given.root, given.count, given.seed)
    first = json.loads(given.first.read_text()) if given.first else {}
    found = 0
    for number, one in enumerate(breaks[given.skip :], given.skip + 1):
        if given.list:
            print(number, one)
            continue
        began = time.monotonic()
        by = _found_by(given.root.resolve(), one, first, given.jobs)
        found += by is not None
        print(
            f"{number:3d} {time.monotonic() - began:6.0f} s  {'found by ' + by if by else 'NOT FOUND'}  {one}",
            flush=True,
        )
    if not given.list:
        print(f"{found} of {len(breaks) - given.skip} breaks found")
    return 0 if given.list or found == len(breaks) - given.skip else 1


def _found_by(root: Path, one: Break, first: dict[str, list[str]], jobs: int) -> str | None:
    """Name of the test that failed; None: all passed."""
    path = root / one.path
    before = path.read_text(encoding="utf-8")
    path.write_text(one.applied(before), encoding="utf-8")
    try:
        near = first.get(f"{one.path}:{one.line}", [])[:400]
        return (_failure(root, near, jobs) if near else None) or _failure(root, [], jobs)
    finally:
        path.write_text(before, encoding="utf-8")


def _failure(root: Path, tests: list[str], jobs: int) -> str | None:
    line = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-x",
        "-n",
        str(jobs),
        "--dist",
        "loadscope",
        "-p",
        "no:cacheprovider",
        *tests,
    ]
    run = subprocess.run(line, cwd=root, env={**os.environ, "PYTHONPATH": str(root)}, capture_output=True, text=True)
    if run.returncode == 0:
        return None
    failed = [word.split(" ")[1] for word in run.stdout.splitlines() if word.startswith(("FAILED ", "ERROR "))]
    return failed[0] if failed else f"exit code {run.returncode}"


if __name__ == "__main__":
    sys.exit(main())
