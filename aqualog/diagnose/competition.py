"""One competition of known effects, unknown shapes and roads, in one evidence, and the posterior over the sets that a
search visits.

Everything that may be in a residual is a block of columns with a Gaussian prior of physical size. Beside a set of
blocks one more block gains -1/2 log |I + P A| + 1/2 b' (P^-1 + A)^-1 b of the log of the marginal likelihood, with A =
X'X and b = X'y, both beside the set. So a shape of twelve columns pays for its freedom. A simulator's errors are no
noise: a share of the likelihood's logarithm counts, a coarsened posterior [miller2018].
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from aqualog.core.records import BoolArray, FloatArray

__all__ = [
    "COARSE", "COARSE_FORMS", "SCALES", "Block", "Fitted", "MayJoin", "Members", "Packed", "Sets", "State", "added",
    "evidence_of", "first_of", "fitted_in", "joined", "packed", "placed", "ranked", "scores", "searched", "shares",
]  # fmt: skip

# share of the log-likelihood that counts in a competition: of 0.5, 0.35 and 0.25, tried on linear sets of 39
# development drives of two other simulators, 4, 2 and 1 names were wrong and sure, 20, 21 and 20 right (D)
COARSE = 0.3
# where unknown forms compete: they are no names, and what simulators err by along their coordinates is allowed for (D)
COARSE_FORMS = 0.6
SCALES = (1.0, 3.0)  # of the usual size: half of all deviations are three times as usual ones (K)
WIDTH = 8
MOST = 4  # blocks in one set
SWAPPED = 3  # sets in which every member is exchanged
FEW_KNOWN, FEW, FEW_ALONG = 3, 4, 2  # first candidates: known effects, shapes, shapes over time and place
DIES = 6.0  # [nats] behind the best set, at which a level of larger sets ends the search
SINGULAR = 1e-3  # share of a column's energy that the others of its set must leave
SMALLEST = 1e-12
BEYOND = 2.0  # standard deviations by which a value may be beyond a physical bound


@dataclass(frozen=True, slots=True)
class Block:
    """What may be in a residual: `columns` of the Gram matrix, their `prior` covariance, log of how usual it is; `tag`:
    hypothesis or shape that it stands for; `low` and `high` bounds of the columns' values."""

    key: str
    kind: Literal["effect", "shape", "road"]
    columns: tuple[int, ...]
    prior: FloatArray
    log_prior: float
    tag: int
    low: FloatArray | None = None
    high: FloatArray | None = None


@dataclass(frozen=True, slots=True)
class State:
    """Inner products (K + 1, K + 1) beside a set, the residual last; its evidence with its prior [nats (natural
    logarithm)]; `scales` of the members' priors that gain most."""

    inner: FloatArray
    members: tuple[int, ...] = ()
    evidence: float = 0.0
    scales: tuple[float, ...] = ()


class Packed(NamedTuple):
    """Blocks of the same number of columns k, to be scored at once: `at` (B,) their numbers, `columns` (B, k), `root`
    (B, k, k) of the prior covariance, `low` and `high` (B, k) bounds of values, infinite without any."""

    at: NDArray[np.intp]
    columns: NDArray[np.intp]
    root: FloatArray
    low: FloatArray
    high: FloatArray


def packed(blocks: Sequence[Block]) -> tuple[Packed, ...]:
    """Blocks by their number of columns."""
    by_width: dict[int, list[int]] = {}
    for i, b in enumerate(blocks):
        by_width.setdefault(len(b.columns), []).append(i)
    out = []
    for k, at in by_width.items():
        own = [blocks[i] for i in at]
        low = [np.full(k, -np.inf) if b.low is None else b.low for b in own]
        high = [np.full(k, np.inf) if b.high is None else b.high for b in own]
        root = np.linalg.cholesky(np.array([b.prior for b in own]))
        columns = np.array([b.columns for b in own], dtype=np.intp)
        out.append(Packed(np.array(at, dtype=np.intp), columns, root, np.array(low), np.array(high)))
    return tuple(out)


