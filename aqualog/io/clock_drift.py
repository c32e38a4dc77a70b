"""Compare two clocks of one log that run at different rates: stamps and recording times, or two times of a table.

A stamp is late by the delay of bus, buffer or rounding, which only ever adds. So the least difference of each ten
seconds counts, and a straight line through these is the drift. A clock that was set makes a step, which no line fits;
it is not reported as a drift.
"""

from __future__ import annotations

import numpy as np

from aqualog.core.records import BoolArray, Drift, FloatArray, TimeArray

__all__ = ["DriftWatch", "drift_note"]

_BIN_NS = 10_000_000_000
_LEAST_BINS, _POINTS = 6, 60
_LEAST_SHIFT_S = 0.01  # a sample time of 100 Hz
_TIMES_SCATTER = 8.0  # a step in the middle of a log is 6 times what a line leaves of it
_MOST = 0.1  # beyond a tenth one of the two is no clock


class DriftWatch:
    """Goes through the stamps of one source on two clocks, in any pieces."""

    def __init__(self) -> None:
        self._bins: dict[int, int] = {}  # the least difference of each
        self._origin: tuple[int, int] | None = None

    def push(self, t_ns: TimeArray, other_ns: TimeArray, good: BoolArray) -> None:
        """Stamps (n,) by the clock that counts and by the other; only those where `good`. [ns]"""
        t, lag = t_ns[good], other_ns[good]
        if not t.size:
            return
        if self._origin is None:
            self._origin = int(t[0]), int(lag[0])
        t = t - self._origin[0]
        lag = lag - self._origin[1] - t
        bins = t // _BIN_NS
        runs = np.flatnonzero(np.append(True, np.diff(bins) != 0))  # stamps mostly rise, so a bin is one run
        for k, least in zip(bins[runs].tolist(), np.minimum.reduceat(lag, runs).tolist(), strict=True):
            self._bins[k] = min(least, self._bins.get(k, least))

    def finish(self, clock: str, against: str) -> Drift | None:
        """Return the drift of the other clock, called `against`, over the one that counts; None without a drift."""
        if len(self._bins) < _LEAST_BINS:
            return None
        points = np.array([(k * _BIN_NS, self._bins[k]) for k in sorted(self._bins)], dtype=np.float64) * 1e-9
        t, lag = _thinned(points)
        slope, rms = _line(t, lag)
        span = float(t[-1] - t[0])
        shift = slope * span
        if not max(_LEAST_SHIFT_S, _TIMES_SCATTER * rms) < abs(shift) < _MOST * span:
            return None
        return Drift(clock, against, slope * 1e6, shift)


def _thinned(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the points of least lag of 60 equal stretches, or all: a buffer that fills up is not the clock."""
    groups = np.arange(len(points)) * min(_POINTS, len(points)) // len(points)
    order = np.lexsort((points[:, 1], groups))
    least = points[order[np.append(True, np.diff(groups[order]) != 0)]]
    return least[:, 0], least[:, 1]


def _line(t: FloatArray, x: FloatArray) -> tuple[float, float]:
    """Return the slope of the regression of x (n,) on t (n,), and the rms of its residual."""
    dt, dx = t - t.mean(), x - x.mean()
    slope = float(dt @ dx / (dt @ dt))
    return slope, float(np.sqrt(np.mean((dx - slope * dt) ** 2)))


def drift_note(drift: Drift) -> str:
    """Return the note on a drift."""
    return (
        f"{drift.against} drifts by {drift.ppm:+.0f} ppm against {drift.clock} ({drift.shift_s:+.3f} s over the log); "
        f"{drift.clock} is taken"
    )
