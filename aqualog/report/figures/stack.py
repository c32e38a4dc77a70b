"""Rows into one plotly figure with one time axis, and the samples apart from it.

The page's script fills the traces from the samples, as many as the view needs: a figure with every sample of every
trace would be slow to zoom.
"""

from __future__ import annotations

import base64
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aqualog.report.figures.row import VEHICLE, Lane, Line, Row
from aqualog.report.reduce import Plan, Spans, merge_spans, reduce_indices
from aqualog.report.theme import EVENT_SHADE, FULL_SHADE, GRID, INK, MUTED, THRESHOLD, WATER_SHADE
from aqualog.report.wording import plot_text
from aqualog.types import Event

__all__ = ["groups", "stack"]

ABOVE = 30  # [px] room above a row for its title
TOP, BOTTOM = 58, 44  # [px] above the first row stand its title, the upper time axis and the buttons
MOST_SHADES = 150


def stack(rows: Sequence[Row], events: Sequence[Event], plan: Plan, dt: float) -> dict[str, Any]:
    """Figure, samples and what the script must know of the rows.

    Returns
    -------
    dict
        `figure` (data, layout), `lines` (samples of the first traces of the figure, in their order), `rows` (y axis,
        what it must show), `dt`, `n`, `windows`.
    """
    data: list[dict[str, Any]] = []
    lines: list[dict[str, Any]] = []
    for k, row in enumerate(rows):
        for line in row.lines:
            data.append(_line_trace(line, row, _axis(k)))
            lines.append({"row": k, **_samples(line.values, plan)})
    for k, row in enumerate(rows):
        data += [_lane_trace(lane, len(row.lanes) - i, _axis(k), dt) for i, lane in enumerate(row.lanes)]
        if row.lanes:
            data.append(_lane_hover(_axis(k)))
    data.append(_anchor_of_upper_axis())
    return {
        "dt": dt,
        "n": plan.n,
        "windows": plan.windows.tolist(),
        "lines": lines,
        "rows": [
            {
                "axis": _layout_axis(k),
                "include": [*r.include, *r.thresholds],
                "least_span": r.least_span,
                "has_lines": bool(r.lines),
            }
            for k, r in enumerate(rows)
        ],
        "figure": {"data": data, "layout": _layout(rows, events, plan, dt)},
    }


def _axis(k: int) -> str:
    return "y" if k == 0 else f"y{k + 1}"


def _layout_axis(k: int) -> str:
    return _axis(k).replace("y", "yaxis")


# --- traces ----------------------------------------------------------------------------------------------------


def _line_trace(line: Line, row: Row, axis: str) -> dict[str, Any]:
    name = plot_text(line.label)
    return {
        "type": "scatter",
        "mode": "lines",
        "name": name,
        "legendgroup": line.group,
        "xaxis": "x",
        "yaxis": axis,
        "line": {"color": line.colour, "width": line.width},
        "hovertemplate": f"{name}: %{{y:.{row.decimals}f}} {plot_text(row.unit)}<extra></extra>",
    }


def _lane_trace(lane: Lane, level: int, axis: str, dt: float) -> dict[str, Any]:
    begins, ends = lane.spans[:, 0] * dt, lane.spans[:, 1] * dt
    spans = [f"{a:.2f} – {b:.2f} s ({b - a:.2f} s)" for a, b in zip(begins, ends, strict=True)]
    return {
        "type": "bar",
        "orientation": "h",
        "name": plot_text(lane.label),
        "legendgroup": lane.group,
        "xaxis": "x",
        "yaxis": axis,
        "base": _numbers(begins),
        "x": _numbers(ends - begins),
        "y": [level] * len(spans),
        "width": 0.62,
        # the outline keeps a bar of one sample visible however far the view is zoomed out
        "marker": {"color": lane.colour, "line": {"color": lane.colour, "width": 1.2}},
        "customdata": spans,
        "hoverinfo": "skip",
    }


def _lane_hover(axis: str) -> dict[str, Any]:
    """Invisible points across the lanes' row, which the script fills with what is on at each place.

    Plotly's own hover finds the wrong one among horizontal bars of different lanes.
    """
    return {
        "type": "scatter",
        "mode": "markers",
        "name": "",
        "meta": "lanes",
        "x": [],
        "y": [],
        "xaxis": "x",
        "yaxis": axis,
        "opacity": 0,
        "marker": {"color": "rgba(0,0,0,0)", "size": 1},
        "hoverlabel": {"align": "left"},
        "hovertemplate": "%{customdata}<extra></extra>",
    }


