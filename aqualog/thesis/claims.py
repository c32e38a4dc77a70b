"""The claims of the thesis with their criteria as data (`claims.toml`), and the one judge of all checks."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any, Literal

from aqualog.core.errors import ConfigError

__all__ = [
    "DIFFERENCE", "KINDS", "NEEDS_DATA", "NOT_REPRODUCED", "REPRODUCED", "VERDICTS", "Check", "Checks", "Conclusion",
    "Verdict", "claims", "combined", "judge", "judged", "limit", "limits", "number_of",
]  # fmt: skip

COUNT = 118
KINDS = {
    "A": "identity",
    "S": "in a simulator",
    "M": "needs a measured log of that condition; a simulator can show its shape",
    "D": "rule or definition",
}
Verdict = Literal["reproduced", "reproduced with a stated difference", "not reproduced", "needs measured data"]
REPRODUCED: Verdict = "reproduced"
DIFFERENCE: Verdict = "reproduced with a stated difference"
NOT_REPRODUCED: Verdict = "not reproduced"
NEEDS_DATA: Verdict = "needs measured data"
VERDICTS: tuple[Verdict, ...] = (REPRODUCED, DIFFERENCE, NOT_REPRODUCED, NEEDS_DATA)
_ONLY_PART = "The criterion is met only in part; see the number."
_OF_CLAIM, _COMMON = ("where", "kind", "statement"), ("limits", "texts")


@dataclass(frozen=True, slots=True)
class Criterion:
    """How one claim is judged from one kind of evidence, as fixed before any computation.

    `text` is the criterion in prose, `part` the checked part of the claim, `statement` the reading of the claim (empty
    for its own words), `unit` that of the number judged, `source` names the data. `note` is said of every check,
    `remark` of one that is reproduced, `reason` of one that is not. Where not even the weaker form is met, `failure`
    stands in its place. Texts hold the names of `limits` in braces.
    """

    text: str
    part: str = ""
    statement: str = ""
    unit: str = ""
    note: str = ""
    remark: str = ""
    reason: str = ""
    failure: str = ""
    source: str = ""
    limits: Mapping[str, Any] | None = None


@dataclass(frozen=True, slots=True)
class Claim:
    """A claim of the thesis.

    `where`: chapter, section, equation or figure; `kind` letters of `KINDS`: how it can be checked at all; `criteria`
    by their evidence: `figure`, `passes`, `drives`, `half_car`, `theory`.
    """

    id: str
    where: str
    statement: str
    kind: str
    criteria: Mapping[str, Criterion]


@dataclass(frozen=True, slots=True)
class Check:
    """A check of a claim: criterion, finding with its uncertainty, verdict.

    `found` gives the result in words and numbers. `value` is the number judged, `ci95` its 95 % interval or its range
    over what was varied, `unit` of both. The other texts are those of the `Criterion`.

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
    unit: str = ""
    reason: str = ""
    source: str = ""

    def __post_init__(self) -> None:
        where = f"check of {self.name}"
        if self.claim not in _ids():
            raise ConfigError(f'"{self.claim}" is not a claim', where=where, expected=f"C1 to C{COUNT}")
        if self.verdict != REPRODUCED and not self.reason:
            raise ConfigError(f"{self.verdict}, without a reason", where=where, expected="the difference and its cause")
        if self.ci95 is not None and not self.ci95[0] <= self.ci95[1]:
            raise ConfigError(f"interval {self.ci95} is not valid", where=where, expected="(low, high)")
        if self.value is not None and math.isnan(self.value):
            raise ConfigError("the number judged is NaN", where=where, expected="a number, or None")

    @property
    def name(self) -> str:
        """Claim and part: C62 (course)."""
        return f"{self.claim} ({self.part})" if self.part else self.claim


Checks = tuple[Check, ...]


@dataclass(frozen=True, slots=True)
class Conclusion:
    """A claim with all that was checked of it."""

    claim: Claim
    checks: Checks
    verdict: Verdict


def number_of(claim_id: str) -> int:
    """Its number, for sorting: 7 of C7."""
    return int(claim_id[1:])


@cache
def _ids() -> tuple[str, ...]:
    return tuple(f"C{n}" for n in range(1, COUNT + 1))


