"""Panels over one time axis: rows as data, one plotly figure of them, and beside it samples, bars and shades.

The page's script fills the figure from them, as many as the view can show: a figure with every sample of every trace,
or with an element for each of thousands of bars and events, would be slow to open and to zoom.
"""

from __future__ import annotations

import base64
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from aqualog.core.records import FloatArray
from aqualog.core.units import convert
from aqualog.report.figures import FRAME, plotly_figure
from aqualog.report.reduce import ALL_SAMPLES, Plan, Spans, make_plan, reduce_indices
from aqualog.report.theme import EVENT_SHADE, FULL_SHADE, GRID, INK, MUTED, OTHER_SHADE, THRESHOLD, WATER_SHADE
from aqualog.report.values import plot_text

if TYPE_CHECKING:
    import plotly.graph_objects as go

__all__ = ["VEHICLE", "Lane", "Line", "Row", "groups", "rows_figure", "stack"]

ABOVE = 30  # [px] room above a row for its title
TOP, BOTTOM = 58, 44  # [px] above the first row stand its title, the upper time axis and the buttons
_BAR = 0.36  # half the height of a lane's bar
VEHICLE = "vehicle"  # group of everything that belongs to no wheel


@dataclass(frozen=True, slots=True)
class Line:
    """One signal over time. Lines of one `group` are shown and hidden together.

    `units` are the values' and the axis's: of a long drive only the drawn values are converted.
    """

    label: str
    group: str
    colour: str
    values: FloatArray
    width: float = 1.3
    units: tuple[str, str] = ("-", "-")


@dataclass(frozen=True, slots=True)
class Lane:
    """One bit over time, drawn as bars."""

    label: str
    group: str
    colour: str
    spans: Spans


@dataclass(frozen=True, slots=True)
class Row:
    """One pair of axes in the stack.

    `caption` describes the row; `thresholds` are drawn dashed; the y axis always shows the values in `include` and
    never less than `least_span`; `shades` are index ranges marked by a strip along the bottom.
    """

    title: str
    caption: str
    unit: str
    lines: tuple[Line, ...] = ()
    lanes: tuple[Lane, ...] = ()
    thresholds: tuple[float, ...] = ()
    include: tuple[float, ...] = ()
    shades: Spans | None = None
    least_span: float = 0.0
    height: int = 120
    decimals: int = 2


def stack(rows: Sequence[Row], plan: Plan, dt: float) -> dict[str, Any]:
    """Figure, samples and the rows' data for the script.

    Returns
    -------
    dict
        `figure` (data, layout), `lines` (samples of the first traces of the figure, in their order), `lanes` (bars of
        the next ones), `rows` (y axis, what it must show), `shades` (of the events, by severity), `dt`, `n`, `windows`.
    """
    data: list[dict[str, Any]] = []
    lines: list[dict[str, Any]] = []
    for k, row in enumerate(rows):
        for line in row.lines:
            data.append(_line_trace(line, row, _axis(k)))
            lines.append({"row": k, **_samples(line, plan)})
    lanes = [(lane, len(row.lanes) - i, k) for k, row in enumerate(rows) for i, lane in enumerate(row.lanes)]
    data += [_lane_trace(lane, _axis(k)) for lane, _, k in lanes]
    data += [_lane_hover(_axis(k)) for k, row in enumerate(rows) if row.lanes]
    # plotly draws an axis only if a trace lies on it
    data.append({"type": "scatter", "x": [None], "y": [None], "xaxis": "x2", "yaxis": "y", "hoverinfo": "skip"})
    return {
        "dt": dt,
        "n": plan.n,
        "windows": plan.windows.tolist(),
        "lines": lines,
        "lanes": [{"level": level, "spans": _indices(lane.spans)} for lane, level, _ in lanes],
        "shades": {"other": OTHER_SHADE, "partial": EVENT_SHADE, "full": FULL_SHADE},
        "rows": [
            {
                "axis": _axis(k, "yaxis"),
                "title": plot_text(r.title),
                "decimals": r.decimals,
                "include": [*r.include, *r.thresholds],
                "thresholds": list(r.thresholds),
                "least_span": r.least_span,
                "has_lines": bool(r.lines),
                "strips": None if r.shades is None else {"colour": WATER_SHADE, "spans": _indices(r.shades)},
            }
            for k, r in enumerate(rows)
        ],
        "figure": {"data": data, "layout": _layout(rows, plan, dt)},
    }


def _axis(k: int, name: str = "y") -> str:
    return name if k == 0 else f"{name}{k + 1}"


