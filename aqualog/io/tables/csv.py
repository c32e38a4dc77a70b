"""CSV logs of any separator, decimal sign and encoding."""

from __future__ import annotations

import codecs
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray

from aqualog.core.errors import LogError
from aqualog.core.notation import SYMBOLS
from aqualog.core.records import BoolArray, Channel, ChannelInfo, FloatArray
from aqualog.io.reader import Part, ReadOptions, csv_hint, format_of, one_piece, part_of
from aqualog.io.tables.columns import (
    FieldKind,
    Stamps,
    TableField,
    TableReader,
    from_dates,
    from_numbers,
    judged_unit,
    no_unit_note,
)  # fmt: skip
from aqualog.io.tables.csv_cells import STYLES, numbers, plain
from aqualog.io.tables.csv_dialect import Column, Layout, find_layout, is_comment, lines_in, lines_of, split_line
from aqualog.io.tables.csv_text import TextFile, count_of, marks_of, open_text, read_text

__all__ = ["CsvReader"]


# Above this share of short rows the writer leaves out blank cells at the end; below it rows are damaged.
_HABIT = 0.1
_TAIL = 1 << 16  # [bytes]
Text = bytes | TextFile

PIECE, _ABOVE = 1 << 24, 20  # [bytes]; lines
_JOIN = "\x1f"  # unit separator: in no cell