@cache
def _raw() -> dict[str, Any]:
    return tomllib.loads(files("aqualog.thesis").joinpath("claims.toml").read_text(encoding="utf-8"))


@cache
def claims() -> dict[str, Claim]:
    """All claims by id, C1 first.

    Raises
    ------
    ConfigError
        If the file is not whole.
    """
    return read(_raw())


def read(raw: Mapping[str, Any]) -> dict[str, Claim]:
    """Claims from the tables of the file.

    Raises
    ------
    ConfigError
        If a claim is missing, unknown, or empty.
    """
    ids = [k for k in raw if k not in _COMMON]
    if ids != list(_ids()):
        odd = [c for c in _ids() if c not in raw] + [c for c in ids if c not in _ids()]
        raise ConfigError(f"claims out of order, missing or unknown: {', '.join(odd) or 'order'}", where="claims.toml")
    found = {}
    for claim_id in ids:
        table = raw[claim_id]
        own = {k: v for k, v in table.items() if not isinstance(v, dict)}
        if set(own) != set(_OF_CLAIM) or not all(isinstance(v, str) and v for v in own.values()):
            raise ConfigError("a claim has a place, a kind and a statement", where=f"claims.toml, {claim_id}")
        if not set(own["kind"]) <= set(KINDS):
            raise ConfigError(f"kind {own['kind']}", where=f"claims.toml, {claim_id}", expected=" ".join(KINDS))
        criteria = {k: _criterion(v) for k, v in table.items() if isinstance(v, dict)}
        found[claim_id] = Claim(claim_id, **own, criteria=criteria)
    return found


def _criterion(table: Mapping[str, Any]) -> Criterion:
    return Criterion(table["criterion"], **{k: v for k, v in table.items() if k != "criterion"})


def limits(name: str, key: str = "") -> tuple[float, ...]:
    """Two numbers of a criterion (`key` as C73.figure), or of all criteria."""
    found: list[float] = _numbers(key)[name]
    return tuple(found)


def limit(name: str, key: str = "") -> float:
    """A number of a criterion (`key` as C73.figure), or of all criteria."""
    found: float = _numbers(key)[name]
    return found


def _numbers(key: str) -> Mapping[str, Any]:
    if not key:
        common: dict[str, Any] = _raw()["limits"]
        return common
    claim, evidence = key.split(".")
    own: dict[str, Any] = _raw()[claim][evidence]["limits"]
    return own


def judged(*, whole: bool, part: bool = False) -> Verdict:
    """Verdict of a criterion and of its weaker form."""
    return REPRODUCED if whole else DIFFERENCE if part else NOT_REPRODUCED


def judge(
    key: str, found: str, *, whole: bool = False, part: bool = False, verdict: Verdict | None = None,
    value: float | None = None, ci95: tuple[float, float] | None = None, reason: str | None = None,
    unit: str | None = None, fields: Mapping[str, Any] | None = None,
) -> Check:  # fmt: skip
    """Judge a claim.

    Parameters
    ----------
    key : str
        Claim and evidence: C73.figure.
    found : str
        What came out, in words and numbers.
    whole, part : bool
        Whether the criterion, or its weaker form, is met.
    verdict : Verdict, optional
        In place of both.
    value, ci95 : optional
        The number judged and its interval. A number that is not finite is left out.
    reason : str, optional
        In place of the criterion's own, where it depends on the numbers.
    unit : str, optional
        In place of the criterion's own.
    fields : mapping, optional
        What the texts name besides their limits.
    """
    claim, evidence = key.split(".")
    c = claims()[claim].criteria[evidence]
    words = {**_raw()["texts"], **_raw()["limits"], **(c.limits or {}), **(fields or {})}
    verdict = verdict or judged(whole=whole, part=part)
    if reason is None:
        own = c.remark if verdict == REPRODUCED else c.failure if verdict == NOT_REPRODUCED and c.failure else c.reason
        reason = " ".join(x for x in (c.note, own) if x).format(**words)
    if not reason and verdict != REPRODUCED:
        reason = _ONLY_PART
    return Check(
        claim, c.text.format(**words), found, verdict, c.part.format(**words), c.statement,
        value if value is not None and math.isfinite(value) else None, ci95, c.unit if unit is None else unit, reason,
        c.source.format(**words),
    )  # fmt: skip


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
