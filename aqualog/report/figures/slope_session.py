"""The slip slope over the session: parts with their intervals, and the recursive estimate."""

from __future__ import annotations

from typing import Any

import numpy as np

from aqualog.detect.slip_slope.direct_records import DirectResult, PlaceSlope, Recursion
from aqualog.report.figures.slope_axes import axis, layout, rounded
from aqualog.report.reduce import reduce_indices
from aqualog.report.theme import wheel_colour

__all__ = ["recursive_estimate", "slope_over_session"]

_POINTS = 3000
_MOST = 3.0  # times the middle slope: an interval that reaches farther leaves the picture


def slope_over_session(result: DirectResult) -> dict[str, Any] | None:
    """Slope of each part with its interval, over the middle of the part; None without parts."""
    data = [t for p in result.places if p.segments for t in _parts(p)]
    if not data:
        return None
    slopes = [s.line.slope for p in result.places for s in p.segments if s.line.told]
    top = _MOST * float(np.median(slopes)) if slopes else 100.0
    return {"data": data, "layout": layout("slope of parts of the session", _minutes(), axis("slope", [0.0, top]))}


def _parts(p: PlaceSlope) -> list[dict[str, Any]]:
    told = [s for s in p.segments if s.line.told]
    middle = np.array([(s.start_s + s.end_s) / 120.0 for s in told])
    slope = np.array([s.line.slope for s in told])
    low, high = (np.array([s.line.slope_ci[i] for s in told]) for i in (0, 1))
    words = [[f"{a:.1f} ... {b:.1f}", f"{s.seconds:.0f} s used"] for a, b, s in zip(low, high, told, strict=True)]
    return [
        {
            "type": "scatter", "mode": "lines+markers", "name": p.place.upper() if p.wheel else p.place,
            "x": rounded(middle), "y": rounded(slope), "line": {"color": wheel_colour(p.wheel), "dash": "dot"},
            "marker": {"color": wheel_colour(p.wheel), "size": 8},
            "error_y": {"type": "data", "symmetric": False, "array": rounded(high - slope),
                        "arrayminus": rounded(slope - low), "color": wheel_colour(p.wheel), "thickness": 1.5},
            "customdata": words,
            "hovertemplate": "%{y:.1f} (95 %: %{customdata[0]}), %{customdata[1]}<extra>%{fullData.name}</extra>",
        }
    ]  # fmt: skip


def recursive_estimate(result: DirectResult) -> dict[str, Any] | None:
    """The recursive estimate over time; None if it never had a value."""
    recursions = [p.recursion for p in result.places] or list(result.recursions)
    data = [_course(r) for r in recursions if np.isfinite(r.slopes).any()]
    if not data:
        return None
    values = np.concatenate([r.slopes[np.isfinite(r.slopes)] for r in recursions])
    top = 1.15 * float(np.quantile(values, 0.98))
    return {"data": data, "layout": layout("recursive estimate", _minutes(), axis("slope", [0.0, top]))}


def _course(r: Recursion) -> dict[str, Any]:
    # it holds its value between the stretches that are used: a line through them, not a dot here and there
    keep = np.flatnonzero(np.isfinite(r.slopes))
    keep = keep[reduce_indices(r.slopes[keep], _POINTS)]
    return {
        "type": "scatter", "mode": "lines", "name": r.place.upper() if r.wheel else r.place,
        "x": rounded(r.t[keep] / 60.0), "y": rounded(r.slopes[keep]),
        "line": {"color": wheel_colour(r.wheel), "width": 1.3, "shape": "hv"},
    }  # fmt: skip


def _minutes() -> dict[str, Any]:
    return axis("time [min]")
