"""One-sided cumulative sum with drift, clamp and reset."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from aqualog.types import BoolArray, FloatArray

__all__ = ["CusumParams", "CusumState", "initial_state", "scan", "step"]


class CusumParams(NamedTuple):
    """`nu` drift in units of x, `h` threshold in units of x * s, `dt` [s]. The sum is clamped at `g_max`."""

    nu: float
    h: float
    g_max: float
    dt: float


class CusumState(NamedTuple):
    """The sum."""

    g: float


def initial_state() -> CusumState:
    """Nothing summed up."""
    return CusumState(0.0)


@njit(cache=True)
def step(p, g, x):  # type: ignore[no-untyped-def]
    """g <- min(g_max, max(0, g + (x - nu) dt)); NaN holds the sum.

    The clamp at zero is missing in thesis 3.24 as printed (E11); the clamp at g_max bounds the time that the alarm
    outlives its cause, to (g_max - h) / nu. The integration over time makes threshold and detection time independent
    of the sample rate.
    """
    if math.isnan(x):
        return g
    return min(p.g_max, max(0.0, g + (x - p.nu) * p.dt))


@njit(cache=True)
def _scan(p, g, x):  # type: ignore[no-untyped-def]
    out = np.empty_like(x)
    active = np.zeros(x.size, dtype=np.bool_)
    for i in range(x.size):
        g = step(p, g, x[i])
        out[i] = math.nan if math.isnan(x[i]) else g
        active[i] = g > p.h and not math.isnan(x[i])
    return out, active, g


def scan(p: CusumParams, state: CusumState, x: FloatArray) -> tuple[FloatArray, BoolArray, CusumState]:
    """Sum of a signal over a drive or a piece of one.

    Parameters
    ----------
    p : CusumParams
    state : CusumState
        From `initial_state` or the piece before.
    x : array (n,)
        NaN: sum held, statistic NaN, no alarm.

    Returns
    -------
    g : array (n,)
        Statistic in units of x * s, never negative.
    active : bool array (n,)
        g > h.
    state : CusumState

    x and h scaled alike give the same alarms; no reset after an alarm: it ends when the sum falls below h again.
    Thesis: Eq. (3.24) and the text under 2.4 and 2.10.
    """
    g, active, last = _scan(p, state.g, np.ascontiguousarray(x, dtype=np.float64))
    return g, active, CusumState(last)
