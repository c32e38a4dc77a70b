"""Large spin-downs and spin-ups of one wheel: CUSUM of the acceleration difference with the sign of the speed
difference.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from aqualog.detect.cusum import CusumParams
from aqualog.detect.cusum import step as cusum_step
from aqualog.types import BoolArray, FloatArray

__all__ = ["SpinParams", "SpinState", "initial_state", "scan"]


class SpinParams(NamedTuple):
    """Tuning in physical units; the defaults of `make` are those of both detectors.

    `sign` is -1 for spin-down, +1 for spin-up. The speed difference must exceed max(v_abs, v_rel v_x).
    """

    cusum: CusumParams  # of sign * a_w_delta; threshold in m/s
    sign: float
    v_abs: float  # [m/s]
    v_rel: float
    v_min: float  # [m/s] below this speed wheel speed sensors and slip mean little

    @staticmethod
    def make(sign: float, dt: float) -> SpinParams:
        """Defaults: 3 m/s^2 drift, 0.6 m/s threshold, speed difference beyond 0.5 m/s and 3 %."""
        return SpinParams(CusumParams(3.0, 0.6, 3.0, dt), sign, 0.5, 0.03, 5.0)


class SpinState(NamedTuple):
    """The sum [m/s] and the detection bit."""

    g: float
    active: bool


def initial_state() -> SpinState:
    """Nothing summed up."""
    return SpinState(0.0, active=False)


@njit(cache=True)
def _step(p, g, active, a, dv, v, allowed):  # type: ignore[no-untyped-def]
    """One sample; `a` and `dv` positive in the direction that is looked for."""
    if math.isnan(a) or math.isnan(dv) or math.isnan(v):
        return g, active, math.nan, False
    if v < p.v_min:
        return 0.0, False, 0.0, False
    limit = max(p.v_abs, p.v_rel * v)
    g = cusum_step(p.cusum, g, a)
    if dv < -0.25 * limit:
        # the wheel is on the other side of the vehicle's speed: this acceleration ends another event (thesis 2.4)
        g = 0.0
    statistic = g
    if active:
        if dv < 0.5 * limit:
            active = False
            g = 0.0
    elif allowed and g > p.cusum.h and dv > limit:
        active = True
    return g, active, statistic, active


@njit(cache=True)
def _scan(p, g, active, a, dv, v, allowed):  # type: ignore[no-untyped-def]
    out = np.empty_like(a)
    bits = np.zeros(a.size, dtype=np.bool_)
    for i in range(a.size):
        g, active, out[i], bits[i] = _step(p, g, active, p.sign * a[i], p.sign * dv[i], v[i], allowed[i])
    return out, bits, g, active


def scan(
    p: SpinParams, state: SpinState, a_w_delta: FloatArray, v_w_delta: FloatArray, v_x: FloatArray, allowed: BoolArray
) -> tuple[FloatArray, BoolArray, SpinState]:
    """Spin detector of one wheel over a drive or a piece of one.

    Parameters
    ----------
    p : SpinParams
    state : SpinState
    a_w_delta : array (n,)
        Acceleration difference of wheel and vehicle. [m/s^2]
    v_w_delta : array (n,)
        Speed difference of wheel and vehicle. [m/s]
    v_x : array (n,)
        Velocity; a coarse one will do, it only decides the sign. [m/s]
    allowed : bool array (n,)
        Where an alarm may begin (spin-up: traction coefficient below 0.07).

    Returns
    -------
    g : array (n,)
        Sum of the acceleration difference beyond the drift: the speed lost (or gained) faster than a healthy wheel
        can. [m/s]
    active : bool array (n,)
        Begins when g > h and the speed difference exceeds its limit; ends when the speed difference has fallen to
        half its limit; then the sum starts anew. NaN in any input: state held, statistic NaN, no detection.
    state : SpinState

    Thesis: Eq. (2.3), (2.4) and the text below them (C24-C27).
    """
    g, bits, last, active = _scan(p, state.g, state.active, a_w_delta, v_w_delta, v_x, allowed)
    return g, bits, SpinState(last, bool(active))
