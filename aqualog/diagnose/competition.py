"""One competition of known effects, unknown shapes and roads, in one evidence.

Everything that may be in a residual is a block of columns with a Gaussian prior of physical size. Beside a set of
blocks one more block gains -1/2 log |I + P A| + 1/2 b' (P^-1 + A)^-1 b of the log of the marginal likelihood, with A =
X'X and b = X'y, both beside the set. So a shape of twelve columns pays for its freedom. A simulator's errors are no
noise: a share of the likelihood's logarithm counts, a coarsened posterior [miller2018].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from aqualog.core.records import FloatArray

__all__ = [
    "COARSE", "COARSE_FORMS", "SCALES", "Block", "Packed", "State", "added", "joined", "packed", "placed", "scores",
]  # fmt: skip

# share of the log-likelihood that counts in a competition: of 0.5, 0.35 and 0.25, tried on linear sets of 39
# development drives of two other simulators, 4, 2 and 1 names were wrong and sure, 20, 21 and 20 right (D)
COARSE = 0.3
# where unknown forms compete: they are no names, and what simulators err by along their coordinates is allowed for (D)
COARSE_FORMS = 0.6
SCALES = (1.0, 3.0)  # of the usual size: half of all deviations are three times as usual ones (K)


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


class Scores(NamedTuple):
    """Evidence gained over the scales of the prior (B,), and the scale that gains most (B,)."""

    gain: FloatArray
    scale: FloatArray


def scores(inner: FloatArray, own: Packed) -> Scores:
    """What each of some blocks gains beside a set, from the inner products (K + 1, K + 1) there."""
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
    return Scores(np.where(np.isfinite(top), total, -np.inf), np.array(SCALES)[gains.argmax(axis=0)])


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
