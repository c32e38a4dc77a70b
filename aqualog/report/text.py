"""Text for a terminal: tables, and the sections of a report."""

from __future__ import annotations

from collections.abc import Sequence

from aqualog.report.numbers import ordinary
from aqualog.report.sections import Bars, Beside, Cell, Headline, Line, Lines, Para, Part, Report, Section, Table, shown
from aqualog.report.wording import CELL, cut

__all__ = ["report_text", "table"]

_MORE = "more: --json or --page"


def report_text(report: Report) -> str:
    """The sections of a report, each after an empty line; plain signs alone but for `²`, `³`, `·` and `±`."""
    lines = [line for s in shown(report.sections, "text") for line in ("", *_section(s))]
    return ordinary("\n".join(lines[1:])) + "\n"


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
            return _listed([_line(x) for x in lines], most)
        case Bars(bars, most_text=most):
            return _listed([f"{b.name} from {b.size}" for b in bars if b.width], most)
        case Beside(sections):
            return [line for s in sections for line in ("", *_section(s))]
        case Table(header, rows, below=below):
            heads = [h if isinstance(h, str) else h[1] for h in header]
            text = table([_small(h) for h in heads], [[_cell(c) for c in row] for row in rows])
            return [*text.splitlines(), *(f"  {_cell(rows[i][0])}: {line}" for i, line in below.items() if line)]
    return []


def _small(title: str) -> str:
    """A title as terminals show it: small, but for an abbreviation."""
    return title if title[1:2].isupper() else title[:1].lower() + title[1:]


def _listed(lines: Sequence[str], most: int) -> list[str]:
    return [f"  {x}" for x in (lines if len(lines) <= most else [*lines[:most], _MORE])]


def _line(line: Line) -> str:
    return line if isinstance(line, str) else f"{line[0]}: {line[1]}"


def _cell(cell: str | Cell) -> str:
    return cell if isinstance(cell, str) else cell.text


def table(header: Sequence[str], rows: Sequence[Sequence[str]], most: int = CELL) -> str:
    """Columns padded to their widest cell; numbers to the right. A cell is one line, of `most` characters at most."""
    header, *rows = ([cut(str(c), most) for c in r] for r in (header, *rows))
    widths = [max(len(r[i]) for r in (header, *rows)) for i in range(len(header))]
    return "\n".join("  ".join(_pad(c, w) for c, w in zip(r, widths, strict=True)).rstrip() for r in (header, *rows))


def _pad(cell: str, width: int) -> str:
    is_number = cell.lstrip("+-−").split(" ")[0].replace(".", "", 1).isdigit() and cell.count(" ") < 2
    return cell.rjust(width) if is_number else cell.ljust(width)
