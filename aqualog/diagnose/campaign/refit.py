"""Sizes of a set of effects in the simulator's own terms: least squares in the model, weighted by the runs' scatter.

A run is one vector of channels, independent of the others. Its deviation from the model has the covariance Sigma +
kappa D_r, with D_r the variance of the run's means that contact and depth give along its lane, and heavier tails than a
normal's (Student's t of `NU` degrees of freedom), so that a run with a wrong entry counts little.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aqualog.core.intervals import student_quantile
from aqualog.core.records import BoolArray, FloatArray
from aqualog.diagnose.campaign.passes import Passes, expected_values
from aqualog.diagnose.evidence import Evidence
from aqualog.diagnose.hypotheses import Hypothesis, value_in, with_free
from aqualog.diagnose.records import Estimate
from aqualog.diagnose.refit import PRIOR_WIDTH
from aqualog.diagnose.search import DOUBT
from aqualog.model.term import Model

__all__ = ["Fit", "Refit", "estimates", "fit", "inner", "inverse_of", "prior_of", "refit", "settled"]

NU = 8.0  # tails as heavy as this cost 4 % of efficiency on normal runs
SOUGHT = 25  # rounds of the scatter
AGAIN = 4  # rounds from a good start
DOUBTS = 21  # columns of `passes.doubted`
_MISSING = 1e9
ROUNDS = 6
STEP = 0.1  # prior standard deviations, of a finite difference
DONE = 0.1  # standard errors
EDGE = 1e-6


class Fit(NamedTuple):
    """Sizes (k,) of all columns, `sigma` (c, c) of the channels in their units, `kappa` (c,) on the road's part, and
    `weight` (g, c, c) = precision of each run.
    """

    size: FloatArray
    sigma: FloatArray
    kappa: FloatArray
    weight: FloatArray


def prior_of(free: int, tested: int = 0) -> FloatArray:
    """Precision (k,) of the sizes: of `free` columns the first `DOUBTS` and all `tested` ones have a unit prior."""
    prior: FloatArray = np.concatenate([np.zeros(free), np.ones(tested)])
    prior[: min(DOUBTS, free)] = 1.0
    return prior


def fit(y: FloatArray, x: FloatArray, road: FloatArray, free: FloatArray, start: Fit | None = None) -> Fit:
    """Sizes and scatter by restricted likelihood (EM), the sizes' uncertainty in the scatter. `y` (g, c), NaN where not
    available; `x`, `free` (g, c, k): columns whose sizes have a unit prior, and those of `prior_of`; `road` (g, c):
    variances; `start`: from where to go on."""
    known = np.isfinite(y)
    X = np.where(known[:, :, None], np.nan_to_num(np.concatenate([free, x], axis=-1)), 0.0)
    prior = np.diag(prior_of(free.shape[-1], x.shape[-1]))
    y, road = np.where(known, y, 0.0), np.nan_to_num(road)
    g, c = y.shape
    floor = np.array([1e-6 * y[known[:, i], i].var() if known[:, i].any() else 1.0 for i in range(c)]) + 1e-30
    sigma, kappa = (start.sigma, start.kappa) if start else (np.diag(1e4 * floor), np.full(c, 0.5))
    tail = np.ones(g)
    for left in range(AGAIN if start else SOUGHT, -1, -1):
        whole = np.linalg.inv(sigma + np.eye(c) * np.where(known, kappa * road, _MISSING)[:, None, :])
        plain: FloatArray = np.where(known[:, :, None] & known[:, None, :], whole, 0.0)
        weight = tail[:, None, None] * plain
        wx = (weight @ X).reshape(g * c, -1)
        covariance = inverse_of(X.reshape(g * c, -1).T @ wx + prior)
        size = covariance @ (y.ravel() @ wx)
        if left == 0:
            break
        e = y - X @ size
        sw = sigma @ plain
        m, swx = np.einsum("rce,re->rc", sw, e), sw @ X
        unsure = (swx @ covariance) @ swx.transpose(0, 2, 1)
        total = tail[:, None, None] * (m[:, :, None] * m[:, None, :] + unsure) + sigma - sw @ sigma
        kappa = _kappa(plain, kappa, road, e, tail, known)
        sigma = total.mean(axis=0)
        sigma = 0.5 * (sigma + sigma.T) + np.diag(floor)
        tail = np.asarray((NU + known.sum(axis=1)) / (NU + np.einsum("rc,rcd,rd->r", e, plain, e)))
    return Fit(size, sigma, kappa, weight)


def _kappa(
    plain: FloatArray, kappa: FloatArray, road: FloatArray, e: FloatArray, tail: FloatArray, known: BoolArray
) -> FloatArray:
    """Factor on the road's part: one for the slips, one for the resistance (the last channel)."""
    part = kappa * road
    m = part * np.einsum("rce,re->rc", plain, e)
    total = tail[:, None] * m**2 + part - part**2 * np.einsum("rcc->rc", plain)
    out = kappa.copy()
    for c in (slice(0, -1), slice(-1, None)):
        use = known[:, c] & (road[:, c] > 0.0)
        if use.any():
            out[c] = float((total[:, c][use] / road[:, c][use]).mean())
    return out


