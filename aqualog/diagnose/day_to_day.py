"""What the same car differs by from drive to drive, as its vehicle file says, in the parameters of effects."""

from __future__ import annotations

from collections.abc import Mapping

from aqualog.diagnose.hypotheses import Hypothesis
from aqualog.vehicle import Vehicle

__all__ = ["day_to_day"]

_KEY_OF: Mapping[str, str] = {
    "payload_mass": "mass", "aero_drag": "drag_area", "rolling_resistance": "rolling_resistance",
    "torque_gain": "torque_gain",
}  # fmt: skip


def day_to_day(h: Hypothesis, name: str, vehicle: Vehicle) -> float:
    """Standard deviation of a parameter from drive to drive, in the effect's unit; 0 where the file has none.

    At the whole car: what a day changes (wind, surface, temperature, the torque's estimate) is at no single axle.
    """
    key = _KEY_OF.get(h.effect.name)
    if key is None or h.where is not None or name != h.free[0]:
        return 0.0
    sd = vehicle.spread.get(key, 0.0)
    # the effect's gain is on top of the file's
    return sd / vehicle.torque_gain if key == "torque_gain" else sd
