"""The pages of the book: where they are, their titles and summaries, and a search of them by word."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

__all__ = ["DOCS", "SECTIONS", "Hit", "Topic", "find", "nearest", "plain", "search", "topics"]

DOCS = Path(__file__).resolve().parents[1] / "docs"

SECTIONS = {
    "": "Start", "guide": "Guide", "method": "Method", "reference": "Reference", "validation": "Validation",
    "decisions": "Decisions",
}  # fmt: skip
"""Folders of pages and their names, in the order in which a name that stands in two of them is looked for."""

_PAGE = re.compile(r"\]\(([^)#\s]+\.md)")
_INLINE = (
    (re.compile(r"!\[([^\]]*)\]\([^)]*\)"), r"\1"),
    (re.compile(r"\[([^\]]*)\]\([^)]*\)"), r"\1"),
    (re.compile(r"`([^`]*)`"), r"\1"),
    (re.compile(r"\*\*([^*]+)\*\*"), r"\1"),
    (re.compile(r"(?<![\w*])\*([^*\s][^*]*)\*(?![\w*])"), r"\1"),
)


@dataclass(frozen=True, slots=True)
class Topic:
    """One page. `section` is its folder, empty for pages at the top; `summary` is its first paragraph."""

    name: str
    section: str
    path: Path
    title: str
    summary: str

    @property
    def address(self) -> str:
        """`reference/campaign`, which names one page only."""
        return f"{self.section}/{self.name}" if self.section else self.name

    @property
    def file(self) -> str:
        """The page's path in the book: `reference/campaign.md`."""
        return f"{self.address}.md"

    def text(self) -> str:
        """The page's Markdown."""
        return self.path.read_text(encoding="utf-8")


def topics(root: Path = DOCS) -> list[Topic]:
    """All pages by section, in the order in which the first page names them; the others behind, by name."""
    index = root / "index.md"
    named = _PAGE.findall(index.read_text(encoding="utf-8")) if index.is_file() else []
    place = {path: i for i, path in reversed(list(enumerate(named)))}
    found = [t for section in SECTIONS for t in _in_section(root, section)]
    sections = list(SECTIONS)
    return sorted(found, key=lambda t: (sections.index(t.section), t.name != "index", place.get(t.file, len(named))))


def find(name: str, pages: list[Topic]) -> Topic | None:
    """The page of that name, or None.

    `-`, `_` and a space are alike, as are capitals; a section may stand before the name. Of pages of one name the
    first in the order of `SECTIONS` is meant, but a page at the top comes last. A page of decisions is found with its
    section alone: its name is that of a package or a command.
    """
    wanted = _key(name)
    order = [s for s in SECTIONS if s] + [""]
    for page in sorted(pages, key=lambda p: order.index(p.section)):
        names = [page.address] if page.section == "decisions" else [page.name, page.address]
        if page.name == "index":
            names = [page.section or "index", page.address]
        if wanted in map(_key, names):
            return page
    return None


def nearest(name: str, names: Iterable[str], count: int = 3) -> list[str]:
    """Those of the names that are spelled alike."""
    from difflib import get_close_matches

    by_key = {_key(n): n for n in names}
    return [by_key[k] for k in get_close_matches(_key(name), by_key, n=count, cutoff=0.5)]


def plain(markdown: str) -> str:
    """Text of a line without the signs of Markdown: links and pictures are their words."""
    for pattern, kept in _INLINE:
        markdown = pattern.sub(kept, markdown)
    return markdown


def _key(name: str) -> str:
    return re.sub(r"[-_\s]+", "_", name.strip().lower().removesuffix(".md"))


def _in_section(root: Path, section: str) -> Iterator[Topic]:
    folder = root / section if section else root
    paths = folder.glob("*.md") if folder.is_dir() else ()
    for path in sorted(paths, key=lambda p: (p.stem != "index", p.stem)):
        title, summary = _head(path)
        yield Topic(path.stem, section, path, title, summary)