def inner(x: FloatArray, y: FloatArray, free: FloatArray, weight: FloatArray) -> FloatArray:
    """Inner products (k + 1, k + 1) of columns `x` (g, c, k) and, last, of `y` (g, c), the `free` columns taken out;
    `weight` (g, c, c): precision of each run."""
    rows = np.concatenate([free, x, y[:, :, None]], axis=-1)
    rows = np.where(np.isfinite(y)[:, :, None], rows, 0.0)
    G = rows.reshape(y.size, -1).T @ (weight @ rows).reshape(y.size, -1)
    n = free.shape[-1]
    return np.asarray(G[n:, n:] - G[n:, :n] @ inverse_of(G[:n, :n] + np.diag(prior_of(n))) @ G[:n, n:])


def inverse_of(a: FloatArray) -> FloatArray:
    """Inverse of a positive matrix whose columns may have any unit; of columns without any data: 0."""
    size = np.diag(a)
    unit = np.sqrt(np.where(size > 0.0, size, 1.0))
    scaled = a / unit[:, None] / unit[None]
    found: FloatArray = np.linalg.pinv(scaled, rcond=1e-10, hermitian=True) / unit[:, None] / unit[None]
    return found


@dataclass(frozen=True, slots=True)
class Refit:
    """A set at its best values: `theta` (k,) their distance from the model at hand in prior standard deviations; `x`
    (g, c, k) change of the observations by one of those there; `residual` (g, c); `at_bound` if a value sits at its
    physical bound."""

    members: tuple[Hypothesis, ...]
    theta: FloatArray
    model: Model
    residual: FloatArray
    x: FloatArray
    at_bound: bool

    @property
    def at_start(self) -> FloatArray:
        """Residual (g, c) that a linear model about these values would have had without the set."""
        return np.asarray(self.residual + self.x @ self.theta)

    @property
    def keys(self) -> str:
        """`contact_loss@f+water_drag`."""
        return "+".join(sorted(h.key for h in self.members)) or "none"


