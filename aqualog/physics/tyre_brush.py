"""The brush tyre: bristles in a parabolic pressure that stick, then slide."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray

__all__ = [
    "brush_force", "brush_forces", "brush_parts", "brush_slip", "brush_slope", "brush_stiffness", "sliding_edge",
]  # fmt: skip


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

    Thesis [fichtinger2024]: Eq. (3.12).
    """
    return 2.0 * c_px * a * a


def sliding_edge(theta: FloatArray, L: FloatArray | float) -> FloatArray:
    """Where the bristles begin to slide, from the centre of the patch in half lengths: -1 rear end, 2 L - 1 front edge.

    Parameters
    ----------
    theta : array
        C_0 |s| / (3 mu F_z), >= 0, with the stiffness C_0 of the full contact. [-]
    L : array
        Remaining share of the contact length, 0 ... 1. [-]

    Returns
    -------
    xi : array
        Smaller root of xi^2 - k xi + k b - 1 = 0 with k = 2 theta and b = 2 L - 1: there a bristle that entered at the
        front edge b of the dry contact is bent as far as the parabolic pressure holds it. Within -1 ... b. [-]

    Source: chapter 3 of Pacejka [pacejka2012] for L = 1; derived for L < 1.
    """
    k = 2.0 * theta
    b = 2.0 * L - 1.0
    root = np.sqrt(np.maximum(k * k - 4.0 * (k * b - 1.0), 0.0))
    # the smaller root as 2 c / (b + root): no digits are lost at large theta
    return np.minimum(np.maximum(2.0 * (k * b - 1.0) / np.maximum(k + root, 1e-300), -1.0), b)


def brush_parts(theta: FloatArray, L: FloatArray | float) -> tuple[FloatArray, FloatArray]:
    """Force of the sticking and of the sliding bristles over mu F_z; see `sliding_edge` for `theta` and `L`.

    Their sum grows from 0 with the slope 3 L^2 in theta (2.2) to L^2 (3 - 2 L) (2.1); at L = 1 it is the brush's
    1 - (1 - theta)^3. Both are integrals over the remaining parabola: no pressure is put on bristles that the water has
    lifted.

    Source: as `sliding_edge`; (2.1) and (2.2) are those of [fichtinger2024].
    """
    b = 2.0 * L - 1.0
    xi = sliding_edge(theta, L)
    stuck = 0.75 * theta * (b - xi) ** 2
    slid = 0.25 * (1.0 + xi) ** 2 * (2.0 - xi)  # integral of the parabola from -1 to xi
    return stuck, slid


def brush_force(s_x: FloatArray, F_z: FloatArray, *, mu: float, C_s: float, L: FloatArray | float = 1.0) -> FloatArray:
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
        Slip stiffness at s_x = 0 of the full contact. [N]
    L : array
        Remaining share of the contact length, 0 ... 1. [-]

    Returns
    -------
    F_x : array
        Force on the vehicle, forward positive. [N]

    Limits: slope C_s L^2 at 0, which holds no mu (C2); odd in s_x; |F_x| <= mu F_z L^2 (3 - 2 L), reached on a full
    contact at a slip of 3 mu F_z / C_s, on a shortened one only as the slip grows without bound, since pressure holds
    its first bristles; no load, no friction or no contact, no force. NaN in, NaN out. Rigid carcass, equal friction of
    sticking and sliding bristles.

    Thesis [fichtinger2024]: section 3.1; (2.1) and (2.2) are its limits at large and small slip.

    Source: chapter 3 of Pacejka [pacejka2012] for L = 1; derived for L < 1.
    """
    F_x, _ = brush_forces(s_x, 0.0 * s_x, F_z, mu=mu, C_x=C_s, C_y=C_s, L=L)
    return F_x


def brush_forces(
    s_x: FloatArray, s_y: FloatArray, F_z: FloatArray, *, mu: float, C_x: float, C_y: float, L: FloatArray | float = 1.0
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
        Slip stiffness and cornering stiffness of the full contact. [N], [N/rad]
    L : array
        Remaining share of the contact length, 0 ... 1. [-]

    Returns
    -------
    F_x, F_y : array
        Forward and left positive. [N]

    The stiffness-weighted slip sets how far the contact slides. Sticking bristles pull along it, sliding ones against
    the sliding velocity. Limits: s_y = 0 is `brush_force`; slopes C_x L^2 and C_y L^2 at 0;
    |F| <= mu F_z L^2 (3 - 2 L), full sliding along (s_x, s_y).

    Source: chapter 3 of Pacejka [pacejka2012] for L = 1; derived for L < 1.
    """
    g_x = C_x * s_x
    g_y = C_y * s_y
    g = np.sqrt(g_x * g_x + g_y * g_y)
    s = np.sqrt(s_x * s_x + s_y * s_y)
    limit = np.maximum(mu * F_z, 1e-9)  # a lifted wheel: no force, and no division by zero
    stuck, slid = brush_parts(g / (3.0 * limit), L)
    along_g = limit * stuck / np.maximum(g, 1e-12)
    along_s = limit * slid / np.maximum(s, 1e-15)
    return along_g * g_x + along_s * s_x, along_g * g_y + along_s * s_y


def brush_slope(s_x: FloatArray, F_z: FloatArray, *, mu: float, C_s: float, L: FloatArray | float = 1.0) -> FloatArray:
    """Local slope dF_x / ds_x of `brush_force`: C_s times the square of the sticking share of the contact. [N]

    C_s L^2 at no slip; 0 where the whole contact slides.

    Source: derived from `brush_force`.
    """
    limit = np.maximum(mu * F_z, 1e-9)
    xi = sliding_edge(C_s * np.abs(s_x) / (3.0 * limit), L)
    stuck = 0.5 * (2.0 * L - 1.0 - xi)
    return C_s * stuck * stuck


def brush_slip(mu_x: FloatArray, *, mu: float, slope: float) -> FloatArray:
    """Slip (3.13) at which a full contact transmits a traction coefficient F_x / F_z: the inverse of `brush_force`. [-]

    Driving positive. `mu`, `slope`: friction, and C_s / F_z at no slip, > 0. [-] The cubic |mu_x| / mu = 1 - (1 - slope
    |s_x| / 3 mu)^3, solved; from mu on the slip is 3 mu / slope, at which the whole contact begins to slide.

    Source: chapter 3 of Pacejka [pacejka2012].
    """
    held = (1.0 - np.minimum(np.abs(mu_x) / mu, 1.0)) ** (1.0 / 3.0)
    return np.copysign(3.0 * mu / slope * (1.0 - held), mu_x)
