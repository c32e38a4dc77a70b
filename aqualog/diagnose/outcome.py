"""From sets with evidence to a verdict: named causes with probabilities, causes that cannot be distinguished."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.diagnose.arena import Arena
from aqualog.diagnose.compete import Members, Posterior, fitted
from aqualog.diagnose.hypotheses import Hypothesis, value_in, with_values
from aqualog.diagnose.judge import repeats
from aqualog.diagnose.probability import SURE, tempered
from aqualog.diagnose.records import Alternative, Cause, Estimate, Verdict
from aqualog.diagnose.refit import Refit
from aqualog.diagnose.search import Found, Option, sharpened
from aqualog.diagnose.sets import grouped, shares
from aqualog.diagnose.words import cause_sentence
from aqualog.model.term import Model

__all__ = ["Outcome", "conclude", "with_causes"]

Z = 1.959964  # 97.5 % quantile of the normal distribution
CREDIBLE = 20.0  # evidence ratio within which places of one effect cannot be distinguished
PLACES = 5.0  # evidence ratio within which the whole car is preferred to a part of it
EXPLAINS = 0.03  # relative fall of a channel's rms from which on an effect explains it
LEAST_SHARE = 1e-4  # probability of a set, below which its values are not looked at


class Outcome(NamedTuple):
    """Verdict, causes, alternatives; `chosen` is the refit that the extended model is made of, None without causes.

    `certain`: effects that are there beyond doubt. `small`: sentences about deviations that are significant and too
    small to be worth naming.
    """

    verdict: Verdict
    causes: tuple[Cause, ...]
    alternatives: tuple[Alternative, ...] = ()
    chosen: Refit | None = None
    small: tuple[str, ...] = ()
    certain: frozenset[str] = frozenset()
    rivals: tuple[Rival, ...] = ()


class Rival(NamedTuple):
    """A refitted set that remains, and its probability."""

    refit: Refit
    probability: float


@dataclass(frozen=True, slots=True)
class _Set:
    """A set's causes, whether each is worth naming, and its share of the posterior."""

    option: Option
    causes: tuple[tuple[Cause, bool], ...]
    share: float
    sharp: float = math.nan

    @property
    def large(self) -> tuple[Cause, ...]:
        return tuple(c for c, is_large in self.causes if is_large)

    @property
    def names(self) -> frozenset[str]:
        return frozenset(c.effect for c in self.large)


def conclude(found: Found, model: Model) -> Outcome:
    """The verdict on what a search found.

    An unknown form comes before any name; beside it stand the effects of the same set whose probability is 0.95 or
    more. A name needs that probability too, and must pass the checks of `judge.repeats`. Else the answer is what the
    posterior consists of, up to 0.95. Sets whose causes worth naming are the same count together.
    """
    if found.forms:
        linear = _linear(found.arena, found.posterior, found.posterior.best, model)
        share = {n: tempered(p) for n, p in found.posterior.marginal.items()}
        causes = (replace(c, probability=share.get(c.effect, 0.0)) for c, large in linear if large)
        beside = tuple(c for c in causes if c.probability >= SURE)
        return Outcome("unexplained", beside, certain=frozenset(c.effect for c in beside))
    sets = _sets(found, model)
    together = grouped([s.names for s in sets], [s.share for s in sets])
    ranked = [[sets[i] for i in g] for g in together.groups]
    marginal = together.marginal
    if not ranked or not ranked[0][0].names:
        first = ranked[0][0].causes if ranked else ()
        return Outcome("no_effect", (), small=_small([c for c, large in first if not large]))
    best = _at_place(found, ranked[0], model)
    own = _with_probability(best.large, marginal)
    small = _small([c for c, is_large in best.causes if not is_large]) + _other_places(best, ranked[0])
    chosen = best.option.refit
    failed = repeats(chosen, found.arena, [w.noise for w in found.posterior.weighings], model) if chosen else ()
    unsure = frozenset(c.effect for c in own if c.probability < SURE)
    if not unsure and not failed:
        verdict: Verdict = "named" if len(own) == 1 else "compound"
        return Outcome(verdict, own, (), chosen, small, best.names)
    others, total = [], sum(s.share for s in ranked[0])
    rivals = [(best, total)]
    for g in ranked[1:]:
        if total >= SURE:
            break
        weight = sum(s.share for s in g)
        total += weight
        if g[0].names:
            ratio = math.exp(min(max(ranked[0][0].option.evidence - g[0].option.evidence, 0.0), 700.0))
            rivals.append((_at_place(found, g, model), weight))
            others.append(Alternative(_with_probability(rivals[-1][0].large, marginal), ratio))
    shown = {c.effect: c for a in reversed(others) for c in a.causes} | {c.effect: c for c in own}
    names = [c.effect for c in own] + [n for n in shown if n not in best.names]
    certain = frozenset() if failed else best.names - unsure
    ordered = sorted(names, key=lambda n: n not in certain)
    small += tuple(f"Not named: {reason}" for reason in failed)
    return Outcome(
        "cannot_tell", tuple(shown[n] for n in ordered), tuple(others), chosen, small, certain,
        tuple(Rival(s.option.refit, q / total) for s, q in rivals if s.option.refit is not None),
    )  # fmt: skip


