"""Samples in groups, the blocks of one drive or the runs of a campaign: normal equations group by group, and noise."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aqualog.core.compiled import compiled
from aqualog.core.records import FloatArray

__all__ = [
    "APART", "Design", "Index", "Moments", "Noise", "block_moments", "moments_of", "residuals",
    "second_difference", "starts_of",
]  # fmt: skip

APART = 3  # samples between values whose noise is independent: 0.3 s of smoothing at 10 Hz
LEAST_TRIPLES = 10  # of a run, to estimate the noise of its own traction; else that of all runs is used

Index = NDArray[np.int64]
_NONE: Index = np.zeros(0, dtype=np.int64)


class Design(NamedTuple):
    """Data of a fit: `columns` (p, n), `y` (n,), and for each sample its `run` of a campaign, or its block of a drive.

    `run` ascends. Only `estimate` uses the rest. `step` ascends within a run and counts samples of the even grid, so
    that gaps show. `scatters` (p,): whether a column's coefficient differs from run to run. `noisy` (p,):
    whether the column is measured with noise that is independent after `APART` samples; at most one.
    """

    columns: FloatArray
    y: FloatArray
    run: Index
    step: Index = _NONE
    scatters: tuple[bool, ...] = ()
    noisy: tuple[bool, ...] = ()


class Noise(NamedTuple):
    """Noise of the design: its `variance`, and by how much it `enters` each column (a number or (n,))."""

    variance: float
    enters: Sequence[FloatArray | float]


def starts_of(label: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return where the samples of each block begin; labels (n,) ascend."""
    return np.append(0, 1 + np.flatnonzero(label[1:] != label[:-1]))


def block_moments(
    columns: Sequence[FloatArray] | FloatArray,
    y: FloatArray,
    first: NDArray[np.int64],
    *,
    weight: FloatArray | None = None,
    noises: Sequence[Noise] = (),
) -> tuple[FloatArray, FloatArray]:
    """Return X'WX (g, p, p) and X'Wy (g, p) of each block.

    Parameters
    ----------
    columns : p arrays (n,)
        Of the design X.
    y : array (n,)
    first : int array (g,)
        As `starts_of`.
    weight : array (n,), optional
        Diagonal of W; 1 by default.
    noises : sequence of Noise
        Independent of each other; their products are subtracted from those of the columns.
    """
    p = len(columns)
    h, c = np.empty((first.size, p, p)), np.empty((first.size, p))
    for i in range(p):
        weighed = columns[i] if weight is None else weight * columns[i]
        c[:, i] = np.add.reduceat(weighed * y, first)
        for j in range(i + 1):
            product = weighed * columns[j]
            for noise in noises:
                product -= noise.variance * noise.enters[i] * noise.enters[j]
            h[:, i, j] = h[:, j, i] = np.add.reduceat(product, first)
    return h, c


def second_difference(x: FloatArray, apart: int) -> FloatArray:
    """Return x[k + 2 a] - 2 x[k + a] + x[k]: fast changes and noise, without level and drift. (n - 2 a,)"""
    return x[2 * apart :] - 2.0 * x[apart:-apart] + x[: -2 * apart]


class Moments(NamedTuple):
    """Per run: X'X (g, p, p), X'y (g, p), the same of the noise, and weights."""

    h: FloatArray
    c: FloatArray
    h_noise: FloatArray
    c_noise: FloatArray
    weight: FloatArray  # (g,)


def moments_of(d: Design, first: Index, weight: FloatArray | None = None) -> Moments:
    """Moments of each run, weights 1 by default; those of the noise per unit of weight, times the run's weight."""
    p = len(d.columns)
    h, c = block_moments(d.columns, d.y, first, weight=weight)
    ends = np.append(first, d.y.size)
    total = np.diff(ends).astype(np.float64) if weight is None else np.add.reduceat(weight, first)
    h_noise, c_noise = np.zeros_like(h), np.zeros_like(c)
    for i in (i for i in range(p) if d.noisy[i]):
        both, same, triples = _second_differences(d.columns[i], d.y, d.step, ends)
        enough = triples >= LEAST_TRIPLES
        if triples.sum() >= LEAST_TRIPLES:
            count = np.where(enough, triples, 1)
            h_noise[:, i, i] = total * np.where(enough, same / count, same.sum() / triples.sum()) / 6.0
            c_noise[:, i] = total * np.where(enough, both / count, both.sum() / triples.sum()) / 6.0
    return Moments(h, c, h_noise, c_noise, total)


@compiled
def residuals(columns, y, first, lines):  # type: ignore[no-untyped-def]
    """What the coefficients of each run, `lines` (g, p), leave of y (n,)."""
    e = np.zeros(y.size)
    for r in range(first.size):
        end = first[r + 1] if r + 1 < first.size else y.size
        for i in range(columns.shape[0]):
            b = lines[r, i]
            for k in range(first[r], end):
                e[k] += columns[i, k] * b
    return y - e


@compiled
def _second_differences(x, y, step, ends):  # type: ignore[no-untyped-def]
    """Per run: sum of D x D y and of (D x)^2 over triples of samples, and their number."""
    g = ends.size - 1
    both, same, triples = np.zeros(g), np.zeros(g), np.zeros(g)
    for r in range(g):
        begin, end = ends[r], ends[r + 1]
        is_even = step[end - 1] - step[begin] == end - 1 - begin
        product, square, count = 0.0, 0.0, 0
        for k in range(begin, end - 2 * APART):
            if is_even or (step[k + 2 * APART] - step[k] == 2 * APART and step[k + APART] - step[k] == APART):
                d_x = x[k + 2 * APART] - 2.0 * x[k + APART] + x[k]
                product += d_x * (y[k + 2 * APART] - 2.0 * y[k + APART] + y[k])
                square += d_x * d_x
                count += 1
        both[r], same[r], triples[r] = product, square, count
    return both, same, triples
