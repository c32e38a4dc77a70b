"""Signs of aquaplaning that come before 15 % slip, from the same run: minor spin-downs, a drop of the slip slope."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from aqualog.core.errors import AqualogError
from aqualog.core.records import Signals
from aqualog.core.vehicle import Vehicle
from aqualog.detect.stream import detect_drive
from aqualog.trade.straight import StraightRun

__all__ = ["SIGNS", "Onset", "onset_of"]

SIGNS = {"minor_spin_down": "minor spin-down", "slip_slope_drop": "drop of the slip slope"}


class Onset(NamedTuple):
    """Speed at the first event of each detector of `SIGNS` on the lane [m/s]; NaN without one. `missing`: what
    a detector lacked, by its name.
    """

    speeds: dict[str, float]
    missing: dict[str, str]


def onset_of(signals: Signals, vehicle: Vehicle, runs: tuple[StraightRun, ...]) -> tuple[Onset, ...]:
    """Return the onset of each run of a drive."""
    if all(r.lane is None for r in runs):
        return tuple(Onset({}, {}) for _ in runs)
    try:
        found = detect_drive(signals, vehicle)
    except AqualogError as error:
        return tuple(Onset({}, dict.fromkeys(SIGNS, error.line())) for _ in runs)
    missing = {u.detector: ", ".join(u.missing) for u in found.unavailable if u.detector in SIGNS}
    t, v = signals.array("t"), np.asarray(found.features["v_x_hat"].to_numpy(), dtype=np.float64)
    made = []
    for run in runs:
        speeds = {}
        for name in (n for n in SIGNS if n not in missing):
            lane = run.lane or (math.inf, -math.inf)
            starts = [e.start_s for e in found.events if e.detector == name and lane[0] <= e.start_s <= lane[1]]
            speeds[name] = float(np.interp(min(starts), t, v)) if starts else math.nan
        made.append(Onset(speeds, missing))
    return tuple(made)
