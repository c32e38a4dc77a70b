"""Inputs that do not fit each other, before any number of a result: a line for a terminal, a list for a page."""

from __future__ import annotations

from collections.abc import Sequence

from aqualog.core.records import Remark
from aqualog.report.sections import Line, Lines, Section

__all__ = ["input_sections", "without_remarks"]

_MAY = "values, intervals and verdicts below may change with it"


def input_sections(checks: Sequence[Remark]) -> list[Section]:
    """What the reader must look at first; no section without a remark."""
    if not checks:
        return []
    short = dict.fromkeys(f"{', '.join(r.signals[:3])} ({r.kind})" for r in checks)
    brief: list[Line] = [f"{'; '.join(short)}: the notes say what to change; {_MAY}"]
    heads = [", ".join(r.signals) for r in checks]
    lines: list[Line] = [(h, f"{r.what.removeprefix(f'{h} ')}\n{r.advice}") for h, r in zip(heads, checks, strict=True)]
    items = [Lines(brief, where="text"), Lines(lines, most=1000, where="page")]
    return [Section("Check the inputs first", items, "inputs", _MAY, look="problems")]


def without_remarks(notes: Sequence[str], checks: Sequence[Remark]) -> list[str]:
    """The other notes of a page."""
    said = {r.sentence for r in checks}
    return [n for n in notes if n not in said]