def refit(
    passes: Passes, evidence: Evidence, chosen: Sequence[int], start: FloatArray, x: FloatArray, weight: FloatArray,
    given: Model,
) -> Refit:  # fmt: skip
    """Fit a set by Gauss-Newton with the prior of each parameter, within its physical bounds, on a given model.
    `chosen`: hypotheses of the set; `start` (k,) in prior standard deviations; `x` (g, c, k): change of the
    observations by one of those near the start; `weight` (g, c, c): precision of each run."""
    members = tuple(evidence.asked[m] for m in chosen)
    columns = [c for m in chosen for c in evidence.columns[m]]
    told = [(h, h.parameter(n)) for h in members for n in h.free]
    now, lowest, highest = np.array([(value_in(given, h, p.name), p.low, p.high) for h, p in told]).reshape(-1, 3).T
    sigma = evidence.prior[columns]
    low, high = evidence.low[columns] / sigma, evidence.high[columns] / sigma

    def at(t: FloatArray) -> tuple[Model, FloatArray]:
        # a bound in units of sigma comes back with a rounding error beyond it
        model = with_free(given, members, np.clip(now + sigma * t, lowest, highest))
        return model, passes.values - expected_values(passes, model)[0]

    def loss(e: FloatArray, t: FloatArray) -> float:
        return float(inner(np.zeros((*e.shape, 0)), e, passes.nuisances, weight)[0, 0] + t @ t / PRIOR_WIDTH**2)

    def slopes(e: FloatArray, t: FloatArray) -> FloatArray:
        x = np.zeros((*e.shape, t.size))
        for k in range(t.size):
            step = STEP if t[k] + STEP <= high[k] else -STEP
            x[:, :, k] = np.nan_to_num((e - at(t + step * np.eye(t.size)[k])[1]) / step)
        return x

    theta = np.clip(start, low, high)
    model, e = at(theta)
    least, fresh = loss(e, theta), False
    for _ in range(ROUNDS if theta.size else 0):
        A = inner(x, e, passes.nuisances, weight)
        full = A[:-1, :-1] + np.eye(theta.size) / PRIOR_WIDTH**2
        way = np.linalg.solve(full, A[:-1, -1] - theta / PRIOR_WIDTH**2)
        for share in (1.0, 0.4, 0.16, 0.064):
            there = np.clip(theta + share * way, low, high)
            new, e_there = at(there)
            if loss(e_there, there) <= least:
                break
        else:
            if fresh:
                break
            x, fresh = slopes(e, theta), True
            continue
        moved = there - theta
        theta, model, e, least = there, new, e_there, loss(e_there, there)
        if float(moved @ full @ moved) < DONE**2:
            break
        x, fresh = slopes(e, theta), True
    at_bound = bool(np.any(((theta <= low + EDGE) | (theta >= high - EDGE)) & (np.abs(theta) >= EDGE)))
    return Refit(members, theta, model, e, x, at_bound)


def settled(found: Refit, passes: Passes, weight: FloatArray, by: NDArray[np.int64] | None = None) -> FloatArray:
    """Residual (g, c) with the free sizes (radii, delay) and the set's values at their best on the runs `by`."""
    x, _, size = _solved(found, passes, weight, np.arange(len(found.residual)) if by is None else by)
    return np.asarray(found.residual - x @ size)


def _solved(
    found: Refit, passes: Passes, weight: FloatArray, by: NDArray[np.int64]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """All columns (g, c, k), covariance (k, k) and sizes (k,) beside the set's values, by some of the runs."""
    k, free = found.theta.size, passes.nuisances.shape[-1]
    x = np.concatenate([passes.nuisances, found.x], axis=-1)
    prior = np.append(prior_of(free), np.full(k, PRIOR_WIDTH**-2.0))
    y = found.residual[by]
    own = np.where(np.isfinite(y)[:, :, None], x[by], 0.0)
    wx = weight[by] @ own
    covariance = inverse_of(np.einsum("rck,rcl->kl", own, wx) + np.diag(prior))
    pull = prior * np.append(np.zeros(free), -found.theta)
    return x, covariance, covariance @ (np.einsum("rck,rc->k", wx, np.nan_to_num(y)) + pull)


def estimates(found: Refit, passes: Passes, weight: FloatArray) -> list[Estimate]:
    """Value and 95 % interval of each parameter: cluster-robust variance with one run as the unit, blown up by its own
    leverage, at least that of the model; Student's t with the runs less the sizes that were fitted."""
    known = np.isfinite(found.residual)
    x, covariance, size = _solved(found, passes, weight, np.arange(len(known)))
    x = np.where(known[:, :, None], x, 0.0)
    e, wx = np.nan_to_num(found.residual) - x @ size, weight @ x
    hat = np.einsum("rck,kl,rdl->rcd", x, covariance, wx)
    grown = np.linalg.solve(np.eye(e.shape[1]) - np.clip(hat, -0.95, 0.95), e[:, :, None])
    scores = (wx.transpose(0, 2, 1) @ grown)[:, :, 0]
    robust = covariance @ (scores.T @ scores) @ covariance
    k = found.theta.size
    wide = student_quantile(0.975, max(int(known.any(axis=1).sum()) - k - 2, 1))
    sd = np.sqrt(np.maximum(np.diag(robust), np.diag(covariance)))[size.size - k :]
    out = []
    names = [(h, n) for h in found.members for n in h.free]
    for (h, name), s, change in zip(names, sd.tolist(), found.theta.tolist(), strict=True):
        p = h.parameter(name)
        value, half = value_in(found.model, h, name), p.sigma * wide * math.hypot(s, DOUBT * change)
        out.append(Estimate(value, max(value - half, p.low), min(value + half, p.high), p.unit))
    return out
