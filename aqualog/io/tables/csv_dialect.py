"""Find how a CSV file is written: separator, decimal sign, header, units, first line of data.

Every separator is tried with every possible header line, and the cells below it decide. A reading counts as proven
only if at least two columns hold (nearly) nothing but numbers, times and blanks.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import takewhile
from typing import Literal

from aqualog.core.errors import LogError
from aqualog.core.units import is_unit, parse_unit
from aqualog.io.reader import CsvFormat, csv_hint
from aqualog.io.tables.columns import split_unit, unique_names
from aqualog.io.tables.csv_cells import STYLES, Style, is_bad, is_clock, is_date, is_number, is_stamp
from aqualog.io.tables.csv_text import TextFile

__all__ = ["Column", "ColumnKind", "Layout", "find_layout", "is_comment", "lines_in", "lines_of", "split_line"]

ColumnKind = Literal["number", "stamp", "date", "clock", "blank", "text"]
Row = list[str]

_SEPARATORS = (",", ";", "\t", "|")
_HEAD_LINES = 600
_HEAD_BYTES = 1 << 21
_BODY_ROWS = 300
_SPREAD = 12  # places behind the head where rows are looked at
_SPREAD_ROWS = 20
_COMMENTS = ("#", "%", "//", "!")
_ALL, _COMMENT = bytes(range(256)), b"#%!/"
_SHOWN = {"\t": "tab", ",": "comma", ";": "semicolon", "|": "bar"}
_HINT = (
    f"{csv_hint('separator', 'decimal', 'encoding')}; or export it with one header line (name [unit]), one separator "
    "and one decimal sign"
)
_NONE_TOLD = CsvFormat()
_GROUP = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}", re.ASCII)  # as good a fraction as it is thousands


@dataclass(frozen=True, slots=True)
class Column:
    """One column by its header and its sampled cells; `texts` of `sampled` filled ones are no value.

    `name` is unique in the file, `header` what stands above it. `is_grouped`: other columns show that its sign is one
    between thousands. `other_unit`: what the row of units says, where the header says something else.
    """

    index: int
    name: str
    unit: str
    style: Style
    kind: ColumnKind
    texts: int = 0
    example: str = ""
    header: str = ""
    sampled: int = 0
    is_grouped: bool = False
    other_unit: str = ""

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a reader should know of it; each goes on behind its name."""
        out = []
        if self.is_grouped:
            what = f': "{self.style.thousands}" is between thousands, since other columns'
            out.append(f"{what} have the other sign before fractions ({csv_hint('decimal')})")
        if self.other_unit:
            what = f" is taken in {self.unit}, as its header says; the row of units says {self.other_unit}"
            out.append(f"{what} (a unit in the signal map decides)")
        return tuple(out)


@dataclass(frozen=True, slots=True)
class Layout:
    """The layout that is needed to read the cells.

    `width` is the number of cells in a whole row: that of the header, or more if every row ends with separators.
    `first_line` counts from 1; `twice` are names of several columns; `unproven` is a cell that may be a fraction or
    thousands, if no cell of the file decides.
    """

    separator: str
    columns: tuple[Column, ...]
    width: int
    first_line: int
    twice: tuple[str, ...] = ()
    unproven: str = ""


@dataclass(frozen=True, slots=True)
class _Candidate:
    layout: Layout
    proven: int

    @property
    def score(self) -> tuple[float, int]:
        return self.proven / len(self.layout.columns), self.proven


def split_line(line: str, separator: str) -> Row:
    """Cells of one line, without the blanks around them."""
    if '"' not in line:
        return [c.strip() for c in line.split(separator)]
    try:
        cells = next(csv.reader([line], delimiter=separator), [])
    except csv.Error:  # a cell beyond the size limit, or a NUL
        cells = line.split(separator)
    return [c.strip() for c in cells]


def is_comment(line: str) -> bool:
    """Whether a line is a comment."""
    return line.lstrip().startswith(_COMMENTS)


