"""CSV logs of any separator, decimal sign and encoding."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

import polars as pl

from aqualog.errors import LogError
from aqualog.io.base import FaultLog, ReadOptions
from aqualog.io.csv_cells import Numbers, numbers, plain
from aqualog.io.csv_dialect import Column, find_layout
from aqualog.io.csv_rows import RowFaults, Rows, find_rows
from aqualog.io.csv_text import read_text
from aqualog.io.table_time import FieldKind, Stamps, TableField, TimeChoice, choose_time, from_dates, from_numbers
from aqualog.types import BoolArray, Channel, ChannelInfo, FileFaults

__all__ = ["CsvReader"]

# Above this share of short rows the writer leaves out blank cells at the end; below it rows are damaged.
_HABIT = 0.1


class CsvReader:
    """Reader of one CSV file.

    A blank cell is no sample of its channel; a cell that stands for a bad sample, or that cannot be understood, is NaN.
    Rows are kept in the order of the file, also if their times are not.
    """

    format = "csv"

    def __init__(self, path: Path, options: ReadOptions) -> None:
        self._path = path
        self._faults = FaultLog()
        self._rows: Rows | None = None
        self._stamps: Stamps | None = None
        self._counted: set[int] = set()
        text = read_text(path)
        self._faults.notes += text.notes
        self._data = text.data
        self._layout = find_layout(text.data, where=str(path))
        ends = text.data.count(b"\n") + (not text.data.endswith(b"\n"))
        self._count = max(0, ends - self._layout.first_line + 1)
        self._time = choose_time([_field(c) for c in self._layout.columns], options, where=str(path))
        if self._time.note:
            self._note(self._time.note)
        self._note_columns()

    def channels(self) -> Sequence[ChannelInfo]:
        """All numeric columns but the time; `count` is the number of lines below the header."""
        return [
            ChannelInfo(c.name, c.name, c.unit, self._count, self._path.name, key=c.index)
            for c in self._layout.columns
            if _is_channel(c, self._time)
        ]

    def read(self, wanted: Iterable[ChannelInfo]) -> list[Channel]:
        """Parse these columns only."""
        asked = list(wanted)
        rows = self._found_rows()
        times = [k for k in (self._time.index, self._time.day) if k is not None and self._stamps is None]
        needed = list({w.key for w in asked}.union(times))
        cells = rows.cells(needed, where=str(self._path)) if needed else {}
        if self._stamps is None:
            self._stamps = self._read_time(cells, rows)
        columns = self._layout.columns
        return [self._channel(w, numbers(cells[w.key], columns[w.key].style), self._stamps, rows) for w in asked]

    def _channel(self, info: ChannelInfo, samples: Numbers, stamps: Stamps, rows: Rows) -> Channel:
        keep = stamps.valid & ~samples.blank
        if info.key not in self._counted:
            self._counted.add(info.key)
            self._lose(samples.unreadable & keep, rows, f'column "{info.path}": {{}} not a number')
        return Channel(info, stamps.t_ns[keep], samples.values[keep], stamps.absolute)

    def _read_time(self, cells: dict[int, pl.Series], rows: Rows) -> Stamps:
        column, choice = self._layout.columns[self._time.index], self._time
        stamps = self._as_stamps(column, cells[choice.index], None if choice.day is None else cells[choice.day])
        for note in stamps.notes:
            self._note(note)
        self._lose(~stamps.valid, rows, f'time column "{column.name}": {{}} without a time, the row is left out')
        return stamps

    def _as_stamps(self, column: Column, cells: pl.Series, day: pl.Series | None) -> Stamps:
        if column.kind in ("stamp", "clock"):
            try:
                return from_dates(cells, day, "clock" if column.kind == "clock" else "stamp")
            except LogError as error:  # it does not know the file
                raise LogError(error.what, where=str(self._path), expected=error.expected, hint=error.hint) from error
        values = numbers(cells, column.style).values
        return from_numbers(values, self._time.unit, cells=plain(cells, column.style))

    def _found_rows(self) -> Rows:
        if self._rows is None:
            self._rows, self._data = find_rows(self._data, self._layout), b""
            self._note_rows(self._rows.faults, len(self._rows.lines))
        return self._rows

    def _lose(self, bad: BoolArray, rows: Rows, text: str) -> None:
        count = int(bad.sum())
        if count:
            self._faults.lost_samples += count
            cells = f"{count} cell{'s' if count > 1 else ''}"
            self._note(f"{text.format(cells)} (first at line {int(rows.lines[bad][0])})")

    def _note_rows(self, faults: RowFaults, count: int) -> None:
        if faults.long:
            self._faults.lost_samples += len(faults.long)
            self._note(_lines(faults.long, "has more cells than the header and is left out"))
        if faults.short:
            is_habit = len(faults.short) > max(1, _HABIT * count)
            self._faults.lost_samples += 0 if is_habit else len(faults.short)
            self._note(_lines(faults.short, "has fewer cells than the header; the missing ones are blank"))
        if faults.comments:
            self._note(_lines(faults.comments, "is a comment among the data and is left out"))
        if faults.cut_line:
            self._faults.truncated = True
            self._note(f"ends inside line {faults.cut_line}; its last cell is left out")

    def _note_columns(self) -> None:
        for name in self._layout.twice:
            self._note(f'several columns are called "{name}"; the others are "{name}#2" and so on')
        for column in self._layout.columns:
            if column.kind == "text" and column.text_share < 1.0:
                share = f'{100 * column.text_share:.0f} % of its cells are text such as "{column.example[:40]}"'
                self._note(f'column "{column.name}" is left out: {share}')

    def _note(self, text: str) -> None:
        self._faults.notes.append(f"{self._path.name}: {text}")

    @property
    def faults(self) -> FileFaults:
        """What was lost so far; complete after `read`."""
        return self._faults.freeze()

    def close(self) -> None:
        """Let go of the text."""
        self._data, self._rows = b"", None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _field(column: Column) -> TableField:
    kind: FieldKind = "text" if column.kind == "blank" else column.kind
    return TableField(column.name, column.unit, kind)


def _is_channel(column: Column, time: TimeChoice) -> bool:
    return column.kind in ("number", "blank") and column.index != time.index


def _lines(lines: Sequence[int], what: str) -> str:
    more = f" (and {len(lines) - 1} more such lines)" if len(lines) > 1 else ""
    return f"line {lines[0]} {what}{more}"
