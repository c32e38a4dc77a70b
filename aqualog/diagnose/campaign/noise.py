"""Scatter of a campaign's runs, estimated from them: covariance of their channels plus the road's fluctuation.

One run is one vector of channels, independent of the others. Its deviation from the model has the covariance
Sigma + kappa D_r, with D_r the variance of the run's means that contact and depth give along its lane, and heavier
tails than a normal's (Student's t of `NU` degrees of freedom), so that a run with a wrong entry counts little.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from aqualog.core.records import BoolArray, FloatArray

__all__ = ["Design", "Fit", "Scatter", "design_of", "fit", "inner", "inverse_of", "prior_of", "weighted", "whole_fit"]

NU = 8.0  # tails as heavy as this cost 4 % of efficiency on normal runs
ROUNDS = 25
AGAIN = 4  # from a good start
DOUBTS = 3  # columns of `passes.doubted`
_MISSING = 1e9


class Scatter(NamedTuple):
    """`sigma` (c, c) of the channels in their units; `kappa` (c,) on the road's part."""

    sigma: FloatArray
    kappa: FloatArray


class Design(NamedTuple):
    """A linear model of the runs: `y` (g, c) with NaN where not available, `x` (g, c, k), `road` (g, c) variances, and
    `prior` (k,) precision of each column's size, 0 for free ones.
    """

    y: FloatArray
    x: FloatArray
    road: FloatArray
    prior: FloatArray


@dataclass(frozen=True, slots=True)
class Fit:
    """Sizes (k,) of the columns with their covariance, scatter, weights (g, c, c) = precision of each run."""

    size: FloatArray
    covariance: FloatArray
    scatter: Scatter
    weight: FloatArray
    tail: FloatArray  # (g,) how much a run counts, about 1


def prior_of(free: int, tested: int) -> FloatArray:
    """Precision (k,) of the sizes: of `free` columns the first `DOUBTS` and all `tested` ones have a unit prior."""
    prior: FloatArray = np.concatenate([np.zeros(free), np.ones(tested)])
    prior[: min(DOUBTS, free)] = 1.0
    return prior


def design_of(y: FloatArray, x: FloatArray, road: FloatArray, prior: FloatArray) -> Design:
    """Missing entries set to 0 without weight."""
    return Design(y, np.where(np.isfinite(y)[:, :, None], np.nan_to_num(x), 0.0), np.nan_to_num(road), prior)


def fit(d: Design, *, start: Scatter | None = None, rounds: int = ROUNDS) -> Fit:
    """Sizes and scatter by restricted likelihood (EM).

    Parameters
    ----------
    d : Design
    start : Scatter, optional
        From where to go on; a good one needs few rounds.
    rounds : int

    The uncertainty of the sizes goes into the scatter, so that many columns do not make it small.
    """
    known = np.isfinite(d.y)
    y = np.where(known, d.y, 0.0)
    scatter = start or _first(d, known)
    scale = np.sqrt(np.diag(scatter.sigma))
    tail = None
    for _ in range(rounds):
        found = weighted(d, scatter, tail)
        tail = _tails(d, found, known)
        e = y - d.x @ found.size
        sw = scatter.sigma @ (found.weight / found.tail[:, None, None])
        m = np.einsum("rce,re->rc", sw, e)
        left = scatter.sigma - sw @ scatter.sigma
        swx = sw @ d.x
        unsure = (swx @ found.covariance) @ swx.transpose(0, 2, 1)
        total = found.tail[:, None, None] * (m[:, :, None] * m[:, None, :] + unsure) + left
        sigma = total.mean(axis=0)
        kappa = _kappa(d, known, scatter, found, e)
        sigma += np.diag((1e-3 * scale) ** 2)
        scatter = Scatter(0.5 * (sigma + sigma.T), kappa)
    return weighted(d, scatter)


def _tails(d: Design, found: Fit, known: BoolArray) -> FloatArray:
    """Weight of each run by its distance from the model."""
    e = np.where(known, d.y, 0.0) - d.x @ found.size
    far = np.einsum("rc,rc->r", e, (found.weight @ e[:, :, None])[:, :, 0]) / found.tail
    counted: FloatArray = (NU + known.sum(axis=1)) / (NU + far)
    return counted


