"""One check of one claim: criterion, finding with its uncertainty, verdict."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from aqualog.core.errors import ConfigError
from aqualog.figures.record import Finding
from aqualog.reproduce.verdict import REPRODUCED, Verdict, of_figure

__all__ = ["Check", "Checks", "Maker", "Plan", "from_finding"]

_CLAIM = re.compile(r"(C\d{1,3})(?: \((.+)\))?")


@dataclass(frozen=True, slots=True)
class Check:
    """A check of a claim.

    `claim` as C7; `part` names the checked part where a claim has several checks; `statement` is this check's reading
    of the claim, empty for the claim's own words. `criterion` is fixed before any computation; `found` gives the result
    in words and numbers, with its conditions. `value` is the number judged, `ci95` its 95 % interval or its range over
    what was varied, `unit` of both. `source`: the data behind it.

    Raises
    ------
    ConfigError
        If a check that is not reproduced lacks a `reason`, or the number or interval is invalid.
    """

    claim: str
    criterion: str
    found: str
    verdict: Verdict
    part: str = ""
    statement: str = ""
    value: float | None = None
    ci95: tuple[float, float] | None = None
    unit: str = "-"
    reason: str = ""
    source: str = ""

    def __post_init__(self) -> None:
        where = f"check of {self.claim}" + (f" ({self.part})" if self.part else "")
        if not re.fullmatch(r"C\d{1,3}", self.claim):
            raise ConfigError(f'"{self.claim}" is not a claim', where=where, expected="C1 to C118")
        if self.verdict != REPRODUCED and not self.reason:
            raise ConfigError(f"{self.verdict}, without a reason", where=where, expected="the difference and its cause")
        if self.ci95 is not None and not self.ci95[0] <= self.ci95[1]:
            raise ConfigError(f"interval {self.ci95} is not valid", where=where, expected="(low, high)")
        if self.value is not None and math.isnan(self.value):
            raise ConfigError("the number judged is NaN", where=where, expected="a number, or None")


Checks = tuple[Check, ...]


@dataclass(frozen=True, slots=True)
class Plan:
    """How checks are made.

    `seeds` of the simulated drives: those that the figures reported are from; `jobs` processes at most; `tell` gets a
    sentence on the progress at times.
    """

    seeds: Sequence[int]
    jobs: int = 1
    tell: Callable[[str], None] | None = None

    def first(self, n: int) -> tuple[int, ...]:
        """The first n seeds; fewer if there are fewer."""
        return tuple(self.seeds[:n])


Maker = Callable[[Plan], Checks]
"""Makes the checks of some claims."""


def from_finding(finding: Finding, figure: str) -> Check:
    """The check that a figure's finding is; `figure` its number.

    For a finding in part without a reason, its criterion shows what is missing.

    Raises
    ------
    ConfigError
        If the finding is not about a claim.
    """
    match = _CLAIM.fullmatch(finding.claim)
    if match is None:
        raise ConfigError(
            f'the finding "{finding.claim}" of figure {figure} is not about a claim', expected="C1, or C1 (part)"
        )
    verdict = of_figure(finding.verdict)
    reason = finding.reason or ("" if verdict == REPRODUCED else "The criterion is met only in part; see the number.")
    value = finding.value if finding.value is not None and math.isfinite(finding.value) else None
    return Check(
        claim=match[1], part=match[2] or "", statement=finding.thesis, criterion=finding.criterion,
        found=finding.found, verdict=verdict, value=value, reason=reason, source=f"figure {figure}",
    )  # fmt: skip
