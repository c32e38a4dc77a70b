"""Extended Kalman filter [kalman1960] of inverse slope, slope ratio and slip offset; what the last seconds show."""

from __future__ import annotations

import math
from typing import NamedTuple

from aqualog.core.compiled import compiled, inlined
from aqualog.physics import differential

__all__ = ["EMPTY", "Belief", "Window", "predict", "sd_beta", "sd_slope", "update", "window_aged", "window_step"]

_predicted_slip = inlined(differential.predicted_differential_slip)
_jacobian = inlined(differential.jacobian)


class Belief(NamedTuple):
    """State x = [k, beta, delta] and its covariance, all dimensionless.

    `k` = 1 / C_i, `beta` slope of axle i over axle j, `delta` offset of the differential slip.
    """

    k: float
    beta: float
    delta: float
    P_kk: float
    P_kb: float
    P_kd: float
    P_bb: float
    P_bd: float
    P_dd: float


@compiled
def predict(b, q_k, q_beta, q_delta):  # type: ignore[no-untyped-def]
    """Random walk of each parameter; `q_*` are variances of one step, 0 for what is frozen."""
    return Belief(
        b.k, b.beta, b.delta, b.P_kk + q_k, b.P_kb, b.P_kd, b.P_bb + q_beta, b.P_bd, b.P_dd + q_delta,
    )  # fmt: skip


@compiled
def update(b, y, mu_i, rho_mu_j, r, learn_k, learn_beta, learn_delta):  # type: ignore[no-untyped-def]
    """Update the belief with one differential slip.

    Parameters
    ----------
    b : Belief
        Predicted.
    y : float
        Differential slip. [-]
    mu_i, rho_mu_j : float
        As in `physics.differential`. [-]
    r : float
        Variance of y. [-]
    learn_k, learn_beta, learn_delta : bool
        False: the parameter keeps its value and its uncertainty still counts (Schmidt's form of the gain
        [schmidt1966]).

    Returns
    -------
    belief : Belief
    innovation, variance : float
        epsilon = y - h(x, 0) and its expected variance H P H' + r.

    The covariance is updated in Joseph's form [bucy1968], which holds for any gain and keeps it symmetric and positive.
    Thesis: Eq. (3.20) to (3.22), with the sign of the offset as in E8.
    """
    H_k, H_b, _ = _jacobian(mu_i, rho_mu_j, b.k, b.beta)
    innovation = y - _predicted_slip(mu_i, rho_mu_j, b.k, b.beta, b.delta)
    # P H'
    c_k = b.P_kk * H_k + b.P_kb * H_b + b.P_kd
    c_b = b.P_kb * H_k + b.P_bb * H_b + b.P_bd
    c_d = b.P_kd * H_k + b.P_bd * H_b + b.P_dd
    S = H_k * c_k + H_b * c_b + c_d + r
    K_k = c_k / S if learn_k else 0.0
    K_b = c_b / S if learn_beta else 0.0
    K_d = c_d / S if learn_delta else 0.0
    # rows of A = 1 - K H, then A P, then A P A' + K r K'
    a_kk, a_kb, a_kd = 1.0 - K_k * H_k, -K_k * H_b, -K_k
    a_bk, a_bb, a_bd = -K_b * H_k, 1.0 - K_b * H_b, -K_b
    a_dk, a_db, a_dd = -K_d * H_k, -K_d * H_b, 1.0 - K_d
    kk = a_kk * b.P_kk + a_kb * b.P_kb + a_kd * b.P_kd
    kb = a_kk * b.P_kb + a_kb * b.P_bb + a_kd * b.P_bd
    kd = a_kk * b.P_kd + a_kb * b.P_bd + a_kd * b.P_dd
    bk = a_bk * b.P_kk + a_bb * b.P_kb + a_bd * b.P_kd
    bb = a_bk * b.P_kb + a_bb * b.P_bb + a_bd * b.P_bd
    bd = a_bk * b.P_kd + a_bb * b.P_bd + a_bd * b.P_dd
    dk = a_dk * b.P_kk + a_db * b.P_kb + a_dd * b.P_kd
    db = a_dk * b.P_kb + a_db * b.P_bb + a_dd * b.P_bd
    dd = a_dk * b.P_kd + a_db * b.P_bd + a_dd * b.P_dd
    return (
        Belief(
            b.k + K_k * innovation,
            b.beta + K_b * innovation,
            b.delta + K_d * innovation,
            kk * a_kk + kb * a_kb + kd * a_kd + K_k * r * K_k,
            kk * a_bk + kb * a_bb + kd * a_bd + K_k * r * K_b,
            kk * a_dk + kb * a_db + kd * a_dd + K_k * r * K_d,
            bk * a_bk + bb * a_bb + bd * a_bd + K_b * r * K_b,
            bk * a_dk + bb * a_db + bd * a_dd + K_b * r * K_d,
            dk * a_dk + db * a_db + dd * a_dd + K_d * r * K_d,
        ),
        innovation,
        S,
    )


_TINY = 1e-12


class Window(NamedTuple):
    """Exponentially weighted moments of the traction coefficients mu_i and rho mu_j.

    `seconds` is the weight of the window: time driven, at most its time constant.
    """

    seconds: float
    mean_i: float
    mean_j: float
    var_i: float
    cov: float
    var_j: float


EMPTY = Window(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@compiled
def window_step(w, keep, dt, mu_i, rho_mu_j):  # type: ignore[no-untyped-def]
    """Add one sample; `keep` = exp(-dt / tau). Deviations are from the old and the new mean, so nothing cancels."""
    seconds = w.seconds * keep + dt
    share = dt / seconds
    d_i, d_j = mu_i - w.mean_i, rho_mu_j - w.mean_j
    rest = 1.0 - share
    return Window(
        seconds,
        w.mean_i + share * d_i,
        w.mean_j + share * d_j,
        rest * (w.var_i + share * d_i * d_i),
        rest * (w.cov + share * d_i * d_j),
        rest * (w.var_j + share * d_j * d_j),
    )


@compiled
def window_aged(w, keep):  # type: ignore[no-untyped-def]
    """Return the window after a sample without data."""
    return Window(w.seconds * keep, w.mean_i, w.mean_j, w.var_i, w.cov, w.var_j)


@compiled
def _variance_of_difference(w, beta):  # type: ignore[no-untyped-def]
    return max(w.var_i - 2.0 * beta * w.cov + beta * beta * w.var_j, 0.0)


@compiled
def sd_slope(w, beta, r):  # type: ignore[no-untyped-def]
    """Return the standard deviation with which the window alone gives 1 / C, the offset unknown.

    Infinite at a constant differential traction, where slope and offset cannot be distinguished (E10). `r` is the
    spectral density of the slip's noise. [s]
    """
    return math.sqrt(r / max(w.seconds * _variance_of_difference(w, beta), _TINY))


@compiled
def sd_beta(w, k, beta, r):  # type: ignore[no-untyped-def]
    """Return the standard deviation with which the window alone gives the slope ratio, slope and offset unknown.

    Infinite at a fixed torque split, where both traction coefficients go together (E10).
    """
    var_u = _variance_of_difference(w, beta)
    cov_uj = w.cov - beta * w.var_j
    own = w.var_j - (cov_uj * cov_uj / var_u if var_u > _TINY else 0.0)
    return math.sqrt(r / max(w.seconds * k * k * own, _TINY))
