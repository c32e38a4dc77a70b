"""Surface of differential traction with lines of fixed torque splits on it: common parts of figures 3.4 and 3.5."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.figures.curves import Road, split, surface
from aqualog.figures.record import Axis, Line, Sheet
from aqualog.figures.study import HIGH_MU, HIGH_SLOPE, LOW_MU, LOW_SLOPE
from aqualog.figures.timeline import COLOURS

__all__ = ["DIFFERENCE", "DRY", "FRONT_SLIP", "SNOW", "TRACTION", "forces", "initial_slope", "sheet", "split_lines"]

DRY = Road("dry", HIGH_MU, HIGH_SLOPE, COLOURS[1])
SNOW = Road("snowy", LOW_MU, LOW_SLOPE, COLOURS[0])

_REACH = 0.02  # slips that are drawn, to both sides [-]
FRONT_SLIP = Axis("s_F", "%", limits=(-100 * _REACH, 100 * _REACH))
DIFFERENCE = Axis("s_delta", "%", limits=(-100 * _REACH, 100 * _REACH))
TRACTION = Axis("mu_delta")


def sheet(road: Road) -> Sheet:
    """The surface of a road within the slips that are drawn."""
    s = np.linspace(-_REACH, _REACH, 41)
    return Sheet(f"surface, {road.name}", 100.0 * s, 100.0 * s, surface(road, s, s), road.colour)


def forces(road: Road) -> FloatArray:
    """Forces over the car's weight (n,), both ways through zero, up to 60 % of what the road holds. [-]"""
    return np.linspace(-0.6, 0.6, 241) * road.mu_max * 0.4


def split_lines(
    road: Road, nu: float, *, name: str, colour: str, dash: str = "solid", is_solid: bool = True
) -> Line:  # fmt: skip
    """Line of a fixed torque split over the force, in space or projected; cut where it leaves the view."""
    p = split(road, forces(road), nu)
    out = (np.abs(p.s_f) > _REACH) | (np.abs(p.s_delta) > _REACH)
    mu_delta = np.where(out, np.nan, p.mu_delta)
    if is_solid:
        x, y = 100.0 * p.s_f, 100.0 * p.s_delta
        return Line(name, x, y, z=mu_delta, colour=colour, dash=dash, width=3.0, group=name)
    return Line(name, 100.0 * p.s_delta, mu_delta, colour=colour, dash=dash, group=name)


def initial_slope(road: Road, nu: float) -> float:
    """mu_delta over s_delta of a fixed split as the force goes to zero; NaN where both axles slip alike. [-]"""
    p = split(road, np.array([1e-7]), nu)
    return float(p.mu_delta[0] / p.s_delta[0]) if abs(p.s_delta[0]) > 1e-12 else float("nan")
