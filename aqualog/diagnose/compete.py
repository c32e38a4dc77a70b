"""The competition on the residuals of some drives: a posterior over sets of effects and shapes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.diagnose.arena import Arena
from aqualog.diagnose.competition import Block, State
from aqualog.diagnose.evidence import Evidence
from aqualog.diagnose.sets import Fitted, MayJoin, Members, Sets, first_of, fitted_in, ranked, searched
from aqualog.diagnose.spectrum import Weighing
from aqualog.diagnose.subsets import TWINS, compatible

__all__ = ["Fitted", "Members", "Posterior", "compete", "fitted", "rule"]

ROUNDS = 3  # of noise after the best set
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

    The noise is that under which the measurement is most likely, after no block or after one of the first candidates
    in the metrics of coloured and of white noise. It is estimated again after the best set.
    """
    plain = [p.residual for p in arena.parts]
    weighings = arena.weighed(plain)
    least = _surprise(weighings)
    after: Members = ()
    gram = arena.inner(weighings)
    tolerant = arena.tolerant(gram)
    first = weighings
    for metric in (tolerant, arena.tolerant(arena.white())):
        for m in first_of(arena.blocks, metric):
            again = arena.weighed(_left(arena, metric, (m,)))
            price = OPTIMISM * len(arena.blocks[m].columns)
            if _surprise(again) + price < least:
                least, weighings, after = _surprise(again) + price, again, (m,)
    for _ in range(ROUNDS):
        if weighings is not first:
            gram = arena.inner(weighings)
            tolerant = arena.tolerant(gram)
        sets = searched(arena.blocks, tolerant, rule(arena.evidence, arena.blocks, gram))
        best = max(sets, key=lambda k: sets[k])
        if not best or set(best) == set(after):
            break
        again = arena.weighed(_left(arena, tolerant, best))
        if _surprise(again) >= _surprise(weighings) - 1.0:
            break
        weighings, after = again, best
    found = ranked(sets, arena.name)
    return Posterior(
        found.sets, found.probability, found.marginal, found.blocks, gram, tolerant, tuple(weighings)
    )  # fmt: skip


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
