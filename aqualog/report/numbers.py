"""Numbers, intervals and units as a reader sees them."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

from aqualog.report.wording import pretty_unit

__all__ = ["interval_text", "measured", "ordinary", "percent", "quantity_text", "short"]

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_ORDINARY = {
    "−": "-", "…": "...", "→": "->", "·10": "e", "≈": "~", "≤": "<=", "≥": ">=", "–": "-",
}  # fmt: skip
_SMALL, _LARGE = 1e-3, 1e6  # beyond, a power of ten


def interval_text(p: Mapping[str, Any]) -> tuple[str, str]:
    """Value and `low … high` of an estimate, rounded to two digits of the interval's half width."""
    value, (low, high) = p["value"], p["ci95"]
    if value is None:
        return "", ""
    if low is None or high is None:
        return short(value), "not available"
    half = 0.5 * abs(high - low)
    return _rounded(value, half, value), f"{_rounded(low, half, value)} … {_rounded(high, half, value)}"


def measured(x: float | None, unit: str) -> str:
    """A size with two significant digits and its unit."""
    if x is None:
        return "–"
    return f"{short(x, 2)} {pretty_unit(unit)}".rstrip(" –")


def quantity_text(x: float, unit: str) -> str:
    """As `measured`, in the spelling of the contract (`14 kg`, `0.02 m/s^2`); empty for NaN and infinities."""
    if not math.isfinite(x):
        return ""
    return f"{ordinary(short(x, 2))} {unit}".removesuffix(" -")


def percent(share: float | None) -> str:
    """A share in per cent; one decimal near the ends."""
    if share is None:
        return "–"
    is_near_end = 0.9 < share < 0.9995 or 0.0 < share < 0.1
    text = f"{100.0 * share:.1f}" if is_near_end else f"{100.0 * share:.0f}"
    return f"{text.removesuffix('.0')} %"


def ordinary(text: str) -> str:
    """Text for a terminal: plain dashes, arrows and powers of ten. `²`, `³`, `·` and `±` stay."""
    raised = {ord(s): p for s, p in zip("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789", strict=True)}
    # powers of ten first: their 2 and 3 are not squares and cubes of a unit
    text = re.sub("·10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", lambda power: "e" + power[1].translate(raised), text)
    for sign, plain in _ORDINARY.items():
        text = text.replace(sign, plain)
    return text.translate({s: p for s, p in raised.items() if chr(s) not in "²³"})


def short(x: float | None, digits: int = 3) -> str:
    """Significant digits without a needless power of ten."""
    if x is None:
        return "–"
    if x == 0.0:
        return "0"
    # of the rounded number: 0.00099999 is 0.001
    power = math.floor(math.log10(abs(float(f"{x:.{digits - 1}e}"))))
    decimals = max(0, digits - 1 - power)
    if not _SMALL <= abs(x) < _LARGE:
        return _signed(f"{x / 10.0**power:.{digits - 1}f}") + f"·10{str(power).translate(_SUPERSCRIPT)}"
    # digits before the point are all shown, except for limits
    rounded = float(f"{x:.{digits - 1}e}") if digits < 3 else x
    text = f"{rounded:.{decimals}f}"
    return _signed(text.rstrip("0").rstrip(".") if "." in text else text)


def _rounded(x: float, half: float, scale: float) -> str:
    """`x` with two digits of `half`; a power of ten where `scale` is small or large."""
    if not half > 0.0:
        return short(x)
    last = math.floor(math.log10(half)) - 1  # power of the last digit shown
    largest = max(abs(scale), half)
    if _SMALL <= largest < _LARGE:
        return _signed(f"{x:.{max(0, -last)}f}")
    power = math.floor(math.log10(largest))
    return _signed(f"{x / 10.0**power:.{max(0, power - last)}f}") + f"·10{str(power).translate(_SUPERSCRIPT)}"


def _signed(text: str) -> str:
    return text.replace("-", "−")