def _first(d: Design, known: BoolArray) -> Scatter:
    """Scatter of plain least squares, channel by channel."""
    c = d.y.shape[1]
    spread = np.array([np.nanstd(d.y[:, i]) if known[:, i].any() else 1.0 for i in range(c)])
    spread = np.where(spread > 0.0, spread, 1.0)
    x = (d.x / spread[None, :, None])[known]
    y = (np.where(known, d.y, 0.0) / spread)[known]
    unit = np.sqrt(np.maximum((x**2).sum(axis=0), 1e-300))
    size = np.linalg.lstsq(
        np.vstack([x / unit, 1e-3 * np.eye(unit.size)]), np.append(y, np.zeros(unit.size)), rcond=None
    )[0]
    e = np.where(known, d.y - np.einsum("rck,k->rc", d.x, size / unit), 0.0)
    variance = np.maximum((e**2).sum(axis=0) / np.maximum(known.sum(axis=0), 1), (1e-3 * spread) ** 2)
    return Scatter(np.diag(variance), np.full(c, 0.5))


def _kappa(d: Design, known: BoolArray, scatter: Scatter, found: Fit, e: FloatArray) -> FloatArray:
    """Factor on the road's part: one for the slips, one for the resistance (the last channel)."""
    w = found.weight / found.tail[:, None, None]
    road = scatter.kappa[None] * d.road
    m = road * np.einsum("rce,re->rc", w, e)
    left = road - road**2 * np.einsum("rcc->rc", w)
    use = known & (d.road > 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.where(use, (found.tail[:, None] * m**2 + left) / d.road, 0.0)
    kappa = scatter.kappa.copy()
    for part in (slice(0, -1), slice(-1, None)):
        if use[:, part].any():
            kappa[part] = ratio[:, part].sum() / use[:, part].sum()
    return kappa


def weighted(d: Design, scatter: Scatter, tail: FloatArray | None = None) -> Fit:
    """Sizes at a given scatter; the runs' weights from their own deviation, unless given."""
    known = np.isfinite(d.y)
    y = np.where(known, d.y, 0.0)
    g, c = y.shape
    v = np.repeat(scatter.sigma[None], g, axis=0)
    v = np.where(known[:, :, None] & known[:, None, :], v, 0.0)
    index = np.arange(c)
    v[:, index, index] += np.where(known, scatter.kappa[None] * d.road, _MISSING)
    plain = np.linalg.inv(v)
    plain = np.where(known[:, :, None] & known[:, None, :], plain, 0.0)
    counted = np.ones(g) if tail is None else tail
    for _ in range(2 if tail is None else 1):
        weight = counted[:, None, None] * plain
        wx = (weight @ d.x).reshape(g * c, -1)
        a = d.x.reshape(g * c, -1).T @ wx + np.diag(d.prior)
        covariance = inverse_of(a)
        size = covariance @ (y.ravel() @ wx)
        if tail is None:
            e = y - d.x @ size
            far = np.einsum("rc,rc->r", e, (plain @ e[:, :, None])[:, :, 0])
            counted = (NU + known.sum(axis=1)) / (NU + far)
    return Fit(size, covariance, scatter, counted[:, None, None] * plain, counted)


def whole_fit(y: FloatArray, x: FloatArray, road: FloatArray, free: FloatArray, start: Scatter | None = None) -> Fit:
    """Scatter of the runs `y` (g, c) with all columns `x` (g, c, k) at their most likely size under a unit prior."""
    d = design_of(y, np.concatenate([free, x], axis=-1), road, prior_of(free.shape[-1], x.shape[-1]))
    return fit(d, start=start, rounds=AGAIN if start else ROUNDS)


def inner(x: FloatArray, y: FloatArray, free: FloatArray, weight: FloatArray) -> FloatArray:
    """Inner products (k + 1, k + 1) of columns `x` (g, c, k) and, last, of `y` (g, c), the `free` columns taken out.

    `weight` (g, c, c): precision of each run.
    """
    rows = np.concatenate([free, x, y[:, :, None]], axis=-1)
    rows = np.where(np.isfinite(y)[:, :, None], rows, 0.0).reshape(y.size, -1)
    G = rows.T @ (weight @ rows.reshape(*y.shape, -1)).reshape(y.size, -1)
    n = free.shape[-1]
    return np.asarray(G[n:, n:] - G[n:, :n] @ inverse_of(G[:n, :n] + np.diag(prior_of(n, 0))) @ G[:n, n:])


def inverse_of(a: FloatArray) -> FloatArray:
    """Inverse of a positive matrix whose columns may have any unit; of columns without any data: 0."""
    size = np.diag(a)
    unit = np.sqrt(np.where(size > 0.0, size, 1.0))
    scaled = a / unit[:, None] / unit[None]
    found: FloatArray = np.linalg.pinv(scaled, rcond=1e-10, hermitian=True) / unit[:, None] / unit[None]
    return found
