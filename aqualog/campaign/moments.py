"""Moments of the runs' samples, and the working model that weighs them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aqualog.core.compiled import compiled
from aqualog.core.moments import block_moments, second_difference
from aqualog.core.records import FloatArray

__all__ = [
    "APART", "Design", "Moments", "Working", "about_own_mean", "huber_weights", "moments_of",
    "working_model",
]  # fmt: skip

APART = 3  # samples between values whose noise is independent: 0.3 s of smoothing at 10 Hz
MAD = 1.4826  # standard deviation over median absolute deviation, normal noise
HUBER = 1.345  # residuals beyond so many standard deviations count less; 95 % efficient on normal noise
LAGS = 30  # samples over which the errors of a run may be correlated
LEAST_TRIPLES = 10  # of a run, to estimate the noise of its own traction; else that of all runs is used
_EXPONENTS = np.linspace(-2.0, 9.0, 12)  # decades of the variance between runs over that of a run's own coefficient

_Index = NDArray[np.int64]


class Design(NamedTuple):
    """Data of a fit: `columns` (p, n), `y` (n,), and for each sample its run and its place in time.

    `run` ascends; `step` ascends within a run and counts samples of the even grid, so that gaps are recognised.
    `scatters` (p,): whether a column's coefficient differs from run to run. `noisy` (p,): whether the column is
    measured with noise that is independent after `APART` samples; at most one.
    """

    columns: FloatArray
    y: FloatArray
    run: _Index
    step: _Index
    scatters: tuple[bool, ...]
    noisy: tuple[bool, ...]


class Moments(NamedTuple):
    """Per run: X'X (g, p, p), X'y (g, p), the same of the noise, and weights."""

    h: FloatArray
    c: FloatArray
    h_noise: FloatArray
    c_noise: FloatArray
    weight: FloatArray  # (g,)


class Working(NamedTuple):
    """The model that the weights come from; the intervals do not require it to be true."""

    variance: float  # of a residual within a run, times the memory
    between: FloatArray  # (p,) variance of the coefficients from run to run
    spread: float
    memory: float


def moments_of(d: Design, first: _Index, weight: FloatArray) -> Moments:
    """Moments of each run; those of the noise per unit of weight, times the run's weight."""
    p = len(d.columns)
    h, c = block_moments(d.columns, d.y, first, weight=weight)
    total = np.add.reduceat(weight, first)
    h_noise, c_noise = np.zeros_like(h), np.zeros_like(c)
    for i in (i for i in range(p) if d.noisy[i]):
        both, same, triples = _second_differences(d, i, first)
        enough = triples >= LEAST_TRIPLES
        if triples.sum() >= LEAST_TRIPLES:
            count = np.where(enough, triples, 1)
            h_noise[:, i, i] = total * np.where(enough, same / count, same.sum() / triples.sum()) / 6.0
            c_noise[:, i] = total * np.where(enough, both / count, both.sum() / triples.sum()) / 6.0
    return Moments(h, c, h_noise, c_noise, total)


def about_own_mean(d: Design, m: Moments, w: Working) -> Moments:
    """The noise's moments without the part that a run's own offset absorbs with the mean of the noise.

    The mean of n samples whose noise is independent after `APART` of them keeps `APART` / n of its variance, and the
    offset absorbs the share n T / (sigma^2 + n T) of it, with intercepts that scatter by T. Without this, k would be 3
    % too large in runs of 30 samples where noise is a third of the variation.
    """
    is_one = np.ptp(d.columns, axis=1) == 0.0
    if not is_one.any():
        return m
    own = m.weight * float(w.between[is_one].max())
    keeps = np.maximum(1.0 - APART / np.maximum(m.weight, APART) * own / (w.variance + own), 0.0)
    return m._replace(h_noise=m.h_noise * keeps[:, None, None], c_noise=m.c_noise * keeps[:, None])


