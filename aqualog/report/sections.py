"""A result as typed sections: text, page and notebook show the same ones, each with one renderer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

__all__ = [
    "Bar", "Bars", "Beside", "Cell", "Figures", "Headline", "Line", "Lines", "Para", "Part", "Report", "Residuals",
    "Section", "Table", "shown",
]  # fmt: skip

Where = Literal["everywhere", "text", "page"]
Line = str | tuple[str, str]
"""A sentence, or a short head and a sentence."""


class Cell(NamedTuple):
    """A table's cell: `dot` is a colour before the text (`ink`: that of the text), `note` stands behind it in grey."""

    text: str
    dot: str = ""
    note: str = ""


@dataclass(frozen=True, slots=True)
class Table:
    """Rows under a header. A head that is a pair has a shorter form for a terminal.

    `words` are the columns that hold words; all others are numbers, to the right. `below` are lines under rows, by
    index.
    """

    header: Sequence[str | tuple[str, str]]
    rows: Sequence[Sequence[str | Cell]]
    id: str = ""
    words: Sequence[int] = (0,)
    below: Mapping[int, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Lines:
    """A list of sentences. A page folds what is beyond `most`; a terminal shows `most_text` and names the rest."""

    lines: Sequence[Line]
    id: str = ""
    most: int = 8
    most_text: int = 1000
    where: Where = "everywhere"
    looks: Sequence[str] = ()


@dataclass(frozen=True, slots=True)
class Para:
    """A paragraph, on a page in grey."""

    text: str
    where: Where = "page"


@dataclass(frozen=True, slots=True)
class Headline:
    """The answer: a kind of answer in few words, a sentence, and lines for it. A terminal shows the sentence."""

    text: str
    lines: Sequence[Line] = ()
    kind: str = ""


class Bar(NamedTuple):
    """A size on a logarithmic scale: `width` [%] empty without a bar; `title` explains it."""

    name: str
    size: str
    width: str
    is_sharp: bool
    title: str


@dataclass(frozen=True, slots=True)
class Bars:
    """Sizes as bars; a terminal lists those that have one. `more` are folded under `fold`."""

    bars: Sequence[Bar]
    more: Sequence[Bar] = ()
    fold: str = ""
    most_text: int = 6


@dataclass(frozen=True, slots=True)
class Figures:
    """Figures of the report by name; those that it does not have are left out."""

    names: Sequence[str]


@dataclass(frozen=True, slots=True)
class Beside:
    """Sections that stand side by side where there is room."""

    sections: Sequence[Section]


@dataclass(frozen=True, slots=True)
class Residuals:
    """Residuals before and after, which the page's script draws."""


Part = Table | Lines | Para | Headline | Bars | Figures | Beside | Residuals


@dataclass(frozen=True, slots=True)
class Section:
    """Parts under a title. `look` is a class of the page's style; empty parts and sections are not shown."""

    title: str
    parts: Sequence[Part]
    id: str = ""
    hint: str = ""
    look: str = ""
    where: Where = "everywhere"


@dataclass(frozen=True, slots=True)
class Report:
    """One result for a reader.

    `kind` and `about` name what it is, `facts` are label and value of what it is of, `figures` plotly's `data` and
    `layout` by name. `islands` and `scripts` are data and scripts that a page needs beside them.
    """

    kind: str
    about: str
    sections: Sequence[Section]
    facts: Sequence[tuple[str, str]] = ()
    figures: Mapping[str, Any] = field(default_factory=dict)
    footer: str = ""
    islands: Mapping[str, Any] = field(default_factory=dict)
    scripts: Sequence[str] = ()


def shown(sections: Sequence[Section], place: Where) -> list[Section]:
    """Sections and parts that a place shows: without what is empty or belongs to the other place."""
    made = []
    for s in sections:
        parts = [p for p in (_shown_part(p, place) for p in s.parts) if p is not None]
        if s.where in ("everywhere", place) and any(not isinstance(p, Para) or not s.title for p in parts):
            made.append(Section(s.title, parts, s.id, s.hint, s.look))
    return made


def _shown_part(part: Part, place: Where) -> Part | None:
    match part:
        case Lines(lines, where=where):
            return part if lines and where in ("everywhere", place) else None
        case Para(text, where):
            return part if text and where in ("everywhere", place) else None
        case Table(rows=rows):
            return part if rows else None
        case Bars(bars):
            return part if bars else None
        case Figures(names):
            return part if names and place == "page" else None
        case Beside(sections):
            inner = shown(sections, place)
            return Beside(inner) if inner else None
    return part if place == "page" or isinstance(part, Headline) else None
