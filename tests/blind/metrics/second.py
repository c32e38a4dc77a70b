"""Metric 8 by doing it: the recommended run is driven by the world and diagnosed together with the first drive."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from aqualog.diagnose.records import Diagnosis
from tests.blind.metrics.plan import Job
from tests.blind.metrics.rows import Second
from tests.blind.world.cases import Case, Spec, make_case

__all__ = ["RUNS", "second"]

RUNS: dict[str, dict[str, object]] = {
    # the nearest thing that the world can drive, on flat dry road
    "hard_acceleration": {"programme": "handling"},
    "hard_accelerations": {"programme": "handling"},
    "brake_staircase": {"programme": "handling"},
    "coast_down": {"programme": "mixed"},
    "speed_staircase": {"programme": "mixed"},
    "speed_steps": {"programme": "mixed"},
    "motorway": {"programme": "motorway"},
    "stop_and_go": {"programme": "stop_and_go"},
}
"""Run of the engine's catalogue -> what of the spec changes."""

NEITHER = ("none", "sensor")


def second(job: Job, spec: Spec, case: Case, found: Diagnosis, diagnosed: Callable[[Case], Diagnosis]) -> Second | None:
    """What came of the recommendation; None if there is none. A run that the world cannot drive is not resolved."""
    if found.manoeuvre is None:
        return None
    name = found.manoeuvre.name
    if name in NEITHER or name not in RUNS:
        return Second(name, job.can, "" if name in NEITHER else "not driven")
    run = make_case(replace(spec, holdout=0, seed=spec.seed + 200_000, **RUNS[name]))  # type: ignore[arg-type]
    both = Case(case.spec, case.vehicle, (*case.drives, ("second", run.drives[0][1])), case.holdout)
    d = diagnosed(both)
    from tests.blind.metrics.case import said_of

    return Second(name, job.can, d.verdict, tuple(said_of(d.causes)))
