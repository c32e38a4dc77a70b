"""Interpret one cell of a CSV file: nothing, a number, a bad sample, a time stamp or text."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from aqualog.core.records import BoolArray, FloatArray

__all__ = ["STYLES", "Numbers", "Style", "is_bad", "is_clock", "is_date", "is_number", "is_stamp", "numbers", "plain"]

# What spreadsheets, C run-times and loggers write for a sample that is not valid.
_BAD = frozenset((
    "-", "--", "---", "null", "none", "nil", "na", "n/a", "#n/a", "#na", "#nv", "#num!", "#zahl!", "#div/0!", "#value!",
    "#wert!", "#ref!", "#bezug!", "invalid", "1.#qnan", "-1.#qnan", "1.#inf", "-1.#inf", "1.#ind", "-1.#ind",
    "nan(ind)", "-nan(ind)", "nan", "+nan", "-nan", "inf", "+inf", "-inf", "infinity", "+infinity", "-infinity",
))  # fmt: skip
_TRUTH = {"true": 1.0, "false": 0.0}


@dataclass(frozen=True, slots=True)
class Style:
    """How numbers are written: the decimal sign, and the sign between thousands if there is one."""

    decimal: str
    thousands: str = ""


# In the order of preference: a style is taken only if it explains more columns than those before it.
STYLES = (Style("."), Style(","), Style(",", "."), Style(".", ","))
_TAIL = r"(?:[eE][+-]?\d+)?"
_GROUPED: Mapping[Style, str] = {
    STYLES[2]: rf"^[+-]?\d{{1,3}}(?:\.\d{{3}})+(?:,\d*)?{_TAIL}$",
    STYLES[3]: rf"^[+-]?\d{{1,3}}(?:,\d{{3}})+(?:\.\d*)?{_TAIL}$",
}
_PLAIN = {
    ".": re.compile(rf"[+-]?(?:\d+\.?\d*|\.\d+){_TAIL}", re.ASCII),
    ",": re.compile(rf"[+-]?(?:\d+,?\d*|,\d+){_TAIL}", re.ASCII),
}
_DATE = re.compile(r"\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[./-]\d{1,2}[./-]\d{4}", re.ASCII)
_CLOCK = re.compile(r"\d{1,2}:\d{2}(?::\d{2}(?:[.,:]\d+)?)?", re.ASCII)
_STAMP = re.compile(rf"(?:{_DATE.pattern})[T _]+(?:{_CLOCK.pattern})\s*(?:Z|UTC|GMT|[+-]\d{{2}}:?\d{{2}})?", re.ASCII)


def is_bad(cell: str) -> bool:
    """Whether a cell stands for a sample that is not valid."""
    return cell.lower() in _BAD


def is_date(cell: str) -> bool:
    """Whether a cell is a day without a time."""
    return _DATE.fullmatch(cell) is not None


def is_clock(cell: str) -> bool:
    """Whether a cell is a time of day."""
    return _CLOCK.fullmatch(cell) is not None


def is_stamp(cell: str) -> bool:
    """Whether a cell is a day with a time."""
    return _STAMP.fullmatch(cell) is not None


def is_number(cell: str, style: Style) -> bool:
    """Whether a cell is a number in this style, or true or false."""
    if _PLAIN[style.decimal].fullmatch(cell) or cell.lower() in _TRUTH:
        return True
    return bool(style.thousands) and re.match(_GROUPED[style], cell) is not None


@dataclass(frozen=True, slots=True)
class Numbers:
    """Cells of a column as numbers, all of shape (n,): NaN in `values` where `blank`, bad or `unreadable`."""

    values: FloatArray
    blank: BoolArray
    unreadable: BoolArray


def numbers(cells: pl.Series, style: Style) -> Numbers:
    """Convert the cells of one column, which are text or read as numbers already; a cell is never guessed at."""
    if cells.dtype == pl.Float64:
        values: FloatArray = cells.to_numpy()  # the library's own memory, where no cell is blank
        finite = np.isfinite(values)
        if not finite.all():
            values = np.where(finite, values, np.nan)
        return Numbers(values, cells.is_null().to_numpy().copy(), np.zeros(len(cells), dtype=np.bool_))
    found = plain(cells, style).cast(pl.Float64, strict=False)
    values = found.to_numpy().astype(np.float64)
    blank = cells.is_null().to_numpy().copy()
    unreadable = np.zeros(len(cells), dtype=np.bool_)
    left: NDArray[np.int64] = (found.is_null() & cells.is_not_null()).arg_true().to_numpy().astype(np.int64)
    if left.size:
        _second_look(cells.gather(left), left, style, Numbers(values, blank, unreadable))
    values[~np.isfinite(values)] = np.nan
    return Numbers(values, blank, unreadable)


def _second_look(cells: pl.Series, rows: NDArray[np.int64], style: Style, into: Numbers) -> None:
    """Cells that are not simply numbers: with blanks around them, true and false, signs of a bad sample, text."""
    unique = cells.unique()
    stripped = unique.str.strip_chars()
    cast = plain(stripped, style).cast(pl.Float64, strict=False)
    meaning = {cell: _meaning(s, v) for cell, s, v in zip(unique, stripped, cast, strict=True)}
    kinds = [meaning[c] for c in cells]
    into.values[rows] = [v for v, _ in kinds]
    into.blank[rows] = [k == "blank" for _, k in kinds]
    into.unreadable[rows] = [k == "text" for _, k in kinds]


def _meaning(cell: str, value: float | None) -> tuple[float, str]:
    if not cell:
        return np.nan, "blank"
    if value is not None:
        return value, "number"
    if cell.lower() in _TRUTH:
        return _TRUTH[cell.lower()], "number"
    return np.nan, "bad" if is_bad(cell) else "text"


def plain(cells: pl.Series, style: Style) -> pl.Series:
    """Numbers rewritten with a decimal point and nothing between thousands; null where the style forbids the cell.

    The library's own decimal comma also takes a point as decimal sign, so `1.234` would be read both ways.
    """
    if style == STYLES[0]:
        return cells
    x = pl.col("x")
    result = x.str.replace(",", ".", literal=True) if style.decimal == "," else x
    foreign = "." if style.decimal == "," else ","
    grouped = pl.lit(None, dtype=pl.String)
    if style.thousands:
        joined = x.str.replace_all(style.thousands, "", literal=True).str.replace(",", ".", literal=True)
        grouped = pl.when(x.str.contains(_GROUPED[style])).then(joined)
    choice = pl.when(x.str.contains(foreign, literal=True)).then(grouped).otherwise(result)
    return cells.alias("x").to_frame().select(choice.alias("x"))["x"]
