"""Speed at which a curve over speed bins passes a level, with the interval that its band gives."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from aqualog.report.campaign_findings import Curve, Point

__all__ = ["Crossing", "crossing"]


@dataclass(frozen=True, slots=True)
class Crossing:
    """`v_kmh` where the level is passed for the first time, NaN if it is not; `ci` where the ends of the band pass it
    (an end that does not is infinite). `to_kmh`: speed up to which there are values.
    """

    v_kmh: float
    ci: tuple[float, float]
    to_kmh: float


def crossing(curve: Curve, level: float, *, rising: bool) -> Crossing | None:
    """Interpolate linearly between the bins that have an interval; None with fewer than two of them.

    Parameters
    ----------
    curve : Curve
    level : float
        In the unit of the curve.
    rising : bool
        Whether the level is passed from below.
    """
    points = [p for p in curve.points if p.reliable]
    if len(points) < 2:
        return None
    # the end of the band that passes first gives the lower speed
    first, last = (1, 0) if rising else (0, 1)
    low = _passed(points, [p.ci[first] for p in points], level, rising=rising)
    high = _passed(points, [p.ci[last] for p in points], level, rising=rising)
    middle = _passed(points, [p.value for p in points], level, rising=rising)
    begin = points[0].v_kmh
    return Crossing(
        middle, (-math.inf if low == begin else low, math.inf if math.isnan(high) else high), points[-1].v_kmh
    )


def _passed(points: Sequence[Point], values: Sequence[float], level: float, *, rising: bool) -> float:
    """Speed at which values reach the level; the first point's if they have already; NaN if they do not."""
    sign = 1.0 if rising else -1.0
    above = [sign * (v - level) for v in values]
    if above[0] >= 0.0:
        return points[0].v_kmh
    for i in range(1, len(above)):
        if above[i] >= 0.0:
            share = above[i - 1] / (above[i - 1] - above[i])
            return points[i - 1].v_kmh + share * (points[i].v_kmh - points[i - 1].v_kmh)
    return math.nan
