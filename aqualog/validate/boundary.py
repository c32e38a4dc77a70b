"""Boundaries about a simulated curve in a cross plot (ISO 19364 [iso19364_2016]), and what lies beyond them.

The boundary's point is where an ellipse of the half-axes eps_x, eps_y about the curve's point touches a line along the
curve: top and bottom are the edges of what this ellipse sweeps along the curve. So a measured point lies within them
where one of the ellipses covers it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aqualog.core.compiled import compiled
from aqualog.core.records import FloatArray

__all__ = ["Boundary", "Tolerance", "beyond", "boundary"]

_MOST_PARTS = 100  # points between two of the curve
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
    if not fine_x.size:
        return np.full(measured_x.shape, np.nan)
    ex, ey = tolerance.along_x(fine_x), tolerance.along_y(fine_y)
    reach = float(ex.max())
    first = np.searchsorted(fine_x, measured_x - reach, "left")
    last = np.searchsorted(fine_x, measured_x + reach, "right")
    out: FloatArray = _nearest(fine_x, fine_y, ex, ey, measured_x, measured_y, first, last)
    return out


@compiled
def _nearest(x, y, ex, ey, measured_x, measured_y, first, last):  # type: ignore[no-untyped-def]
    """Of each measured point the least distance beyond any of the ellipses from `first` to before `last`, along y."""
    out = np.full(measured_x.size, np.nan)
    for i in range(measured_x.size):
        if np.isnan(measured_y[i]):
            continue
        least, sign = np.inf, 1.0
        for j in range(first[i], last[i]):
            apart = abs(measured_x[i] - x[j])
            if apart > ex[j]:
                continue
            ratio = apart / ex[j] if ex[j] > 0.0 else 0.0
            off = measured_y[i] - y[j]
            over = abs(off) - ey[j] * np.sqrt(max(1.0 - ratio * ratio, 0.0))
            if over < least:
                least, sign = over, 1.0 if off >= 0.0 else -1.0
        if least < np.inf:
            out[i] = sign * least if least > 1e-12 else 0.0
    return out


def _fine(x: FloatArray, y: FloatArray, tolerance: Tolerance) -> tuple[FloatArray, FloatArray]:
    """The curve with points between its own, so dense that the ellipses about them leave no gap."""
    good = np.isfinite(x) & np.isfinite(y)
    ex = tolerance.along_x(x)
    step = _FINE * np.maximum(ex[:-1], ex[1:])
    joined = good[:-1] & good[1:] & (np.diff(x) > 0.0) & (step > 0.0)
    parts = np.ones(x.size, dtype=np.int64)  # points from each one on to the next
    parts[:-1][joined] = np.clip(np.ceil(np.diff(x)[joined] / step[joined]), 1, _MOST_PARTS).astype(np.int64)
    at = np.repeat(np.arange(x.size), np.where(good, parts, 0))
    share = (np.arange(at.size) - np.searchsorted(at, at)) / parts[at]
    following = np.minimum(at + 1, x.size - 1)
    between = share > 0.0  # a value beside a gap must not enter
    moved = [np.where(between, v[at] + share * (v[following] - v[at]), v[at]) for v in (x, y)]
    return moved[0], moved[1]
