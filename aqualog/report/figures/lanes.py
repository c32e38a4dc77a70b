"""Detection bits as bars, one lane per detector and wheel."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import DriveResult, Track
from aqualog.report.figures.row import VEHICLE, Lane, Row
from aqualog.report.figures.water import watered
from aqualog.report.reduce import spans_of
from aqualog.report.theme import WATER, detector_colour
from aqualog.report.wording import detector_name, place

__all__ = ["lanes"]

MOST_BARS = 20_000  # per lane; beyond, bars that nearly touch are joined


def lanes(result: DriveResult) -> list[Row]:
    """Times at which each detector reports aquaplaning, by wheel or side."""
    found = [_lane(t) for t in result.tracks]
    water = watered(result)
    if water is not None:
        found.append(Lane("On water (label)", VEHICLE, WATER, water))
    if not found:
        return []
    caption = "bars: the detector reports; an empty lane was judged, without event"
    return [Row("Detections", caption, "", lanes=tuple(found), height=18 * len(found) + 8)]


def _lane(track: Track) -> Lane:
    label = f"{detector_name(track.detector)} {place(track.wheel, track.side)}".rstrip()
    if not np.isfinite(track.statistic).any():
        label += " (not judged)"  # its signals are there but carry no usable value
    spans = spans_of(track.active, at_most=MOST_BARS)
    return Lane(label, track.wheel or VEHICLE, detector_colour(track.detector, track.wheel), spans)