def _with_probability(causes: Sequence[Cause], marginal: Mapping[str, float]) -> tuple[Cause, ...]:
    return tuple(replace(c, probability=tempered(marginal.get(c.effect, 0.0))) for c in causes)


def _small(causes: Sequence[Cause]) -> tuple[str, ...]:
    return tuple(f"Significant, but too small to be worth naming: {c.sentence}" for c in causes)


def _sets(found: Found, model: Model) -> list[_Set]:
    """Options with their causes and shares, most likely first."""
    if not found.options:
        return []
    p = shares([o.evidence for o in found.options])
    out = []
    for o, share in zip(found.options, p.tolist(), strict=True):
        if share < LEAST_SHARE:
            continue
        if o.refit is not None:
            causes = _refitted(found, o.refit, model)
        else:
            causes = _linear(found.arena, found.posterior, o.members, model)
        out.append(_Set(o, tuple(causes), share))
    return sorted(out, key=lambda s: -s.share)


def _at_place(found: Found, group: Sequence[_Set], model: Model) -> _Set:
    """The set at the whole car, unless another place is clearly better; with the values that a metric of few
    tolerances gives."""
    top = group[0].share
    near = [s for s in group if s.option.refit is not None and s.share > top / CREDIBLE]
    if not near:
        return group[0]
    sharp = []
    for s in near:
        refit, loss = sharpened(found, s.option, model)
        causes = tuple(_refitted(found, refit, model)) if refit is not None else s.causes
        kept = replace(s, option=replace(s.option, refit=refit), causes=causes, sharp=loss)
        # with fewer tolerances a value may fall below what is worth naming
        sharp.append(kept if kept.names == s.names else replace(s, sharp=loss))
    best = min(sharp, key=lambda s: s.sharp)
    return max(
        [best, *(s for s in sharp if s.sharp - best.sharp < 2.0 * math.log(PLACES))], key=lambda s: _whole(s.causes)
    )


def _whole(causes: Sequence[tuple[Cause, bool]]) -> int:
    return sum(c.where is None for c, _ in causes)


def _other_places(best: _Set, group: Sequence[_Set]) -> tuple[str, ...]:
    """Sentences about the same effects at other places that explain the log as well, or nearly so."""
    own = {c.key for c in best.large}
    near = [s for s in group if s.share * CREDIBLE > group[0].share]
    return tuple(
        dict.fromkeys(f"Equally possible: {c.sentence}" for s in near for c in s.large if c.key not in own)
    )  # fmt: skip


