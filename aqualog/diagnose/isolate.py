"""What a log can tell apart, before its residual is looked at: pairs and sets of up to three rivals, and limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations
from statistics import NormalDist

import numpy as np

from aqualog.diagnose.bench import Bench
from aqualog.diagnose.records import Confusion, Limit
from aqualog.diagnose.subsets import compatible
from aqualog.diagnose.words import place, quantity
from aqualog.types import FloatArray

__all__ = ["confusions", "limits", "reference_sizes", "separation"]

POWER = 0.9
TOLD_APART = 0.95  # probability of the right one of two from which on they count as told apart
EXACT = 1e-3  # share of an effect's energy that an exact relation leaves at the most
RIVALS = 10  # the likest ones, of which sets are made


def separation(gram: FloatArray, columns: Sequence[int], rivals: Sequence[int], theta: FloatArray) -> float:
    """Whitened energy of columns at values `theta` that the columns `rivals` cannot imitate (lambda)."""
    c, r = list(columns), list(rivals)
    rest = gram[np.ix_(c, c)]
    if r:
        rest = (
            rest
            - gram[np.ix_(c, r)] @ np.linalg.pinv(gram[np.ix_(r, r)], hermitian=True, rcond=1e-9) @ gram[np.ix_(r, c)]
        )
    return max(float(theta @ rest @ theta), 0.0)


def p_correct(lam: float) -> float:
    """Probability of naming the right one of two: Phi(sqrt(lambda) / 2)."""
    return NormalDist().cdf(0.5 * math.sqrt(max(lam, 0.0)))


def reference_sizes(bench: Bench, gram: FloatArray, inflation: FloatArray, threshold: float) -> FloatArray:
    """Size of each column (K,) that is seen with a power of 0.9, or the smallest worth naming if that is larger.

    NaN where no physical size would be seen.
    """
    out = np.full(bench.count, np.nan)
    for i, columns in enumerate(bench.columns):
        for c in columns:
            energy = gram[c, c]
            if energy <= 1e-12:
                continue
            seen = (math.sqrt(threshold * inflation[i]) + NormalDist().inv_cdf(POWER) * math.sqrt(inflation[i])) / (
                math.sqrt(energy)
            )
            if seen <= max(bench.high[c], -bench.low[c]):
                out[c] = max(seen, bench.smallest[c])
    return out


def limits(bench: Bench, sizes: FloatArray) -> tuple[Limit, ...]:
    """Detection limit of each effect and place, by its first parameter."""
    out = {}
    for h, columns in zip(bench.asked, bench.columns, strict=True):
        if h.allowed:
            continue
        size = float(sizes[columns[0]])
        old = out.get(h.key)
        if old is None or (math.isfinite(size) and not (old.size <= size)):
            out[h.key] = Limit(h.effect.name, h.where, size, h.parameter(h.free[0]).unit)
    return tuple(out.values())


def confusions(bench: Bench, gram: FloatArray, sizes: FloatArray, inflation: FloatArray) -> tuple[Confusion, ...]:
    """All pairs, and for each effect the sets of two and three rivals that imitate it much better than any one.

    At the reference sizes; effects that the log does not show are left out.
    """
    G = gram[:-1, :-1]
    seen = [i for i, c in enumerate(bench.columns) if math.isfinite(sizes[c[0]]) and len(c) == 1 and not bench.asked[i].allowed]
    first: dict[str, int] = {}
    for i in seen:
        first.setdefault(bench.asked[i].key, i)
    index = list(first.values())
    out = []
    for i in index:
        column = bench.columns[i][0]
        theta = np.array([sizes[column]]) / math.sqrt(inflation[i])
        energy = float(theta[0] ** 2 * G[column, column])
        pairs = {}
        for j in index:
            if i != j:
                lam = separation(G, (column,), bench.columns[j], theta)
                pairs[j] = lam
                out.append(_confusion(bench, G, i, (j,), lam, energy))
        nearest = sorted((j for j in pairs if compatible(bench, (i, j))), key=lambda j: pairs[j])[:RIVALS]
        for size in (2, 3):
            best: tuple[float, tuple[int, ...]] | None = None
            for rivals in combinations(nearest, size):
                if not compatible(bench, (i, *rivals)):
                    continue
                r = [bench.columns[j][0] for j in rivals]
                lam = separation(G, (column,), r, theta)
                if best is None or lam < best[0]:
                    best = (lam, rivals)
            if best and best[0] < 0.5 * min([pairs[j] for j in best[1]]) and p_correct(best[0]) < TOLD_APART:
                out.append(_confusion(bench, G, i, best[1], best[0], energy))
                break
    return tuple(out)


def _confusion(bench: Bench, G: FloatArray, i: int, rivals: tuple[int, ...], lam: float, energy: float) -> Confusion:
    relation = _relation(bench, G, i, rivals) if lam < EXACT * energy else ""
    return Confusion(bench.asked[i].key, tuple(bench.asked[j].key for j in rivals), lam, p_correct(lam), relation)


def _relation(bench: Bench, G: FloatArray, i: int, rivals: tuple[int, ...]) -> str:
    """In words: what of the rivals looks like a certain size of the effect, on this log."""
    c = bench.columns[i][0]
    r = [bench.columns[j][0] for j in rivals]
    h = bench.asked[i]
    size = bench.smallest[c]
    amount = np.linalg.lstsq(G[np.ix_(r, r)], G[r, c], rcond=1e-9)[0] * size
    parts = [
        f"{bench.asked[j].effect.name.replace('_', ' ')}{place(bench.asked[j].where)} of "
        f"{quantity(float(a), bench.asked[j].parameter(bench.asked[j].free[0]).unit, change=True)}"
        for j, a in zip(rivals, amount, strict=True)
    ]
    unit = h.parameter(h.free[0]).unit
    joined = parts[0] if len(parts) == 1 else ", ".join(parts[:-1]) + " and " + parts[-1]
    return (
        f"On this log {h.effect.name.replace('_', ' ')}{place(h.where)} of {quantity(size, unit, change=True)} looks "
        f"exactly like {joined}."
    )
