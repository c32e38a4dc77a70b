"""Traction coefficient from wheel torque."""

from __future__ import annotations

import numpy as np

from aqualog.types import FloatArray

__all__ = ["traction_coefficient"]


def traction_coefficient(
    torque: FloatArray, F_z: FloatArray, omega_dot: FloatArray, *, r_l: float, inertia: float, r_w: float
) -> FloatArray:
    """Traction coefficient mu = F_x / F_z of one wheel.

    Parameters
    ----------
    torque : array (n,)
        Net wheel torque, drive minus brake. [N m]
    F_z : array (n,)
        Wheel load. [N]
    omega_dot : array (n,)
        Angular acceleration. [rad/s^2]
    r_l, inertia, r_w : float
        Loaded radius [m], wheel inertia [kg m^2], rolling resistance coefficient [-].

    Returns
    -------
    mu : array (n,)
        Driving positive; NaN where the wheel carries less than 100 N. [-]

    F_x = (T - I omega_dot) / r_l - r_w F_z: the thesis does not say that rolling resistance and inertia come off the
    torque of 3.14 (E13). A wheel that rolls freely at constant speed has mu = -r_w.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        mu = (torque - inertia * omega_dot) / (r_l * F_z) - r_w
    return np.where(F_z > 100.0, mu, np.nan)
