"""Vehicle and wheel speeds."""

from __future__ import annotations

from aqualog.report.figures.row import VEHICLE, Line, Row, feature, wheel_lines
from aqualog.report.figures.water import watered
from aqualog.report.theme import INK, MUTED
from aqualog.types import DriveResult

__all__ = ["speeds"]


def speeds(result: DriveResult) -> list[Row]:
    """Speed of the vehicle and of the four wheels on its centre line."""
    reference = feature(result.signals.frame, "v_x", "m/s", "km/h")
    estimate = feature(result.features, "v_x_hat", "m/s", "km/h")
    below = () if reference is None else (Line("v_x reference", VEHICLE, MUTED, reference, 1.0),)
    above = () if estimate is None else (Line("v_x", VEHICLE, INK, estimate, 1.8),)
    lines = (*below, *wheel_lines(result, "v_w", "m/s", "km/h"), *above)
    if not lines:
        return []
    caption = "wheels on the vehicle's centre line; a wheel that leaves the black line slips"
    return [Row("Speed", caption, "km/h", lines, least_span=4.0, shades=watered(result), height=210)]
