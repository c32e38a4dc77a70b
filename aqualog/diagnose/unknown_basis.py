"""Penalised splines over a coordinate of a drive, or over two of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from aqualog.core.records import BoolArray, FloatArray

__all__ = ["PAIRS", "Basis", "bases"]

PAIRS = (("v_x", "water_depth"), ("v_x", "torque"), ("v_x", "a_x"))
COLUMNS = 14  # of a coordinate: humps down to about a tenth of its range
COLUMNS_ALONG = 26  # of a coordinate that runs with time: a road has more features than a car
COLUMNS_PAIR = 6  # per coordinate
FEW_VALUES = 8  # a coordinate with at most so many values gets one column for each
TRIM = 0.004  # share of the samples beyond either end, where a spline would hang on single samples
LEAST_FINITE = 0.8  # share of the samples that must bear a coordinate
POINTS, POINTS_PAIR = 60, 12  # of the reported function, per coordinate
SUPPORT_S = 2.0  # [s] of drive about a point of the function, least to speak of it
IDLE = 0.02  # of the large torques: below, the car is neither driven nor braked
ALONG = 0.98  # rank correlation with time from which a coordinate runs with it


class Basis(NamedTuple):
    """Columns (n, K) of functions of one or two coordinates, each with mean zero over the drive, and their roughness.

    `penalty` (K, K) is the integrated squared curvature; `points` (k, d) where the function is reported, `at_points`
    (k, K) the columns there, `supported` (k,) whether the drive was there long enough. `along`: it runs with time.
    """

    names: tuple[str, ...]
    columns: FloatArray
    penalty: FloatArray
    points: FloatArray
    at_points: FloatArray
    supported: BoolArray
    along: bool


class _Axis(NamedTuple):
    knots: FloatArray
    degree: int


def bases(coordinates: Mapping[str, FloatArray], mask: BoolArray, dt: float) -> list[Basis]:
    """Bases of all coordinates that vary over the drive, of their pairs, and of driving against braking.

    Parameters
    ----------
    coordinates : mapping of (n,)
        By name, SI; NaN where a coordinate is not known: the function is taken at its mean there.
    mask : (n,)
        Samples that count.
    dt : float
        [s]
    """
    with_sign = dict(coordinates)
    if "torque" in coordinates:
        sign = _drive_sign(coordinates["torque"], mask)
        if sign is not None:
            with_sign["drive_sign"] = sign
    singles = {}
    for name, z in with_sign.items():
        known = mask & np.isfinite(z)
        if np.count_nonzero(known) >= max(LEAST_FINITE * np.count_nonzero(mask), 2) and np.ptp(z[known]) > 0.0:
            found = _basis((name,), (z,), known, dt)
            if found is not None:
                singles[name] = found
    pairs = [
        _basis((a, b), (with_sign[a], with_sign[b]), mask & np.isfinite(with_sign[a] + with_sign[b]), dt)
        for a, b in PAIRS
        if a in singles and b in singles
    ]
    return [*singles.values(), *(p for p in pairs if p is not None)]


def _drive_sign(torque: FloatArray, mask: BoolArray) -> FloatArray | None:
    known = mask & np.isfinite(torque)
    if not known.any():
        return None
    large = float(np.quantile(np.abs(torque[known]), 0.95))
    sign: FloatArray = np.where(np.isfinite(torque), np.sign(torque) * (np.abs(torque) > IDLE * large), np.nan)
    least = 0.02 * np.count_nonzero(known)
    if min(np.count_nonzero(sign[known] > 0.0), np.count_nonzero(sign[known] < 0.0)) < least:
        return None
    return sign


def _basis(names: tuple[str, ...], z: tuple[FloatArray, ...], known: BoolArray, dt: float) -> Basis | None:
    along = len(names) == 1 and (names[0] == "t" or _runs_with_time(z[0][known]))
    long = along or names == ("position",)
    size = COLUMNS_ALONG if long else COLUMNS if len(z) == 1 else COLUMNS_PAIR
    axes = [_axis(x[known], size) for x in z]
    points = [_points(a, x[known], POINTS if len(z) == 1 else POINTS_PAIR) for a, x in zip(axes, z, strict=True)]
    if any(p.size < 2 for p in points):
        return None
    at = [_columns(a, x[known]) for a, x in zip(axes, z, strict=True)]
    at_points = [_columns(a, p) for a, p in zip(axes, points, strict=True)]
    penalties = [_penalty(a) for a in axes]
    if len(z) == 1:
        columns, on_grid, penalty, grid = at[0], at_points[0], penalties[0], points[0][:, None]
    else:
        columns = np.einsum("ni,nj->nij", at[0], at[1]).reshape(at[0].shape[0], -1)
        on_grid = np.asarray(np.kron(at_points[0], at_points[1]), dtype=np.float64)
        eyes = [np.eye(len(p)) for p in penalties]
        penalty = np.asarray(np.kron(penalties[0], eyes[1]) + np.kron(eyes[0], penalties[1]), dtype=np.float64)
        grid = np.stack([g.ravel() for g in np.meshgrid(*points, indexing="ij")], axis=1)
    visited = columns.sum(axis=0) > 1e-9 * columns.shape[0]
    columns, on_grid, penalty = columns[:, visited], on_grid[:, visited], penalty[np.ix_(visited, visited)]
    if columns.shape[1] < 2:
        return None
    free = _mean_free(columns.mean(axis=0))
    placed = np.zeros((known.size, free.shape[1]))
    placed[known] = columns @ free
    near = _seconds_near(grid, points, [x[known] for x in z]) * dt
    return Basis(names, placed, free.T @ penalty @ free, grid, on_grid @ free, near >= SUPPORT_S, along)


def _axis(x: FloatArray, size: int) -> _Axis:
    """Cubic splines with knots half by the visits and half evenly, or a hat at each of a few values."""
    values = np.unique(x)
    if values.size <= FEW_VALUES:
        return _Axis(np.concatenate([values[:1], values, values[-1:]]), 1)
    low, high = (float(q) for q in np.quantile(x, [TRIM, 1.0 - TRIM]))
    if not high > low:
        low, high = float(values[0]), float(values[-1])
    even: FloatArray = np.linspace(low, high, 257)
    share: FloatArray = 0.5 * np.searchsorted(np.sort(x), even) / x.size + 0.5 * (even - low) / (high - low)
    share = (share - share[0]) / (share[-1] - share[0])
    inner = np.interp(np.linspace(0.0, 1.0, size - 2), share, even)
    return _Axis(np.concatenate([[low] * 3, inner, [high] * 3]), 3)


def _columns(axis: _Axis, x: FloatArray) -> FloatArray:
    """B-splines (n, K) at points; beyond the knots as at the last one."""
    return _splines(axis.knots, axis.degree, np.clip(x, axis.knots[0], axis.knots[-1]))


def _splines(knots: FloatArray, degree: int, x: FloatArray) -> FloatArray:
    """All B-splines of a degree by the recursion of Cox and de Boor (K); an empty span counts as zero."""
    last = np.flatnonzero(knots < knots[-1])[-1]  # the last span holds its right end
    span = np.minimum(np.searchsorted(knots, x, side="right") - 1, last)
    out = np.zeros((x.size, knots.size - 1))
    out[np.arange(x.size), span] = 1.0
    for k in range(1, degree + 1):
        width = knots[k:] - knots[:-k]
        share = np.where(width > 0.0, (x[:, None] - knots[:-k]) / np.where(width > 0.0, width, 1.0), 0.0)
        falls = np.where(width[1:] > 0.0, 1.0 - share[:, 1:], 0.0)
        out = share[:, :-1] * out[:, :-1] + falls * out[:, 1:]
    return out


def _penalty(axis: _Axis) -> FloatArray:
    """Integrated squared curvature over the range scaled to one; of hats the squared changes of slope."""
    knots, degree = axis
    k = knots.size - degree - 1
    scaled = (knots - knots[0]) / (knots[-1] - knots[0])
    if degree == 1:
        if k < 3:
            return np.zeros((k, k))
        slopes = np.diff(np.eye(k), axis=0) / np.diff(scaled[1:-1])[:, None]
        bends: FloatArray = np.diff(slopes, axis=0)
        return bends.T @ bends
    coefficients: FloatArray = np.eye(k)
    for d in (degree, degree - 1):  # a derivative of a spline: differences of its coefficients on the inner knots
        width = scaled[1 + d : -1] - scaled[1 : -1 - d]
        coefficients = d * np.diff(coefficients, axis=0) / width[:, None]
        scaled = scaled[1:-1]
    grid: FloatArray = np.linspace(0.0, 1.0, 401)
    second = _splines(scaled, degree - 2, grid) @ coefficients
    return np.asarray(second.T @ second / grid.size, dtype=np.float64)


def _points(axis: _Axis, x: FloatArray, count: int) -> FloatArray:
    if axis.degree == 1:
        return np.unique(x)
    return np.linspace(axis.knots[0], axis.knots[-1], count)


def _mean_free(mean: FloatArray) -> FloatArray:
    """Orthonormal directions (K, K - 1) of coefficients whose function has mean zero."""
    q, _ = np.linalg.qr(np.column_stack([mean, np.eye(mean.size)[:, 1:]]))
    return np.asarray(q[:, 1:], dtype=np.float64)


def _seconds_near(grid: FloatArray, points: list[FloatArray], z: list[FloatArray]) -> FloatArray:
    """Samples within one and a half grid steps of each point."""
    near: npt.NDArray[np.bool_] = np.ones((grid.shape[0], z[0].size), dtype=bool)
    for d, x in enumerate(z):
        reach = 1.5 * np.diff(points[d]).min()
        near &= np.abs(grid[:, d : d + 1] - x) <= reach
    return np.asarray(near.sum(axis=1), dtype=np.float64)


def _runs_with_time(x: FloatArray) -> bool:
    if np.unique(x).size <= FEW_VALUES:
        return False
    _, rank = np.unique(x, return_inverse=True)
    return abs(float(np.corrcoef(np.arange(x.size), rank)[0, 1])) > ALONG
