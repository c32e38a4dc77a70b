"""The competition on the residuals of some drives: a posterior over sets of effects and shapes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from aqualog.core.records import FloatArray
from aqualog.diagnose.arena import Arena, products
from aqualog.diagnose.competition import (
    COARSE,
    COARSE_FORMS,
    Block,
    Fitted,
    MayJoin,
    Members,
    Sets,
    State,
    first_of,
    fitted_in,
    joined,
    placed,
    ranked,
    searched,
)
from aqualog.diagnose.evidence import Evidence, forgiving
from aqualog.diagnose.isolate import TWINS, compatible
from aqualog.diagnose.noise import Weighing
from aqualog.diagnose.shapes import ALONG
from aqualog.diagnose.threads import beside

__all__ = ["Begun", "Fitted", "Members", "Posterior", "begin", "compete", "rule"]

ROUGHLY = 2  # sets that are carried on while the noise is sought
ROUNDS = 4  # of noise, each after what the one before has found
SETTLED = 2.0  # [nats] that a better noise gains, below which the next one is not sought
PAIRS, SEED = 2, 20  # of draws of a set's values
NEGLIGIBLE = 1.0  # variance, in units of white noise's, of a direction of the tolerances that is left out


@dataclass(frozen=True, slots=True)
class Posterior(Sets):
    """The posterior over sets with its inner products, `gram` plain and `tolerant`. `most`: by which any set may be
    likelier than none, since what is slow may as well be noise, of which the noise beside the best set has no part.
    [nats (natural logarithm)]"""

    gram: FloatArray
    tolerant: FloatArray
    weighings: tuple[Weighing, ...]
    most: float = math.inf


@dataclass(frozen=True, slots=True)
class _Noise:
    """A noise beside a set, with the set's values there. `likely`: log of the measurement's marginal likelihood under
    noise, tolerances and the set, with the set's prior; `bare` under noise and tolerances alone."""

    members: Members
    weighings: tuple[Weighing, ...]
    fit: Fitted
    likely: float
    bare: float

    @property
    def is_consistent(self) -> bool:
        """Whether the set, which the noise was sought beside, is likelier there than none."""
        return not self.members or self.likely >= self.bare


@dataclass(frozen=True, slots=True)
class Begun:
    """What stays the same in all rounds: what cars and files differ by anyway along each part, as few `columns`
    (r, C, n) of independent unit values; `whitely`, inner products in the metrics of white noise, of the size of
    steps and of whole residuals; noises that were tried after sets there, or in the first round.
    """

    arena: Arena
    columns: tuple[npt.NDArray[Any], ...]
    whitely: tuple[FloatArray, ...]
    tried: dict[tuple[Members, bytes], _Noise]

    def after(self, members: Members, fit: Fitted | None, number: int = 0) -> _Noise:
        """The noise after a set of a round."""
        key = (members, b"" if fit is None else fit.mean.tobytes())
        found = self.tried.get(key) or _beside(self, members, fit)
        if number == 0:
            self.tried[key] = found
        return found


def compete(arena: Arena, *, rounds: int = ROUNDS, begun: Begun | None = None) -> Posterior:
    """The posterior over the sets that a search with swaps visits. The noise is that beside which the measurement is
    most likely, after one of the first candidates in the metrics of coloured noise and of both white ones, or after the
    best set so far: else a slow effect would count as noise. It is sought with the whole likelihood, in at most so many
    rounds; the posterior has a share of it. `begun`: of the same arena, where fewer rounds of it are known already."""
    only = begun is None
    begun = begun or begin(arena)
    noise = begun.after((), None)
    bare = noise.bare
    gram = arena.inner(noise.weighings)
    for number in range(only, rounds + only):  # what is only asked for once is not kept
        tolerant = arena.tolerant(gram)
        sets = searched(arena.blocks, tolerant, rule(arena.evidence, arena.blocks, gram), width=ROUGHLY)
        best = max(sets, key=lambda k: sets[k])
        coloured = [(m, fitted_in(arena.blocks, tolerant, m), number) for m in _first(arena, tolerant, best)]
        # a noise beside what is within the tolerances is no finding, and what else there is has to be seen beside it
        bases = (dict.fromkeys([best, noise.members, ()]), [noise.members])
        white = []
        for inner, own in zip(begun.whitely, bases, strict=True):
            each = (m for b in own for m in _first(arena, inner, b))
            white += [(m, fitted_in(arena.blocks, inner, m), 0) for m in dict.fromkeys(each) if m or m == best]
        tried = beside(lambda s: begun.after(*s), [*coloured, *white])
        # white noise is wrong: a second step is fairer
        likeliest = max(tried[len(coloured) :], key=lambda n: n.likely)
        second = begun.after(likeliest.members, likeliest.fit, number)
        tried += [second]
        tried = [n for n in tried if n.is_consistent]
        better = max(tried, key=lambda n: n.likely, default=noise)
        bare = max([bare, *(n.bare for n in tried)])
        if better.likely <= noise.likely:
            break
        again = second if better is likeliest else begun.after(better.members, better.fit, number)
        new = again if again.is_consistent and again.likely > better.likely else better
        gained, noise = new.likely - noise.likely, new
        gram = arena.inner(noise.weighings)
        if gained < SETTLED:
            break
    forms = any(b.kind == "shape" for b in arena.blocks)
    tolerant = arena.tolerant((COARSE_FORMS if forms else COARSE) * gram)
    sets = searched(arena.blocks, tolerant, rule(arena.evidence, arena.blocks, gram))
    most = max(noise.likely - bare, 0.0) if noise.members else math.inf
    sets[()] = max(sets[()], max(sets.values()) - most)
    found = ranked(sets, arena.name)
    return Posterior(
        found.sets, found.probability, found.marginal, found.blocks, gram, tolerant, noise.weighings, most
    )  # fmt: skip


