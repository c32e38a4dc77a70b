"""Spin-up of a driven wheel: little traction, and water that holds the car back."""

from __future__ import annotations

from collections.abc import Collection
from functools import partial

from aqualog.core.vehicle import Vehicle
from aqualog.detect.detector import Detector, Needs, missing_drivetrain, missing_torques, missing_wheels, too_slow
from aqualog.detect.events import DURATION
from aqualog.detect.resistance import RESISTANCE
from aqualog.detect.spin import LOST_S, MIN_RATE, THRESHOLD, SpinWatch

__all__ = ["SPIN_UP"]


def _needs_up(vehicle: Vehicle, have: Collection[str], rate_hz: float) -> Needs:
    omega = missing_wheels(have, vehicle.driven)
    is_blind = len(omega) == len(vehicle.driven)
    return Needs(
        (*(omega if is_blind else ()), *missing_drivetrain(vehicle), *too_slow(rate_hz, MIN_RATE)),
        (*omega, *missing_torques(vehicle, have)),
    )


SPIN_UP = Detector(
    name="spin_up",
    title="Spin-up",
    unit="m/s",
    meaning="speed that a wheel gains faster than a healthy one can",
    statistic="speed a driven wheel gained faster than the vehicle",
    threshold=THRESHOLD,
    needs=_needs_up,
    start=partial(SpinWatch, sign=1.0),
    reads=(RESISTANCE,),  # wet ice holds less than the limit too, but costs nothing (C27)
    # thesis 2.5, criterion 3: by the traction coefficient over most of the event, for longer than the torque changes or
    # the contact has a gap; partial where it is unknown
    severity=lambda e: "full" if (lost := e.get("mu_lost", 0.0)) > 0.5 and lost * e[DURATION] >= LOST_S else "partial",
)
