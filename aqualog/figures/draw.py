"""Panels into plotly figures, as plain dicts; colours that begin with @ are set by the page for light and dark."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from aqualog.figures.record import Axis, Line, Panel, Sheet
from aqualog.report.theme import GRID, INK, MUTED
from aqualog.types import FloatArray

__all__ = ["HEIGHT_PX", "panel_figure", "rounded"]

HEIGHT_PX = 430
_LARGEST_PX = 16.0  # dot with the most samples
_DIGITS = 6


def panel_figure(panel: Panel) -> dict[str, Any]:
    """One panel as `data` and `layout` of plotly."""
    is_solid = panel.z is not None
    data = [_sheet(s) for s in panel.sheets] + [_line(line, is_solid=is_solid) for line in panel.lines]
    return {"data": data, "layout": _layout(panel)}


def rounded(values: FloatArray) -> list[float | None]:
    """Numbers with six digits, None for NaN."""
    return [None if math.isnan(v) else float(f"{v:.{_DIGITS}g}") for v in np.asarray(values, dtype=np.float64).tolist()]


def _line(line: Line, *, is_solid: bool) -> dict[str, Any]:
    # plotly has no dashes "dash" and markers in one name for both kinds of trace; widths in 3-D are about doubled
    trace: dict[str, Any] = {
        "type": "scatter3d" if is_solid else "scatter",
        "name": line.name,
        "mode": line.mode,
        "x": rounded(line.x),
        "y": rounded(line.y),
        "line": {"color": line.colour, "dash": line.dash, "width": line.width * (2.0 if is_solid else 1.0)},
        "marker": {"color": line.colour, "size": _sizes(line, is_solid=is_solid), "symbol": line.symbol,
                   "line": {"width": 0}},
        "opacity": line.opacity,
        "showlegend": line.in_legend,
        "connectgaps": False,
    }  # fmt: skip
    if is_solid and line.z is not None:
        trace["z"] = rounded(line.z)
    if line.group:
        trace["legendgroup"] = line.group
    if line.count is not None:
        trace["customdata"] = rounded(line.count)
        trace["hovertemplate"] = "%{customdata} samples<extra>%{fullData.name}</extra>"
    return trace


def _sizes(line: Line, *, is_solid: bool) -> float | list[float]:
    scale = 0.6 if is_solid else 1.0
    if line.count is None or not line.count.size:
        return line.size * scale
    # the area of a dot is its number of samples
    largest = float(line.count.max())
    return [round(max(_LARGEST_PX * math.sqrt(c / largest), 1.5), 2) for c in line.count.tolist()]


def _sheet(sheet: Sheet) -> dict[str, Any]:
    return {
        "type": "surface",
        "name": sheet.name,
        "x": rounded(sheet.x),
        "y": rounded(sheet.y),
        "z": [rounded(row) for row in sheet.z],
        "colorscale": [[0, sheet.colour], [1, sheet.colour]],
        "showscale": False,
        "showlegend": True,
        "opacity": 0.45,
        "hoverinfo": "skip",
        "contours": {"x": {"highlight": False}, "y": {"highlight": False}, "z": {"highlight": False}},
    }


def _axis(axis: Axis) -> dict[str, Any]:
    out: dict[str, Any] = {
        "title": {"text": axis.title, "font": {"size": 12}},
        "gridcolor": GRID,
        "zerolinecolor": MUTED,
        "linecolor": MUTED,
        "tickcolor": MUTED,
        "tickfont": {"size": 11},
    }
    if axis.is_log:
        # octaves, not decades
        out |= {"type": "log", "dtick": math.log10(2.0)}
    if axis.limits is not None:
        out["range"] = [math.log10(v) if axis.is_log else v for v in axis.limits]
    return out


def _layout(panel: Panel) -> dict[str, Any]:
    layout: dict[str, Any] = {
        "title": {"text": panel.title, "font": {"size": 14}, "x": 0.01, "xanchor": "left", "y": 0.985, "yanchor": "top"},
        "font": {"color": INK, "size": 12, "family": 'system-ui, "Segoe UI", Helvetica, Arial, sans-serif'},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "height": HEIGHT_PX,
        "margin": {"l": 60, "r": 16, "t": 34, "b": 50},
        "legend": {"orientation": "h", "x": 0, "y": -0.2, "yanchor": "top", "font": {"size": 11}},
        "hovermode": "closest",
    }
    if panel.z is None:
        layout["xaxis"] = _axis(panel.x)
        layout["yaxis"] = _axis(panel.y)
        return layout
    layout["margin"] = {"l": 0, "r": 0, "t": 34, "b": 0}
    layout["legend"]["y"] = 0.0
    layout["scene"] = {
        "xaxis": _axis(panel.x),
        "yaxis": _axis(panel.y),
        "zaxis": _axis(panel.z),
        "aspectmode": "cube",
        "camera": {"eye": {"x": -1.5, "y": -1.6, "z": 0.9}},
    }
    return layout
