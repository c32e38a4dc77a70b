"""Residual channels by physics: the value of a function of the measured signals minus that of the simulated ones."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from aqualog.core.notation import WHEELS
from aqualog.core.records import FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.physics.kinematics import centre_line_speed, kinematic_steer_angle

__all__ = ["CHANNELS", "block_means", "block_step", "centre_line_speeds", "channel_values", "channels_of", "contrasts"]

BLOCK_S = 0.1  # [s] keeps what is slower than 5 Hz; faster motion comes from springs, gear teeth and buses


class Kind(NamedTuple):
    """A channel for the page."""

    title: str
    unit: str


# acceleration against torque and resistance, of the accelerometer if there is one; accelerometer against the
# acceleration of the wheels or the velocity; rim speeds on the centre line against the velocity or each other; a_y
# against v_x times yaw rate; rods against the wheel's forces
CHANNELS: dict[str, Kind] = {
    "force_balance": Kind("Force balance", "m/s^2"),
    "kinematic": Kind("Kinematic", "m/s^2"),
    **{f"slip_{w}": Kind(f"Slip {w.upper()}", "m/s") for w in WHEELS},
    "axle_slip": Kind("Slip between axles", "m/s"),
    "side_slip_f": Kind("Slip between front wheels", "m/s"),
    "side_slip_r": Kind("Slip between rear wheels", "m/s"),
    "lateral": Kind("Lateral", "m/s^2"),
    "tie_rod_fl": Kind("Tie rod left", "N"),
    "tie_rod_fr": Kind("Tie rod right", "N"),
}


def channels_of(present: frozenset[str], vehicle: Vehicle) -> tuple[str, ...]:
    """Channels that a log with these signals has."""
    wheels = all(f"omega_{w}" in present for w in WHEELS)
    moves = wheels or "v_x" in present
    out = []
    if ("a_x" in present or moves) and all(f"torque_{w}" in present for w in vehicle.driven):
        out.append("force_balance")
    if "a_x" in present and moves:
        out.append("kinematic")
    if wheels:
        out += [f"slip_{w}" for w in WHEELS] if "v_x" in present else ["axle_slip", "side_slip_f", "side_slip_r"]
    # without a steering angle the gyro leads the simulation, and its noise would be on both sides
    if {"a_y", "yaw_rate", "steer_angle"} <= present and moves:
        out.append("lateral")
    out += [n for n in ("tie_rod_fl", "tie_rod_fr") if n in present and "force_balance" in out]
    return tuple(out)


def contrasts(channels: tuple[str, ...]) -> FloatArray:
    """Combinations of channels (C, C), as rows, that share as little noise as possible: the accelerometer's is in the
    force balance and in the kinematic channel, a reference velocity's in the slip of all four wheels."""
    out = np.eye(len(channels))
    at = {c: i for i, c in enumerate(channels)}
    if {"force_balance", "kinematic"} <= set(at):
        out[at["kinematic"], at["force_balance"]] = -1.0
    four = [at[f"slip_{w}"] for w in WHEELS if f"slip_{w}" in at]
    if len(four) == 4:
        of_four = [[0.25, 0.25, 0.25, 0.25], [0.5, 0.5, -0.5, -0.5], [1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0]]
        out[np.ix_(four, four)] = np.array(of_four)
    if {"tie_rod_fl", "tie_rod_fr"} <= set(at):
        rods = [at["tie_rod_fl"], at["tie_rod_fr"]]
        out[np.ix_(rods, rods)] = [[0.5, 0.5], [1.0, -1.0]]
    return out


def channel_values(
    columns: Mapping[str, FloatArray], channels: tuple[str, ...], vehicle: Vehicle, *, dt: float
) -> FloatArray:
    """Channels of signals as means over blocks of 0.1 s, NaN where a signal is missing. (C, m)

    `columns` (n,) at the step `dt` [s]: canonical signals; of a simulation also `nudge_seen`, the acceleration that
    drew its speed to the measured one. `vehicle`: the file's for both sides. `force_balance` is the accelerometer
    itself, or else the change of the speed: what the torque explains is on the simulated side. ISO 8855 signs
    [iso8855_2011].
    """
    mean = {n: block_means(x, dt) for n, x in columns.items()}
    step = block_step(dt)
    # as a speed, so that it passes the same differences as the wheels'
    drawn = block_means(np.cumsum(columns["nudge_seen"]) * dt, dt) if "nudge_seen" in columns else 0.0
    has_wheels = all(f"omega_{w}" in mean for w in WHEELS)
    wheels = centre_line_speeds(mean, vehicle) if has_wheels else np.empty((4, 0))
    speed = wheels.mean(axis=0) if has_wheels else mean.get("v_x", np.empty(0))
    out = []
    for name in channels:
        if name == "force_balance":
            x = mean["a_x"] if "a_x" in mean else np.gradient(speed - drawn, step)
        elif name == "kinematic":
            x = mean["a_x"] - np.gradient(speed - drawn, step)
        elif name == "lateral":
            x = mean["a_y"] - mean.get("v_x", speed) * mean["yaw_rate"]
        elif name.startswith("tie_rod"):
            x = mean[name]
        elif name == "axle_slip":
            front, rear = 0.5 * (wheels[0] + wheels[1]), 0.5 * (wheels[2] + wheels[3])
            x = front - rear if vehicle.drivetrain == "fwd" else rear - front
        elif name.startswith("side_slip"):
            left, right = wheels[:2] if name == "side_slip_f" else wheels[2:]
            x = left - right
        else:
            x = wheels[WHEELS.index(name[-2:])] - mean["v_x"]
        out.append(x)
    return np.array(out)


def centre_line_speeds(columns: Mapping[str, FloatArray], vehicle: Vehicle) -> FloatArray:
    """Rim speeds on the centre line (4, m) [m/s], of canonical signals with four wheels."""
    yaw = columns.get("yaw_rate")
    rim = [columns[f"omega_{w}"] * vehicle.r_e(w) for w in WHEELS]
    if yaw is None:
        return np.array(rim)
    speed = np.mean(rim, axis=0)
    # the radius of the curve, not the steering wheel: an offset of the one does not enter
    steer = kinematic_steer_angle(yaw, speed, wheelbase=vehicle.wheelbase)
    half = 0.5 * vehicle.track
    return np.array([
        centre_line_speed(
            rim[i], yaw, steer if i < 2 else np.zeros_like(steer), y=half if i % 2 == 0 else -half,
            wheelbase=vehicle.wheelbase,
        )
        for i in range(4)
    ])  # fmt: skip


def block_step(dt: float) -> float:
    """Length of the blocks of `block_means`. [s]"""
    return max(1, round(BLOCK_S / dt)) * dt


def block_means(x: FloatArray, dt: float) -> FloatArray:
    """Means over blocks of 0.1 s, NaN where any sample is missing; slower signals stay as they are. (n,) to (m,)"""
    k = round(block_step(dt) / dt)
    if k == 1:
        return x
    m = x.size // k
    return np.asarray(x[: m * k].reshape(m, k).mean(axis=1))
