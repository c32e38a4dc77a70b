"""The competition on the residuals of some drives: a posterior over sets of effects and shapes."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.diagnose.arena import Arena
from aqualog.diagnose.competition import COARSE, Block, State
from aqualog.diagnose.evidence import Evidence, forgiving
from aqualog.diagnose.hypotheses import THREADS
from aqualog.diagnose.sets import Fitted, MayJoin, Members, Sets, evidence_of, first_of, fitted_in, ranked, searched
from aqualog.diagnose.spectrum import Weighing
from aqualog.diagnose.subsets import TWINS, compatible

__all__ = ["Fitted", "Members", "Posterior", "compete", "fitted", "rule"]

ROUGHLY = 2  # sets that are carried on while the noise is sought
ROUNDS = 4  # of noise, each after what the one before has found
PAIRS, SEED = 2, 20  # of draws of a set's values
CLEARLY = 1.0  # [nats] that a noise must make the measurement more likely


@dataclass(frozen=True, slots=True)
class Posterior(Sets):
    """The posterior over sets with its inner products, `gram` plain and `tolerant`."""

    gram: FloatArray
    tolerant: FloatArray
    weighings: tuple[Weighing, ...]


def fitted(arena: Arena, tolerant: FloatArray, members: Sequence[int]) -> Fitted:
    """Values of all columns of a set together."""
    return fitted_in(arena.blocks, tolerant, members)


@dataclass(frozen=True, slots=True)
class _Noise:
    """A noise beside a set; `gram` (K + 1, K + 1) at least of the set and the tolerances.

    `likely`: log of the measurement's marginal likelihood under noise, tolerances and the set, with the set's prior.
    """

    members: Members
    weighings: tuple[Weighing, ...]
    gram: FloatArray
    likely: float


def compete(arena: Arena) -> Posterior:
    """The posterior over the sets that a search with swaps visits.

    The noise is that beside which the measurement is most likely, after one of the first candidates in the metrics of
    coloured and of white noise, or after the best set so far. Else a slow effect would count as noise and could not be
    found. The noise is sought with the whole likelihood, the posterior has a share of it.
    """
    white = arena.white()
    whitely = arena.tolerant(white)
    noise = _noise(arena, arena.weighed([[p.residual] for p in arena.parts]), ())
    gram = arena.inner(noise.weighings)
    for _ in range(ROUNDS):
        tolerant = arena.tolerant(gram)
        sets = searched(arena.blocks, tolerant, rule(arena.evidence, arena.blocks, gram), width=ROUGHLY)
        best = max(sets, key=lambda k: sets[k])
        coloured = _beside(arena, tolerant, best)
        others = [*_beside(arena, whitely, best), *_beside(arena, whitely, ())[1:]]
        starts = [replace(noise, members=m, gram=gram) for m in coloured]
        starts += [replace(noise, members=m, gram=white) for m in dict.fromkeys(others)]
        with ThreadPoolExecutor(THREADS) as pool:
            tried = list(pool.map(lambda n: _after(arena, n), starts))
        # white noise is wrong: a second step is fairer
        tried.append(_after(arena, max(tried[len(coloured) :], key=lambda n: n.likely)))
        better = max(tried, key=lambda n: n.likely)
        if better.likely < noise.likely + CLEARLY:
            break
        noise = _after(arena, better)
        gram = arena.inner(noise.weighings)
    tolerant = arena.tolerant(COARSE * gram)
    sets = searched(arena.blocks, tolerant, rule(arena.evidence, arena.blocks, gram))
    found = ranked(sets, arena.name)
    return Posterior(found.sets, found.probability, found.marginal, found.blocks, gram, tolerant, noise.weighings)


def _beside(arena: Arena, inner: FloatArray, best: Members) -> list[Members]:
    """A set, and the set with each of the blocks that gain most beside it."""
    return [best, *((*best, m) for m in first_of(arena.blocks, inner, best))]


def _after(arena: Arena, noise: _Noise) -> _Noise:
    """The noise that its set leaves: a step of expectation and maximisation [dempster1977].

    The set's values are not exactly known: draws of what is left keep the noise from being too small. What the car
    differs by anyway stays in the noise: it is of the size of the simulator's own errors, for which no noise stands.
    """
    if not noise.members:
        return _noise(arena, arena.weighed([[p.residual] for p in arena.parts]), ())
    fit = fitted(arena, arena.tolerant(noise.gram), noise.members)
    z = np.random.default_rng(SEED).standard_normal((PAIRS, len(fit.mean))) @ np.linalg.cholesky(fit.covariance).T
    values = np.zeros((2 * PAIRS, arena.width))
    values[:, fit.columns] = fit.mean + np.concatenate([z, -z])
    left = [[p.residual - arena.made(i, v) for v in values] for i, p in enumerate(arena.parts)]
    return _noise(arena, arena.weighed(left), noise.members)


def _noise(arena: Arena, weighings: tuple[Weighing, ...], members: Members) -> _Noise:
    used = np.diag(arena.tolerance) > 0.0
    used[[c for m in members for c in arena.blocks[m].columns]] = True
    gram = arena.inner(weighings, used)
    forgiven = forgiving(gram, arena.tolerance)
    gained = evidence_of(arena.blocks, forgiven.gram, members) + sum(arena.blocks[m].log_prior for m in members)
    likely = gained - 0.5 * float(forgiven.gram[-1, -1]) - forgiven.room - sum(w.sharpness for w in weighings)
    return _Noise(members, weighings, gram, likely)


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
