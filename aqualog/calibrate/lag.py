"""Estimate how late one signal is against another, from their common changes."""

from __future__ import annotations

import math

import numpy as np

from aqualog.core.records import FloatArray

__all__ = ["LAG_MAX", "earlier", "lag_between"]

LAG_MAX = 0.6  # [s] buses and GNSS receivers stay below
FAST_S, SLOW_S = 0.2, 4.0  # [s] band in which a driver's pedal moves force and acceleration alike
CORRELATION_MIN = 0.5  # below it the two do not move together and the lag is left at zero
LEAST_S = 20.0  # [s]


def lag_between(x: FloatArray, y: FloatArray, dt: float) -> float:
    """Return the time by which x is late against y.

    Parameters
    ----------
    x, y : array (n,)
        Two signals that move alike, up to scale, offset and slow parts; NaN where missing.
    dt : float
        Sample time. [s]

    Returns
    -------
    lag : float
        Within ±0.6, positive where x comes later; 0 if their best correlation is below 0.5 or less than 20 s are
        usable. [s]

    The peak of the correlation of both signals between 0.25 and 5 Hz, by a parabola through its three highest points.
    """
    a, b = _band(x, dt), _band(y, dt)
    most = round(LAG_MAX / dt)
    if np.count_nonzero(np.isfinite(a + b)) * dt < LEAST_S or most < 1:
        return 0.0
    shifts = np.arange(-most, most + 1)
    found = np.array([_correlation(a, b, int(k)) for k in shifts])
    best = int(np.argmax(found))
    if not found[best] > CORRELATION_MIN or best in (0, shifts.size - 1):
        return 0.0
    low, top, high = found[best - 1 : best + 2]
    curvature = low - 2.0 * top + high
    part = 0.5 * (low - high) / curvature if curvature < 0.0 else 0.0
    return float((shifts[best] + part) * dt)


def earlier(x: FloatArray, lag: float, dt: float) -> FloatArray:
    """Shift a signal that is late by `lag` [s] back; NaN beyond its ends."""
    if lag == 0.0:
        return x
    k = np.arange(x.size, dtype=np.float64)
    moved: FloatArray = np.interp(k + lag / dt, k, x, left=math.nan, right=math.nan)
    return moved


def _band(x: FloatArray, dt: float) -> FloatArray:
    return _mean(x, FAST_S, dt) - _mean(x, SLOW_S, dt)


def _mean(x: FloatArray, seconds: float, dt: float) -> FloatArray:
    """Return the centred mean without delay; NaN where one of its samples is NaN."""
    half = max(round(0.5 * seconds / dt), 0)
    width = 2 * half + 1
    out = np.full(x.size, np.nan)
    if x.size < width:
        return out
    good = np.isfinite(x)
    total = np.concatenate([[0.0], np.cumsum(np.where(good, x, 0.0))])
    count = np.concatenate([[0], np.cumsum(good)])
    full = count[width:] - count[:-width] == width
    out[half : x.size - half] = np.where(full, (total[width:] - total[:-width]) / width, np.nan)
    return out


def _correlation(a: FloatArray, b: FloatArray, k: int) -> float:
    """Of a[i + k] with b[i]."""
    x, y = (a[k:], b[: b.size - k]) if k >= 0 else (a[:k], b[-k:])
    good = np.isfinite(x + y)
    if not good.any():
        return 0.0
    x, y = x[good], y[good]
    scale = math.sqrt(float(x @ x) * float(y @ y))
    return float(x @ y) / scale if scale > 0.0 else 0.0
