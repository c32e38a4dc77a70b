"""Choice of the coordinate: does each improve held-out stretches of the drive when the other is in the model?"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from aqualog.core.records import FloatArray

__all__ = ["Candidate", "Choice", "blocks_of_rows", "choose"]

BLOCK_S = 5.0  # [s] held out together: longer than the noise remembers, shorter than features of a road
BLOCKS = 60  # of a long drive
FOLDS = 6
SURE = 2.0  # standard errors of a gain
LEAST = 2.0  # [nats (natural logarithm)] of a gain

Blocks = npt.NDArray[np.int64]


class Candidate(NamedTuple):
    """A function that may explain the residual: whitened columns (N, K), penalty (K, K) times its factor.

    `along`: its coordinate runs with time. `passed`: the test found it; else it stands beside for comparison.
    """

    names: tuple[str, ...]
    columns: FloatArray
    penalty: FloatArray
    along: bool
    passed: bool = True


class Choice(NamedTuple):
    """The coordinates that explain it; `equals` explain it as well on this drive, `proxies` do not.

    A proxy explains some of it alone and nothing once the chosen coordinates are known. `gain` on held-out stretches,
    in nats (natural logarithm).
    """

    names: tuple[str, ...]
    along: bool
    equals: tuple[str, ...]
    proxies: tuple[str, ...]
    gain: float


def blocks_of_rows(
    whitened: Callable[[FloatArray], FloatArray], shape: tuple[int, int], dt: float, rng: np.random.Generator
) -> Blocks:
    """Block of the drive that each whitened row belongs to, found by whitening noise that lives in one block alone."""
    n = shape[1]
    width = max(round(BLOCK_S / dt), -(-n // BLOCKS))
    block = np.arange(n) // width
    noise = rng.standard_normal(shape)
    probes = [np.abs(whitened(np.where(block == b, noise, 0.0))) for b in range(int(block[-1]) + 1)]
    return np.asarray(np.argmax(np.stack(probes), axis=0), dtype=np.int64)


def choose(candidates: Sequence[Candidate], constants: FloatArray, rows: FloatArray, blocks: Blocks) -> Choice | None:
    """The coordinates that a residual depends on.

    Parameters
    ----------
    candidates : sequence of Candidate
        Functions of one coordinate, and of two where those of either stand beside.
    constants : (N, q)
        Whitened columns that every fit has.
    rows : (N,)
        Whitened residual.
    blocks : (N,)

    Returns
    -------
    choice : Choice or None
        None if nothing predicts the stretches that were held out.
    """
    known: dict[tuple[int, ...], FloatArray] = {}

    def gain(*members: int) -> FloatArray:
        key = tuple(sorted(members))
        if key not in known:
            known[key] = _held_out_gain([candidates[i] for i in key], constants, rows, blocks)
        return known[key]

    singles = [i for i, c in enumerate(candidates) if len(c.names) == 1]
    place = {candidates[i].names[0]: i for i in singles}
    found = [i for i in singles if candidates[i].passed]
    best = _of_one(candidates, found, gain) if found else _of_two(candidates, gain)
    road = place.get("position", best)
    if candidates[best].along and candidates[road].along:  # same thing here, but the model has a road and no clock
        best = road
    for i, c in enumerate(candidates if found else ()):
        if len(c.names) == 2 and all(name in place for name in c.names):
            parts = [place[name] for name in c.names]
            if all(_helps(gain(i) - gain(*m)) for m in ((best,), parts)) and gain(i).sum() > gain(best).sum():
                best = i
    total = float(gain(best).sum())
    if not total > 0.0:
        return None
    equals: list[str] = []
    proxies: list[str] = []
    for j in singles:
        if j == best or candidates[j].names[0] in candidates[best].names or not _helps(gain(j)):
            continue
        both = gain(best, j)
        if _helps(both - gain(best)):
            continue
        (proxies if _helps(both - gain(j)) else equals).append(candidates[j].names[0])
    if candidates[best].along:  # one pass over a road: its places and moments are the same thing
        equals += [candidates[j].names[0] for j in singles if j != best and candidates[j].along]
    equals = list(dict.fromkeys(equals))
    return Choice(
        candidates[best].names,
        candidates[best].along,
        tuple(equals),
        tuple(p for p in proxies if p not in equals),
        total,
    )


def _of_one(candidates: Sequence[Candidate], among: Sequence[int], gain: Callable[..., FloatArray]) -> int:
    """The coordinate that explains most."""
    totals = {i: float(gain(i).sum()) for i in among}
    best = max(totals, key=lambda i: totals[i])
    # a coordinate other than time applies to other drives too: it wins where the drive cannot distinguish them
    plain = [i for i in among if not candidates[i].along]
    if candidates[best].along and plain:
        other = max(plain, key=lambda i: totals[i])
        if totals[other] > 0.0 and not _helps(gain(best, other) - gain(other)):
            return other
    return best


def _of_two(candidates: Sequence[Candidate], gain: Callable[..., FloatArray]) -> int:
    """The pair that explains most, where no coordinate alone was found: a part of it is no answer then."""
    pairs = [i for i, c in enumerate(candidates) if c.passed]
    return max(pairs, key=lambda i: float(gain(i).sum()))


def _helps(gains: FloatArray) -> bool:
    total, spread = float(gains.sum()), float(np.sqrt(gains.size) * gains.std())
    return total > LEAST and total > SURE * spread


def _held_out_gain(terms: Sequence[Candidate], constants: FloatArray, rows: FloatArray, blocks: Blocks) -> FloatArray:
    """Log-likelihood (blocks,) of stretches that were not fitted, above that of the constants alone."""
    columns = np.column_stack([constants, *(t.columns for t in terms)])
    penalty = np.zeros((columns.shape[1],) * 2)
    at = constants.shape[1]
    for t in terms:
        k = t.columns.shape[1]
        penalty[at : at + k, at : at + k] = t.penalty
        at += k
    gram, load = columns.T @ columns, columns.T @ rows
    q = constants.shape[1]
    gains = np.zeros(int(blocks.max()) + 1)
    for fold in range(FOLDS):
        out = blocks % FOLDS == fold
        x, r = columns[out], rows[out]
        left, push = gram - x.T @ x, load - x.T @ r
        full = r - x @ _solved(left + penalty, push)
        base = r - x[:, :q] @ _solved(left[:q, :q], push[:q])
        gains += np.bincount(blocks[out], 0.5 * (base * base - full * full), gains.size)
    return gains


def _solved(a: FloatArray, b: FloatArray) -> FloatArray:
    ridge = 1e-9 * float(np.trace(a)) / max(a.shape[0], 1) + 1e-12
    return np.asarray(np.linalg.solve(a + ridge * np.eye(a.shape[0]), b), dtype=np.float64)
