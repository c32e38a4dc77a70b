"""A few short cases for every run of the tests: two nulls and three large effects."""

from __future__ import annotations

from tests.blind.metrics.plan import Job
from tests.blind.world.cases import Hidden, Spec

__all__ = ["small_jobs"]

_LENGTH_S = 60.0


def small_jobs(seeds_from: int = 1) -> list[Job]:
    """Cases of little more than a minute: enough for what is large."""
    cases = (
        ("null", Spec("mixed", "ou1", (), vehicle="sedan_rwd")),
        ("null", Spec("handling", "pink", (), vehicle="compact_fwd")),
        ("named", Spec("mixed", "ou1", (Hidden("aero_drag", None, {"delta_drag_area": 0.5}),), vehicle="sedan_rwd")),
        ("named", Spec("mixed", "white", (Hidden("tyre_radius", "fl", {"delta": -0.01}),), vehicle="compact_fwd")),
        ("named", Spec("handling", "ou01", (Hidden("signal_delay", "a_x", {"delay": 0.1}),), vehicle="suv_awd")),
    )
    out = []
    for i, (group, spec) in enumerate(cases):
        seeded = Spec(spec.programme, spec.noise, spec.hidden, seeds_from + i, spec.vehicle, duration_s=_LENGTH_S)
        out.append(Job(f"small-{i}-{seeds_from + i}", group, seeded, surrogates=19))
    return out