def _anchor_of_upper_axis() -> dict[str, Any]:
    """Plotly draws an axis only if a trace lies on it."""
    return {"type": "scatter", "x": [None], "y": [None], "xaxis": "x2", "yaxis": "y", "hoverinfo": "skip"}


def _numbers(values: NDArray[np.floating[Any]]) -> list[float]:
    return [float(f"{v:.9g}") for v in values]


# --- samples ---------------------------------------------------------------------------------------------------


def _samples(values: NDArray[np.float64], plan: Plan) -> dict[str, str]:
    """`full`: every value inside the windows; `index`, `value`: minima and maxima elsewhere. Base64, little-endian."""
    inside = np.zeros(plan.n, dtype=bool)
    for begin, end in plan.windows:
        inside[begin:end] = True
    with np.errstate(over="ignore"):
        short = values.astype("<f4")
    short[~np.isfinite(short)] = np.nan
    index = np.empty(0, dtype=np.int64) if plan.is_complete else reduce_indices(values)
    index = index[~inside[index]]
    return {
        "full": _base64(short[inside]),
        "index": _base64(index.astype("<u4")),
        "value": _base64(short[index]),
    }


def _base64(array: NDArray[Any]) -> str:
    return base64.b64encode(array.tobytes()).decode("ascii")


# --- layout ----------------------------------------------------------------------------------------------------


def _layout(rows: Sequence[Row], events: Sequence[Event], plan: Plan, dt: float) -> dict[str, Any]:
    total = TOP + BOTTOM + sum(r.height + ABOVE for r in rows)
    domains = list(_domains(rows))
    duration = max(plan.n, 1) * dt
    layout: dict[str, Any] = {
        "height": total,
        "margin": {"l": 132, "r": 18, "t": TOP, "b": BOTTOM, "pad": 0},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "font": {"family": "system-ui, 'Segoe UI', Helvetica, Arial, sans-serif", "size": 12, "color": INK},
        "showlegend": False,
        "hovermode": "x unified",
        "hoverdistance": 30,
        "spikedistance": -1,
        "hoverlabel": {"bgcolor": "@paper", "bordercolor": MUTED, "font": {"size": 12, "color": INK}},
        "dragmode": "zoom",
        "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": MUTED, "activecolor": INK},
        "barmode": "overlay",
        "xaxis": {**_time_axis(duration), "anchor": _axis(len(rows) - 1), "title": {"text": "time [s]"}},
        "xaxis2": {
            **_time_axis(duration),
            "anchor": "y",
            "overlaying": "x",
            "matches": "x",
            "side": "top",
            "showgrid": False,
            "showspikes": False,
        },
        "shapes": [*_event_shapes(events), *_row_shapes(rows, dt)],
        "annotations": [*_titles(rows, domains), *_threshold_labels(rows)],
    }
    for k, (row, domain) in enumerate(zip(rows, domains, strict=True)):
        layout[_layout_axis(k)] = _lane_axis(row, domain) if row.lanes else _value_axis(row, domain)
    return layout


def _domains(rows: Sequence[Row]) -> Iterator[tuple[float, float]]:
    """Share of the height of each row, from the top; each has its title's room above it but the first."""
    heights = [r.height + (ABOVE if k else 0) for k, r in enumerate(rows)]
    edges = 1.0 - np.concatenate([[0.0], np.cumsum(heights)]) / sum(heights)
    for k, (upper, lower) in enumerate(pairwise(edges)):
        room = ABOVE / sum(heights) if k else 0.0
        yield max(0.0, round(float(lower), 9)), round(float(upper) - room, 9)


def _time_axis(duration: float) -> dict[str, Any]:
    return {
        "range": [0.0, duration],
        "autorange": False,
        "gridcolor": GRID,
        "zeroline": False,
        "showline": True,
        "linecolor": MUTED,
        "ticks": "outside",
        "tickcolor": MUTED,
        "ticklen": 4,
        "hoverformat": ".3f",
        "unifiedhovertitle": {"text": "%{x:.3f} s"},
        "exponentformat": "none",
        "showspikes": True,
        "spikemode": "across",
        "spikesnap": "cursor",
        "spikethickness": 1,
        "spikedash": "solid",
        "spikecolor": MUTED,
    }