def _head(path: Path) -> tuple[str, str]:
    """Title and first paragraph."""
    title, paragraph = path.stem, list[str]()
    with path.open(encoding="utf-8") as lines:
        for line in map(str.strip, lines):
            if line.startswith("# ") and not paragraph:
                title = plain(line[2:])
            elif line and not line.startswith(("<!--", "![", "#", "|", "```", "---")):
                paragraph.append(line)
            elif paragraph:
                break
    return title, plain(" ".join(paragraph))


_IN_TITLE, _IN_HEADING, _IN_SUMMARY = 40, 12, 10
_WHOLE = 3  # a word that stands alone counts more than a part of another
_MOST_COUNTED = 10  # a long table of one word is no better page than an explanation


@dataclass(frozen=True, slots=True)
class Hit:
    """A page that holds the words: the first lines with them, as plain text, and how many such lines there are."""

    topic: Topic
    score: int
    lines: tuple[str, ...]
    count: int


def search(words: Sequence[str], pages: list[Topic], most_lines: int = 3) -> list[Hit]:
    """Pages that hold all words, best first. Capitals do not matter; a word may be a part of another."""
    found = (_hit([w.lower() for w in words], page, most_lines) for page in pages)
    return sorted((h for h in found if h), key=lambda h: -h.score)


def _hit(words: list[str], page: Topic, most_lines: int) -> Hit | None:
    text = page.text()
    low = text.lower()
    if not words or not all(w in low for w in words):
        return None
    lines = list(dict.fromkeys(_lines(text)))
    scored = [(line, sum(_in(w, line) for w in words)) for line, _ in lines]
    body = sorted((s for (_, s), (_, is_code) in zip(scored, lines, strict=True) if not is_code), reverse=True)
    heads = [line for line in text.lower().splitlines() if line.startswith("#")]
    score = sum(body[:_MOST_COUNTED])
    for word in words:
        score += _IN_TITLE * _in(word, f"{page.title} {page.name}")
        score += _IN_SUMMARY * _in(word, page.summary)
        score += _IN_HEADING * sum(_in(word, h) for h in heads)
    if page.section == "decisions":
        score //= 2  # why something is so is asked for last
    shown = sorted((i for i, (_, s) in enumerate(scored) if s), key=lambda i: (lines[i][1], -scored[i][1], i))
    count = len(shown)
    return Hit(page, score, tuple(lines[i][0] for i in sorted(shown[:most_lines])), count)


def _in(word: str, text: str) -> int:
    low = text.lower()
    if word not in low:
        return 0
    return _WHOLE if re.search(rf"(?<![^\W_]){re.escape(word)}(?![^\W_])", low) else 1


def _lines(text: str) -> list[tuple[str, bool]]:
    """Paragraphs, list items, table rows and lines of code, each on one line, and whether it is code.

    A heading stands before its first paragraph.
    """
    lines, paragraph, in_code, heading = list[tuple[str, bool]](), list[str](), False, ""

    def end() -> None:
        nonlocal heading
        if paragraph:
            said = plain(" ".join(paragraph))
            lines.append((f"{heading}: {said}" if heading else said, False))
            paragraph.clear()
        elif heading:
            lines.append((heading, False))
        heading = ""

    for raw in text.splitlines():
        line = raw.strip()
        if line.startswith("```"):
            in_code = not in_code
            end()
        elif in_code:
            lines.append((line, True))
        elif not line or set(line) <= set("|-: "):
            if paragraph:
                end()
        elif line.startswith("|"):
            end()
            lines.append((plain("  ".join(c.strip() for c in line.strip("|").split("|"))), False))
        elif line.startswith("#"):
            end()
            heading = plain(line.lstrip("# "))
        elif line.startswith(("- ", "* ", "> ")):
            end()
            paragraph.append(line.lstrip(">-* "))
        else:
            paragraph.append(line)
    end()
    return [(line, is_code) for line, is_code in lines if line]
