"""Figures as plain data of plotly: axes, layout, lines, dots, bands, bars and heat maps in the colours of the pages."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.report.theme import GRID, INK, LIGHT, MUTED, in_light
from aqualog.report.values import plot_text

if TYPE_CHECKING:
    import plotly.graph_objects as go

__all__ = [
    "FRAME", "GOOD_TO_BAD", "PALETTE", "axis", "band", "bars", "dots", "error_bars", "figure", "heat", "layout",
    "line", "plotly_figure", "rounded", "see_through", "side_by_side",
]  # fmt: skip

Figure = dict[str, Any]
Numbers = FloatArray | Sequence[float | None]
_CLEAR = "rgba(0,0,0,0)"
# Okabe and Ito's palette [okabe2008], and two colours more
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7F6BB3", "#8C6D31")
GOOD_TO_BAD = ((0.0, "#B2182B"), (0.5, "#F4D9A8"), (1.0, "#2B7A4B"))
FRAME: Mapping[str, Any] = {
    "font": {"color": INK, "size": 12, "family": 'system-ui, "Segoe UI", Helvetica, Arial, sans-serif'},
    "paper_bgcolor": _CLEAR,
    "plot_bgcolor": _CLEAR,
    "modebar": {"bgcolor": _CLEAR, "color": MUTED, "activecolor": INK},
}
"""What the layouts of all figures have."""


def rounded(values: Numbers, digits: int = 5) -> list[float | None]:
    """Numbers with so many significant digits, None for NaN and infinities."""
    found = np.asarray(values, dtype=np.float64).tolist()
    return [float(f"{v:.{digits}g}") if math.isfinite(v) else None for v in found]


def see_through(colour: str, opacity: float = 0.22) -> str:
    """`#0072B2` as rgba; grey for a colour that the page sets."""
    if not colour.startswith("#"):
        return f"rgba(128,128,128,{opacity})"
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return f"rgba({red},{green},{blue},{opacity})"


# --- axes and layout -------------------------------------------------------------------------------------------------


def axis(title: str = "", limits: Sequence[float] | None = None, **more: Any) -> dict[str, Any]:
    """An axis in the page's colours; `more` as plotly takes it."""
    out = {
        "title": {"text": title, "font": {"size": 12}}, "gridcolor": GRID, "zerolinecolor": MUTED, "linecolor": MUTED,
        "tickcolor": MUTED, "tickfont": {"size": 11}, **more,
    }  # fmt: skip
    if limits is not None:
        out["range"] = [float(f"{v:.6g}") for v in limits]
    return out


def layout(title: str, x: dict[str, Any], y: dict[str, Any], *, height: int = 400, **more: Any) -> dict[str, Any]:
    """A layout with one pair of axes; a mapping in `more` is laid over the one that is there."""
    out: dict[str, Any] = {
        "title": {"text": title, "font": {"size": 14}, "x": 0.01, "y": 0.985, "yanchor": "top"},
        **FRAME,
        "height": height,
        "margin": {"l": 60, "r": 16, "t": 34, "b": 50},
        "legend": {"orientation": "h", "x": 0, "y": -0.18, "yanchor": "top", "font": {"size": 11}},
        "hovermode": "closest",
        "xaxis": x,
        "yaxis": y,
    }
    return out | {k: {**out.get(k, {}), **v} if isinstance(v, dict) else v for k, v in more.items()}


def figure(data: Sequence[dict[str, Any]], title: str, x: dict[str, Any], y: dict[str, Any], **more: Any) -> Figure:
    """Traces with their layout."""
    return {"data": list(data), "layout": layout(title, x, y, **more)}


# --- traces ----------------------------------------------------------------------------------------------------------


def line(name: str, x: Numbers, y: Numbers, colour: str, *, width: float = 2, style: Any = None, **more: Any) -> Figure:
    """A line; `style` are further settings of plotly's line."""
    return {
        "type": "scatter", "mode": "lines", "name": plot_text(name), "x": rounded(x), "y": rounded(y),
        "line": {"color": colour, "width": width, **(style or {})}, **more,
    }  # fmt: skip


