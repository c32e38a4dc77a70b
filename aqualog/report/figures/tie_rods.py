"""Tie-rod forces, or the steering torque, beside the expectation for a dry road."""

from __future__ import annotations

from aqualog.core.records import DriveResult
from aqualog.report.figures.row import VEHICLE, Line, Row, feature
from aqualog.report.theme import MUTED, wheel_colour

__all__ = ["tie_rods"]


def tie_rods(result: DriveResult) -> list[Row]:
    """Measured and modelled forces of both rods (thesis section 2.4)."""
    lines = []
    for wheel in ("fl", "fr"):
        measured = feature(result.features, f"tie_rod_meas_{wheel}")
        model = feature(result.features, f"tie_rod_hat_{wheel}")
        if measured is not None and model is not None:
            lines += [
                Line(wheel.upper(), wheel, wheel_colour(wheel), measured),
                Line(f"{wheel.upper()}, model", wheel, MUTED, model, width=0.9),
            ]
    if lines:
        caption = "measured; dry model in grey"
        return [Row("Tie-rod forces", caption, "N", tuple(lines), include=(-200.0, 200.0), decimals=0)]
    measured = feature(result.features, "steering_meas")
    model = feature(result.features, "steering_hat")
    if measured is None or model is None:
        return []
    pair = (Line("measured", VEHICLE, "#7F6BB3", measured), Line("model", VEHICLE, MUTED, model, width=0.9))
    return [Row("Steering torque", "measured; dry model in grey", "N·m", pair, include=(-1.0, 1.0))]
