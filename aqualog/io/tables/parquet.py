"""Parquet logs: one table whose columns are signals and one of which is the time."""

from __future__ import annotations

import base64
import binascii
import json
import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from aqualog.core.errors import LogError
from aqualog.core.records import Channel, ChannelInfo, FloatArray, TimeArray
from aqualog.guard.system import bytes_text, free_memory
from aqualog.io.reader import Part, ReadOptions, one_piece, part_of
from aqualog.io.tables.columns import (
    FieldKind,
    Stamps,
    TableField,
    TableReader,
    from_dates,
    from_numbers,
    judged_unit,
    no_unit_note,
    split_unit,
    unique_names,
)  # fmt: skip
from aqualog.io.tables.csv_cells import STYLES, is_clock, is_number, is_stamp
from aqualog.io.tables.parquet_groups import LIBRARY_ERRORS, SoundRows, reason_of, unreadable
from aqualog.io.write_table import METADATA_KEY

__all__ = ["ParquetReader", "field_metadata"]

_CONTINUATION = b"\xff\xff\xff\xff"
_MESSAGE_HEADER = 2  # numbers of members in Schema.fbs and Message.fbs
_SCHEMA_FIELDS = 1
_FIELD_NAME, _FIELD_METADATA = 0, 6
_KEY, _VALUE = 0, 1


@dataclass(frozen=True, slots=True)
class _Table:
    """A FlatBuffers table: its members stand where the table of offsets before it says."""

    data: bytes
    at: int

    def member(self, number: int) -> int | None:
        """Position of a member, or None if it is not there."""
        offsets = self.at - _int(self.data, "<i", self.at)
        size = _int(self.data, "<H", offsets)
        slot = 4 + 2 * number
        offset = _int(self.data, "<H", offsets + slot) if slot < size else 0
        return self.at + offset if offset else None

    def text(self, number: int) -> str:
        """A string member."""
        at = self.member(number)
        if at is None:
            return ""
        start = at + _int(self.data, "<I", at)
        length = _int(self.data, "<I", start)
        return self.data[start + 4 : start + 4 + length].decode("utf-8")

    def table(self, number: int) -> _Table | None:
        """A table member."""
        at = self.member(number)
        return None if at is None else _Table(self.data, at + _int(self.data, "<I", at))

    def tables(self, number: int) -> Iterator[_Table]:
        """A member that is a list of tables."""
        at = self.member(number)
        if at is None:
            return
        start = at + _int(self.data, "<I", at)
        for k in range(_int(self.data, "<I", start)):
            slot = start + 4 + 4 * k
            yield _Table(self.data, slot + _int(self.data, "<I", slot))


def field_metadata(encoded: str, key: str) -> dict[str, str]:
    """Value of a key of the metadata of each field that has it; empty if the schema cannot be decoded.

    Parameters
    ----------
    encoded : str
        What stands under `ARROW:schema`.
    key : str
        Such as `unit`; upper and lower case are the same.
    """
    try:
        message = base64.b64decode(encoded)
        message = message[8 if message.startswith(_CONTINUATION) else 4 :]
        schema = _Table(message, _int(message, "<I", 0)).table(_MESSAGE_HEADER)
        return {
            field.text(_FIELD_NAME): pair.text(_VALUE)
            for field in (() if schema is None else schema.tables(_SCHEMA_FIELDS))
            for pair in field.tables(_FIELD_METADATA)
            if pair.text(_KEY).casefold() == key
        }
    except (binascii.Error, struct.error, UnicodeDecodeError, ValueError):
        return {}


def _int(data: bytes, code: str, at: int) -> int:
    if at < 0:
        raise ValueError("offset before the start")
    return int(struct.unpack_from(code, data, at)[0])


_LOOKED_AT = 50
_PER_SAMPLE = 24  # [bytes] while a column is read as a whole: as stored, as a number, its time
_PIECE = 1 << 22  # values of all columns together
_JUDGED = 1 << 16  # rows that tell the unit of a time without one
_MOST_ROWS = 1 << 26  # what 18 h at 1 kHz have; more are believed of a file that has a byte for 64 of them
_UNIT_NS = {"ns": 1, "us": 10**3, "ms": 10**6}


