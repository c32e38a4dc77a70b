"""The remaining dry contact of a tyre on water, and its effect on friction, stiffness and load symmetry.

L = (a + b) / 2a is the share of the contact length that still touches the road, with the half length a and the front
edge b of the dry contact (Fig. 2.1 of [fichtinger2024]; E1: a is HALF the length). L = 1 on dry road, 0 at full
aquaplaning.
"""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray

__all__ = [
    "contact_half_length",
    "contact_share",
    "friction_ratio",
    "load_shift",
    "lost_contact",
    "remaining_share",
    "slip_stiffness_ratio",
]


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
        n > 0. 2 is the stagnation pressure alone; 20 km/h below a full aquaplaning at 118 km/h, n = 4 leaves 0.28
        of the slip slope, 6 leaves 0.45, 6.6 half of it. [-]

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


def load_shift(L: FloatArray, a: FloatArray, *, peak: float) -> FloatArray:
    """Forward shift of the wheel load when water carries the front part of the contact patch.

    Parameters
    ----------
    L : array
        Remaining share of the contact length, 0 ... 1. [-]
    a : array
        Half length of the contact. [m]
    peak : float
        Where in the wedge the water's force acts: 0 at its rear end, 0.5 its middle (even pressure), 1 at its front
        end. [-]

    Returns
    -------
    e : array
        Forward positive; times F_z it is a torque against the rolling wheel. [m]

    The dry part keeps its share of the parabola (2.1); the rest of the load rests on the wedge from b to a. The moment
    of the wedge less that of the parabola it replaces, over the load:
    e / a = x_h (1 - L^2 (3 - 2 L)) - 3 L^2 (1 - L)^2 with x_h = b/a + peak (1 - b/a), b/a = 2 L - 1.
    Limits: L = 1 gives 0; L = 0 gives a (2 peak - 1); even pressure at full aquaplaning shifts nothing. For
    little lost contact l it is (6 peak - 2) l^3 a: early partial aquaplaning is hardly felt. Below peak = 1/3 it would
    be negative.

    Source: derived from the parabola of Eq. (2.1) [fichtinger2024].
    """
    L = np.minimum(np.maximum(L, 0.0), 1.0)
    b = 2.0 * L - 1.0
    lifted = 1.0 - L * L * (3.0 - 2.0 * L)
    return a * ((b + peak * (1.0 - b)) * lifted - 3.0 * L * L * (1.0 - L) ** 2)
