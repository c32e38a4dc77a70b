"""Figures of a drive's slip slopes: slip over traction, the slope over the session, shares of the time."""

from __future__ import annotations

from typing import Any

import numpy as np

from aqualog.detect.slip_slope.direct_inputs import LEFT_OUT
from aqualog.detect.slip_slope.direct_records import DirectResult, PlaceSlope, Recursion
from aqualog.report.figures import axis, band, bars, dots, error_bars, figure, line
from aqualog.report.reduce import reduce_indices
from aqualog.report.theme import INK, MUTED, wheel_colour

__all__ = ["place_name", "slope_plots"]

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
    plots = {f"scatter-{i}": _scatter(p) for i, p in enumerate(p for p in result.places if p.line.samples)}
    recursions = [r for r in [p.recursion for p in result.places] or result.recursions if np.isfinite(r.slopes).any()]
    if any(p.segments for p in result.places):
        slopes = [s.line.slope for p in result.places for s in p.segments if s.line.told]
        limits = [0.0, _MOST * float(np.median(slopes)) if slopes else 100.0]
        parts = [_parts(p) for p in result.places if p.segments]
        plots["session"] = figure(parts, "slope of parts of the session", axis("time [min]"), axis("slope", limits))
    if recursions:
        values = np.concatenate([r.slopes[np.isfinite(r.slopes)] for r in recursions])
        limits = [0.0, 1.15 * float(np.quantile(values, 0.98))]
        courses = [_course(r) for r in recursions]
        plots["recursive"] = figure(courses, "recursive estimate", axis("time [min]"), axis("slope", limits))
    return {**plots, "share": _time_share(result)} if result.places else plots


def place_name(p: PlaceSlope | Recursion) -> str:
    """Return the name of a wheel or a side as pages show it."""
    return p.place.upper() if p.wheel else p.place


def _scatter(p: PlaceSlope) -> dict[str, Any]:
    """Slip over traction: samples, means of classes, and the line with its band."""
    colour = wheel_colour(p.wheel)
    step = max(1, -(-p.mu.size // _MOST_DOTS))
    mu, slip = p.mu[::step], 100.0 * p.slip[::step]
    # the more dots, the lighter each: where they lie on top of each other it gets dark
    opacity = float(np.clip(120.0 / max(mu.size, 1), 0.08, 0.6))
    data = [dots("samples", mu, slip, colour, style={"opacity": opacity}), _classes(p)]
    title = place_name(p) if p.wheel and p.line.told else p.place
    if p.line.told:
        data += _line_with_band(p, colour)
        title += f": slope {p.line.slope:.1f}"
    low, high = np.quantile(p.slip, (0.002, 0.998)) * 100.0
    margin = 0.1 * (high - low) + 0.02
    return figure(data, title, axis("traction coefficient μ"), axis("slip [%]", [low - margin, high + margin]))


def _line_with_band(p: PlaceSlope, colour: str) -> list[dict[str, Any]]:
    fit = p.line
    x = np.linspace(float(p.mu.min()), float(p.mu.max()), 41)
    # about the middle of the data the level is known best; there the lines of all slopes in the interval cross
    middle = float(p.mu.mean())
    level = fit.k * middle + fit.offset
    lower, upper = (100.0 * (level + k * (x - middle)) for k in fit.k_ci)
    return [
        band("95 % of the slope", x, np.minimum(lower, upper), np.maximum(lower, upper), colour),
        line(f"slope {fit.slope:.1f}", x, 100.0 * (fit.k * x + fit.offset), INK),
    ]


def _classes(p: PlaceSlope) -> dict[str, Any]:
    edges = np.linspace(float(p.mu.min()), float(p.mu.max()), _CLASSES + 1)
    which = np.clip(np.searchsorted(edges, p.mu, side="right") - 1, 0, _CLASSES - 1)
    groups = [g for g in (np.flatnonzero(which == i) for i in range(_CLASSES)) if g.size >= _LEAST]
    return dots(
        "means of classes", [p.mu[g].mean() for g in groups], [100.0 * p.slip[g].mean() for g in groups], INK, size=8,
        style={"symbol": "diamond", "line": {"color": MUTED, "width": 1}}, customdata=[int(g.size) for g in groups],
        hovertemplate="μ %{x:.3f}, slip %{y:.3f} %, %{customdata} samples<extra></extra>",
    )  # fmt: skip


def _parts(p: PlaceSlope) -> dict[str, Any]:
    """Slope of each part with its interval, over the middle of the part."""
    told = [s for s in p.segments if s.line.told]
    slope, low, high = (
        np.array(x) for x in ([s.line.slope for s in told], *([s.line.slope_ci[i] for s in told] for i in (0, 1)))
    )
    words = [[f"{a:.1f} ... {b:.1f}", f"{s.seconds:.0f} s used"] for a, b, s in zip(low, high, told, strict=True)]
    colour = wheel_colour(p.wheel)
    return line(
        place_name(p), [(s.start_s + s.end_s) / 120.0 for s in told], slope, colour, style={"dash": "dot"},
        mode="lines+markers", marker={"color": colour, "size": 8}, error_y=error_bars(slope, low, high, colour),
        customdata=words,
        hovertemplate="%{y:.1f} (95 %: %{customdata[0]}), %{customdata[1]}<extra>%{fullData.name}</extra>",
    )  # fmt: skip


def _course(r: Recursion) -> dict[str, Any]:
    """The recursive estimate over time."""
    # it holds its value between the stretches that are used: a line through them, not a dot here and there
    keep = np.flatnonzero(np.isfinite(r.slopes))
    keep = keep[reduce_indices(r.slopes[keep], _POINTS)]
    return line(
        place_name(r), r.t[keep] / 60.0, r.slopes[keep], wheel_colour(r.wheel), width=1.3, style={"shape": "hv"}
    )


def _time_share(result: DirectResult) -> dict[str, Any]:
    """Bars of seconds per place."""
    parts = [("used", _USED, [p.seconds for p in result.places])]
    parts += [
        (reason, colour, [p.left_out[reason] for p in result.places])
        for reason, colour in zip(LEFT_OUT, _COLOURS, strict=True)
    ]
    names = [place_name(p) for p in result.places]
    data = [
        bars(name, names, seconds, colour, hovertemplate="%{x:.0f} s<extra>" + name + "</extra>")
        for name, colour, seconds in parts
        if name == "used" or any(seconds)
    ]
    return figure(
        data, "time used and left out [s]", axis(), axis(autorange="reversed"), height=150 + 34 * len(names),
        barmode="stack", legend={"y": -0.3, "traceorder": "normal"},
    )  # fmt: skip
