"""Spin-up of a driven wheel: little traction, and water that holds the car back."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import partial
from typing import Any

from aqualog.core.vehicle import Vehicle
from aqualog.detect.detector import Detector, Needs, missing_drivetrain, missing_torques, missing_wheels, too_slow
from aqualog.detect.events import DURATION
from aqualog.detect.resistance import RESISTANCE
from aqualog.detect.spin import MIN_RATE, THRESHOLD, SpinWatch

__all__ = ["SPIN_UP"]

LOST_S = 0.06  # [s] twice the memory of wheel accelerations: what is shorter is a change of torque or a gap of water


def _needs_up(vehicle: Vehicle, have: Collection[str], rate_hz: float) -> Needs:
    omega = missing_wheels(have, vehicle.driven)
    is_blind = len(omega) == len(vehicle.driven)
    return Needs(
        (*(omega if is_blind else ()), *missing_drivetrain(vehicle), *too_slow(rate_hz, MIN_RATE)),
        (*omega, *missing_torques(vehicle, have)),
    )


def severity(evidence: Mapping[str, Any]) -> str:
    """Full and partial by the traction coefficient (thesis 2.5, criterion 3); partial where it is unknown.

    It is lost for most of the event, since its least value is that of a moment in which the torque changes, and for
    longer than such a moment.
    """
    lost = evidence.get("mu_lost", 0.0)
    return "full" if lost > 0.5 and lost * evidence[DURATION] > LOST_S - 1e-9 else "partial"


SPIN_UP = Detector(
    name="spin_up",
    title="Spin-up",
    unit="m/s",
    meaning="speed that a wheel gains faster than a healthy one can",
    statistic="speed a driven wheel gained faster than the vehicle",
    threshold=THRESHOLD,
    needs=_needs_up,
    start=partial(SpinWatch, sign=1.0),
    # wet ice holds less than the limit too, but costs nothing (C27)
    reads=(RESISTANCE,),
    severity=severity,
)