def find_layout(data: bytes | TextFile, *, where: str, told: CsvFormat = _NONE_TOLD) -> Layout:
    """Find and prove the layout of a CSV file.

    Parameters
    ----------
    data : bytes or TextFile
        The whole file in UTF-8.
    where : str
        Named in an error.
    told : CsvFormat
        Layout given by the user: no other is tried.

    Raises
    ------
    LogError
        If no reading of the file is proven; the message says what was tried.
    """
    head, spread = _sample(data)
    if len(head) == 1 and len(data) > _HEAD_BYTES:
        raise LogError(
            f"its first line is longer than {_HEAD_BYTES} bytes", where=where, expected="a header", hint=_HINT
        )
    used = [s for s in ([told.separator] if told.separator else _SEPARATORS) if sum(s in line for line in head) >= 2]
    if not used and told.separator:
        sign = _SHOWN.get(told.separator, told.separator)
        what = f'has no "{sign}", by which the map says that its cells are separated'
        raise LogError(what, where=where, hint="name another separator, or none")
    if not used and sum(bool(line.strip()) for line in head) == 1:
        hint = "check whether the logger has recorded anything"
        raise LogError("has one line only", where=where, expected="a header and rows of data", hint=hint)
    if not used:
        raise LogError("has one column only", where=where, expected="a time and at least one signal", hint=_HINT)
    candidates, reasons = [], []
    for separator in used:
        found = _with_separator(head, spread, separator, told.decimal)
        if isinstance(found, str):
            reasons.append(f"{_SHOWN.get(separator, separator)}: {found}")
        else:
            candidates.append(found)
    if candidates:
        return max(candidates, key=lambda c: c.score).layout
    raise _unproven(reasons, where)


def _unproven(reasons: Sequence[str], where: str) -> LogError:
    if any("no header" in r for r in reasons):
        what, hint = "has no header line", "put one line such as t [s],omega_fl [rad/s] above the data"
    else:
        what, hint = "is not a table that can be understood", _HINT
    tried = "; ".join(reasons)
    return LogError(f"{what} (tried {tried})", where=where, expected="a header and columns of numbers", hint=hint)


def _sample(data: bytes | TextFile) -> tuple[list[str], list[str]]:
    """Lines of the head, and whole lines from places spread over the rest."""
    head = data[:_HEAD_BYTES]
    is_whole = len(head) == len(data)
    lines = head.split(b"\n", _HEAD_LINES)
    rest = len(lines) > _HEAD_LINES or not is_whole
    if rest and len(lines) > 1:
        lines.pop()
    start = sum(len(line) + 1 for line in lines)
    spread = list(_spread(data, start)) if rest else []
    return [_text(line) for line in lines], [_text(line) for line in spread]


def _spread(data: bytes | TextFile, start: int) -> Iterator[bytes]:
    step = (len(data) - start) // _SPREAD
    for k in range(_SPREAD if step else 0):
        begin = data.find(b"\n", start + k * step) + 1
        if begin:
            yield from data[begin : begin + (1 << 16)].split(b"\n", _SPREAD_ROWS)[:-1]


def _text(line: bytes) -> str:
    return line.decode("utf-8", errors="replace").rstrip("\r")


def _with_separator(head: Sequence[str], spread: Sequence[str], separator: str, decimal: str) -> _Candidate | str:
    """Return the best reading with this separator, or the reason why no reading is possible."""
    rows = [split_line(line, separator) for line in head]
    reason = ""
    for k, row in enumerate(rows):
        if not _is_header_like(row):
            continue
        header, units, body_at = _header_block(head, rows, k)
        body = [r for line, r in zip(head[body_at:], rows[body_at:], strict=True) if any(r) and not is_comment(line)]
        body = body[:_BODY_ROWS] + [split_line(line, separator) for line in spread if line and not is_comment(line)]
        is_data = (k for k in range(body_at, len(rows)) if any(rows[k]) and not is_comment(head[k]))
        found = _prove(header, units, body, separator, next(is_data, body_at) + 1, decimal)
        if not isinstance(found, str):
            return found
        reason = reason or found
    return reason or "no header line above the data"


