"""Benchmarks beside their peers: `python -m tests.bench [NAME ...] [--table]` from the checkout.

Names: starting, mf4, csv, computing; without any, all. Each row first checks that both sides give the same, then times
them in turns and prints the ratio of their times, minimum / median / maximum. `--table` prints Markdown alone.
"""

from __future__ import annotations

import argparse
import platform
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from tests.bench import computing, reading, starting
from tests.bench.compare import HEAD, Row, line, measured

GROUPS: dict[str, Callable[[Path], list[Row]]] = {
    "starting": lambda _: starting.rows(),
    "mf4": reading.mf4_rows,
    "csv": reading.csv_rows,
    "computing": lambda _: computing.rows(),
}


def main(arguments: list[str] | None = None) -> int:
    """Run and print; 1 if both sides of a row do not agree."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(GROUPS))
    parser.add_argument("--table", action="store_true", help="Markdown alone")
    given = parser.parse_args(arguments)
    unknown = set(given.names) - set(GROUPS)
    if unknown:
        parser.error(f"no group {', '.join(sorted(unknown))}; there are {', '.join(GROUPS)}")
    say = (lambda _: None) if given.table else (lambda text: print(text, file=sys.stderr, flush=True))
    say(f"Python {platform.python_version()}, {platform.machine()}")
    print(HEAD)
    code = 0
    for name in given.names or GROUPS:
        with tempfile.TemporaryDirectory(prefix="aqualog-bench-") as folder:
            say(f"making {name}")
            for row in GROUPS[name](Path(folder)):
                say(f"timing {row.name} beside {row.peer_name}")
                try:
                    print(line(measured(row)), flush=True)
                except AssertionError as error:
                    code = 1
                    print(f"not the same: {error}", file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())
