"""Terms without a name in physics: functions from a diagnosis that the model may carry, as tables of knots.

They are separate from the effects that a search may name: any of them could imitate several effects.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aqualog.model.term import Effect, Knots, Setup, Table

__all__ = ["EMPIRICAL"]


def _sum(a: Knots, b: Knots) -> Knots:
    """Sum of two piecewise linear functions that are constant beyond their ends."""
    x = np.unique([k[0] for k in (*a, *b)])
    total = sum(np.interp(x, [k[0] for k in knots], [k[1] for k in knots]) for knots in (a, b))
    return tuple(zip(x.tolist(), np.asarray(total).tolist(), strict=True))


def _force(setup: Setup, knots: Knots, _: str | None) -> Setup:
    now = tuple((float(v), float(force)) for v, force in setup.plant.drag_over_v)
    return setup._replace(plant=setup.plant._replace(drag_over_v=np.array(_sum(now, knots))))


def _grade(setup: Setup, knots: Knots, _: str | None) -> Setup:
    now = setup.scenario.grade or ((0.0, 0.0),)
    return setup._replace(scenario=replace(setup.scenario, grade=_sum(now, knots)))


_ALL = (
    Effect(
        "unexplained_force", "extra force against the motion, over the speed [N]",
        "A force that depends on the speed holds the car back, and no known effect explains it.", "found in a drive",
        (), lambda setup, _v, _w: setup, twins=("aero_drag", "head_wind", "rolling_resistance"),
        table=Table("v_x", "m/s", 0.0, 150.0, "N", -2e4, 2e4, _force),
    ),
    Effect(
        "unexplained_grade", "slope angle along the way [rad]",
        "The road climbs and falls along the way.", "found in a drive",
        (), lambda setup, _v, _w: setup, twins=("road_grade", "accelerometer_drift"),
        table=Table("position", "m", 0.0, 1e7, "rad", -0.3, 0.3, _grade),
    ),
)  # fmt: skip

EMPIRICAL: dict[str, Effect] = {e.name: e for e in _ALL}
"""By name; no parameters, neutral without knots."""
