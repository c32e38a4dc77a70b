"""From sets of effects with their shares of the posterior to a verdict, on a drive and over a campaign alike."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Generic, NamedTuple, TypeVar

from aqualog.diagnose.competition import shares
from aqualog.diagnose.records import SURE, Alternative, Cause, Verdict, tempered
from aqualog.diagnose.threads import beside

__all__ = ["CREDIBLE", "PLACES", "Candidate", "Causes", "Outcome", "candidates", "decided", "whole"]

CREDIBLE = 20.0  # evidence ratio within which places of one effect cannot be distinguished
PLACES = 5.0  # evidence ratio within which the whole car is preferred to a part of it
DOUBTED = 0.9  # most probability of what fails a check, below that of a name
WORTH_SAYING = 0.05  # probability of a set that is not named, from which a note tells of it
LEAST_SHARE = 1e-4  # probability of a set, below which its values are not looked at

Option = TypeVar("Option")
Causes = tuple[tuple[Cause, bool], ...]


@dataclass(frozen=True, slots=True)
class Candidate(Generic[Option]):
    """A set's causes, whether each is worth naming, its log `evidence` and its `share` of the posterior; `torn`: sets
    with the same effects at other wheels, between which and this one nothing decides."""

    option: Option
    causes: Causes
    evidence: float
    share: float
    sharp: float = math.nan
    torn: tuple[Candidate[Option], ...] = ()

    @property
    def large(self) -> tuple[Cause, ...]:
        """Causes worth naming."""
        return tuple(c for c, is_large in self.causes if is_large)

    @property
    def names(self) -> frozenset[str]:
        """Their names."""
        return frozenset(c.name for c in self.large)


class Outcome(NamedTuple, Generic[Option]):
    """Verdict, causes, alternatives; `best`: the set that the extended model is made of, None without causes;
    `certain`: effects beyond doubt; `rivals`: what remains, with its share, where the causes cannot be distinguished;
    `notes`: what is too small, what other places are as likely, what speaks against a name."""

    verdict: Verdict
    causes: tuple[Cause, ...] = ()
    alternatives: tuple[Alternative, ...] = ()
    best: Candidate[Option] | None = None
    certain: frozenset[str] = frozenset()
    rivals: tuple[tuple[Candidate[Option], float], ...] = ()
    notes: tuple[str, ...] = ()

    def doubted(self, why: str, *, certain: frozenset[str] = frozenset()) -> Outcome[Option]:
        """The outcome without a name, because of what a note says; `certain`: effects that stay so."""
        causes = tuple(
            c if c.effect in certain else replace(c, probability=min(c.probability, DOUBTED)) for c in self.causes
        )
        notes = (*self.notes, f"Not named: {why}")
        return self._replace(verdict="cannot_tell", causes=causes, certain=certain, notes=notes)

    def beside(self, *sure: Cause) -> Outcome[Option]:
        """The outcome with causes that are certain, whatever its own are."""
        verdict, causes = self.verdict, (*self.causes, *sure)
        if sure and verdict in ("no_effect", "named", "compound"):
            verdict = "named" if len(causes) == 1 else "compound"
        return self._replace(verdict=verdict, causes=causes, certain=self.certain | {c.effect for c in sure})


def candidates(
    options: Sequence[tuple[Option, float]], causes: Callable[[Option], Causes | None]
) -> list[Candidate[Option]]:  # fmt: skip
    """Options and their log evidence as sets with causes, most likely first, without those that hardly count; None for
    causes: a set that stands for another one, which has its share."""
    if not options:
        return []
    p = shares([e for _, e in options]).tolist()
    each = [(o, causes(o), e) for (o, e), q in zip(options, p, strict=True) if q >= LEAST_SHARE]
    kept = [(o, own, e) for o, own, e in each if own is not None]
    p = shares([e for *_, e in kept]).tolist() if kept else []
    out = [Candidate(o, own, e, q) for (o, own, e), q in zip(kept, p, strict=True)]
    return sorted(out, key=lambda s: -s.share)


def whole(s: Candidate[Option]) -> int:
    """How many causes act on the whole car, in all drives."""
    return sum(c.where is None and not c.drives for c, _ in s.causes)


def decided(
    sets: Sequence[Candidate[Option]],
    pick: Callable[[Sequence[Candidate[Option]]], Candidate[Option]],
    failing: Callable[[Candidate[Option]], Sequence[str]],
) -> Outcome[Option]:
    """The verdict on sets without an unknown form. A name needs a probability of 0.95. Else the answer is what the
    posterior consists of, up to 0.95. Sets whose causes worth naming are the same count together: `pick` says which one
    of a group that differs in places only stands for it, `failing` what speaks against naming a set's causes."""
    groups: dict[frozenset[str], list[Candidate[Option]]] = {}
    marginal: dict[tuple[str, Sequence[str]], float] = {}
    for s in sets:
        groups.setdefault(s.names, []).append(s)
        marginal.update({n: marginal.get(n, 0.0) + s.share for n in {(c.name, c.drives) for c in s.large}})
    ranked = sorted(groups.values(), key=lambda g: -sum(s.share for s in g))
    if not ranked or not ranked[0][0].names:
        return Outcome("no_effect", notes=(*_small(ranked[0][0]), *_likeliest(ranked[1:2])) if ranked else ())
    best, group = pick(ranked[0]), tuple(ranked[0])
    own = _with_probability(best.large, marginal)
    # the same effects at other places that explain the log as well, or nearly so
    near = [c for s in group if s.share * CREDIBLE > group[0].share for c in s.large]
    here = {(c.key, c.drives) for c in best.large}
    own, others = _torn(best, own, marginal)
    torn = {c.key: c for a in others for c in a.causes if (c.key, c.drives) not in here}
    here |= {(c.key, c.drives) for c in torn.values()}
    elsewhere = [c.sentence for c in near if (c.key, c.drives) not in here]
    notes = _small(best) + tuple(dict.fromkeys(f"Equally possible: {s}" for s in elsewhere))
    failed = failing(best)
    if failed:
        own = tuple(replace(c, probability=min(c.probability, DOUBTED)) for c in own)
    unsure = frozenset(c.name for c in own if c.probability < SURE)
    if not unsure and not failed:
        certain = frozenset(c.effect for c in own)
        return Outcome("named" if len(own) == 1 else "compound", own, (), best, certain, (), notes)
    total = sum(s.share for s in group)
    rivals, rest = [(best, total - sum(s.share for s in best.torn)), *((s, s.share) for s in best.torn)], []
    for g in ranked[1:]:
        if total >= SURE:
            break
        total += sum(s.share for s in g)
        if g[0].names:
            rest.append(g)
    for g, picked in zip(rest, beside(pick, rest), strict=True):
        ratio = math.exp(min(max(group[0].evidence - g[0].evidence, 0.0), 700.0))
        rivals.append((picked, sum(s.share for s in g)))
        others += (Alternative(_with_probability(picked.large, marginal), ratio),)
    certain = frozenset(c.effect for c in own if not failed and c.name not in unsure)
    # the best set whole, one effect at two places too; of the others what it does not have
    more = {c.name: c for a in reversed(others) for c in a.causes if c.name not in best.names}
    shown = sorted([*own, *torn.values(), *more.values()], key=lambda c: (c.effect not in certain, -c.probability))
    notes += tuple(f"Not named: {reason}" for reason in failed)
    remain = tuple((s, q / total) for s, q in rivals)
    return Outcome("cannot_tell", tuple(shown), others, best, certain, remain, notes)


