"""Contact of one tyre on water in the simulator's physics, for Figures 2.1 and 2.2."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.model.plant import F_Z_ANCHOR, F_Z_HALF_LENGTH, H_ANCHOR, P_ANCHOR, P_HALF_LENGTH
from aqualog.model.tyre import TYRES
from aqualog.physics.contact import contact_half_length, contact_share
from aqualog.physics.hydroplaning import full_aquaplaning_speed

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
    v = full_aquaplaning_speed(
        np.array([h]), np.array([LOAD]), p=p, tread_capacity=TYRE.tread_capacity, v_anchor=TYRE.v_anchor,
        h_anchor=H_ANCHOR, p_anchor=P_ANCHOR, F_z_anchor=F_Z_ANCHOR, h_bulk=TYRE.h_bulk, h_onset=TYRE.h_onset,
        exponent=TYRE.contact_exponent,
    )  # fmt: skip
    return float(v[0])


def share(v: FloatArray, h: float, p: float) -> FloatArray:
    """Remaining share of the contact length over speed (n,) [m/s]. [-]"""
    return contact_share(v, np.full_like(v, full_speed(h, p)), exponent=TYRE.contact_exponent)
