"""The dictionary of signals: the only home of column names, their units and signs.

SI and radians inside; ISO 8855 axes [iso8855_2011] (x forward, y left, z up); wheels `fl fr rl rr` in this order
everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

__all__ = ["ACCEPTED", "AXLES", "SIDES", "SYMBOLS", "WHEELS", "Kind", "Symbol", "side_of"]

WHEELS = ("fl", "fr", "rl", "rr")
AXLES = {"f": ("fl", "fr"), "r": ("rl", "rr")}
SIDES = {"left": ("fl", "rl"), "right": ("fr", "rr")}

Kind = Literal["continuous", "state"]


def side_of(wheel: str) -> str:
    """Vehicle side of a wheel: `fl` -> `left`."""
    return "left" if wheel.endswith("l") else "right"


@dataclass(frozen=True, slots=True)
class Symbol:
    """One canonical signal.

    `low` and `high` bound what a sensor of a road car can show; a sample outside is bad data, masked and counted.
    """

    name: str
    unit: str
    meaning: str
    low: float
    high: float
    kind: Kind = "continuous"


def _wheels(stem: str, unit: str, meaning: str, low: float, high: float) -> list[Symbol]:
    return [Symbol(f"{stem}_{w}", unit, meaning, low, high) for w in WHEELS]


_ALL = [
    Symbol("v_x", "m/s", "longitudinal velocity from a reference (GNSS, optical)", -30.0, 150.0),
    Symbol("a_x", "m/s^2", "ESC accelerometer, forward: specific force, holds g sin(theta) on a grade", -20.0, 20.0),
    Symbol("a_y", "m/s^2", "ESC accelerometer, left", -25.0, 25.0),
    Symbol("yaw_rate", "rad/s", "yaw rate, left turn positive", -6.0, 6.0),
    Symbol("steer_angle", "rad", "mean road-wheel angle, left positive", -1.2, 1.2),
    *_wheels("omega", "rad/s", "wheel speed, forward positive", -50.0, 600.0),
    *_wheels("torque", "N*m", "net wheel torque, drive minus brake", -12000.0, 12000.0),
    Symbol("tie_rod_fl", "N", "tie-rod force, compression positive", -50000.0, 50000.0),
    Symbol("tie_rod_fr", "N", "tie-rod force, compression positive", -50000.0, 50000.0),
    Symbol("steering_torque", "N*m", "torque at the steering (assistance, column), left positive", -200.0, 200.0),
    Symbol("water_depth", "m", "water depth on the lane", 0.0, 0.2),
    Symbol("water_depth_left", "m", "water depth in the left track", 0.0, 0.2),
    Symbol("water_depth_right", "m", "water depth in the right track", 0.0, 0.2),
    Symbol("on_water", "bool", "label: on the watered lane", 0.0, 1.0, "state"),
    Symbol("gear", "-", "gear", -2.0, 20.0, "state"),
    Symbol("brake_pressure", "Pa", "brake pressure (master cylinder)", -1e6, 4e7),
    Symbol("latitude", "deg", "latitude", -90.0, 90.0),
    Symbol("longitude", "deg", "longitude", -180.0, 180.0),
    Symbol("altitude", "m", "height above sea level", -500.0, 9000.0),
    *_wheels("pressure", "Pa", "gauge pressure of the tyre: above that of the air", 0.0, 2e6),
    Symbol("ambient_temperature", "K", "ambient temperature", 200.0, 340.0),
]

SYMBOLS: dict[str, Symbol] = {s.name: s for s in _ALL}

# Names that a log may bear beside the canonical ones; each becomes canonical on reading.
ACCEPTED: dict[str, Symbol] = {
    "steering_wheel_angle": Symbol("steering_wheel_angle", "rad", "divided by the vehicle's steering_ratio", -25, 25),
    "torque_f": Symbol("torque_f", "N*m", "front axle torque, halved to its wheels", -24000.0, 24000.0),
    "torque_r": Symbol("torque_r", "N*m", "rear axle torque, halved to its wheels", -24000.0, 24000.0),
}
