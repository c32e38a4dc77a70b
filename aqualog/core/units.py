"""Unit spellings of the field, as a closed table.

A spelling that is not in the table is an error with a suggestion, never a guess: general units libraries read
`Nm` as number*metre and `U/min` as enzyme units per minute.
"""

from __future__ import annotations

import difflib
import math
import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aqualog.core.errors import SignalError

__all__ = [
    "Unit", "convert", "displayed_text", "displayed_unit", "displayed_units", "is_unit", "parse_unit", "spellings",
]  # fmt: skip


@dataclass(frozen=True, slots=True)
class Unit:
    """SI value = factor * value + offset, within one dimension."""

    dimension: str
    factor: float
    offset: float = 0.0


_G = 9.80665
_TABLE: dict[str, tuple[Unit, str]] = {}


def _add(dimension: str, factor: float, spellings: str, offset: float = 0.0) -> None:
    for spelling in spellings.split():
        _TABLE[spelling] = (Unit(dimension, factor, offset), spelling)


_add("speed", 1.0, "m/s mps m/sec m*s^-1 m*s-1 m.s-1 m·s⁻¹ meter/s metre/s")
_add("speed", 1.0 / 3.6, "km/h kph kmh kmph km/hr KPH Km/h KM/H km*h^-1")
_add("speed", 0.44704, "mph MPH mi/h")
_add("speed", 1852.0 / 3600.0, "kn kt knot knots")
_add("speed", 0.3048, "ft/s fps")
_add("speed", 0.01, "cm/s")
_add("speed", 0.001, "mm/s")
_add("acceleration", 1.0, "m/s^2 m/s2 m/s² m/s/s m/(s^2) m/s**2 mps2 m*s^-2 m*s-2 m.s-2 m·s⁻²")
_add("acceleration", _G, "g G g0 g_n gn")
_add("acceleration", _G / 1000.0, "mg")
_add("acceleration", 1.0 / 3.6, "km/h/s")
_add("angular_speed", 1.0, "rad/s 1/s rad/sec rad*s^-1 rad*s-1 rad.s-1 rad·s⁻¹")
_add("angular_speed", math.pi / 180.0, "deg/s deg/sec °/s dps Grad/s grad/s º/s deg*s^-1 \xb0/sec")
_add("angular_speed", 2.0 * math.pi / 60.0, "rpm 1/min U/min RPM r/min rev/min min^-1 min-1 /min")
_add("angular_speed", 2.0 * math.pi, "rev/s Hz U/s")
_add("angle", 1.0, "rad radian radians Rad")
_add("angle", math.pi / 180.0, "deg ° º degree degrees Grad Deg DEG")
_add("angle", math.pi / 180000.0, "mdeg")
_add("angle", 0.001, "mrad")
_add("torque", 1.0, "N*m Nm N.m N·m N-m N_m NM N⋅m Newton*m")
_add("torque", 1000.0, "kNm kN*m kN·m")
_add("torque", 1.3558179483314004, "lbft lb*ft lb-ft ft*lb ft-lb ftlb lbf*ft")
_add("force", 1.0, "N newton Newton")
_add("force", 1000.0, "kN")
_add("force", 10.0, "daN")
_add("length", 1.0, "m meter metre meters metres")
_add("length", 0.001, "mm")
_add("length", 0.01, "cm")
_add("length", 1000.0, "km")
_add("length", 0.0254, "in inch")
_add("length", 0.3048, "ft")
_add("pressure", 1.0, "Pa pascal Pascal")
_add("pressure", 100.0, "hPa mbar")
_add("pressure", 1e3, "kPa KPa kpa")
_add("pressure", 1e5, "bar Bar BAR")
_add("pressure", 1e6, "MPa")
_add("pressure", 6894.757293168361, "psi PSI")
_add("temperature", 1.0, "K Kelvin kelvin")
_add("temperature", 1.0, "degC °C C ºC deg_C Celsius celsius", 273.15)
_add("temperature", 5.0 / 9.0, "degF °F F", 273.15 - 32.0 * 5.0 / 9.0)
_add("time", 1.0, "s sec secs second seconds S")
_add("time", 1e-3, "ms msec millisecond milliseconds")
_add("time", 1e-6, "us µs μs usec")
_add("time", 1e-9, "ns nsec")
_add("time", 60.0, "min")
_add("time", 3600.0, "h hr")
_add("ratio", 1.0, "- 1 none None unitless bool Bool boolean enum n/a N/A")
_add("ratio", 0.01, "% percent Percent pct")


