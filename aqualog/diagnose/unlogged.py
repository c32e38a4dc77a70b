"""Quantities missing in a log: replacements for torque and steering, and brakes that were not logged."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.diagnose.inputs import SPEED_S, smooth
from aqualog.model.plant import understeer_gradient
from aqualog.model.tyre import Tyre
from aqualog.physics.kinematics import kinematic_steer_angle
from aqualog.physics.load import G

__all__ = [
    "A_MOST", "BRAKE_PRESSURE", "LEAST_S", "V_MIN", "brakes_in_torque", "brakes_unlogged", "needed_torque",
    "road_wheel_angle", "roll_out",
]  # fmt: skip

STEER_S = 0.5  # [s]
V_MIN = 4.0  # [m/s] below it, creeping, clutch and standstill dominate
A_MOST = 3.0  # [m/s^2] of replaced torque beyond resistance: with more, the simulated car spins in a curve
UNEXPLAINED = 0.8  # [m/s^2] more than a grade of 8 %
OFTEN = 0.01  # share of the driving
LEAST_S = 20.0  # [s] of usable driving
BRAKE_PRESSURE = 0.5e5  # [Pa]
HOLDS_BRAKES = -300.0  # [N·m] of all wheels, where the brakes are pressed hard


def roll_out(v: FloatArray, vehicle: Vehicle) -> FloatArray:
    """How fast the car of the file slows down on a flat dry road without torque. (n,) [m/s] to [m/s²], positive"""
    drag = 0.5 * vehicle.air_density * vehicle.drag_area * v * v / vehicle.mass
    return drag + G * vehicle.rolling_resistance


def needed_torque(v: FloatArray, vehicle: Vehicle, dt: float) -> FloatArray:
    """Torque at the driven wheels that the car of the file needs for a speed on a flat road. (4, n) [N·m], >= 0

    Zero where the car slows down faster than it rolls out: brakes are on all wheels, and one axle alone would lock at
    that deceleration. At most for `A_MOST`.
    """
    inertia = np.gradient(smooth(v, dt, SPEED_S), dt)
    force = vehicle.mass * np.maximum(np.minimum(inertia, A_MOST) + roll_out(v, vehicle), 0.0)
    rear = {"rwd": 1.0, "fwd": 0.0}.get(vehicle.drivetrain, vehicle.torque_split_rear)
    return np.array([0.5 * (rear if w[0] == "r" else 1.0 - rear) * force * vehicle.arm(w) for w in WHEELS])


def road_wheel_angle(
    columns: Mapping[str, FloatArray], v: FloatArray, vehicle: Vehicle, dt: float, *, most: float
) -> FloatArray:
    """Angle of the front wheels, measured or computed from the gyro with the model. (n,) [rad], left positive

    `most` [m/s²]: lateral acceleration beyond which the angle is cut; larger than in the samples used, because the
    simulated car could spin.
    """
    understeer = understeer_gradient(Tyre().cornering_slope)
    if "steer_angle" in columns:
        angle = columns["steer_angle"]
    elif "yaw_rate" in columns:
        rolling = kinematic_steer_angle(columns["yaw_rate"], v, wheelbase=vehicle.wheelbase)
        angle = rolling + understeer * v * columns["yaw_rate"]
    else:
        return np.zeros_like(v)
    limit = most * (vehicle.wheelbase / np.maximum(v, V_MIN) ** 2 + understeer)
    return smooth(np.clip(angle, -limit, limit), dt, STEER_S)


def brakes_in_torque(pressure: FloatArray, torque: FloatArray) -> bool:
    """Whether the torque (4, n) holds the brakes: it is far below zero where the brakes are pressed."""
    braked = pressure > 4.0 * BRAKE_PRESSURE
    if braked.sum() < 10:
        return True
    return bool(np.median(torque.sum(axis=0)[braked]) < HOLDS_BRAKES)


def brakes_unlogged(torque: FloatArray, v: FloatArray, wet: BoolArray, vehicle: Vehicle, dt: float) -> bool:
    """Whether the car often slows down much more than torque and resistance explain off the water, so by braking."""
    a = smooth(np.gradient(smooth(v, dt, SPEED_S), dt), dt, SPEED_S)
    explained = smooth(torque.sum(axis=0), dt, SPEED_S) / (vehicle.arm("fl") * vehicle.mass) - roll_out(v, vehicle)
    moving = (v > V_MIN) & ~wet
    if moving.sum() * dt < LEAST_S:
        return False
    return bool(((a < explained - UNEXPLAINED) & moving).sum() > OFTEN * moving.sum())
