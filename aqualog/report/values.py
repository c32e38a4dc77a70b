"""Words of values: numbers, intervals, units and names as a reader sees them, and values as JSON holds them."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from aqualog.core.units import displayed_unit, displayed_units

__all__ = [
    "CELL", "KMH", "LONGEST_WORD", "NOTE", "counted", "cut", "ends", "fields_of", "interval_text", "measured",
    "name_digest", "number", "ordinary", "percent", "place", "plain", "plot_text", "pretty_unit", "quantity_text",
    "readable", "short", "upper_first",
]  # fmt: skip

KMH = 3.6  # [km/h per m/s]
LONGEST = 90  # characters of a name that are shown
CELL = 200  # of a cell in a terminal
NOTE = 1000  # of a sentence that names what a log holds
LONGEST_WORD = 200  # characters without a space that a page shows
LONGEST_TEXT = 4000  # characters in one place of a page
# characters that a terminal or a browser acts on instead of showing: controls and marks of writing direction
_OBEYED = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")
_LONG_WORD = re.compile(rf"\S{{{LONGEST_WORD + 1},}}")
_RAISED = "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"
_SUPERSCRIPT = str.maketrans("-0123456789", _RAISED)
_LOWERED = str.maketrans(_RAISED, "-0123456789")
_ORDINARY = {
    "−": "-", "…": "...", "→": "->", "·10": "e", "≈": "~", "≤": "<=", "≥": ">=", "–": "-",
}  # fmt: skip
_SMALL, _LARGE = 1e-3, 1e6  # beyond, a power of ten


# --- numbers ---------------------------------------------------------------------------------------------------------


def number(x: float, decimals: int | None = None) -> str:
    """A number for a table: fixed decimals, or three significant digits; a dash for NaN and infinities."""
    if not math.isfinite(x):
        return "–"
    if decimals is None and 999.5 <= abs(x) < 1e6:
        decimals = 0
    text = f"{x:.{decimals}f}" if decimals is not None else f"{x:.3g}"
    return text.replace("-", "−") if "e" not in text else text


def short(x: float | None, digits: int = 3) -> str:
    """Significant digits without a needless power of ten."""
    if x is None:
        return "–"
    if x == 0.0:
        return "0"
    # of the rounded number: 0.00099999 is 0.001
    power = math.floor(math.log10(abs(float(f"{x:.{digits - 1}e}"))))
    if not _SMALL <= abs(x) < _LARGE:
        return _scaled(x, power, digits - 1)
    # digits before the point are all shown, except for limits
    rounded = float(f"{x:.{digits - 1}e}") if digits < 3 else x
    text = f"{rounded:.{max(0, digits - 1 - power)}f}".replace("-", "−")
    return text.rstrip("0").rstrip(".") if "." in text else text


def _scaled(x: float, power: int, decimals: int) -> str:
    return f"{x / 10.0**power:.{decimals}f}".replace("-", "−") + f"·10{str(power).translate(_SUPERSCRIPT)}"


def interval_text(p: Mapping[str, Any]) -> tuple[str, str]:
    """Value and `low … high` of an estimate, rounded to two digits of the interval's half width."""
    value, (low, high) = p["value"], p["ci95"]
    if value is None:
        return "", ""
    if low is None or high is None:
        return short(value), "not available"
    half = 0.5 * abs(high - low)
    return _rounded(value, half, value), f"{_rounded(low, half, value)} … {_rounded(high, half, value)}"


def _rounded(x: float, half: float, scale: float) -> str:
    """`x` with two digits of `half`; a power of ten where `scale` is small or large."""
    if not half > 0.0:
        return short(x)
    last = math.floor(math.log10(half)) - 1  # power of the last digit shown
    largest = max(abs(scale), half)
    if _SMALL <= largest < _LARGE:
        return f"{x:.{max(0, -last)}f}".replace("-", "−")
    power = math.floor(math.log10(largest))
    return _scaled(x, power, max(0, power - last))


def ends(ci: tuple[float, float], decimals: int = 1) -> str:
    """`29.7 ... 37.0`, `open` for an end that is not finite; a dash where both are not."""
    if not any(math.isfinite(x) for x in ci):
        return "-"
    return " ... ".join(f"{x:.{decimals}f}" if math.isfinite(x) else "open" for x in ci)