@dataclass(frozen=True, slots=True)
class _Column:
    """A column of the file: `stored` is its name there, `name` that without the unit, `path` the same but unique."""

    stored: str
    path: str
    name: str
    unit: str
    dtype: pl.DataType
    kind: FieldKind


@dataclass(slots=True)
class _Lost:
    """Rows without a time, and the first of them."""

    rows: int = 0
    first: int = 0

    def add(self, stamps: Stamps, row_of: Callable[[int], int]) -> None:
        """Count those of a piece; `row_of` returns the row of the file of each of its rows."""
        bad = np.flatnonzero(~stamps.valid)
        if bad.size:
            self.first = self.first if self.rows else row_of(int(bad[0]))
            self.rows += bad.size


class ParquetReader(TableReader):
    """Reader of one Parquet file.

    A null is no sample of its channel; a NaN is a bad sample. Units stand in the metadata of the file (as aqualog
    writes them) or of a field (`unit`), or in the name of the column (`v_x [km/h]`).
    """

    format = "parquet"

    def __init__(self, path: Path, options: ReadOptions) -> None:
        super().__init__(path)
        self._unit: str | None = None
        try:
            str(path).encode()
        except UnicodeEncodeError as error:
            what = "its name is not UTF-8, which the Parquet library cannot open"
            raise LogError(what, where=str(path), hint="rename it") from error
        schema, metadata = self._wrapped(lambda: _head(path))
        self._rows: int = self._wrapped(
            lambda: int(pl.scan_parquet(path, glob=False).select(pl.len()).collect().item())
        )
        self._sound = SoundRows(path, self._rows, self._faults)
        if self._rows > max(_MOST_ROWS, 64 * path.stat().st_size):
            what = f"declares {self._rows} rows in {path.stat().st_size} bytes"
            raise LogError(what, where=str(path), expected="a recording", hint="write it again")
        about = _about(metadata)
        start = about.get("start_ns")
        self._start_ns = start if isinstance(start, int) else None
        units = about.get("units")
        known = {str(k): str(v) for k, v in units.items()} if isinstance(units, dict) else {}
        self._columns = self._listed(schema, known or field_metadata(metadata.get("ARROW:schema", ""), "unit"))
        self._choose_time([TableField(c.path, c.unit, c.kind) for c in self._columns], options)

    def channels(self) -> Sequence[ChannelInfo]:
        """All numeric columns but the time."""
        return [
            ChannelInfo(c.path, c.name, c.unit, self._rows, self._path.name, key=k)
            for k, c in enumerate(self._columns)
            if c.kind == "number" and k != self._time.index
        ]

    def read(self, wanted: Iterable[ChannelInfo]) -> list[Channel]:
        """Read these columns only."""
        asked = list(wanted)
        times = self._times if self._stamps is None else []
        stored = list(dict.fromkeys(self._columns[k].stored for k in [*times, *(w.key for w in asked)]))
        if not stored:
            return []
        self._check_memory(len(stored))
        unit = self._time_unit()
        frame = self._sound.collect(stored, 0, self._rows)
        if self._stamps is None:
            self._stamps = self._stamps_of(frame, unit)
            lost = _Lost()
            lost.add(self._stamps, partial(self._sound.row_of, 0))
            self._tell_lost(lost)
            self._compare_clocks(self._stamps, frame)
            self._tell_drift()
        elif frame.height != len(self._stamps.t_ns):  # another row group turned out to be damaged
            self._stamps = None
            return self.read(asked)
        self._sound.tell()
        return [self._channel(w, frame[self._columns[w.key].stored], self._stamps) for w in asked]

    def parts(self, wanted: Iterable[ChannelInfo]) -> list[Part]:
        """Return the same piece by piece; in one if the time is text, which needs the whole to find the month."""
        asked = list(wanted)
        if self._columns[self._time.index].dtype == pl.String:
            return [one_piece(asked, self.read)]
        return [part_of(asked, self._pieces(asked))]

    def _pieces(self, asked: Sequence[ChannelInfo]) -> Iterator[Sequence[Channel]]:
        stored = list(dict.fromkeys(self._columns[k].stored for k in [*self._times, *(w.key for w in asked)]))
        rows = max(1, _PIECE // len(stored))
        unit = self._time_unit()
        absolute: bool | None = None
        lost = _Lost()
        for at in range(0, self._rows, rows):
            frame = self._sound.collect(stored, at, rows)
            if frame.is_empty():
                continue
            stamps = self._stamps_of(frame, unit)
            if absolute is None and stamps.valid.any():
                absolute = stamps.absolute
            stamps = replace(stamps, absolute=bool(absolute))
            lost.add(stamps, partial(self._sound.row_of, at))
            self._compare_clocks(stamps, frame)
            yield [self._channel(w, frame[self._columns[w.key].stored], stamps) for w in asked]
        self._tell_lost(lost)
        self._tell_drift()
        self._sound.tell()

    def _check_memory(self, columns: int) -> None:
        """Refuse what cannot be held: a page of one value in a million rows is a few bytes."""
        need, free = self._rows * (columns + 1) * _PER_SAMPLE, free_memory()
        if need > free:
            raise LogError(
                f"{columns} columns of {self._rows} rows would take {bytes_text(need)}", where=str(self._path),
                expected=f"at most {bytes_text(free)} that are free",
                hint="give fewer channels in a signal map, or a machine with more memory",
            )  # fmt: skip

    def _time_unit(self) -> str:
        """Return the unit of the time; without one, infer it from the first rows and the last: the log's length.

        It is found before any other column is read, so that a log has the same unit whichever channels are read.
        """
        column, unit = self._columns[self._time.index], self._time.unit
        if unit or not column.dtype.is_numeric():
            return unit
        if self._unit is None:
            spans = ((0, _JUDGED), (max(self._rows - 1, 0), 1))
            ends = [self._sound.collect([column.stored], at, n) for at, n in spans]
            self._unit, reason = judged_unit(np.concatenate([_floats(frame[column.stored]) for frame in ends]))
            if note := no_unit_note(self._unit, reason, column.name):
                self._note(note)
        return self._unit

    def _channel(self, info: ChannelInfo, column: pl.Series, stamps: Stamps) -> Channel:
        keep = stamps.valid & column.is_not_null().to_numpy()
        values = _floats(column)[keep]
        values[~np.isfinite(values)] = np.nan
        return Channel(info, stamps.t_ns[keep], values, stamps.absolute)

    def _stamps_of(self, frame: pl.DataFrame, unit: str) -> Stamps:
        column, choice = self._columns[self._time.index], self._time
        day = None if choice.day is None else frame[self._columns[choice.day].stored].cast(pl.String)
        with self._located():
            stamps = _stamps(frame[column.stored], day, unit, column.kind)
        if self._start_ns is not None and not stamps.absolute:
            stamps = replace(stamps, t_ns=stamps.t_ns + self._start_ns, absolute=True)
        for note in stamps.notes:
            self._note(note)
        return stamps

    def _compare_clocks(self, stamps: Stamps, frame: pl.DataFrame) -> None:
        """Compare the second clock of these rows with their stamps; not if it is text, which needs the whole column."""
        other = None if self._time.other is None else self._columns[self._time.other]
        if other is None or other.dtype == pl.String:
            return
        found = _stamps(frame[other.stored], None, self._time.other_unit, other.kind)
        self._drift.push(stamps.t_ns, found.t_ns, stamps.valid & found.valid)

    def _tell_lost(self, lost: _Lost) -> None:
        if lost.rows:
            self._faults.lost_samples += lost.rows
            name, where = self._columns[self._time.index].path, f"(first at row {lost.first + 1})"
            self._note(f'time column "{name}": {lost.rows} rows without a time are left out {where}')

    def _listed(self, schema: Any, units: dict[str, str]) -> tuple[_Column, ...]:
        known = [(n, units[n]) if n in units else split_unit(n) for n in schema]
        paths = unique_names([name for name, _ in known])
        return tuple(
            _Column(stored, path, name or path, unit, dtype, self._kind(stored, dtype))
            for (stored, dtype), path, (name, unit) in zip(schema.items(), paths, known, strict=True)
        )

    def _kind(self, stored: str, dtype: pl.DataType) -> FieldKind:
        if dtype.is_numeric() or dtype == pl.Boolean or isinstance(dtype, pl.Duration):
            return "number"
        if isinstance(dtype, pl.Datetime):
            return "stamp"
        if dtype == pl.Date:
            return "date"
        if dtype == pl.Time:
            return "clock"
        return self._text_kind(stored) if dtype == pl.String else "text"

    def _text_kind(self, stored: str) -> FieldKind:
        frame = self._sound.collect([stored], 0, min(self._rows, _LOOKED_AT))
        cells = [c.strip() for c in frame[stored].drop_nulls().to_list()]
        if cells and all(map(is_stamp, cells)):
            return "stamp"
        if cells and all(any(is_number(c, style) for style in STYLES) for c in cells):
            self._note(f'column "{stored}" holds numbers as text and is left out: write it as numbers')
        return "clock" if cells and all(map(is_clock, cells)) else "text"

    def _wrapped(self, action: Callable[[], Any]) -> Any:
        """Result of a call into the library, whose errors of all kinds become ours."""
        try:
            return action()
        except LIBRARY_ERRORS as error:
            raise unreadable(self._path, reason_of(error)) from error


def _about(metadata: dict[str, str]) -> dict[str, Any]:
    try:
        about = json.loads(metadata.get(METADATA_KEY, "{}"))
    except ValueError:
        return {}
    return about if isinstance(about, dict) else {}


def _floats(column: pl.Series) -> FloatArray:
    if isinstance(column.dtype, pl.Duration):
        column = (column.to_physical().cast(pl.Int64) * _UNIT_NS[column.dtype.time_unit]).cast(pl.Float64) * 1e-9
    values: FloatArray = column.cast(pl.Float64).to_numpy().astype(np.float64)
    return values


def _stamps(column: pl.Series, day: pl.Series | None, unit: str, kind: FieldKind) -> Stamps:
    dtype = column.dtype
    if isinstance(dtype, pl.Datetime | pl.Duration):
        return _whole(column, _UNIT_NS[dtype.time_unit], absolute=isinstance(dtype, pl.Datetime))
    if kind in ("stamp", "clock"):
        # a cast of a time of day to text drops the fraction of the second
        text = column.dt.to_string("%H:%M:%S%.9f") if dtype == pl.Time else column.cast(pl.String)
        return from_dates(text, day, kind)
    if dtype.is_integer() and not (whole := column.cast(pl.Int64, strict=False)).null_count():
        return from_numbers(whole.to_numpy(), unit)
    return from_numbers(_floats(column), unit, cells=column.cast(pl.String) if dtype.is_integer() else None)


def _whole(column: pl.Series, factor: int, *, absolute: bool) -> Stamps:
    """Return whole ticks of `factor` nanoseconds; ticks beyond the range of nanoseconds become missing."""
    ticks = column.to_physical().cast(pl.Int64)
    t: TimeArray = ticks.fill_null(0).to_numpy().astype(np.int64)
    latest = np.iinfo(np.int64).max // factor
    valid = ticks.is_not_null().to_numpy() & (t <= latest) & (t >= -latest)
    return Stamps(np.where(valid, t, 0) * factor, valid, absolute)


def _head(path: Path) -> tuple[dict[str, pl.DataType], dict[str, str]]:
    """Columns and metadata; from an open file, because polars takes `[` and `*` in a name for a pattern."""
    with path.open("rb") as file:
        schema = pl.read_parquet_schema(file)
        file.seek(0)
        return dict(schema), pl.read_parquet_metadata(file)
