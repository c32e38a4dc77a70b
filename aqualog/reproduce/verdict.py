"""The four verdicts on a claim of the thesis, and how those of several checks become one."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

from aqualog.core.errors import ConfigError
from aqualog.figures.record import BORNE_OUT, IN_PART, NOT_BORNE_OUT
from aqualog.figures.record import Verdict as FigureVerdict

__all__ = [
    "DIFFERENCE", "NEEDS_DATA", "NOT_REPRODUCED", "REPRODUCED", "VERDICTS", "Verdict", "combined", "judged",
    "of_figure",
]  # fmt: skip

Verdict = Literal[
    "reproduced", "reproduced with a stated difference", "not reproduced", "needs measured data"
]  # fmt: skip
REPRODUCED: Verdict = "reproduced"
DIFFERENCE: Verdict = "reproduced with a stated difference"
NOT_REPRODUCED: Verdict = "not reproduced"
NEEDS_DATA: Verdict = "needs measured data"
VERDICTS: tuple[Verdict, ...] = (REPRODUCED, DIFFERENCE, NOT_REPRODUCED, NEEDS_DATA)

_OF_FIGURES: dict[FigureVerdict, Verdict] = {
    BORNE_OUT: REPRODUCED, IN_PART: DIFFERENCE, NOT_BORNE_OUT: NOT_REPRODUCED,
}  # fmt: skip


def of_figure(verdict: FigureVerdict) -> Verdict:
    """A figure's verdict (borne out, in part, not borne out) in the words of the reproduction."""
    return _OF_FIGURES[verdict]


def judged(*, whole: bool, part: bool = False) -> Verdict:
    """Verdict of a criterion and of its weaker form."""
    return REPRODUCED if whole else DIFFERENCE if part else NOT_REPRODUCED


def combined(verdicts: Iterable[Verdict]) -> Verdict:
    """One verdict on a claim from those of all its checks.

    Reproduced only if every check is; not reproduced only if none of the possible checks is, not even with a
    difference; needing measured data only if no check could be made. A claim of which one half is reproduced and the
    other needs measured data is reproduced with a stated difference.

    Raises
    ------
    ConfigError
        If there is no check: a claim without one has no verdict.
    """
    found = set(verdicts)
    if not found:
        raise ConfigError("a claim without a check has no verdict", expected="at least one check")
    if len(found) == 1:
        return found.pop()
    return NOT_REPRODUCED if found == {NOT_REPRODUCED, NEEDS_DATA} else DIFFERENCE