def _is_header_like(row: Row) -> bool:
    """Whether a row names at least two columns and holds no number and no time."""
    filled = [c for c in row if c and not is_bad(c)]
    if len(filled) < 2:
        return False
    return not any(any(is_number(c, s) for s in STYLES[:2]) or is_stamp(c) or is_clock(c) or is_date(c) for c in filled)


def _is_units(row: Row) -> bool:
    """Whether a row holds units: most of its cells are known spellings, at least one of them a word."""
    filled = [_bare(c) for c in row if c and c != "-"]
    known = [c for c in filled if is_unit(c)]
    return len(known) * 2 > len(filled) and any(not c.isdigit() for c in known)


def _bare(cell: str) -> str:
    return cell.strip("[](){} ")


def _header_block(head: Sequence[str], rows: Sequence[Row], first: int) -> tuple[Row, Row, int]:
    """Names, units and the index of the line behind them.

    Above the data there may stand several lines of words (groups, names, units, types): the units are known by their
    spelling and the names stand above them; without units the last line is that of the names. A comment sign before
    the only line of names is dropped, as numpy writes it.
    """
    block = [first]
    for k in range(first + 1, len(rows)):
        if _is_header_like(rows[k]) or (_is_units(rows[k]) and not is_comment(head[k])):
            block.append(k)
        elif any(rows[k]) and not is_comment(head[k]):
            break
    names = [k for k in block if not is_comment(head[k])] or block[-1:]
    units_at = next((k for k in names[1:] if _is_units(rows[k])), None)
    if units_at is None:
        first_name, *others = rows[names[-1]]
        sign = next((c for c in _COMMENTS if first_name.startswith(c)), "")
        return [first_name.removeprefix(sign).strip(), *others], [], names[-1] + 1
    return rows[names[names.index(units_at) - 1]], [_bare(c) if c != "-" else c for c in rows[units_at]], names[-1] + 1


