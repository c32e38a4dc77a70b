"""Guess the unit of a channel that has none.

Two things are asked: how large its values become in a drive, and by which factor they follow what the motion of the
car makes of them (a speed, an acceleration, a yaw rate in SI). The factor decides where there is one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aqualog.core.records import FloatArray

__all__ = ["CHOICES", "Choice", "UnitGuess", "by_acceleration", "by_factor", "by_range", "top_of"]


@dataclass(frozen=True, slots=True)
class Choice:
    """A unit that a quantity may have.

    `low`, `high`: SI value over raw value, of the quantity itself or of what is compared with it. `least`, `most`:
    between them the top of a drive lies in this unit, see `top_of`.
    """

    unit: str
    low: float
    high: float
    least: float
    most: float


@dataclass(frozen=True, slots=True)
class UnitGuess:
    """The likeliest unit, in words why, and the other units that the data allow (`doubt`), likeliest first."""

    unit: str
    reason: str
    doubt: tuple[str, ...] = ()


_SPEED = (
    Choice("km/h", 1 / 3.6, 1 / 3.6, 8.0, 420.0),
    Choice("m/s", 1.0, 1.0, 2.0, 115.0),
    Choice("mph", 0.44704, 0.44704, 5.0, 260.0),
)
_DEG = math.pi / 180.0
CHOICES: dict[str, tuple[Choice, ...]] = {
    "speed": _SPEED,
    # a wheel's speed is compared with that of the car: the factor of its turning is the rolling radius [m]
    "wheel": (*_SPEED, Choice("rad/s", 0.24, 0.42, 6.0, 400.0), Choice("rpm", 0.025, 0.044, 400.0, 4000.0)),
    "acceleration": (
        Choice("m/s^2", 1.0, 1.0, 0.02, 25.0),
        Choice("g", 9.80665, 9.80665, 0.002, 2.5),
        Choice("mg", 0.00980665, 0.00980665, 30.0, 2500.0),
    ),
    "yaw_rate": (Choice("deg/s", _DEG, _DEG, 0.05, 180.0), Choice("rad/s", 1.0, 1.0, 0.0005, 2.5)),
    # yaw rate over speed per angle of the steering wheel: 1 / (steering ratio * wheelbase) [1/m]
    "steering": (
        Choice("deg", _DEG / 100.0, _DEG / 20.0, 0.1, 1000.0),
        Choice("rad", 1.0 / 100.0, 1.0 / 20.0, 0.002, 16.0),
    ),
    # deceleration per brake pressure [m/s^2]: full braking takes 60 to 180 bar
    "brake": (
        Choice("bar", 0.04, 0.25, 0.1, 250.0),
        Choice("MPa", 0.4, 2.5, 0.2, 25.0),
        Choice("kPa", 0.0004, 0.0025, 200.0, 25000.0),
        Choice("psi", 0.0028, 0.017, 30.0, 3600.0),
        Choice("Pa", 4e-7, 2.5e-6, 2e5, 2.5e7),
    ),
    "tyre_pressure": (
        Choice("bar", 1e5, 1e5, 1.0, 5.0), Choice("kPa", 1e3, 1e3, 100.0, 500.0),
        Choice("psi", 6895.0, 6895.0, 14.0, 72.0), Choice("Pa", 1.0, 1.0, 1e5, 5e5), Choice("MPa", 1e6, 1e6, 0.1, 0.5),
    ),
    "torque": (Choice("N*m", 1.0, 1.0, 0.05, 12000.0), Choice("kNm", 1e3, 1e3, 0.05, 12.0)),
    "tie_rod": (Choice("N", 1.0, 1.0, 60.0, 50000.0), Choice("kN", 1e3, 1e3, 0.05, 50.0)),
    "temperature": (
        Choice("degC", 1.0, 1.0, 0.0, 55.0), Choice("degF", 0.5556, 0.5556, 56.0, 130.0),
        Choice("K", 1.0, 1.0, 230.0, 330.0),
    ),
}  # fmt: skip
"""Units of each quantity, the usual one first."""

_TOP = 99.9  # [%] of the samples; a code or a glitch may stand above
_MARGIN = math.log(1.3)  # beside the best pair of units: as near as this, another is in doubt


def top_of(x: FloatArray) -> float:
    """Return what the absolute value of samples (n,) stays below but for one of a thousand; NaN without a sample."""
    finite = np.abs(x[np.isfinite(x)])
    return float(np.percentile(finite, _TOP)) if finite.size else math.nan


def by_factor(factor: float, choices: Sequence[Choice], *, spread: float) -> str | None:
    """Return the first unit whose factor is the measured one; None if none is.

    Parameters
    ----------
    factor : float
        What is expected in SI over the raw value, positive.
    choices : sequence of Choice
    spread : float
        Relative uncertainty of the factor, such as 0.04.
    """
    if not (math.isfinite(factor) and factor > 0.0):
        return None
    return next((c.unit for c in choices if c.low / (1.0 + spread) <= factor <= c.high * (1.0 + spread)), None)


def by_range(x: FloatArray, choices: Sequence[Choice]) -> UnitGuess | None:
    """Return the usual unit for samples (n,) that become as large as these, the others in doubt; None if none is."""
    top = top_of(x)
    if top == 0.0:
        return UnitGuess(choices[0].unit, "as usual, it is 0 throughout")
    units = [c.unit for c in choices if c.least <= top <= c.most]
    if not units:
        return None
    return UnitGuess(units[0], f"by its range (to {top:.4g})", tuple(units[1:]))


def by_acceleration(ratio: float, speeds: Sequence[Choice], accelerations: Sequence[Choice]) -> UnitGuess | None:
    """Return the unit of a speed by an accelerometer: the pair of units in which one is the derivative of the other.

    `ratio` is the scatter of the accelerometer's values over that of the derivative of the speed's [1/s], both raw. The
    choices are the units that the ranges allow; one acceleration if the unit is known.
    """
    if not (math.isfinite(ratio) and ratio > 0.0):
        return None
    misfit: dict[str, float] = {}
    for v in speeds:
        for a in accelerations:
            factor = math.sqrt(v.low * v.high) / a.low
            misfit[v.unit] = min(misfit.get(v.unit, math.inf), abs(math.log(ratio / factor)))
    ordered = sorted(misfit, key=lambda u: misfit[u])
    if not ordered or misfit[ordered[0]] > math.log(2.0):
        return None
    near = [u for u in ordered if misfit[u] - misfit[ordered[0]] < _MARGIN]
    usual = [c.unit for c in speeds if c.unit in near]
    return UnitGuess(usual[0], "fits the accelerometer", tuple(usual[1:]))
