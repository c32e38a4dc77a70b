"""How far repetitions of a drive are apart: the tolerance that the car itself asks for."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from aqualog.core.intervals import student_quantile
from aqualog.core.records import FloatArray
from aqualog.validate.records import Trace

__all__ = ["LEAST_DRIVES", "spread_of"]

LEAST_DRIVES = 3  # ISO 19364: the car is tested at least three times
CELL = 5.0 / 3.6  # [m/s] width of a cell of speed
LEAST_BLOCKS = 5  # of a drive in a cell
LEAST_SHARE = 0.5  # of the judged time that must lie in cells of three drives and more
# of drives that repeat each other, else any three would widen the boundaries by what differs between their roads
LENGTHS = 0.15  # most difference of the lengths
SPEEDS = 0.1  # most rms difference of the speeds, of their mean
LATE_S = 10.0  # [s] by which one recording may begin later than another


def spread_of(traces: Sequence[Trace], signal: str) -> float:
    """eps_y by drives that repeat each other; NaN where they do not.

    Parameters
    ----------
    traces : sequence of Trace
        Of one car.
    signal : str
        In all of them, else the result is NaN.

    Returns
    -------
    float
        t sqrt(s_b² + s_n²) [unit of the signal], t the 97.5 % quantile of Student's t with (drives - 1) degrees of
        freedom. s_b is the scatter between the drives' means of measured minus simulated in cells of speed (5 km/h),
        dry and wet apart; what the inputs of a drive explain is not in it, an error that all drives share neither.
        s_n is the noise, from the differences of successive blocks.
    """
    if len(traces) < LEAST_DRIVES or any(signal not in t.measured for t in traces) or not _repeat(traces):
        return math.nan
    cells: dict[tuple[bool, int], list[tuple[float, int]]] = {}
    squares, pairs, judged = 0.0, 0, 0
    for trace in traces:
        off = np.where(trace.judged, trace.measured[signal] - trace.simulated[signal], np.nan)
        good = np.isfinite(off)
        judged += int(good.sum())
        step = np.diff(off)
        step = step[np.isfinite(step)]
        squares, pairs = squares + 0.5 * float(step @ step), pairs + step.size
        cell = np.floor(trace.over["v_x"] / CELL).astype(int)
        for wet in (False, True):
            for c in np.unique(cell[good & (trace.wet == wet)]).tolist():
                own = off[good & (trace.wet == wet) & (cell == c)]
                if own.size >= LEAST_BLOCKS:
                    cells.setdefault((wet, c), []).append((float(own.mean()), own.size))
    shared = [x for x in cells.values() if len(x) >= LEAST_DRIVES]
    if not shared or sum(n for x in shared for _, n in x) < LEAST_SHARE * judged or not pairs:
        return math.nan
    between = sum(float(np.var([m for m, _ in x])) * len(x) for x in shared) / sum(len(x) - 1 for x in shared)
    t = student_quantile(0.975, float(len(traces) - 1))
    return t * math.sqrt(between + squares / pairs)


def _repeat(traces: Sequence[Trace]) -> bool:
    """Whether the drives went the same way: lengths and speeds over time are those of the first."""
    first = traces[0].over["v_x"]
    return all(_same(first, t.over["v_x"], round(LATE_S / t.step)) for t in traces[1:])


def _same(a: FloatArray, b: FloatArray, most: int) -> bool:
    if abs(a.size - b.size) > LENGTHS * max(a.size, b.size):
        return False
    least = SPEEDS * float(np.mean(a))
    for shift in range(-most, most + 1):
        x, y = (a[shift:], b) if shift >= 0 else (a, b[-shift:])
        n = min(x.size, y.size)
        if n and float(np.sqrt(np.mean((x[:n] - y[:n]) ** 2))) <= least:
            return True
    return False