def _torn(
    best: Candidate[Option], own: tuple[Cause, ...], marginal: Mapping[tuple[str, Sequence[str]], float]
) -> tuple[tuple[Cause, ...], tuple[Alternative, ...]]:
    """The causes of the best set, and what other wheels make of it that are as likely: they share the probability."""
    here, total = {(c.key, c.drives) for c in own}, best.share + sum(s.share for s in best.torn)
    at: dict[frozenset[str], list[Candidate[Option]]] = {}
    for s in best.torn:
        at.setdefault(frozenset(c.key for c in s.large), []).append(s)
    there, names = [], set()
    for sets in at.values():
        share, causes = sum(s.share for s in sets), []
        for c in _with_probability(sets[0].large, marginal):
            is_own = (c.key, c.drives) in here
            causes.append(c if is_own else replace(c, probability=c.probability * share / total))
            names |= set() if is_own else {(c.effect, c.drives)}
        there.append(Alternative(tuple(causes), best.share / share))
    left = best.share / total
    kept = (replace(c, probability=c.probability * left) if (c.effect, c.drives) in names else c for c in own)
    return tuple(kept), tuple(there)


def _with_probability(
    causes: Sequence[Cause], marginal: Mapping[tuple[str, Sequence[str]], float]
) -> tuple[Cause, ...]:  # fmt: skip
    """The causes with that of their name at any place, in these drives."""
    return tuple(replace(c, probability=tempered(marginal.get((c.name, c.drives), 0.0))) for c in causes)


def _likeliest(groups: Sequence[Sequence[Candidate[Option]]]) -> list[str]:
    """What is said of the likeliest effects where no effect at all is likelier still."""
    each = [(sum(s.share for s in g), " ".join(c.sentence for c in g[0].large)) for g in groups]
    return [f"Not named, with a probability of {p:.2f}: {said}" for p, said in each if p >= WORTH_SAYING]


def _small(s: Candidate[Option]) -> tuple[str, ...]:
    return tuple(f"Significant, but too small to be worth naming: {c.sentence}" for c, large in s.causes if not large)