def _prove(
    header: Row, units: Row, body: Sequence[Row], separator: str, first_line: int, decimal: str
) -> _Candidate | str:
    names = _trimmed(header)
    if not body:
        return "a header, but no data below it"
    used = [len(_trimmed(r)) for r in body]
    long = sum(u > len(names) for u in used)
    if long > max(1, len(body) // 100) or long == len(body):
        is_decimal = separator == "," and max(used) <= 2 * len(names)
        return f"{len(names)} names, but {max(used)} cells in a row{', as decimal commas make' if is_decimal else ''}"
    if not any(len(r) >= len(names) for r in body):
        return f"{len(names)} names, but at most {max(map(len, body))} cells in a row"
    columns, unproven = _columns(names, units, body, separator, decimal)
    proven = sum(c.kind not in ("text", "blank") for c in columns)
    sound = sum(c.kind != "text" for c in columns)
    if proven < 1 or sound < 2:
        return f"{proven} of {len(names)} columns hold numbers in 99 % of their cells"
    twice = tuple(n for n, count in Counter(split_unit(h)[0] for h in names).items() if n and count > 1)
    widths = [len(r) for r in body]
    width = max(len(names), max(set(widths), key=widths.count))
    return _Candidate(Layout(separator, columns, width, first_line, twice, unproven), proven)


def _trimmed(row: Row) -> Row:
    blank = sum(1 for _ in takewhile(lambda c: not c, reversed(row)))
    return row[: len(row) - blank]


def _columns(
    names: Row, units: Row, body: Sequence[Row], separator: str, decimal: str
) -> tuple[tuple[Column, ...], str]:
    """Return kind and decimal sign of each column; a name or a cell that shows neither follows the rest of the file.

    The last value is a cell that may be a fraction or thousands, if no cell of the file decides.
    """
    cells = [_Cells(tuple(r[k] for r in body if k < len(r) and r[k])) for k in range(len(names))]
    order = _told_styles(cells, decimal) if decimal else _preferred(cells, separator)
    # an apostrophe stands before a name only to keep a spreadsheet from running it
    proven = "" if decimal else _proven_sign(cells, order)
    split = [split_unit(n[1:] if n[:1] == "'" and n[1:2] in ("=", "+", "-", "@", "\t") else n) for n in names]
    paths = unique_names([name for name, _ in split])
    below = units + [""] * len(names)
    columns = []
    for k, column in enumerate(cells):
        alone = _style(column, order)
        style = _with_thousands(column, alone, proven)
        kind = _kind(column, style)
        header, unit = split[k]
        count, other = len(column.cells), below[k] if _differ(unit, below[k]) else ""
        columns.append(
            Column(k, paths[k], unit or below[k], style, *kind, header or paths[k], count, style != alone, other)
        )
    foreign = [c.cells[0] for c, own in zip(cells, columns, strict=True) if _is_foreign(c, own, proven)]
    if foreign:
        return tuple(columns), foreign[0]
    return tuple(columns), "" if decimal or order[0].thousands else _unproven_cell(cells, columns)


def _differ(one: str, other: str) -> bool:
    """Whether two known spellings mean different units."""
    return is_unit(one) and is_unit(other) and parse_unit(one) != parse_unit(other)


def _told_styles(columns: Sequence[_Cells], decimal: str) -> tuple[Style, ...]:
    """The styles with a decimal sign, those with thousands only where these are proven."""
    plain, grouped = (next(s for s in STYLES if s.decimal == decimal and bool(s.thousands) == t) for t in (False, True))
    return (grouped, plain) if any(c.explained(grouped) > c.explained(plain) for c in columns) else (plain,)


def _unproven_cell(cells: Sequence[_Cells], columns: Sequence[Column]) -> str:
    """Return a cell that may be a fraction or thousands, if all cells with a decimal sign are such."""
    signed = [
        x for c, column in zip(cells, columns, strict=True) if column.kind == "number"
        for x in c.cells if column.style.decimal in x
    ]  # fmt: skip
    return signed[0] if signed and all(map(_GROUP.fullmatch, signed)) else ""


class _Cells:
    """The sampled filled cells of a column, each judged once in each style."""

    def __init__(self, cells: tuple[str, ...]) -> None:
        self.cells = cells
        self._fits: dict[Style, list[bool]] = {}

    def fits(self, style: Style) -> list[bool]:
        """Whether each cell is a number in this style."""
        if style not in self._fits:
            self._fits[style] = [is_number(c, style) for c in self.cells]
        return self._fits[style]

    def explained(self, style: Style) -> int:
        """How many cells are numbers in this style."""
        return sum(self.fits(style))

    def is_all(self, style: Style) -> bool:
        """Whether every cell is a number in this style."""
        return all(self.fits(style))

    def proves(self, style: Style) -> bool:
        """Whether more than a stray cell cannot be a number but with this sign between thousands."""
        if any(self.is_all(s) for s in STYLES[:2]):
            return False
        each = zip(self.fits(style), self.fits(STYLES[0]), self.fits(STYLES[1]), strict=True)
        return sum(fits and not (point or comma) for fits, point, comma in each) > len(self.cells) // 100


def _preferred(columns: Sequence[_Cells], separator: str) -> tuple[Style, ...]:
    """Return the possible styles, those first that the file as a whole supports: they decide where a column does not.

    A group of three behind a sign may be a fraction or thousands. Only cells with both signs, or with two groups, prove
    thousands; a damaged cell among hundreds does not. Where commas separate the cells, a comma in quotes marks
    thousands rather than decimals.
    """
    by_point, by_comma = STYLES[:2]
    comma = sum(not c.is_all(by_point) and c.explained(by_comma) > c.explained(by_point) for c in columns)
    is_comma = comma > 0 and comma > sum(c.explained(by_point) > c.explained(by_comma) for c in columns)
    plain: tuple[Style, ...] = (by_comma, by_point) if is_comma else (by_point, by_comma)
    if separator == "," and plain[0] == STYLES[0]:
        plain = (STYLES[0], STYLES[3], STYLES[1])
    proven = [s for s in STYLES if s.thousands and any(c.proves(s) for c in columns)]
    return tuple(dict.fromkeys((*proven, *plain)))


def _style(column: _Cells, order: Sequence[Style]) -> Style:
    """The style that explains the most cells of a column, the first of equals."""
    if not order[0].thousands and column.is_all(order[0]):
        return order[0]
    usable = [s for s in order if not (s.thousands and any(_has_leading_zero(c, s.thousands) for c in column.cells))]
    return max(usable, key=column.explained)


def _proven_sign(columns: Sequence[_Cells], order: Sequence[Style]) -> str:
    """The file's decimal sign where a column shows it by fractions that are no groups of three; else empty."""
    plain = next(s for s in order if not s.thousands)
    found = (x for c in columns if c.is_all(plain) for x in c.cells if plain.decimal in x)
    return plain.decimal if any(not _GROUP.fullmatch(x) for x in found) else ""


def _with_thousands(column: _Cells, style: Style, proven: str) -> Style:
    """The style with thousands for a column of numbers in groups of three by the sign that is not the file's decimal
    sign, such as `1.570` beside `790` where others have `0,5`."""
    if not proven or style.thousands or style.decimal == proven:
        return style
    grouped = next(s for s in STYLES if s.decimal == proven and s.thousands == style.decimal)
    signed = [c for c in column.cells if style.decimal in c]
    if len(signed) == len(column.cells):  # all may be fractions
        return style
    fits = bool(signed) and column.is_all(grouped) and not any(_has_leading_zero(c, grouped.thousands) for c in signed)
    return grouped if fits else style


def _is_foreign(cells: _Cells, column: Column, proven: str) -> bool:
    """Whether all cells of a column are groups of three by a sign that is not the file's decimal sign."""
    is_other = bool(proven) and column.kind == "number" and column.style.decimal != proven
    return is_other and all(_GROUP.fullmatch(c) for c in cells.cells)


def _has_leading_zero(cell: str, thousands: str) -> bool:
    """Whether a cell such as `0.250` is no group of thousands."""
    whole, sign, _ = cell.lstrip("+-").partition(thousands)
    return bool(sign) and whole.startswith("0")


def _kind(column: _Cells, style: Style) -> tuple[ColumnKind, int, str]:
    """Kind of a column by its filled cells, the number of cells that do not fit, and one of these."""
    cells = column.cells
    if not cells:
        return "blank", 0, ""
    texts = [c for c, fits in zip(cells, column.fits(style), strict=True) if not fits and not is_bad(c)]
    allowed = max(int(len(cells) >= 3), len(cells) // 100)
    if len(texts) <= allowed and len(texts) < len(cells):
        return "number", 0, ""
    shapes: tuple[tuple[ColumnKind, int], ...] = (
        ("stamp", sum(map(is_stamp, texts))), ("date", sum(map(is_date, texts))), ("clock", sum(map(is_clock, texts))),
    )  # fmt: skip
    kind, hits = max(shapes, key=lambda s: s[1])
    if hits and len(cells) - hits <= allowed:
        return kind, 0, ""
    return "text", len(texts), texts[0]


def lines_in(body: bytes, layout: Layout, start: int) -> int | None:
    """Number of lines from `start` on, if each has exactly the separators of a whole row and none is a comment."""
    if not body[start : start + 2].strip(b"\r\n") and len(body) <= start + 2:
        return 0
    others = _ALL.translate(None, layout.separator.encode() + b"\n" + _COMMENT)
    signs = body.translate(None, others)[len(body[:start].translate(None, others)) :]
    comments = [sign for sign in _COMMENT if sign in signs and sign != ord(layout.separator)]
    if comments and (body[start] in comments or any(body.find(b"\n%c" % sign, start) >= 0 for sign in comments)):
        return None
    return lines_of(signs.translate(None, bytes(comments)) + b"\n" * (not body.endswith(b"\n")), layout)


def lines_of(signs: bytes, layout: Layout) -> int | None:
    """Number of lines, if these signs in their order are the separators of whole rows and ends of lines alone."""
    row = layout.separator.encode() * (layout.width - 1) + b"\n"
    lines, rest = divmod(len(signs), len(row))
    return lines if layout.width == len(layout.columns) and not rest and signs == row * lines else None
