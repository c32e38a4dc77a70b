"""The competition on the residuals of some drives: a posterior over sets of effects and shapes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.diagnose.arena import Arena
from aqualog.diagnose.competition import COARSE, Block, State
from aqualog.diagnose.evidence import Evidence
from aqualog.diagnose.sets import Fitted, MayJoin, Members, Sets, first_of, fitted_in, ranked, searched
from aqualog.diagnose.spectrum import Weighing
from aqualog.diagnose.subsets import TWINS, compatible

__all__ = ["Fitted", "Members", "Posterior", "compete", "fitted", "rule"]

ROUNDS = 3  # of noise after the best set so far
CLEARLY = 1.0  # [nats] that a noise must make the measurement more likely
OPTIMISM = 1.5  # [nats] a column by which noise after a fit is too likely


@dataclass(frozen=True, slots=True)
class Posterior(Sets):
    """The posterior over sets with its inner products, `gram` plain and `tolerant`."""

    gram: FloatArray
    tolerant: FloatArray
    weighings: tuple[Weighing, ...]


def fitted(arena: Arena, tolerant: FloatArray, members: Sequence[int]) -> Fitted:
    """Values of all columns of a set together."""
    return fitted_in(arena.blocks, tolerant, members)


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
        sets = searched(arena.blocks, tolerant, rule(arena.evidence, arena.blocks, gram))
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
    sets = searched(arena.blocks, tolerant, rule(arena.evidence, arena.blocks, gram))
    found = ranked(sets, arena.name)
    return Posterior(found.sets, found.probability, found.marginal, found.blocks, gram, tolerant, tuple(weighings))


def _quieter(
    arena: Arena, best: Members, metrics: Sequence[FloatArray], least: float
) -> tuple[float, tuple[Weighing, ...]] | None:
    """Noise after one block more than the best set, under which the measurement is clearly more likely.

    Functions of time and place are left out: they could be slow noise.
    """
    found = None
    along = {i for i, b in enumerate(arena.blocks) if arena.is_along(b)}
    for metric in metrics:
        for m in first_of(arena.blocks, metric, best, but=along):
            members = (*best, m)
            again = arena.weighed(_left(arena, metric, members))
            score = _surprise(again) + _price(arena, members)
            if score < least - CLEARLY:
                least, found = score, again
    return None if found is None else (least, found)


def _price(arena: Arena, members: Members) -> float:
    return OPTIMISM * sum(len(arena.blocks[m].columns) for m in members)


def _surprise(weighings: Sequence[Weighing]) -> float:
    return sum(w.surprise for w in weighings)


def _left(arena: Arena, metric: FloatArray, members: Members) -> list[FloatArray]:
    """The residual of each part without what a set explains."""
    fit = fitted(arena, metric, members)
    out = []
    for i, p in enumerate(arena.parts):
        columns = np.concatenate([arena.drawn(i, arena.blocks[m]) for m in members])
        out.append(p.residual - np.tensordot(fit.mean, columns, axes=1))
    return out


def rule(evidence: Evidence, blocks: Sequence[Block], gram: FloatArray) -> MayJoin:
    """Which block may join a set: no effect twice at a wheel, no twin that says nothing of its own."""
    asked = evidence.asked

    def may_join(state: State, block: Block) -> bool:
        if block.kind != "effect":
            return True
        own = asked[block.tag].effect
        known = [blocks[m] for m in state.members if blocks[m].kind == "effect"]
        if any(asked[o.tag].effect is own for o in known) and not compatible(
            evidence, (*(o.tag for o in known), block.tag)
        ):
            return False
        for o in known:
            other = asked[o.tag].effect
            if other.name in own.twins or own.name in other.twins:
                c, e = block.columns[0], o.columns[0]
                if 1.0 - gram[c, e] ** 2 / max(gram[c, c] * gram[e, e], 1e-30) < TWINS:
                    return False
        return True

    return may_join
