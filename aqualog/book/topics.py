"""The pages of the book: where they are, their titles and summaries."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

__all__ = ["DOCS", "SECTIONS", "Topic", "find", "nearest", "plain", "topics"]

DOCS = Path(__file__).resolve().parents[1] / "docs"

SECTIONS = {
    "": "Start",
    "guide": "Guide",
    "method": "Method",
    "reference": "Reference",
    "validation": "Validation",
    "decisions": "Decisions",
}
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
