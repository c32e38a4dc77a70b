"""Find the valid rows of a Parquet file, row group by row group."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from aqualog.core.errors import LogError
from aqualog.io.reader import FaultLog
from aqualog.io.tables.parquet_pages import Group, Index, MalformedError, is_of, page_fault, read_index

__all__ = ["LIBRARY_ERRORS", "SoundRows", "reason_of", "unreadable"]

_CODES: dict[type[pl.DataType], str] = {
    pl.Float64: "d", pl.Float32: "f", pl.Int64: "q", pl.UInt64: "Q", pl.Int32: "i", pl.Int16: "i", pl.Int8: "i",
    pl.UInt32: "I", pl.UInt16: "I", pl.UInt8: "I",
}  # fmt: skip
LIBRARY_ERRORS = (pl.exceptions.PolarsError, pl.exceptions.PanicException, OSError, TypeError, ValueError)
_TRIED = 1 << 20  # values decoded at once where none is handed out
"""What the library raises for the content of a file."""


class SoundRows:
    """Rows of one file without those of damaged row groups, which are noted and counted.

    Parameters
    ----------
    path : Path
    rows : int
        As the library counts them.
    faults : FaultLog
        Collects the losses.

    Raises
    ------
    LogError
        If the index is not valid.
    """

    def __init__(self, path: Path, rows: int, faults: FaultLog) -> None:
        self._path, self._rows, self._faults = path, rows, faults
        try:
            self._index: Index | None = read_index(path)
        except (MalformedError, OSError) as error:
            raise unreadable(path, str(error)) from error
        if self._index is None:
            self._note("the index is too large to hold the pages against it")
        elif self._index.unowned:
            self._note(f"{self._index.unowned} bytes before the index (byte {self._index.end}) belong to no column")
        self._groups = (Group(0, rows, {}),) if self._index is None else self._index.groups
        there = sum(g.rows for g in self._groups)
        if there != rows:
            what = f"declares other rows than its row groups hold ({rows} and {there})"
            raise LogError(what, where=str(path), hint="check whether it was damaged: its index says so")
        self._bad: dict[int, str] = {}
        self._checked: set[tuple[int, str]] = set()
        self._gone_through: set[tuple[int, frozenset[str]]] = set()
        self._left_out: dict[str, NDArray[np.int64]] = {}
        self._counted: dict[str, NDArray[np.int64]] = {}
        self._told: set[int] = set()

    @property
    def bad(self) -> frozenset[int]:
        """Return the row groups that are left out, among those checked so far."""
        return frozenset(self._bad)

    def collect(self, columns: Sequence[str], at: int, rows: int) -> pl.DataFrame:
        """Rows of some columns, without those of damaged row groups.

        Raises
        ------
        LogError
            If none of the row groups is sound.
        """
        touched = [k for k, g in enumerate(self._groups) if g.first < at + rows and at < g.first + g.rows]
        self._check(touched, columns)
        inner = [k for k in touched if at <= self._groups[k].first <= at + rows - self._groups[k].rows]
        self._go_through([k for k in touched if k not in inner], columns, rows)
        try:
            return self._frame(columns, at, rows, touched)
        except LIBRARY_ERRORS as error:
            if len(self._groups) == 1:
                raise unreadable(self._path, reason_of(error)) from error
        for k in touched:  # which of them cannot be decoded
            if k not in self._bad:
                group = self._groups[k]
                try:
                    self._slice(columns, group.first, group.rows)
                except LIBRARY_ERRORS as error:
                    self._leave_out(k, reason_of(error))
        try:
            return self._frame(columns, at, rows, touched)
        except LIBRARY_ERRORS as error:
            raise unreadable(self._path, reason_of(error)) from error

    def row_of(self, at: int, k: int) -> int:
        """Row of the file that is the k-th of those collected from row `at` on."""
        for begin, rows in self._spans(at, self._rows - at, range(len(self._groups))):
            if k < rows:
                return begin + k
            k -= rows
        return self._rows

    def tell(self) -> None:
        """Note and count what was lost; a row counts once, however many columns it has.

        Values in a row group that is left out as a whole do not count again, so that the order of the columns makes no
        difference.
        """
        for k, reason in sorted(self._bad.items()):
            if k in self._told:
                continue
            group = self._groups[k]
            self._told.add(k)
            before = [np.count_nonzero(self._is_in(group, rows)) for rows in self._counted.values()]
            self._faults.lost_samples += max(0, group.rows - int(sum(before)))
            span = f"rows {group.first + 1} to {group.first + group.rows}"
            self._note(f"row group {k + 1} of {len(self._groups)} ({span}) is left out: {reason}")
        for column, rows in self._left_out.items():
            new = np.setdiff1d(rows, self._counted.get(column, np.zeros(0, dtype=np.int64)))
            for k in self._bad:
                new = new[~self._is_in(self._groups[k], new)]
            if new.size:
                self._counted[column] = np.union1d(self._counted.get(column, new), new)
                self._faults.lost_samples += new.size
                what = f"{new.size} value{'s' if new.size > 1 else ''} (first at row {new[0] + 1}) beyond the least and"
                self._note(f'column "{column}": {what} greatest that the index declares; left out')

    @staticmethod
    def _is_in(group: Group, rows: NDArray[np.int64]) -> NDArray[np.bool_]:
        return (rows >= group.first) & (rows < group.first + group.rows)

    def _check(self, groups: Sequence[int], columns: Sequence[str]) -> None:
        if self._index is None:
            return
        for k in groups:
            new = [c for c in columns if (k, c) not in self._checked]
            self._checked |= {(k, c) for c in new}
            if k in self._bad or not new:
                continue
            fault = page_fault(self._path, self._index, self._groups[k], new)
            if fault:
                self._leave_out(k, fault)

    def _go_through(self, groups: Sequence[int], columns: Sequence[str], rows: int) -> None:
        """Decode row groups to their ends before a part of them is handed out: the rest may be none."""
        for k in groups:
            asked = (k, frozenset(columns))
            if k in self._bad or asked in self._gone_through:
                continue
            self._gone_through.add(asked)
            group = self._groups[k]
            step = max(rows, _TRIED // max(len(columns), 1), 1)  # a step for each of a few rows would take hours
            try:
                for at in range(group.first, group.first + group.rows, step):
                    self._slice(columns, at, min(step, group.first + group.rows - at))
            except LIBRARY_ERRORS as error:
                self._leave_out(k, reason_of(error))

    def _leave_out(self, group: int, reason: str) -> None:
        self._bad[group] = reason
        if len(self._bad) == len(self._groups):
            raise unreadable(self._path, next(iter(self._bad.values())))

    def _frame(self, columns: Sequence[str], at: int, rows: int, touched: Sequence[int]) -> pl.DataFrame:
        spans = list(self._spans(at, rows, touched))
        frames = [self._within_bounds(self._slice(columns, a, n), a) for a, n in spans]
        if not frames:
            return self._slice(columns, 0, 0)
        return frames[0] if len(frames) == 1 else pl.concat(frames)

    def _spans(self, at: int, rows: int, touched: Sequence[int]) -> Iterator[tuple[int, int]]:
        """Stretches of rows between the damaged row groups."""
        begin = at
        for k in touched:
            group = self._groups[k]
            if k in self._bad and group.first + group.rows > at:
                if group.first > begin:
                    yield begin, group.first - begin
                begin = group.first + group.rows
        if begin < at + rows:
            yield begin, at + rows - begin

    def _slice(self, columns: Sequence[str], at: int, rows: int) -> pl.DataFrame:
        return pl.scan_parquet(self._path, glob=False).select(columns).slice(at, rows).collect()

    def _within_bounds(self, frame: pl.DataFrame, at: int) -> pl.DataFrame:
        """Leave out numbers beyond the bounds of their row group: a bit or more of them has changed."""
        if not frame.height:
            return frame
        groups = [g for g in self._groups if g.rows and g.first < at + frame.height and at < g.first + g.rows]
        starts = np.array([max(g.first - at, 0) for g in groups])
        for name in frame.columns:
            column = frame[name]
            code = _CODES.get(column.dtype.base_type())
            if code is None:
                continue
            values = column.fill_null(0).to_numpy()
            low, high = _bounds(groups, name, code, values.dtype)
            outside = (np.fmin.reduceat(values, starts) < low) | (np.fmax.reduceat(values, starts) > high)
            if not outside.any():
                continue
            which = np.searchsorted(starts, np.arange(len(values)), side="right") - 1
            strange = column.is_not_null().to_numpy() & ((values < low[which]) | (values > high[which]))
            if strange.any():
                rows = at + np.flatnonzero(strange)  # each once: the ends of a time are looked at before it is read
                self._left_out[name] = np.union1d(self._left_out.get(name, rows), rows)
                frame = frame.with_columns(pl.when(pl.Series(~strange)).then(column).alias(name))
        return frame

    def _note(self, text: str) -> None:
        self._faults.notes.append(f"{self._path.name}: {text}")


def _bounds(groups: Sequence[Group], column: str, code: str, dtype: Any) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return least and greatest value of a column in each group; without bounds in the file, those of the type."""
    limits = np.iinfo(dtype) if dtype.kind in "iu" else np.finfo(dtype)
    widest = (limits.min, limits.max) if dtype.kind in "iu" else (-np.inf, np.inf)
    found = []
    for group in groups:
        chunk = group.chunks.get(column)
        known = chunk.bounds.numbers(code) if chunk and chunk.bounds and is_of(chunk, code) else None
        fits = known is not None and limits.min <= known[0] and known[1] <= limits.max
        found.append(known if fits or (known and dtype.kind == "f") else widest)
    low, high = zip(*found, strict=True)
    return np.array(low, dtype=dtype), np.array(high, dtype=dtype)


def reason_of(error: BaseException) -> str:
    """Why the library cannot read, in a line."""
    if isinstance(error, pl.exceptions.PanicException):
        return "its pages and its index do not fit together"
    return (str(error).splitlines() or [type(error).__name__])[0]


def unreadable(path: Path, reason: str) -> LogError:
    """Return the error for a file without any sound row."""
    hint = "check whether it was written to its end: the index stands there"
    return LogError(f"cannot be read as Parquet ({reason})", where=str(path), hint=hint)
