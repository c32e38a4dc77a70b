"""Drives made by kinematics alone, with sensors' noise: quick, and every sign is known."""

import numpy as np
import polars as pl

from aqualog.core.records import Quality, Signals
from aqualog.core.vehicle import Vehicle
from aqualog.physics.load import G

CAR = Vehicle(name="made", given=frozenset({"drivetrain", "mass"}))
DT = 0.05


def smooth(rng, n, tau_s, sd):
    """Noise (n,) with a time constant, of a standard deviation."""
    width = max(1, round(tau_s / DT))
    x = np.convolve(rng.standard_normal(n + 3 * width), np.hanning(width + 2), "valid")[:n]
    return sd * (x - x.mean()) / x.std()


def made(seconds=240.0, seed=0, v=20.0, turning=0.06, accelerating=1.0, stops=0, bank=0.0, one_way=False, **sensors):
    """Columns of a drive.

    turning: standard deviation of the yaw rate [rad/s]; bank: cross slope in the bends, to the inside, as a share of
    that which balances them; stops: standstills of 12 s; sensors: `a_x_offset` and the like, SI.
    """
    rng = np.random.default_rng(seed)
    n = round(seconds / DT)
    t = DT * np.arange(n)
    a = smooth(rng, n, 4.0, accelerating)
    speed = np.clip(v + DT * np.cumsum(a - a.mean()), 4.0, None)
    for k in range(stops):
        at = seconds * (k + 0.6) / stops
        speed = speed * np.clip((np.abs(t - at) - 6.0) / 5.0, 0.0, 1.0)
    yaw = smooth(rng, n, 3.0, turning) * (speed > 0.5)
    if one_way:
        yaw = np.abs(yaw) + 0.05
    gained = np.gradient(speed, DT)
    columns = {
        "v_x": speed + 0.03 * rng.standard_normal(n),
        "a_x": gained + 0.15 * rng.standard_normal(n) + 0.2 * np.sin(t / 40.0),
        "a_y": (1.0 - bank) * speed * yaw + 0.15 * rng.standard_normal(n),
        "yaw_rate": yaw + 0.003 * rng.standard_normal(n),
        "steer_angle": yaw * (CAR.wheelbase + 0.003 * speed**2) / np.maximum(speed, 1.0) + 0.001 * rng.standard_normal(n),
    }  # fmt: skip
    course = DT * np.cumsum(yaw)
    columns["latitude"] = 48.0 + np.degrees(DT * np.cumsum(speed * np.sin(course)) / 6.371e6)
    columns["longitude"] = 11.0 + np.degrees(
        DT * np.cumsum(speed * np.cos(course)) / 6.371e6 / np.cos(np.radians(48.0))
    )
    for w, side in (("fl", -1), ("fr", 1), ("rl", -1), ("rr", 1)):
        columns[f"omega_{w}"] = (speed + side * 0.5 * CAR.track * yaw) / CAR.r_e(w) * (speed > 0.1)
        columns[f"omega_{w}"] += 0.05 * rng.standard_normal(n) * (speed > 0.1)
    inertia = sum(CAR.inertia(w) / CAR.r_e(w) / CAR.arm(w) for w in ("fl", "fr", "rl", "rr"))
    force = (CAR.mass + inertia) * gained + 0.5 * CAR.air_density * CAR.drag_area * speed**2 + 0.01 * CAR.mass * G
    for w in ("rl", "rr"):  # brakes are not in it
        columns[f"torque_{w}"] = np.maximum(0.5 * force * CAR.arm(w), -100.0) + 5.0 * rng.standard_normal(n)
        columns[f"omega_{w}"] *= 1.0 + force / (31.0 * 0.5 * CAR.mass * G)
    for name, offset in sensors.items():
        columns[name.removesuffix("_offset")] += offset
    return columns


def signals(columns, drop=(), turned=(), origins=None):
    """The columns as a drive, with some signals turned or left out."""
    own = {n: -x if n in turned else x for n, x in columns.items() if n not in drop}
    return Signals(pl.DataFrame(own), round(1e9 * DT), None, origins or {}, Quality(), ("made",))
