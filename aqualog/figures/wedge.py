"""Contact of one tyre on water in the simulator's physics, for Figures 2.1 and 2.2."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.model.plant import F_Z_HALF_LENGTH, P_HALF_LENGTH
from aqualog.model.tyre import F_Z_ANCHOR, H_ANCHOR, TYRES
from aqualog.physics.contact import contact_half_length, contact_share

__all__ = ["DEPTH", "LOAD", "TYRE", "full_speed", "half_length", "share"]

TYRE = TYRES["worn_summer"]
LOAD = F_Z_ANCHOR  # [N] a wheel of the thesis' test car
DEPTH = H_ANCHOR  # [m] as in most of the thesis' figures


def half_length(p: float) -> float:
    """Half the contact length of the standing wheel at a pressure [Pa]. [m]"""
    a = contact_half_length(
        np.array([LOAD]), p=p, a_ref=TYRE.half_length, F_z_ref=F_Z_HALF_LENGTH, p_ref=P_HALF_LENGTH
    )  # fmt: skip
    return float(a[0])


def full_speed(h: float, p: float) -> float:
    """Speed of full aquaplaning in a depth [m] at a pressure [Pa]. [m/s]"""
    return float(TYRE.full_speed(np.array([h]), np.array([LOAD]), p=p)[0])


def share(v: FloatArray, h: float, p: float) -> FloatArray:
    """Remaining share of the contact length over speed (n,) [m/s]. [-]"""
    return contact_share(v, np.full_like(v, full_speed(h, p)), exponent=TYRE.contact_exponent)
