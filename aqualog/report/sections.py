"""A result as typed sections: text, page and notebook show the same ones, each with one renderer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, NamedTuple

__all__ = [
    "Bar", "Bars", "Beside", "Cell", "Code", "Figures", "Headline", "Line", "Lines", "Para", "Part", "Report",
    "Residuals", "Section", "Stack", "Table", "shown",
]  # fmt: skip

Where = Literal["everywhere", "text", "page"]
Line = str | tuple[str, str]
"""A sentence, or a short head and a sentence. What follows a line break is advice, on a line of its own."""


class Cell(NamedTuple):
    """A table's cell.

    `dot` is a colour before the text (`ink`: that of the text), `note` stands behind it in grey. `tag` is a class of
    the page's style for a word in a frame. A sortable table goes by `key`, or else by the text.
    """

    text: str
    dot: str = ""
    note: str = ""
    tag: str = ""
    key: float | str | None = None


@dataclass(frozen=True, slots=True)
class Table:
    """Rows under a header. A head that is a pair has a shorter form for a terminal; empty: a column of pages alone.

    `words` are the columns that hold words; all others are numbers, to the right. `wide` columns hold sentences, of
    which a terminal shows those in `brief` up to the first phrases only. `below` are lines under rows, by index.
    `more` rows are not in the page's text: its script fills the table by pages. With `is_choice` the page's script acts
    when the reader picks a row.
    """

    header: Sequence[str | tuple[str, str]]
    rows: Sequence[Sequence[str | Cell]]
    id: str = ""
    words: Sequence[int] = (0,)
    below: Mapping[int, str] = field(default_factory=dict)
    wide: Sequence[int] = ()
    brief: Sequence[int] = ()
    is_sortable: bool = False
    is_choice: bool = False
    more: Sequence[Sequence[str | Cell]] = ()
    where: Where = "everywhere"


@dataclass(frozen=True, slots=True)
class Lines:
    """A list of sentences. A page folds what is beyond `most`; a terminal shows `most_text` and names the rest.

    `fold` is what the page calls the folded ones.
    """

    lines: Sequence[Line]
    id: str = ""
    most: int = 8
    most_text: int = 1000
    where: Where = "everywhere"
    looks: Sequence[str] = ()
    fold: str = ""


@dataclass(frozen=True, slots=True)
class Para:
    """A paragraph, on a page in grey."""

    text: str
    where: Where = "page"


@dataclass(frozen=True, slots=True)
class Code:
    """A command for the reader to run."""

    text: str


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


@dataclass(frozen=True, slots=True)
class Stack:
    """Panels over one time axis, which the page's script draws.

    `toggles` are groups of lines with label and colour, `shades` classes of the page's style and what they mean;
    `has_steps` for buttons that go from event to event.
    """

    toggles: Sequence[tuple[str, str, str]] = ()
    shades: Sequence[tuple[str, str]] = ()
    has_steps: bool = False


Part = Code | Table | Lines | Para | Headline | Bars | Figures | Beside | Residuals | Stack


@dataclass(frozen=True, slots=True)
class Section:
    """Parts under a title. `look` is a class of the page's style; empty parts and sections are not shown.

    `fold`: a page shows this line instead, and the parts when the reader opens it.
    """

    title: str
    parts: Sequence[Part]
    id: str = ""
    hint: str = ""
    look: str = ""
    where: Where = "everywhere"
    fold: str = ""


@dataclass(frozen=True, slots=True)
class Report:
    """One result for a reader.

    `kind` and `about` name what it is, `facts` are label and value of what it is of, `figures` plotly's `data` and
    `layout` by name. `islands` are data for the page's `scripts`.
    """

    kind: str
    about: str
    sections: Sequence[Section]
    facts: Sequence[tuple[str, str]] = ()
    figures: Mapping[str, Any] = field(default_factory=dict)
    footer: str = ""
    islands: Mapping[str, Any] = field(default_factory=dict)
    scripts: Sequence[str] = ("figures.js",)


def shown(sections: Sequence[Section], place: Where) -> list[Section]:
    """Sections and parts that a place shows: without what is empty or belongs to the other place."""
    made = []
    for s in sections:
        parts = [p for p in (_shown_part(p, place) for p in s.parts) if p is not None]
        if s.where in ("everywhere", place) and any(not isinstance(p, Para) or not s.title for p in parts):
            made.append(replace(s, parts=parts))
    return made


def _shown_part(part: Part, place: Where) -> Part | None:
    match part:
        case Lines(content, where=where) | Para(content, where) | Table(rows=content, where=where):
            return part if content and where in ("everywhere", place) else None
        case Bars(content):
            return part if content else None
        case Figures(names):
            return part if names and place == "page" else None
        case Beside(sections):
            inner = shown(sections, place)
            return Beside(inner) if inner else None
    return part if place == "page" or isinstance(part, Headline) else None
