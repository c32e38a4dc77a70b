"""What `tests.blind.judge` cannot count, on cases of the second simulator made for it: power at the stated limit, pairs of
effects, relations, the recommended run, the truth's own gain, the detectors.

`python -m tests.blind.score [--metric 1,2,...] [--small] [--jobs 2] [--seeds-from N] [--work DIR] [--json FILE]`
from the checkout. With `--work` every case is kept as it is done, and a run that was killed goes on from there.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, fields, replace
from pathlib import Path

# the folder of the tests, as in the tests themselves: compiled code of the world is kept under the name of its module
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.blind.metrics import naming, worth
from tests.blind.metrics.measure import Measure
from tests.blind.metrics.plan import PARTS, Sizes, plan
from tests.blind.metrics.rows import Row
from tests.blind.metrics.run import run
from tests.blind.metrics.store import Store
from tests.blind.metrics.table import measures_text

NEEDS: dict[int, tuple[str, ...]] = {
    4: ("limit",),
    6: ("pairs",),
    7: ("twins",),
    8: ("twins",),
    10: ("null", "named"),
    12: ("detector",),
}
"""Parts of the plan that a metric is made from."""

MEASURES = {
    4: naming.limits,
    6: naming.forecasts,
    7: naming.confounds,
    8: worth.manoeuvres,
    10: worth.gains,
    12: worth.detectors,
}


def measured(rows: Sequence[Row], metrics: Sequence[int]) -> list[Measure]:
    """All figures of these metrics, with those on cost that belong to every run."""
    return [m for number in metrics for m in MEASURES[number](rows)] + worth.speed(rows)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print, and return 1 if a target was missed."""
    given = _parsed(arguments)
    metrics = sorted({int(n) for n in given.metric.split(",")}) if given.metric else sorted(NEEDS)
    parts = [p for p in PARTS if any(p in NEEDS[m] for m in metrics)]
    sizes = _thinned(Sizes(), given.thin)
    jobs = plan(parts, sizes, given.seeds_from)
    if given.small:
        from tests.blind.metrics.small import small_jobs

        jobs = small_jobs(given.seeds_from)
    from tests.blind.metrics.case import work

    rows = run(jobs, Store(given.work), work, processes=given.jobs)
    figures = measured(rows, metrics)
    print(f"{len(rows)} cases, seeds from {given.seeds_from}\n\n{measures_text(figures)}")
    if given.json:
        document = {"seeds_from": given.seeds_from, "cases": len(rows), "measures": [asdict(m) for m in figures]}
        given.json.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    return int(any(m.reached is False for m in figures))


def _thinned(sizes: Sizes, by: float) -> Sizes:
    counts = {f.name: max(1, round(getattr(sizes, f.name) / by)) for f in fields(sizes) if f.name != "duration_s"}
    return replace(sizes, **counts)


def _parsed(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m tests.blind.score", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--metric", default="", help="numbers with commas between; default all")
    parser.add_argument("--small", action="store_true", help="a few short drives, under 90 s")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--seeds-from", type=int, default=1000, help="below 200: development")
    parser.add_argument("--thin", type=float, default=1.0, help="so many times fewer cases of each kind")
    parser.add_argument("--work", type=Path, help="folder that keeps the rows")
    parser.add_argument("--json", type=Path, help="the figures as a document")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
