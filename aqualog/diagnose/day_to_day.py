"""Drive-to-drive spread of the same car from its vehicle file, expressed in the parameters of effects."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal

from aqualog.core.vehicle import Vehicle
from aqualog.diagnose.hypotheses import Hypothesis
from aqualog.physics.load import G

__all__ = ["Kind", "as_value", "day_to_day", "kind_of"]

Kind = Literal["", "inertia", "drag", "rolling"]

_KEY_OF: Mapping[str, str] = {
    "payload_mass": "mass", "aero_drag": "drag_area", "rolling_resistance": "rolling_resistance",
    "torque_gain": "torque_gain",
}  # fmt: skip
# parameters that look like one day-to-day difference: the force balance cannot separate mass from the torque's gain,
# drag area from the day's wind, or rolling resistance from drag
_KIND_OF: Mapping[tuple[str, str], Kind] = {
    ("payload_mass", "delta_mass"): "inertia",
    ("trailer", "mass"): "inertia",
    ("wheel_inertia", "delta_inertia"): "inertia",
    ("torque_gain", "gain"): "inertia",
    ("aero_drag", "delta_drag_area"): "drag",
    ("trailer", "delta_drag_area"): "drag",
    ("head_wind", "speed"): "drag",
    ("rolling_resistance", "delta_r_w"): "rolling",
    ("brake_drag", "torque"): "rolling",
}


def day_to_day(h: Hypothesis, name: str, vehicle: Vehicle) -> float:
    """Standard deviation of a parameter from drive to drive, in the effect's unit; 0 where the file gives no value.

    Applies to the whole car only: wind, surface, temperature and the torque's estimate do not act on a single axle.
    Each key of the file counts here once.
    """
    key = _KEY_OF.get(h.effect.name)
    if key is None or h.where is not None or name != h.free[0]:
        return 0.0
    sd = vehicle.spread.get(key, 0.0)
    # the effect's gain is on top of the file's
    return sd / vehicle.torque_gain if key == "torque_gain" else sd


def kind_of(h: Hypothesis, name: str) -> Kind:
    """The kind of day-to-day difference that a parameter looks like, or an empty string."""
    return _KIND_OF.get((h.effect.name, name), "")


def as_value(h: Hypothesis, name: str, vehicle: Vehicle, speed: float) -> float:
    """Standard deviation of the day-to-day differences of its kind, expressed as a value of this parameter, in its
    unit.

    Parameters
    ----------
    h : Hypothesis
    name : str
        One of its free parameters.
    vehicle : Vehicle
    speed : float
        At which its drag counts. [m/s]
    """
    kind = kind_of(h, name)
    if kind == "inertia":
        gain = vehicle.spread.get("torque_gain", 0.0) / vehicle.torque_gain
        share = math.hypot(vehicle.spread.get("mass", 0.0) / vehicle.mass, gain)
        return share * _mass_of_unit(h, vehicle)
    if kind == "drag":
        sd = vehicle.spread.get("drag_area", 0.0)
        # (v + w)^2 = v^2 (1 + 2 w / v) to first order
        return 0.5 * speed * sd / vehicle.drag_area if h.effect.name == "head_wind" and vehicle.drag_area > 0.0 else sd
    if kind == "rolling":
        return vehicle.spread.get("rolling_resistance", 0.0) * _rolling_of_unit(h, vehicle)
    return 0.0


def _mass_of_unit(h: Hypothesis, vehicle: Vehicle) -> float:
    """Value of a parameter that has the effect of doubling the car's mass."""
    if h.effect.name == "torque_gain":
        return 1.0
    if h.effect.name == "wheel_inertia":
        parts = [2.0 / vehicle.r_l(axle) ** 2 for axle in _axles(h)]
        return vehicle.mass / sum(parts)
    return vehicle.mass


def _rolling_of_unit(h: Hypothesis, vehicle: Vehicle) -> float:
    """Value of a parameter that has the effect of a coefficient of one at the whole car."""
    if h.effect.name == "brake_drag":
        wheels = 1 if h.where in ("fl", "fr", "rl", "rr") else 2 * len(_axles(h))
        return vehicle.mass * G * vehicle.r_l(_axles(h)[0]) / wheels
    front = vehicle.l_r / vehicle.wheelbase
    return {"f": 1.0 / front, "r": 1.0 / (1.0 - front)}.get(h.where or "", 1.0)


def _axles(h: Hypothesis) -> tuple[str, ...]:
    return ("f", "r") if h.where is None else (h.where[0],)
