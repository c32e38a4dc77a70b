"""The resistance measure."""

from __future__ import annotations

from aqualog.report.figures.row import VEHICLE, Line, Row, feature
from aqualog.report.theme import detector_colour
from aqualog.types import DriveResult

__all__ = ["resistance"]


def resistance(result: DriveResult) -> list[Row]:
    """Nominal minus measured acceleration, Eq. (2.9) of the thesis."""
    values = feature(result.features, "delta_a_x", "m/s^2", "m/s^2")
    if values is None:
        return []
    line = Line("delta_a_x", VEHICLE, detector_colour("resistance", None), values)
    caption = "acceleration that the torques should give minus the measured one; water lifts it"
    return [Row("Resistance measure", caption, "m/s²", (line,), include=(-0.2, 0.2))]
