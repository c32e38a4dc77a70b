"""The slip-slope estimator at 100 Hz on traction and slip with the noise of a road."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import BoolArray, FloatArray
from aqualog.detect.slip_slope import estimator
from aqualog.detect.slip_slope.tuning import Params, Tuning
from aqualog.figures.study import HIGH_SLOPE

__all__ = ["DT", "ROAD_NOISE", "noise", "run"]

DT = 0.01  # [s]
ROAD_NOISE = 5e-4  # [-] rms of the slip as measured on a road (V, Gustafsson [gustafsson2000])
_KEEP = 0.48 ** (DT / 0.2)  # its memory from sample to sample: a correlation of 0.48 after 0.2 s


def run(
    tuning: Tuning,
    s_delta: FloatArray,
    mu_i: FloatArray,
    rho_mu_j: FloatArray,
    *,
    slope: float = HIGH_SLOPE,
    beta: float = 1.0,
    active: BoolArray | None = None,
) -> estimator.Estimate:
    """The estimator over samples (n,), from a slope and ratio at the start; `active` everywhere by default."""
    used = np.ones(s_delta.size, dtype=np.bool_) if active is None else active
    state = estimator.initial_state(tuning, slope=slope, beta=beta)
    return estimator.scan(Params.make(tuning, DT), state, s_delta, mu_i, rho_mu_j, used)[0]


def noise(rng: np.random.Generator, n: int) -> FloatArray:
    """Noise of the differential slip as measured on a road, (n,). [-]"""
    white = ROAD_NOISE * np.sqrt(1.0 - _KEEP**2) * rng.standard_normal(n)
    out = np.empty(n)
    last = 0.0
    for i in range(n):
        last = _KEEP * last + white[i]
        out[i] = last
    return out
