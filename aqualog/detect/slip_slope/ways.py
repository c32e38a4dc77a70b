"""Choose the method for the slip slope that a drive allows: the sources of slip and traction."""

from __future__ import annotations

from collections.abc import Collection
from typing import Literal, NamedTuple

from aqualog.core.errors import ConfigError, SignalError
from aqualog.core.notation import WHEELS
from aqualog.core.vehicle import Vehicle

__all__ = ["METHODS", "TRACTIONS", "Method", "TractionSource", "Way", "choose_way"]

Method = Literal["axle", "velocity", "differential"]
TractionSource = Literal["torque", "accelerometer"]
METHODS = ("auto", "axle", "velocity", "differential")
TRACTIONS = ("auto", "torque", "accelerometer")

_MAP_HINT = "`aqualog inspect LOG --write-map map.toml`, then the log with this signal map"


class Way(NamedTuple):
    """Sources of slip and traction; `notes` are sentences on substitutes that were used."""

    method: Method
    traction: TractionSource
    notes: tuple[str, ...] = ()


def choose_way(
    vehicle: Vehicle, available: Collection[str], *, method: str = "auto", traction: str = "auto", where: str = ""
) -> Way:
    """Choose the method, or check the one asked for.

    Parameters
    ----------
    vehicle : Vehicle
    available : collection of str
        Symbols of the drive.
    method : str
        `axle`: driven against free wheel of the same side; `velocity`: against v_x, thesis (3.13); `differential`: both
        axles driven, recursive estimate only; `auto`.
    traction : str
        `torque`, `accelerometer` (one driven axle) or `auto`.
    where : str
        For the message.

    Raises
    ------
    ConfigError
        If the method does not exist for this car.
    SignalError
        If signals are missing.
    """
    have = set(available)
    if method not in METHODS:
        raise ConfigError(f'method "{method}"', expected=", ".join(METHODS))
    if traction not in TRACTIONS:
        raise ConfigError(f'traction "{traction}"', expected=", ".join(TRACTIONS))
    chosen = _method(vehicle, have, method, where)
    source, notes = _traction(vehicle, have, traction, where)
    return Way(chosen, source, notes)


def _method(vehicle: Vehicle, have: set[str], method: str, where: str) -> Method:
    is_awd = vehicle.drivetrain == "awd"
    if method == "axle" and is_awd:
        raise ConfigError(
            f"--method axle: {vehicle.name} drives all wheels, none rolls freely", expected="velocity or differential"
        )
    chosen: Method = "axle"
    if method == "velocity" or (method == "auto" and is_awd and "v_x" in have):
        chosen = "velocity"
    elif method == "differential" or is_awd:
        chosen = "differential"
    wheels = vehicle.driven if chosen == "velocity" else WHEELS
    omega = [f"omega_{w}" for w in wheels if f"omega_{w}" not in have]
    if omega:
        raise SignalError(
            f"no slip without wheel speeds: missing {', '.join(omega)}", where=where,
            expected=f"the speeds of {'the driven' if chosen == 'velocity' else 'all four'} wheels", hint=_MAP_HINT,
        )  # fmt: skip
    if chosen == "velocity" and "v_x" not in have:
        raise SignalError(
            "no reference velocity: missing v_x", where=where, expected="v_x from GNSS or an optical sensor",
            hint="--method axle" if not is_awd else "--method differential",
        )  # fmt: skip
    return chosen


def _traction(vehicle: Vehicle, have: set[str], traction: str, where: str) -> tuple[TractionSource, tuple[str, ...]]:
    is_awd = vehicle.drivetrain == "awd"
    torque = [f"torque_{w}" for w in vehicle.driven if f"torque_{w}" not in have]
    if traction == "accelerometer" and is_awd:
        raise ConfigError(
            "--traction accelerometer: it does not show how much of the force each driven axle has",
            expected="torque",
        )
    if traction == "torque" or (traction == "auto" and (not torque or is_awd)):
        if torque:
            why = "; with all wheels driven an accelerometer cannot replace them" if is_awd else ""
            raise SignalError(
                f"no traction: missing {', '.join(torque)}{why}", where=where, expected="wheel or axle torques",
                hint=_MAP_HINT if is_awd or "a_x" not in have else "--traction accelerometer",
            )  # fmt: skip
        return "torque", ()
    if "a_x" not in have:
        raise SignalError(
            f"no traction: missing {', '.join(torque)}, and a_x in their place", where=where,
            expected="wheel torques or an accelerometer", hint=_MAP_HINT,
        )  # fmt: skip
    if traction == "accelerometer":
        return "accelerometer", ()
    return "accelerometer", (f"no wheel torque ({', '.join(torque)}): the traction is that of the accelerometer",)
