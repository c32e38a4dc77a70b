"""Panels into plotly figures, as plain dicts; colours that begin with @ are set by the page for light and dark."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.core.units import displayed_text
from aqualog.report.theme import GRID, INK, MUTED
from aqualog.report.values import plot_text
from aqualog.thesis.record import Axis, Line, Note, Panel, Sheet

__all__ = ["panel_figure", "rounded"]

PLOT_PX = 380  # height without the legend
_WIDTH_PX = 524.0  # of the legend in a narrow panel
_SAMPLES = 100.0  # behind a dot of `_DOT_PX`
_DOT_PX = 12.0
_DIGITS = 6


def panel_figure(panel: Panel) -> dict[str, Any]:
    """One panel as `data` and `layout` of plotly."""
    is_solid = panel.z is not None
    data = [_sheet(s) for s in panel.sheets] + [_line(line, is_solid=is_solid) for line in panel.lines]
    return {"data": data, "layout": _layout(panel)}


def rounded(values: FloatArray) -> list[float | None]:
    """Numbers with six digits, None for NaN."""
    return [None if math.isnan(v) else float(f"{v:.{_DIGITS}g}") for v in np.asarray(values, dtype=np.float64).tolist()]


def _text(text: str) -> str:
    return plot_text(displayed_text(text))


def _line(line: Line, *, is_solid: bool) -> dict[str, Any]:
    # a line in space looks half as wide as one in the plane
    trace: dict[str, Any] = {
        "type": "scatter3d" if is_solid else "scatter",
        "name": _text(line.name),
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
    if line.low is not None and line.high is not None:
        trace["error_y"] = {
            "type": "data", "symmetric": False, "array": _bars(line.high - line.y),
            "arrayminus": _bars(line.y - line.low), "color": line.colour, "thickness": 1.2, "width": 3,
        }  # fmt: skip
    if line.is_filled:
        trace |= {"fill": "tozeroy", "fillcolor": _pale(line.colour)}
    if line.group:
        trace["legendgroup"] = line.group
    if line.count is not None:
        trace["customdata"] = rounded(line.count)
        trace["hovertemplate"] = "%{customdata} samples<extra>%{fullData.name}</extra>"
    return trace


def _bars(lengths: FloatArray) -> list[float]:
    """Lengths of bars; 0 without an interval, since plotly's drawing of null is undefined."""
    return [0.0 if v is None else max(v, 0.0) for v in rounded(lengths)]


def _pale(colour: str) -> str:
    """A colour as it fills an area."""
    if not colour.startswith("#"):
        return GRID
    r, g, b = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return f"rgba({r},{g},{b},0.25)"


def _note(note: Note) -> dict[str, Any]:
    words = {
        "x": note.x,
        "y": note.y,
        "text": displayed_text(note.text),
        "font": {"size": note.size, "color": note.colour},
    }
    if note.tail is None:
        return words | {"showarrow": False}
    x, y = note.tail
    return words | {
        "showarrow": True, "ax": x, "ay": y, "axref": "x", "ayref": "y", "arrowhead": 2, "arrowwidth": 1.4,
        "arrowcolor": note.colour,
    }  # fmt: skip


def _sizes(line: Line, *, is_solid: bool) -> float | list[float]:
    scale = 0.6 if is_solid else 1.0
    if line.count is None or not line.count.size:
        return line.size * scale
    # the area of a dot is its number of samples, alike in all panels
    return [round(max(_DOT_PX * math.sqrt(c / _SAMPLES), 2.0), 2) for c in line.count.tolist()]


def _sheet(sheet: Sheet) -> dict[str, Any]:
    return {
        "type": "surface",
        "name": _text(sheet.name),
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
        "title": {"text": _text(axis.title), "font": {"size": 12}},
        "gridcolor": GRID,
        "zerolinecolor": MUTED,
        "linecolor": MUTED,
        "tickcolor": MUTED,
        "tickfont": {"size": 11},
    }
    if axis.log_base:
        # a tick an octave or a decade
        out |= {"type": "log", "dtick": math.log10(axis.log_base)}
    if axis.limits is not None:
        out["range"] = [math.log10(v) if axis.log_base else v for v in axis.limits]
    return out


def _legend_px(panel: Panel) -> int:
    """Height of the legend, with its entries set in lines."""
    rows, used = 1, 0.0
    for name in [s.name for s in panel.sheets] + [line.name for line in panel.lines if line.in_legend]:
        width = 45.0 + 5.5 * len(_text(name))
        if used + width > _WIDTH_PX and used > 0.0:
            rows, used = rows + 1, 0.0
        used += width
    return 10 + 19 * rows


def _layout(panel: Panel) -> dict[str, Any]:
    legend = _legend_px(panel)
    layout: dict[str, Any] = {
        "font": {"color": INK, "size": 12, "family": 'system-ui, "Segoe UI", Helvetica, Arial, sans-serif'},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "height": PLOT_PX + legend,
        "margin": {"l": 60, "r": 16, "t": 26, "b": 52 + legend},
        "legend": {
            "orientation": "h",
            "x": 0,
            "y": 0,
            "yref": "container",
            "yanchor": "bottom",
            "font": {"size": 11},
            "itemsizing": "constant",
        },
        "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": MUTED, "activecolor": INK},
        "hovermode": "closest",
    }
    if panel.z is None:
        layout["xaxis"] = _axis(panel.x)
        layout["yaxis"] = _axis(panel.y)
        layout["annotations"] = [_note(n) for n in panel.notes]
        if panel.is_diagram:
            layout |= {"showlegend": False, "hovermode": False}
            for axis in ("xaxis", "yaxis"):
                layout[axis] |= {"visible": False}
        return layout
    layout["height"] += 60
    layout["margin"] = {"l": 0, "r": 0, "t": 20, "b": legend}
    layout["scene"] = {
        "xaxis": _axis(panel.x),
        "yaxis": _axis(panel.y),
        "zaxis": _axis(panel.z),
        "aspectmode": "cube",
        "camera": {"eye": {"x": -1.45, "y": -1.5, "z": 0.8}, "center": {"x": 0, "y": 0, "z": -0.12}},
    }
    return layout
