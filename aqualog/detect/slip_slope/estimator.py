"""The estimator: filter, change detection, activation and observability as one recursion."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from aqualog.core.compiled import compiled, plain
from aqualog.core.records import BoolArray, FloatArray
from aqualog.detect import cusum
from aqualog.detect.slip_slope import ekf
from aqualog.detect.slip_slope.ekf import Belief, Window
from aqualog.detect.slip_slope.tuning import Params, Tuning

__all__ = ["STATUS", "Estimate", "State", "cusum_input", "initial_state", "scan"]

STATUS = {
    0: "estimating",
    1: "slope frozen: the traction is too even to distinguish slope from offset",
    2: "blind: both axles slip alike",
    3: "differential traction too large",
    4: "a wheel spins",
    5: "not active",
}
"""What each sample was used for; 0 and 1 update the slope."""

ESTIMATING, FROZEN, BLIND, TOO_LARGE, SPINNING, INACTIVE = range(6)
K_MIN, K_MAX = 1.0 / 300.0, 1.0  # slopes from 1 to 300
BETA_MIN, BETA_MAX = 0.2, 5.0
K_USUAL = 1.0 / 33.0


class Before(NamedTuple):
    """Inverse slope, offset and its variance when a sum was last zero: before the change that it shows began."""

    k: float
    delta: float
    P_dd: float


class State(NamedTuple):
    """The state from sample to sample."""

    belief: Belief
    window: Window
    g_drop: float
    g_rise: float
    before_drop: Before
    before_rise: Before
    calm: Before  # before the alarm that the estimator settles from
    settling: int  # samples for which the offset rests; below zero: in which slope and offset are sorted out anew


@dataclass(frozen=True, slots=True)
class Estimate:
    """Estimates of a drive or a piece of one, arrays (n,).

    `slope` = C_s / F_z of axle i, `slope_sd` its standard deviation by the filter; `beta` and `offset` as in `Belief`.
    `innovation` and `innovation_sd` (NaN where not updated); `g_drop`, `g_rise` the two sums [s]. `alarm`: 1 at the
    sample at which a drop of the slope was found, -1 at a rise, else 0. `status`: a key of `STATUS`. `beta_told`:
    whether the window identifies the ratio.
    """

    slope: FloatArray
    slope_sd: FloatArray
    beta: FloatArray
    offset: FloatArray
    innovation: FloatArray
    innovation_sd: FloatArray
    g_drop: FloatArray
    g_rise: FloatArray
    alarm: FloatArray
    status: FloatArray
    beta_told: FloatArray


def initial_state(tuning: Tuning, *, slope: float, beta: float = 1.0) -> State:
    """Return the state before the first sample: slope and ratio from the vehicle file, the offset unknown."""
    k = 1.0 / slope
    # the prior is relative to the usual slope, so that a soft or a stiff tyre starts as well known
    sd_k = tuning.sd_k * k / K_USUAL
    belief = Belief(k, beta, 0.0, sd_k**2, 0.0, 0.0, tuning.sd_beta**2, 0.0, tuning.sd_delta**2)
    before = Before(belief.k, belief.delta, belief.P_dd)
    return State(belief, ekf.EMPTY, 0.0, 0.0, before, before, before, 0)


@compiled
def cusum_input(innovation, direction, adapted):  # type: ignore[no-untyped-def]
    """Return the statistic to sum: the prediction error, or its projection on the sign of the traction.

    Parameters
    ----------
    innovation : float
        epsilon = y - h(x, 0). [-]
    direction : float
        Has the sign of the slip: the differential traction mu_delta. The thesis takes the differential slip. There the
        radii's error is often larger than the slip, so that its sign does not alternate. With the estimated offset
        removed it does (E12), but it then holds the same noise as epsilon, and sgn(u + v) v drifts upwards by up to
        0.8 of the noise's rms. The traction has neither fault. [-]
    adapted : bool
        True: sgn(direction) epsilon, positive where the slip is larger than the slope explains, whichever way the
        traction goes. False: epsilon.

    Thesis: Eq. (3.23); adapted, (3.25) with E12. The sums (3.24) are `detect.cusum.step`.
    """
    if not adapted:
        return innovation
    if direction > 0.0:
        return innovation
    return -innovation if direction < 0.0 else 0.0


@compiled
def _is_at_bound(k):  # type: ignore[no-untyped-def]
    return k <= 1.01 * K_MIN or k >= 0.99 * K_MAX


@compiled
def _bounded(b, learn_delta):  # type: ignore[no-untyped-def]
    """Return the belief with slope and ratio inside their bounds.

    The offset moves by its correlation with the slope. If only the slope were held at its bound, it would leave an
    error that pushes the offset further with every sample.
    """
    k = min(max(b.k, K_MIN), K_MAX)
    delta = b.delta + b.P_kd / b.P_kk * (k - b.k) if learn_delta and k != b.k else b.delta
    return Belief(
        k, min(max(b.beta, BETA_MIN), BETA_MAX), delta, b.P_kk, b.P_kb, b.P_kd, b.P_bb, b.P_bd, b.P_dd,
    )  # fmt: skip


@compiled
def _changed(p, b, before):  # type: ignore[no-untyped-def]
    """Return the belief after an alarm: the slope is unknown again; ratio and offset are the car's.

    The offset returns to its value before the change.
    """
    return Belief(b.k, b.beta, before.delta, max(p.P_k_reset, b.P_kk), 0.0, 0.0, b.P_bb, 0.0, before.P_dd)


@compiled
def _released(p, b, calm, window):  # type: ignore[no-untyped-def]
    """Allow that a change ascribed to the road is the car's: a radius may have changed at once.

    A slope that no tyre has returns to the one before, with an unknown offset. Otherwise slope and offset become
    uncertain together, along the line on which they predict the same slip at the traction of the last seconds. Only
    traction that varies can distinguish the two (E10).
    """
    if _is_at_bound(b.k):
        P_kk = (p.sd_k * calm.k / K_USUAL) ** 2
        return Belief(calm.k, b.beta, calm.delta, P_kk, 0.0, 0.0, b.P_bb, 0.0, p.P_delta_start)
    mu = window.mean_i - b.beta * window.mean_j
    along = -1.0 / mu if abs(mu) > p.mu_min else 0.0
    P = p.P_delta_release
    return Belief(
        b.k, b.beta, b.delta, b.P_kk + along * along * P, b.P_kb, b.P_kd + along * P, b.P_bb, b.P_bd, b.P_dd + P,
    )  # fmt: skip


@compiled
def _faded(p, g):  # type: ignore[no-untyped-def]
    """Decay a sum while the estimator is blind: old evidence fades; less than one sample of drift becomes zero."""
    return g * p.fade if g > p.g_trace else 0.0


@compiled
def _scan(p, sums, state, y, mu_i, rho_mu_j, is_active, out):  # type: ignore[no-untyped-def]
    b, window, g_drop, g_rise, before_drop, before_rise, calm, settling = state
    for i in range(y.size):
        innovation, variance, alarm, status, beta_told = math.nan, math.nan, 0.0, INACTIVE, False
        if is_active[i] and math.isfinite(y[i]) and math.isfinite(mu_i[i]) and math.isfinite(rho_mu_j[i]):
            mu_delta = mu_i[i] - b.beta * rho_mu_j[i]
            if abs(mu_delta) > p.mu_max:
                status = TOO_LARGE
            elif abs(y[i] - b.delta) > p.s_max:
                status = SPINNING
            else:
                window = ekf.window_step(window, p.keep, p.dt, mu_i[i], rho_mu_j[i])
                has_traction = abs(mu_delta) >= p.mu_min and abs(y[i] - b.delta) >= p.s_min
                k_told = ekf.sd_slope(window, b.beta, p.r_density) < p.told_k * b.k
                beta_told = ekf.sd_beta(window, b.k, b.beta, p.r_density) < p.told_beta
                status = BLIND if not has_traction else (ESTIMATING if k_told else FROZEN)
                # while evidence of a change gathers, and for a while after it, the offset rests
                learn_delta = settling < 0 or (settling == 0 and max(g_drop, g_rise) < p.h_rest)
                b = ekf.predict(
                    b,
                    p.q_k if has_traction and k_told else 0.0,
                    p.q_beta if has_traction and beta_told else 0.0,
                    p.q_delta if learn_delta else 0.0,
                )
                b, innovation, variance = ekf.update(
                    b, y[i], mu_i[i], rho_mu_j[i], p.r, has_traction, has_traction and beta_told, learn_delta
                )
                b = _bounded(b, learn_delta)
                if settling > 0:
                    # evidence of another change is used up first
                    settling -= 1 if settling > 1 or max(g_drop, g_rise) < p.h_rest else 0
                    if settling == 0:
                        b = _released(p, b, calm, window)
                        settling = -p.sort
                elif settling < 0:
                    settling += 1
                    g_drop, g_rise = 0.0, 0.0
                if has_traction:
                    if settling >= 0:
                        nu = cusum_input(innovation, mu_delta, p.adapted)
                        g_drop = cusum.step(sums, g_drop, nu)
                        g_rise = cusum.step(sums, g_rise, -nu)
                else:
                    g_drop, g_rise = _faded(p, g_drop), _faded(p, g_rise)
                if g_drop == 0.0:
                    before_drop = Before(b.k, b.delta, b.P_dd)
                if g_rise == 0.0:
                    before_rise = Before(b.k, b.delta, b.P_dd)
                if g_drop > p.h or g_rise > p.h:
                    alarm = 1.0 if g_drop > p.h else -1.0
                    if settling > 0 and _is_at_bound(b.k):
                        # no slope explains it: not the road has changed, but a radius
                        b = _released(p, b, calm, window)
                        settling = -p.sort
                    else:
                        before = before_drop if g_drop > p.h else before_rise
                        if settling == 0:
                            calm = before
                            settling = p.settle
                        b = _changed(p, b, before)
                    g_drop, g_rise = 0.0, 0.0
        if status > BLIND:
            # radii go on drifting while nothing can be seen of them
            b = ekf.predict(b, 0.0, 0.0, p.q_delta)
            window = ekf.window_aged(window, p.keep)
            g_drop, g_rise = _faded(p, g_drop), _faded(p, g_rise)
        out[0, i] = 1.0 / b.k
        out[1, i] = math.sqrt(b.P_kk) / (b.k * b.k)
        out[2, i] = b.beta
        out[3, i] = b.delta
        out[4, i] = innovation
        out[5, i] = math.sqrt(variance)
        out[6, i] = g_drop
        out[7, i] = g_rise
        out[8, i] = alarm
        out[9, i] = status
        out[10, i] = beta_told
    return State(b, window, g_drop, g_rise, before_drop, before_rise, calm, settling)


def scan(
    p: Params, state: State, s_delta: FloatArray, mu_i: FloatArray, rho_mu_j: FloatArray, is_active: BoolArray
) -> tuple[Estimate, State]:
    """Estimate the slip slope over a drive or a piece of one.

    Parameters
    ----------
    state : State
        From `initial_state` or the piece before.
    s_delta : array (n,)
        Differential slip, or the slip of a driven axle where the other rolls freely. [-]
    mu_i, rho_mu_j : array (n,)
        Traction coefficients, see `physics.differential`; zeros for rho_mu_j give the direct method of a known
        velocity. NaN in any: sample left out. [-]
    is_active : bool array (n,)
        From `activation.inactive_reason`.

    Returns
    -------
    estimate : Estimate
    state : State

    Thesis: Eq. (3.20) to (3.25) with E8, E10 (parameters that the data cannot identify are frozen), E11 and E12. E11:
    sums are clamped at zero. An alarm resets them and the knowledge of the slope, and the offset rests for half a
    minute. Then slope and offset are separated anew for 5 s without change detection.
    """
    out = np.empty((11, s_delta.size))
    sums = cusum.CusumParams(p.zeta, p.h, math.inf, p.dt)
    inputs = (*(np.asarray(x, dtype=np.float64) for x in (s_delta, mu_i, rho_mu_j)), np.asarray(is_active, dtype=bool))
    last = _scan(p, sums, state, *plain(*inputs), out)
    return Estimate(*out), last
