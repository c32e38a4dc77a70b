"""Measurements on a standing car that an effect could be checked by."""

from __future__ import annotations

from aqualog.core.notation import AXLES, WHEELS
from aqualog.model.term import Check

__all__ = ["JACKED", "ROLLED", "STANDSTILL", "WEIGHED"]

_EACH = (None, *AXLES, *WHEELS)

STANDSTILL = Check(  # level to 0.3 %: twice in opposite directions at one place, and the mean of both
    "standstill", "Stand for half a minute, turn the car round at the same place and stand again: the mean of both "
    "readings of the accelerometer is its bias", 5.0, ("a_x", None), "bias", 0.01,
)  # fmt: skip
JACKED = Check(
    "jacked_wheel", "Jack up each wheel and turn it in neutral with a torque wrench", 20.0, _EACH, "torque", 2.0
)
ROLLED = Check(  # 2 cm and the load's share of ten turns, 20 m
    "rolled_distance", "Roll the car ten turns of each wheel and measure the way", 20.0, _EACH, "delta", 0.002
)
WEIGHED = Check("weighing", "Weigh the car as it was driven", 30.0, (None,), "delta_mass", 10.0)
