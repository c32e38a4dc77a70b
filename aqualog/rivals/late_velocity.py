"""Estimate the delay of a reference velocity by the accelerometer."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.features.smoothing import UNSET, derivative, lowpass

__all__ = ["LAG_MAX", "velocity_lag"]

TAU = 0.3  # [s] both accelerations are smoothed alike
TAU_SLOW = 5.0  # [s] grade and offset of the accelerometer change more slowly
LAG_MAX = 0.5  # [s]
# Integral of the squared jerk at which half of a lag is reported, less of it before: a receiver counts as in time at
# first. 5 s of accelerations that change by 0.1 m/s³ have it
KNOWN = 0.05  # [m^2/s^5]


def velocity_lag(v_x: FloatArray, a_x: FloatArray, *, dt: float) -> FloatArray:
    """Return the lag of a velocity behind the accelerometer, from the drive so far.

    Parameters
    ----------
    v_x : array (n,)
        Reference velocity. [m/s]
    a_x : array (n,)
        Specific force; its own latency, some 10 ms, is left out. [m/s²]
    dt : float
        [s]

    Returns
    -------
    lag : array (n,)
        0 ... 0.5, starting at 0, never NaN. [s]

    Least squares of dv_x/dt - a_x = -lag da_x/dt beyond the slow part, which holds the grade. Wheel speeds are not
    used: a slip grows with the acceleration as a lag does, and would look like one.
    """
    a_v, _ = derivative(v_x, UNSET, tau=TAU, dt=dt)
    smooth, _ = lowpass(a_x, UNSET, tau=TAU, dt=dt)
    jerk, _ = derivative(smooth, UNSET, tau=TAU, dt=dt)
    late = a_v - smooth
    slow, _ = lowpass(late, UNSET, tau=TAU_SLOW, dt=dt)
    # the difference is smoothed as the jerk is, or the jerk would be the later one
    behind, _ = lowpass(late - slow, UNSET, tau=TAU, dt=dt)
    along = np.cumsum(np.nan_to_num(-behind * jerk)) * dt
    size = np.cumsum(np.where(np.isnan(behind), 0.0, np.nan_to_num(jerk * jerk))) * dt
    return np.clip(along / (size + KNOWN), 0.0, LAG_MAX)
