"""Smooth functions of one or two coordinates of a drive: splines whose coefficients have a Gaussian-process prior."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from aqualog.core.records import BoolArray, FloatArray

__all__ = ["Basis", "basis"]

COLUMNS = 12  # of a coordinate: humps down to about a tenth of its range
COLUMNS_TIME = 24  # of time: a step of 75 s in 300 s
COLUMNS_PAIR = 6  # per coordinate
LENGTH, LENGTH_TIME = 0.15, 0.08  # of the range over which a function may change
FEW_VALUES = 8  # a coordinate with at most so many values gets one column for each
TRIM = 0.004  # share of the samples beyond either end, where a spline would hang on single samples
LEAST_FINITE = 0.8  # share of the samples that must bear a coordinate
POINTS, POINTS_PAIR = 60, 12  # of the reported function, per coordinate
SUPPORT_S = 2.0  # [s] of drive about a point of the function, least to speak of it
NUGGET = 1e-3


class Basis(NamedTuple):
    """Columns (n, K) of functions of one or two coordinates; `prior` (K, K) covariance of their coefficients; `points`
    (k, d) where the function is reported, `at_points` (k, K) the columns there, `supported` (k,) whether the drive was
    there long enough."""

    names: tuple[str, ...]
    columns: FloatArray
    prior: FloatArray
    points: FloatArray
    at_points: FloatArray
    supported: BoolArray


class _Axis(NamedTuple):
    knots: FloatArray
    degree: int
    length: float

    @property
    def centres(self) -> FloatArray:
        """Where the coefficients sit (Greville), scaled to the range."""
        k, p = self.knots, self.degree
        at = np.array([k[i + 1 : i + p + 1].mean() for i in range(k.size - p - 1)])
        return np.asarray((at - k[0]) / (k[-1] - k[0]))

    @property
    def prior(self) -> FloatArray:
        x = self.centres
        return np.asarray(np.exp(-0.5 * ((x[:, None] - x) / self.length) ** 2) + NUGGET * np.eye(x.size))


def basis(names: tuple[str, ...], z: Sequence[FloatArray], mask: BoolArray, dt: float) -> Basis | None:
    """Functions of one or two coordinates (n,) [SI], zero where unknown (NaN); None where the drive does not vary them.
    `mask` (n,): samples that count, at the step `dt` [s]."""
    known = mask & np.isfinite(np.sum(z, axis=0))
    if np.count_nonzero(known) < max(LEAST_FINITE * np.count_nonzero(mask), 2):
        return None
    if any(np.ptp(x[known]) <= 0.0 for x in z):
        return None
    along = names[0] in ("t", "position")
    size = COLUMNS_TIME if along else COLUMNS if len(z) == 1 else COLUMNS_PAIR
    length = LENGTH_TIME if along else LENGTH if len(z) == 1 else 0.25
    axes = [_axis(x[known], size, length) for x in z]
    count = POINTS if len(z) == 1 else POINTS_PAIR
    points = [
        np.unique(x[known]) if a.degree == 1 else np.linspace(a.knots[0], a.knots[-1], count)
        for a, x in zip(axes, z, strict=True)
    ]
    if any(p.size < 2 for p in points):
        return None
    at = [_splines(a, x[known]) for a, x in zip(axes, z, strict=True)]
    at_points = [_splines(a, p) for a, p in zip(axes, points, strict=True)]
    if len(z) == 1:
        columns, on_grid, prior, grid = at[0], at_points[0], axes[0].prior, points[0][:, None]
    else:
        columns = np.einsum("ni,nj->nij", at[0], at[1]).reshape(at[0].shape[0], -1)
        on_grid = np.asarray(np.kron(at_points[0], at_points[1]), dtype=np.float64)
        prior = np.asarray(np.kron(axes[0].prior, axes[1].prior), dtype=np.float64)
        grid = np.stack([g.ravel() for g in np.meshgrid(*points, indexing="ij")], axis=1)
    visited = columns.sum(axis=0) > 1e-9 * columns.shape[0]
    if visited.sum() < 2:
        return None
    placed = np.zeros((known.size, int(visited.sum())))
    placed[known] = columns[:, visited]
    # samples within one and a half grid steps of each point
    reach = [1.5 * np.diff(p).min() for p in points]
    near = np.all([np.abs(grid[:, d : d + 1] - x[known]) <= reach[d] for d, x in enumerate(z)], axis=0)
    supported = near.sum(axis=1) * dt >= SUPPORT_S
    return Basis(names, placed, prior[np.ix_(visited, visited)], grid, on_grid[:, visited], supported)


def _axis(x: FloatArray, size: int, length: float) -> _Axis:
    """Cubic splines with knots half by the visits and half evenly, or a hat at each of a few values."""
    values = np.unique(x)
    if values.size <= FEW_VALUES:
        return _Axis(np.concatenate([values[:1], values, values[-1:]]), 1, length)
    low, high = (float(q) for q in np.quantile(x, [TRIM, 1.0 - TRIM]))
    if not high > low:
        low, high = float(values[0]), float(values[-1])
    even: FloatArray = np.linspace(low, high, 257)
    share: FloatArray = 0.5 * np.searchsorted(np.sort(x), even) / x.size + 0.5 * (even - low) / (high - low)
    share = (share - share[0]) / (share[-1] - share[0])
    inner = np.interp(np.linspace(0.0, 1.0, size - 2), share, even)
    return _Axis(np.concatenate([[low] * 3, inner, [high] * 3]), 3, length)


def _splines(axis: _Axis, x: FloatArray) -> FloatArray:
    """B-splines (n, K) at points by the recursion of Cox and de Boor (K); an empty span counts as zero, and beyond the
    knots they are as at the last one."""
    knots = axis.knots
    x = np.clip(x, knots[0], knots[-1])
    last = np.flatnonzero(knots < knots[-1])[-1]  # the last span holds its right end
    span = np.minimum(np.searchsorted(knots, x, side="right") - 1, last)
    out = np.zeros((x.size, knots.size - 1))
    out[np.arange(x.size), span] = 1.0
    for k in range(1, axis.degree + 1):
        width = knots[k:] - knots[:-k]
        share = np.where(width > 0.0, (x[:, None] - knots[:-k]) / np.where(width > 0.0, width, 1.0), 0.0)
        falls = np.where(width[1:] > 0.0, 1.0 - share[:, 1:], 0.0)
        out = share[:, :-1] * out[:, :-1] + falls * out[:, 1:]
    return out
