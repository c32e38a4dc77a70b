"""Sum a signal one-sidedly, with drift, clamp and reset (CUSUM)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from aqualog.core.compiled import compiled
from aqualog.core.records import BoolArray, FloatArray

__all__ = ["Ages", "CusumParams", "CusumState", "ages", "initial_state", "new_ages", "scan", "step"]


class CusumParams(NamedTuple):
    """`nu` drift in units of x; `h` threshold and `g_max` clamp in units of x * s; `dt` [s].

    An alarm ends when the sum has fallen below `off_share` of the threshold, so that it does not flicker there.
    """

    nu: float
    h: float
    g_max: float
    dt: float
    off_share: float = 0.5


class CusumState(NamedTuple):
    """The sum and whether the alarm is on."""

    g: float
    active: bool


def initial_state() -> CusumState:
    """Nothing summed up."""
    return CusumState(0.0, active=False)


@compiled
def step(p, g, x):  # type: ignore[no-untyped-def]
    """g <- min(g_max, max(0, g + (x - nu) dt)); NaN holds the sum.

    The clamp at zero is missing in thesis 3.24 as printed (E11) and present in Page's [page1954] and Gustafsson's
    [gustafsson2000]. The clamp at g_max bounds the time by which the alarm outlives its cause, to (g_max - off_share h)
    / nu. The integration over time makes threshold and detection time independent of the sample rate.
    """
    if math.isnan(x):
        return g
    return min(p.g_max, max(0.0, g + (x - p.nu) * p.dt))


@compiled
def _scan(p, g, active, x):  # type: ignore[no-untyped-def]
    out = np.empty_like(x)
    bits = np.zeros(x.size, dtype=np.bool_)
    for i in range(x.size):
        g = step(p, g, x[i])
        active = g > (p.off_share * p.h if active else p.h)
        out[i] = math.nan if math.isnan(x[i]) else g
        bits[i] = active and not math.isnan(x[i])
    return out, bits, g, active


def scan(p: CusumParams, state: CusumState, x: FloatArray) -> tuple[FloatArray, BoolArray, CusumState]:
    """Sum a signal x (n,) over a drive or a piece of one; `state` from `initial_state` or the piece before.

    NaN: sum held, statistic NaN, no alarm. Returns the statistic g (n,) in units of x * s, never negative; where it is
    active (n,), from g > h until g <= off_share h; and the state.

    x and h scaled alike give the same alarms; no reset after an alarm.
    Thesis: Eq. (3.24) and the text under 2.4 and 2.10.
    """
    g, bits, last, active = _scan(p, state.g, state.active, np.ascontiguousarray(x, dtype=np.float64))
    return g, bits, CusumState(last, active=bool(active))


class Ages(NamedTuple):
    """Largest sum since it left zero, seconds since it left zero, seconds since an alarm's sum was the largest."""

    peak: float
    since: float
    after: float


def new_ages() -> Ages:
    """Return the state of a sum that is zero."""
    return Ages(0.0, 0.0, 0.0)


@compiled
def _ages(dt, peak, since, after, g, active):  # type: ignore[no-untyped-def]
    left = np.empty_like(g)
    back = np.empty_like(g)
    for i in range(g.size):
        after += dt
        since += dt
        if g[i] <= 0.0 or (math.isnan(g[i]) and peak == 0.0):
            peak, since = 0.0, 0.0
        elif g[i] >= peak:
            peak = g[i]
            if active[i]:
                after = 0.0
        left[i], back[i] = since, after
    return left, back, peak, since, after


def ages(dt: float, state: Ages, g: FloatArray, active: BoolArray) -> tuple[FloatArray, FloatArray, Ages]:
    """Estimate when a change began and ended from its sum, which is late at both ends; `dt` [s].

    `state` from `new_ages` or the piece before; `g`, `active` (n,) statistic and alarm of `scan`. NaN: time goes on,
    and a sum of zero stays zero. Returns `since` (n,), seconds since the sum left zero: the estimate of when a change
    began (Page [page1954]); `after` (n,), seconds since the sum of an alarm was at its largest, which with a clamp is
    as long as the change lasts, and what follows is decay; and the state.
    """
    since, after, *last = _ages(dt, *state, np.ascontiguousarray(g, dtype=np.float64), np.ascontiguousarray(active))
    return since, after, Ages(*(float(x) for x in last))
