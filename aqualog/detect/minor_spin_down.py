"""Minor spin-downs of one vehicle side: variance of the wheel acceleration difference, front against rear."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from aqualog.detect.ewvar import EwvarParams, from_seconds
from aqualog.detect.ewvar import step as ewvar_step
from aqualog.types import BoolArray, FloatArray

__all__ = ["MinorParams", "MinorState", "initial_state", "scan"]


class MinorParams(NamedTuple):
    """Tuning in physical units; defaults in `make`."""

    ew: EwvarParams
    var_min: float  # [(m/s^2)^2] of the watched wheel itself
    delta_min: float  # [(m/s^2)^2] of the difference to the other axle
    off_share: float  # ends when the difference falls below this share of delta_min
    v_abs: float  # [m/s] how much slower than the vehicle the wheel must be on average,
    v_scatter: float  # and in units of the scatter of its speed: bumps swing it both ways, water only down
    v_min: float  # [m/s]
    quiet: float  # [s] ends after this time without an acceleration difference beyond sqrt(delta_min)
    dt: float  # [s]

    @staticmethod
    def make(dt: float) -> MinorParams:
        """Defaults: half a second of memory, 1.2 (m/s^2)^2 of the wheel and 1.0 of the difference."""
        return MinorParams(from_seconds(0.5, 0.5, dt), 1.2, 1.0, 0.5, 0.08, 0.7, 8.0, 0.6, dt)


class MinorState(NamedTuple):
    """Moving moments of both wheels' accelerations and of the speed difference, time since a deviation, bit."""

    mean: float
    var: float
    mean_other: float
    var_other: float
    v_mean: float
    v_var: float
    still: float
    active: bool


def initial_state() -> MinorState:
    """No sample yet."""
    return MinorState(math.nan, 0.0, math.nan, 0.0, math.nan, 0.0, math.inf, active=False)


@njit(cache=True)
def _anew():  # type: ignore[no-untyped-def]
    return MinorState(math.nan, 0.0, math.nan, 0.0, math.nan, 0.0, math.inf, False)  # noqa: FBT003


@njit(cache=True)
def _step(p, s, a, a_other, dv, v, allowed):  # type: ignore[no-untyped-def]
    if math.isnan(a) or math.isnan(a_other) or math.isnan(dv) or math.isnan(v):
        return s, math.nan, math.nan, False
    if not allowed or v < p.v_min:
        # a brake makes its own variance on the front wheels; what it leaves must not count after its release
        return _anew(), 0.0, 0.0, False
    still = s.still + p.dt
    if a * a > p.delta_min:
        still = 0.0
    mean, var = ewvar_step(p.ew, s.mean, s.var, a)
    mean_other, var_other = ewvar_step(p.ew, s.mean_other, s.var_other, a_other)
    v_mean, v_var = ewvar_step(p.ew, s.v_mean, s.v_var, dv)
    delta = var - var_other
    if still > p.quiet:
        # one large spin-down leaves a variance that takes seconds to fade; the wheel itself is calm again
        active = False
    elif s.active:
        active = delta > p.off_share * p.delta_min
    else:
        is_slow = v_mean < -max(p.v_abs, p.v_scatter * math.sqrt(v_var))
        active = var > p.var_min and delta > p.delta_min and is_slow
    return MinorState(mean, var, mean_other, var_other, v_mean, v_var, still, active), delta, var, active


@njit(cache=True)
def _scan(p, s, a, a_other, dv, v, allowed):  # type: ignore[no-untyped-def]
    delta = np.empty_like(a)
    var = np.empty_like(a)
    bits = np.zeros(a.size, dtype=np.bool_)
    for i in range(a.size):
        s, delta[i], var[i], bits[i] = _step(p, s, a[i], a_other[i], dv[i], v[i], allowed[i])
    return delta, var, bits, s


def scan(
    p: MinorParams,
    state: MinorState,
    a_w_delta: FloatArray,
    a_w_delta_other: FloatArray,
    v_w_delta: FloatArray,
    v_x: FloatArray,
    allowed: BoolArray,
) -> tuple[FloatArray, FloatArray, BoolArray, MinorState]:
    """Minor spin-down detector of one vehicle side over a drive or a piece of one.

    Parameters
    ----------
    p : MinorParams
    state : MinorState
    a_w_delta, a_w_delta_other : array (n,)
        Acceleration differences of the watched (non-driven) wheel and of the other one on the same side. [m/s^2]
    v_w_delta : array (n,)
        Speed difference of the watched wheel. [m/s]
    v_x : array (n,)
        Velocity. [m/s]
    allowed : bool array (n,)
        False while a negative (braking) force acts on the watched wheel.

    Returns
    -------
    delta_var : array (n,)
        Variance of the watched wheel minus that of the other one: the road's roughness, which both wheels see, drops
        out. [(m/s^2)^2]
    var : array (n,)
        Variance of the watched wheel. [(m/s^2)^2]
    active : bool array (n,)
        Begins when variance and difference exceed their limits and the wheel is slower than the vehicle on average
        over the same memory, by more than 0.7 of the scatter of its speed; ends when the difference falls below half
        its limit, 0.6 s after the last deviation, or on braking, which also starts the moments anew. NaN in any
        input: state held, statistic NaN, no detection.
    state : MinorState

    Thesis: Eq. (2.5), (2.6), (2.8) (C30-C33, E4); criterion 2 of section 2.5 (C66).
    """
    delta, var, bits, last = _scan(p, state, a_w_delta, a_w_delta_other, v_w_delta, v_x, allowed)
    final: MinorState = last._replace(active=bool(last.active))
    return delta, var, bits, final
