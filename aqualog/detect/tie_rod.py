"""Detect tie-rod forces that dry road cannot explain, by a CUSUM."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import BoolArray, FloatArray
from aqualog.detect.cusum import CusumParams
from aqualog.detect.thresholds import DEFAULT

__all__ = ["SIGMA", "params", "scaled_residual"]

# [N, N m] scatter of a good model on dry road, where none is given (K)
SIGMA = {"tie_rod": 60.0, "steering_torque": 0.5}
SHARE = 0.10  # of the modelled force: a coarse model is off in proportion too (thesis 2.4)
CLIP = 12.0  # [-] a kerb shows more for a moment than a spin-down ever does
V_MIN = 8.0  # [m/s]
A_Y_MAX = 4.0  # [m/s^2] beyond, the lateral force is out of the range in which the polynomial was found


def params(dt: float, threshold: float = DEFAULT.tie_rod) -> CusumParams:
    """Drift of four scatters, so that neither the model's error nor early partial aquaplaning raises an alarm (C60)."""
    return CusumParams(4.0, threshold, 3.0 * threshold, dt)


def scaled_residual(
    measured: FloatArray,
    modelled: FloatArray,
    v_x: FloatArray,
    a_y: FloatArray,
    is_braking: BoolArray,
    *,
    sigma: float,
) -> FloatArray:
    """Return measured minus modelled force over the scatter that it has on dry road.

    Parameters
    ----------
    measured, modelled : array (n,)
        Tie-rod force [N] or steering torque [N·m], low-passed alike.
    v_x : array (n,)
        [m/s]
    a_y : array (n,)
        Low-passed. [m/s²]
    is_braking : bool array (n,)
        A braking force acts on this wheel: brake forces pull at the rods too.
    sigma : float
        Scatter on dry road, > 0. [N, N m]

    Returns
    -------
    z : array (n,)
        |measured - modelled| / (sigma + 0.1 |modelled|), at most 12; 0 where the model does not hold, NaN where a
        signal is missing. [-]

    Thesis: section 2.4 (C59-C63). The amount counts, not the sign: the design of the axle decides whether a resisting
    wheel presses or pulls its rod.
    """
    with np.errstate(invalid="ignore"):
        z = np.minimum(np.abs(measured - modelled) / (sigma + SHARE * np.abs(modelled)), CLIP)
        holds = (v_x > V_MIN) & (np.abs(a_y) < A_Y_MAX) & ~is_braking
    return np.where(np.isnan(z), np.nan, np.where(holds, z, 0.0))
