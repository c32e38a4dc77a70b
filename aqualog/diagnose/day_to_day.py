"""Drive-to-drive spread of the same car from its vehicle file, expressed in the parameters of effects.

Some parameters look like one day-to-day difference: the force balance cannot separate mass from the torque's gain, drag
area from the day's wind, or rolling resistance from drag.
"""

from __future__ import annotations

import math

from aqualog.core.vehicle import Vehicle
from aqualog.diagnose.file_values import deviation, own_sd
from aqualog.diagnose.hypotheses import Hypothesis
from aqualog.model.term import Kind

__all__ = ["as_value", "day_to_day", "kind_of"]


def day_to_day(h: Hypothesis, name: str, vehicle: Vehicle) -> float:
    """Standard deviation of a parameter from drive to drive, in the effect's unit; 0 where the file gives no value.

    Applies to the whole car only: wind, surface, temperature and the torque's estimate do not act on a single axle.
    Each key of the file counts here once.
    """
    row = h.parameter(name).day_to_day
    if row is None or h.where is not None:
        return 0.0
    sd = vehicle.spread.get(row.key, 0.0)
    # the effect's gain is on top of the file's
    return sd / vehicle.torque_gain if row.key == "torque_gain" else sd


def kind_of(h: Hypothesis, name: str) -> Kind:
    """The kind of day-to-day difference that a parameter looks like, or an empty string."""
    row = h.parameter(name).day_to_day
    return "" if row is None else row.kind


def as_value(h: Hypothesis, name: str, vehicle: Vehicle, speed: float) -> float:
    """Standard deviation of the day-to-day differences of its kind and of the file's own values, expressed as a value
    of this parameter, in its unit.

    Parameters
    ----------
    h : Hypothesis
    name : str
        One of its free parameters.
    vehicle : Vehicle
    speed : float
        At which its drag counts. [m/s]
    """
    row = h.parameter(name).day_to_day
    own = deviation(h, name, vehicle)
    if row is None:
        return own

    def off(key: str) -> float:
        return math.hypot(vehicle.spread.get(key, 0.0), own_sd(vehicle, key))

    sd = {
        "inertia": math.hypot(off("mass") / vehicle.mass, off("torque_gain") / vehicle.torque_gain),
        "drag": off("drag_area"),
        "rolling": off("rolling_resistance"),
    }[row.kind]
    alike = row.value(sd, vehicle, h.where, speed)
    is_in = h.where is None and row.key  # the file's own value is one of those above
    return max(alike, own) if is_in else math.hypot(alike, own)
