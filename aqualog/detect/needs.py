"""Check what each detector needs before any work."""

from __future__ import annotations

from collections.abc import Collection

from aqualog.core.notation import AXLES, SIDES, WHEELS
from aqualog.core.records import Unavailable
from aqualog.core.vehicle import Vehicle

__all__ = ["DETECTORS", "MIN_RATE_MINOR", "check_needs"]

DETECTORS = (
    "spin_down", "minor_spin_down", "spin_up", "resistance", "slip_slope_drop", "tie_rod", "joint_criteria",
    "joint_cusum",
)  # fmt: skip

MIN_RATE_SPIN = 5.0  # [Hz] a full spin-down lasts half a second and more
MIN_RATE_RESISTANCE = 2.0  # [Hz]
MIN_RATE_MINOR = 20.0  # [Hz] a minor spin-down lasts 50 to 300 ms; slower wheel speeds show kerbs and noise only


def check_needs(
    vehicle: Vehicle, available: Collection[str], *, rate_hz: float
) -> tuple[list[Unavailable], list[Unavailable]]:
    """Return which detectors cannot run, and which run without one of their conditions.

    Parameters
    ----------
    vehicle : Vehicle
    available : collection of str
        Symbols of the drive.
    rate_hz : float
        Rate of the grid, which is that of the wheel speeds. [Hz]

    Returns
    -------
    unavailable, limited : lists
        Each with the signals (or `vehicle.KEY`) that are missing.
    """
    have = set(available)
    omega = [f"omega_{w}" for w in WHEELS if f"omega_{w}" not in have]
    torque = [f"torque_{w}" for w in vehicle.driven if f"torque_{w}" not in have]
    no_speed = ["v_x"] if "v_x" not in have and len(omega) == len(WHEELS) else []
    resistance = [*torque, *(["a_x"] if "a_x" not in have else []), *no_speed, *_not_given(vehicle, "mass")]
    sides = {s: [f"omega_{w}" for w in ws if f"omega_{w}" in omega] for s, ws in SIDES.items()}
    driven_omega = [f"omega_{w}" for w in vehicle.driven if f"omega_{w}" in omega]
    slow = [f"wheel speeds at {MIN_RATE_MINOR:g} Hz or more"] if rate_hz < MIN_RATE_MINOR else []
    too_slow = [f"wheel speeds at {MIN_RATE_SPIN:g} Hz or more"] if rate_hz < MIN_RATE_SPIN else []
    if rate_hz < MIN_RATE_RESISTANCE:
        resistance.append(f"signals at {MIN_RATE_RESISTANCE:g} Hz or more (check the unit of the time)")
    missing = {
        "spin_down": [*(omega if len(omega) == len(WHEELS) else _lone_wheel(have, omega)), *too_slow],
        "minor_spin_down": [*(omega if all(sides.values()) else []), *slow],
        "spin_up": [*(driven_omega if len(driven_omega) == len(vehicle.driven) else []), *too_slow],
        "resistance": resistance,
        "slip_slope_drop": [*omega, *torque, *too_slow],
        "tie_rod": _steering(vehicle, have),
        "joint_criteria": [*resistance, *(omega if len(omega) == len(WHEELS) else [])],
        "joint_cusum": [*resistance, *(omega if len(omega) == len(WHEELS) else [])],
    }
    unavailable = [Unavailable(d, tuple(dict.fromkeys(missing[d]))) for d in DETECTORS if missing[d]]
    gone = {u.detector for u in unavailable}
    limited = {
        "spin_down": omega,
        "minor_spin_down": omega,
        "spin_up": [*driven_omega, *torque],
        "tie_rod": [f"tie_rod_{w}" for w in AXLES["f"] if f"tie_rod_{w}" not in have],
        "joint_criteria": [*omega, *(["slip_slope_drop"] if "slip_slope_drop" in gone else [])],
        "joint_cusum": [*omega, *(["slip_slope_drop"] if "slip_slope_drop" in gone else [])],
    }
    return unavailable, [Unavailable(d, tuple(m)) for d, m in limited.items() if m and d not in gone]


def _lone_wheel(have: set[str], omega: list[str]) -> list[str]:
    """List the missing wheel speeds if the log has a single one and no reference to compare it with."""
    return omega if len(omega) == len(WHEELS) - 1 and "v_x" not in have else []


def _steering(vehicle: Vehicle, have: set[str]) -> list[str]:
    """List what is missing to compare tie-rod forces, or else the steering torque, with their model."""
    rods = [f"tie_rod_{w}" for w in AXLES["f"]]
    front = [f"torque_{w}" for w in AXLES["f"] if w in vehicle.driven and f"torque_{w}" not in have]
    motion = [*(["a_y"] if "a_y" not in have else []), *(["yaw_rate"] if "yaw_rate" not in have else []), *front]
    if any(r in have for r in rods):
        model = [] if vehicle.tie_rod else ["vehicle.tie_rod (aqualog calibrate)"]
    elif "steering_torque" in have:
        model = [] if vehicle.steering_torque else ["vehicle.steering_torque (aqualog calibrate)"]
    else:
        model = rods
    return [*model, *motion]


def _not_given(vehicle: Vehicle, *keys: str) -> list[str]:
    return [f"vehicle.{k}" for k in keys if k not in vehicle.given]
