"""Detect resistance: a CUSUM of the balance of forces, where it can be trusted."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import BoolArray, FloatArray
from aqualog.detect.cusum import CusumParams
from aqualog.detect.thresholds import DEFAULT

__all__ = ["THRESHOLD", "alarm_params", "gate_params", "trusted_measure", "usable_for_offset"]

THRESHOLD = 0.2  # [m/s^2] thesis 2.2: partial aquaplaning (C44)
V_MIN = 14.0  # [m/s] below 50 km/h even 2 mm of water cost less than 0.12 m/s^2; traffic rules the balance
CLIP = 0.8  # [m/s^2] a gear change or a bump shows more for a moment than water ever does (C46)
V_OFFSET = 5.0  # [m/s] from here on the dry offset is learnt; the less water shows, the better
A_OFFSET = 1.0  # [m/s^2] beyond, a wrong mass shows in the measure, and curves cost more than the model knows
A_Y_MAX = 2.5  # [m/s^2] beyond, cornering itself costs more than water does


def alarm_params(dt: float, threshold: float = DEFAULT.resistance) -> CusumParams:
    """Tuning of the single detector, robust: its drift is half the change that is to be found.

    It reports 0.2 m/s² after 2 s, 0.4 m/s² after 0.7 s (C76).
    """
    # the clamp does not follow a low threshold: joint detector 2 takes the sum up to 0.3 m/s
    return CusumParams(0.5 * THRESHOLD, threshold, max(1.5 * threshold, 0.3), dt)


def gate_params(dt: float, threshold: float = DEFAULT.joint_criteria) -> CusumParams:
    """Tuning of the joint detector's gate, sensitive: it only has to show that something holds the car back (C64)."""
    return CusumParams(0.5 * THRESHOLD, threshold, 2.0 * threshold, dt)


def trusted_measure(delta_a_x: FloatArray, v_x: FloatArray, a_y: FloatArray, is_braking: BoolArray) -> FloatArray:
    """Return the resistance measure where the longitudinal balance can be trusted.

    Elsewhere it is zero: no evidence, and sums decay. Under braking it is the least value, so that an alarm ends within
    a quarter of a second.

    Parameters
    ----------
    delta_a_x : array (n,)
        Nominal minus measured acceleration (thesis 2.9); more resistance is positive. [m/s²]
    v_x : array (n,)
        Velocity. [m/s]
    a_y : array (n,)
        Lateral acceleration, low-passed. [m/s²]
    is_braking : bool array (n,)
        A braking force acts on any wheel: brake torque is rarely known well enough.

    Returns
    -------
    x : array (n,)
        Within ±0.8; NaN stays NaN. [m/s²]
    """
    with np.errstate(invalid="ignore"):
        trusted = (v_x > V_MIN) & (np.abs(a_y) < A_Y_MAX)
    x = np.where(trusted, np.clip(delta_a_x, -CLIP, CLIP), 0.0)
    return np.where(np.isnan(delta_a_x), np.nan, np.where(is_braking, -CLIP, x))


def usable_for_offset(
    delta_a_x: FloatArray, v_x: FloatArray, a_kin: FloatArray, a_y: FloatArray, is_braking: BoolArray
) -> FloatArray:
    """Return the resistance measure where it shows its own offset on dry road: rolling steadily, straight, no brake.

    Parameters
    ----------
    delta_a_x, v_x, a_kin, a_y : array (n,)
        As in `trusted_measure`; `a_kin` kinematic acceleration, low-passed. [m/s², m/s]
    is_braking : bool array (n,)

    Returns
    -------
    x : array (n,)
        Within ±0.8; NaN elsewhere. [m/s²]
    """
    with np.errstate(invalid="ignore"):
        usable = (v_x > V_OFFSET) & (np.abs(a_kin) < A_OFFSET) & (np.abs(a_y) < A_OFFSET) & ~is_braking
    return np.where(usable, np.clip(delta_a_x, -CLIP, CLIP), np.nan)
