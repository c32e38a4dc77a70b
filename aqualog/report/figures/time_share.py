"""Shares of the drive's time: used, or left out with the reason."""

from __future__ import annotations

from typing import Any

from aqualog.detect.slip_slope.direct_inputs import LEFT_OUT
from aqualog.detect.slip_slope.direct_records import DirectResult
from aqualog.report.figures.slope_axes import axis, layout

__all__ = ["time_share"]

_USED = "#009E73"
# one for each reason, in their order; light ones for what is outside the task, dark ones for what the choice leaves out
_COLOURS = (
    "#BBBBBB", "#D9D9D9", "#E69F00", "#D55E00", "#B2182B", "#7F6BB3", "#0072B2", "#56B4E9", "#8C6D31",
)  # fmt: skip


def time_share(result: DirectResult) -> dict[str, Any] | None:
    """Bars of seconds per place; None without places."""
    if not result.places:
        return None
    names = [p.place.upper() if p.wheel else p.place for p in result.places]
    parts = [("used", _USED, [p.seconds for p in result.places])]
    parts += [
        (reason, colour, [p.left_out[reason] for p in result.places])
        for reason, colour in zip(LEFT_OUT, _COLOURS, strict=True)
        if any(p.left_out[reason] > 0.0 for p in result.places)
    ]
    data = [
        {
            "type": "bar", "orientation": "h", "name": name, "y": names, "x": [round(s, 2) for s in seconds],
            "marker": {"color": colour},
            "hovertemplate": "%{x:.0f} s<extra>" + name + "</extra>",
        }
        for name, colour, seconds in parts
    ]  # fmt: skip
    figure = layout("time used and left out [s]", axis(""), axis(""), height=150 + 34 * len(names))
    figure["barmode"] = "stack"
    figure["legend"]["y"] = -0.3
    figure["legend"]["traceorder"] = "normal"
    figure["yaxis"]["autorange"] = "reversed"
    return {"data": data, "layout": figure}
