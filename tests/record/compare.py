"""Compares two records: numbers without tolerance, prose apart from results."""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

# not of the result: the version, and what a run takes
LEFT_OUT = {"tool_version", "seconds", "bytes", "limit_bytes", "last_used", "folder", "real_time_factor"}
PROSE = {
    "caption", "condition", "criterion", "detail", "found", "hint", "how", "label", "meaning", "message", "note", "notes",
    "question", "reason", "reasons", "rule", "sentence", "stderr", "stdout", "text", "thesis", "title", "what", "why",
    "words",
}  # fmt: skip
_NUMBER = re.compile(r"(?<![\w.^])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
_WORDS = 4  # a text with as many is a sentence wherever it stands


@dataclass(frozen=True, slots=True)
class Change:
    """One place where two records differ."""

    place: str
    old: Any
    new: Any
    is_wording: bool

    @property
    def has_other_numbers(self) -> bool:
        """Whether the two texts hold different numbers."""
        return Counter(_NUMBER.findall(str(self.old))) != Counter(_NUMBER.findall(str(self.new)))

    def __str__(self) -> str:
        """The place with both values, cut to a line."""
        return f"{self.place}: {_cut(self.old)} -> {_cut(self.new)}"


def changes(old: Any, new: Any, place: str = "", *, is_prose: bool = False) -> Iterator[Change]:
    """All places where two documents differ; `is_prose` for what lies below a key of prose."""
    if isinstance(old, dict) and isinstance(new, dict):
        old, new = dict(old), dict(new)
        for was, now in _reworded_keys(old, new):
            yield Change(f"{place}.(key)", was, now, is_wording=True)
            old[now] = old.pop(was)
        for key in [*old, *(k for k in new if k not in old)]:
            if key in LEFT_OUT:
                continue
            below = f"{place}.{key}" if place else key
            prose = is_prose or key.split(" ")[-1] in PROSE
            if key in old and key in new:
                yield from changes(old[key], new[key], below, is_prose=prose)
            else:
                yield Change(below, old.get(key, "(lacking)"), new.get(key, "(lacking)"), is_wording=False)
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for i, (a, b) in enumerate(zip(old, new, strict=True)):
            yield from changes(a, b, f"{place}[{i}]", is_prose=is_prose)
    elif not _is_same(old, new):
        texts = isinstance(old, str) and isinstance(new, str)
        yield Change(place, old, new, is_wording=texts and (is_prose or _is_sentence(old) or _is_sentence(new)))


def results_of(document: Any) -> Any:
    """The document without what `changes` leaves out, and without prose."""
    if isinstance(document, dict):
        return {k: results_of(x) for k, x in document.items() if k not in LEFT_OUT and k.split(" ")[-1] not in PROSE}
    if isinstance(document, list):
        return [results_of(x) for x in document]
    return "words" if isinstance(document, str) and _is_sentence(document) else document


def case_changes(old: Path, new: Path) -> list[Change]:
    """Differences between two files of a record."""
    return list(changes(json.loads(old.read_text()), json.loads(new.read_text())))


def _reworded_keys(old: dict[str, Any], new: dict[str, Any]) -> list[tuple[str, str]]:
    """Keys that are sentences, by their order, where as many have gone as have come."""
    gone = [k for k in old if k not in new and _is_sentence(k)]
    come = [k for k in new if k not in old and _is_sentence(k)]
    return list(zip(gone, come, strict=True)) if len(gone) == len(come) else []


def _is_same(old: Any, new: Any) -> bool:
    if isinstance(old, float) and isinstance(new, float) and math.isnan(old) and math.isnan(new):
        return True
    return bool(old == new) and isinstance(old, bool) == isinstance(new, bool)


def _is_sentence(text: str) -> bool:
    return len(text.split()) >= _WORDS


def _cut(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 110 else f"{text[:107]}..."