def _second_differences(d: Design, i: int, first: _Index) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Per run: sum of D x D y and of (D x)^2 over triples of samples, and their number."""
    run = np.repeat(np.arange(first.size), np.diff(np.append(first, d.y.size)))
    a = 2 * APART
    if d.y.size <= a:
        return np.zeros(first.size), np.zeros(first.size), np.zeros(first.size)
    whole = (run[a:] == run[:-a]) & (d.step[a:] - d.step[:-a] == a) & (d.step[APART:-APART] - d.step[:-a] == APART)
    d_x, d_y = (second_difference(v, APART) for v in (d.columns[i], d.y))
    r = run[a:][whole]
    both = np.bincount(r, (d_x * d_y)[whole], first.size).astype(np.float64)
    same = np.bincount(r, (d_x * d_x)[whole], first.size).astype(np.float64)
    return both, same, np.bincount(r, minlength=first.size).astype(np.float64)


def working_model(d: Design, first: _Index, m: Moments, weight: FloatArray) -> Working:
    """Variances within and between the runs."""
    own = np.einsum("gij,gj->gi", np.linalg.pinv(m.h, rcond=1e-8, hermitian=True), m.c)
    run = np.repeat(np.arange(first.size), np.diff(np.append(first, d.y.size)))
    e = d.y - np.einsum("ig,gi->g", d.columns, own[run]) if d.y.size else d.y
    e = e * np.sqrt(weight)
    memory = _memory(e, run, d.step)
    free = np.maximum(m.weight - len(d.columns) * memory, 0.2 * m.weight)
    raw = max(float(e @ e) / float(free.sum()), 1e-30)
    variance = raw * memory
    between = _between(m, variance, np.array(d.scatters)) if first.size > 1 else np.zeros(len(d.columns))
    return Working(variance, between, math.sqrt(raw), memory)


def _memory(e: FloatArray, run: _Index, step: _Index) -> float:
    """Number of neighbouring samples that count as one: 1 + 2 (sum of the autocorrelation up to its first zero)."""
    power = float(e @ e)
    if not power > 0.0:
        return 1.0
    total = 1.0
    for lag in range(1, min(LAGS, e.size - 1) + 1):
        pair = (run[lag:] == run[:-lag]) & (step[lag:] - step[:-lag] == lag)
        count = int(np.count_nonzero(pair))
        r = float((e[lag:] * e[:-lag])[pair].sum()) / power * e.size / count if count else 0.0
        if r <= 0.0:
            break
        total += 2.0 * min(r, 1.0)
    return total


def _between(m: Moments, variance: float, scatters: NDArray[np.bool_]) -> FloatArray:
    """Variance of the coefficients from run to run that makes the data most likely (restricted), on a grid."""
    p = m.c.shape[1]
    diagonal = np.einsum("gii->gi", m.h)
    scale = np.array([variance / max(float(np.median(diagonal[:, i])), 1e-30) for i in range(p)])
    axis = np.concatenate([[0.0], 10.0**_EXPONENTS])
    axes = [scale[i] * axis if scatters[i] else np.zeros(1) for i in range(p)]
    best = np.zeros(p)
    for finer in range(2):
        grid = np.stack([x.ravel() for x in np.meshgrid(*axes, indexing="ij")], axis=1)
        best = grid[int(np.argmin(_unlikelihood(m, variance, grid)))]
        if finer == 0:
            step = 10.0 ** (np.linspace(-0.75, 0.75, 7) * (_EXPONENTS[1] - _EXPONENTS[0]))
            axes = [best[i] * step if best[i] > 0.0 else np.zeros(1) for i in range(p)]
    return best


def _unlikelihood(m: Moments, variance: float, grid: FloatArray) -> FloatArray:
    """-2 log of the restricted likelihood, without a constant, for each row of `grid` (q, p)."""
    k, a, b, spread = _weighed(variance, m.h, m.c, grid)
    value = np.einsum("qij,qj->qi", np.linalg.pinv(a, rcond=1e-10, hermitian=False), b)
    # residual sum of squares without y'y, which is the same for all
    rss = -2.0 * value @ m.c.sum(axis=0) + np.einsum("qi,ij,qj->q", value, m.h.sum(axis=0), value)
    explained = _explained(k, m.h, m.c, grid, value)
    result: FloatArray = spread + np.linalg.slogdet(a)[1] + (rss - explained) / variance
    return result


@compiled
def _inverse(x, out):  # type: ignore[no-untyped-def]
    """|det x| of a small matrix (p, p), which is used up; its inverse into `out`. Gauss and Jordan with pivots."""
    p = x.shape[0]
    for i in range(p):
        for j in range(p):
            out[i, j] = 1.0 if i == j else 0.0
    determinant = 1.0
    for i in range(p):
        best = i
        for r in range(i + 1, p):
            if abs(x[r, i]) > abs(x[best, i]):
                best = r
        for j in range(p):
            x[i, j], x[best, j] = x[best, j], x[i, j]
            out[i, j], out[best, j] = out[best, j], out[i, j]
        pivot = x[i, i]
        determinant *= abs(pivot)
        for j in range(p):
            x[i, j] /= pivot
            out[i, j] /= pivot
        for r in range(p):
            if r != i:
                factor = x[r, i]
                for j in range(p):
                    x[r, j] -= factor * x[i, j]
                    out[r, j] -= factor * out[i, j]
    return determinant


@compiled
def _weighed(variance, h, c, grid):  # type: ignore[no-untyped-def]
    """For each row T of `grid`: K = (sigma^2 I + H T)^-1 of the runs (q, g, p, p), sums of K H and of K c over them,
    and the sum of log |I + H T / sigma^2|.
    """
    q, (g, p) = grid.shape[0], c.shape
    k, a, b, spread = np.empty((q, g, p, p)), np.zeros((q, p, p)), np.zeros((q, p)), np.zeros(q)
    inner = np.empty((p, p))
    for n in range(q):
        for r in range(g):
            for i in range(p):
                for j in range(p):
                    inner[i, j] = (variance if i == j else 0.0) + h[r, i, j] * grid[n, j]
            own = k[n, r]
            spread[n] += math.log(_inverse(inner, own) / variance**p)
            for i in range(p):
                for j in range(p):
                    b[n, i] += own[i, j] * c[r, j]
                    for other in range(p):
                        a[n, i, other] += own[i, j] * h[r, j, other]
    return k, a, b, spread


@compiled
def _explained(k, h, c, grid, value):  # type: ignore[no-untyped-def]
    """Sum over the runs of s' T K s with s = c - H value, for each row of `grid`. (q,)"""
    q, (g, p) = grid.shape[0], c.shape
    out, s = np.zeros(q), np.empty(p)
    for n in range(q):
        for r in range(g):
            for i in range(p):
                s[i] = c[r, i]
                for j in range(p):
                    s[i] -= h[r, i, j] * value[n, j]
            for i in range(p):
                for j in range(p):
                    out[n] += s[i] * grid[n, i] * k[n, r, i, j] * s[j]
    return out


def huber_weights(d: Design, first: _Index, m: Moments, w: Working, value: FloatArray) -> FloatArray:
    """Weights of the samples, by their residual about the line of their own run."""
    s = m.c - m.h @ value
    k = np.linalg.inv(w.variance * np.eye(value.size) + m.h * w.between)
    own = value + w.between * np.einsum("gij,gj->gi", k, s)
    run = np.repeat(np.arange(first.size), np.diff(np.append(first, d.y.size)))
    e = d.y - np.einsum("in,ni->n", d.columns, own[run])
    scale = max(MAD * float(np.median(np.abs(e))), 1e-12)
    weight: FloatArray = np.minimum(1.0, HUBER * scale / np.maximum(np.abs(e), 1e-30))
    return weight
