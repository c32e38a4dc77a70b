"""Whether an accelerometer follows the change of the speed: one measure for checks and diagnosis."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aqualog.core.records import BoolArray, FloatArray

__all__ = ["Follow", "follow", "passed_from"]

OVER_S = 2.0  # [s] of the change that is compared: shorter than hills, longer than delays
LAG_S = 1.0  # [s]
LEAST_TIMES = 10  # as many changes side by side
# time constants of a high pass that are tried
CORNERS_S: tuple[float, ...] = tuple(np.geomspace(2.0, 30.0, 9).tolist())
EXPLAINED, LEAST_LEFT = 0.75, 0.1  # of what else is left, which is at least as large [m/s^2]
STEP_S = 0.1


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


def passed_from(a: FloatArray, v: FloatArray, used: BoolArray, dt: float) -> float | None:
    """Time constant [s] of a high pass between the car's acceleration and a, None where it explains little.

    An accelerometer whose signal is coupled without its constant part follows fast changes and forgets what lasts.
    Arrays (n,); dt in s.
    """
    seen = follow(a, v, used, dt)
    if seen is None:
        return None
    k = max(1, round(OVER_S / dt)) // 2
    step = max(1, round(STEP_S / dt))
    whole = np.arange(a.size)
    a, v = (np.interp(whole, whole[used], x[used]) for x in (a, v))
    x, y, good = _shifted(np.gradient(_smooth(v, k), dt), _smooth(a, k), used, round(seen.lag_s / dt))
    x, y, good = x[::step], y[::step], good[::step]
    left = [_left(x, y, good), *(_left(_without_slow(x, step * dt / tau), y, good) for tau in CORNERS_S)]
    best = int(np.argmin(left))
    if left[0] < LEAST_LEFT**2 or left[best] > (1.0 - EXPLAINED) * left[0]:
        return None
    return CORNERS_S[best - 1]


def _without_slow(x: FloatArray, share: float) -> FloatArray:
    """What is beyond an exponential mean that takes in this share of each sample."""
    out = np.empty_like(x)
    mean = 0.0
    for i, now in enumerate(x.tolist()):
        mean += share * (now - mean)
        out[i] = now - mean
    return out


def _left(x: FloatArray, y: FloatArray, good: BoolArray) -> float:
    """Variance of y that a line over x does not explain."""
    c = np.cov(x[good], y[good])
    return float(c[1, 1] - c[0, 1] ** 2 / max(c[0, 0], 1e-30))


def _smooth(x: FloatArray, k: int) -> FloatArray:
    k = max(1, k | 1)
    return np.convolve(np.pad(x, k // 2, mode="edge"), np.full(k, 1.0 / k), "valid")


def _shifted(x: FloatArray, y: FloatArray, good: BoolArray, lag: int) -> tuple[FloatArray, FloatArray, BoolArray]:
    """`y` later than `x` by `lag` samples."""
    if lag >= 0:
        return x[: x.size - lag], y[lag:], good[: good.size - lag] & good[lag:]
    return x[-lag:], y[:lag], good[-lag:] & good[:lag]