def measured(x: float | None, unit: str) -> str:
    """A size with two significant digits and its unit."""
    return "–" if x is None else f"{short(x, 2)} {pretty_unit(unit)}".rstrip(" –")


def quantity_text(x: float, unit: str) -> str:
    """As `measured`, in the spelling of the contract (`14 kg`, `0.02 m/s^2`); empty for NaN and infinities."""
    return f"{ordinary(short(x, 2))} {unit}".removesuffix(" -") if math.isfinite(x) else ""


def percent(share: float | None) -> str:
    """A share in per cent; one decimal near the ends."""
    if share is None:
        return "–"
    is_near_end = 0.9 < share < 0.9995 or 0.0 < share < 0.1
    text = f"{100.0 * share:.1f}" if is_near_end else f"{100.0 * share:.0f}"
    return f"{text.removesuffix('.0')} %"


def counted(n: int, what: str) -> str:
    """`1 run`, `2 runs`."""
    return f"{n} {what}{'' if n == 1 else 's'}"


# --- texts -----------------------------------------------------------------------------------------------------------


def ordinary(text: str) -> str:
    """Text for a terminal: plain dashes, arrows and powers of ten. `²`, `³`, `·` and `±` stay."""
    # powers of ten first: their 2 and 3 are not squares and cubes of a unit
    text = re.sub(f"·10([{_RAISED}]+)", lambda power: "e" + power[1].translate(_LOWERED), text)
    for sign, plain_sign in _ORDINARY.items():
        text = text.replace(sign, plain_sign)
    return text.translate({s: p for s, p in _LOWERED.items() if chr(s) not in "²³"})


def place(wheel: str | None, side: str | None) -> str:
    """`FR`, or the side, or an empty string."""
    return wheel.upper() if wheel else (side or "")


def pretty_unit(unit: str) -> str:
    """Unit as pages and text show it."""
    return readable(displayed_unit(unit), LONGEST_WORD)


def upper_first(text: str) -> str:
    """The text with a capital at its beginning."""
    return text[:1].upper() + text[1:]


def readable(text: str, most: int = LONGEST_TEXT) -> str:
    """Text as a page can show it: shortened with a mark that says how long it was, without control characters."""
    if len(text) > most:
        text = f"{text[: most - 40]}… ({len(text)} characters)"
    if len(text) > LONGEST_WORD:
        text = _LONG_WORD.sub(lambda word: f"{word[0][: LONGEST_WORD - 20]}… ({len(word[0])} characters)", text)
    text = displayed_units(text)
    return text if text.isprintable() else _OBEYED.sub("\ufffd", text)


def plot_text(text: str, most: int = 80) -> str:
    """Text for plotly, which reads `<b>`, entities and `%{...}` as markup: those characters become look-alikes.

    Longer text than `most` characters is cut: plotly does not wrap.
    """
    text = readable(text if len(text) <= most else f"{text[: most - 1]}…")
    return text.replace("&", "＆").replace("<", "‹").replace(">", "›").replace("%{", "％{").replace("$", "＄")


def cut(text: str, most: int = LONGEST) -> str:
    """One line of at most so many characters; what is cut gets a hash, so that two long names stay two."""
    line = "".join(c if c.isprintable() else "\ufffd" for c in text[:most])
    return line if len(text) <= most else f"{line[: most - 12]}… #{name_digest(text)[:8]}"


def name_digest(text: str) -> str:
    """A digest that distinguishes two names whose shown parts are equal."""
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()


# --- JSON ------------------------------------------------------------------------------------------------------------


def plain(value: Any, digits: int | None = 9) -> Any:
    """A value for JSON: NaN and infinities become null, floats keep so many significant digits (None: all)."""
    if isinstance(value, float):
        if not math.isfinite(value):
            return None
        return float(value) if digits is None else float(f"{value:.{digits}g}")
    if isinstance(value, np.ndarray):
        return plain(value.tolist(), digits)
    if isinstance(value, list | tuple):
        return [plain(v, digits) for v in value]
    if isinstance(value, Mapping):
        return {k: plain(v, digits) for k, v in value.items()}
    return value


def fields_of(record: Any, *names: str, digits: int | None = 9, **renamed: str) -> dict[str, Any]:
    """Fields of a record for JSON, in this order; `renamed` are those that the document calls otherwise."""
    both = {**{name: name for name in names}, **renamed}
    return {key: plain(getattr(record, name), digits) for key, name in both.items()}
