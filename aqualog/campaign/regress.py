"""Straight lines and means over the samples of several runs, with the run, not the sample, as the unit."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aqualog.campaign.moments import (
    Design,
    Moments,
    Working,
    about_own_mean,
    huber_weights,
    moments_of,
    working_model,
)
from aqualog.core.intervals import student_quantile
from aqualog.core.moments import block_starts
from aqualog.core.records import FloatArray

__all__ = ["ATTENUATION_MAX", "NOWHERE", "Design", "Estimate", "Interval", "RunParts", "estimate"]

LEVEL = 0.95
ATTENUATION_MAX = 0.30  # beyond it, the correction depends more on the noise than on the data
ROUNDS = 12

Interval = tuple[float, float]
NOWHERE: Interval = (math.nan, math.nan)
_Index = NDArray[np.int64]


class RunParts(NamedTuple):
    """Contribution of each run to the normal equations, for repeated fits with bootstrapped runs: `run` (g,),
    `left` (g, p, p), `right` (g, p), `unit` (p,) of the columns.
    """

    run: _Index
    left: FloatArray
    right: FloatArray
    unit: FloatArray

    def again(self, times: FloatArray) -> FloatArray:
        """First coefficient (b,) if runs count `times` (b, g) each; NaN where they do not determine it."""
        left = np.einsum("bg,gij->bij", times, self.left)
        right = np.einsum("bg,gi->bi", times, self.right)
        inverse = np.linalg.pinv(left, rcond=1e-10)
        value: FloatArray = np.einsum("bi,bi->b", inverse[:, 0], right) / self.unit[0]
        return np.where(times.sum(axis=1) > 0.0, value, np.nan)


@dataclass(frozen=True, slots=True)
class Estimate:
    """Coefficients of a fit.

    `value`, `half` (p,): estimates and half widths of the 95 % intervals, infinite with one run; `dof` (p,) degrees of
    freedom; `scatter` (p,) standard deviation of the coefficients from run to run; `attenuation` share of the noisy
    column's coefficient that plain least squares would have lost [-]; `noise` variance of that column's noise;
    `spread` standard deviation of the residuals within a run; `memory` samples that count as one, since errors are
    correlated; `runs`, `samples`; `parts` for the bootstrap over runs.
    """

    value: FloatArray
    half: FloatArray
    dof: FloatArray
    scatter: FloatArray
    attenuation: float
    noise: float
    spread: float
    memory: float
    runs: int
    samples: int
    parts: RunParts

    def interval(self, i: int) -> Interval:
        """95 % interval of a coefficient."""
        return float(self.value[i] - self.half[i]), float(self.value[i] + self.half[i])


def estimate(design: Design, *, robust: bool = False) -> Estimate:
    """Fit y = columns' coefficient, with coefficients that scatter from run to run.

    Parameters
    ----------
    design : Design
        At least one run; no NaN.
    robust : bool
        Huber's weights [huber1981], on the residuals about each run's own line.

    Returns
    -------
    Estimate

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
    unit = np.sqrt(np.mean(design.columns**2, axis=1))
    unit[unit == 0.0] = 1.0  # columns differ by orders of magnitude
    d = design._replace(columns=design.columns / unit[:, None])
    first = block_starts(d.run)
    weight = np.ones_like(d.y)
    moments = moments_of(d, first, weight)
    working = working_model(d, first, moments, weight)
    moments = about_own_mean(d, moments, working)
    value, k = _solve(moments, working)
    for _ in range(ROUNDS if robust else 0):
        weight = huber_weights(d, first, moments, working, value)
        moments = moments_of(d, first, weight)
        working = working_model(d, first, moments, weight)
        moments = about_own_mean(d, moments, working)
        old, (value, k) = value, _solve(moments, working)
        if np.all(np.abs(value - old) <= 1e-4 * np.abs(value)):
            break
    half, dof = _half_widths(moments, k, value)
    # a clipped residual does not depend on the coefficients, though its weight is not zero ([huber1981], chapter 7)
    half = half * float(weight.mean() / max(float(np.mean(weight == 1.0)), 0.5))
    i = d.noisy.index(True) if any(d.noisy) else -1
    noise = _noise(moments_of(d, first, weight), value, i) if i >= 0 else 0.0
    return Estimate(
        value / unit, half / unit, dof, np.sqrt(working.between) / unit, _attenuation(moments, k, noise, i),
        noise * (float(unit[i]) ** 2 if i >= 0 else 0.0), working.spread, working.memory, first.size, d.y.size,
        RunParts(d.run[first], np.einsum("gij,gjk->gik", k, moments.h - moments.h_noise),
                 np.einsum("gij,gj->gi", k, moments.c - moments.c_noise), unit),
    )  # fmt: skip


