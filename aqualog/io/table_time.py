"""Which column of a table is the time, and what it counts in."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl

from aqualog.errors import LogError
from aqualog.io.base import ReadOptions
from aqualog.types import BoolArray, FloatArray, TimeArray
from aqualog.units import is_unit, parse_unit

__all__ = ["TimeColumn", "choose_time", "numbers_to_ns", "split_unit", "texts_to_ns"]

_NAMES = ("t", "time", "timestamp", "timestamps", "zeit", "zeitstempel", "utc", "datetime", "time_stamp", "elapsed")
_SUFFIXES = {"_ns": "ns", "_us": "us", "_ms": "ms", "_s": "s", "_sec": "s"}
_YEAR_2000 = 946_684_800.0
_YEAR_2100 = 4_102_444_800.0
_FORMATS = ("%Y-%m-%dT%H:%M:%S%.f", "%Y/%m/%dT%H:%M:%S%.f", "%d.%m.%YT%H:%M:%S%.f", "%Y%m%dT%H:%M:%S%.f")
_BRACKET = re.compile(r"^(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]\s*$")


@dataclass(frozen=True, slots=True)
class TimeColumn:
    """The time of a table: one column, or a date and a time of day. `unit` is empty where nothing says it."""

    columns: tuple[int, ...]
    unit: str


def split_unit(header: str) -> tuple[str, str]:
    """Name and unit of a header cell: `v_x [km/h]` -> (`v_x`, `km/h`).

    A last part in brackets counts as unit if square brackets hold it, or if it is one in round ones; a bracket that is
    closed by the wrong kind is forgiven.
    """
    text = header.strip()
    match = _BRACKET.match(text)
    if match is None or not match["name"]:
        return text, ""
    unit = match["unit"].strip()
    if is_unit(unit) or "[" in text[len(match["name"]) :]:
        return match["name"].strip(), unit
    return text, ""


def choose_time(names: Sequence[str], units: Sequence[str], options: ReadOptions, *, where: str) -> TimeColumn:
    """Find the time column by its name.

    Parameters
    ----------
    names, units : sequences
        Of all columns.
    options : ReadOptions
        `time_channel` and `time_unit` win.
    where : str
        File, for errors.

    Raises
    ------
    LogError
        If no column or more than one may be it.
    """
    lower = [n.strip().lower() for n in names]
    if options.time_channel is not None:
        wanted = split_unit(options.time_channel)[0].lower()
        if wanted not in lower:
            raise _no_time(names, where, f'no column "{options.time_channel}"')
        index = lower.index(wanted)
        return TimeColumn((index,), options.time_unit or units[index] or _suffix_unit(lower[index]))
    if "date" in lower and "time" in lower:
        return TimeColumn((lower.index("date"), lower.index("time")), "")
    for wanted in (lambda n: n in _NAMES, lambda n: _stem(n) in _NAMES, lambda n: n.startswith(("time", "zeit"))):
        hits = [i for i, n in enumerate(lower) if wanted(n)]
        if hits:
            index = hits[0]
            return TimeColumn((index,), options.time_unit or units[index] or _suffix_unit(lower[index]))
    raise _no_time(names, where, "no time column")


def _stem(name: str) -> str:
    return next((name.removesuffix(s) for s in _SUFFIXES if name.endswith(s)), name)


def _suffix_unit(name: str) -> str:
    return next((unit for s, unit in _SUFFIXES.items() if name.endswith(s)), "")


def _no_time(names: Sequence[str], where: str, what: str) -> LogError:
    listed = ", ".join(names[:8]) + (", ..." if len(names) > 8 else "")
    return LogError(f"{what} among {listed}", where=where, expected="a column such as t [s], time or t_ms",
                    hint='[time] channel = "NAME" and unit = "s" in the signal map')  # fmt: skip


def numbers_to_ns(t: FloatArray, unit: str, *, where: str) -> tuple[TimeArray, bool, str]:
    """Numbers into nanoseconds.

    Parameters
    ----------
    t : array (n,)
        Finite stamps.
    unit : str
        Unit of time; empty: decided by the values, and said in the note.

    Returns
    -------
    t_ns : int64 array (n,)
    absolute : bool
        Whether they count from 1970.
    note : str
    """
    note = ""
    if not unit or not is_unit(unit) or parse_unit(unit).dimension != "time":
        if unit:
            raise LogError(
                f'time is in "{unit}"', where=where, expected="s, ms, us or ns", hint="[time] unit in the map"
            )
        unit = _guess_unit(t)
        note = f"{where}: the time has no unit; taken as {unit}"
    scale = parse_unit(unit).factor * 1e9
    with np.errstate(invalid="ignore"):
        # whole ticks times a whole factor stay exact; only fractions of a tick are rounded
        t_ns = np.rint(t * round(scale)) if scale >= 1 else np.rint(t * scale)
    if t.size and np.abs(t_ns).max() > 9e18:
        raise LogError(f"time stamps reach {np.abs(t).max():g} {unit}", where=where, expected="times within 290 years")
    first = float(t_ns[0]) * 1e-9 if t.size else 0.0
    return t_ns.astype(np.int64), _YEAR_2000 < first < _YEAR_2100, note


def _guess_unit(t: FloatArray) -> str:
    if t.size == 0:
        return "s"
    for unit, factor in (("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)):
        if _YEAR_2000 * factor < t[0] < _YEAR_2100 * factor:
            return unit
    steps = np.diff(t)
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
    # nobody logs a drive every 2 s and slower, but every 2 ms
    return "ms" if step >= 2.0 and bool(np.all(np.mod(t[:1000], 1.0) == 0.0)) else "s"


def texts_to_ns(texts: pl.Series) -> tuple[TimeArray, BoolArray, bool] | None:
    """Dates and times of day into nanoseconds.

    Returns
    -------
    t_ns : int64 array (n,)
    known : bool array (n,)
        Where the text could be read.
    absolute : bool
        False for a time of day without a date.

    None if the texts are no times.
    """
    clean = texts.str.strip_chars().str.replace(" +", "T").str.replace(r",(\d+)", ".$1")
    zoned = clean.str.contains(r"[+-]\d\d:?\d\d$").any()
    clean = clean.str.replace(r"Z$", "")
    for form in _FORMATS:
        stamps = clean.str.to_datetime(form + ("%z" if zoned else ""), time_unit="ns", strict=False)
        if _mostly(stamps):
            return _stamps(stamps.dt.epoch("ns"), absolute=True)
    of_day = clean.str.to_time("%H:%M:%S%.f", strict=False)
    if _mostly(of_day):
        return _stamps(of_day.cast(pl.Int64), absolute=False)
    return None


def _mostly(series: pl.Series) -> bool:
    return len(series) > 0 and series.null_count() <= 0.01 * len(series) + 1 and series.null_count() < len(series)


def _stamps(series: pl.Series, *, absolute: bool) -> tuple[TimeArray, BoolArray, bool]:
    known = series.is_not_null().to_numpy()
    return series.fill_null(0).to_numpy().astype(np.int64), known, absolute