def groups(rows: Sequence[Row]) -> list[str]:
    """Groups that hold any line, wheels first."""
    found = dict.fromkeys(g for r in rows for g in (*(x.group for x in r.lines), *(x.group for x in r.lanes)))
    return sorted(found, key=lambda g: g == VEHICLE)


def rows_figure(rows: Sequence[Row], n: int, dt: float) -> go.Figure:
    """Return the panels of a drive as one figure with one time axis.

    Parameters
    ----------
    rows : sequence of Row
    n : int
        Samples of the drive. A line with more than 20,000 is drawn by its minima and maxima.
    dt : float
        Sample time. [s]
    """
    found = stack(rows, make_plan((), n, dt), dt)["figure"]
    lines = [line for row in rows for line in row.lines]
    lanes = [(lane, len(row.lanes) - i) for row in rows for i, lane in enumerate(row.lanes)]
    data = [trace for trace in found["data"] if trace.get("meta") != "lanes"]
    for trace, line in zip(data, lines, strict=False):
        values = line.values
        index = np.arange(values.size) if values.size <= ALL_SAMPLES else reduce_indices(values)
        trace |= {"x": index * dt, "y": convert(values[index], *line.units)}
    for trace, (lane, level) in zip(data[len(lines) :], lanes, strict=False):
        low, high = level - _BAR, level + _BAR
        spans = (lane.spans * dt).tolist()
        trace["x"] = [x for begin, end in spans for x in (begin, begin, end, end, begin, None)]
        trace["y"] = [low, high, high, low, low, None] * len(spans)
    layout = dict(found["layout"])
    for k, row in enumerate(rows):
        if not row.lanes:
            layout[_axis(k, "yaxis")] |= {"autorange": True, "range": None}
    return plotly_figure({"data": data, "layout": layout})


# --- traces ----------------------------------------------------------------------------------------------------------


def _line_trace(line: Line, row: Row, axis: str) -> dict[str, Any]:
    name = plot_text(line.label)
    return {
        "type": "scatter", "mode": "lines", "name": name, "legendgroup": line.group, "xaxis": "x", "yaxis": axis,
        "line": {"color": line.colour, "width": line.width},
        "hovertemplate": f"{name}: %{{y:.{row.decimals}f}} {plot_text(row.unit)}<extra></extra>",
    }  # fmt: skip


def _lane_trace(lane: Lane, axis: str) -> dict[str, Any]:
    """All bars of a lane as one outline: an element for each bar would make thousands of them slow."""
    return {
        "type": "scatter", "mode": "lines", "meta": "bars", "name": plot_text(lane.label), "legendgroup": lane.group,
        "xaxis": "x", "yaxis": axis, "x": [], "y": [], "fill": "toself", "fillcolor": lane.colour,
        # the outline keeps a bar of one sample visible however far the view is zoomed out
        "line": {"color": lane.colour, "width": 1.2, "simplify": False}, "hoverinfo": "skip",
    }  # fmt: skip


def _lane_hover(axis: str) -> dict[str, Any]:
    """Invisible points across the lanes' row, which the script fills with the detectors active at each time.

    Plotly's own hover finds the wrong one among horizontal bars of different lanes.
    """
    return {
        "type": "scatter", "mode": "markers", "name": "", "meta": "lanes", "x": [], "y": [], "xaxis": "x",
        "yaxis": axis, "opacity": 0, "marker": {"color": "rgba(0,0,0,0)", "size": 1}, "hoverlabel": {"align": "left"},
        "hovertemplate": "%{customdata}<extra></extra>",
    }  # fmt: skip


# --- samples ---------------------------------------------------------------------------------------------------------


def _samples(line: Line, plan: Plan) -> dict[str, str]:
    """`full`: every value inside the windows; `index`, `value`: minima and maxima elsewhere. Base64, little-endian."""
    values = line.values
    index = np.empty(0, dtype=np.int64) if plan.is_complete else reduce_indices(values)
    for begin, end in plan.windows:
        index = np.delete(index, slice(*np.searchsorted(index, (begin, end))))
    inside = np.concatenate([values[:0], *(values[begin:end] for begin, end in plan.windows)])
    return {
        "full": _base64(_short(inside, line.units)),
        "index": _base64(index.astype("<u4")),
        "value": _base64(_short(values[index], line.units)),
    }


def _short(values: NDArray[np.float64], units: tuple[str, str]) -> NDArray[np.float32]:
    with np.errstate(over="ignore"):
        short = convert(values, *units).astype("<f4")
    short[~np.isfinite(short)] = np.nan
    return short


def _indices(spans: Spans) -> str:
    """First index and the one after the last of each span, one after the other."""
    return _base64(spans.astype("<u4"))


def _base64(array: NDArray[Any]) -> str:
    return base64.b64encode(array.tobytes()).decode("ascii")