@dataclass(frozen=True, slots=True)
class RowFaults:
    """Lines, counted from 1, that do not fit the header; `cut_line` is the last one if the file ends inside it.

    `doubtful_line` is the last one if it is whole, but may have lost the end of its last number. `empty` are lines with
    NUL bytes in them, as a page of a file that was never written has, each with their number.
    """

    short: tuple[int, ...] = ()
    long: tuple[int, ...] = ()
    comments: tuple[int, ...] = ()
    cut_line: int = 0
    doubtful_line: int = 0
    empty: tuple[tuple[int, int], ...] = ()

    def __add__(self, other: RowFaults) -> RowFaults:
        return RowFaults(
            self.short + other.short, self.long + other.long, self.comments + other.comments,
            self.cut_line or other.cut_line, self.doubtful_line or other.doubtful_line, self.empty + other.empty,
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Rows:
    """The rows below the header: `text` has one row per line from `start` on, `lines` (n,) are their line numbers.

    A text that is a file has no quotes; the library reads it by itself, so many lines of it: a log may still grow.
    """

    text: Text
    separator: str
    names: int
    lines: NDArray[np.int64]
    faults: RowFaults
    start: int = 0

    def cells(self, columns: Sequence[int], *, where: str, numbers: Collection[int] = ()) -> dict[int, pl.Series]:
        """Cells of these columns as text, null where blank; as numbers those of `numbers`, if all of them are.

        Raises
        ------
        LogError
            If the library finds another number of rows.
        """
        if not self.lines.size or not columns:
            return {k: pl.Series(f"c{k}", [], dtype=pl.String) for k in columns}
        try:
            frame = self._split(columns, numbers)
        except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
            if numbers:  # a cell is no number: its text shows what it is
                return self.cells(columns, where=where)
            reason = str(error).splitlines()[0]
            raise LogError(f"cannot be split into cells ({reason})", where=where, hint="check its quotes") from error
        if frame.height != len(self.lines):
            what = f"{frame.height} rows in {len(self.lines)} lines"
            raise LogError(what, where=where, expected="one row per line", hint="check its quotes")
        return {k: frame[f"c{k}"] for k in columns}

    def blank(self, which: BoolArray) -> BoolArray:
        """Those of some rows (n,) that hold nothing but separators, as spreadsheets leave them behind a table."""
        found = np.zeros_like(which)
        lines = self.text[self.start :].split(b"\n") if which.any() else []
        for k in np.flatnonzero(which):
            found[k] = not lines[k].replace(self.separator.encode(), b"").strip()
        return found

    def _split(self, columns: Sequence[int], numbers: Collection[int]) -> pl.DataFrame:
        text, is_held = self.text, isinstance(self.text, bytes)
        return pl.read_csv(
            text if isinstance(text, bytes) else text.path,
            n_rows=None if is_held else len(self.lines),
            glob=False,
            has_header=False,
            schema={f"c{k}": pl.Float64 if k in numbers else pl.String for k in range(self.names)},
            columns=sorted(set(columns)),
            separator=self.separator,
            quote_char='"' if is_held and self.separator != _JOIN and text.find(b'"', self.start) >= 0 else None,
            skip_lines=text[: self.start].count(b"\n"),
        )


def find_rows(data: Text, layout: Layout) -> Rows:
    """Find the rows below the header; see `rows_of`. A regular file is not held."""
    if isinstance(data, TextFile):
        start = behind(data, layout.first_line - 1)
        is_cut = data[-1:] != b"\n"
        marks = data.marks[len(marks_of(data[:start])) :] + b"\n" * is_cut
        lines = lines_of(marks, layout)
        if lines:
            return _regular(data, layout, layout.first_line, lines, is_cut=is_cut, start=start)
        data = data[:]
    is_cut, end = not data.endswith((b"\n", b"\r")), _end(data)
    body = data if data[end:] in (b"", b"\n", b"\r\n") else data[:end]  # a copy would take as long as reading the file
    return rows_of(body, layout, layout.first_line, is_cut=is_cut, start=behind(data, layout.first_line - 1))


def rows_of(body: bytes, layout: Layout, first_line: int, *, is_cut: bool, start: int = 0) -> Rows:
    """Rows of whole lines below the header; the last one may do without its end.

    `first_line`: number of the first of them in the file, which is at the place `start` of `body`. `is_cut`: whether
    the file ends behind them without the end of a line.

    Nearly all files are regular: every line has the separators of a whole row. Only such a file is passed to the
    library unchanged, because it silently drops the cells of longer rows and fills up shorter ones.
    """
    lines = None if b"\0" in body else lines_in(body, layout, start)
    if lines is not None:
        rows = _regular(body, layout, first_line, lines, is_cut=is_cut, start=start)
        if body.find(b'"', start) < 0 or _is_quoted_plainly(rows, body):
            return rows
    return _irregular(body[start : _end(body)], layout, first_line, is_cut=is_cut)


def _regular(body: Text, layout: Layout, first_line: int, count: int, *, is_cut: bool, start: int) -> Rows:
    numbers = first_line + np.arange(count, dtype=np.int64)
    doubtful = int(numbers[-1]) if is_cut and count and _ends_short(body, layout.separator) else 0
    return Rows(body, layout.separator, len(layout.columns), numbers, RowFaults(doubtful_line=doubtful), start)


def _ends_short(body: Text, separator: str) -> bool:
    """Whether the last cell is shorter than those above it: it may be half a number."""
    tail = body[-_TAIL:].split(b"\n")[-_ABOVE - 1 :]
    *above, last = (len(line.rpartition(separator.encode())[2].strip()) for line in tail)
    return len(above) == _ABOVE and 0 < last < min(above)


def behind(data: Text, lines: int) -> int:
    """Where the text goes on behind so many lines."""
    at = 0
    for _ in range(lines):
        at = data.find(b"\n", at) + 1
    return at


def bodies(text: TextFile, at: int, line: int) -> Iterator[tuple[bytes, int, bool]]:
    """Pieces of whole lines from a place on, each with the number of its first line and whether it is the last.

    As of the whole file, what ends no line at its end is no line.
    """
    rest, place, size = b"", at, len(text)
    for block in text.blocks(at, PIECE):
        place += len(block)
        data = rest + block
        last = place >= size
        end = _end(data) if last else _end(data[: data.rfind(b"\n") + 1])
        if not end and not last:
            rest = data
            continue
        body, rest = data[:end], data[end:]
        if body or last:
            yield body, line, last
        if not last:
            line += count_of(b"\n", body) + 1
            # the end of this body's last line
            rest = rest.removeprefix(b"\r").removeprefix(b"\n")


def _end(data: bytes) -> int:
    """Position behind the last character that ends no line; a file may be large, so it is not copied for this."""
    end = len(data)
    while end and data[end - 1] in b"\r\n":
        end -= 1
    return end


def _is_quoted_plainly(rows: Rows, body: bytes) -> bool:
    """Return whether the library also finds one row per line: then no quotes hold a separator or a line's end.

    A line with an odd quote is a row of its own to the library only if it is the last one. A quoted cell that goes on
    behind its quote is lost.
    """
    text = body[rows.start : _end(body)]
    octets = np.frombuffer(b"\n" + text + b"\n", dtype=np.uint8)
    quotes = np.flatnonzero(octets == ord('"'))
    before = np.searchsorted(quotes, np.flatnonzero(octets == ord("\n")))  # quotes up to the end of each line
    if (before % 2).any():
        return False
    around = np.frombuffer(f'\r\n"{rows.separator}'.encode(), dtype=np.uint8)
    if not (np.isin(octets[quotes - 1], around) | np.isin(octets[quotes + 1], around)).all():
        return False
    try:
        rows.cells([0], where="")
    except LogError:
        return False
    return True


def _irregular(body: bytes, layout: Layout, first_line: int, *, is_cut: bool) -> Rows:
    """Line by line: rows that fit are kept, the lines of the others remembered. No cell spans lines."""
    names = len(layout.columns)
    kept: list[list[str]] = []
    lines: list[int] = []
    short, long, comments, empty = [], [], [], []
    has_nul = b"\0" in body
    for line, text in enumerate(body.decode("utf-8").split("\n"), start=first_line):
        if has_nul and (count := text.count("\0")):
            empty.append((line, count))
        cells = _split(text, layout.separator)
        if not any(cells):
            continue
        if is_comment(text):
            comments.append(line)
        elif any(cells[names:]):
            long.append(line)
        else:
            if len(cells) < names:
                short.append(line)
            kept.append(cells[:names])
            lines.append(line)
    cut = short[-1] if is_cut and short and lines[-1] == short[-1] else 0
    if cut:
        kept[-1] = kept[-1][:-1]  # it may be half a number
    joined = "\n".join(_JOIN.join(c + [""] * (names - len(c))) for c in kept).encode()
    faults = RowFaults(tuple(short), tuple(long), tuple(comments), cut, empty=tuple(empty))
    return Rows(joined, _JOIN, names, np.array(lines, dtype=np.int64), faults)


def _split(text: str, separator: str) -> list[str]:
    if '"' in text:
        return [c.replace(_JOIN, " ").replace("\n", " ") for c in split_line(text, separator)]
    return [c.strip() for c in text.split(separator)]


class CsvReader(TableReader):
    """Reader of one CSV file.

    A blank cell is no sample of its channel; a cell that stands for a bad sample, or that cannot be understood, is NaN.
    Rows are kept in the order of the file, also if their times are not.
    """

    format = "csv"

    def __init__(self, path: Path, options: ReadOptions) -> None:
        super().__init__(path)
        self._rows: Rows | None = None
        self._counted: set[int] = set()
        self._lost: dict[tuple[int, tuple[str, str]], tuple[int, int]] = {}
        self._told = format_of(options.csv, path.name)
        self._data: bytes | TextFile = self._text()
        self._layout = find_layout(self._data, where=str(path), told=self._told)
        ends = self._data.lines if isinstance(self._data, TextFile) else count_of(b"\n", self._data)
        ends += self._data[-1:] != b"\n"
        self._count = max(0, ends - self._layout.first_line + 1)
        self._size = len(self._data)
        kinds: list[FieldKind] = ["text" if c.kind == "blank" else c.kind for c in self._layout.columns]
        columns = zip(self._layout.columns, kinds, strict=True)
        self._choose_time([TableField(c.name, c.unit, kind) for c, kind in columns], options)
        self._refuse_two_times(options)
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
            if c.kind in ("number", "blank") and c.index != self._time.index
        ]

    def read(self, wanted: Iterable[ChannelInfo]) -> list[Channel]:
        """Parse these columns only."""
        asked = list(wanted)
        rows = self._found_rows()
        needed = list({w.key for w in asked}.union(self._times if self._stamps is None else ()))
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
        if isinstance(self._data, TextFile) and self._data.is_large and numeric:
            return [part_of(asked, self._pieces(asked, self._data))]
        return [one_piece(asked, self.read)]

    def _plain(self, asked: Sequence[ChannelInfo]) -> frozenset[int]:
        """Columns that the library reads as numbers as they stand: three times faster than by their text."""
        return frozenset(w.key for w in asked if self._layout.columns[w.key].style == STYLES[0]) - {*self._times}

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
                if note := no_unit_note(unit, reason, column.name):
                    self._note(note)
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

    def _no_time(self, column: Column) -> tuple[str, str]:
        return f'time column "{column.name}": ', " without a time, the row is left out"

    def _as_stamps(self, column: Column, cells: pl.Series, day: pl.Series | None) -> Stamps:
        if column.kind in ("stamp", "clock"):
            with self._located():
                return from_dates(cells, day, column.kind)
        values, text = numbers(cells, column.style).values, plain(cells, column.style)
        return from_numbers(values, self._time.unit, cells=text, column=column.name)

    def _found_rows(self) -> Rows:
        if self._rows is None:
            self._rows = find_rows(self._data, self._layout)
            self._data = self._data if isinstance(self._data, TextFile) else b""
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
        for column in self._layout.columns:
            for remark in column.remarks:
                self._note(f'column "{column.name}"{remark}')
        for name in self._layout.twice:
            self._note(f'several columns are called "{name}": "{name}", "{name}#2" and so on in a map')
        for column in self._layout.columns:
            is_signal = column.unit or column.name in SYMBOLS or column.texts < column.sampled  # else a comment
            if column.kind == "text" and is_signal:
                share = f'{column.texts} of {column.sampled} cells looked at are text such as "{column.example[:40]}"'
                self._note(f'column "{column.name}" is left out: {share}')

    def close(self) -> None:
        """Release the text."""
        if isinstance(self._data, TextFile):
            self._data.close()
        self._data, self._rows = b"", None


def _lines(lines: Sequence[int], what: str) -> str:
    more = f" (and {len(lines) - 1} more such lines)" if len(lines) > 1 else ""
    return f"line {lines[0]} {what}{more}"
