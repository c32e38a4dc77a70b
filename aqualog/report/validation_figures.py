"""Figures of a validation: each signal over time and in cross plots, with top and bottom boundary."""

from __future__ import annotations

from typing import Any

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.report.figures import axis, dots, figure, line
from aqualog.report.theme import INK, MUTED, THRESHOLD, wheel_colour
from aqualog.report.values import cut, pretty_unit
from aqualog.validate.boundary import Boundary, boundary
from aqualog.validate.records import ABSCISSAE, SIGNALS, Judged, Trace, Validity

__all__ = ["validation_figures"]

_MOST = 3000  # blocks of a figure: five minutes
_HEIGHT = 300


def validation_figures(found: Validity) -> dict[str, dict[str, Any]]:
    """By name: `time-SIGNAL`, then `cross-SIGNAL-ABSCISSA`."""
    over_time = {f"time-{j.plot.y}": _over_time(j, found) for j in found.judged if j.plot.x == "t"}
    crossed = {f"cross-{j.plot.y}-{j.plot.x}": _crossed(j) for j in found.judged if j.x is not None}
    return over_time | crossed


def _over_time(judged: Judged, found: Validity) -> dict[str, Any]:
    """The drive with the worst stretch, else the first one that has the signal; of a long one the part about it."""
    plot, worst = judged.plot, judged.worst
    own = [t for t in found.traces if plot.y in t.measured]
    trace = next((t for t in own if worst is not None and t.name == worst.drive), own[0])
    here = _part(trace, (worst.start_s + worst.end_s) / 2.0 if worst is not None else 0.0)
    t, shown = trace.over["t"][here], trace.simulated[plot.y][here]
    measured = np.where(trace.judged, trace.measured[plot.y], np.nan)[here]
    edge = boundary(t, shown, plot.tolerance)
    title = f"{plot.y} of {cut(trace.name, 40)}" if len(found.traces) > 1 else f"{plot.y}: {SIGNALS[plot.y].title}"
    title += ", 5 min about the worst" if t.size < trace.judged.size else ""  # beside the buttons of the plot
    return _drawn(title, edge, (t, shown), (t, measured), plot.y, "t")


def _crossed(judged: Judged) -> dict[str, Any]:
    plot, x, shown, measured = judged.plot, judged.x, judged.simulated, judged.measured
    assert x is not None
    assert shown is not None
    assert measured is not None
    edge = boundary(x, shown, plot.tolerance)
    return _drawn(plot.name, edge, (x, shown), (x, measured), plot.y, plot.x)


_Line = tuple[FloatArray, FloatArray]


def _drawn(title: str, edge: Boundary, shown: _Line, measured: _Line, y: str, x: str) -> dict[str, Any]:
    colour = wheel_colour(y[-2:])
    points = dots if x != "t" else line
    data = [
        line("boundaries", edge.top_x, edge.top_y, THRESHOLD, width=1),
        line("bottom", edge.bottom_x, edge.bottom_y, THRESHOLD, width=1, showlegend=False),
        line("simulated", *shown, MUTED, width=1.5),
        points("measured", *measured, colour if colour != INK else wheel_colour("fl")),
    ]
    units = [pretty_unit(k.unit) for k in (ABSCISSAE[x], SIGNALS[y])]
    return figure(data, title, axis(f"{ABSCISSAE[x].title} [{units[0]}]"), axis(f"{y} [{units[1]}]"), height=_HEIGHT)


def _part(trace: Trace, middle_s: float) -> slice:
    n = trace.judged.size
    if n <= _MOST:
        return slice(0, n)
    first = min(max(int(middle_s / trace.step) - _MOST // 2, 0), n - _MOST)
    return slice(first, first + _MOST)
