"""Wheel speed differences."""

from __future__ import annotations

from aqualog.core.records import DriveResult
from aqualog.report.figures.row import Row, wheel_lines

__all__ = ["speed_differences"]


def speed_differences(result: DriveResult) -> list[Row]:
    """Wheel speed minus vehicle speed, Eq. (2.4) of the thesis."""
    lines = wheel_lines(result, "v_w_delta", ("m/s", "km/h"))
    caption = "wheel minus vehicle; below zero the wheel spins down"
    return [Row("Speed difference", caption, "km/h", lines, include=(-1.0, 1.0), height=150)] if lines else []