def _refitted(found: Found, r: Refit, model: Model) -> list[tuple[Cause, bool]]:
    """The members of a refitted set with values, intervals and sentences, and whether each is worth naming."""
    sd = np.sqrt(np.diag(r.covariance))
    off = r.values - np.array([value_in(model, r.members[i], n) for i, n in r.names])
    out = []
    for i, h in enumerate(r.members):
        k = [k for k, (owner, _) in enumerate(r.names) if owner == i]
        made = [np.tensordot(off[k], s[k], axes=1) for s in r.signatures]
        explains = _explains(found.arena, [x + m for x, m in zip(r.residuals, made, strict=True)], r.residuals)
        out.append(_cause(h, r.values[k], off[k], sd[k], explains))
    return out


def _linear(arena: Arena, posterior: Posterior, members: Members, model: Model) -> list[tuple[Cause, bool]]:
    """The known effects of a set with their values in the competition, and whether each is worth naming."""
    if not members:
        return []
    fit = fitted(arena, posterior.tolerant, members)
    sd = np.sqrt(np.diag(fit.covariance)) * arena.sd[fit.columns]
    mean = fit.mean * arena.sd[fit.columns]
    drives = arena.evidence.drives
    out = []
    for b in (arena.blocks[m] for m in members):
        if b.kind != "effect":
            continue  # an unknown form
        h, k = arena.evidence.asked[b.tag], [fit.columns.index(c) for c in b.columns]
        now = np.array([value_in(model, h, n) for n in h.free])
        made = [np.tensordot(mean[k], s[list(b.columns)], axes=1) for s in arena.evidence.signatures]
        before = arena.evidence.residuals
        explains = _explains(arena, before, [x - m for x, m in zip(before, made, strict=True)])
        assert len(drives) == len(made)
        out.append(_cause(h, now + mean[k], mean[k], sd[k], explains))
    return out


def _cause(
    h: Hypothesis, values: FloatArray, off: FloatArray, sd: FloatArray, explains: tuple[str, ...]
) -> tuple[Cause, bool]:
    """A cause, and whether a value reaches its smallest size and its interval excludes zero effect."""
    parameters, large = {}, False
    for name, x, change, s in zip(h.free, values.tolist(), off.tolist(), sd.tolist(), strict=True):
        p = h.parameter(name)
        v = min(max(x, p.low), p.high)
        parameters[name] = Estimate(v, max(v - Z * s, p.low), min(v + Z * s, p.high), p.unit)
        large |= abs(change) >= max(h.worth_naming(name), Z * s)
    for name, value in h.fixed.items():
        if name in {p.name for p in h.effect.parameters} and name not in parameters:
            parameters[name] = Estimate(float(value), math.nan, math.nan, h.parameter(name).unit)
    return Cause(h.effect.name, h.where, parameters, explains, cause_sentence(h.effect, h.where, parameters)), large


def _explains(arena: Arena, before: Sequence[FloatArray], after: Sequence[FloatArray]) -> tuple[str, ...]:
    """Channels whose rms falls, from residuals without and with an effect."""
    drives = arena.evidence.drives
    fall = np.zeros(len(drives[0].channels))
    for d, x, y in zip(drives, before, after, strict=True):
        then, now = (np.sqrt((z[:, d.mask] ** 2).mean(axis=1)) for z in (x, y))
        fall += then / np.maximum(now, 1e-15) - 1.0
    fall /= len(drives)
    channels = drives[0].channels
    return tuple(c for c, x in zip(channels, fall.tolist(), strict=True) if x > EXPLAINS) or (
        channels[int(np.argmax(fall))],
    )


def with_causes(model: Model, causes: Sequence[Cause], asked: Sequence[Hypothesis]) -> Model:
    """The model with causes at their values."""
    found = []
    for c in causes:
        values = {n: e.value for n, e in c.parameters.items()}
        for h in asked:
            if h.key == c.key and all(values.get(n, v) == v for n, v in h.fixed.items()):
                found.append((h, {n: values[n] for n in h.free}))
                break
    return with_values(model, found)
