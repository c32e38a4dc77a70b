"""A verdict beside its truth. A measured drive has faults of its own: what its clean verdict says is not counted."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from aqualog.model.effects import EFFECTS
from tests.blind.judging.answers import Answer, Form, coordinates_of, exact_twins, judged_by, mechanism_of, twins_of
from tests.blind.metrics.measure import right_first, right_or_listed
from tests.blind.metrics.rows import Fact, Row, Said

__all__ = ["Judged", "beyond", "error_of", "facts_of", "fits", "judge", "limited"]

LAGS = ("signal_delay", "clock_skew")


@dataclass(frozen=True, slots=True)
class Judged:
    """`row` for the figures that blind drives share; `chances`: (probability, whether it was so) of each cause and form.

    `is_baseline`: a measured drive with nothing added, with no truth but itself; `is_measured`: one with effects added.
    """

    row: Row
    world: str
    kind: str
    forms: tuple[Form, ...] = ()
    unknown: Mapping[str, Any] | None = None
    chances: tuple[tuple[float, bool], ...] = ()
    gain_low: float = math.nan
    probability: tuple[float, ...] = ()
    is_baseline: bool = False
    is_measured: bool = False

    @property
    def in_answer(self) -> bool:
        """All that is hidden is named or left open."""
        return right_or_listed(self.row)

    @property
    def first_is_right(self) -> bool:
        """The first cause is what is hidden or its exact twin, and nothing else is named beside it."""
        twin = bool(self.row.names) and not self.wrong and self.row.causes[0].key not in self.row.hidden
        return right_first(self.row) or twin

    @property
    def wrong(self) -> bool:
        """Names without reserve what is neither hidden, nor its exact twin, nor a name that the truth accepts."""
        right = set(self.row.hidden).union(*(exact_twins(f.effect) for f in self.row.truth))
        return any(c.key not in right and c.effect not in right | self.accepted for c in self._named)

    @property
    def accepted(self) -> frozenset[str]:
        """Names that are right for an unknown form as well."""
        return frozenset((self.unknown or {}).get("accepts") or ())

    @property
    def is_accepted(self) -> bool:
        """An unknown form is named, and by nothing but names that its truth accepts."""
        return bool(self._named) and all(c.effect in self.accepted for c in self._named)

    @property
    def limit_is_right(self) -> bool:
        """Nothing is found, and the one effect is below the limit that the verdict itself states for it."""
        row = self.row
        if row.verdict != "no_effect" or len(row.truth) != 1 or row.truth[0].key not in row.limits:
            return False
        return limited(row.truth[0]) <= row.limits[row.truth[0].key]

    @property
    def _named(self) -> tuple[Said, ...]:
        return self.row.causes if self.row.names else ()

    @property
    def is_right_or_twins(self) -> bool:
        """Named rightly, or a set that is what is hidden and its twins, and nothing else."""
        row = self.row
        if row.verdict in ("named", "compound"):
            return set(row.names) == set(row.hidden) or (len(row.names) == len(row.truth) == 1 and self.first_is_right)
        allowed = {f.effect for f in row.truth}.union(*(twins_of(f.effect) for f in row.truth)) if row.truth else set()
        said = {c.effect for c in row.causes}
        return row.verdict == "cannot_tell" and self.in_answer and said <= allowed

    @property
    def form_is_right(self) -> bool:
        """The most probable form acts by the right mechanism over the right coordinates."""
        return self._form(exact=True)

    @property
    def form_is_near(self) -> bool:
        """... by the right mechanism, over one of the right coordinates at least."""
        return self._form(exact=False)

    def _form(self, *, exact: bool) -> bool:
        if self.is_accepted:
            return True
        if self.unknown is None or not self.forms or self.row.verdict != "unexplained":
            return False
        return fits(self._first, self.unknown, exact=exact)

    @property
    def _first(self) -> Form:
        return max(self.forms, key=lambda f: f.probability if math.isfinite(f.probability) else -1.0)

    @property
    def function_error(self) -> float:
        """Of a right form, see `error_of`; NaN of others."""
        if self.unknown is None or self.is_accepted or not self.form_is_right:
            return math.nan
        return error_of(self._first, self.unknown)


def fits(form: Form, unknown: Mapping[str, Any], *, exact: bool) -> bool:
    """Whether a form acts by the truth's mechanism over its coordinates: all of them, or one at least."""
    right = [coordinates_of(unknown["depends_on"]), *(coordinates_of(x) for x in unknown.get("also") or ())]
    over = form.depends_on in right if exact else any(form.depends_on & r for r in right)
    return over and mechanism_of(unknown["mechanism"]) in form.mechanisms


def error_of(form: Form, unknown: Mapping[str, Any]) -> float:
    """Rms of said less true function over that of the true one, where both are known; NaN without points.

    Means stay in. What an effect beside the form carries is not counted.
    """
    true = unknown.get("points")
    # a gain over its own signal is an offset over that
    is_gain = true is not None and (form.unit, true["unit"], *form.depends_on) == ("-", "m/s^2", "a_x")
    if true is None or (form.unit != true["unit"] and not is_gain):
        return math.nan
    both = [(x, f * x if is_gain else f) for x, f in form.points if true["x"][0] <= x <= true["x"][-1]]
    if not both:
        return math.nan
    x, said = np.array(both).T
    f = np.interp(x, true["x"], true.get(form.name, true["f"]))
    return float(np.sqrt(np.mean((said - f) ** 2) / max(np.mean(f**2), 1e-24)))


