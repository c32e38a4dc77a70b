"""The best sets of effects on whitened inner products: every set, not one effect after the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from aqualog.core.notation import AXLES, WHEELS
from aqualog.core.records import FloatArray
from aqualog.diagnose.bench import Bench

__all__ = ["PRIOR_WIDTH", "SetFit", "best_sets", "compatible", "fit_set", "gains_on_top"]

PRIOR_WIDTH = 3.0  # the prior is this much wider than the effect's: it only keeps huge, cancelling pairs apart
SINGULAR = 1e-3  # share of a column's energy that the others of its set must leave
TWINS = 0.1  # the same between two effects that are each other's twins, to stand in one set
CANDIDATES = 40  # hypotheses that sets of three and more are made of


@dataclass(frozen=True, slots=True)
class SetFit:
    """Hypotheses `members`, values `theta` of their columns and twice the log-likelihood gained, without the prior."""

    members: tuple[int, ...]
    columns: tuple[int, ...]
    theta: FloatArray
    gain: float


def fit_set(bench: Bench, gram: FloatArray, members: Sequence[int]) -> SetFit | None:
    """Least squares of one set; None if its members cannot be distinguished or a value is outside its bounds."""
    if bench.barred[list(members)].any():
        return None
    columns = tuple(c for m in members for c in bench.columns[m])
    c = list(columns)
    G, b = gram[np.ix_(c, c)], gram[c, -1]
    scale = np.sqrt(np.maximum(np.diag(G), 1e-300))
    unit = G / np.outer(scale, scale)
    # a ridge keeps the direction in which exact twins cancel, which a pseudoinverse would leave out
    if len(c) > 1 and 1.0 / np.max(np.diag(np.linalg.inv(unit + 1e-9 * np.eye(len(c))))) < SINGULAR:
        return None
    if any(_cancel(bench, gram, pair) for pair in combinations(members, 2)):
        return None
    P = np.diag(1.0 / (PRIOR_WIDTH * bench.prior[c]) ** 2)
    theta: FloatArray = np.linalg.solve(G + P, b).astype(np.float64)
    if np.any(theta < bench.low[c]) or np.any(theta > bench.high[c]):
        return None
    return SetFit(tuple(members), columns, theta, float(b @ theta))


def _cancel(bench: Bench, gram: FloatArray, pair: tuple[int, int]) -> bool:
    """Whether two effects are known twins and alike on these drives; large twins that cancel explain nothing."""
    a, b = (bench.asked[m].effect for m in pair)
    if b.name not in a.twins and a.name not in b.twins:
        return False
    i, j = (bench.columns[m][0] for m in pair)
    energy = gram[i, i] * gram[j, j]
    return bool(energy > 0.0 and 1.0 - gram[i, j] ** 2 / energy < TWINS)


def gains_on_top(bench: Bench, gram: FloatArray, base: Sequence[int]) -> FloatArray:
    """Twice the log-likelihood that each hypothesis gains beside the columns of `base`, without prior. (H,)"""
    taken = [c for m in base for c in bench.columns[m]]
    rest = gram
    if taken:
        inner = np.linalg.pinv(gram[np.ix_(taken, taken)], hermitian=True)
        rest = gram - gram[:, taken] @ inner @ gram[taken, :]
    out = np.zeros(len(bench.asked))
    for i, columns in enumerate(bench.columns):
        c = list(columns)
        energy = np.diag(rest)[c]
        if bench.asked[i].allowed or bench.barred[i] or i in base:
            continue
        if np.any(energy < SINGULAR * np.maximum(np.diag(gram)[c], 1e-300)):
            continue
        out[i] = float(rest[c, -1] @ np.linalg.solve(rest[np.ix_(c, c)], rest[c, -1]))
    return out


def compatible(bench: Bench, members: Sequence[int]) -> bool:
    """Whether a set holds each effect once per wheel, in one variant, and does not delay every signal.

    Delays are relative: a delay of all signals only shifts the start of the log's clock.
    """
    for effect in {bench.asked[m].effect.name for m in members if bench.asked[m].effect.drive.is_relative}:
        late = {bench.asked[m].where for m in members if bench.asked[m].effect.name == effect}
        if len(late) > 1 and late == {h.where for h in bench.asked if h.effect.name == effect}:
            return False
    seen: set[tuple[str, str]] = set()
    for m in members:
        h = bench.asked[m]
        # a load at the front and one removed at the rear are not two loads, but a shift of the centre of mass
        whole = h.where is None or h.effect.drive.is_single
        places = WHEELS if whole else AXLES.get(h.where or "", (h.where or "",))
        for p in places:
            if (h.effect.name, p) in seen:
                return False
            seen.add((h.effect.name, p))
    return True


def best_sets(bench: Bench, gram: FloatArray, size: int, *, within: float, most: int) -> list[SetFit]:
    """All sets of a size whose gain is within a distance of the best one's, best first, at most so many.

    Pairs are searched completely; larger sets among the hypotheses that gain most alone, beside the best single one and
    beside the best pair.
    """
    alive = [
        i for i, c in enumerate(bench.columns)
        if np.all(np.diag(gram)[list(c)] > 1e-12) and not bench.asked[i].allowed and not bench.barred[i]
    ]  # fmt: skip
    if size == 1:
        fits = [f for i in alive if (f := fit_set(bench, gram, (i,)))]
    elif size == 2:
        fits = [f for pair in _promising_pairs(bench, gram, alive) if (f := fit_set(bench, gram, pair))]
    else:
        smaller = best_sets(bench, gram, size - 1, within=2.0 * within, most=8)
        pool: list[int] = []
        for s in smaller:
            order = np.argsort(-gains_on_top(bench, gram, s.members))
            pool += [*s.members, *order[: CANDIDATES // 4].tolist()]
        unique = list(dict.fromkeys(pool))[:CANDIDATES]
        sets = [s for s in combinations(sorted(unique), size) if compatible(bench, s)]
        fits = [f for s in _screened(bench, gram, sets) if (f := fit_set(bench, gram, s))]
    fits.sort(key=lambda f: -f.gain)
    return [f for f in fits if f.gain >= fits[0].gain - within][:most]


def _promising_pairs(bench: Bench, gram: FloatArray, alive: Sequence[int]) -> list[tuple[int, ...]]:
    return _screened(bench, gram, [p for p in combinations(alive, 2) if compatible(bench, p)])


def _screened(bench: Bench, gram: FloatArray, sets: Sequence[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """The 300 sets of one size that gain most without prior and bounds; those with several columns are all kept."""
    plain = [s for s in sets if all(len(bench.columns[m]) == 1 for m in s)]
    other = [s for s in sets if s not in set(plain)] if len(plain) < len(sets) else []
    if not plain:
        return list(sets)
    index = np.array([[bench.columns[m][0] for m in s] for s in plain])
    G = gram[index[:, :, None], index[:, None, :]]
    b = gram[index, -1]
    P = np.array([np.diag(d) for d in 1.0 / (PRIOR_WIDTH * bench.prior[index]) ** 2])
    theta = np.linalg.solve(G + P + 1e-12 * G * np.eye(index.shape[1]), b[..., None])[..., 0]
    gain = np.einsum("ij,ij->i", b, theta)
    outside = (theta < bench.low[index]).any(axis=1) | (theta > bench.high[index]).any(axis=1)
    order = np.argsort(-np.where(outside, -np.inf, gain))[:300]
    return [plain[i] for i in order if not outside[i]] + other
