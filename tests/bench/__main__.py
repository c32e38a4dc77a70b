"""Benchmarks beside their peers: `python -m tests.bench [NAME ...] [--full] [--table]` from the checkout.

Each row first checks that both sides give the same, then measures them in turns and prints the ratio of their costs,
minimum / median / maximum. Without a name all groups are run: some minutes; `--full`, with logs of 100 h and batches of
10,000 logs: hours, and 10 GB of disk. `--table` writes the table of all groups into the book. A row whose peer is not
installed is told and left out.
"""

from __future__ import annotations

import argparse
import gc
import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

# threads of linear algebra would only wait for each other; where polars may use more than one, a row says so
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from tests.bench import (
    batching,
    computing,
    detecting,
    messages,
    paging,
    reading,
    recursions,
    regressing,
    starting,
    table,
)
from tests.bench.compare import HEAD, INSTALL, Row, line, line_without, measured
from tests.bench.scale import FULL, STANDARD, Scale

GROUPS: dict[str, Callable[[Path, Scale], list[Row]]] = {
    "starting": lambda _folder, _scale: starting.rows(),
    "mf4": reading.mf4_rows,
    "csv": reading.csv_rows,
    "mcap": messages.rows,
    "recursions": lambda _, scale: recursions.rows(scale),
    "computing": lambda _, scale: computing.rows(scale),
    "regression": lambda _, scale: regressing.rows(scale),
    "page": lambda _, scale: paging.rows(scale),
    "detect": detecting.script_rows,
    "long": detecting.long_rows,
    "batch": batching.pool_rows,
    "growth": batching.growth_rows,
}


def main(arguments: list[str] | None = None) -> int:
    """Run and print; 1 if both sides of a row do not agree, or one of them fails."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(GROUPS))
    parser.add_argument("--full", action="store_true", help="logs of 100 h, batches of 10,000 logs")
    parser.add_argument(
        "--table", action="store_true", help="write the table into aqualog/docs/validation/benchmarks.md"
    )
    given = parser.parse_args(arguments)
    unknown = set(given.names) - set(GROUPS)
    if unknown:
        parser.error(f"no group {', '.join(sorted(unknown))}; there are {', '.join(GROUPS)}")
    if given.table and given.names:
        parser.error("--table is the table of all groups")
    about = table.conditions()
    print(f"{about}\n\n{HEAD}", flush=True)
    lines, code = run(given.names or list(GROUPS), FULL if given.full else STANDARD)
    if given.table:
        table.put(table.PAGE, about, lines)
    return code


def run(names: list[str], scale: Scale) -> tuple[list[str], int]:
    """Rows of the table as they come, and the exit code."""
    lines, code = [], 0
    for name in names:
        with tempfile.TemporaryDirectory(prefix="aqualog-bench-") as folder:
            _say(f"making {name}")
            for row in GROUPS[name](Path(folder), scale):
                _say(f"measuring {row.name} beside {row.peer_name}")
                text, is_well = _one(row, scale)
                code = code if is_well else 1
                lines.append(text)
                print(text, flush=True)
                gc.collect()  # a page or a frame of one row is not the next one's
    return lines, code


def _one(row: Row, scale: Scale) -> tuple[str, bool]:
    if not row.is_runnable:
        return line_without(row, f"not run: `{INSTALL}`"), True
    try:
        return line(measured(row, scale.rounds)), True
    except AssertionError as error:
        return line_without(row, f"not the same: {error}"), False
    except (RuntimeError, MemoryError, OSError) as error:
        return line_without(row, f"failed: {error}".replace("|", "/")), False


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