def _solve(m: Moments, w: Working) -> tuple[FloatArray, FloatArray]:
    """Coefficients, and the weights K = (sigma^2 I + H T)^-1 of the runs' moments (g, p, p)."""
    k = np.linalg.inv(w.variance * np.eye(m.c.shape[1]) + m.h * w.between)
    a = np.einsum("gij,gjk->ik", k, m.h - m.h_noise)
    b = np.einsum("gij,gj->i", k, m.c - m.c_noise)
    value: FloatArray = np.linalg.pinv(a, rcond=1e-10) @ b
    return value, np.asarray(k, dtype=np.float64)


def _half_widths(m: Moments, k: FloatArray, value: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Half widths of the 95 % intervals and degrees of freedom, by the scores of the runs."""
    p, g = value.size, k.shape[0]
    if g < 2:
        return np.full(p, np.inf), np.zeros(p)
    plain = np.einsum("gij,gjk->gik", k, m.h)
    plain = 0.5 * (plain + np.swapaxes(plain, 1, 2))
    size, axes = np.linalg.eigh(plain.sum(axis=0))
    size = np.maximum(size, 1e-12 * size[-1])
    root, unroot = (axes * size**-0.5) @ axes.T, (axes * size**0.5) @ axes.T  # M^(1/2), M^(-1/2)
    share, turn = np.linalg.eigh(root @ plain @ root)  # share of a run in the whole: B
    share = np.clip(share, 0.0, 1.0 - 1e-6)
    grow = np.einsum("gij,gj,gkj->gik", turn, (1.0 - share) ** -0.5, turn)
    score = np.einsum("gij,gj->gi", k, m.c - m.c_noise - (m.h - m.h_noise) @ value)
    score = np.einsum("gij,gj->gi", grow, score @ root)
    jacobian = np.linalg.pinv(np.einsum("gij,gjk->ik", k, m.h - m.h_noise), rcond=1e-10)
    to_value = jacobian @ unroot
    half, dof = np.zeros(p), np.zeros(p)
    b = np.einsum("gij,gj,gkj->gik", turn, share, turn)
    for i in range(p):
        w = to_value[i]
        sigma = math.sqrt(float(np.sum((score @ w) ** 2)))
        q = grow @ w
        r = np.einsum("gij,gj->gi", b, q)
        omega = np.diag(np.einsum("gi,gi->g", q, r)) - r @ r.T
        power = float(np.sum(omega * omega))
        dof[i] = max(float(np.trace(omega)) ** 2 / power, 1.0) if power > 0.0 else 1.0
        half[i] = student_quantile(0.5 + LEVEL / 2.0, float(dof[i])) * sigma
    return half, dof


def _noise(m: Moments, value: FloatArray, i: int) -> float:
    """Variance of the noise of column i: fast changes that y does not follow."""
    total = float(m.weight.sum())
    real = float(m.c_noise[:, i].sum()) / float(value[i]) if value[i] != 0.0 else 0.0
    return max(float(m.h_noise[:, i, i].sum()) - max(real, 0.0), 0.0) / total


def _attenuation(m: Moments, k: FloatArray, noise: float, i: int) -> float:
    """Share of coefficient i that would be lost without the correction for noise."""
    if i < 0:
        return 0.0
    a = np.einsum("gij,gjk->ik", k, m.h)
    lost = noise * np.einsum("gj,g->j", k[:, :, i], m.weight)
    return float(np.linalg.pinv(a, rcond=1e-10)[i] @ lost)
