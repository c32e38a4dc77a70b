"""Rows into one plotly figure with one time axis, and apart from it the samples, the bars and the shades.

The page's script fills the figure from them, as many as the view can show: a figure with every sample of every trace,
or with an element for each of thousands of bars and events, would be slow to open and to zoom.
"""

from __future__ import annotations

import base64
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aqualog.core.units import convert
from aqualog.report.reduce import Plan, Spans, reduce_indices
from aqualog.report.row import VEHICLE, Lane, Line, Row
from aqualog.report.theme import EVENT_SHADE, FULL_SHADE, GRID, INK, MUTED, THRESHOLD, WATER_SHADE
from aqualog.report.wording import plot_text

__all__ = ["groups", "stack"]

ABOVE = 30  # [px] room above a row for its title
TOP, BOTTOM = 58, 44  # [px] above the first row stand its title, the upper time axis and the buttons


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
    data.append(_anchor_of_upper_axis())
    return {
        "dt": dt,
        "n": plan.n,
        "windows": plan.windows.tolist(),
        "lines": lines,
        "lanes": [{"level": level, "spans": _indices(lane.spans)} for lane, level, _ in lanes],
        "shades": {"partial": EVENT_SHADE, "full": FULL_SHADE},
        "rows": [
            {
                "axis": _layout_axis(k),
                "include": [*r.include, *r.thresholds],
                "least_span": r.least_span,
                "has_lines": bool(r.lines),
                "strips": None if r.shades is None else {"colour": WATER_SHADE, "spans": _indices(r.shades)},
            }
            for k, r in enumerate(rows)
        ],
        "figure": {"data": data, "layout": _layout(rows, plan, dt)},
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


def _lane_trace(lane: Lane, axis: str) -> dict[str, Any]:
    """All bars of a lane as one outline: an element for each bar would make thousands of them slow."""
    return {
        "type": "scatter",
        "mode": "lines",
        "meta": "bars",
        "name": plot_text(lane.label),
        "legendgroup": lane.group,
        "xaxis": "x",
        "yaxis": axis,
        "x": [],
        "y": [],
        "fill": "toself",
        "fillcolor": lane.colour,
        # the outline keeps a bar of one sample visible however far the view is zoomed out
        "line": {"color": lane.colour, "width": 1.2, "simplify": False},
        "hoverinfo": "skip",
    }


def _lane_hover(axis: str) -> dict[str, Any]:
    """Invisible points across the lanes' row, which the script fills with the detectors active at each time.

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


# --- samples ---------------------------------------------------------------------------------------------------


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


# --- layout ----------------------------------------------------------------------------------------------------


def _layout(rows: Sequence[Row], plan: Plan, dt: float) -> dict[str, Any]:
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
        "shapes": list(_threshold_lines(rows)),
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


def _threshold_lines(rows: Sequence[Row]) -> Iterator[dict[str, Any]]:
    for k, row in enumerate(rows):
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
    """Groups that hold any line, wheels first."""
    found = dict.fromkeys(g for r in rows for g in (*(x.group for x in r.lines), *(x.group for x in r.lanes)))
    return [g for g in found if g != VEHICLE] + [g for g in found if g == VEHICLE]
