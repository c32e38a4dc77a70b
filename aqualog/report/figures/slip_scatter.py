"""Slip over traction of each place: samples, means of classes, line with its band."""

from __future__ import annotations

from typing import Any

import numpy as np

from aqualog.detect.slip_slope.direct_records import DirectResult, PlaceSlope
from aqualog.report.figures.slope_axes import axis, layout, rounded, see_through
from aqualog.report.theme import INK, MUTED, wheel_colour

__all__ = ["slip_scatter"]

_MOST_DOTS = 4000  # per place; more are thinned evenly in time
_CLASSES = 14
_LEAST = 10  # samples of a class


def slip_scatter(result: DirectResult) -> list[dict[str, Any]]:
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
