"""Split the text of a CSV file into the cells of some of its columns, with the line of every row."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from aqualog.core.errors import LogError
from aqualog.core.records import BoolArray
from aqualog.io.tables.csv_dialect import Layout, is_comment, split_line
from aqualog.io.tables.csv_text import TextFile

__all__ = ["RowFaults", "Rows", "behind", "bodies", "find_rows", "rows_of"]

Text = bytes | TextFile

PIECE = 1 << 24  # [bytes]
_TAIL, _ABOVE = 1 << 16, 20  # [bytes], lines
_JOIN = "\x1f"  # unit separator: in no cell
_ALL, _COMMENT = bytes(range(256)), b"#%!/"


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
    """The rows below the header: `text` has one row per line, `lines` (n,) are their line numbers in the file."""

    text: bytes
    separator: str
    names: int
    lines: NDArray[np.int64]
    faults: RowFaults

    def cells(self, columns: Sequence[int], *, where: str, numbers: Collection[int] = ()) -> dict[int, pl.Series]:
        """Cells of these columns as text, null where blank; as numbers those of `numbers`, if all of them are.

        Raises
        ------
        LogError
            If the library finds another number of rows.
        """
        if not self.text or not columns:
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
        found = np.zeros(len(self.lines), dtype=np.bool_)
        if which.any():
            lines = self.text.split(b"\n")
            separator = self.separator.encode()
            for k in np.flatnonzero(which):
                found[k] = not lines[k].replace(separator, b"").strip()
        return found

    def _split(self, columns: Sequence[int], numbers: Collection[int]) -> pl.DataFrame:
        return pl.read_csv(
            self.text,
            has_header=False,
            schema={f"c{k}": pl.Float64 if k in numbers else pl.String for k in range(self.names)},
            columns=sorted(set(columns)),
            separator=self.separator,
            quote_char='"' if self.separator != _JOIN and b'"' in self.text else None,
        )


def find_rows(data: bytes, layout: Layout) -> Rows:
    """Find the rows below the header; see `rows_of`."""
    body = data[behind(data, layout.first_line - 1) : _end(data)]
    return rows_of(body, layout, layout.first_line, is_cut=not data.endswith((b"\n", b"\r")))


def rows_of(body: bytes, layout: Layout, first_line: int, *, is_cut: bool) -> Rows:
    """Rows of lines below the header.

    Parameters
    ----------
    body : bytes
        Whole lines, without the end of the last one.
    layout : Layout
    first_line : int
        Number of the first of them in the file.
    is_cut : bool
        Whether the file ends behind them without the end of a line.

    Nearly all files are regular: every line has the separators of a whole row. Only such a file is passed to the
    library unchanged, because it silently drops the cells of longer rows and fills up shorter ones.
    """
    lines = None if b"\0" in body else _regular(body, layout)
    if lines is not None:
        numbers = first_line + np.arange(lines, dtype=np.int64)
        doubtful = int(numbers[-1]) if is_cut and lines and _ends_short(body, layout.separator) else 0
        rows = Rows(body, layout.separator, len(layout.columns), numbers, RowFaults(doubtful_line=doubtful))
        if b'"' not in body or _is_quoted_plainly(rows):
            return rows
    return _irregular(body, layout, first_line, is_cut=is_cut)


def _ends_short(body: bytes, separator: str) -> bool:
    """Whether the last cell is shorter than those above it: of half a number the rest is missing."""
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
            line += body.count(b"\n") + 1
            # the end of this body's last line
            rest = rest.removeprefix(b"\r").removeprefix(b"\n")


def _end(data: bytes) -> int:
    """Position behind the last character that ends no line; a file may be large, so it is not copied for this."""
    end = len(data)
    while end and data[end - 1] in b"\r\n":
        end -= 1
    return end


def _regular(body: bytes, layout: Layout) -> int | None:
    """Number of lines if each has exactly the separators of a whole row and none is a comment."""
    if not body:
        return 0
    separator = layout.separator.encode()
    if layout.width > len(layout.columns):
        return None
    signs = body.translate(None, _ALL.translate(None, separator + b"\n" + _COMMENT)) + b"\n"
    comments = [sign for sign in _COMMENT if sign in signs and sign != separator[0]]
    if comments:
        if body[0] in comments or any(b"\n%c" % sign in body for sign in comments):
            return None
        signs = signs.translate(None, bytes(comments))
    row = separator * (layout.width - 1) + b"\n"
    lines, rest = divmod(len(signs), len(row))
    return lines if not rest and signs == row * lines else None


def _is_quoted_plainly(rows: Rows) -> bool:
    """Return whether the library also finds one row per line: then no quotes hold a separator or a line's end.

    A line with an odd quote is a row of its own to the library only if it is the last one. A quoted cell that goes on
    behind its quote is lost.
    """
    octets = np.frombuffer(b"\n" + rows.text + b"\n", dtype=np.uint8)
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
