"""Figures of a drive's slip slopes: slip over traction, the slope over the session, shares of the time."""

from __future__ import annotations

from typing import Any

import numpy as np

from aqualog.detect.slip_slope.direct_inputs import LEFT_OUT
from aqualog.detect.slip_slope.direct_records import DirectResult, PlaceSlope, Recursion
from aqualog.report.axes import axis, layout, rounded, see_through
from aqualog.report.reduce import reduce_indices
from aqualog.report.theme import INK, MUTED, wheel_colour

__all__ = ["slope_plots"]

_MOST_DOTS = 4000  # per place; more are thinned evenly in time
_CLASSES = 14
_LEAST = 10  # samples of a class
_POINTS = 3000
_MOST = 3.0  # times the middle slope: an interval that reaches farther leaves the picture
_USED = "#009E73"
# one for each reason, in their order; light ones for what is outside the task, dark ones for what the choice leaves out
_COLOURS = (
    "#BBBBBB", "#D9D9D9", "#E69F00", "#D55E00", "#B2182B", "#7F6BB3", "#0072B2", "#56B4E9", "#8C6D31",
)  # fmt: skip


def slope_plots(result: DirectResult) -> dict[str, Any]:
    """The figures by name; those without content are left out."""
    plots: dict[str, Any] = {f"scatter-{i}": figure for i, figure in enumerate(_scatters(result))}
    plots |= {
        "session": _over_session(result),
        "recursive": _recursive(result),
        "share": _time_share(result),
    }
    return {name: figure for name, figure in plots.items() if figure is not None}


def _scatters(result: DirectResult) -> list[dict[str, Any]]:
    """One plotly figure per place."""
    return [_figure(p) for p in result.places if p.line.samples]


def _figure(p: PlaceSlope) -> dict[str, Any]:
    colour = wheel_colour(p.wheel)
    step = max(1, -(-p.mu.size // _MOST_DOTS))
    mu, slip = p.mu[::step], 100.0 * p.slip[::step]
    # the more dots, the lighter each: where they lie on top of each other it gets dark
    opacity = float(np.clip(120.0 / max(mu.size, 1), 0.08, 0.6))
    data: list[dict[str, Any]] = [
        {
            "type": "scatter", "mode": "markers", "name": "samples", "x": rounded(mu), "y": rounded(slip),
            "marker": {"color": colour, "size": 5, "opacity": opacity}, "hoverinfo": "skip",
        },
        _classes(p),
    ]  # fmt: skip
    if p.line.told:
        data += _line_with_band(p, colour)
    low, high = np.quantile(p.slip, (0.002, 0.998)) * 100.0
    margin = 0.1 * (high - low) + 0.02
    title = f"{p.place.upper() if p.wheel else p.place}: slope {p.line.slope:.1f}" if p.line.told else p.place
    return {
        "data": data,
        "layout": layout(title, axis("traction coefficient μ"), axis("slip [%]", [low - margin, high + margin])),
    }


def _line_with_band(p: PlaceSlope, colour: str) -> list[dict[str, Any]]:
    line = p.line
    ends = np.array([float(p.mu.min()), float(p.mu.max())])
    x = np.linspace(ends[0], ends[1], 41)
    # about the middle of the data the level is known best; there the lines of all slopes in the interval cross
    middle = float(p.mu.mean())
    level = line.k * middle + line.offset
    lower, upper = (level + k * (x - middle) for k in line.k_ci)
    band = np.concatenate([np.maximum(lower, upper), np.minimum(lower, upper)[::-1]])
    return [
        {
            "type": "scatter", "mode": "lines", "name": "95 % of the slope", "x": rounded(np.concatenate([x, x[::-1]])),
            "y": rounded(100.0 * band), "fill": "toself", "fillcolor": see_through(colour), "line": {"width": 0},
            "hoverinfo": "skip",
        },
        {
            "type": "scatter", "mode": "lines", "name": f"slope {line.slope:.1f}", "x": rounded(x),
            "y": rounded(100.0 * (line.k * x + line.offset)), "line": {"color": INK, "width": 2},
        },
    ]  # fmt: skip


def _classes(p: PlaceSlope) -> dict[str, Any]:
    edges = np.linspace(float(p.mu.min()), float(p.mu.max()), _CLASSES + 1)
    which = np.clip(np.searchsorted(edges, p.mu, side="right") - 1, 0, _CLASSES - 1)
    groups = [np.flatnonzero(which == i) for i in range(_CLASSES)]
    groups = [g for g in groups if g.size >= _LEAST]
    return {
        "type": "scatter", "mode": "markers", "name": "means of classes",
        "x": rounded(np.array([p.mu[g].mean() for g in groups])),
        "y": rounded(np.array([100.0 * p.slip[g].mean() for g in groups])),
        "customdata": [int(g.size) for g in groups],
        "hovertemplate": "μ %{x:.3f}, slip %{y:.3f} %, %{customdata} samples<extra></extra>",
        "marker": {"color": INK, "size": 8, "symbol": "diamond", "line": {"color": MUTED, "width": 1}},
    }  # fmt: skip


def _over_session(result: DirectResult) -> dict[str, Any] | None:
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


def _recursive(result: DirectResult) -> dict[str, Any] | None:
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


def _time_share(result: DirectResult) -> dict[str, Any] | None:
    """Bars of seconds per place; None without places."""
    if not result.places:
        return None
    names = [p.place.upper() if p.wheel else p.place for p in result.places]
    parts = [("used", _USED, [p.seconds for p in result.places])]
    parts += [
        (reason, colour, [p.left_out[reason] for p in result.places])
        for reason, colour in zip(LEFT_OUT, _COLOURS, strict=True)
        if any(p.left_out[reason] > 0.0 for p in result.places)
    ]
    data = [
        {
            "type": "bar", "orientation": "h", "name": name, "y": names, "x": [round(s, 2) for s in seconds],
            "marker": {"color": colour},
            "hovertemplate": "%{x:.0f} s<extra>" + name + "</extra>",
        }
        for name, colour, seconds in parts
    ]  # fmt: skip
    figure = layout("time used and left out [s]", axis(""), axis(""), height=150 + 34 * len(names))
    figure["barmode"] = "stack"
    figure["legend"]["y"] = -0.3
    figure["legend"]["traceorder"] = "normal"
    figure["yaxis"]["autorange"] = "reversed"
    return {"data": data, "layout": figure}
