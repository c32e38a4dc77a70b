"""The competition on the residuals of some drives: a posterior over sets of effects and shapes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.diagnose.arena import Arena
from aqualog.diagnose.competition import COARSE, SCALES, Block, State, added, scored, start, values
from aqualog.diagnose.spectrum import Weighing
from aqualog.diagnose.subsets import TWINS, compatible

__all__ = ["Fitted", "Posterior", "compete", "fitted"]

WIDTH = 8  # sets that are carried on
MOST = 4  # blocks in one set
SWAPPED = 3  # sets in which every member is exchanged
FEW = 4  # first candidates in each metric after which the noise is tried
CLEARLY = 1.0  # [nats] that a noise must make the measurement more likely
ROUNDS = 3  # of noise after the best set so far
DIES = 6.0  # [nats] behind the best set, at which a level of larger sets ends the search
SINGULAR = 1e-3  # share of a column's energy that the others of its set must leave
SMALLEST = 1e-12
BEYOND = 2.0  # standard deviations by which a value may be beyond a physical bound
OPTIMISM = 1.5  # [nats] a column by which noise after a fit is too likely

Members = tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Posterior:
    """`sets` by evidence with their prior, best first, and `probability` of each; `gram` plain, and `tolerant`, which
    is coarsened."""

    sets: tuple[tuple[Members, float], ...]
    probability: FloatArray
    marginal: Mapping[str, float]  # by name of effect or mechanism
    blocks: Mapping[int, float]  # by block
    gram: FloatArray
    tolerant: FloatArray
    weighings: tuple[Weighing, ...]

    @property
    def best(self) -> Members:
        """The most probable set."""
        return self.sets[0][0]


@dataclass(frozen=True, slots=True)
class Fitted:
    """A set's `columns`, posterior `mean` (k,) and `covariance` (k, k) in scaled values."""

    columns: list[int]
    mean: FloatArray
    covariance: FloatArray


def fitted(arena: Arena, tolerant: FloatArray, members: Sequence[int]) -> Fitted:
    """Values of all columns of a set together."""
    state = start(tolerant)
    scales = []
    for m in members:
        scales.append(scored(state, arena.blocks[m])[1])
        state = added(state, m, arena.blocks[m])
    return Fitted(*values(tolerant, [arena.blocks[m] for m in members], scales))


def compete(arena: Arena) -> Posterior:
    """The posterior over the sets that a search with swaps visits.

    The noise is that under which the measurement is most likely: after no block, after one of the first candidates in
    the metrics of coloured and of white noise, or after the best set so far. Else a slow effect would count as noise
    and could not be found. The noise is sought with the whole likelihood, the posterior has a share of it.
    """
    weighings = arena.weighed([p.residual for p in arena.parts])
    white = arena.tolerant(arena.white())
    gram = arena.inner(weighings)
    best: Members = ()
    least = _surprise(weighings)
    for _ in range(ROUNDS):
        tolerant = arena.tolerant(gram)
        quieter = _quieter(arena, best, (tolerant, white), least)
        if quieter is not None:
            least, weighings = quieter
            gram = arena.inner(weighings)
            tolerant = arena.tolerant(gram)
        sets = _searched(arena, gram, tolerant)
        now = max(sets, key=lambda k: sets[k])
        again = arena.weighed(_left(arena, tolerant, now)) if now else weighings
        is_better = _surprise(again) < _surprise(weighings) - CLEARLY
        if is_better:
            weighings = again
            least = _surprise(again) + _price(arena, now)
            gram = arena.inner(weighings)
        if now == best or not (is_better or quieter):
            break
        best = now
    tolerant = arena.tolerant(COARSE * gram)
    return _posterior(arena, _searched(arena, gram, tolerant), gram, tolerant, weighings)


def _quieter(
    arena: Arena, best: Members, metrics: Sequence[FloatArray], least: float
) -> tuple[float, tuple[Weighing, ...]] | None:
    """Noise after one block more than the best set, under which the measurement is clearly more likely."""
    found = None
    for metric in metrics:
        for m in _first(arena, metric, best):
            members = (*best, m)
            again = arena.weighed(_left(arena, metric, members))
            score = _surprise(again) + _price(arena, members)
            if score < least - CLEARLY:
                least, found = score, again
    return None if found is None else (least, found)


def _price(arena: Arena, members: Members) -> float:
    return OPTIMISM * sum(len(arena.blocks[m].columns) for m in members)