def scores(inner: FloatArray, own: Packed) -> tuple[FloatArray, FloatArray]:
    """Evidence that each of some blocks gains beside a set over the scales of its prior (B,), and the scale that gains
    most (B,), from the inner products (K + 1, K + 1) there."""
    A = inner[own.columns[:, :, None], own.columns[:, None, :]]
    transposed = own.root.transpose(0, 2, 1)
    w, V = np.linalg.eigh(transposed @ A @ own.root)
    u = ((transposed @ inner[own.columns, -1][..., None]).transpose(0, 2, 1) @ V)[:, 0]
    each = []
    for s in SCALES:
        room = 1.0 + s * s * w
        # below zero: columns that others explain to the last digit, which is rounding, not information
        sound = (room > 0.0).all(axis=1)
        room = np.where(room > 0.0, room, 1.0)
        gain = -0.5 * np.log(room).sum(axis=1) + 0.5 * (s * s * u * u / room).sum(axis=1)
        each.append(np.where(sound, gain, -np.inf))
    gains = np.array(each)
    top = gains.max(axis=0)
    safe = np.where(np.isfinite(top), top, 0.0)
    total = safe + np.log(np.exp(gains - safe).mean(axis=0) + 1e-300)
    return np.where(np.isfinite(top), total, -np.inf), np.array(SCALES)[gains.argmax(axis=0)]


def added(state: State, index: int, block: Block) -> State:
    """The state with one block more."""
    gain, scales = scores(state.inner, packed([block])[0])
    gained, scale = float(gain[0]), float(scales[0])
    c = list(block.columns)
    B = state.inner[:, c]
    A = state.inner[np.ix_(c, c)]
    L = scale * np.linalg.cholesky(block.prior)
    BL = B @ L
    M = np.eye(L.shape[1]) + L.T @ A @ L
    inner = state.inner - BL @ np.linalg.solve(M, BL.T)
    evidence = state.evidence + gained + block.log_prior
    return State(inner, (*state.members, index), evidence, (*state.scales, scale))


def joined(inner: FloatArray, blocks: Sequence[Block], members: Sequence[int]) -> State:
    """A set's state, from inner products (K + 1, K + 1) without any block."""
    state = State(inner)
    for m in members:
        state = added(state, m, blocks[m])
    return state


def placed(blocks: Sequence[Block], first: int = 0) -> list[Block]:
    """The same blocks with their columns one after another, from `first` on."""
    ends = first + np.cumsum([len(b.columns) for b in blocks], dtype=np.intp)
    return [
        replace(b, columns=tuple(range(end - len(b.columns), end)))
        for b, end in zip(blocks, ends.tolist(), strict=True)
    ]  # fmt: skip


Members = tuple[int, ...]
MayJoin = Callable[[State, Block], bool]


@dataclass(frozen=True, slots=True)
class Sets:
    """`sets` by evidence with their prior, best first, and `probability` of each."""

    sets: tuple[tuple[Members, float], ...]
    probability: FloatArray
    marginal: Mapping[str, float]  # by name of effect or mechanism
    blocks: Mapping[int, float]  # by block

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


def fitted_in(blocks: Sequence[Block], inner: FloatArray, members: Sequence[int]) -> Fitted:
    """Values of all columns of a set together, from inner products (K + 1, K + 1) whose last row is the residual."""
    columns = [c for m in members for c in blocks[m].columns]
    inner = inner[np.ix_([*columns, -1], [*columns, -1])]
    own = placed([blocks[m] for m in members])
    P = np.zeros((len(columns), len(columns)))
    for b, s in zip(own, joined(inner, own, range(len(own))).scales, strict=True):
        P[np.ix_(b.columns, b.columns)] = s * s * b.prior
    cov = np.linalg.inv(np.linalg.inv(P) + inner[:-1, :-1])
    return Fitted(columns, cov @ inner[:-1, -1], 0.5 * (cov + cov.T))


def evidence_of(blocks: Sequence[Block], inner: FloatArray, members: Sequence[int]) -> float:
    """Log of the marginal likelihood that a set gains, without its prior. [nats (natural logarithm)]"""
    return joined(inner, blocks, members).evidence - sum(blocks[m].log_prior for m in members)


def ranked(sets: Mapping[Members, float], name: Callable[[int], str]) -> Sets:
    """The posterior over sets from their evidence; `name` of a block, by which probabilities add up."""
    order = tuple(sorted(sets.items(), key=lambda x: -x[1]))
    p = shares([e for _, e in order])
    by_name: dict[str, float] = {}
    by_block: dict[int, float] = {}
    for (members, _), q in zip(order, p.tolist(), strict=True):
        for n in {name(m) for m in members}:
            by_name[n] = by_name.get(n, 0.0) + q
        for m in members:
            by_block[m] = by_block.get(m, 0.0) + q
    return Sets(order, p, by_name, by_block)


def shares(evidence: Sequence[float]) -> FloatArray:
    """Probabilities of sets from their log evidence."""
    z = np.array(evidence)
    p = np.exp(z - z.max())
    return np.asarray(p / p.sum())


