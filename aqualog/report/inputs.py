"""Inputs that do not fit each other, before any number of a result: a line for a terminal, a list for a page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from aqualog.core.records import Remark
from aqualog.report.sections import Line, Lines, Section
from aqualog.report.values import counted

__all__ = ["input_sections", "of_runs", "without_remarks"]

_NAMED = 3  # logs in a line
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


def of_runs(checks: Mapping[str, Sequence[Remark]]) -> str:
    """The same for many logs in one line, by log; empty without a remark."""
    doubted = {n: ", ".join(dict.fromkeys(s for r in own for s in r.signals)) for n, own in checks.items() if own}
    if not doubted:
        return ""
    some = [f"{n} ({signals})" for n, signals in list(doubted.items())[:_NAMED]]
    more = f" and {len(doubted) - _NAMED} more" if len(doubted) > _NAMED else ""
    what = f"Check the inputs of {len(doubted)} of {counted(len(checks), 'log')} first: {', '.join(some)}{more}."
    return f"{what} Alarms and verdicts may change with them; `aqualog doctor LOG` says how."


def without_remarks(notes: Sequence[str], checks: Sequence[Remark]) -> list[str]:
    """The other notes of a page."""
    said = {r.sentence for r in checks}
    return [n for n in notes if n not in said]