def _first(arena: Arena, inner: FloatArray, best: Members) -> list[Members]:
    """A set, the set without each of its blocks, and with each of those that gain most beside it."""
    along = [
        i for i, b in enumerate(arena.blocks) if b.kind == "shape" and set(arena.shapes[b.tag].coordinates) & set(ALONG)
    ]
    apart = [i for i, b in enumerate(arena.blocks) if b.kind == "effect" and arena.evidence.asked[b.tag].drive]
    firsts = first_of(arena.blocks, inner, lambda i: arena.name(i).split("@")[0], best, along, apart)
    fewer = [tuple(m for m in best if m != out) for out in best if len(best) > 1]
    return [best, *fewer, *((*best, m) for m in firsts)]


def begin(arena: Arena) -> Begun:
    """Main directions of the tolerances; what the others do is small beside white noise, smaller beside any other."""
    white = arena.white()
    k = np.flatnonzero((np.diag(arena.tolerance) > 0.0) & (np.diag(white)[:-1] > 1e-12))
    P = arena.tolerance[np.ix_(k, k)]
    root = np.linalg.cholesky(P + 1e-14 * np.diag(np.diag(P)))
    w, V = np.linalg.eigh(root.T @ white[np.ix_(k, k)] @ root)
    values = np.zeros((int((w > NEGLIGIBLE).sum()), arena.sd.size))
    values[:, k] = (root @ V[:, w > NEGLIGIBLE]).T
    columns = tuple(arena.made(i, values).astype(np.float32) for i in range(len(arena.parts)))
    return Begun(arena, columns, (arena.tolerant(white), arena.tolerant(arena.white(whole=True))), {})


def _beside(begun: Begun, members: Members, fit: Fitted | None) -> _Noise:
    """The noise that a set of these values leaves: a step of expectation and maximisation [dempster1977]. Draws of the
    values keep it from being too small. What the car differs by anyway stays in it: it is of the size of the
    simulator's own errors, for which no noise stands."""
    arena = begun.arena
    if fit is None or not members:
        left = [p.residual[None] for p in arena.parts]
    else:
        z = np.random.default_rng(SEED).standard_normal((PAIRS, len(fit.mean))) @ np.linalg.cholesky(fit.covariance).T
        values = np.zeros((2 * PAIRS, arena.sd.size))
        values[:, fit.columns] = fit.mean + np.concatenate([z, -z])
        left = [p.residual - arena.made(i, values) for i, p in enumerate(arena.parts)]
    weighings = arena.weighed(left)
    r = len(begun.columns[0])
    own = placed([arena.blocks[m] for m in members], r)
    at = r + sum(len(b.columns) for b in own)
    gram = np.zeros((at + 1, at + 1))
    for i, (p, w) in enumerate(zip(arena.parts, weighings, strict=True)):
        drawn = w.rows(np.concatenate([*(arena.drawn(i, arena.blocks[m]) for m in members), p.residual[None]]))
        gram += products(np.concatenate([w.rows(begun.columns[i], np.float32), drawn], dtype=np.float32))
    allowed = np.zeros((at, at))
    allowed[:r, :r] = np.eye(r)
    forgiven = forgiving(gram, allowed)
    numbers = tuple(range(len(own)))
    gained = joined(forgiven.gram, own, numbers).evidence
    bare = -0.5 * float(forgiven.gram[-1, -1]) - forgiven.room - sum(w.sharpness for w in weighings)
    found = fitted_in(own, forgiven.gram, numbers)
    columns = [c for m in members for c in arena.blocks[m].columns]
    return _Noise(members, weighings, replace(found, columns=columns), gained + bare, bare)


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
