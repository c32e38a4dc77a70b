"""Information of the last seconds of driving about slope and slope ratio, over a sliding window."""

from __future__ import annotations

import math
from typing import NamedTuple

from aqualog.core.compiled import compiled

__all__ = ["EMPTY", "Window", "aged", "sd_beta", "sd_slope", "step"]

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
def step(w, keep, dt, mu_i, rho_mu_j):  # type: ignore[no-untyped-def]
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
def aged(w, keep):  # type: ignore[no-untyped-def]
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
