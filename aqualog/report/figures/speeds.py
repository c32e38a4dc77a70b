"""Vehicle and wheel speeds."""

from __future__ import annotations

from aqualog.core.records import DriveResult
from aqualog.report.figures.row import VEHICLE, Line, Row, feature, wheel_lines
from aqualog.report.figures.water import watered
from aqualog.report.theme import INK, MUTED

__all__ = ["speeds"]


def speeds(result: DriveResult) -> list[Row]:
    """Speed of the vehicle and of the four wheels on its centre line."""
    units = ("m/s", "km/h")
    reference = feature(result.signals.frame, "v_x")
    estimate = feature(result.features, "v_x_hat")
    below = () if reference is None else (Line("v_x reference", VEHICLE, MUTED, reference, 1.0, units),)
    above = () if estimate is None else (Line("v_x", VEHICLE, INK, estimate, 1.8, units),)
    lines = (*below, *wheel_lines(result, "v_w", units), *above)
    if not lines:
        return []
    caption = "wheels on the vehicle's centre line; a wheel that leaves the black line slips"
    return [Row("Speed", caption, "km/h", lines, least_span=4.0, shades=watered(result), height=210)]
