"""Water on the road, where it was measured or labelled."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import DriveResult
from aqualog.report.figures.row import VEHICLE, Line, Row, feature
from aqualog.report.reduce import Spans, spans_of
from aqualog.report.theme import MUTED, WATER, WHEEL_COLOURS

__all__ = ["water", "watered"]

_TRACKS = {
    "water_depth": ("lane", WATER),
    "water_depth_left": ("left track", WHEEL_COLOURS["fl"]),
    "water_depth_right": ("right track", WHEEL_COLOURS["fr"]),
}
MOST_SHADES = 20_000


def watered(result: DriveResult) -> Spans | None:
    """Where the label says that the car is on the watered lane; None without a label."""
    if "on_water" not in result.signals.frame.columns:
        return None
    return spans_of(np.nan_to_num(result.signals.array("on_water")) > 0.5, at_most=MOST_SHADES)


def water(result: DriveResult) -> list[Row]:
    """Water depths."""
    frame = result.signals.frame
    columns = [(label, colour, feature(frame, s)) for s, (label, colour) in _TRACKS.items()]
    lines = tuple(
        Line(label, VEHICLE, colour or MUTED, v, units=("m", "mm")) for label, colour, v in columns if v is not None
    )
    if not lines:
        return []
    return [Row("Water depth", "as logged", "mm", lines, include=(0.0,), height=100)]
