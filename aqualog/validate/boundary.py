"""Boundaries about a simulated curve in a cross plot (ISO 19364 [iso19364_2016]), and what lies beyond them.

The boundary's point is where an ellipse of the half-axes eps_x, eps_y about the curve's point touches a line along the
curve: top and bottom are the edges of what this ellipse sweeps along the curve. So a measured point lies within them
where one of the ellipses covers it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aqualog.core.records import FloatArray

__all__ = ["Boundary", "Tolerance", "beyond", "boundary"]

_FINE = 0.1  # of eps_x between two ellipses: their union then is 0.1 % of eps_y narrower than the strip


@dataclass(frozen=True, slots=True)
class Tolerance:
    """How far a measurement may be off: eps = offset + gain |value|, along x and along y, each in its own unit."""

    x_offset: float = 0.0
    x_gain: float = 0.0
    y_offset: float = 0.0
    y_gain: float = 0.0

    def along_x(self, x: FloatArray) -> FloatArray:
        """Half-axis along x. (n,)"""
        return np.asarray(self.x_offset + self.x_gain * np.abs(x))

    def along_y(self, y: FloatArray) -> FloatArray:
        """Half-axis along y. (n,)"""
        return np.asarray(self.y_offset + self.y_gain * np.abs(y))


@dataclass(frozen=True, slots=True)
class Boundary:
    """Upper and lower boundary of a curve, each (n,); NaN at points that are no point of a line."""

    top_x: FloatArray
    top_y: FloatArray
    bottom_x: FloatArray
    bottom_y: FloatArray


def boundary(x: FloatArray, y: FloatArray, tolerance: Tolerance) -> Boundary:
    """Boundaries about the simulated curve.

    Parameters
    ----------
    x, y : array (n,)
        Points of the curve in their order.
    tolerance : Tolerance

    Returns
    -------
    Boundary
        With dx, dy to the preceding point and D = sqrt((dx eps_y)² + (dy eps_x)²): top (x - dy eps_x²/D,
        y + dx eps_y²/D), bottom mirrored at the curve. The first point takes the way to the second, one that stays
        where its predecessor is the way before. [iso19364_2016]
    """
    dx, dy = np.diff(x, prepend=np.nan), np.diff(y, prepend=np.nan)
    known = np.isfinite(dx) & np.isfinite(dy) & ((dx != 0.0) | (dy != 0.0))
    if known.any():
        last = np.maximum.accumulate(np.where(known, np.arange(x.size), -1))
        at = np.where(last < 0, int(np.flatnonzero(known)[0]), last)
        dx, dy = dx[at], dy[at]
    ex, ey = tolerance.along_x(x), tolerance.along_y(y)
    d = np.hypot(dx * ey, dy * ex)
    with np.errstate(invalid="ignore", divide="ignore"):
        off_x, off_y = -dy * ex * ex / d, dx * ey * ey / d
    return Boundary(x + off_x, y + off_y, x - off_x, y - off_y)


def beyond(
    x: FloatArray, y: FloatArray, tolerance: Tolerance, measured_x: FloatArray, measured_y: FloatArray
) -> FloatArray:
    """How far measured points lie beyond the boundaries, along y. (k,) [unit of y]

    Parameters
    ----------
    x, y : array (n,)
        The simulated curve, x rising. A NaN in y parts it.
    tolerance : Tolerance
    measured_x, measured_y : array (k,)

    Returns
    -------
    array (k,)
        0 within the boundaries, positive above the top, negative below the bottom; NaN where the measurement is, or
        where the curve has no point within eps_x.
    """
    fine_x, fine_y = _fine(x, y, tolerance)
    out = np.full(measured_x.shape, np.nan)
    if not fine_x.size:
        return out
    ex, ey = tolerance.along_x(fine_x), tolerance.along_y(fine_y)
    reach = float(ex.max())
    first = np.searchsorted(fine_x, measured_x - reach, "left")
    last = np.searchsorted(fine_x, measured_x + reach, "right")
    for i in np.flatnonzero(np.isfinite(measured_y) & (last > first)).tolist():
        here = slice(int(first[i]), int(last[i]))
        share = _share(measured_x[i] - fine_x[here], ex[here])
        near = share >= 0.0
        if not near.any():
            continue
        off = measured_y[i] - fine_y[here][near]
        over = np.abs(off) - ey[here][near] * np.sqrt(share[near])
        least = int(np.argmin(over))
        out[i] = np.copysign(over[least], off[least]) if over[least] > 1e-12 else 0.0
    return out


def _share(apart: FloatArray, ex: FloatArray) -> FloatArray:
    """1 - (apart / eps_x)², the square of the share of eps_y that is left; without eps_x only the point itself."""
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.where(apart == 0.0, 0.0, np.abs(apart) / ex)
    return np.asarray(1.0 - ratio * ratio)


def _fine(x: FloatArray, y: FloatArray, tolerance: Tolerance) -> tuple[FloatArray, FloatArray]:
    """The curve with points between its own, so dense that the ellipses about them leave no gap."""
    good = np.isfinite(x) & np.isfinite(y)
    ex = tolerance.along_x(x)
    parts_x, parts_y = [], []
    for i in np.flatnonzero(good).tolist():
        parts_x.append(x[i : i + 1])
        parts_y.append(y[i : i + 1])
        if i + 1 < x.size and good[i + 1] and x[i + 1] > x[i]:
            step = _FINE * max(float(ex[i]), float(ex[i + 1]))
            n = int(min(np.ceil((x[i + 1] - x[i]) / step), 100)) if step > 0.0 else 1
            share = np.arange(1, n) / n
            parts_x.append(x[i] + share * (x[i + 1] - x[i]))
            parts_y.append(y[i] + share * (y[i + 1] - y[i]))
    return np.concatenate([*parts_x, np.empty(0)]), np.concatenate([*parts_y, np.empty(0)])
