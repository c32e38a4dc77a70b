"""Whether an accelerometer follows the change of the speed: one measure for checks and diagnosis."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aqualog.core.records import BoolArray, FloatArray

__all__ = ["Follow", "follow"]

OVER_S = 2.0  # [s] of the change that is compared: shorter than hills, longer than delays
LAG_S = 1.0  # [s]
LEAST_TIMES = 10  # as many changes side by side


class Follow(NamedTuple):
    """How an accelerometer follows the speed: correlation and gain of its changes at the best lag [s].

    `motion`: standard deviation of the change of dv/dt. [m/s²]
    """

    correlation: float
    gain: float
    lag_s: float
    motion: float


def follow(a: FloatArray, v: FloatArray, used: BoolArray, dt: float) -> Follow | None:
    """Compare the changes over 2 s of an accelerometer a [m/s²] with those of dv/dt, at the best lag up to 1 s.

    Slow errors such as grades and offsets do not matter. None where too little is known. Arrays (n,); dt in s.
    """
    k = max(1, round(OVER_S / dt))
    if a.size <= k + 1:
        return None
    a, dv = _smooth(a, k // 2), np.gradient(_smooth(v, k // 2), dt)
    change_a, change_v = a[k:] - a[:-k], dv[k:] - dv[:-k]
    good = used[k:] & used[:-k] & np.isfinite(change_a) & np.isfinite(change_v)
    if good.sum() < LEAST_TIMES * k:
        return None
    motion = float(change_v[good].std())
    most = round(LAG_S / dt)
    best = Follow(0.0, 0.0, 0.0, motion)
    for lag in range(-most, most + 1, max(1, most // 20)):
        x, y, g = _shifted(change_v, change_a, good, lag)
        if g.sum() < 2 or not x[g].std() or not y[g].std():
            continue
        c = float(np.corrcoef(x[g], y[g])[0, 1])
        if abs(c) > abs(best.correlation):
            best = Follow(c, c * float(y[g].std() / x[g].std()), lag * dt, motion)
    return best


def _smooth(x: FloatArray, k: int) -> FloatArray:
    k = max(1, k | 1)
    return np.convolve(np.pad(x, k // 2, mode="edge"), np.full(k, 1.0 / k), "valid")


def _shifted(x: FloatArray, y: FloatArray, good: BoolArray, lag: int) -> tuple[FloatArray, FloatArray, BoolArray]:
    """`y` later than `x` by `lag` samples."""
    if lag >= 0:
        return x[: x.size - lag], y[lag:], good[: good.size - lag] & good[lag:]
    return x[-lag:], y[:lag], good[-lag:] & good[:lag]