def first_of(
    blocks: Sequence[Block], inner: FloatArray, name: Callable[[int], str], beside: Members = (),
    along: Collection[int] = (), apart: Collection[int] = (),
) -> list[int]:  # fmt: skip
    """The few known effects, each at its best place, the few shapes and the road that gain most beside a set. `along`:
    shapes over time and place, which have places of their own: where noise is slow they would take all others. So do
    effects that one of several drives alone has, `apart`: what all share gains more in a noise that is wrong in all."""
    gains = _gains(joined(inner, blocks, beside), blocks, packed(blocks), inner)
    order = [i for i in np.argsort(-gains, kind="stable").tolist() if i not in beside and gains[i] > 0.0]
    known: dict[str, int] = {}
    alone: dict[str, int] = {}
    for i in order:
        if blocks[i].kind == "effect":
            (alone if i in apart else known).setdefault(name(i), i)
    shapes = [i for i in order if blocks[i].kind == "shape"]
    late, others = ([i for i in shapes if (i in along) is over] for over in (True, False))
    roads = [i for i in order if blocks[i].kind == "road"]
    few = [i for each in (known, alone) for i in list(each.values())[:FEW_KNOWN]]
    return [*few, *late[:FEW_ALONG], *others[:FEW], *roads[:1]]


def searched(
    blocks: Sequence[Block], inner: FloatArray, may_join: MayJoin, *, width: int = WIDTH
) -> dict[Members, float]:  # fmt: skip
    """Evidence of the sets that are visited: the best ones of each size carried on, then members exchanged. `inner` (K
    + 1, K + 1): inner products of all columns, the residual last; `may_join`: whether a block may join the set of a
    state; `width`: sets that are carried on."""

    together = packed(blocks)

    def joining(state: State) -> list[tuple[int, float]]:
        gains = _gains(state, blocks, together, inner)
        return [
            (i, float(gains[i]))
            for i in np.flatnonzero(gains > -np.inf).tolist()
            if i not in state.members and may_join(state, blocks[i])
        ]

    states = [State(inner)]
    sets: dict[Members, float] = {(): 0.0}
    for _ in range(MOST):
        new: dict[Members, tuple[float, State, int]] = {}
        for state in states:
            for i, gain in joining(state):
                key = tuple(sorted((*state.members, i)))
                total = state.evidence + gain
                if key not in new or new[key][0] < total:
                    new[key] = (total, state, i)
        for key, (total, _, _) in new.items():
            sets.setdefault(key, total)
        top = sorted(new.values(), key=lambda x: -x[0])[:width]
        if not top or top[0][0] < max(sets.values()) - DIES:
            break
        states = [added(state, i, blocks[i]) for _, state, i in top]
    for members in sorted(sets, key=lambda k: -sets[k])[: min(SWAPPED, width)]:
        for out in members if len(members) > 1 else ():
            state = joined(inner, blocks, [m for m in members if m != out])
            for i, gain in joining(state):
                key = tuple(sorted((*state.members, i)))
                sets[key] = max(sets.get(key, -math.inf), state.evidence + gain)
    return sets


def _gains(
    state: State, blocks: Sequence[Block], together: Sequence[Packed], inner: FloatArray
) -> FloatArray:  # fmt: skip
    """What each block gains beside a set, with its prior; minus infinity where it does not show. (B,)"""
    out = np.full(len(blocks), -np.inf)
    prior = np.array([b.log_prior for b in blocks])
    for own in together:
        out[own.at] = np.where(_show(state.inner, own, inner), scores(state.inner, own)[0] + prior[own.at], -np.inf)
    return out


def _show(beside: FloatArray, own: Packed, inner: FloatArray) -> BoolArray:
    """Whether a set leaves enough of a single column, and the values are not clearly beyond their bounds. (B,)"""
    c = own.columns
    out = np.ones(len(c), dtype=bool)
    if c.shape[1] == 1:
        k = c[:, 0]
        out = beside[k, k] >= np.maximum(SINGULAR * inner[k, k], SMALLEST)
    bounded = np.flatnonzero((np.isfinite(own.low) | np.isfinite(own.high)).any(axis=1) & out)
    if bounded.size:
        c, root = c[bounded], SCALES[-1] * own.root[bounded]
        A = beside[c[:, :, None], c[:, None, :]]
        cov = np.linalg.inv(A + np.linalg.inv(root @ root.transpose(0, 2, 1)))
        value = (cov @ beside[c, -1][..., None])[..., 0]
        reach = BEYOND * np.sqrt(np.diagonal(cov, axis1=1, axis2=2))
        out[bounded] = ((value >= own.low[bounded] - reach) & (value <= own.high[bounded] + reach)).all(axis=1)
    return out
