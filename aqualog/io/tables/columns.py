"""Columns of a table: names and units, which one is the time, its stamps in nanoseconds; what CSV and Parquet share."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import polars as pl
from numpy.typing import NDArray

from aqualog.core.errors import ConfigError, LogError
from aqualog.core.records import BoolArray, TimeArray
from aqualog.core.units import is_unit, parse_unit
from aqualog.io.clock_drift import DriftWatch, drift_note
from aqualog.io.reader import OpenFile, ReadOptions

__all__ = [
    "FieldKind", "Stamps", "TableField", "TableReader", "TimeChoice", "choose_time", "from_dates", "from_numbers",
    "judged_unit", "no_unit_note", "split_unit", "text_to_ns", "unique_names",
]  # fmt: skip

# Loggers do write `max. SoC [%)`: either closing bracket ends the group.
_SQUARE = re.compile(r"^(?P<name>.*?)(?P<space>\s*)\[(?P<unit>[^\[\]()]*(?:\([^()]*\)[^\[\]()]*)?)[\])]$")
_ROUND = re.compile(r"^(?P<name>.*\S)(?P<space>\s*)[({](?P<unit>[^(){}]*)[)}]$")
_SLASH = re.compile(r"^(?P<name>.*\S)\s+(?:/|in)\s+(?P<unit>\S+)$")


def split_unit(header: str) -> tuple[str, str]:
    """Name and unit of a header cell: `v_x [km/h]` -> (`v_x`, `km/h`).

    A group in square brackets at the end is the unit, known or not, unless it is an index (`cell[3]`). A group in other
    brackets or behind a slash is one only if its spelling is known: `speed (filtered)` is a name.
    """
    text = " ".join(header.split())
    square = _SQUARE.match(text)
    if square and square["name"] and not (square["unit"].isdigit() and not square["space"]):
        return square["name"].strip(), square["unit"].strip()
    for pattern in (_ROUND, _SLASH):
        other = pattern.match(text)
        if other and is_unit(other["unit"]):
            return other["name"].strip(), other["unit"].strip()
    return text, ""


def unique_names(names: Sequence[str]) -> tuple[str, ...]:
    """The names, those that come again as `name#2`, `name#3`; a column without a name is `column_1`, counted from 1."""
    taken = set(names)
    numbers: dict[str, int] = {}
    result = []
    for position, name in enumerate(names, start=1):
        own = name or f"column_{position}"
        wanted = own
        if own in numbers:  # counted on from the last one of that name: a header may repeat one thousands of times
            number = numbers[own] + 1
            while f"{own}#{number}" in taken:
                number += 1
            numbers[own] = number
            wanted = f"{own}#{number}"
            taken.add(wanted)
        numbers.setdefault(wanted, 1)
        result.append(wanted)
    return tuple(result)


FieldKind = Literal["number", "stamp", "date", "clock", "text"]

# Preferred first: the logger's own clock is finer and steadier than the UTC that some write beside it.
_STEMS = (
    "t", "time", "timestamp", "timestamps", "time stamp", "zeit", "zeitstempel", "timebase", "elapsed time", "rel time",
    "log time", "date time", "datetime", "date/time", "%time", "t rel", "time rel", "gps time", "gpstime", "utc time",
    "utc", "uhrzeit", "time of day",
)  # fmt: skip
_SUFFIX = re.compile(r"^(?P<stem>.*?)[ _]?(?P<unit>seconds|secs|sec|s|ms|msec|us|µs|usec|ns|nsec|min)$")
_NAME = '[time] channel = "{}" in the map'
_HINT = _NAME.format("...")

_NS = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}
_DIGITS = {10**9: 9, 10**6: 6, 10**3: 3, 1: 0}
_EPOCH_S = (631_152_000.0, 4_102_444_800.0)  # 1990 to 2100
_PLAUSIBLE_STEP_S = (1e-6, 60.0)
_ABSURD_S = 5 * 3600.0
_LATEST_S = 9.2e9  # what int64 nanoseconds hold
_EXACT = 1e6  # seconds, up to which float64 resolves a nanosecond


@dataclass(frozen=True, slots=True)
class TableField:
    """A column as a candidate for the time."""

    name: str
    unit: str
    kind: FieldKind


@dataclass(frozen=True, slots=True)
class TimeChoice:
    """The time column, the column of the day beside it if there is one, and the unit, empty if not given.

    `other` is a second clock beside it, as a receiver's, with the unit `other_unit` if it is a number.
    """

    index: int
    day: int | None
    unit: str
    note: str = ""
    other: int | None = None
    other_unit: str = ""


@dataclass(frozen=True, slots=True)
class Stamps:
    """Time stamps (n,) [ns]; only those where `valid` mean anything."""

    t_ns: TimeArray
    valid: BoolArray
    absolute: bool
    notes: tuple[str, ...] = ()


def choose_time(fields: Sequence[TableField], options: ReadOptions, *, where: str) -> TimeChoice:
    """Find the time column.

    The user's `time_channel` comes first, then the names that loggers give it. A drive may have several tables of which
    only one has the user's column: in the others the usual names count, which is noted.

    Raises
    ------
    LogError
        If no column can be the time.
    ConfigError
        If the user's unit is not one of time.
    """
    note = ""
    found = _named(fields, options.time_channel) if options.time_channel else None
    if found is None:
        found = _usual(fields)
        if options.time_channel and found is not None:
            note = f'no time channel "{options.time_channel}"; "{fields[found].name}" is taken'
    if found is None:
        listed = ", ".join(f.name for f in fields[:20]) + (", ..." if len(fields) > 20 else "")
        asked = f' "{options.time_channel}"' if options.time_channel else ""
        text = next((f for f in fields if f.kind == "text" and _rank(f) is not None), None)
        if text is not None:
            what = f'column "{text.name}" is no time: too many of its cells are no numbers'
            hint = f"look for lines with another separator or decimal mark; {_NAME.format(text.name)} reads the others"
            raise LogError(what, where=where, expected="times as numbers or dates", hint=hint)
        among = f" among: {listed}" if listed else ": the table has no column"
        raise LogError(f"no time column{asked}{among}", where=where, expected="t [s] or time", hint=_HINT)
    unit = options.time_unit or _own_unit(fields[found])
    if options.time_unit and not (is_unit(unit) and parse_unit(unit).dimension == "time"):
        raise ConfigError(f'"{unit}" is no unit of time', where=where, expected="s, ms, us or ns", hint="[time] unit")
    day = next((k for k, f in enumerate(fields) if f.kind == "date" and k != found), None)
    other = _second_clock(fields, found)
    other_unit = "" if other is None else _own_unit(fields[other])
    return TimeChoice(found, day if fields[found].kind == "clock" else None, unit, note, other, other_unit)


def _second_clock(fields: Sequence[TableField], found: int) -> int | None:
    """The next usual column that is a date-time, or a number with a unit of time."""
    is_clock = [f.kind == "stamp" or (f.kind == "number" and bool(_own_unit(f))) for f in fields]
    usable = [k for k, is_one in enumerate(is_clock) if is_one and k != found]
    best = _usual([fields[k] for k in usable])
    return None if best is None else usable[best]


def _named(fields: Sequence[TableField], name: str) -> int | None:
    spellings = [(f.name, f"{f.name} [{f.unit}]") for f in fields]
    exact = next((k for k, s in enumerate(spellings) if name.strip() in s), None)
    if exact is not None:
        return exact
    return next((k for k, s in enumerate(spellings) if name.strip().casefold() in map(str.casefold, s)), None)


def _usual(fields: Sequence[TableField]) -> int | None:
    ranked = [(_rank(f), k) for k, f in enumerate(fields) if f.kind in ("number", "stamp", "clock")]
    best = min((r for r in ranked if r[0] is not None), default=None, key=lambda r: (r[0] or 0, r[1]))
    return None if best is None else best[1]


def _rank(field: TableField) -> int | None:
    """Place of a name in the list of usual ones, without a unit at its end."""
    name = re.sub(r"[ _\-.]+", " ", field.name.casefold()).strip()
    if name in _STEMS:
        return _STEMS.index(name)
    split = _SUFFIX.match(name)
    stem = split["stem"].strip() if split else ""
    return _STEMS.index(stem) if stem in _STEMS else None


def _own_unit(field: TableField) -> str:
    """Return the unit of the header, or of the end of the name; empty without a unit of time."""
    if is_unit(field.unit) and parse_unit(field.unit).dimension == "time":
        return field.unit
    name = field.name.casefold()
    split = _SUFFIX.match(name)
    if split and name not in _STEMS and split["stem"].strip(" _"):
        return split["unit"]
    return ""


def from_numbers(
    values: NDArray[np.float64] | NDArray[np.int64], unit: str, *, cells: pl.Series | None = None, column: str = ""
) -> Stamps:
    """Stamps of a numeric column.

    Parameters
    ----------
    values : array (n,)
        Float, NaN where missing, or int64.
    unit : str
        Unit of time; empty if it is to be judged by the values.
    cells : Series of text, optional
        What `values` were read from: large stamps are converted from it, digit by digit, where float64 is too coarse.
    column : str
        Name of the column.
    """
    note = ""
    valid: BoolArray = np.isfinite(values)
    if unit:
        factor = round(parse_unit(unit).factor * 1e9)
    else:
        name, reason = judged_unit(values)
        factor, note = _NS[name], no_unit_note(name, reason, column)
    seconds = values.astype(np.float64) * (factor / 1e9)
    valid &= np.abs(seconds) < _LATEST_S
    absolute = bool(valid.any()) and _EPOCH_S[0] < float(np.median(seconds[valid])) < _EPOCH_S[1]
    return Stamps(_scaled(values, valid, factor, cells), valid, absolute, (note,) if note else ())


def _scaled(
    values: NDArray[np.float64] | NDArray[np.int64], valid: BoolArray, factor: int, cells: pl.Series | None
) -> TimeArray:
    t_ns: TimeArray = np.zeros(len(values), dtype=np.int64)
    if values.dtype.kind == "i":
        t_ns[valid] = values[valid].astype(np.int64) * factor
        return t_ns
    t_ns[valid] = np.rint(values[valid] * factor).astype(np.int64)
    if cells is not None and valid.any() and np.abs(values[valid]).max() * (factor / 1e9) > _EXACT:
        exact = text_to_ns(cells, factor)
        known = valid & exact.is_not_null().to_numpy()
        t_ns[known] = exact.fill_null(0).to_numpy()[known]
    return t_ns


def text_to_ns(cells: pl.Series, factor: int) -> pl.Series:
    """Decimal numbers as text into whole nanoseconds, exact to the last digit; null where the text is not one."""
    digits = _DIGITS.get(factor)
    if digits is None:
        return pl.Series(cells.name, [None] * len(cells), dtype=pl.Int64)
    parts = pl.col("x").str.strip_chars().str.extract_groups(r"^(\d{1,19})(?:\.(\d*))?$")
    frame = cells.alias("x").to_frame().select(parts.alias("p")).unnest("p")
    whole = pl.col(frame.columns[0]).cast(pl.Int64, strict=False) * factor
    below = pl.col(frame.columns[1]).fill_null("").str.slice(0, digits).str.pad_end(digits, "0")
    fraction = below.cast(pl.Int64, strict=False) if digits else pl.lit(0, dtype=pl.Int64)
    return frame.select((whole + fraction).alias("t"))["t"]


def no_unit_note(unit: str, reason: str, column: str) -> str:
    """Return the note on a time whose unit was inferred; none where its column is named `t`, which is in seconds."""
    return "" if (column, unit) == ("t", "s") else f"the time has no unit; taken as {unit} ({reason})"


def judged_unit(stamps: NDArray[np.float64] | NDArray[np.int64]) -> tuple[str, str]:
    """Unit that makes the stamps (n,) plausible, and why; NaN where missing."""
    values = stamps[np.isfinite(stamps)].astype(np.float64)
    if values.size < 2:
        return "s", "nothing speaks against it"
    steps = np.diff(values)
    moving = np.abs(steps[steps != 0])
    step = float(np.median(moving)) if moving.size else 0.0
    middle = float(np.median(values))
    for name, factor in _NS.items():
        per_s = 1e9 / factor
        is_plausible = not step or _PLAUSIBLE_STEP_S[0] <= step / per_s <= _PLAUSIBLE_STEP_S[1]
        if _EPOCH_S[0] < middle / per_s < _EPOCH_S[1] and is_plausible:
            return name, "it counts from 1970"
    if (np.abs(np.rint(values) - values) <= 1e-6 * step).all() and step >= 1 and float(np.ptp(values)) > _ABSURD_S:
        name = "ms" if step <= 1e3 else "us" if step <= 1e6 else "ns"
        return name, f"whole numbers, {step:g} apart"
    return "s", "its steps are those of seconds"


def from_dates(cells: pl.Series, day: pl.Series | None, kind: FieldKind) -> Stamps:
    """Stamps of a column of date-times, or of times of day with or without a column of days beside them."""
    clean = _clean(cells)
    if kind == "clock" and day is None:
        t = _to_ns(pl.lit("1970-01-01 ") + pl.col("x"), clean)
        return _stamps(t, absolute=False, notes=("the time is a time of day, without a date",))
    notes = []
    if kind == "clock" and day is not None:
        clean = (_clean(day) + " " + clean).alias("x")
    iso, order = _iso(clean)
    if order:
        notes.append(f"dates are taken as {order}")
    if not iso.str.contains(r"(?:Z|UTC|GMT|[+-]\d{2}:?\d{2})$").any():
        notes.append("the date-times have no time zone; taken as UTC")
    return _stamps(_to_ns(pl.col("x"), iso), absolute=True, notes=tuple(notes))


def _clean(cells: pl.Series) -> pl.Series:
    text = pl.col("x").str.strip_chars().str.replace(r"^(\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4})[T_ ]+", "$1 ")
    clock = text.str.replace(r"(:\d{2}),(\d+)", "$1.$2").str.replace(r"(:\d{2}:\d{2}):(\d+)$", "$1.$2")
    hours = clock.str.replace(r"(^|\s)(\d):", "${1}0$2:").str.replace(r"(^|\s)(\d{2}:\d{2})(\D*$)", "$1$2:00$3")
    return cells.alias("x").to_frame().select(hours)["x"]


def _iso(cells: pl.Series) -> tuple[pl.Series, str]:
    """Return dates as year-month-day. The file decides which of two numbers is the month; it is never guessed."""
    first = cells.str.extract(r"^(\d{1,2})[./-]\d{1,2}[./-]\d{4}").cast(pl.Int64, strict=False)
    second = cells.str.extract(r"^\d{1,2}[./-](\d{1,2})[./-]\d{4}").cast(pl.Int64, strict=False)
    same = cells.str.replace(r"^(\d{4})[-/.](\d{1,2})[-/.](\d{1,2})", "$1-$2-$3")
    if first.is_null().all():
        return same, ""
    has_point = bool(cells.str.contains(r"^\d{1,2}\.").any())
    month_first = bool((second > 12).any())
    if not (has_point or month_first or (first > 12).any()):
        raise LogError(
            f'cannot distinguish day and month in "{cells.drop_nulls()[0]}"',
            expected="2026-03-01",
            hint="export ISO 8601",
        )
    swapped = "$3-$1-$2" if month_first else "$3-$2-$1"
    order = "month/day/year" if month_first else "day.month.year"
    return same.str.replace(r"^(\d{1,2})[./-](\d{1,2})[./-](\d{4})", swapped), order


def _to_ns(text: pl.Expr, cells: pl.Series) -> pl.Series:
    zone = text.str.extract(r"([+-]\d{2}:?\d{2})$").str.replace(":", "")
    bare = text.str.replace(r"\s*(?:Z|UTC|GMT|[+-]\d{2}:?\d{2})$", "")
    local = bare.str.to_datetime("%Y-%m-%d %H:%M:%S%.f", time_unit="ns", strict=False).cast(pl.Int64)
    minutes = zone.str.slice(1, 2).cast(pl.Int64) * 60 + zone.str.slice(3, 2).cast(pl.Int64)
    signed = pl.when(zone.str.starts_with("-")).then(-minutes).otherwise(minutes).fill_null(0)
    return cells.alias("x").to_frame().select((local - signed * 60_000_000_000).alias("t"))["t"]


def _stamps(t: pl.Series, *, absolute: bool, notes: tuple[str, ...]) -> Stamps:
    valid: BoolArray = t.is_not_null().to_numpy().copy()
    return Stamps(t.fill_null(0).to_numpy().astype(np.int64), valid, absolute, notes)


class TableReader(OpenFile):
    """What readers of tables have in common: which columns are times, and the comparison of two clocks."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._stamps: Stamps | None = None
        self._drift = DriftWatch()

    def _choose_time(self, fields: Sequence[TableField], options: ReadOptions) -> None:
        self._fields = fields
        self._time = time = choose_time(fields, options, where=str(self._path))
        self._times = [k for k in (time.index, time.day, time.other) if k is not None]
        if time.note:
            self._note(time.note)

    @contextmanager
    def _located(self) -> Iterator[None]:
        """Name the file in an error of a function that does not know it."""
        try:
            yield
        except LogError as error:
            raise LogError(error.what, where=str(self._path), expected=error.expected, hint=error.hint) from error

    def _tell_drift(self) -> None:
        """Note how the second clock runs against the time."""
        drift = self._drift.finish(*(f'"{self._fields[k].name}"' for k in (self._time.index, self._time.other or 0)))
        if drift is not None:
            self._faults.drifts = [drift]
            self._note(drift_note(drift))
