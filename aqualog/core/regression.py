"""Straight lines and means over samples in groups: the blocks of one drive, or the runs of a campaign.

One way for both: a design, its moments in each group, the fit, the interval. `jackknife` knows the noise of the columns
and leaves out one block after the other. `estimate` finds the noise, and lets coefficients scatter from run to run.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aqualog.core.compiled import compiled
from aqualog.core.intervals import Interval, half_width
from aqualog.core.moments import APART, Design, Index, Moments, Noise, block_moments, moments_of, residuals, starts_of
from aqualog.core.records import FloatArray

__all__ = ["NOISE_MAX", "ByRun", "Estimate", "degrees_of_freedom", "estimate", "jackknife"]

NOISE_MAX = 0.30  # share of a coefficient; beyond, its correction rests on the noise more than on the data
ROUNDS = 12
MAD = 1.4826  # standard deviation over median absolute deviation, normal noise
HUBER = 1.345  # residuals beyond so many standard deviations count less; 95 % efficient on normal noise
LAGS = 30  # samples over which the errors of a run may be correlated
_EXPONENTS = np.linspace(-2.0, 9.0, 12)  # decades of the variance between runs over that of a run's own coefficient


def jackknife(d: Design, noises: Sequence[Noise]) -> tuple[FloatArray, FloatArray]:
    """Fit by least squares with known noise of the columns subtracted from their moments; errors by leaving out blocks.

    The noises are independent of each other. Returns estimate and half width of the 95 % interval, (p,) each; degrees
    of freedom count the blocks by their information.
    """
    first = starts_of(d.run)
    unit = np.array([math.sqrt(float(np.mean(c * c))) or 1.0 for c in d.columns])  # they differ by orders of magnitude
    h, g = block_moments(d.columns, d.y, first, noises=noises)
    h, g = h / np.multiply.outer(unit, unit), g / unit
    inverse = np.linalg.pinv(h.sum(axis=0), rcond=1e-9, hermitian=True)
    value = inverse @ g.sum(axis=0)
    without = np.einsum("bij,bj->bi", np.linalg.pinv(h.sum(axis=0) - h, rcond=1e-9, hermitian=True), g.sum(axis=0) - g)
    blocks = first.size
    sigma = np.sqrt((blocks - 1) / blocks * np.sum((without - value) ** 2, axis=0))
    half = np.zeros(unit.size)
    for i in np.flatnonzero(sigma > 0.0).tolist():
        # information of a block about a parameter: what its samples weigh in the estimate
        weight = np.zeros_like(d.y)
        for c, w in zip(d.columns, inverse[i] / unit, strict=True):
            weight += w * c
        inform = np.add.reduceat(weight * weight, first)
        half[i] = half_width(float(sigma[i]), max(float(inform.sum() ** 2 / np.sum(inform**2)) - 1.0, 1.0))
    return value / unit, half / unit


class _Working(NamedTuple):
    """The model that the weights come from; the intervals do not require it to be true."""

    variance: float  # of a residual within a run, times the samples that count as one, since errors are correlated
    between: FloatArray  # (p,) variance of the coefficients from run to run


def _about_own_mean(d: Design, m: Moments, w: _Working) -> Moments:
    """The noise's moments without the part that a run's own offset absorbs with the mean of the noise.

    The mean of n samples whose noise is independent after `APART` of them keeps `APART` / n of its variance, and the
    offset absorbs the share n T / (sigma^2 + n T) of it, with intercepts that scatter by T. Without this, k would be 3
    % too large in runs of 30 samples where noise is a third of the variation.
    """
    is_one = (d.columns == d.columns[:, :1]).all(axis=1)
    if not is_one.any():
        return m
    own = m.weight * float(w.between[is_one].max())
    keeps = np.maximum(1.0 - APART / np.maximum(m.weight, APART) * own / (w.variance + own), 0.0)
    return m._replace(h_noise=m.h_noise * keeps[:, None, None], c_noise=m.c_noise * keeps[:, None])


def _working_model(d: Design, first: Index, m: Moments, weight: FloatArray | None = None) -> _Working:
    """Variances within and between the runs."""
    own = np.einsum("gij,gj->gi", np.linalg.pinv(m.h, rcond=1e-8, hermitian=True), m.c)
    e = residuals(d.columns, d.y, first, own)
    if weight is not None:
        e *= np.sqrt(weight)
    memory = _memory(e, d.run, d.step)
    free = np.maximum(m.weight - len(d.columns) * memory, 0.2 * m.weight)
    variance = max(float(e @ e) / float(free.sum()), 1e-30) * memory
    between = _between(m, variance, np.array(d.scatters)) if first.size > 1 else np.zeros(len(d.columns))
    return _Working(variance, between)


@compiled
def _memory(e, run, step):  # type: ignore[no-untyped-def]
    """Number of neighbouring samples that count as one: 1 + 2 (sum of the autocorrelation up to its first zero)."""
    power = 0.0
    for x in e:
        power += x * x
    if not power > 0.0:
        return 1.0
    total = 1.0
    for lag in range(1, min(LAGS, e.size - 1) + 1):
        count, product = 0, 0.0
        for k in range(lag, e.size):
            if run[k] == run[k - lag] and step[k] - step[k - lag] == lag:
                count += 1
                product += e[k] * e[k - lag]
        r = product / power * e.size / count if count else 0.0
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
    a, b, scattered, spread = (_weighed_lines if m.c.shape[1] == 2 else _weighed)(variance, m.h, m.c, grid)
    try:
        value = np.linalg.solve(a, b[:, :, None])[:, :, 0]
    except np.linalg.LinAlgError:  # columns depend on each other
        value = np.einsum("qij,qj->qi", np.linalg.pinv(a, rcond=1e-10), b)
    # what the lines leave, over the variance, without y'y, which is the same for all: H T K = I - sigma^2 K
    left = -np.einsum("qi,qi->q", value, b) - scattered / variance
    result: FloatArray = spread + np.linalg.slogdet(a)[1] + left
    return result


@compiled
def _weighed(variance, h, c, grid):  # type: ignore[no-untyped-def]
    """For each row T of `grid`, with K = (sigma^2 I + H T)^-1: sums over the runs of K H (q, p, p), K c (q, p),
    c' T K c (q,) and log |I + H T / sigma^2| (q,). Gauss and Jordan need no pivots: H is positive, T diagonal.
    """
    q, (g, p) = grid.shape[0], c.shape
    a, b, scattered, spread = np.zeros((q, p, p)), np.zeros((q, p)), np.zeros(q), np.zeros(q)
    x = np.empty((p, 2 * p + 1))  # sigma^2 I + H T, H, c
    for n in range(q):
        for r in range(g):
            for i in range(p):
                for j in range(p):
                    x[i, j], x[i, p + j] = (variance if i == j else 0.0) + h[r, i, j] * grid[n, j], h[r, i, j]
                x[i, 2 * p] = c[r, i]
            determinant = 1.0
            for i in range(p):
                pivot = x[i, i]
                determinant *= abs(pivot) / variance
                for j in range(i + 1, 2 * p + 1):
                    x[i, j] /= pivot
                    for k in range(p):
                        if k != i:
                            x[k, j] -= x[k, i] * x[i, j]
            spread[n] += math.log(determinant)
            for i in range(p):
                b[n, i] += x[i, 2 * p]
                scattered[n] += c[r, i] * grid[n, i] * x[i, 2 * p]
                for j in range(p):
                    a[n, i, j] += x[i, p + j]
    return a, b, scattered, spread


@compiled
def _weighed_lines(variance, h, c, grid):  # type: ignore[no-untyped-def]
    """The same with two columns, nearly always a slope and an offset: all in registers, and few logarithms."""
    q, g = grid.shape[0], c.shape[0]
    a, b, scattered, spread = np.empty((q, 2, 2)), np.empty((q, 2)), np.empty(q), np.empty(q)
    for n in range(q):
        t_0, t_1 = grid[n, 0], grid[n, 1]
        a_00 = a_01 = a_11 = b_0 = b_1 = form = logs = 0.0
        product = 1.0
        for r in range(g):
            h_00, h_01, h_11 = h[r, 0, 0], h[r, 0, 1], h[r, 1, 1]
            d_0, d_1 = variance + h_00 * t_0, variance + h_11 * t_1
            determinant = d_0 * d_1 - h_01 * h_01 * t_0 * t_1
            over = 1.0 / determinant
            x_0 = (d_1 * c[r, 0] - h_01 * t_1 * c[r, 1]) * over
            x_1 = (d_0 * c[r, 1] - h_01 * t_0 * c[r, 0]) * over
            b_0, b_1 = b_0 + x_0, b_1 + x_1
            form += c[r, 0] * t_0 * x_0 + c[r, 1] * t_1 * x_1
            a_00 += (d_1 * h_00 - h_01 * t_1 * h_01) * over
            a_01 += variance * h_01 * over
            a_11 += (d_0 * h_11 - h_01 * t_0 * h_01) * over
            product *= abs(determinant) / (variance * variance)
            if product > 1e100:
                logs, product = logs + math.log(product), 1.0
        a[n, 0, 0], a[n, 0, 1], a[n, 1, 0], a[n, 1, 1] = a_00, a_01, a_01, a_11
        b[n, 0], b[n, 1], scattered[n], spread[n] = b_0, b_1, form, logs + math.log(product)
    return a, b, scattered, spread


def _huber_weights(d: Design, first: Index, m: Moments, w: _Working, value: FloatArray) -> FloatArray:
    """Weights of the samples, by their residual about the line of their own run."""
    s = m.c - m.h @ value
    k = np.linalg.inv(w.variance * np.eye(value.size) + m.h * w.between)
    own = value + w.between * np.einsum("gij,gj->gi", k, s)
    e = np.abs(residuals(d.columns, d.y, first, own))
    scale = max(MAD * float(np.median(e)), 1e-12)
    weight: FloatArray = np.minimum(1.0, HUBER * scale / np.maximum(e, 1e-30))
    return weight


class ByRun(NamedTuple):
    """What each run does to an estimate, arrays (g,): its `run`, its `part` in the error, whose squares add up to the
    variance [bell2002], and its `share` in the information. Estimates from the same runs err together by their parts.
    """

    run: Index = np.zeros(0, dtype=np.int64)
    part: FloatArray = np.zeros(0)
    share: FloatArray = np.zeros(0)


@dataclass(frozen=True, slots=True)
class Estimate:
    """Coefficients of a fit.

    `value`, `half` (p,): estimates and half widths of the 95 % intervals, infinite with one run; `dof` (p,) degrees of
    freedom; `scatter` (p,) standard deviation of the coefficients from run to run; `attenuation` share of the noisy
    column's coefficient that plain least squares would have lost [-]; `noise` variance of that column's noise; numbers
    of `runs` and `samples`; `by_run` of each coefficient.
    """

    value: FloatArray
    half: FloatArray
    dof: FloatArray
    scatter: FloatArray
    attenuation: float
    noise: float
    runs: int
    samples: int
    by_run: tuple[ByRun, ...]

    def interval(self, i: int) -> Interval:
        """95 % interval of a coefficient."""
        return float(self.value[i] - self.half[i]), float(self.value[i] + self.half[i])


def estimate(design: Design, *, robust: bool = False) -> Estimate:
    """Fit y = columns' coefficient, with coefficients that scatter from run to run.

    At least one run, and no NaN. `robust`: Huber's weights [huber1981], on the residuals about each run's own line.

    Generalised least squares with V = sigma^2 I + X T X' per run: the intercepts, and on request the slopes, scatter
    about a mean (T by restricted likelihood), the errors within a run are correlated (sigma^2 counts `memory` samples
    as one). With p columns all of it needs X'X and X'y of each run only. Variation within runs and differences between
    runs both count, with weights from the data.

    Noise of the traction biases k towards 0. Its moments, from second differences over `APART` samples, are subtracted
    from X'X and X'y alike, so that the estimate stays consistent; run by run, so that the error of the noise is in the
    intervals too.

    Intervals: cluster-robust variance of the runs' scores with the correction of Bell and McCaffrey (CR2 [bell2002])
    and Satterthwaite's degrees of freedom [satterthwaite1946], as Pustejovsky and Tipton [pustejovsky2018] give them
    for weighted fits: they hold with a handful of runs, and whether or not the model behind the weights is right.
    """
    unit = np.sqrt(np.einsum("pn,pn->p", design.columns, design.columns) / design.y.size)
    unit[unit == 0.0] = 1.0  # columns differ by orders of magnitude
    d = design._replace(columns=design.columns / unit[:, None])
    first = starts_of(d.run)
    plain = moments_of(d, first)
    working = _working_model(d, first, plain)
    moments = _about_own_mean(d, plain, working)
    value, k = _solve(moments, working)
    for _ in range(ROUNDS if robust else 0):
        weight = _huber_weights(d, first, moments, working, value)
        plain = moments_of(d, first, weight)
        working = _working_model(d, first, plain, weight)
        moments = _about_own_mean(d, plain, working)
        old, (value, k) = value, _solve(moments, working)
        if np.all(np.abs(value - old) <= 1e-4 * np.abs(value)):
            break
    half, dof, parts, shares = _half_widths(moments, k, value)
    if robust:
        # a clipped residual does not depend on the coefficients, though its weight is not zero ([huber1981], chapter 7)
        clipped = float(weight.mean() / max(float(np.mean(weight == 1.0)), 0.5))
        half, parts = half * clipped, parts * clipped
    by_run = tuple(ByRun(d.run[first], part / u, share) for part, share, u in zip(parts, shares, unit, strict=True))
    i = d.noisy.index(True) if any(d.noisy) else -1
    noise = 0.0
    if i >= 0:  # fast changes that y does not follow
        real = float(plain.c_noise[:, i].sum()) / float(value[i]) if value[i] != 0.0 else 0.0
        noise = max(float(plain.h_noise[:, i, i].sum()) - max(real, 0.0), 0.0) / float(plain.weight.sum())
    return Estimate(
        value / unit, half / unit, dof, np.sqrt(working.between) / unit, _attenuation(moments, k, noise, i),
        noise * (float(unit[i]) ** 2 if i >= 0 else 0.0), first.size, d.y.size, by_run,
    )  # fmt: skip


def _solve(m: Moments, w: _Working) -> tuple[FloatArray, FloatArray]:
    """Coefficients, and the weights K = (sigma^2 I + H T)^-1 of the runs' moments (g, p, p)."""
    k = np.linalg.inv(w.variance * np.eye(m.c.shape[1]) + m.h * w.between)
    a = np.einsum("gij,gjk->ik", k, m.h - m.h_noise)
    b = np.einsum("gij,gj->i", k, m.c - m.c_noise)
    value: FloatArray = np.linalg.pinv(a, rcond=1e-10) @ b
    return value, np.asarray(k, dtype=np.float64)


