"""Vehicle files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from aqualog.config.toml_file import Faults, is_number, load_toml
from aqualog.vehicle import COEFFICIENTS, KEYS, POLYNOMIALS, Vehicle

__all__ = ["load_vehicle"]

_SPLIT = {"rwd": 1.0, "fwd": 0.0, "awd": 0.5}


def load_vehicle(path: Path) -> Vehicle:
    """Read and check a vehicle file.

    A key that is left out takes its default (see `aqualog.vehicle.KEYS`); unknown keys are errors.

    Raises
    ------
    ConfigError
        With all faults of the file in one message.
    """
    document, text = load_toml(path, what="vehicle file")
    faults = Faults(path, text)
    values: dict[str, Any] = {"name": str(document.pop("name", path.stem))}
    if isinstance(values.get("name"), str) and not values["name"].isprintable():
        faults.add("name", f"name = {values['name']!r:.60} is not one line of printable characters")
    drivetrain = document.pop("drivetrain", "rwd")
    given = {"name"}
    if not isinstance(drivetrain, str) or drivetrain not in _SPLIT:
        faults.add("drivetrain", f'drivetrain = {drivetrain!r} is not one of "rwd", "fwd", "awd"')
        drivetrain = "rwd"
    values["drivetrain"] = drivetrain
    values["torque_split_rear"] = _SPLIT[drivetrain]
    for section in POLYNOMIALS:
        values[section] = _polynomial(document.pop(section, {}), section, faults)
    for section, table in _sections(document, faults).items():
        known = [k.name for k in KEYS.values() if k.section == section]
        for name in table:
            if name not in known:
                faults.unknown(name, known)
                continue
            key = KEYS[f"{section}.{name}" if section else name]
            number = faults.number(table, name, low=key.low, high=key.high, unit=key.unit)
            if number is not None:
                values[name] = number
                given.add(key.path)
    faults.raise_if_any()
    # a loaded radius that is not given follows the effective one, so that a truck does not get a car's
    for axle in ("f", "r"):
        if f"wheels.r_e_{axle}" in given and f"wheels.r_l_{axle}" not in given:
            values[f"r_l_{axle}"] = 0.975 * values[f"r_e_{axle}"]
    return Vehicle(**values, given=frozenset(given))


def _sections(document: dict[str, Any], faults: Faults) -> dict[str, dict[str, Any]]:
    sections = {s for s in (k.section for k in KEYS.values()) if s}
    found: dict[str, dict[str, Any]] = {"": {}}
    for name, value in document.items():
        if name in sections and isinstance(value, dict):
            found[name] = value
        elif isinstance(value, dict):
            faults.unknown(name, [*sections, *POLYNOMIALS])
        else:
            found[""][name] = value
    return found


def _polynomial(table: Any, section: str, faults: Faults) -> dict[str, tuple[float, ...]]:
    """`F = c0 + c_y F_y + c_x F_x`, higher powers as lists."""
    result: dict[str, tuple[float, ...]] = {}
    if not isinstance(table, dict):
        faults.add(section, f"{section} is not a table")
        return result
    for name, value in table.items():
        if name not in COEFFICIENTS:
            faults.unknown(name, COEFFICIENTS)
            continue
        numbers = value if isinstance(value, list) else [value]
        if not numbers or not all(is_number(n) for n in numbers):
            faults.add(name, f"{name} = {value!r} is not a number or a list of numbers")
            continue
        if name == "sigma" and not all(n > 0 for n in numbers):
            faults.add(name, f"{name} = {value!r} is not above 0")
            continue
        result[name] = tuple(float(n) for n in numbers)
    return result
