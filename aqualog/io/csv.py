"""CSV logs: any separator, decimal sign and encoding, units in the header or in a row of their own."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
import polars as pl

from aqualog.errors import LogError
from aqualog.io.base import FaultLog, ReadOptions
from aqualog.io.csv_dialect import BAD_WORDS, Dialect, decode, find_dialect
from aqualog.io.table_time import TimeColumn, choose_time, numbers_to_ns, texts_to_ns
from aqualog.types import BoolArray, Channel, ChannelInfo, FileFaults, FloatArray, TimeArray

__all__ = ["CsvReader"]

_NEWLINE = 10


class CsvReader:
    """One CSV file.

    A blank cell is no sample of that channel in that row (files that merge several rates are full of them); a word
    such as `NaN` is a bad sample. Whatever cannot be understood is counted and noted with its line.
    """

    format = "csv"

    def __init__(self, path: Path, options: ReadOptions) -> None:
        self._name = path.name
        self._where = str(path)
        self._faults = FaultLog()
        try:
            raw = path.read_bytes()
        except OSError as error:
            raise LogError(f"cannot be read: {error.strerror}", where=self._where) from error
        text, note = decode(raw, where=path.name)
        if note:
            self._faults.notes.append(note)
        if "\n" not in text and "\r" in text:
            text = text.replace("\r", "\n")
        self._dialect: Dialect = find_dialect(text, where=self._where)
        names, units = self._dialect.names, self._dialect.units
        self._time: TimeColumn = choose_time(names, units, options, where=self._where)
        self._body = self._clean_body(text)
        self._rows = self._body.count(b"\n")
        if not self._rows:
            raise LogError("has a header and no rows", where=self._where)
        self._infos = tuple(
            ChannelInfo(name, name, units[i], self._rows, self._name, key=i)
            for i, name in enumerate(names)
            if self._dialect.numeric[i] and i not in self._time.columns
        )
        self._stamps: tuple[TimeArray, BoolArray, bool] | None = None

    def channels(self) -> Sequence[ChannelInfo]:
        """Columns of numbers, in file order."""
        return self._infos

    @property
    def faults(self) -> FileFaults:
        """Rows and cells that could not be used."""
        return self._faults.freeze()

    def read(self, wanted: Iterable[ChannelInfo]) -> list[Channel]:
        """Parse these columns."""
        wanted = list(wanted)
        table = self._table([*self._time.columns, *(w.key for w in wanted)])
        if self._stamps is None:
            self._stamps = self._read_time(table)
        t_ns, known, absolute = self._stamps
        channels = []
        for info in wanted:
            values, has_sample = self._numbers(table[f"c{info.key}"], info.name)
            use = known & has_sample
            channels.append(Channel(info, t_ns[use], values[use], absolute))
        return channels

    def close(self) -> None:
        """Nothing is kept open."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # --- rows --------------------------------------------------------------------------------------------------

    def _clean_body(self, text: str) -> bytes:
        """Data rows that all have as many cells as the header, each ended by a newline."""
        start = 0
        for _ in range(self._dialect.first_data_line - 1):
            start = text.find("\n", start) + 1
            if start == 0:
                return b""
        body = text[start:].encode("utf-8").replace(b"\r\n", b"\n")
        is_cut = bool(body) and not body.endswith(b"\n")
        if is_cut:
            body += b"\n"
        counts, starts, ends = _cells_per_line(body, self._dialect.separator)
        width = len(self._dialect.names)
        odd = np.flatnonzero(counts != width)
        if odd.size == 0:
            return body
        return self._mend(body, odd, counts, starts, ends, width, is_cut=is_cut)

    def _mend(
        self,
        body: bytes,
        odd: TimeArray,
        counts: TimeArray,
        starts: TimeArray,
        ends: TimeArray,
        width: int,
        *,
        is_cut: bool,
    ) -> bytes:
        parts: list[bytes] = []
        done = 0
        short: list[int] = []
        long: list[int] = []
        separator = self._dialect.separator.encode()
        for i in odd:
            line = body[starts[i] : ends[i]]
            parts.append(body[done : starts[i]])
            done = int(ends[i]) + 1
            if not line.strip(b" \t" + separator):
                continue
            if counts[i] == width + 1 and line.rstrip().endswith(separator):
                parts.append(line.rstrip()[: -len(separator)] + b"\n")  # a separator behind the last cell
            elif counts[i] > width:
                long.append(int(i))
            elif is_cut and i == counts.size - 1:
                # the last number of a row that breaks off may be half a number
                self._faults.truncated = True
                self._note(1, f"breaks off in line {self._line(int(i))}; that row is left out")
            else:
                short.append(int(i))
                parts.append(line + separator * (width - int(counts[i])) + b"\n")
        parts.append(body[done:])
        if short:
            self._note(
                0, f"{len(short)} rows have too few cells (first: line {self._line(short[0])}); the rest is blank"
            )
        if long:
            self._note(len(long), f"{len(long)} rows have too many cells (first: line {self._line(long[0])}); left out")
        return b"".join(parts)

    def _line(self, row: int) -> int:
        return self._dialect.first_data_line + row

    def _note(self, lost: int, text: str) -> None:
        self._faults.lost_samples += lost
        note = f"{self._name}: {text}"
        if note not in self._faults.notes:
            self._faults.notes.append(note)

    # --- cells -------------------------------------------------------------------------------------------------

    def _table(self, columns: Sequence[int]) -> pl.DataFrame:
        """These columns as text; text keeps every cell until it is known what it means."""
        try:
            return pl.read_csv(
                io.BytesIO(self._body),
                has_header=False,
                separator=self._dialect.separator,
                columns=sorted(set(columns)),
                new_columns=[f"c{i}" for i in sorted(set(columns))],
                infer_schema=False,
            )
        except pl.exceptions.PolarsError as error:
            raise LogError(f"rows cannot be read ({error})", where=self._where) from error

    def _read_time(self, table: pl.DataFrame) -> tuple[TimeArray, BoolArray, bool]:
        columns = [table[f"c{i}"] for i in self._time.columns]
        name = self._dialect.names[self._time.columns[0]]
        if len(columns) == 2:
            texts = pl.select(pl.concat_str(columns, separator=" ")).to_series()
        else:
            numbers, known = self._parse(columns[0])
            known &= np.isfinite(numbers)
            if known.mean() > 0.5:
                where = f"{self._name}:{name}"
                t_ns = np.zeros(numbers.size, dtype=np.int64)
                t_ns[known], absolute, note = numbers_to_ns(numbers[known], self._time.unit, where=where)
                if note:
                    self._note(0, note.removeprefix(f"{self._name}: "))
                self._count_bad_times(known)
                return t_ns, known, absolute
            texts = columns[0]
        found = texts_to_ns(texts.fill_null(""))
        if found is None:
            first = next((v for v in texts if v), "")
            raise LogError(
                f'time "{first}" in column {name} is neither a number nor a date',
                where=self._where,
                expected="seconds, or 2026-03-01T12:00:00.010",
                hint="[time] channel and unit in the signal map",
            )
        self._count_bad_times(found[1])
        return found

    def _count_bad_times(self, known: BoolArray) -> None:
        bad = np.flatnonzero(~known)
        if bad.size:
            self._note(int(bad.size), f"{bad.size} rows have no time (first: line {self._line(int(bad[0]))}); left out")

    def _numbers(self, cells: pl.Series, name: str) -> tuple[FloatArray, BoolArray]:
        """Values and where there is a sample; a cell that is no number is a NaN sample, counted."""
        values, has_sample = self._parse(cells)
        odd = np.flatnonzero(np.isnan(values) & has_sample)
        if odd.size:
            words = cells.gather(odd).str.strip_chars().str.to_lowercase()
            strange = odd[(~words.is_in(list(BAD_WORDS))).to_numpy()]
            if strange.size:
                line = self._line(int(strange[0]))
                text = str(cells[int(strange[0])])[:40]
                self._note(
                    int(strange.size), f'{strange.size} cells of {name} are no numbers (first: "{text}", line {line})'
                )
        return values, has_sample

    def _parse(self, cells: pl.Series) -> tuple[FloatArray, BoolArray]:
        values = cells.cast(pl.Float64, strict=False)
        blank = cells.is_null()
        unread = values.is_null() & ~blank
        if unread.any():
            text = cells.str.strip_chars()
            blank = blank | (text == "").fill_null(value=False)
            values = _decimal(text, self._dialect.separator).cast(pl.Float64, strict=False)
            logical = text.str.to_lowercase().replace_strict({"true": 1.0, "false": 0.0}, default=None)
            values = values.fill_null(logical.cast(pl.Float64))
        has_sample = (~blank).to_numpy()
        return values.fill_null(float("nan")).to_numpy().astype(np.float64), has_sample


