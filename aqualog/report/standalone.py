"""Figures of the pages as plotly figures that stand alone: in a notebook, or to be changed and saved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from aqualog.core.units import convert
from aqualog.report.reduce import ALL_SAMPLES, make_plan, reduce_indices
from aqualog.report.row import Lane, Line, Row
from aqualog.report.stack import stack
from aqualog.report.theme import LIGHT, in_light

if TYPE_CHECKING:
    import plotly.graph_objects as go

__all__ = ["figure", "rows_figure", "side_by_side"]

_BAR = 0.36  # half the height of a lane's bar


def figure(found: Mapping[str, Any]) -> go.Figure:
    """Return `data` and `layout` of a page's figure as a plotly figure in light colours."""
    import plotly.graph_objects as go

    light = in_light({"data": list(found["data"]), "layout": dict(found["layout"])})
    made = go.Figure(light, skip_invalid=True)
    made.update_layout(paper_bgcolor=LIGHT["@paper"], plot_bgcolor=LIGHT["@paper"])
    return made


def side_by_side(found: Sequence[Mapping[str, Any]], *, columns: int = 2) -> go.Figure:
    """Return several figures of a page as the panels of one."""
    from plotly.subplots import make_subplots

    figures = [figure(f) for f in found]
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
        trace |= _samples(line, dt)
    for trace, (lane, level) in zip(data[len(lines) :], lanes, strict=False):
        trace |= _bars(lane, level, dt)
    layout = dict(found["layout"])
    for k, row in enumerate(rows):
        if not row.lanes:
            axis = layout["yaxis" if k == 0 else f"yaxis{k + 1}"]
            axis |= {"autorange": True, "range": None}
    return figure({"data": data, "layout": layout})


def _samples(line: Line, dt: float) -> dict[str, Any]:
    values = line.values
    index = np.arange(values.size) if values.size <= ALL_SAMPLES else reduce_indices(values)
    return {"x": index * dt, "y": convert(values[index], *line.units)}


def _bars(lane: Lane, level: int, dt: float) -> dict[str, Any]:
    """The outlines of a lane's bars, one after the other."""
    x: list[float | None] = []
    y: list[float | None] = []
    for begin, end in (lane.spans * dt).tolist():
        x += [begin, begin, end, end, begin, None]
        y += [level - _BAR, level + _BAR, level + _BAR, level - _BAR, level - _BAR, None]
    return {"x": x, "y": y}
