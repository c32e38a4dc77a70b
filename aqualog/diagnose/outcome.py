"""From refitted sets to a verdict: named causes, causes that cannot be distinguished, open questions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from aqualog.diagnose.evidence import Evidence
from aqualog.diagnose.hypotheses import value_in
from aqualog.diagnose.records import Alternative, Cause, Estimate, Verdict
from aqualog.diagnose.refit import Refit
from aqualog.diagnose.search import CREDIBLE, Candidate
from aqualog.diagnose.words import cause_sentence
from aqualog.model.term import Model

__all__ = ["Outcome", "causes_of", "conclude", "one_per_name"]

Z = 1.959964  # 97.5 % quantile of the normal distribution
BEYOND_DOUBT = 1e-5  # p-value from which a test counts as a finding although no effect and no function confirms it
PLACES = 5.0  # evidence ratio within which the whole car is preferred to a part of it
EXPLAINS = 0.03  # relative fall of a channel's rms from which on an effect explains it


class Outcome(NamedTuple):
    """Verdict, causes, alternatives; `chosen` is the refit that the extended model is made of, None without causes.

    `certain`: effects that every credible set has. `small`: sentences about deviations that are significant and too
    small to be worth naming.
    """

    verdict: Verdict
    causes: tuple[Cause, ...]
    alternatives: tuple[Alternative, ...]
    chosen: Refit | None
    small: tuple[str, ...]
    certain: frozenset[str] = frozenset()


def conclude(evidence: Evidence, candidates: Sequence[Candidate], model: Model, *, p_value: float) -> Outcome:
    """The verdict on refitted sets, best first; without any: `no_effect`, or `unexplained` if the test is beyond doubt.

    A set is credible if the best one's evidence is less than 20 times its own. Members of every credible set are
    certain. Places of one effect that cannot be distinguished count as one cause, at the whole car if that is one of
    them.
    """
    if not candidates:
        return Outcome("unexplained" if p_value < BEYOND_DOUBT else "no_effect", (), (), None, ())
    every_place = [c for c in candidates if c.evidence_ratio < CREDIBLE]
    credible = one_per_name(every_place)
    best = credible[0]
    own = causes_of(evidence, best, model)
    worth = [_worth_naming(best, i, model) for i in range(len(best.refit.members))]
    small = tuple(
        f"Significant, but too small to be worth naming: {c.sentence}" for c, w in zip(own, worth, strict=True) if not w
    )
    if not any(worth):
        return Outcome("no_effect", (), (), None, small)
    small += _other_places(evidence, best, every_place, model)
    named = tuple(c for c, w in zip(own, worth, strict=True) if w)
    others = tuple(
        Alternative(large, c.evidence_ratio)
        for c in credible[1:]
        if (large := _large(evidence, c, model)) and {x.effect for x in large} != {x.effect for x in named}
    )
    if not others:
        return Outcome("named" if len(named) == 1 else "compound", named, (), best.refit, small)
    every = [named, *(a.causes for a in others)]
    certain = set.intersection(*({c.effect for c in s} for s in every))
    union: dict[str, Cause] = {}
    for s in every:
        for c in s:
            union.setdefault(c.effect, c)
    shown = tuple(c for c in union.values() if c.effect in certain) + tuple(
        c for c in union.values() if c.effect not in certain
    )
    return Outcome("cannot_tell", shown, others, best.refit, small, frozenset(certain))


def _other_places(evidence: Evidence, best: Candidate, credible: Sequence[Candidate], model: Model) -> tuple[str, ...]:
    """Sentences about the same effects at other places that explain the log as well, or nearly so."""
    names = sorted(h.effect.name for h in best.refit.members)
    own = {h.key for h in best.refit.members}
    out = []
    for c in credible:
        is_near = _sharp(c) - _sharp(best) < 2.0 * math.log(CREDIBLE) * best.inflation
        if c.refit is not best.refit and is_near and sorted(h.effect.name for h in c.refit.members) == names:
            out += [f"Equally possible: {x.sentence}" for x in causes_of(evidence, c, model) if x.key not in own]
    return tuple(dict.fromkeys(out))


def one_per_name(credible: Sequence[Candidate]) -> list[Candidate]:
    """One candidate for each set of effects: the one at the whole car, unless another place is clearly better.

    All tolerances together can hide a wrong place: the form of a tyre's curve absorbs a difference between left and
    right wheel. So places are compared with only a part of the tolerances.
    """
    groups: dict[tuple[str, ...], list[Candidate]] = {}
    for c in credible:
        groups.setdefault(tuple(sorted(h.effect.name for h in c.refit.members)), []).append(c)
    out = []
    for own in groups.values():
        best = min(own, key=_sharp) if not any(math.isnan(c.sharp) for c in own) else own[0]
        near = [c for c in own if _sharp(c) - _sharp(best) < 2.0 * math.log(PLACES) * c.inflation]
        chosen = max([best, *near], key=_whole)
        out.append(replace(chosen, evidence_ratio=min(c.evidence_ratio for c in own)))
    return out


def _sharp(c: Candidate) -> float:
    """Loss with part of the tolerances; the evidence replaces it where it was not computed."""
    return 2.0 * math.log(c.evidence_ratio) * c.inflation if math.isnan(c.sharp) else c.sharp


def _whole(c: Candidate) -> int:
    return sum(h.where is None for h in c.refit.members)


def _large(evidence: Evidence, candidate: Candidate, model: Model) -> tuple[Cause, ...]:
    """The causes of a set that are worth naming."""
    causes = causes_of(evidence, candidate, model)
    return tuple(c for i, c in enumerate(causes) if _worth_naming(candidate, i, model))


def _worth_naming(candidate: Candidate, member: int, model: Model) -> bool:
    """Whether a value of a member reaches its smallest size and its interval excludes zero effect."""
    r = candidate.refit
    h = r.members[member]
    sd = candidate.sd
    for k, (i, name) in enumerate(r.names):
        if i != member:
            continue
        off = abs(float(r.values[k]) - value_in(model, h, name))
        if off >= max(h.worth_naming(name), Z * float(sd[k])):
            return True
    return False


def causes_of(evidence: Evidence, candidate: Candidate, model: Model) -> tuple[Cause, ...]:
    """The members of a set with values, intervals and sentences."""
    r = candidate.refit
    sd = candidate.sd
    explained = _explained(evidence, r, model)
    out = []
    for i, h in enumerate(r.members):
        parameters = {}
        for k, (owner, name) in enumerate(r.names):
            if owner == i:
                p = h.parameter(name)
                v, s = float(r.values[k]), Z * float(sd[k])
                parameters[name] = Estimate(v, max(v - s, p.low), min(v + s, p.high), p.unit)
        for name, v in h.fixed.items():
            if name in {p.name for p in h.effect.parameters} and name not in parameters:
                parameters[name] = Estimate(float(v), math.nan, math.nan, h.parameter(name).unit)
        sentence = cause_sentence(h.effect, h.where, parameters)
        out.append(Cause(h.effect.name, h.where, parameters, explained[i], sentence))
    return tuple(out)


def _explained(evidence: Evidence, r: Refit, model: Model) -> list[tuple[str, ...]]:
    """Channels whose rms would rise again without a member."""
    channels = evidence.drives[0].channels
    out: list[tuple[str, ...]] = []
    k = 0
    for h in r.members:
        shares = np.zeros(len(channels))
        for d, left, own in zip(evidence.drives, r.residuals, r.signatures, strict=True):
            theta = r.values[k : k + len(h.free)] - np.array([value_in(model, h, n) for n in h.free])
            without = left + np.tensordot(theta, own[k : k + len(h.free)], axes=1)
            now = np.sqrt((left[:, d.mask] ** 2).mean(axis=1))
            then = np.sqrt((without[:, d.mask] ** 2).mean(axis=1))
            shares += then / np.maximum(now, 1e-15) - 1.0
        shares /= len(evidence.drives)
        k += len(h.free)
        names = tuple(c for c, s in zip(channels, shares, strict=True) if s > EXPLAINS)
        out.append(names or (channels[int(np.argmax(shares))],))
    return out
