"""Slips of wheels on the water over speed, as clouds of points: passes at constant speed and accelerated ones apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aqualog.campaign.samples import RunInfo
from aqualog.figures.evidence import KMH, Evidence
from aqualog.figures.record import Line
from aqualog.figures.scene_panels import WHEEL_WORDS
from aqualog.report.theme import wheel_colour

__all__ = ["clouds"]

_MOST = 2500  # points of a cloud


def clouds(evidence: Evidence, runs: Sequence[RunInfo], column: str, wheels: Sequence[str]) -> list[Line]:
    """Extremes of the slip [%] within each 0.1 s over velocity [km/h], a cloud per wheel and kind of pass.

    Parameters
    ----------
    column : str
        `slip_min` or `slip_max`: rim against car, over the car's speed.
    """
    lines = []
    for kind, is_constant in (("constant speed", True), ("accelerated", False)):
        for wheel in wheels:
            x, y = [], []
            for info in runs:
                if evidence.of(info).is_constant != is_constant:
                    continue
                samples, wet = evidence.wet(info)
                v, s = samples.array("v_x")[wet], samples.array(f"{column}_{wheel}")[wet]
                good = np.isfinite(v) & np.isfinite(s)
                x.append(v[good] / KMH)
                y.append(100.0 * s[good])
            if x and sum(p.size for p in x):
                v, s = np.concatenate(x), np.concatenate(y)
                every = slice(None, None, max(1, -(-v.size // _MOST)))
                lines.append(
                    Line(
                        f"{WHEEL_WORDS[wheel]}, {kind}", v[every], s[every], colour=wheel_colour(wheel), mode="markers",
                        symbol="circle" if is_constant else "cross", size=3.5, opacity=0.6,
                    )
                )  # fmt: skip
    return lines