# --- layout ----------------------------------------------------------------------------------------------------------


def _layout(rows: Sequence[Row], plan: Plan, dt: float) -> dict[str, Any]:
    domains = list(_domains(rows))
    time = _time_axis(max(plan.n, 1) * dt)
    thresholds = [(_axis(k), value) for k, row in enumerate(rows) for value in row.thresholds]
    return {
        **FRAME,
        "height": TOP + BOTTOM + sum(r.height + ABOVE for r in rows),
        "margin": {"l": 132, "r": 18, "t": TOP, "b": BOTTOM, "pad": 0},
        "showlegend": False,
        "hovermode": "x unified",
        "hoverdistance": 30,
        "spikedistance": -1,
        "hoverlabel": {"bgcolor": "@paper", "bordercolor": MUTED, "font": {"size": 12, "color": INK}},
        "dragmode": "zoom",
        "barmode": "overlay",
        "xaxis": {**time, "anchor": _axis(len(rows) - 1), "title": {"text": "time [s]"}},
        "xaxis2": {
            **time, "anchor": "y", "overlaying": "x", "matches": "x", "side": "top", "showgrid": False,
            "showspikes": False,
        },
        "shapes": [
            {"type": "line", "xref": "x domain", "x0": 0, "x1": 1, "yref": axis, "y0": value, "y1": value,
             "line": {"color": THRESHOLD, "width": 1.2, "dash": "dash"}}
            for axis, value in thresholds
        ],
        "annotations": [
            *(_title(row, domains[k][1], is_first=k == 0) for k, row in enumerate(rows)),
            *({"text": f"threshold {value:g}", "xref": "x domain", "x": 1, "yref": axis, "y": value, "xanchor": "right",
               "yanchor": "bottom", "showarrow": False, "font": {"size": 10, "color": THRESHOLD}}
              for axis, value in thresholds),
        ],
        **{_axis(k, "yaxis"): _row_axis(row, domains[k]) for k, row in enumerate(rows)},
    }  # fmt: skip


def _domains(rows: Sequence[Row]) -> Iterator[tuple[float, float]]:
    """Share of the height of each row, from the top; each has its title's room above it but the first."""
    heights = [r.height + (ABOVE if k else 0) for k, r in enumerate(rows)]
    edges = 1.0 - np.concatenate([[0.0], np.cumsum(heights)]) / sum(heights)
    for k, (upper, lower) in enumerate(pairwise(edges)):
        room = ABOVE / sum(heights) if k else 0.0
        yield max(0.0, round(float(lower), 9)), round(float(upper) - room, 9)


def _time_axis(duration: float) -> dict[str, Any]:
    return {
        "range": [0.0, duration], "autorange": False, "gridcolor": GRID, "zeroline": False, "showline": True,
        "linecolor": MUTED, "ticks": "outside", "tickcolor": MUTED, "ticklen": 4, "hoverformat": ".3f",
        "unifiedhovertitle": {"text": "%{x:.3f} s"}, "exponentformat": "none", "showspikes": True,
        "spikemode": "across", "spikesnap": "cursor", "spikethickness": 1, "spikedash": "solid", "spikecolor": MUTED,
    }  # fmt: skip


def _row_axis(row: Row, domain: tuple[float, float]) -> dict[str, Any]:
    shared = {
        "domain": list(domain), "anchor": "x", "gridcolor": GRID, "showline": True, "linecolor": MUTED,
        "autorange": False,
    }  # fmt: skip
    count = len(row.lanes)
    if count:
        return shared | {
            "range": [0.4, count + 0.6], "fixedrange": True, "tickmode": "array",
            "tickvals": [count - i for i in range(count)],
            "ticktext": [plot_text(lane.label, 22) for lane in row.lanes], "tickfont": {"size": 11}, "showgrid": True,
            "zeroline": False,
        }  # fmt: skip
    return shared | {
        "title": {"text": plot_text(row.unit, 16), "standoff": 6}, "zeroline": True,
        "zerolinecolor": "rgba(128,128,128,0.55)", "zerolinewidth": 1, "nticks": 5, "range": [0.0, 1.0],
        "exponentformat": "power",
    }  # fmt: skip


def _title(row: Row, y: float, *, is_first: bool) -> dict[str, Any]:
    return {
        "text": f"<b>{plot_text(row.title)}</b> – {plot_text(row.caption)}", "xref": "paper", "x": 0, "yref": "paper",
        "y": y, "xanchor": "left", "yanchor": "bottom",
        # the upper time axis stands between the first row and its title
        "yshift": 18 if is_first else 1, "showarrow": False, "align": "left", "font": {"size": 12, "color": INK},
    }  # fmt: skip
