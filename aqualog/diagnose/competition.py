"""One competition of known effects, unknown shapes and roads, in one evidence.

Everything that may be in a residual is a block of columns with a Gaussian prior of physical size. Beside a set of
blocks the log of the marginal likelihood that one more block gains is

    -1/2 log |I + P A| + 1/2 b' (P^-1 + A)^-1 b,    A = X'X, b = X'y, both beside the set

so that a shape of twelve columns pays for its freedom and a known effect wins where it says the same with one.

No simulator is the car. Its errors are no noise, so with enough samples a likelihood is sure of anything. A share of
its logarithm counts instead: a coarsened posterior [miller2018].
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from aqualog.core.records import FloatArray

__all__ = ["COARSE", "SCALES", "Block", "State", "added", "scored", "start", "values"]

# share of the log-likelihood that counts in a competition: of 0.5, 0.35 and 0.25, tried on linear sets of 39
# development drives of two other simulators, 4, 2 and 1 names were wrong and sure, 20, 21 and 20 right (D)
COARSE = 0.3
SCALES = (1.0, 3.0)  # of the usual size: half of all deviations are three times as usual ones (K)


@dataclass(frozen=True, slots=True)
class Block:
    """What may be in a residual: `columns` of the Gram matrix, their `prior` covariance, log of how usual it is.

    `tag`: what it stands for, a hypothesis or a shape; `low` and `high` bounds of the columns' values.
    """

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
    """Inner products (K + 1, K + 1) beside a set, the residual last; its evidence [nats (natural logarithm)]."""

    inner: FloatArray
    members: tuple[int, ...] = ()
    evidence: float = 0.0


def start(inner: FloatArray) -> State:
    """Without any block."""
    return State(inner)


def _parts(state: State, block: Block) -> tuple[FloatArray, FloatArray]:
    c = list(block.columns)
    return state.inner[np.ix_(c, c)], state.inner[c, -1]


def _evidence(A: FloatArray, b: FloatArray, P: FloatArray) -> tuple[float, FloatArray]:
    """Log of the marginal likelihood gained, and the posterior mean."""
    if len(b) == 1:
        a, p = float(A[0, 0]), float(P[0, 0])
        v = p / (1.0 + p * a)
        return -0.5 * math.log1p(p * a) + 0.5 * float(b[0]) ** 2 * v, np.array([v * float(b[0])])
    L = np.linalg.cholesky(P)
    M = np.eye(len(b)) + L.T @ A @ L
    try:
        C = np.linalg.cholesky(M)
    except np.linalg.LinAlgError:
        # columns that others explain to the last digit: rounding, not information
        return -math.inf, np.zeros(len(b))
    u = np.linalg.solve(C, L.T @ b)
    mean = L @ np.linalg.solve(C.T, u)
    return -float(np.log(np.diag(C)).sum()) + 0.5 * float(u @ u), np.asarray(mean)


def scored(state: State, block: Block) -> tuple[float, float]:
    """Evidence gained by a block, over the scales of its prior, and the scale that gains most."""
    A, b = _parts(state, block)
    each = [_evidence(A, b, s * s * block.prior)[0] for s in SCALES]
    top = max(each)
    if top == -math.inf:
        return top, SCALES[0]
    total = top + math.log(sum(math.exp(e - top) for e in each) / len(each))
    return total, SCALES[each.index(top)]


def added(state: State, index: int, block: Block) -> State:
    """The state with one block more."""
    gained, scale = scored(state, block)
    c = list(block.columns)
    B = state.inner[:, c]
    A = state.inner[np.ix_(c, c)]
    L = scale * np.linalg.cholesky(block.prior)
    BL = B @ L
    M = np.eye(L.shape[1]) + L.T @ A @ L
    inner = state.inner - BL @ np.linalg.solve(M, BL.T)
    return State(inner, (*state.members, index), state.evidence + gained + block.log_prior)


def values(
    inner: FloatArray, blocks: Sequence[Block], scales: Sequence[float]
) -> tuple[list[int], FloatArray, FloatArray]:
    """Posterior means and covariance of all columns of a set together: columns, mean, covariance."""
    columns = [c for b in blocks for c in b.columns]
    k = len(columns)
    P = np.zeros((k, k))
    at = 0
    for b, s in zip(blocks, scales, strict=True):
        P[at : at + len(b.columns), at : at + len(b.columns)] = s * s * b.prior
        at += len(b.columns)
    G, y = inner[np.ix_(columns, columns)], inner[columns, -1]
    cov = np.linalg.inv(np.linalg.inv(P) + G)
    return columns, cov @ y, 0.5 * (cov + cov.T)