def _decimal(text: pl.Series, separator: str) -> pl.Series:
    """Numbers of one column with a decimal point and no thousands separators."""
    if separator == ",":
        has_thousands = text.str.contains(r"\d,\d{3}(\D|$)").any()
        return text.str.replace_all(",", "") if has_thousands else text
    if text.str.contains(",", literal=True).any():
        last_is_point = text.str.contains(r",\d{3}.*\.\d*$").any()
        if last_is_point:
            return text.str.replace_all(",", "", literal=True)
        return text.str.replace_all(".", "", literal=True).str.replace_all(",", ".", literal=True)
    return text


def _cells_per_line(body: bytes, separator: str) -> tuple[TimeArray, TimeArray, TimeArray]:
    """Number of cells, begin and end of every line."""
    data = np.frombuffer(body, dtype=np.uint8)
    ends = np.flatnonzero(data == _NEWLINE)
    starts = np.concatenate([[0], ends[:-1] + 1]) if ends.size else ends
    if b'"' in body:
        rows = csv.reader(io.StringIO(body.decode("utf-8")), delimiter=separator)
        counts = np.array([len(r) for r in rows], dtype=np.int64)
        if counts.size == ends.size:
            return counts, starts, ends
        raise LogError("has line breaks inside quoted cells", expected="one row a line")
    at = np.flatnonzero(data == ord(separator))
    counts = np.searchsorted(at, ends) - np.searchsorted(at, starts) + 1
    return counts.astype(np.int64), starts, ends
