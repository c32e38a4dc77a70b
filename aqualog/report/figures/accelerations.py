"""Wheel acceleration differences."""

from __future__ import annotations

from aqualog.core.records import DriveResult
from aqualog.report.figures.row import Row, wheel_lines

__all__ = ["accelerations"]


def accelerations(result: DriveResult) -> list[Row]:
    """Wheel acceleration minus vehicle acceleration, Eq. (2.3) of the thesis."""
    lines = wheel_lines(result, "a_w_delta")
    caption = "wheel minus vehicle; a healthy wheel stays near zero"
    return [Row("Acceleration difference", caption, "m/s²", lines, include=(-2.0, 2.0), height=150)] if lines else []
