"""Longitudinal slip: the one definition, sign and low-speed rule."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray

__all__ = ["V_MIN", "bounded_slip", "slip_of_wheel_speed", "wheel_slip"]

V_MIN = 1.0  # [m/s] below this no slip is defined


def slip_of_wheel_speed(v_w: FloatArray, v_x: FloatArray) -> FloatArray:
    """Longitudinal slip related to the vehicle speed, driving positive.

    Parameters
    ----------
    v_w : array (n,)
        Wheel speed at the rolling circumference, omega r_e. [m/s]
    v_x : array (n,)
        Velocity of the wheel's centre along the road. [m/s]

    Returns
    -------
    s : array (n,)
        (v_w - v_x) / v_x; -1 for a locked wheel; NaN below `V_MIN`. [-]

    The denominator is the vehicle speed, which stays bounded when the wheel stops; Eq. (3.13) [fichtinger2024]
    divides by the wheel speed and runs to minus infinity there (E7). Both agree to first order in small slip.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(v_x > V_MIN, (v_w - v_x) / v_x, np.nan)


def wheel_slip(omega: FloatArray, v_x: FloatArray, r_e: float) -> FloatArray:
    """Longitudinal slip related to the wheel speed, driving positive: (omega r_e - v_x) / (omega r_e).

    Parameters
    ----------
    omega : array (n,)
        Wheel speed. [rad/s]
    v_x : array (n,)
        Velocity of the wheel's centre along the road. [m/s]
    r_e : float
        Effective rolling radius. [m]

    Returns
    -------
    s_x : array (n,)
        NaN where the rim runs slower than `V_MIN` (E7: minus infinity as the wheel stops). [-]

    Thesis [fichtinger2024]: Eq. (3.13).
    """
    v_w = omega * r_e
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(v_w > V_MIN, (v_w - v_x) / v_w, np.nan)


def bounded_slip(v_w: FloatArray, v_along: FloatArray) -> FloatArray:
    """Slip of (3.13) that a simulation can use at any speed: (v_w - v) / max(|v_w|, 0.5 m/s).

    Parameters
    ----------
    v_w : array
        Speed at the rolling circumference, omega r_e. [m/s]
    v_along : array
        Velocity of the wheel's centre in its plane. [m/s]

    Returns
    -------
    s_x : array
        Driving positive. Equal to (3.13) while the rim runs faster than 0.5 m/s; large and negative, not infinite, for
        a wheel that stands still in a moving car (E7), where the brush slides anyway. [-]

    Source: Eq. (3.13) [fichtinger2024]; the bound is derived.
    """
    return (v_w - v_along) / np.maximum(np.abs(v_w), 0.5)
