"""Slip slope by a linear Kalman filter with a change detection on its residual (thesis [15])."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from aqualog.core.compiled import compiled
from aqualog.core.records import BoolArray, FloatArray, Track
from aqualog.detect.cusum import CusumParams
from aqualog.detect.cusum import step as cusum_step
from aqualog.detect.detector import Scene, Setup
from aqualog.detect.rivals.rival import needs_slip, rival
from aqualog.detect.rivals.slope_inputs import line_tracks
from aqualog.detect.slip_slope import ekf
from aqualog.detect.slip_slope.ekf import Belief
from aqualog.detect.slip_slope.estimator import K_MAX, K_MIN
from aqualog.detect.slip_slope.watch import SLIP_SLOPE_DROP

__all__ = ["SLOPE_KALMAN", "THRESHOLD", "KalmanParams", "scan"]

THRESHOLD = 0.65  # [-]

_predict = ekf.predict
_update = ekf.update


class KalmanParams(NamedTuple):
    """Variances per step and the change detection; made by `make`.

    Noise and random walks are those of the thesis' own filter, so that the comparison is fair.
    """

    r: float
    q_k: float
    q_delta: float
    P_k: float  # at the start
    P_delta: float
    P_k_reset: float  # after an alarm of the change detection
    nu: float
    h: float
    dt: float

    @staticmethod
    def make(dt: float) -> KalmanParams:
        """White noise of 1.4e-7 s; a slope that wanders by 2.3 % in a minute; residuals of 2e-3 found after 4 s."""
        return KalmanParams(1.4e-7 / dt, 1e-8 * dt, 1e-9 * dt, 0.01**2, 5e-3**2, 0.05**2, 1.0e-3, 4.0e-3, dt)


@compiled
def _scan(p, sums, belief, s, mu, is_active):  # type: ignore[no-untyped-def]
    slope = np.empty_like(s)
    offset = np.empty_like(s)
    alarm = np.zeros_like(s)
    b = belief
    up, down = 0.0, 0.0
    for i in range(s.size):
        if not is_active[i] or math.isnan(s[i]) or math.isnan(mu[i]):
            slope[i], offset[i] = math.nan, b.delta
            continue
        b = _predict(b, p.q_k, 0.0, p.q_delta)
        b, residual, _ = _update(b, s[i], mu[i], 0.0, p.r, True, False, True)  # noqa: FBT003
        k = min(max(b.k, K_MIN), K_MAX)
        b = Belief(k, b.beta, b.delta, b.P_kk, b.P_kb, b.P_kd, b.P_bb, b.P_bd, b.P_dd)
        up = cusum_step(sums, up, residual)
        down = cusum_step(sums, down, -residual)
        if up > p.h or down > p.h:
            alarm[i] = 1.0 if up > p.h else -1.0
            b = Belief(b.k, b.beta, b.delta, max(b.P_kk, p.P_k_reset), 0.0, 0.0, b.P_bb, 0.0, b.P_dd)
            up, down = 0.0, 0.0
        slope[i], offset[i] = 1.0 / b.k, b.delta
    return slope, offset, alarm


def scan(
    p: KalmanParams, slip: FloatArray, mu: FloatArray, is_active: BoolArray, *, slope: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Estimate slope and offset of slip = mu / C + delta over a drive.

    Parameters
    ----------
    p : KalmanParams
    slip, mu : array (n,)
        NaN: left out. [-]
    is_active : bool array (n,)
        False: left out, everything held.
    slope : float
        At the start. [-]

    Returns
    -------
    slope, offset : array (n,)
        C_s / F_z within 1 ... 300, NaN where left out; offset of the slip. [-]
    alarm : array (n,)
        1 where a residual above zero was found, -1 below, else 0: the slope is unknown again from there.

    The filter of `detect.slip_slope.ekf` with one driven axle, which is linear: (3.20) at mu_j = 0. Two sums of the
    residual, reset after an alarm. Observability is not checked.
    """
    start = Belief(1.0 / slope, 1.0, 0.0, p.P_k, 0.0, 0.0, 0.0, 0.0, p.P_delta)
    result: tuple[FloatArray, FloatArray, FloatArray] = _scan(
        p, CusumParams(p.nu, p.h, math.inf, p.dt), start, np.ascontiguousarray(slip, dtype=np.float64),
        np.ascontiguousarray(mu, dtype=np.float64), np.ascontiguousarray(is_active, dtype=np.bool_),
    )  # fmt: skip
    return result


def run(r: Scene, setup: Setup) -> tuple[Track, ...]:
    """Run the method: one track per driven wheel; the statistic is the loss of slope against the dry one. [-]

    Thesis [15]: slope and offset by a Kalman filter whose covariance is raised when a CUSUM of its residual alarms.
    """
    p = KalmanParams.make(setup.dt)
    return line_tracks(r, setup, lambda w, slip: scan(p, slip, w.mu, w.is_active, slope=w.expected)[0])


SLOPE_KALMAN = rival(
    "slope_kalman",
    "slip slope by Kalman filter with CUSUM",
    "slope and offset of the slip by a linear Kalman filter that a CUSUM of its residual makes quick",
    run,
    reference="[15]",
    unit="-",
    threshold=THRESHOLD,
    needs=needs_slip,
    counterpart=SLIP_SLOPE_DROP,
)
