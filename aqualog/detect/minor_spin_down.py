"""Detect minor spin-downs of one side by the variance of the wheel acceleration difference, front against rear."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from aqualog.core.compiled import compiled
from aqualog.core.records import BoolArray, FloatArray
from aqualog.detect.ewvar import EwvarParams, from_seconds
from aqualog.detect.ewvar import step as ewvar_step
from aqualog.detect.thresholds import DEFAULT

__all__ = ["MinorParams", "MinorState", "initial_state", "scan"]


class MinorParams(NamedTuple):
    """Tuning in physical units; defaults in `make`."""

    ew: EwvarParams
    var_min: float  # [(m/s^2)^2] of the watched wheel itself
    delta_min: float  # [(m/s^2)^2] of the difference to the other axle
    share: float  # of the wheel's variance that the other axle must not have: bumps shake both (C33)
    off_share: float  # ends when the difference or the one-sidedness falls below this share of its limit
    one_sided: float  # mean square of the speed difference below zero over that above: bumps swing a wheel both ways
    v_noise: float  # [m/s] added to the latter, so that noise alone is not one-sided
    v_min: float  # [m/s]
    warm_up: float  # [s] after braking, until the moments mean something
    quiet: float  # [s] ends after this time without an acceleration difference beyond sqrt(delta_min)
    dt: float  # [s]

    @staticmethod
    def make(dt: float, threshold: float = DEFAULT.minor_spin_down) -> MinorParams:
        """Return defaults: 0.5 s of memory, 1.2 (m/s²)² of the wheel, 1.0 of the difference, 8 to 1 below zero."""
        return MinorParams(
            from_seconds(0.5, 0.5, dt), 1.2 * threshold, threshold, 0.7, 0.5, 8.0, 0.05, 8.0, 0.5, 0.6, dt
        )


class MinorState(NamedTuple):
    """Moving moments of both wheels' accelerations, mean squares of the speed difference below and above zero, ages."""

    mean: float
    var: float
    mean_other: float
    var_other: float
    below: float
    above: float
    age: float
    still: float
    active: bool


RADIUS_KNOWN = 2.5  # [s] more after the start: until the radius correction has found the wheels' offsets


def initial_state() -> MinorState:
    """Return the state without samples. The age starts below zero: a constant offset of the speed is one-sided too."""
    return MinorState(math.nan, 0.0, math.nan, 0.0, 0.0, 0.0, -RADIUS_KNOWN, math.inf, active=False)


@compiled
def _anew(age):  # type: ignore[no-untyped-def]
    return MinorState(math.nan, 0.0, math.nan, 0.0, 0.0, 0.0, min(age, 0.0), math.inf, False)  # noqa: FBT003


@compiled
def _step(p, s, a, a_other, dv, v, allowed):  # type: ignore[no-untyped-def]
    if math.isnan(a) or math.isnan(a_other) or math.isnan(dv) or math.isnan(v):
        return s, math.nan, math.nan, False
    if not allowed or v < p.v_min:
        # a brake makes its own variance on the front wheels; what it leaves must not count after its release
        return _anew(s.age), 0.0, 0.0, False
    still = 0.0 if a * a > p.delta_min else s.still + p.dt
    mean, var = ewvar_step(p.ew, s.mean, s.var, a)
    mean_other, var_other = ewvar_step(p.ew, s.mean_other, s.var_other, a_other)
    beta = p.ew.beta
    below = (1.0 - beta) * s.below + beta * min(dv, 0.0) ** 2
    above = (1.0 - beta) * s.above + beta * max(dv, 0.0) ** 2
    one_sided = below / (above + p.v_noise * p.v_noise)
    shown, delta = var, var - var_other
    active = s.active
    if active:
        is_on = delta > p.off_share * p.delta_min and one_sided > p.off_share * p.one_sided
        if not is_on or still > p.quiet:
            # one large spin-down leaves moments that take seconds to fade; the wheel itself is calm again
            active = False
            mean, var, below, above = a, 0.0, 0.0, 0.0
    elif s.age > p.warm_up and still < p.quiet:
        active = var > p.var_min and delta > max(p.delta_min, p.share * var) and one_sided > p.one_sided
    state = MinorState(mean, var, mean_other, var_other, below, above, s.age + p.dt, still, active)
    return state, delta, shown, active


@compiled
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
    """Run the minor spin-down detector of one vehicle side over a drive or a piece of one.

    Parameters
    ----------
    p : MinorParams
    state : MinorState
    a_w_delta, a_w_delta_other : array (n,)
        Acceleration differences of the watched (non-driven) wheel and of the other one on the same side. [m/s²]
    v_w_delta : array (n,)
        Speed difference of the watched wheel, less the slow part that all wheels share. [m/s]
    v_x : array (n,)
        Velocity. [m/s]
    allowed : bool array (n,)
        False while a negative (braking) force acts on the watched wheel.

    Returns
    -------
    delta_var : array (n,)
        Variance of the watched wheel minus that of the other one. The road's roughness acts on both wheels and drops
        out. [(m/s²)²]
    var : array (n,)
        Variance of the watched wheel. [(m/s²)^2]
    active : bool array (n,)
        Begins when variance and difference exceed their limits (the difference also 0.7 of the variance) and the
        wheel's speed lies eight times more below the vehicle's than above it (mean squares over the same memory).
        Ends when the difference or that ratio falls below half its limit, 0.6 s after the last acceleration
        difference beyond 1 m/s², or on braking. After braking the moments restart and no detection begins for 0.5 s,
        after the start for 3 s. NaN in any input: state held, statistic NaN, no detection.
    state : MinorState

    Thesis: Eq. (2.5), (2.6), (2.8) (C30-C33, E4); criterion 2 of section 2.5 (C66).
    """
    delta, var, bits, last = _scan(p, state, a_w_delta, a_w_delta_other, v_w_delta, v_x, allowed)
    final: MinorState = last._replace(active=bool(last.active))
    return delta, var, bits, final
