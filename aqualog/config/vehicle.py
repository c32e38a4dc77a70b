"""Vehicle files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from aqualog.config.toml_file import TableFaults, is_real, load_toml
from aqualog.core.vehicle import COEFFICIENTS, KEYS, POLYNOMIALS, SPREAD, Vehicle

__all__ = ["load_vehicle"]

MOST_POWERS = 5  # of a polynomial; calibration fits fewer
LARGEST_TERM = 1e4  # [N], [N*m] constant and spread: as much as the whole force of a tie rod (K)
LARGEST_GAIN = 100.0  # [-], [m] of the first power; a rod bears a tenth to a half of the tyre's force (K)
TYPICAL_FORCE = 1000.0  # [N] at which a higher power may give as much as the first (D)

_SPLIT = {"rwd": 1.0, "fwd": 0.0, "awd": 0.5}


def load_vehicle(path: Path) -> Vehicle:
    """Read and check a vehicle file.

    A key that is left out takes its default (see `aqualog.core.vehicle.KEYS`); unknown keys are errors.

    Raises
    ------
    ConfigError
        With all faults of the file in one message.
    """
    document, text = load_toml(path, what="vehicle file")
    faults = TableFaults(path, text)
    values: dict[str, Any] = {"name": str(document.pop("name", path.stem))}
    if isinstance(values.get("name"), str) and not values["name"].isprintable():
        faults.add("name", f"name = {values['name']!r:.60} is not one line of printable characters")
    given = {"name", *(n for n in ("drivetrain",) if n in document)}
    drivetrain = document.pop("drivetrain", "rwd")
    if not isinstance(drivetrain, str) or drivetrain not in _SPLIT:
        faults.add("drivetrain", f'drivetrain = {drivetrain!r} is not one of "rwd", "fwd", "awd"')
        drivetrain = "rwd"
    values["drivetrain"] = drivetrain
    values["torque_split_rear"] = _SPLIT[drivetrain]
    for section in POLYNOMIALS:
        with faults.inside(section):
            values[section] = _polynomial(document.pop(section, {}), section, faults)
    with faults.inside("spread"):
        values["spread"] = _spread(document.pop("spread", {}), faults)
    for section, table in _sections(document, faults).items():
        with faults.inside(section):
            _numbers(table, section, faults, values, given)
    faults.raise_if_any()
    # a loaded radius that is not given follows the effective one, so that a truck does not get a car's
    for axle in ("f", "r"):
        if f"wheels.r_e_{axle}" in given and f"wheels.r_l_{axle}" not in given:
            values[f"r_l_{axle}"] = 0.975 * values[f"r_e_{axle}"]
    return Vehicle(**values, given=frozenset(given))


def _sections(document: dict[str, Any], faults: TableFaults) -> dict[str, dict[str, Any]]:
    sections = {s for s in (k.section for k in KEYS.values()) if s}
    found: dict[str, dict[str, Any]] = {"": {}}
    for name, value in document.items():
        if name in sections and isinstance(value, dict):
            found[name] = value
        elif isinstance(value, dict):
            faults.unknown(name, [*sections, *POLYNOMIALS, "spread"])
        else:
            found[""][name] = value
    return found


def _numbers(table: dict[str, Any], section: str, faults: TableFaults, values: dict[str, Any], given: set[str]) -> None:
    """Read plain keys of a table into `values`, their paths into `given`."""
    known = [k.name for k in KEYS.values() if k.section == section]
    for name in table:
        if name in known:
            key = KEYS[f"{section}.{name}" if section else name]
            number = faults.number(table, name, low=key.low, high=key.high, unit=key.unit)
            if number is not None:
                values[name] = number
                given.add(key.path)
        elif section and (name in POLYNOMIALS or name in KEYS):
            own = f"expected [{name}], a table of its own" if name in POLYNOMIALS else "expected above all tables"
            faults.add(name, f"{name} stands in [{section}]; {own}")
        else:
            faults.unknown(name, known)


def _spread(table: Any, faults: TableFaults) -> dict[str, float]:
    """Read standard deviations from drive to drive by key, each at most as large as its key may be."""
    result: dict[str, float] = {}
    if not isinstance(table, dict):
        faults.add("spread", "spread is not a table; write [spread]")
        return result
    for name in table:
        if name not in SPREAD:
            faults.unknown(name, SPREAD)
            continue
        number = faults.number(table, name, low=0.0, high=KEYS[name].high, unit=KEYS[name].unit)
        if number is not None:
            result[name] = number
    return result


def _polynomial(table: Any, section: str, faults: TableFaults) -> dict[str, tuple[float, ...]]:
    """Read `F = c0 + c_y F_y + c_x F_x`, higher powers as lists."""
    result: dict[str, tuple[float, ...]] = {}
    if not isinstance(table, dict):
        faults.add(section, f"{section} is not a table; write [{section}]")
        return result
    for name, value in table.items():
        if name not in COEFFICIENTS:
            faults.unknown(name, COEFFICIENTS)
            continue
        numbers = value if isinstance(value, list) else [value]
        wrong = _wrong(name, numbers)
        if wrong:
            faults.add(name, f"[{section}] {name} = {str(value)[:60]} {wrong}")
        else:
            result[name] = tuple(float(n) for n in numbers)
    return result


def _wrong(name: str, numbers: list[Any]) -> str:
    """Say what is wrong with the numbers of a coefficient; empty if they are valid."""
    if not numbers or not all(is_real(n) for n in numbers):
        return "is not a number or a list of numbers"
    most = 1 if name in ("c0", "sigma") else MOST_POWERS
    if len(numbers) > most:
        return f"has {len(numbers)} values; expected {'one' if most == 1 else f'at most {most} powers'}"
    if name == "sigma":
        return "" if 0.0 < numbers[0] <= LARGEST_TERM else f"is outside 0 ... {LARGEST_TERM:g}, 0 excluded"
    for power, n in enumerate(numbers, 0 if name == "c0" else 1):
        bound = LARGEST_TERM if power == 0 else LARGEST_GAIN / TYPICAL_FORCE ** (power - 1)
        if not abs(n) <= bound:
            return f"is outside -{bound:g} ... {bound:g}" + (f" in power {power}" if power > 1 else "")
    return ""
