"""Concave curves through points, as the lateral acceleration over speed is one."""

from __future__ import annotations

import math

import numpy as np

from aqualog.core.records import FloatArray

__all__ = ["area_under", "concave_fit", "falls_to", "nonnegative"]


def concave_fit(x: FloatArray, y: FloatArray, knots: FloatArray) -> FloatArray:
    """Fit the concave, piecewise linear curve of least squares.

    Parameters
    ----------
    x, y : array (n,)
        Points, in any order.
    knots : array (m,)
        Where the curve may bend, rising; all x lie between the first and the last.

    Returns
    -------
    values : array (m,)
        The curve at the knots.

    Notes
    -----
    f = a + b x - sum c_j max(x - k_j, 0) with c_j >= 0 over the inner knots; non-negative least squares [lawson1974].
    Points on a concave curve are kept: the fit goes through them.
    """
    if knots.size == 1:
        return np.full(1, float(np.mean(y)))
    scale = float(knots[-1] - knots[0])
    u, k = (x - knots[0]) / scale, (knots - knots[0]) / scale

    def basis(at: FloatArray) -> FloatArray:
        line = [np.ones_like(at), -np.ones_like(at), at, -at]
        return np.stack([*line, *(-np.maximum(at - j, 0.0) for j in k[1:-1])], axis=1)

    return np.asarray(basis(k) @ nonnegative(basis(u), y))


def nonnegative(A: FloatArray, b: FloatArray) -> FloatArray:
    """Return x >= 0 of least |A x - b|: the active-set method of Lawson and Hanson [lawson1974]."""
    n = A.shape[1]
    x, passive = np.zeros(n), np.zeros(n, dtype=np.bool_)
    tolerance = 1e-10 * float(np.abs(A).max()) * max(float(np.abs(b).max()), 1e-300) * A.shape[0]
    for _ in range(10 * n):
        gradient = A.T @ (b - A @ x)
        gradient[passive] = -math.inf
        if passive.all() or gradient.max() <= tolerance:
            break
        passive[int(np.argmax(gradient))] = True
        while True:
            step = np.zeros(n)
            step[passive] = np.linalg.lstsq(A[:, passive], b, rcond=None)[0]
            wrong = passive & (step <= 0.0)
            if not wrong.any():
                x = step
                break
            share = float(np.min(x[wrong] / np.maximum(x[wrong] - step[wrong], 1e-300)))
            x = x + share * (step - x)
            passive &= x > 1e-14
            x[~passive] = 0.0
            if not passive.any():
                break
    return x


def falls_to(x: FloatArray, y: FloatArray, level: FloatArray | float) -> float:
    """Return where a curve falls to a level for the last time, linear between points; NaN where it does not.

    `level` may be one for each point.
    """
    above = y - np.broadcast_to(np.asarray(level, dtype=np.float64), y.shape)
    at = np.flatnonzero((above[:-1] > 0.0) & (above[1:] <= 0.0))
    if not at.size:
        return math.nan
    k = int(at[-1])
    return float(x[k] + (x[k + 1] - x[k]) * above[k] / (above[k] - above[k + 1]))


def area_under(x: FloatArray, y: FloatArray, low: float, high: float) -> float:
    """Return the area under a piecewise linear curve between two places, in the units of both axes."""
    inner = x[(x > low) & (x < high)]
    at = np.concatenate([[low], inner, [high]])
    values = np.interp(at, x, y)
    return float(np.sum(0.5 * (values[1:] + values[:-1]) * np.diff(at)))
