"""The remaining dry contact of a tyre on water, and what it leaves of friction and stiffness."""

from __future__ import annotations

import numpy as np

from aqualog.types import FloatArray

__all__ = ["friction_ratio", "slip_stiffness_ratio"]


def friction_ratio(L: FloatArray) -> FloatArray:
    """Residual over dry friction, mu / mu_0 = L^2 (3 - 2 L).

    Parameters
    ----------
    L : array
        Remaining share of the contact length, (a + b) / 2a with half length a and front edge b of the dry contact
        (E1); clipped to 0 ... 1. [-]

    Returns
    -------
    ratio : like L
        0 at full aquaplaning, 1 on dry road. [-]

    Thesis: Eq. (2.1), the integral of a parabolic pressure over the remaining contact.
    """
    L = np.clip(L, 0.0, 1.0)
    return L * L * (3.0 - 2.0 * L)


def slip_stiffness_ratio(L: FloatArray) -> FloatArray:
    """Residual over dry slip stiffness, C / C_0 = L^2.

    `L` as in `friction_ratio`; falls before the friction does for every 0 < L < 1.

    Thesis: Eq. (2.2); L = 1 is Eq. (3.12) (E1).
    """
    L = np.clip(L, 0.0, 1.0)
    return L * L
