"""Scatter of the runs: a run is one vector of channels, independent of the others. Its deviation from the model has the
covariance Sigma + kappa D_r, with D_r the variance of the run's means that contact and depth give along its lane. Its
tails are heavier than a normal's (Student's t of `NU` degrees of freedom), so that a run with a wrong entry counts
little."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aqualog.core.records import BoolArray, FloatArray

__all__ = ["Fit", "fit", "inner", "inverse_of", "prior_of"]

NU = 8.0  # tails as heavy as this cost 4 % of efficiency on normal runs
ROUNDS = 25
AGAIN = 4  # from a good start
DOUBTS = 21  # columns of `passes.doubted`
_MISSING = 1e9


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
    for left in range(AGAIN if start else ROUNDS, -1, -1):
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
