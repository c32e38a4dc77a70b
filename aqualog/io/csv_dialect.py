"""How a CSV is written: encoding, separator, decimal sign, header, units row. Found by trying, accepted by proof."""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

from aqualog.errors import LogError
from aqualog.io.table_time import split_unit
from aqualog.units import is_unit

__all__ = ["BAD_WORDS", "Dialect", "decode", "find_dialect"]

_SEPARATORS = (",", ";", "\t", "|")
_SAMPLE_ROWS = 300
_HEADER_LIMIT = 100  # a header stands within the first so many lines
_POINT = re.compile(r"^\s*[+-]?(\d[\d,]*\.?\d*|\.\d+)([eE][+-]?\d+)?\s*$")
_COMMA = re.compile(r"^\s*[+-]?(\d[\d.]*,?\d*|,\d+)([eE][+-]?\d+)?\s*$")
_TIME_TEXT = re.compile(r"^\s*(\d{4}[-/]\d\d[-/]\d\d|\d\d\.\d\d\.\d{4}|\d{1,2}:\d\d:\d\d)")
# What loggers write for "no value": a sample that is bad, not a column of text.
BAD_WORDS = frozenset({"nan", "-nan", "inf", "-inf", "+inf", "-", "--", "null", "none", "n/a", "#n/a", "?", "#value!"})
_LOGICAL = frozenset({"true", "false"})


@dataclass(frozen=True, slots=True)
class Dialect:
    """How the file is written. Line numbers count from 1."""

    separator: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    numeric: tuple[bool, ...]
    header_line: int
    first_data_line: int


def decode(raw: bytes, *, where: str) -> tuple[str, str]:
    """Text of a file and the note on its encoding: byte order mark, else strict UTF-8, else Windows-1252.

    Raises
    ------
    LogError
        If it is binary.
    """
    for mark, name in (
        (codecs.BOM_UTF8, "utf-8-sig"),
        (codecs.BOM_UTF16_LE, "utf-16"),
        (codecs.BOM_UTF16_BE, "utf-16"),
    ):
        if raw.startswith(mark):
            try:
                return raw.decode(name), ""
            except UnicodeDecodeError as error:
                raise LogError(f"is not the {name} its first bytes say", where=where) from error
    if b"\0" in raw[:65536]:
        raise LogError("holds zero bytes", where=where, expected="text (UTF-16 needs its byte order mark)")
    try:
        return raw.decode("utf-8"), ""
    except UnicodeDecodeError:
        note = f"{where}: not UTF-8, read as Windows-1252"
        try:
            return raw.decode("cp1252"), note
        except UnicodeDecodeError:
            return raw.decode("latin-1"), note.replace("Windows-1252", "Latin-1")


def find_dialect(text: str, *, where: str) -> Dialect:
    """Find separator, header and units row.

    A separator is accepted if it splits the sampled rows alike and at least two columns (or one beside a column of
    times) are numbers in 99 % of their cells.

    Raises
    ------
    LogError
        If none is, with what was tried.
    """
    lines = [line.rstrip("\r") for line in islice(_lines(text), _HEADER_LIMIT + _SAMPLE_ROWS)]
    best: tuple[int, Dialect] | None = None
    for separator in _SEPARATORS:
        found = _try(lines, separator)
        if found is not None and (best is None or found[0] > best[0]):
            best = found
    if best is None:
        raise LogError(
            "is not a table of numbers that aqualog can read",
            where=where,
            expected="a header line, then rows split by comma, semicolon, tab or |",
            hint="check separator and header; a file without a header needs one",
        )
    return best[1]


def _lines(text: str) -> Iterator[str]:
    start = 0
    while start < len(text):
        end = text.find("\n", start)
        if end < 0:
            end = len(text)
        yield text[start:end]
        start = end + 1


def _try(lines: Sequence[str], separator: str) -> tuple[int, Dialect] | None:
    rows = [next(csv.reader([line], delimiter=separator), []) for line in lines]
    width = _common_width(rows)
    if width < 2:
        return None
    for header in range(min(len(rows), _HEADER_LIMIT)):
        if not _is_header(rows[header], width):
            continue
        first = header + 1
        units: list[str] = []
        if first < len(rows) and _is_units_row(rows[first]):
            units = [c.strip().strip("[]()") for c in rows[first]]
            first += 1
        body = [r for r in rows[first : first + _SAMPLE_ROWS] if any(c.strip() for c in r)]
        numeric, proven, has_times = _numeric_columns(body, width, separator)
        if proven + has_times < 2 or not proven:
            continue
        parts = [split_unit(c) for c in rows[header][:width]]
        names = _unique([n or f"column {i + 1}" for i, (n, _) in enumerate(parts)])
        padded = [*units, *[""] * (width - len(units))]
        merged = tuple(u or ("" if p in ("", "-") else p) for (_, u), p in zip(parts, padded, strict=False))
        return proven, Dialect(separator, names, merged, tuple(numeric), header + 1, first + 1)
    return None


def _common_width(rows: Sequence[Sequence[str]]) -> int:
    widths = [len(r) for r in rows if any(c.strip() for c in r)]
    return max(set(widths), key=lambda w: (widths.count(w), w)) if widths else 0


def _is_header(row: Sequence[str], width: int) -> bool:
    cells = [c.strip() for c in row]
    if len(cells) not in (width, width - 1) and not (len(cells) == width + 1 and not cells[-1]):
        return False
    filled = [c for c in cells if c]
    words = [c for c in filled if not _POINT.match(c) and not _TIME_TEXT.match(c) and c.lower() not in BAD_WORDS]
    return len(filled) >= 2 and len(words) >= 0.8 * len(filled) and not cells[0].startswith(("#", "//", "%"))


def _is_units_row(row: Sequence[str]) -> bool:
    cells = [c.strip().strip("[]()") for c in row]
    filled = [c for c in cells if c and c != "-"]
    known = [c for c in filled if is_unit(c)]
    return len(known) >= max(1.0, 0.5 * len(filled)) and not any(_POINT.match(c) and c != "1" for c in filled)


def _numeric_columns(body: Sequence[Sequence[str]], width: int, separator: str) -> tuple[list[bool], int, bool]:
    numeric, proven, times = [], 0, False
    for i in range(width):
        cells = [r[i].strip() for r in body if len(r) > i and r[i].strip()]
        good = sum(_is_number(c, separator) for c in cells)
        # a column that is blank in the sample may hold a slow signal: it is kept, and proves nothing
        numeric.append(good >= 0.99 * len(cells))
        proven += numeric[-1] and bool(cells)
        times |= bool(cells) and all(_TIME_TEXT.match(c) for c in cells)
    return numeric, proven, times


def _is_number(cell: str, separator: str) -> bool:
    lower = cell.lower()
    if lower in BAD_WORDS or lower in _LOGICAL:
        return True
    return bool(_POINT.match(cell) and (separator == "," or "," not in cell)) or bool(
        separator != "," and _COMMA.match(cell)
    )


def _unique(names: Sequence[str]) -> tuple[str, ...]:
    """Second and later columns of one name become `name#2`, so that none is lost and none is taken for the other."""
    seen: dict[str, int] = {}
    result = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        result.append(name if seen[name] == 1 else f"{name}#{seen[name]}")
    return tuple(result)