def is_unit(text: str) -> bool:
    """Whether a spelling is in the table."""
    return text.strip() in _TABLE


def spellings() -> list[tuple[Unit, list[str]]]:
    """Every unit with all of its spellings."""
    found: dict[Unit, list[str]] = {}
    for spelling, (unit, _) in _TABLE.items():
        found.setdefault(unit, []).append(spelling)
    return list(found.items())


def parse_unit(text: str, *, where: str = "") -> Unit:
    """Look a spelling up.

    Raises
    ------
    SignalError
        If the spelling is not in the table; the message names the nearest one.
    """
    found = _TABLE.get(text.strip())
    if found is not None:
        return found[0]
    near = difflib.get_close_matches(text.strip(), list(_TABLE), n=1, cutoff=0.5)
    hint = f'unit = "{near[0]}" in the signal map' if near else "give the unit in the signal map"
    expected = "a unit such as km/h, rad/s, g, N*m, bar"
    raise SignalError(f'unknown unit "{text.strip()}"', where=where, expected=expected, hint=hint)


def convert(values: NDArray[np.float64], source: str, target: str, *, where: str = "") -> NDArray[np.float64]:
    """Convert samples between two spellings of one dimension.

    Parameters
    ----------
    values : array
        Samples in `source`; not changed.
    source, target : str
        Unit spellings.
    where : str
        Named in an error.

    Raises
    ------
    SignalError
        If a spelling is unknown or the dimensions differ.
    """
    if source.strip() == target.strip():
        return values
    a, b = parse_unit(source, where=where), parse_unit(target, where=where)
    if a.dimension != b.dimension:
        raise SignalError(
            f'unit "{source}" is one of {a.dimension.replace("_", " ")}',
            where=where,
            expected=f'one of {b.dimension.replace("_", " ")} such as "{target}"',
            hint="correct the unit or the channel in the signal map",
        )
    return (values * (a.factor / b.factor)) + (a.offset - b.offset) / b.factor


_SHOWN = {"nats": "natural units", "-": "–", "degC": "°C"}
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def displayed_unit(unit: str) -> str:
    """A unit as pages and text output show it: `m/s^2` -> `m/s²`, `N*m` -> `N·m`, `-` -> `–`.

    For display only: JSON values and CSV headers keep the spelling of the contract.
    """
    if unit in _SHOWN:
        return _SHOWN[unit]
    return re.sub(r"\^(-?\d+)", lambda power: power[1].translate(_RAISED), unit).replace("*", "·")


_ATOM = r"(?:1|k?g|[km]?m|s|h|min|k?N|rad|deg|k?Pa|K|W|J)(?:\^-?\d)?"
_WORD = re.compile(rf"(?<![\w/*^.\\-])\(?{_ATOM}(?:[*/]{_ATOM})*(?:\)\^-?\d)?(?![\w/*^\\]|\.\w)")


def displayed_units(text: str) -> str:
    """A text in which each word that is a unit stands as `displayed_unit` shows it; paths and names stay."""
    if "^" not in text and "*" not in text:
        return text
    return _WORD.sub(lambda word: displayed_unit(word[0]), text)


def displayed_text(text: str) -> str:
    """A text with units as `displayed_unit` shows them: `m/s^2` -> `m/s²`, `N m` -> `N·m`, `+-` -> `±`.

    Raised numbers are replaced after a letter or a bracket only, and only where they are whole.
    """
    text = re.sub(r"(?<=[A-Za-z)])\^(-?\d)(?![\d.])", lambda power: power[1].translate(_RAISED), text)
    return re.sub(r"\bN[ *]m\b", "N·m", text).replace("+-", "±")
