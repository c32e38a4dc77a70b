"""Logs that cannot be judged because a signal does not hold the quantity of its name."""

from __future__ import annotations

import numpy as np

from aqualog.checks.follows import Follow, follow
from aqualog.diagnose.drive import Drive

__all__ = ["accelerometer_defect"]

LEAST_CORRELATION = 0.5
LEAST_GAIN, MOST_GAIN = 0.5, 1.5  # bounds of an accelerometer's gain
LEAST_MOTION = 0.1  # [m/s^2] sd of the change of the acceleration


def accelerometer_defect(drive: Drive) -> Follow | None:
    """Whether `a_x` is the car's longitudinal acceleration: its changes over 2 s against those of dv/dt.

    None if it is, or if the speed changes too little for a judgement.
    """
    if "a_x" not in drive.columns:
        return None
    used = np.repeat(drive.mask, max(1, round(0.1 / drive.dt)) if drive.dt < 0.1 else 1)
    # not the course's target: it leads the simulation of a car that is heavier than its file by more than the speed
    a, v = drive.columns["a_x"], drive.speed
    n = min(used.size, a.size)
    found = follow(a[:n], v[:n], used[:n], drive.dt)
    if found is None or found.motion < LEAST_MOTION:
        return None
    wrong = found.correlation < LEAST_CORRELATION or not LEAST_GAIN <= found.gain <= MOST_GAIN
    return found if wrong else None
