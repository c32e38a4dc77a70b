"""Put one channel on the common grid: linear or hold, never across a gap, never beyond the ends."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aqualog.core.records import BoolArray, FloatArray, TimeArray

__all__ = ["MEDIAN_OF", "Placed", "bin_mean", "gap_limit_ns", "hold", "linear", "median_period_ns", "placed"]


MEDIAN_OF = 1 << 18  # steps, the first ones: a log that is read in pieces has the same median


def median_period_ns(t_ns: TimeArray) -> int:
    """Return the median sample time of the first 2^18 steps. [ns] 0 for fewer than two samples."""
    return int(np.median(np.diff(t_ns[: MEDIAN_OF + 1]))) if t_ns.size > 1 else 0


def gap_limit_ns(period_ns: int, *, is_state: bool) -> int:
    """Return the longest interval across which a value may be carried, by the median sample time. [ns]

    Five sample times for a continuous signal (at least 50 ms), ten for a state (at least 2 s): a lost frame or two is
    bridged, an outage is not.
    """
    return max(10 * period_ns, 2_000_000_000) if is_state else max(5 * period_ns, 50_000_000)


class Placed(NamedTuple):
    """Positions of the points (m,) of a grid among stamps (n,).

    `right` (m,): the first stamp that is not before the point, n behind the last; `exact` (m,): it is at the point;
    `between`: indices (k,) of the points with a stamp on either side, `span` (k,) the interval there [ns], and `share`
    (k,) how much of it lies before the point.
    """

    right: TimeArray
    exact: BoolArray
    between: TimeArray
    span: TimeArray
    share: FloatArray


def placed(t_ns: TimeArray, grid_ns: TimeArray, dt_ns: int | None = None) -> Placed:
    """Find the points of a grid among strictly increasing stamps, at least one; signals with the same stamps share it.

    With the step [ns] of even points, stamps are counted by the step that they fall into; else each point is searched
    for.
    """
    n, m = t_ns.size, grid_ns.size
    if dt_ns is not None and m:
        step = np.clip((t_ns - grid_ns[0]) // dt_ns + 1, 0, m)
        right = np.cumsum(np.bincount(step, minlength=m + 1)[:m])
    else:
        right = np.searchsorted(t_ns, grid_ns, side="left")
    exact = (right < n) & (t_ns[np.minimum(right, n - 1)] == grid_ns)
    between = np.flatnonzero(~exact & (right > 0) & (right < n))
    i = right[between]
    before = t_ns[i - 1]
    span = t_ns[i] - before
    # integers are subtracted before they become floats: epoch nanoseconds do not fit a double
    share = (grid_ns[between] - before).astype(np.float64) / span.astype(np.float64)
    return Placed(right, exact, between, span, share)


def linear(
    t_ns: TimeArray,
    x: FloatArray,
    grid_ns: TimeArray,
    *,
    gap_ns: int,
    period_ns: int | None = None,
    at: Placed | None = None,
) -> tuple[FloatArray, BoolArray]:
    """Interpolate linearly.

    Parameters
    ----------
    t_ns : int64 array (n,)
        Strictly increasing stamps.
    x : array (n,)
        Finite samples.
    grid_ns : int64 array (m,)
        Points at which values are wanted.
    gap_ns : int
        Longest interval that may be bridged.
    period_ns : int, optional
        Median sample time; default that of the stamps.
    at : Placed, optional
        Positions of these points among these stamps, if known.

    Returns
    -------
    y : array (m,)
        NaN outside the first and last stamp and inside longer intervals.
    bridged : bool array (m,)
        Grid points inside an interval of more than 1.5 median sample times: a sample was missing there.
    """
    y = np.full(grid_ns.size, np.nan)
    bridged = np.zeros(grid_ns.size, dtype=bool)
    if t_ns.size == 0:
        return y, bridged
    right, exact, between, span, share = at or placed(t_ns, grid_ns)
    y[exact] = x[right[exact]]
    i = right[between]
    values = x[i - 1] + share * (x[i] - x[i - 1])
    y[between] = np.where(span <= gap_ns, values, np.nan)
    bridged[between] = span > 1.5 * (median_period_ns(t_ns) if period_ns is None else period_ns)
    return y, bridged


def hold(t_ns: TimeArray, x: FloatArray, grid_ns: TimeArray, *, gap_ns: int, at: Placed | None = None) -> FloatArray:
    """Hold the last value for at most `gap_ns`, also beyond the last stamp. Shapes as `linear`."""
    y = np.full(grid_ns.size, np.nan)
    if t_ns.size == 0:
        return y
    right, exact, *_ = at or placed(t_ns, grid_ns)
    last = right - ~exact
    known = last >= 0
    age = grid_ns[known] - t_ns[last[known]]
    y[known] = np.where(age <= gap_ns, x[last[known]], np.nan)
    return y


def bin_mean(
    t_ns: TimeArray,
    x: FloatArray,
    grid_ns: TimeArray,
    *,
    dt_ns: int,
    gap_ns: int,
    period_ns: int | None = None,
    at: Placed | None = None,
) -> tuple[FloatArray, BoolArray]:
    """Average the samples within half a grid step on either side, for signals much faster than the grid.

    Plain interpolation would alias their noise into the grid. Where a bin is empty, linear interpolation takes over.
    Returns as `linear`.
    """
    y, bridged = linear(t_ns, x, grid_ns, gap_ns=gap_ns, period_ns=period_ns, at=at)
    if t_ns.size == 0:
        return y, bridged
    low = np.searchsorted(t_ns, grid_ns - dt_ns // 2, side="left")
    high = np.searchsorted(t_ns, grid_ns + dt_ns - dt_ns // 2, side="left")
    count = high - low
    full = count >= 2
    # sums of each bin by itself: differences of one long running sum would lose digits over hours
    edges = np.column_stack([low[full], np.minimum(high[full], x.size - 1)]).ravel()
    sums = np.add.reduceat(x, edges)[::2] if edges.size else np.zeros(0)
    tail = high[full] == x.size  # reduceat needs an end index; the last sample is added where the bin holds it
    sums = sums + np.where(tail, x[-1], 0.0)
    y[full & ~np.isnan(y)] = (sums / count[full])[~np.isnan(y[full])]
    return y, bridged
