"""Layout of the compiled simulation: states, stiff part of the Jacobian, recorded columns by name."""

from __future__ import annotations

from collections import namedtuple
from typing import Any

import numpy as np

from aqualog.core.records import FloatArray

__all__ = ["AT", "COLUMNS", "N_JACOBIAN", "N_STATES", "WIDTH", "column", "wheel_columns"]

# states: speeds and attitude, low-passed specific forces, the driver; then four of each wheel
V_X, V_Y, YAW_RATE, PSI, S, Y_LAT, A_X, A_Y, INTEGRAL, DRIVE, BRAKE, STEER = range(12)
OMEGA, ANGLE, SLIP_X, SLIP_Y = 12, 16, 20, 24
N_STATES = 28
# the Jacobian: a diagonal, and behind it the coupling of v_x with the wheels, d(v_x')/d(omega) and d(omega')/d(v_x)
J_V, J_W = N_STATES, N_STATES + 4
N_JACOBIAN = N_STATES + 8

_SCALARS = (
    "v_x", "v_y", "yaw_rate", "psi", "position", "y_lat", "a_x", "a_y", "steer_angle", "drive_torque", "brake_torque",
    "grade", "lane_front", "lane_rear", "drag", "nudge",
)  # fmt: skip
_WHEELS = (
    "omega", "angle", "torque", "F_x", "F_y", "F_z", "s_x", "slip_angle", "contact", "slope", "mu_max", "film",
    "water_torque", "wave_drag", "resisting_torque", "v_along", "r_e", "v_full", "aligning", "braking",
)  # fmt: skip
COLUMNS = {name: i for i, name in enumerate(_SCALARS)} | {name: len(_SCALARS) + 4 * i for i, name in enumerate(_WHEELS)}
WIDTH = len(_SCALARS) + 4 * len(_WHEELS)
# `AT.film + i` is the column of wheel i, in compiled code too
AT: Any = namedtuple("At", list(COLUMNS))(**COLUMNS)


def column(rows: FloatArray, name: str) -> FloatArray:
    """Return one recorded column of the car (n,)."""
    return np.ascontiguousarray(rows[:, COLUMNS[name]])


def wheel_columns(rows: FloatArray, name: str) -> list[FloatArray]:
    """Return the recorded columns (n,) of the four wheels."""
    return [np.ascontiguousarray(rows[:, COLUMNS[name] + i]) for i in range(4)]
