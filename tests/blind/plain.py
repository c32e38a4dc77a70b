"""A third simulator, as simple as a test's author would write one: a point mass on linear tyres, no transients.

No relaxation, no slip of rolling wheels, kinematic curves, the driver's torque in steps. Whoever diagnoses its drives
meets differences of form that neither the library's simulator nor the blind world has.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import polars as pl

from aqualog.core.notation import WHEELS
from aqualog.core.records import FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.physics.load import G
from tests.blind.world.noise import coloured

__all__ = ["CAR", "EFFECTS", "drive"]

CAR = Vehicle(
    name="plain", drivetrain="rwd", mass=1600.0, drag_area=0.7, rolling_resistance=0.011, r_e_f=0.315, r_e_r=0.315,
    r_l_f=0.31, r_l_r=0.31,
)  # fmt: skip
EFFECTS: Mapping[str, float] = {
    "payload_mass": 0.0, "rolling_resistance": 0.0, "aero_drag": 0.0, "head_wind": 0.0, "torque_gain": 1.0,
    "brake_drag": 0.0, "road_grade": 0.0, "hills": 0.0, "slip_stiffness": 1.0, "tyre_radius_fl": 0.0,
    "velocity_scale": 1.0, "accelerometer_bias": 0.0, "accelerometer_gain": 1.0, "delay_a_x": 0.0, "delay_v_x": 0.0,
}  # fmt: skip
"""Neutral values of what can be hidden, SI."""
SPEEDS = {"mixed": (8.0, 38.0, 8.0), "motorway": (26.0, 36.0, 20.0), "stop_and_go": (5.0, 16.0, 8.0)}  # [m/s], [s]
DT = 0.01
FRONT_BRAKE = 0.6
SIGMA = {"a_x": 0.05, "a_y": 0.05, "yaw_rate": 2e-3, "steer_angle": 5e-4, "v_x": 0.03, "omega": 0.04, "torque": 3.0}


def drive(
    seed: int, programme: str = "mixed", noise: str = "white", duration_s: float = 300.0, **hidden: float
) -> pl.DataFrame:
    """The log of a drive with effects hidden in it; noise of the accelerometers has a colour of the blind world."""
    h = {**EFFECTS, **hidden}
    if unknown := set(hidden) - set(EFFECTS):
        raise KeyError(f"no effect {sorted(unknown)} here")
    rng = np.random.default_rng([seed, 7])
    n = round(duration_s / DT)
    v, a, force, slope = _driven(_target(rng, programme, n), 0.1 * _slow(rng, n, 3.0), seed, h)
    out = _sensors(rng, v, a, force, slope, h)
    noisy = {
        name: x + SIGMA[name if name in SIGMA else name.split("_")[0]] * coloured(noise if name[0] == "a" else "white", n, rng)
        for name, x in out.items()
    }  # fmt: skip
    return pl.DataFrame({"t": np.arange(n) * DT, **noisy})


def _target(rng: np.random.Generator, programme: str, n: int) -> FloatArray:
    low, high, hold = SPEEDS[programme]
    target: FloatArray = np.zeros(n)
    at = 0
    while at < n:
        length = int(rng.uniform(hold, 3.0 * hold) / DT)
        target[at : at + length] = rng.uniform(low, high)
        at += length
    return target


def _slow(rng: np.random.Generator, n: int, tau: float) -> FloatArray:
    """Noise of unit variance with a time constant."""
    keep = np.exp(-DT / tau)
    steps = np.sqrt(1.0 - keep**2) * rng.standard_normal(n)
    out: FloatArray = np.zeros(n)
    for i in range(1, n):
        out[i] = keep * out[i - 1] + steps[i]
    return out


def _driven(
    target: FloatArray, unrest: FloatArray, seed: int, h: Mapping[str, float]
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Speed, acceleration, force of the wheels' torque, sine of the slope: (n,) each."""
    m = CAR.mass + h["payload_mass"]
    turning = 2.0 * CAR.inertia_f / CAR.r_e_f**2 + 2.0 * CAR.inertia_r / CAR.r_e_r**2
    rolling = m * G * (CAR.rolling_resistance + h["rolling_resistance"]) + 4.0 * h["brake_drag"] / CAR.r_e_f
    v, s = max(target[0], 5.0), 0.0
    rows = np.zeros((4, target.size))
    for i, wish in enumerate(target):
        slope = h["road_grade"] + h["hills"] * np.sqrt(2.0) * np.sin(2.0 * np.pi * s / 900.0 + seed)
        want = np.clip(0.5 * (wish - v) + unrest[i], -3.0, 2.5)
        # the driver presses as the vehicle file's car would need it, and is late to see that it is another one
        force = (CAR.mass + turning) * want + _drag(v, CAR.drag_area) + CAR.mass * G * CAR.rolling_resistance
        drag = _drag(v + h["head_wind"], CAR.drag_area + h["aero_drag"])
        a = (force - drag - rolling - m * G * np.sin(slope)) / (m + turning)
        rows[:, i] = v, a, force, np.sin(slope)
        v = max(v + a * DT, 1.0)
        s += v * DT
    return rows[0], rows[1], rows[2], rows[3]


def _drag(v: float, area: float) -> float:
    return 0.5 * CAR.air_density * area * v * abs(v)


def _sensors(
    rng: np.random.Generator, v: FloatArray, a: FloatArray, force: FloatArray, slope: FloatArray, h: Mapping[str, float]
) -> dict[str, FloatArray]:
    n = v.size
    t = np.arange(n) * DT
    m = CAR.mass + h["payload_mass"]
    yaw = 0.05 * _slow(rng, n, 2.0) * np.minimum(1.0, 8.0 / np.maximum(v, 5.0))
    out: dict[str, FloatArray] = {}
    front = np.where(force >= 0.0, 0.0, FRONT_BRAKE)
    for w in WHEELS:
        axle = front if w[0] == "f" else 1.0 - front
        torque = 0.5 * axle * force * CAR.r_e_r
        static = 0.5 * m * G * (CAR.l_r if w[0] == "f" else CAR.l_f) / CAR.wheelbase
        shift = 0.5 * m * a * CAR.h_cg / CAR.wheelbase
        F_z = static - shift if w[0] == "f" else static + shift
        own = 0.25 * m * G * (CAR.rolling_resistance + h["rolling_resistance"]) + h["brake_drag"] / CAR.r_e_f
        traction = torque / CAR.r_e_r - own - CAR.inertia(w) * a / CAR.r_e(w) ** 2
        slip_slope = (CAR.slip_slope_f if w[0] == "f" else CAR.slip_slope_r) * h["slip_stiffness"]
        side = 0.5 * CAR.track * (-1.0 if w[1] == "l" else 1.0)
        radius = CAR.r_e(w) * (1.0 + (h["tyre_radius_fl"] if w == "fl" else 0.0))
        out[f"omega_{w}"] = (v + yaw * side) * (1.0 + traction / (slip_slope * F_z)) / radius
        out[f"torque_{w}"] = torque / h["torque_gain"]
    out["v_x"] = np.interp(t - h["delay_v_x"], t, v) * h["velocity_scale"]
    felt = np.interp(t - h["delay_a_x"], t, a + G * slope)
    out["a_x"] = felt * h["accelerometer_gain"] + h["accelerometer_bias"]
    out["a_y"], out["yaw_rate"], out["steer_angle"] = v * yaw, yaw, yaw * CAR.wheelbase / np.maximum(v, 3.0)
    return out