def dots(name: str, x: Numbers, y: Numbers, colour: Any, *, size: float = 5, style: Any = None, **more: Any) -> Figure:
    """Markers; without a text when the pointer is over them, unless `hovertemplate` is given."""
    hover = {} if "hovertemplate" in more else {"hoverinfo": "skip"}
    return {
        "type": "scatter", "mode": "markers", "name": plot_text(name), "x": rounded(x), "y": rounded(y),
        "marker": {"color": colour, "size": size, **(style or {})}, **hover, **more,
    }  # fmt: skip


def band(name: str, x: Numbers, low: Numbers, high: Numbers, colour: str, opacity: float = 0.22) -> Figure:
    """The area between two lines."""
    x, low, high = rounded(x), rounded(low), rounded(high)
    return line(
        name, [*x, *x[::-1]], [*high, *low[::-1]], colour, fill="toself", fillcolor=see_through(colour, opacity),
        hoverinfo="skip", style={"width": 0},
    )  # fmt: skip


def bars(name: str, y: Sequence[str], x: Numbers, colour: str, **more: Any) -> Figure:
    """Horizontal bars."""
    return {
        "type": "bar", "orientation": "h", "name": plot_text(name), "y": list(y), "x": rounded(x),
        "marker": {"color": colour}, **more,
    }  # fmt: skip


def error_bars(y: FloatArray, low: FloatArray, high: FloatArray, colour: str) -> dict[str, Any]:
    """The interval of each point of a line."""
    return {
        "type": "data", "symmetric": False, "array": rounded(high - y), "arrayminus": rounded(y - low),
        "color": colour, "thickness": 1.5,
    }  # fmt: skip


def heat(
    x: Sequence[str], y: Sequence[str], z: Sequence[Sequence[float | None]], text: Sequence[Sequence[str]],
    limits: tuple[float, float], scale: Sequence[tuple[float, str]], **more: Any,
) -> Figure:  # fmt: skip
    """Cells of two categories by colour."""
    return {
        "type": "heatmap", "x": list(x), "y": list(y), "z": z, "text": text, "zmin": limits[0], "zmax": limits[1],
        "colorscale": [list(s) for s in scale], "xgap": 1, "ygap": 1, "hoverongaps": False, **more,
    }  # fmt: skip


# --- plotly's own figures --------------------------------------------------------------------------------------------


def plotly_figure(found: Mapping[str, Any]) -> go.Figure:
    """A figure as plotly's own, in light colours: for a notebook, or to be changed and saved."""
    import plotly.graph_objects as go

    light = in_light({"data": list(found["data"]), "layout": dict(found["layout"])})
    made = go.Figure(light, skip_invalid=True)
    made.update_layout(paper_bgcolor=LIGHT["@paper"], plot_bgcolor=LIGHT["@paper"])
    return made


def side_by_side(found: Sequence[Mapping[str, Any]], *, columns: int = 2) -> go.Figure:
    """Several figures as the panels of one."""
    from plotly.subplots import make_subplots

    figures = [plotly_figure(f) for f in found]
    if len(figures) == 1:
        return figures[0]
    columns = max(1, min(columns, len(figures)))
    rows = max(1, -(-len(figures) // columns))
    titles = [(f.layout.title.text or "") for f in figures]
    named: set[str] = set()
    made = make_subplots(rows=rows, cols=columns, subplot_titles=titles)
    for i, one in enumerate(figures):
        row, column = i // columns + 1, i % columns + 1
        for trace in one.data:
            if trace.type in ("scatter", "bar"):  # one entry in the legend for all panels
                trace.update(showlegend=bool(trace.name) and trace.name not in named, legendgroup=trace.name)
                named.add(trace.name)
            made.add_trace(trace, row=row, col=column)
        made.update_xaxes(one.layout.xaxis, row=row, col=column)
        made.update_yaxes(one.layout.yaxis, row=row, col=column)
    made.update_layout(
        paper_bgcolor=LIGHT["@paper"], plot_bgcolor=LIGHT["@paper"], height=380 * rows, showlegend=True,
        legend={"orientation": "h", "y": -0.2 / rows, "yanchor": "top"},
        barmode=next((f.layout.barmode for f in figures if f.layout.barmode), None),
    )  # fmt: skip
    return made
