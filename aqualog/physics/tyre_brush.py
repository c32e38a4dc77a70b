"""The brush tyre: bristles in a parabolic pressure that stick, then slide."""

from __future__ import annotations

import numpy as np

from aqualog.types import FloatArray

__all__ = ["brush_force", "brush_forces", "brush_slope", "brush_stiffness", "full_sliding_slip", "utilisation"]


def brush_stiffness(c_px: FloatArray, a: FloatArray) -> FloatArray:
    """Slip stiffness of a full contact, C_s = 2 c_px a^2.

    Parameters
    ----------
    c_px : array
        Stiffness of the bristles per length. [N/m^2]
    a : array
        Half length of the contact. [m]

    Returns
    -------
    C_s : array
        [N] It holds no friction: slip stiffness is a property of the tyre (C2).

    Thesis: Eq. (3.12).
    """
    return 2.0 * c_px * a * a


def utilisation(theta: FloatArray) -> FloatArray:
    """Force over friction limit of the brush, 1 - (1 - theta)^3, at most 1.

    Parameters
    ----------
    theta : array
        C_s |s| / (3 mu F_z), >= 0: the share of the contact that slides. [-]

    Returns
    -------
    share : array
        0 at theta = 0 with slope 3, 1 from theta = 1 on. [-]
    """
    left = 1.0 - np.minimum(theta, 1.0)
    return 1.0 - left * left * left


def brush_force(s_x: FloatArray, F_z: FloatArray, *, mu: float, C_s: float) -> FloatArray:
    """Longitudinal force of the brush tyre.

    Parameters
    ----------
    s_x : array
        Longitudinal slip (omega r_e - v_x) / (omega r_e) as in (3.13), driving positive; any size. [-]
    F_z : array
        Wheel load, >= 0. [N]
    mu : float
        Friction of tread and road. [-]
    C_s : float
        Slip stiffness at s_x = 0. [N]

    Returns
    -------
    F_x : array
        Force on the vehicle, forward positive. [N]

    Limits: slope C_s at 0, which holds no mu (C2); odd in s_x; |F_x| <= mu F_z, reached at `full_sliding_slip`; no
    load or no friction, no force. NaN in, NaN out. Rigid carcass, equal friction of sticking and sliding bristles.

    Thesis: section 3.1 and the reference of (2.1); H. B. Pacejka, Tire and Vehicle Dynamics, chapter 3.
    """
    F_x, _ = brush_forces(s_x, 0.0 * s_x, F_z, mu=mu, C_x=C_s, C_y=C_s)
    return F_x


def brush_forces(
    s_x: FloatArray, s_y: FloatArray, F_z: FloatArray, *, mu: float, C_x: float, C_y: float
) -> tuple[FloatArray, FloatArray]:
    """Longitudinal and lateral force of the brush tyre under combined slip.

    Parameters
    ----------
    s_x, s_y : array
        Theoretical slips: sliding speed over rolling speed, (omega r_e - v_x) / (omega r_e) and -v_y / (omega r_e),
        in the direction of the force. [-]
    F_z : array
        Wheel load, >= 0. [N]
    mu : float
        Friction. [-]
    C_x, C_y : float
        Slip stiffness and cornering stiffness. [N], [N/rad]

    Returns
    -------
    F_x, F_y : array
        Forward and left positive. [N]

    The stiffness-weighted slip vector sets how far the contact slides and where the force points. Limits: s_y = 0 is
    `brush_force`; slopes C_x and C_y at 0; |F| <= mu F_z.
    """
    g_x = C_x * s_x
    g_y = C_y * s_y
    g = np.sqrt(g_x * g_x + g_y * g_y)
    limit = np.maximum(mu * F_z, 1e-9)  # a lifted wheel: no force, and no division by zero
    factor = limit * utilisation(g / (3.0 * limit)) / np.maximum(g, 1e-12)
    return factor * g_x, factor * g_y


def brush_slope(s_x: FloatArray, F_z: FloatArray, *, mu: float, C_s: float) -> FloatArray:
    """Local slope dF_x / ds_x of `brush_force`: C_s (1 - theta)^2, 0 where the whole contact slides. [N]"""
    limit = np.maximum(mu * F_z, 1e-9)
    left = 1.0 - np.minimum(C_s * np.abs(s_x) / (3.0 * limit), 1.0)
    return C_s * left * left


def full_sliding_slip(F_z: FloatArray, *, mu: float, C_s: float) -> FloatArray:
    """Slip from which the whole contact slides, 3 mu F_z / C_s. [-]"""
    return 3.0 * mu * F_z / C_s
