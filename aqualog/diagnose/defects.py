"""Logs that cannot be judged because a signal does not hold the quantity of its name."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aqualog.core.records import BoolArray, FloatArray
from aqualog.diagnose.drive import Drive

__all__ = ["Defect", "accelerometer_defect"]

OVER_S = 2.0  # [s] of the change that is compared: shorter than hills, longer than delays
LEAST_CORRELATION = 0.5
LEAST_GAIN, MOST_GAIN = 0.5, 1.5  # bounds of an accelerometer's gain
LEAST_MOTION = 0.1  # [m/s^2] sd of the change of the acceleration
LAG_S = 1.0  # [s]


class Defect(NamedTuple):
    """An accelerometer that does not follow the speed: correlation and gain of its changes, at the best lag [s]."""

    correlation: float
    gain: float
    lag_s: float


def accelerometer_defect(drive: Drive) -> Defect | None:
    """Whether `a_x` is the car's longitudinal acceleration: its changes over 2 s against those of dv/dt.

    None if it is, or if the speed changes too little for a judgement. Slow errors such as grades and offsets do not
    matter. A lag of up to a second is estimated first.
    """
    if "a_x" not in drive.columns:
        return None
    k = max(1, round(OVER_S / drive.dt))
    a, dv = _smooth(drive.columns["a_x"], k // 2), np.gradient(_smooth(drive.course.v_x, k // 2), drive.dt)
    used = np.repeat(drive.mask, max(1, round(0.1 / drive.dt)) if drive.dt < 0.1 else 1)[: a.size]
    a, dv = a[: used.size], dv[: used.size]
    change_a, change_v = a[k:] - a[:-k], dv[k:] - dv[:-k]
    good = used[k:] & used[:-k]
    if good.sum() < 10 * k or change_v[good].std() < LEAST_MOTION:
        return None
    most = round(LAG_S / drive.dt)
    best = Defect(0.0, 0.0, 0.0)
    for lag in range(-most, most + 1, max(1, most // 20)):
        x, y, g = _shifted(change_v, change_a, good, lag)
        c = float(np.corrcoef(x[g], y[g])[0, 1]) if y[g].std() > 0.0 else 0.0
        if abs(c) > abs(best.correlation):
            best = Defect(c, c * float(y[g].std() / x[g].std()), lag * drive.dt)
    wrong = best.correlation < LEAST_CORRELATION or not LEAST_GAIN <= best.gain <= MOST_GAIN
    return best if wrong else None


def _smooth(x: FloatArray, k: int) -> FloatArray:
    k = max(1, k | 1)
    return np.convolve(np.pad(x, k // 2, mode="edge"), np.full(k, 1.0 / k), "valid")


def _shifted(x: FloatArray, y: FloatArray, good: BoolArray, lag: int) -> tuple[FloatArray, FloatArray, BoolArray]:
    """`y` later than `x` by `lag` samples."""
    if lag >= 0:
        return x[: x.size - lag], y[lag:], good[: good.size - lag] & good[lag:]
    return x[-lag:], y[:lag], good[-lag:] & good[:lag]
