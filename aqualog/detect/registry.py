"""All detectors: those of the thesis and the methods of the prior art. A new one is a file and a line here."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

from aqualog.core.records import Unavailable
from aqualog.core.vehicle import Vehicle
from aqualog.detect.detector import Detector, Kind
from aqualog.detect.joint_criteria import JOINT_CRITERIA
from aqualog.detect.joint_cusum import JOINT_CUSUM
from aqualog.detect.margin.watch import MARGIN
from aqualog.detect.minor_spin_down import MINOR_SPIN_DOWN
from aqualog.detect.resistance import RESISTANCE
from aqualog.detect.rivals.front_rear_pattern import FRONT_REAR_PATTERN
from aqualog.detect.rivals.resistance_model import RESISTANCE_MODEL
from aqualog.detect.rivals.slope_friction_ekf import SLOPE_FRICTION_EKF
from aqualog.detect.rivals.slope_line import SLOPE_KALMAN, SLOPE_RLS
from aqualog.detect.rivals.wheel_oscillation import WHEEL_OSCILLATION
from aqualog.detect.rivals.wheel_thresholds import WHEEL_THRESHOLDS
from aqualog.detect.slip_slope.watch import SLIP_SLOPE_DROP
from aqualog.detect.spin import SPIN_DOWN
from aqualog.detect.spin_up import SPIN_UP
from aqualog.detect.tie_rod import TIE_ROD

__all__ = ["BY_NAME", "DETECTORS", "OWN", "RIVALS", "all_of", "check_needs", "running_order"]

_ALL = (
    SPIN_DOWN, MINOR_SPIN_DOWN, SPIN_UP, RESISTANCE, SLIP_SLOPE_DROP, TIE_ROD, JOINT_CRITERIA, JOINT_CUSUM, MARGIN,
    # prior art that the thesis cites in chapter 1, in its order: wheels, resistance, slope
    WHEEL_THRESHOLDS, FRONT_REAR_PATTERN, WHEEL_OSCILLATION, RESISTANCE_MODEL, SLOPE_RLS, SLOPE_KALMAN,
    SLOPE_FRICTION_EKF,
)  # fmt: skip

BY_NAME: Mapping[str, Detector] = {d.name: d for d in _ALL}


def all_of(*kinds: Kind) -> tuple[Detector, ...]:
    """Return the detectors of some kinds, in the order of all lists."""
    return tuple(d for d in BY_NAME.values() if d.kind in kinds)


OWN: tuple[Kind, ...] = ("effect", "joint", "warning")
"""Kinds that run on every drive: the thesis' own, and the warning before."""

DETECTORS = tuple(d.name for d in all_of(*OWN))
"""Names of these."""

RIVALS = {d.name: d for d in all_of("rival")}
"""Methods of the prior art."""


def running_order(detectors: Iterable[Detector]) -> list[Detector]:
    """Return detectors so that each comes after those that it reads; else in their own order."""
    asked = list(detectors)
    ordered: list[Detector] = []

    def add(detector: Detector) -> None:
        for read in detector.reads:
            add(read)
        if detector in asked and detector not in ordered:
            ordered.append(detector)

    for detector in asked:
        add(detector)
    return ordered


def check_needs(
    vehicle: Vehicle, available: Collection[str], *, rate_hz: float, detectors: Iterable[Detector] | None = None
) -> tuple[list[Unavailable], list[Unavailable]]:
    """Return which detectors cannot run, and which run without one of their conditions.

    Parameters
    ----------
    available : collection of str
        Symbols of the drive.
    rate_hz : float
        Rate of the grid, which is that of the wheel speeds. [Hz]
    detectors : iterable of Detector, optional
        The thesis' own by default.

    Returns
    -------
    unavailable, limited : lists
        Each with the signals (or `vehicle.KEY`) that are missing.
    """
    have = frozenset(available)
    chosen = all_of(*OWN) if detectors is None else detectors
    needs = {d.name: d.needs(vehicle, have, rate_hz) for d in chosen}
    unavailable = [Unavailable(name, tuple(dict.fromkeys(n.missing))) for name, n in needs.items() if n.missing]
    limited = [Unavailable(name, n.lacks) for name, n in needs.items() if n.lacks and not n.missing]
    return unavailable, limited
