"""CSV logs of any separator, decimal sign and encoding."""

from __future__ import annotations

import codecs
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl

from aqualog.core.errors import LogError
from aqualog.core.records import BoolArray, Channel, ChannelInfo, FloatArray
from aqualog.io.clock_drift import DriftWatch, drift_note
from aqualog.io.reader import OpenFile, Part, ReadOptions, csv_hint, format_of, one_piece, part_of
from aqualog.io.tables.columns import (
    FieldKind,
    Stamps,
    TableField,
    TimeChoice,
    choose_time,
    from_dates,
    from_numbers,
    judged_unit,
    no_unit_note,
)  # fmt: skip
from aqualog.io.tables.csv_cells import STYLES, numbers, plain
from aqualog.io.tables.csv_dialect import Column, find_layout
from aqualog.io.tables.csv_rows import RowFaults, Rows, behind, bodies, find_rows, rows_of
from aqualog.io.tables.csv_text import TextFile, open_text, read_text

__all__ = ["CsvReader"]

# Above this share of short rows the writer leaves out blank cells at the end; below it rows are damaged.
_HABIT = 0.1
_TAIL = 1 << 16  # [bytes]


class CsvReader(OpenFile):
    """Reader of one CSV file.

    A blank cell is no sample of its channel; a cell that stands for a bad sample, or that cannot be understood, is NaN.
    Rows are kept in the order of the file, also if their times are not.
    """

    format = "csv"

    def __init__(self, path: Path, options: ReadOptions) -> None:
        super().__init__(path)
        self._rows: Rows | None = None
        self._stamps: Stamps | None = None
        self._counted: set[int] = set()
        self._drift = DriftWatch()
        self._lost: dict[tuple[int, tuple[str, str]], tuple[int, int]] = {}
        self._told = format_of(options.csv, path.name)
        self._data: bytes | TextFile = self._text()
        self._layout = find_layout(self._data, where=str(path), told=self._told)
        ends = self._data.count(b"\n") + (self._data[-1:] != b"\n")
        self._count = max(0, ends - self._layout.first_line + 1)
        self._size = len(self._data)
        self._time = choose_time([_field(c) for c in self._layout.columns], options, where=str(path))
        self._refuse_two_times(options)
        if self._time.note:
            self._note(self._time.note)
        self._note_columns()

    def _text(self) -> bytes | TextFile:
        is_plain = not self._told.encoding or codecs.lookup(self._told.encoding).name in ("utf-8", "ascii")
        try:
            large = open_text(self._path) if is_plain else None
        except OSError as error:
            raise LogError(f"cannot be opened: {error.strerror}", where=str(self._path)) from error
        if large is not None:
            return large
        text = read_text(self._path, self._told.encoding)
        self._faults.notes += text.notes
        return text.data

    def _refuse_two_times(self, options: ReadOptions) -> None:
        """Two columns of one name may be the times of different signals."""
        name = self._layout.columns[self._time.index].header
        if name in self._layout.twice and not options.time_channel:
            what = f'has several columns called "{name}", and each may be the time'
            hint = f'[time] channel = "{name}" in the map if the first is right for all signals'
            raise LogError(what, where=str(self._path), expected="one time", hint=hint)

    def channels(self) -> Sequence[ChannelInfo]:
        """All numeric columns but the time; `count` is the number of lines below the header."""
        return [
            ChannelInfo(c.name, c.header, c.unit, self._count, self._path.name, key=c.index)
            for c in self._layout.columns
            if _is_channel(c, self._time)
        ]

    def read(self, wanted: Iterable[ChannelInfo]) -> list[Channel]:
        """Parse these columns only."""
        asked = list(wanted)
        rows = self._found_rows()
        choice = self._time
        times = [k for k in (choice.index, choice.day, choice.other) if k is not None and self._stamps is None]
        needed = list({w.key for w in asked}.union(times))
        cells = rows.cells(needed, where=str(self._path), numbers=self._plain(asked)) if needed else {}
        if self._stamps is None:
            self._stamps = self._read_time(cells, rows)
            self._compare_clocks(self._stamps, cells)
            self._tell_drift()
        found = [self._channel(w, cells, self._stamps, rows) for w in asked]
        self._counted |= {w.key for w in asked}
        self._tell_lost()
        return found

    def parts(self, wanted: Iterable[ChannelInfo]) -> list[Part]:
        """The same piece by piece where the file is large and its time is a number; else in one."""
        asked = list(wanted)
        numeric = self._layout.columns[self._time.index].kind == "number"
        if isinstance(self._data, TextFile) and numeric:
            return [part_of(asked, self._pieces(asked, self._data))]
        return [one_piece(asked, self.read)]

    def _plain(self, asked: Sequence[ChannelInfo]) -> frozenset[int]:
        """Columns that the library reads as numbers as they stand: three times faster than by their text."""
        times = {self._time.index, self._time.day, self._time.other}
        return frozenset(w.key for w in asked if self._layout.columns[w.key].style == STYLES[0]) - times

    def _pieces(self, asked: Sequence[ChannelInfo], text: TextFile) -> Iterator[Sequence[Channel]]:
        columns, choice = self._layout.columns, self._time
        where = str(self._path)
        faults, count = RowFaults(), 0
        unit, first = choice.unit, None
        for body, line, is_last in bodies(text, behind(text, self._layout.first_line - 1), self._layout.first_line):
            rows = rows_of(body, self._layout, line, is_cut=is_last and text[-1:] not in (b"\n", b"\r"))
            faults, count = faults + rows.faults, count + len(rows.lines)
            other = self._numeric_clock()
            needed = list({choice.index, *other, *(w.key for w in asked)})
            cells = rows.cells(needed, where=where, numbers=self._plain(asked))
            column = columns[choice.index]
            values = numbers(cells[choice.index], column.style).values
            if not unit:
                unit, reason = judged_unit(np.concatenate([values, self._last_times(text)]))
                self._note(no_unit_note(unit, reason))
            stamps = from_numbers(values, unit, cells=plain(cells[choice.index], column.style))
            first = first or stamps
            if other:
                self._compare_clocks(stamps, cells)
            self._count_lost(~stamps.valid, rows, -1, self._no_time(column))
            yield [self._channel(w, cells, replace(stamps, absolute=first.absolute), rows) for w in asked]
        self._note_rows(faults, count)
        self._tell_drift()
        self._tell_lost()

    def _last_times(self, text: TextFile) -> FloatArray:
        """Return the time at the end of the file: the length of a log shows its unit."""
        column = self._layout.columns[self._time.index]
        tail = text[max(len(text) - _TAIL, behind(text, self._layout.first_line - 1)) :].rstrip(b"\r\n")
        rows = rows_of(tail[tail.find(b"\n") + 1 :], self._layout, 0, is_cut=True)
        return numbers(rows.cells([column.index], where=str(self._path))[column.index], column.style).values

    def _channel(self, info: ChannelInfo, cells: dict[int, pl.Series], stamps: Stamps, rows: Rows) -> Channel:
        samples = numbers(cells[info.key], self._layout.columns[info.key].style)
        keep = stamps.valid & ~samples.blank
        if info.key not in self._counted:
            self._count_lost(samples.unreadable & keep, rows, info.key, (f'column "{info.path}": ', " not a number"))
        if keep.all():  # nearly always: all channels have one time
            return Channel(info, stamps.t_ns, samples.values, stamps.absolute)
        return Channel(info, stamps.t_ns[keep], samples.values[keep], stamps.absolute)

    def _read_time(self, cells: dict[int, pl.Series], rows: Rows) -> Stamps:
        column, choice = self._layout.columns[self._time.index], self._time
        stamps = self._as_stamps(column, cells[choice.index], None if choice.day is None else cells[choice.day])
        for note in stamps.notes:
            self._note(note)
        self._count_lost(~stamps.valid, rows, -1, self._no_time(column))
        return stamps

    def _numeric_clock(self) -> list[int]:
        """Return the second clock, if it can be read piece by piece."""
        other = self._time.other
        return [other] if other is not None and self._layout.columns[other].kind == "number" else []

    def _compare_clocks(self, stamps: Stamps, cells: dict[int, pl.Series]) -> None:
        """Compare the second clock of these rows with their stamps."""
        other = self._time.other
        if other is None:
            return
        column = self._layout.columns[other]
        try:
            if column.kind == "stamp":
                found = from_dates(cells[other], None, "stamp")
            else:
                found = from_numbers(numbers(cells[other], column.style).values, self._time.other_unit)
        except LogError:  # no date-times after all: not the clock that counts
            return
        self._drift.push(stamps.t_ns, found.t_ns, stamps.valid & found.valid)

    def _tell_drift(self) -> None:
        other = self._time.other
        names = [self._layout.columns[k].name for k in (self._time.index, other or 0)]
        drift = self._drift.finish(*(f'"{n}"' for n in names))
        if drift is not None:
            self._faults.drifts = [drift]
            self._note(drift_note(drift))

    def _no_time(self, column: Column) -> tuple[str, str]:
        return f'time column "{column.name}": ', " without a time, the row is left out"

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
            data = self._data if isinstance(self._data, bytes) else self._data[:]
            self._rows, self._data = find_rows(data, self._layout), b""
            self._note_rows(self._rows.faults, len(self._rows.lines))
        return self._rows

    def _count_lost(self, bad: BoolArray, rows: Rows, column: int, text: tuple[str, str]) -> None:
        """Note lost cells, with the text before and behind their number; a blank row has no time to lose."""
        if column < 0:
            bad = bad & ~rows.blank(bad)
        if bad.any():
            count, first = self._lost.get((column, text), (0, int(rows.lines[bad][0])))
            self._lost[column, text] = count + int(bad.sum()), first

    def _tell_lost(self) -> None:
        for (_, (before, behind_it)), (count, first) in sorted(self._lost.items()):
            self._faults.lost_samples += count
            cells = f"{count} cell{'s' if count > 1 else ''}"
            self._note(f"{before}{cells}{behind_it} (first at line {first})")
        self._lost = {}

    def _note_rows(self, faults: RowFaults, count: int) -> None:
        if faults.long:
            self._faults.lost_samples += len(faults.long)
            self._note(_lines(faults.long, "has more cells than the header and is left out"))
        if faults.short:
            is_habit = len(faults.short) > max(1, _HABIT * count)
            self._faults.lost_samples += 0 if is_habit else len(faults.short)
            self._note(_lines(faults.short, "has fewer cells than the header; the missing ones are blank"))
        if faults.empty:
            lines, nul = [line for line, _ in faults.empty], sum(n for _, n in faults.empty)
            rows = round(nul * self._count / max(self._size - nul, 1))  # as would have had room there
            self._faults.lost_samples += rows
            what = f"holds {nul} NUL bytes, as what was never written does: about {rows} rows are missing"
            self._note(_lines(lines, what))
        if faults.comments:
            self._note(_lines(faults.comments, "is a comment among the data and is left out"))
        if faults.cut_line:
            self._faults.truncated = True
            self._note(f"ends inside line {faults.cut_line}; its last cell is left out")
        if faults.doubtful_line:
            # many writers end no last line: that a number is short is a hint and no proof
            self._note(f"ends without a line's end; the last number of line {faults.doubtful_line} may be cut")

    def _note_columns(self) -> None:
        if self._layout.unproven:
            what = f'whether "{self._layout.unproven}" is a fraction or thousands is not proven; taken as a fraction'
            self._note(f"{what} ({csv_hint('decimal')})")
        for name in self._layout.twice:
            self._note(f'several columns are called "{name}": "{name}", "{name}#2" and so on in a map')
        for column in self._layout.columns:
            if column.kind == "text" and column.text_share < 1.0:
                share = f'{100 * column.text_share:.0f} % of its cells are text such as "{column.example[:40]}"'
                self._note(f'column "{column.name}" is left out: {share}')

    def close(self) -> None:
        """Release the text."""
        if isinstance(self._data, TextFile):
            self._data.close()
        self._data, self._rows = b"", None


def _field(column: Column) -> TableField:
    kind: FieldKind = "text" if column.kind == "blank" else column.kind
    return TableField(column.name, column.unit, kind)


def _is_channel(column: Column, time: TimeChoice) -> bool:
    return column.kind in ("number", "blank") and column.index != time.index


def _lines(lines: Sequence[int], what: str) -> str:
    more = f" (and {len(lines) - 1} more such lines)" if len(lines) > 1 else ""
    return f"line {lines[0]} {what}{more}"
