"""Estimated slip slope beside the dry slope that it is compared with."""

from __future__ import annotations

from aqualog.core.notation import SIDES
from aqualog.core.records import DriveResult
from aqualog.report.figures.row import VEHICLE, Line, Row, feature
from aqualog.report.theme import MUTED, wheel_colour
from aqualog.report.wording import place

__all__ = ["slip_slope"]


def slip_slope(result: DriveResult) -> list[Row]:
    """Slip slope C_s / F_z per side with its reference (thesis chapter 3, criterion 4)."""
    lines = []
    wheels = {t.side: t.wheel for t in result.tracks if t.detector == "slip_slope_drop"}
    for side, pair in SIDES.items():
        slope = feature(result.features, f"slip_slope_{side}")
        dry = feature(result.features, f"slip_slope_ref_{side}")
        if slope is None:
            continue
        wheel = wheels.get(side)
        # an all-wheel drive has a slope per side, drawn in the colour of its front wheel
        group, colour, name = wheel or VEHICLE, wheel_colour(wheel or pair[0]), place(wheel, side) or side
        lines.append(Line(name, group, colour, slope))
        if dry is not None:
            lines.append(Line(f"{name}, dry", group, MUTED, dry, width=0.9))
    if not lines:
        return []
    caption = "traction per slip; dry value in grey"
    return [Row("Slip slope", caption, "", tuple(lines), include=(0.0, 40.0))]
