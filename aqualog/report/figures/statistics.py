"""The detectors' statistics against their thresholds."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import DriveResult, Track
from aqualog.report.figures.row import VEHICLE, Line, Row
from aqualog.report.theme import detector_colour
from aqualog.report.wording import caption, detector_name, place, pretty_unit

__all__ = ["statistics"]


def statistics(result: DriveResult) -> list[Row]:
    """One row per detector that ran."""
    detectors = dict.fromkeys(t.detector for t in result.tracks)
    rows = [_row(d, [t for t in result.tracks if t.detector == d]) for d in detectors]
    return [r for r in rows if r.lines]


def _row(detector: str, tracks: list[Track]) -> Row:
    lines = tuple(
        Line(
            place(t.wheel, t.side) or "vehicle",
            t.wheel or VEHICLE,
            detector_colour(detector, t.wheel),
            np.asarray(t.statistic, dtype=np.float64),
        )
        for t in tracks
        if np.isfinite(t.statistic).any()
    )
    thresholds = tuple(sorted({t.threshold for t in tracks if np.isfinite(t.threshold)}))
    unit = pretty_unit(tracks[0].unit)
    return Row(detector_name(detector), caption(detector), unit, lines, thresholds=thresholds, include=(0.0,))
