"""Search of the pages by word."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from aqualog.book.topics import Topic, plain

__all__ = ["Hit", "search"]

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