def facts_of(truth: Mapping[str, Any]) -> tuple[Fact, ...]:
    """Hidden effects; a size that is not known counts as strong."""
    return tuple(
        Fact(
            *judged_by(e["effect"], e["where"]), dict(e["parameters"]), known=e["effect"] in EFFECTS,
            z=math.inf if e["detectability"] is None else float(e["detectability"]),
        )
        for e in truth["effects"]
    )  # fmt: skip


def beyond(answer: Answer, clean: Answer, facts: tuple[Fact, ...]) -> tuple[Answer, tuple[Fact, ...]]:
    """The answer without what the clean drive's says as well, and the truth as it stands in this drive.

    A hidden effect that the clean drive has by itself counts as found where its value moved by more than half of what was
    added; its true value is that of the clean verdict and what was added.
    """
    own = {c.key: c for c in clean.causes}
    sized = {f.key: _with_own(f, own[f.key]) if f.key in own else f for f in facts}
    kept = []
    for cause, chance in zip(answer.causes, answer.probability, strict=True):
        before, fact = own.get(cause.key), sized.get(cause.key)
        if fact is None and any(_is_same_lag(cause, old) for old in clean.causes):
            continue
        if before is None or (fact is not None and _moved(cause, before, fact)):
            kept.append((cause, chance))
    forms = tuple(f for f in answer.forms if not any(_alike(f, old) for old in clean.forms))
    verdict = answer.verdict
    if verdict in ("named", "compound", "cannot_tell") and not kept:
        verdict = "unexplained" if forms else "no_effect"  # a verdict has one word: the car's own faults took it
    elif verdict in ("named", "compound"):
        verdict = "named" if len(kept) == 1 else "compound"
    elif verdict == "unexplained" and not forms:
        verdict = "no_effect"
    new = replace(
        answer, verdict=verdict, causes=tuple(c for c, _ in kept), probability=tuple(p for _, p in kept), forms=forms
    )
    return new, tuple(sized[f.key] for f in facts)


def _is_same_lag(cause: Said, old: Said) -> bool:
    """A lag between two signals is that of the one or, turned, of the other: places and signs are exchangeable."""
    if cause.effect != old.effect or cause.effect not in LAGS:
        return False
    (_, low, high), (_, a, b) = (next(iter(c.values.values()), (math.nan,) * 3) for c in (cause, old))
    return (low <= b and a <= high) or (low <= -a and -b <= high)


def _alike(a: Form, b: Form) -> bool:
    return a.depends_on == b.depends_on and bool(set(a.mechanisms) & set(b.mechanisms))


def limited(fact: Fact) -> float:
    """Deviation of the parameter that the limit of an effect is stated for: its first one."""
    names = [p.name for p in EFFECTS[fact.effect].parameters] if fact.effect in EFFECTS else []
    name = next((n for n in names if n in fact.values), next(iter(fact.values), ""))
    return abs(fact.values.get(name, 0.0) - _neutral(fact.effect, name))


def _neutral(effect: str, name: str) -> float:
    known = {p.name: p.neutral for p in EFFECTS[effect].parameters} if effect in EFFECTS else {}
    return float(known.get(name, 0.0))


def _with_own(fact: Fact, own: Said) -> Fact:
    values = dict(fact.values)
    for name, x in fact.values.items():
        if name in own.values:
            before = own.values[name][0]
            values[name] = x * before if _neutral(fact.effect, name) == 1.0 else x + before
    return replace(fact, values=values)


def _moved(cause: Said, before: Said, fact: Fact) -> bool:
    shared = [n for n in fact.values if n in cause.values and n in before.values]
    if not shared:
        return False
    name = shared[0]
    added = fact.values[name] - before.values[name][0]  # the fact holds the sum already
    return (cause.values[name][0] - before.values[name][0]) * math.copysign(1.0, added) > 0.5 * abs(added)


def judge(
    key: str, answer: Answer, truth: Mapping[str, Any], *, clean: Answer | None = None,
    cost: Mapping[str, float] | None = None,
) -> Judged:  # fmt: skip
    """One case: `clean` is the verdict on the same drive without the effects, where that drive was measured."""
    facts = facts_of(truth)
    if clean is not None:
        answer, facts = beyond(answer, clean, facts)
    told = [answer.told.get(f.key, math.nan) for f in facts]
    facts = tuple(replace(f, p_right=p) for f, p in zip(facts, told, strict=True))
    used = cost or {}
    row = Row(
        key, truth["kind"], truth["drive_type"], truth["noise"], truth["seed"], truth=facts, causes=answer.causes,
        verdict="" if answer.error else answer.verdict, alternatives=answer.alternatives, p_value=answer.p_value,
        limits=answer.limits, separation=truth.get("separation", 1.0), gain=answer.gain, worse=answer.worse,
        oracle=truth.get("oracle_gain", math.nan), error=answer.error,
        **{n: used.get(n, math.nan) for n in ("seconds", "cpu_seconds", "peak_mb")},
    )  # fmt: skip
    causes = zip(answer.causes, answer.probability, strict=True)
    unknown = truth["unknown"]
    right = set(row.hidden).union((unknown or {}).get("accepts") or (), *(exact_twins(f.effect) for f in facts))
    chances = [(p, c.key in right or c.effect in right - set(row.hidden)) for c, p in causes if math.isfinite(p)]
    for f in answer.forms:
        if math.isfinite(f.probability):
            chances.append((f.probability, unknown is not None and fits(f, unknown, exact=True)))
    return Judged(
        row, truth["world"], truth["kind"], answer.forms, unknown, tuple(chances), answer.gain_low, answer.probability,
        is_baseline=bool(truth.get("is_baseline")), is_measured=clean is not None,
    )  # fmt: skip
