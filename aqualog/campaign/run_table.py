"""Cells of a table of runs, as editors and spreadsheets of any country write it."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from aqualog.core.errors import ConfigError
from aqualog.io.user_file import read_small

__all__ = ["RunTable", "as_point", "decimal_sign", "read_table"]

LARGEST = 64 * 2**20  # [byte]
_SEPARATORS = (",", ";", "\t")
_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
_POINT = re.compile(r"[+-]?\d*\.\d+([eE][+-]?\d+)?")


@dataclass(frozen=True, slots=True)
class RunTable:
    """A table: heading, and rows as (line from 1, cells); cells are stripped, rows without any content left out."""

    heading: tuple[str, ...]
    line: int
    rows: tuple[tuple[int, tuple[str, ...]], ...]
    separator: str


def read_table(path: Path, *, key: str) -> RunTable:
    """Read a table whose heading names a column `key`.

    Commas, semicolons or tabs between the cells, UTF-8 with or without its mark, UTF-16 with its mark, or the Western
    European code page of older spreadsheets; a first line `sep=;` and separators behind the last cell are understood.

    Raises
    ------
    ConfigError
        If it cannot be read or is not a table.
    """
    what = "table of runs"
    data = read_small(path, what=what, expected="a CSV file", largest=LARGEST)
    if data.startswith(b"PK\x03\x04") or data.startswith(b"\xd0\xcf\x11\xe0"):
        raise ConfigError(f"{what} is a spreadsheet", where=str(path), expected="CSV", hint='"save as" CSV UTF-8')
    text = _text(data)
    if text is None:
        raise ConfigError(f"{what} is not text", where=str(path), expected="a CSV file")
    separator, skipped = _separator(text, key)
    reader = csv.reader(io.StringIO(text), delimiter=separator, strict=True)
    rows: list[tuple[int, tuple[str, ...]]] = []
    begin = 1
    try:
        for cells in reader:
            if begin > skipped and any(c.strip() for c in cells):
                rows.append((begin, tuple(c.strip() for c in cells)))
            begin = reader.line_num + 1
    except csv.Error as error:
        raise ConfigError(f"{what} is not CSV: {error}", where=f"{path}: line {begin}") from error
    if not rows:
        return RunTable((), 1, (), separator)
    line, heading = rows[0]
    width = max(i for i, name in enumerate(heading, 1) if name)
    # without empty cells behind the heading's last name
    body = tuple((n, cells if any(cells[width:]) else cells[:width]) for n, cells in rows[1:])
    return RunTable(heading[:width], line, body, separator)


def _text(data: bytes) -> str | None:
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        codecs: tuple[str, ...] = ("utf-16",)
    else:
        codecs = ("utf-8-sig", "cp1252")
    for codec in codecs:
        try:
            text = data.decode(codec)
        except UnicodeDecodeError:
            continue
        return None if "\0" in text else text
    return None


def _separator(text: str, key: str) -> tuple[str, int]:
    """The separator by which the heading names the key (else the most frequent one), and lines before the heading."""
    lines = text.splitlines()
    if lines and (told := re.fullmatch(r"sep=(.)", lines[0].strip(' \r\n"').lower())) and told[1] in _SEPARATORS:
        return told[1], 1
    first = next((line for line in lines if line.strip()), "")
    for separator in _SEPARATORS:
        if key in (cell.strip(' "') for cell in first.split(separator)):
            return separator, 0
    return max(_SEPARATORS, key=first.count), 0


def decimal_sign(cells: Iterable[str], separator: str) -> str:
    """Decimal sign of a table's numbers: `.`, `,`, or `?` where it cannot be determined.

    A comma is one where no number has a point. Between commas as separators, `1,234` may also mean a thousand.
    """
    with_comma = [c for c in cells if _COMMA.fullmatch(c) or _POINT.fullmatch(c)]
    points = any(_POINT.fullmatch(c) for c in with_comma)
    commas = [c for c in with_comma if _COMMA.fullmatch(c)]
    if not commas:
        return "."
    thousands = separator == "," and any(re.fullmatch(r"[+-]?\d{1,3},\d{3}", c) for c in commas)
    return "?" if points or thousands else ","


def as_point(cells: Sequence[str]) -> list[str]:
    """Numbers with a decimal comma written with a point; anything else as it is."""
    return [c.replace(",", ".") if _COMMA.fullmatch(c) else c for c in cells]
