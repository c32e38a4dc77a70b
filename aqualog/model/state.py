"""Layout of the compiled simulation: states, Jacobian, recorded columns by name, and states to start from."""

from __future__ import annotations

from collections import namedtuple
from itertools import accumulate
from typing import Any

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.model.plant import Plant
from aqualog.physics.load import G, wheel_loads
from aqualog.physics.resistance import air_drag
from aqualog.physics.rolling import effective_radius

__all__ = [
    "AT", "COLUMNS", "MOTION_WIDTH", "N_JACOBIAN", "N_STATES", "WIDTH", "column", "resistance_at",
    "rolling_state", "wheel_columns",
]  # fmt: skip

# states: speeds and attitude, low-passed specific forces, the driver; then four of each wheel
V_X, V_Y, YAW_RATE, PSI, S, Y_LAT, A_X, A_Y, INTEGRAL, DRIVE, BRAKE, STEER = range(12)
# where rim and belt are two, the speed of the belt and their twist; of a wheel that hops its lift and the lift's rate
OMEGA, BELT, ANGLE, SLIP_X, SLIP_Y, TWIST, LIFT, RISE = range(12, 44, 4)
N_STATES = 44
# the Jacobian: a diagonal, and behind it the coupling of v_x with the wheels and then the belts, d(v_x')/d(omega) and
# d(omega')/d(v_x); where slip builds up, that of a wheel's slip with both: d(omega')/d(s), d(v_x')/d(s) and back
J_V, J_W, J_WS = N_STATES, N_STATES + 8, N_STATES + 16
J_VS, J_SW, J_SV = J_WS + 8, J_WS + 12, J_WS + 16
N_JACOBIAN = J_SV + 4

# what is recorded: of the car, and four of each wheel; motion first, which a drive that is followed needs alone
_MOTION = ("v_x", "a_x", "a_y", "yaw_rate", "steer_angle", "position", "nudge", "slides")
_MOTION_WHEELS = ("omega", "angle", "torque")
_SCALARS = (
    "v_y", "psi", "y_lat", "drive_torque", "brake_torque", "grade", "lane_front", "lane_rear", "drag", "held",
)  # fmt: skip
_WHEELS = (
    "F_x", "F_y", "F_z", "s_x", "slip_angle", "contact", "slope", "mu_max", "film", "water_torque", "wave_drag",
    "resisting_torque", "v_along", "r_e", "v_full", "aligning", "braking", "climb", "tread_omega", "twist",
)  # fmt: skip
MOTION_WIDTH = len(_MOTION) + 4 * len(_MOTION_WHEELS)
_WIDTHS = dict.fromkeys(_MOTION, 1) | dict.fromkeys(_MOTION_WHEELS, 4) | dict.fromkeys(_SCALARS, 1)
_WIDTHS |= dict.fromkeys(_WHEELS, 4)
WIDTH = sum(_WIDTHS.values())
COLUMNS = dict(zip(_WIDTHS, accumulate(_WIDTHS.values(), initial=0), strict=False))
# `AT.film + i` is the column of wheel i, in compiled code too
AT: Any = namedtuple("At", list(COLUMNS))(**COLUMNS)


def column(rows: FloatArray, name: str) -> FloatArray:
    """Return one recorded column of the car (n,)."""
    return np.ascontiguousarray(rows[:, COLUMNS[name]])


def wheel_columns(rows: FloatArray, name: str) -> list[FloatArray]:
    """Return the recorded columns (n,) of the four wheels."""
    return [np.ascontiguousarray(rows[:, COLUMNS[name] + i]) for i in range(4)]


def resistance_at(plant: Plant, v: float, a: float) -> tuple[float, FloatArray]:
    """Return air drag, and the resistance of each of the four wheels, at a speed and specific force on dry road. [N]"""
    through_air = np.array([v + plant.head_wind])
    drag = float(air_drag(through_air, drag_area=plant.drag_area, air_density=plant.air_density)[0])
    drag += float(np.interp(v, plant.drag_over_v[:, 0], plant.drag_over_v[:, 1]))
    drag += plant.towed_mass * G * float(plant.r_w[2])
    rolling = plant.r_w * (1.0 + plant.warmup_extra) * _loads(plant, a)
    return drag, rolling + plant.brake_drag / plant.r_e


def _loads(plant: Plant, a: float) -> FloatArray:
    return wheel_loads(
        np.array([a]), np.zeros(1), mass=plant.mass, l_f=plant.l_f, l_r=plant.l_r, h_cg=plant.h_cg, track=plant.track
    )[:, 0]


def rolling_state(plant: Plant, *, v: float, a: float, drive: float, split_rear: float) -> FloatArray:
    """Return the state of a car that rolls straight on dry road, each wheel at the slip that its torque needs.

    `v` [m/s], `a` specific force forward [m/s²], `drive` torque of all wheels [N·m], its rear share.
    """
    y = np.zeros(N_STATES)
    y[V_X], y[A_X], y[DRIVE] = v, a, drive
    _, rolling = resistance_at(plant, v, a)
    share = 0.5 * np.array([1.0 - split_rear, 1.0 - split_rear, split_rear, split_rear])
    force = share * drive / plant.r_e - rolling
    radii = zip(plant.r_e, plant.radius_growth, strict=True)
    slip = np.clip(force / np.maximum(plant.slip_slope * _loads(plant, a), 1.0), -0.1, 0.1)
    r_e = np.array([float(effective_radius(np.array([r]), np.array([v]), growth=g)[0]) for r, g in radii])
    y[OMEGA : OMEGA + 4] = v / (r_e * (1.0 - slip))
    y[BELT : BELT + 4] = y[OMEGA : OMEGA + 4]
    y[TWIST : TWIST + 4] = (share * drive - plant.brake_drag) / np.maximum(plant.torsion_stiffness, 1.0)
    y[SLIP_X : SLIP_X + 4] = slip
    return y
