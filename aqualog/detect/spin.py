"""Detect large spin-downs and spin-ups of one wheel: CUSUM of the acceleration difference with the sign of the speed
difference.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from aqualog.core.compiled import compiled
from aqualog.core.records import BoolArray, FloatArray
from aqualog.detect.cusum import CusumParams
from aqualog.detect.cusum import step as cusum_step
from aqualog.detect.thresholds import DEFAULT

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
    slip_deep: float  # a wheel this far off begins an event without acceleration too, if it stays there
    t_deep: float  # [s] for so long: the acceleration may have been in a gap
    a_calm: float  # [m/s^2] a wheel that is but slightly off and does not accelerate for t_calm has a wrong radius
    t_calm: float  # [s]

    @staticmethod
    def make(sign: float, dt: float, threshold: float = DEFAULT.spin_down) -> SpinParams:
        """Return defaults: 3 m/s² drift, 0.6 m/s threshold, speed difference beyond 0.5 m/s and 3 %."""
        # the clamp does not follow a low threshold: joint detector 2 takes the sum up to 1.5 m/s
        sums = CusumParams(3.0, threshold, max(5.0 * threshold, 3.0), dt)
        return SpinParams(sums, sign, 0.5, 0.03, 5.0, 0.25, 0.1, 1.0, 1.0)


class SpinState(NamedTuple):
    """The sum [m/s], times of being far off and of being calm [s], and the detection bit."""

    g: float
    deep: float
    calm: float
    active: bool


def initial_state() -> SpinState:
    """Nothing summed up."""
    return SpinState(0.0, 0.0, 0.0, active=False)


@compiled
def _step(p, s, a, dv, v, allowed):  # type: ignore[no-untyped-def]
    """Process one sample; `a` and `dv` are positive in the direction of the event."""
    if math.isnan(a) or math.isnan(dv) or math.isnan(v):
        return s, math.nan, False
    if v < p.v_min:
        return SpinState(0.0, 0.0, 0.0, False), 0.0, False  # noqa: FBT003
    limit = max(p.v_abs, p.v_rel * v)
    g = cusum_step(p.cusum, s.g, a)
    if dv < -0.25 * limit:
        # the wheel is on the other side of the vehicle's speed: this acceleration ends another event (thesis 2.4)
        g = 0.0
    deep = s.deep + p.cusum.dt if dv > p.slip_deep * v else 0.0
    calm = s.calm + p.cusum.dt if dv < 3.0 * limit and abs(a) < p.a_calm else 0.0
    statistic = g
    active = s.active
    if active:
        if dv < 0.5 * limit or calm > p.t_calm:
            active = False
            g = 0.0
    elif allowed and dv > limit and (g > p.cusum.h or deep > p.t_deep):
        active = True
    return SpinState(g, deep, calm, active), statistic, active


@compiled
def _scan(p, s, a, dv, v, allowed):  # type: ignore[no-untyped-def]
    out = np.empty_like(a)
    bits = np.zeros(a.size, dtype=np.bool_)
    for i in range(a.size):
        s, out[i], bits[i] = _step(p, s, p.sign * a[i], p.sign * dv[i], v[i], allowed[i])
    return out, bits, s


def scan(
    p: SpinParams, state: SpinState, a_w_delta: FloatArray, v_w_delta: FloatArray, v_x: FloatArray, allowed: BoolArray
) -> tuple[FloatArray, BoolArray, SpinState]:
    """Run the spin detector of one wheel over a drive or a piece of one.

    Parameters
    ----------
    p : SpinParams
    state : SpinState
    a_w_delta : array (n,)
        Acceleration difference of wheel and vehicle. [m/s²]
    v_w_delta : array (n,)
        Speed difference of wheel and vehicle. [m/s]
    v_x : array (n,)
        Velocity; a coarse one suffices, since it only decides the sign. [m/s]
    allowed : bool array (n,)
        Where an alarm may begin (spin-up: traction coefficient below 0.07).

    Returns
    -------
    g : array (n,)
        Sum of the acceleration difference beyond the drift: the speed lost (or gained) faster than a healthy wheel
        can. [m/s]
    active : bool array (n,)
        Begins when g > h and the speed difference exceeds its limit, or when a quarter of the speed has been missing
        for 0.1 s. Ends when the speed difference has fallen to half its limit, or stays within three limits without
        acceleration for 1 s (a wrong radius); then the sum restarts. NaN in any input: state held, statistic NaN,
        no detection.
    state : SpinState

    Thesis: Eq. (2.3), (2.4) and the text below them (C24-C27).
    """
    g, bits, last = _scan(p, state, a_w_delta, v_w_delta, v_x, allowed)
    final: SpinState = last._replace(active=bool(last.active))
    return g, bits, final
