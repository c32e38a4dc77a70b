"""Slip slope by recursive least squares with forgetting (thesis [14], [17])."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from aqualog.core.compiled import compiled
from aqualog.core.records import BoolArray, FloatArray, Track
from aqualog.detect.detector import Scene, Setup
from aqualog.detect.rivals.rival import needs_slip, rival
from aqualog.detect.rivals.slope_inputs import line_tracks
from aqualog.detect.slip_slope.estimator import K_MAX, K_MIN
from aqualog.detect.slip_slope.watch import SLIP_SLOPE_DROP

__all__ = ["SLOPE_RLS", "THRESHOLD", "RlsParams", "scan"]

THRESHOLD = 0.7  # [-]
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
def _scan(p, k, s, mu, is_active):  # type: ignore[no-untyped-def]
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


def scan(
    p: RlsParams, slip: FloatArray, mu: FloatArray, is_active: BoolArray, *, slope: float
) -> tuple[FloatArray, FloatArray]:
    """Estimate slope and offset of slip = mu / C + delta over a drive.

    Parameters
    ----------
    p : RlsParams
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

    Least squares with a forgetting factor per parameter: slope with 8 s, offset with 60 s.
    """
    result: tuple[FloatArray, FloatArray] = _scan(
        p, 1.0 / slope, np.ascontiguousarray(slip, dtype=np.float64), np.ascontiguousarray(mu, dtype=np.float64),
        np.ascontiguousarray(is_active, dtype=np.bool_),
    )  # fmt: skip
    return result


def run(r: Scene, setup: Setup) -> tuple[Track, ...]:
    """Run the method: one track per driven wheel; the statistic is the loss of slope against the dry one. [-]

    Thesis [14], [17]: (3.14) by recursive least squares. [17] makes the maximum friction a linear function of the
    slope, which orders drives as the slope does, so that the slope itself is compared.
    """
    p = RlsParams.make(setup.dt)
    return line_tracks(r, setup, lambda w, slip: scan(p, slip, w.mu, w.is_active, slope=w.expected)[0])


SLOPE_RLS = rival(
    "slope_rls",
    "slip slope by recursive least squares",
    "slip on traction by least squares with forgetting; a slope far below the dry one means little friction",
    run,
    reference="[14], [17]",
    unit="-",
    threshold=THRESHOLD,
    needs=needs_slip,
    counterpart=SLIP_SLOPE_DROP,
)
