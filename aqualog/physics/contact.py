"""The remaining dry contact of a tyre on water, and its effect on friction, stiffness and load symmetry.

L = (a + b) / 2a is the share of the contact length that still touches the road, with the half length a and the front
edge b of the dry contact (Fig. 2.1 of [fichtinger2024]; E1: a is HALF the length). L = 1 on dry road, 0 at full
aquaplaning.
"""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray

__all__ = [
    "contact_half_length", "contact_share", "friction_ratio", "load_shift", "lost_contact", "remaining_share",
    "slip_stiffness_ratio",
]  # fmt: skip


def remaining_share(b: FloatArray, a: FloatArray) -> FloatArray:
    """Remaining share of the contact length, L = (a + b) / 2a.

    Parameters
    ----------
    b : array
        Front edge of the dry contact, from the centre of the patch, forward positive, -a ... a. [m]
    a : array
        Half length of the contact. [m]

    Returns
    -------
    L : array
        0 at b = -a (full aquaplaning), 1 at b = a (dry). [-]

    Thesis [fichtinger2024]: Fig. 2.1 (E1).
    """
    return 0.5 * (a + b) / a


def friction_ratio(L: FloatArray) -> FloatArray:
    """Residual over dry friction, mu / mu_0 = L^2 (3 - 2 L).

    Parameters
    ----------
    L : array
        Remaining share of the contact length; clipped to 0 ... 1. [-]

    Returns
    -------
    ratio : like L
        0 at full aquaplaning, 1 on dry road. [-]

    Thesis [fichtinger2024]: Eq. (2.1), the integral of a parabolic pressure over the remaining contact.
    """
    L = np.minimum(np.maximum(L, 0.0), 1.0)
    return L * L * (3.0 - 2.0 * L)


def slip_stiffness_ratio(L: FloatArray) -> FloatArray:
    """Residual over dry slip stiffness, C / C_0 = L^2.

    `L` as in `friction_ratio`; falls before the friction does for every 0 < L < 1.

    Thesis [fichtinger2024]: Eq. (2.2); L = 1 is Eq. (3.12) (E1).
    """
    L = np.minimum(np.maximum(L, 0.0), 1.0)
    return L * L


def lost_contact(v: FloatArray, v_full: FloatArray, *, exponent: float) -> FloatArray:
    """Share of the contact length that the water wedge has lifted, (v / v_full)^n, at most 1.

    Parameters
    ----------
    v : array
        Speed over the water. [m/s] Negative speeds count as their amount.
    v_full : array
        Speed of full aquaplaning, > 0; infinite where the tread takes all the water. [m/s]
    exponent : float
        n > 0. 2 is the stagnation pressure alone. [-]

    Returns
    -------
    lost : array
        0 at rest, 1 from v_full on; L = 1 - lost. [-]

    An assumption in shape: published curves of contact length over speed fall slowly first and steeply near full
    aquaplaning; no coefficients were found.

    Source: an assumption. Such curves were measured with tyre sensors (thesis [37]; [niskanen2014]), but no numbers
    were at hand.
    """
    return np.minimum((np.abs(v) / v_full) ** exponent, 1.0)


def contact_share(v: FloatArray, v_full: FloatArray, *, exponent: float) -> FloatArray:
    """Remaining share of the contact length at a speed, L = 1 - (v / v_full)^n; see `lost_contact`.

    Source: an assumption, as for `lost_contact`.
    """
    return 1.0 - lost_contact(v, v_full, exponent=exponent)


def contact_half_length(F_z: FloatArray, *, p: float, a_ref: float, F_z_ref: float, p_ref: float) -> FloatArray:
    """Half the length of the contact patch, a = a_ref sqrt(F_z p_ref / (F_z_ref p)).

    Parameters
    ----------
    F_z : array
        Wheel load, >= 0. [N]
    p, p_ref : float
        Inflation pressure, and that of the reference. [Pa]
    a_ref : float
        Half length at the reference. [m]
    F_z_ref : float
        Load of the reference. [N]

    Returns
    -------
    a : array
        [m]

    The patch carries the load by about the inflation pressure (area ~ F_z / p) and grows mainly in length; the square
    root is what measured patches show (MF6.1 [besselink2010]: QRA1, QRA2). Limits: no load, no patch.
    """
    return a_ref * np.sqrt(np.maximum(F_z, 0.0) / F_z_ref * p_ref / p)


def load_shift(L: FloatArray, a: FloatArray, *, arm: float) -> FloatArray:
    """Forward shift of the wheel load when water carries the front part of the contact patch.

    Parameters
    ----------
    L : array
        Remaining share of the contact length, 0 ... 1. [-]
    a : array
        Half length of the contact. [m]
    arm : float
        Shift at full aquaplaning over the half length. [-]

    Returns
    -------
    e : array
        Forward positive; times F_z it is a torque against the rolling wheel. [m]

    arm a (1 - L): linear in the lost contact, because the water's pressure is about the tyre's own and acts on the
    wedge, from the dry part's front edge to ahead of the patch. With 1 - L ~ v^n and n near 2 the resistance is
    parabolic, as measured. To keep the dry part's parabola instead would begin with the third power of the lost
    contact, 1 mm at 80 km/h and 13 mm at 100. Limits: L = 1 gives 0; L = 0 gives arm a.

    Source: an assumption in shape; parabolic in speed as in NASA TN D-552 [horne1960].
    """
    return arm * a * (1.0 - np.minimum(np.maximum(L, 0.0), 1.0))
