"""Text for a terminal: tables, and the sections of a report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import wrap

from aqualog.core.units import displayed_units
from aqualog.report.sections import Bars, Beside, Cell, Headline, Line, Lines, Para, Part, Report, Section, Table, shown
from aqualog.report.values import CELL, NOTE, cut, ordinary

__all__ = ["report_text", "table"]

_MORE = "more: --json or --page"
_LINE = 100  # characters of a line in a column of sentences
_BRIEF = 100  # of the first phrases


def report_text(report: Report) -> str:
    """The sections of a report, each after an empty line; plain signs alone but for `²`, `³`, `·` and `±`."""
    lines = [line for s in shown(report.sections, "text") for line in ("", *_section(s))]
    return displayed_units(ordinary("\n".join(lines[1:]))) + "\n"


def _section(section: Section) -> list[str]:
    title = [_small(section.title)] if section.title else []
    return [*title, *(line for part in section.parts for line in _part(part))]


def _part(part: Part) -> list[str]:
    match part:
        case Headline(text):
            return [text]
        case Para(text):
            return text.splitlines()
        case Lines(lines, most_text=most):
            return _listed(lines, most)
        case Bars(bars, most_text=most):
            return _listed([f"{b.name} from {b.size}" for b in bars if b.width], most)
        case Beside(sections):
            return [line for s in sections for line in ("", *_section(s))]
        case Table(header, rows, below=below, wide=wide, brief=brief, more=more):
            heads = [(i, h if isinstance(h, str) else h[1]) for i, h in enumerate(header)]
            kept = [(i, _small(h)) for i, h in heads if h or isinstance(header[i], str)]
            cells = [
                [_brief(_cell(row[i])) if i in brief else _cell(row[i]) for i, _ in kept] for row in (*rows, *more)
            ]
            sentences = set(wide) - set(brief)
            text = table(
                [h for _, h in kept], cells, wrapped={k: _LINE for k, (i, _) in enumerate(kept) if i in sentences}
            )
            return [*text.splitlines(), *(f"  {_cell(rows[i][0])}: {line}" for i, line in below.items() if line)]
    return []


def _small(title: str) -> str:
    """A title as terminals show it: small, but for an abbreviation."""
    return title if title[1:2].isupper() else title[:1].lower() + title[1:]


def _listed(lines: Sequence[Line], most: int) -> list[str]:
    told = [line if isinstance(line, str) else f"{line[0]}: {line[1]}" for line in lines]
    return ["  " + x.replace("\n", "\n    ") for x in (told if len(told) <= most else [*told[:most], _MORE])]


def _cell(cell: str | Cell) -> str:
    return cell if isinstance(cell, str) else cell.text


def _brief(text: str) -> str:
    """The first phrases, as many as a line of a terminal has room for."""
    first, *more = text.split("; ")
    for phrase in more:
        if len(first) + len(phrase) > _BRIEF:
            return f"{first}; …"
        first = f"{first}; {phrase}"
    return first


def table(
    header: Sequence[str], rows: Sequence[Sequence[str]], most: int = CELL, *, wrapped: Mapping[int, int] | None = None
) -> str:
    """Columns padded to their widest cell; numbers to the right.

    A cell is one line, of `most` characters at most. Those of `wrapped` columns go on below after so many characters.
    """
    wrapped = wrapped or {}
    lines = [line for r in (header, *rows) for line in _wrapped([displayed_units(str(c)) for c in r], wrapped, most)]
    widths = [max(len(r[i]) for r in lines) for i in range(len(header))]
    return "\n".join("  ".join(_pad(c, w) for c, w in zip(r, widths, strict=True)).rstrip() for r in lines)


def _wrapped(row: Sequence[str], wrapped: Mapping[int, int], most: int) -> list[list[str]]:
    """The lines of a row."""
    parts = [
        wrap(cut(c, max(most, NOTE)), wrapped[i], break_on_hyphens=False) or [""] if i in wrapped else [cut(c, most)]
        for i, c in enumerate(row)
    ]
    return [[p[k] if k < len(p) else "" for p in parts] for k in range(max(map(len, parts)))]


def _pad(cell: str, width: int) -> str:
    is_number = cell.lstrip("+-−").split(" ")[0].replace(".", "", 1).isdigit() and cell.count(" ") < 2
    return cell.rjust(width) if is_number else cell.ljust(width)