def _value_axis(row: Row, domain: tuple[float, float]) -> dict[str, Any]:
    return {
        "domain": list(domain),
        "anchor": "x",
        "title": {"text": plot_text(row.unit, 16), "standoff": 6},
        "gridcolor": GRID,
        "zeroline": True,
        "zerolinecolor": "rgba(128,128,128,0.55)",
        "zerolinewidth": 1,
        "showline": True,
        "linecolor": MUTED,
        "nticks": 5,
        "autorange": False,
        "range": [0.0, 1.0],
        "exponentformat": "power",
    }


def _lane_axis(row: Row, domain: tuple[float, float]) -> dict[str, Any]:
    count = len(row.lanes)
    return {
        "domain": list(domain),
        "anchor": "x",
        "range": [0.4, count + 0.6],
        "autorange": False,
        "fixedrange": True,
        "tickmode": "array",
        "tickvals": [count - i for i in range(count)],
        "ticktext": [plot_text(lane.label, 22) for lane in row.lanes],
        "tickfont": {"size": 11},
        "showgrid": True,
        "gridcolor": GRID,
        "zeroline": False,
        "showline": True,
        "linecolor": MUTED,
    }


def _titles(rows: Sequence[Row], domains: Sequence[tuple[float, float]]) -> Iterator[dict[str, Any]]:
    for k, (row, domain) in enumerate(zip(rows, domains, strict=True)):
        yield {
            "text": f"<b>{plot_text(row.title)}</b> – {plot_text(row.caption)}",
            "xref": "paper",
            "x": 0,
            "yref": "paper",
            "y": domain[1],
            "xanchor": "left",
            "yanchor": "bottom",
            # the upper time axis stands between the first row and its title
            "yshift": 18 if k == 0 else 1,
            "showarrow": False,
            "align": "left",
            "font": {"size": 12, "color": INK},
        }


def _threshold_labels(rows: Sequence[Row]) -> Iterator[dict[str, Any]]:
    for k, row in enumerate(rows):
        for value in row.thresholds:
            yield {
                "text": f"threshold {value:g}",
                "xref": "x domain",
                "x": 1,
                "yref": _axis(k),
                "y": value,
                "xanchor": "right",
                "yanchor": "bottom",
                "showarrow": False,
                "font": {"size": 10, "color": THRESHOLD},
            }


def _event_shapes(events: Sequence[Event]) -> Iterator[dict[str, Any]]:
    for severity, colour in (("partial", EVENT_SHADE), ("full", FULL_SHADE)):
        spans = [(e.start_s, e.end_s) for e in events if (e.severity == "full") == (severity == "full")]
        for begin, end in _few(spans):
            yield _rectangle(begin, end, "paper", colour)


def _few(spans: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Union of spans [s], at most MOST_SHADES of them."""
    whole: Spans = np.round(np.array(spans, dtype=np.float64).reshape(-1, 2) * 1e6).astype(np.int64)
    merged, gap = merge_spans(whole), 1000
    while len(merged) > MOST_SHADES:
        merged, gap = merge_spans(merged, gap), 2 * gap
    return [(a / 1e6, b / 1e6) for a, b in merged.tolist()]


def _rectangle(begin: float, end: float, yref: str, colour: str) -> dict[str, Any]:
    return {
        "type": "rect",
        "xref": "x",
        "x0": begin,
        "x1": end,
        "yref": yref,
        "y0": 0,
        "y1": 1,
        "fillcolor": colour,
        "line": {"width": 0},
        "layer": "below",
    }


def _row_shapes(rows: Sequence[Row], dt: float) -> Iterator[dict[str, Any]]:
    for k, row in enumerate(rows):
        for begin, end in [] if row.shades is None else row.shades.tolist():
            # a strip along the bottom, which the colours of the events do not mix with
            strip = _rectangle(round(begin * dt, 6), round(end * dt, 6), f"{_axis(k)} domain", WATER_SHADE)
            yield {**strip, "y1": 0.05}
        for value in row.thresholds:
            yield {
                "type": "line",
                "xref": "x domain",
                "x0": 0,
                "x1": 1,
                "yref": _axis(k),
                "y0": value,
                "y1": value,
                "line": {"color": THRESHOLD, "width": 1.2, "dash": "dash"},
            }


def groups(rows: Sequence[Row]) -> list[str]:
    """Groups that have something to show, wheels first."""
    found = dict.fromkeys(g for r in rows for g in (*(x.group for x in r.lines), *(x.group for x in r.lanes)))
    return [g for g in found if g != VEHICLE] + [g for g in found if g == VEHICLE]