def _posterior(
    arena: Arena, sets: Mapping[Members, float], gram: FloatArray, tolerant: FloatArray, weighings: Sequence[Weighing]
) -> Posterior:
    ranked = tuple(sorted(sets.items(), key=lambda x: -x[1]))
    z = np.array([e for _, e in ranked])
    p = np.exp(z - z.max())
    p /= p.sum()
    by_name: dict[str, float] = {}
    by_block: dict[int, float] = {}
    for (members, _), q in zip(ranked, p.tolist(), strict=True):
        for name in {arena.name(m) for m in members}:
            by_name[name] = by_name.get(name, 0.0) + q
        for m in members:
            by_block[m] = by_block.get(m, 0.0) + q
    return Posterior(ranked, p, by_name, by_block, gram, tolerant, tuple(weighings))


def _surprise(weighings: Sequence[Weighing]) -> float:
    return sum(w.surprise for w in weighings)


def _first(arena: Arena, metric: FloatArray, beside: Members) -> list[int]:
    """The few blocks that gain most beside a set, without functions of time and place: those could be slow noise."""
    state = start(metric)
    for m in beside:
        state = added(state, m, arena.blocks[m])
    gains = [
        (scored(state, b)[0] + b.log_prior, i)
        for i, b in enumerate(arena.blocks)
        if i not in beside and _shows(arena, state, b, metric) and not arena.is_along(b)
    ]
    return [i for gain, i in sorted(gains, reverse=True)[:FEW] if gain > 0.0]


def _left(arena: Arena, metric: FloatArray, members: Members) -> list[FloatArray]:
    """The residual of each part without what a set explains."""
    fit = fitted(arena, metric, members)
    out = []
    for i, p in enumerate(arena.parts):
        columns = np.concatenate([arena.drawn(i, arena.blocks[m]) for m in members])
        out.append(p.residual - np.tensordot(fit.mean, columns, axes=1))
    return out


def _searched(arena: Arena, gram: FloatArray, tolerant: FloatArray) -> dict[Members, float]:
    """Evidence of the sets that are visited: the best ones of each size carried on, then members exchanged."""
    states = [start(tolerant)]
    sets: dict[Members, float] = {(): 0.0}
    for _ in range(MOST):
        new: dict[Members, tuple[float, State, int]] = {}
        for state in states:
            for i, gain in _joining(arena, gram, tolerant, state):
                key = tuple(sorted((*state.members, i)))
                total = state.evidence + gain
                if key not in new or new[key][0] < total:
                    new[key] = (total, state, i)
        for key, (total, _, _) in new.items():
            sets.setdefault(key, total)
        top = sorted(new.values(), key=lambda x: -x[0])[:WIDTH]
        if not top or top[0][0] < max(sets.values()) - DIES:
            break
        states = [added(state, i, arena.blocks[i]) for _, state, i in top]
    for members in sorted(sets, key=lambda k: -sets[k])[:SWAPPED]:
        for out in members if len(members) > 1 else ():
            state = start(tolerant)
            for m in members:
                if m != out:
                    state = added(state, m, arena.blocks[m])
            for i, gain in _joining(arena, gram, tolerant, state):
                key = tuple(sorted((*state.members, i)))
                sets[key] = max(sets.get(key, -math.inf), state.evidence + gain)
    return sets


def _joining(arena: Arena, gram: FloatArray, tolerant: FloatArray, state: State) -> list[tuple[int, float]]:
    """Blocks that may join a set, with what each gains."""
    return [
        (i, scored(state, b)[0] + b.log_prior)
        for i, b in enumerate(arena.blocks)
        if i not in state.members and _may_join(arena, gram, state, b) and _shows(arena, state, b, tolerant)
    ]


def _may_join(arena: Arena, gram: FloatArray, state: State, block: Block) -> bool:
    if block.kind != "effect":
        return True
    asked = arena.evidence.asked
    own = asked[block.tag].effect
    known = [arena.blocks[m] for m in state.members if arena.blocks[m].kind == "effect"]
    if any(asked[o.tag].effect is own for o in known) and not compatible(
        arena.evidence, (*(o.tag for o in known), block.tag)
    ):
        return False
    for o in known:
        other = asked[o.tag].effect
        if other.name in own.twins or own.name in other.twins:
            c, e = block.columns[0], o.columns[0]
            if 1.0 - gram[c, e] ** 2 / max(gram[c, c] * gram[e, e], 1e-30) < TWINS:
                return False
    return True


def _shows(arena: Arena, state: State, block: Block, tolerant: FloatArray) -> bool:
    """Whether a set leaves enough of a single column, and the values are not clearly beyond their bounds."""
    c, A = list(block.columns), state.inner
    if len(c) == 1 and A[c[0], c[0]] < max(SINGULAR * tolerant[c[0], c[0]], SMALLEST):
        return False
    if block.low is None or block.high is None:
        return True
    cov = np.linalg.inv(A[np.ix_(c, c)] + np.linalg.inv(SCALES[-1] ** 2 * block.prior))
    value, reach = cov @ A[c, -1], BEYOND * np.sqrt(np.diag(cov))
    return bool(np.all(value >= block.low - reach) and np.all(value <= block.high + reach))
