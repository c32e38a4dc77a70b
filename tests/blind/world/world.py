"""What a drive is made of, as plain records: the car with its tyres, the sensors' errors, the road's own troubles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from aqualog.core.vehicle import Vehicle

from .tyre import KINDS, SECANT

__all__ = ["CAR", "TYRE", "Errors", "World", "nominal_world"]

G = 9.80665
WHEELS = ("fl", "fr", "rl", "rr")

# columns of the car's and of the tyres' numbers in the arrays that the kernel reads
CAR = {name: i for i, name in enumerate((
    "mass", "l_f", "l_r", "h_cg", "track", "I_zz", "drag_area", "air_density", "head_wind", "cornering_drag",
    "torque_gain", "gear_loss", "warm_extra", "warm_time", "towed_mass", "towed_r_w", "leak_start", "leak_time",
    "hump_force", "hump_v", "hump_width", "wet_force", "wet_vh", "wet_width", "saddle_depth", "saddle_at",
    "saddle_width", "split_rear", "brake_front", "power", "pitch_hz", "pitch_damping", "track_film", "habit_mass",
    "habit_drag", "habit_r_w", "shifts", "r_drive", "tyre_kind",
))}  # fmt: skip
TYRE = {name: i for i, name in enumerate((
    "r_e", "growth", "inertia", "r_w", "brake_drag", "slope", "slope_drift", "load_delta", "F_ref", "mu",
    "relaxation", "water_gain", "contact_gain", "leak_radius", "leak_slope", "cornering", "side_y",
))}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Errors:
    """Systematic errors of one sensor: y = gain x (1 + speed_gain (v - 15 m/s)) + bias + drift t, late by `delay`.

    `ahead` of the centre of gravity [m] an accelerometer has x - ahead r^2 for x, with the yaw rate r.
    """

    gain: float = 1.0
    bias: float = 0.0
    drift: float = 0.0
    delay: float = 0.0
    skew_ppm: float = 0.0
    speed_gain: float = 0.0
    ring: float = 0.0
    ahead: float = 0.0


@dataclass(frozen=True, slots=True)
class World:
    """Car (39,) and tyres (4, 18) by the columns above, errors by signal, water by side, the road's own effects."""

    car: np.ndarray
    tyre: np.ndarray
    errors: Mapping[str, Errors] = field(default_factory=dict)
    depth_gain: tuple[float, float] = (1.0, 1.0)
    irregularity: tuple[float, float] = (0.0, 0.0)
    grade: float = 0.0
    hills_rms: float = 0.0
    hills_length: float = 800.0
    patch_force: float = 0.0
    patch_start: float = 0.0
    patch_length: float = 0.0
    patch_period: float = 0.0


def nominal_world(vehicle: Vehicle, tyre_kind: str = "magic") -> World:
    """The world in which the vehicle file is true."""
    slope = SECANT if tyre_kind == "magic" else 1.0
    v, base = vehicle, vehicle.wheelbase
    car = np.zeros(len(CAR))
    values = {
        "mass": v.mass, "l_f": v.l_f, "l_r": v.l_r, "h_cg": v.h_cg, "track": v.track, "I_zz": v.mass * v.l_f * v.l_r,
        "drag_area": v.drag_area, "air_density": v.air_density, "torque_gain": 1.0, "warm_time": 600.0,
        "towed_r_w": v.rolling_resistance, "leak_time": 1.0, "hump_width": 1.0, "wet_width": 1.0, "saddle_width": 1.0,
        "split_rear": v.torque_split_rear, "brake_front": 0.64, "power": 115.0 * v.mass, "pitch_hz": 1.6,
        "pitch_damping": 0.35, "track_film": 0.5e-3, "habit_mass": v.mass, "habit_drag": 0.5 * v.drag_area * 1.2,
        "habit_r_w": v.rolling_resistance, "shifts": 0.0 if v.name.startswith("electric") else 1.0,
        "r_drive": (1.0 - v.torque_split_rear) * v.r_e_f + v.torque_split_rear * v.r_e_r,
        "tyre_kind": KINDS[tyre_kind],
    }  # fmt: skip
    for name, x in values.items():
        car[CAR[name]] = x
    tyre = np.zeros((4, len(TYRE)))
    for i, wheel in enumerate(WHEELS):
        front = wheel[0] == "f"
        axle = {
            "r_e": v.r_e(wheel), "inertia": v.inertia(wheel), "r_w": v.rolling_resistance,
            "slope": slope * (v.slip_slope_f if front else v.slip_slope_r),
            "F_ref": 0.5 * v.mass * G * (v.l_r if front else v.l_f) / base, "mu": v.mu_max, "water_gain": 1.0,
            "contact_gain": 1.0, "cornering": slope * (16.0 if front else 20.0),
            "side_y": 0.5 * v.track if wheel[1] == "l" else -0.5 * v.track,
        }  # fmt: skip
        for name, x in axle.items():
            tyre[i, TYRE[name]] = x
    return World(car, tyre)
