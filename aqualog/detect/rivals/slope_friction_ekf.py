"""Estimate slip slope and maximum friction jointly, by an extended Kalman filter on a bent tyre curve (thesis [16])."""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import numpy as np

from aqualog.core.compiled import compiled, inlined
from aqualog.core.records import BoolArray, FloatArray, Track
from aqualog.detect.detector import Detector, Scene, Setup
from aqualog.detect.rivals.rival import WholeDrive, alarm_bits, needs_slip
from aqualog.detect.rivals.slope_inputs import PATIENCE, contiguous, driven_wheels, reference_slope
from aqualog.detect.slip_slope.watch import SLIP_SLOPE_DROP
from aqualog.features.smoothing import gain
from aqualog.physics.tyre_brush import brush_force, brush_slope

__all__ = ["MU_FULL", "SLOPE_FRICTION_EKF", "THRESHOLD", "CurveParams", "scan"]

THRESHOLD = 0.75  # [-]
MU_FULL = 0.1  # [-] less than wet ice: nothing but floating
SLIP_SHOWN = 0.01  # [-] a slip that shows friction whatever the traction
OUTLIER = 9.0  # [-] squared residual over its variance
USED_MOST = 0.9  # [-] share of the friction that is used at most: the curve has no slope at all of it
C_LOW, C_HIGH = 1.0, 150.0  # [-]
MU_LOW, MU_HIGH = 0.02, 1.5  # [-]

_brush_force = inlined(brush_force)
_brush_slope = inlined(brush_slope)


class CurveParams(NamedTuple):
    """Variances per step; made by `make`. Slope and friction are carried as logarithms, which keeps them positive."""

    r: float  # of the traction coefficient, of a tyre that slides
    r_slip: float  # of the slip, of one that holds
    q_C: float
    q_mu: float
    q_delta: float
    P_C: float  # at the start
    P_mu: float
    P_delta: float
    P_most: float
    back_C: float  # shares by which slope and friction return to the dry ones: old evidence fades
    back_mu: float

    @staticmethod
    def make(dt: float) -> CurveParams:
        """Slope and friction may change by e^0.2 in a second and return in 20 s and 5 s; the offset by 3e-5."""
        return CurveParams(
            1e-5 / dt, 1.4e-7 / dt, 0.01 * dt, 0.04 * dt, 1e-9 * dt, 0.2**2, 0.2**2, 5e-3**2, 1.0, gain(20.0, dt),
            gain(5.0, dt),
        )  # fmt: skip


@compiled
def _sliding(s, C, m):  # type: ignore[no-untyped-def]
    """Traction of the brush tyre, and its derivatives by ln C and ln mu_max.

    It depends on C s and mu_max alone and scales with both: mu = C dmu/dC + mu_max dmu/dmu_max, which gives the second.
    """
    mu = _brush_force(s, 1.0, m, C, 1.0)
    by_C = _brush_slope(s, 1.0, m, C, 1.0) * s
    return mu, by_C, mu - by_C


@compiled
def _holding(mu, C, m):  # type: ignore[no-untyped-def]
    """Slip at which a brush tyre that holds has this traction, |mu| < mu_max, and its derivatives by ln C, ln mu_max.

    The brush's mu = mu_max (1 - (1 - theta)^3) solved for its slip 3 mu_max theta / C.
    """
    left = (1.0 - abs(mu) / m) ** (1.0 / 3.0)
    s = math.copysign(3.0 * m / C * (1.0 - left), mu)
    return s, -s, s - mu / (C * left * left)