def _half_widths(m: Moments, k: FloatArray, value: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Half widths of the 95 % intervals and degrees of freedom, by the scores of the runs; those, and shares (p, g)."""
    p, g = value.size, k.shape[0]
    parts, shares = np.zeros((p, g)), np.full((p, g), 1.0 / g)
    if g < 2:
        return np.full(p, np.inf), np.zeros(p), parts, shares
    plain = np.einsum("gij,gjk->gik", k, m.h)
    plain = 0.5 * (plain + np.swapaxes(plain, 1, 2))
    size, axes = np.linalg.eigh(plain.sum(axis=0))
    size = np.maximum(size, 1e-12 * size[-1])
    root, unroot = (axes * size**-0.5) @ axes.T, (axes * size**0.5) @ axes.T  # M^(1/2), M^(-1/2)
    share, turn = np.linalg.eigh(root @ plain @ root)  # share of a run in the whole: B
    share = np.clip(share, 0.0, 1.0 - 1e-6)
    back = np.swapaxes(turn, 1, 2)
    grow = (turn * ((1.0 - share) ** -0.5)[:, None]) @ back
    score = np.einsum("gij,gj->gi", k, m.c - m.c_noise - (m.h - m.h_noise) @ value)
    score = np.einsum("gij,gj->gi", grow, score @ root)
    jacobian = np.linalg.pinv(np.einsum("gij,gjk->ik", k, m.h - m.h_noise), rcond=1e-10)
    to_value = jacobian @ unroot
    half, dof = np.zeros(p), np.zeros(p)
    b = (turn * share[:, None]) @ back
    for i in range(p):
        w = to_value[i]
        parts[i] = score @ w
        sigma = math.sqrt(float(np.sum(parts[i] ** 2)))
        q = grow @ w
        r = np.einsum("gij,gj->gi", b, q)
        omega = r @ r.T
        np.einsum("gg->g", omega)[:] -= np.einsum("gi,gi->g", q, r)
        dof[i] = degrees_of_freedom(omega)
        half[i] = half_width(sigma, float(dof[i]))
        if (total := float(np.trace(omega))) < 0.0:
            shares[i] = np.diag(omega) / total
    return half, dof, parts, shares


def degrees_of_freedom(omega: FloatArray) -> float:
    """Degrees of freedom of a sum of squares [satterthwaite1946], from the covariance (g, g) of its terms."""
    power = float(np.vdot(omega, omega))
    return max(float(np.trace(omega)) ** 2 / power, 1.0) if power > 0.0 else 1.0


def _attenuation(m: Moments, k: FloatArray, noise: float, i: int) -> float:
    """Share of coefficient i that would be lost without the correction for noise."""
    if i < 0:
        return 0.0
    a = np.einsum("gij,gjk->ik", k, m.h)
    lost = noise * np.einsum("gj,g->j", k[:, :, i], m.weight)
    return float(np.linalg.pinv(a, rcond=1e-10)[i] @ lost)
