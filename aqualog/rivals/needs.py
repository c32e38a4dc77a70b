"""List what rivals need, by name of the missing signal or key of the vehicle file."""

from __future__ import annotations

from collections.abc import Collection

from aqualog.core.notation import WHEELS
from aqualog.core.vehicle import Vehicle

__all__ = [
    "MIN_RATE", "MIN_RATE_OSCILLATION", "MIN_RATE_PATTERN", "all_wheels", "balance", "fast_wheels", "pattern_wheels",
    "slip_slope",
]  # fmt: skip

MIN_RATE = 5.0  # [Hz] as of the spin detectors: a full spin-down lasts half a second and more
MIN_RATE_PATTERN = 20.0  # [Hz] the axles pass the same spot within a tenth of a second
MIN_RATE_OSCILLATION = 80.0  # [Hz] the band reaches from 15 Hz to near half of the rate


def all_wheels(vehicle: Vehicle, have: Collection[str], rate_hz: float) -> tuple[str, ...]:
    """Wheel speeds of all wheels."""
    return (*(f"omega_{w}" for w in WHEELS if f"omega_{w}" not in have), *_rate(rate_hz, MIN_RATE))


def pattern_wheels(vehicle: Vehicle, have: Collection[str], rate_hz: float) -> tuple[str, ...]:
    """Wheel speeds of all wheels, fast enough to see the same spot twice."""
    return (*(f"omega_{w}" for w in WHEELS if f"omega_{w}" not in have), *_rate(rate_hz, MIN_RATE_PATTERN))


def fast_wheels(vehicle: Vehicle, have: Collection[str], rate_hz: float) -> tuple[str, ...]:
    """Wheel speeds of all wheels, fast enough for oscillations."""
    return (*(f"omega_{w}" for w in WHEELS if f"omega_{w}" not in have), *_rate(rate_hz, MIN_RATE_OSCILLATION))


def balance(vehicle: Vehicle, have: Collection[str], rate_hz: float) -> tuple[str, ...]:
    """Signals and vehicle keys of the longitudinal balance."""
    torque = [f"torque_{w}" for w in vehicle.driven if f"torque_{w}" not in have]
    no_wheel = not any(f"omega_{w}" in have for w in WHEELS)
    return (
        *torque,
        *(() if "a_x" in have else ("a_x",)),
        *(("v_x",) if no_wheel and "v_x" not in have else ()),
        *(() if "mass" in vehicle.given else ("vehicle.mass",)),
        *_rate(rate_hz, MIN_RATE),
    )


def slip_slope(vehicle: Vehicle, have: Collection[str], rate_hz: float) -> tuple[str, ...]:
    """Wheel speeds, driving torque, and a velocity that no driven wheel makes: for AWD a reference and its lag."""
    torque = [f"torque_{w}" for w in vehicle.driven if f"torque_{w}" not in have]
    velocity = ("v_x", "a_x") if vehicle.drivetrain == "awd" else ()
    return (*all_wheels(vehicle, have, rate_hz), *torque, *(s for s in velocity if s not in have))


def _rate(rate_hz: float, least: float) -> tuple[str, ...]:
    # grids of 80 Hz have sample times of whole nanoseconds
    return () if rate_hz > least * (1.0 - 1e-6) else (f"wheel speeds at {least:g} Hz or more",)