@compiled
def _scan(p, ln_C, ln_m, s, mu, is_active, lows, highs):  # type: ignore[no-untyped-def]
    n = s.size
    slope, friction, offset = np.empty(n), np.empty(n), np.empty(n)
    x = np.array([ln_C, ln_m, 0.0])
    P = np.diag(np.array([p.P_C, p.P_mu, p.P_delta]))
    H = np.empty(3)
    g = np.empty(3)
    for i in range(n):
        x[0] += p.back_C * (ln_C - x[0])
        x[1] += p.back_mu * (ln_m - x[1])
        if not is_active[i] or math.isnan(s[i]) or math.isnan(mu[i]):
            slope[i], friction[i], offset[i] = math.nan, math.nan, x[2]
            continue
        P[0, 0] = min(P[0, 0] + p.q_C, p.P_most)
        P[1, 1] = min(P[1, 1] + p.q_mu, p.P_most)
        P[2, 2] += p.q_delta
        # the road has at least the friction that it shows
        x[1] = min(max(x[1], math.log(max(abs(mu[i]) / USED_MOST, 1e-6))), highs[1])
        C, m = math.exp(x[0]), math.exp(x[1])
        if abs(s[i] - x[2]) < 3.0 * m / C:
            # the slip is the noisy one: as long as the tyre holds, the slip is the measurement
            predicted, H[0], H[1] = _holding(mu[i], C, m)
            H[2] = 1.0
            e, variance = s[i] - predicted - x[2], p.r_slip
        else:
            predicted, H[0], H[1] = _sliding(s[i] - x[2], C, m)
            H[2] = 0.0  # a wheel that slides does not update the radii
            e, variance = mu[i] - predicted, p.r
        for a in range(3):
            g[a] = P[a, 0] * H[0] + P[a, 1] * H[1] + P[a, 2] * H[2]
            variance += H[a] * g[a]
        if e * e > OUTLIER * variance:
            g[2] = 0.0  # the road has changed, not the radii
        for a in range(3):
            x[a] = min(max(x[a] + g[a] / variance * e, lows[a]), highs[a])
            for b in range(3):
                P[a, b] -= g[a] * g[b] / variance
        slope[i], friction[i], offset[i] = math.exp(x[0]), math.exp(x[1]), x[2]
    return slope, friction, offset


def scan(
    p: CurveParams, slip: FloatArray, mu: FloatArray, is_active: BoolArray, *, slope: float, mu_max: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Estimate slope, maximum friction and offset of mu = brush(slip - delta; C, mu_max) over a drive.

    `slip`, `mu` (n,) [-]; NaN, or where `is_active` (n,) is False: left out, everything held. `slope` and `mu_max` at
    the start. Slope and maximum friction (n,) are NaN where left out. Small slip does not identify the friction.
    """
    lows = np.array([math.log(C_LOW), math.log(MU_LOW), -0.02])
    highs = np.array([math.log(C_HIGH), math.log(MU_HIGH), 0.02])
    result: tuple[FloatArray, FloatArray, FloatArray] = _scan(
        p, math.log(slope), math.log(mu_max), *contiguous(slip, mu, is_active), lows, highs,
    )  # fmt: skip
    return result


def run(r: Scene, setup: Setup) -> tuple[Track, ...]:
    """Run the method: one track per driven wheel; statistic: the larger loss, of slope or of maximum friction. [-]

    Thesis [16]: an extended Kalman filter estimates slope and friction of a nonlinear tyre model together; the tyre is
    the brush of section 3.1. A driven wheel that spins shows its friction, so such samples stay in.
    """
    p = CurveParams.make(setup.dt)
    dry = setup.vehicle.mu_max
    tracks = []
    for w in driven_wheels(r, setup):
        slope, mu_max, offset = scan(p, w.slip, w.mu, w.is_active, slope=w.expected, mu_max=dry)
        reference = reference_slope(w, slope, dt=setup.dt)
        loss = 1.0 - np.minimum(slope / reference, mu_max / dry)
        with np.errstate(invalid="ignore"):
            statistic = np.where(w.is_shown | (np.abs(w.slip - offset) > SLIP_SHOWN), loss, np.nan)
        bits = alarm_bits(statistic, setup.threshold, off_share=0.8, patience_s=PATIENCE, dt=setup.dt)
        tracks.append(setup.track(statistic, bits, wheel=w.wheel))
    return tuple(tracks)


SLOPE_FRICTION_EKF = Detector(
    name="slope_friction_ekf",
    title="slip slope and friction by extended Kalman filter",
    meaning="slope and maximum friction of a bent tyre curve, estimated together",
    statistic="statistic",
    start=partial(WholeDrive, run=run),
    kind="rival",
    reference="[16]",
    unit="-",
    threshold=THRESHOLD,
    needs=needs_slip,
    counterpart=SLIP_SLOPE_DROP,
    # full where nine tenths are lost: less friction than wet ice has
    severity=lambda evidence: "full" if evidence.get("statistic_max", 0.0) > 1.0 - MU_FULL else "partial",
)
