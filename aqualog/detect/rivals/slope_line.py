"""Slip slope as a line: by recursive least squares with forgetting (thesis [14], [17]), by a Kalman filter ([15])."""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import numpy as np

from aqualog.core.compiled import compiled
from aqualog.core.records import BoolArray, FloatArray, Track
from aqualog.detect.cusum import CusumParams
from aqualog.detect.cusum import step as cusum_step
from aqualog.detect.detector import Detector, Scene, Setup
from aqualog.detect.rivals.rival import WholeDrive, needs_slip
from aqualog.detect.rivals.slope_inputs import contiguous, line_tracks
from aqualog.detect.slip_slope.ekf import Belief, predict, update
from aqualog.detect.slip_slope.estimator import K_MAX, K_MIN
from aqualog.detect.slip_slope.watch import SLIP_SLOPE_DROP

__all__ = ["SLOPE_KALMAN", "SLOPE_RLS", "KalmanParams", "RlsParams", "scan_kalman", "scan_rls"]

RLS_THRESHOLD = 0.7  # [-]
R = 1.4e-7  # [s] spectral density of the slip's noise, the unit of the covariances


class RlsParams(NamedTuple):
    """Forgetting factors per step and bounds; made by `make`."""

    keep_k: float  # of the inverse slope, which changes with the road
    keep_delta: float  # of the offset, which is the radii's
    P_k: float  # at the start, and at most: without traction forgetting alone would let it grow without bound
    P_delta: float

    @staticmethod
    def make(dt: float) -> RlsParams:
        """Memories of 8 s and 60 s; at the start 0.01 of 1 / C and 5e-3 of the offset, as of the thesis' own filter."""
        return RlsParams(math.exp(-dt / 8.0), math.exp(-dt / 60.0), dt * 0.01**2 / R, dt * 5e-3**2 / R)


@compiled
def _rls(p, k, s, mu, is_active):  # type: ignore[no-untyped-def]
    slope = np.empty_like(s)
    offset = np.empty_like(s)
    delta, P_k, P_delta = 0.0, p.P_k, p.P_delta
    for i in range(s.size):
        if not is_active[i] or math.isnan(s[i]) or math.isnan(mu[i]):
            slope[i], offset[i] = math.nan, delta
            continue
        e = s[i] - k * mu[i] - delta
        a = P_k * mu[i] / p.keep_k
        b = P_delta / p.keep_delta
        scale = 1.0 + a * mu[i] + b
        k = min(max(k + a / scale * e, K_MIN), K_MAX)
        delta += b / scale * e
        # each parameter's own line of the covariance alone, as if the other were known (multiple forgetting)
        P_k = min(P_k / (p.keep_k + P_k * mu[i] * mu[i]), p.P_k)
        P_delta = min(P_delta / (p.keep_delta + P_delta), p.P_delta)
        slope[i], offset[i] = 1.0 / k, delta
    return slope, offset


def scan_rls(
    p: RlsParams, slip: FloatArray, mu: FloatArray, is_active: BoolArray, *, slope: float
) -> tuple[FloatArray, FloatArray]:
    """Estimate slope and offset of slip = mu / C + delta over a drive.

    `slip`, `mu` (n,) [-]; NaN, or where `is_active` (n,) is False: left out, everything held. `slope` at the start.
    The slope C_s / F_z (n,) is within 1 ... 300, NaN where left out; the offset is that of the slip. [-]

    Least squares with a forgetting factor per parameter: slope with 8 s, offset with 60 s.
    """
    result: tuple[FloatArray, FloatArray] = _rls(p, 1.0 / slope, *contiguous(slip, mu, is_active))
    return result


def run_rls(r: Scene, setup: Setup) -> tuple[Track, ...]:
    """Run the method: one track per driven wheel; the statistic is the loss of slope against the dry one. [-]

    Thesis [14], [17]: (3.14) by recursive least squares. [17] makes the maximum friction a linear function of the
    slope, which orders drives as the slope does, so that the slope itself is compared.
    """
    p = RlsParams.make(setup.dt)
    return line_tracks(r, setup, lambda w, slip: scan_rls(p, slip, w.mu, w.is_active, slope=w.expected)[0])


SLOPE_RLS = Detector(
    name="slope_rls",
    title="slip slope by recursive least squares",
    meaning="slip on traction by least squares with forgetting; a slope far below the dry one means little friction",
    statistic="statistic",
    start=partial(WholeDrive, run=run_rls),
    kind="rival",
    reference="[14], [17]",
    unit="-",
    threshold=RLS_THRESHOLD,
    needs=needs_slip,
    counterpart=SLIP_SLOPE_DROP,
)


KALMAN_THRESHOLD = 0.65  # [-]


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
def _kalman(p, sums, belief, s, mu, is_active):  # type: ignore[no-untyped-def]
    slope = np.empty_like(s)
    offset = np.empty_like(s)
    alarm = np.zeros_like(s)
    b = belief
    up, down = 0.0, 0.0
    for i in range(s.size):
        if not is_active[i] or math.isnan(s[i]) or math.isnan(mu[i]):
            slope[i], offset[i] = math.nan, b.delta
            continue
        b = predict(b, p.q_k, 0.0, p.q_delta)
        b, residual, _ = update(b, s[i], mu[i], 0.0, p.r, True, False, True)  # noqa: FBT003
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


def scan_kalman(
    p: KalmanParams, slip: FloatArray, mu: FloatArray, is_active: BoolArray, *, slope: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Estimate slope and offset as `scan_rls`, and the alarms (n,) of the change detection.

    An alarm is 1 where a residual above zero was found, -1 below, else 0: the slope is unknown again from there. The
    filter of `detect.slip_slope.ekf` with one driven axle is linear: (3.20) at mu_j = 0. Two sums of the residual,
    reset after an alarm. Observability is not checked.
    """
    start = Belief(1.0 / slope, 1.0, 0.0, p.P_k, 0.0, 0.0, 0.0, 0.0, p.P_delta)
    sums = CusumParams(p.nu, p.h, math.inf, p.dt)
    result: tuple[FloatArray, FloatArray, FloatArray] = _kalman(p, sums, start, *contiguous(slip, mu, is_active))
    return result


def run_kalman(r: Scene, setup: Setup) -> tuple[Track, ...]:
    """Run the method: one track per driven wheel; the statistic is the loss of slope against the dry one. [-]

    Thesis [15]: slope and offset by a Kalman filter whose covariance is raised when a CUSUM of its residual alarms.
    """
    p = KalmanParams.make(setup.dt)
    return line_tracks(r, setup, lambda w, slip: scan_kalman(p, slip, w.mu, w.is_active, slope=w.expected)[0])


SLOPE_KALMAN = Detector(
    name="slope_kalman",
    title="slip slope by Kalman filter with CUSUM",
    meaning="slope and offset of the slip by a linear Kalman filter that a CUSUM of its residual makes quick",
    statistic="statistic",
    start=partial(WholeDrive, run=run_kalman),
    kind="rival",
    reference="[15]",
    unit="-",
    threshold=KALMAN_THRESHOLD,
    needs=needs_slip,
    counterpart=SLIP_SLOPE_DROP,
)
