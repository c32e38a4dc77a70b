"""The resistance measure."""

from __future__ import annotations

from aqualog.core.records import DriveResult
from aqualog.report.figures.row import VEHICLE, Line, Row, feature
from aqualog.report.theme import MUTED, detector_colour

__all__ = ["resistance"]


def resistance(result: DriveResult) -> list[Row]:
    """Nominal minus measured acceleration, Eq. (2.9) of the thesis."""
    values = feature(result.features, "delta_a_x")
    if values is None:
        return []
    lines = [Line("delta_a_x", VEHICLE, detector_colour("resistance", None), values)]
    offset = feature(result.features, "delta_a_x_offset")
    caption = "nominal minus measured acceleration; water lifts it"
    if offset is not None:
        lines.append(Line("dry offset", VEHICLE, MUTED, offset, width=0.9))
        caption += "; its offset on dry road in grey"
    return [Row("Resistance measure", caption, "m/s²", tuple(lines), include=(-0.2, 0.2))]
