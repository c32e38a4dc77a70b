"""How far repetitions of a drive are apart: the tolerance that the car itself asks for."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import NormalDist

import numpy as np

from aqualog.core.intervals import Z95, student_quantile
from aqualog.core.records import FloatArray
from aqualog.diagnose.inputs import smooth
from aqualog.trade.control import satterthwaite
from aqualog.validate.records import Spread, Trace

__all__ = ["LEAST_DRIVES", "spread_of"]

LEAST_DRIVES = 3  # ISO 19364: the car is tested at least three times
CELL = 5.0 / 3.6  # [m/s] width of a cell of speed
LEAST_BLOCKS = 5  # of a drive in a cell
LEAST_SHARE = 0.5  # of the judged time that must lie in cells of three drives and more
# of drives that repeat each other, else any three would widen the boundaries by what differs between their roads
LENGTHS = 0.15  # most difference of the lengths
SPEEDS = 0.1  # most rms difference of the speeds, of their mean
TOGETHER_S = 1.0  # [s] within which errors belong together: a velocity of 10 Hz is its own neighbour over 0.1 s
BY_NOISE = 0.01  # of the time that a right simulation may be beyond any boundary by noise; 5 % are agreed on
PARTS = 5  # shifts of the simulated signal within this time, to either side
LATE_S = 10.0  # [s] by which one recording may begin later than another


def spread_of(traces: Sequence[Trace], signal: str) -> Spread | None:
    """eps_y by drives that repeat each other; None where they do not.

    Parameters
    ----------
    traces : sequence of Trace
        Of one car.
    signal : str
        In all of them, else there is no result.

    Returns
    -------
    Spread, optional
        y_offset = t sqrt(s_b² + s_n²) [unit of the signal]. s_b is the scatter between the drives' means of measured
        minus simulated in cells of speed (5 km/h), dry and wet apart; what the inputs of a drive explain is not in it,
        an error that all drives share neither. s_n is the noise, from differences over a second, less what the
        simulated signal, without what is faster, up to a second earlier and later explains of them by least squares:
        a wrong gain, delay or stiffness is no noise, that of the inputs is. It is larger for each other signal, so
        that by noise all are within at once 99 % of the time [bonferroni1936]. t is the 97.5 % quantile of Student's
        t with the degrees of freedom of the sum [satterthwaite1946]: s_b has (drives - 1), s_n one per second.
    """
    if len(traces) < LEAST_DRIVES or any(signal not in t.measured for t in traces) or not _repeat(traces):
        return None
    cells: dict[tuple[bool, int], list[tuple[float, int]]] = {}
    squares, pairs, judged = 0.0, 0, 0
    for trace in traces:
        off = np.where(trace.judged, trace.measured[signal] - trace.simulated[signal], np.nan)
        good = np.isfinite(off)
        judged += int(good.sum())
        late = max(1, round(TOGETHER_S / trace.step))
        step = _unexplained(off[late:] - off[:-late], trace.simulated[signal], late)
        squares, pairs = squares + 0.5 * float(step @ step), pairs + step.size
        cell = np.floor(trace.over["v_x"] / CELL).astype(int)
        for wet in (False, True):
            for c in np.unique(cell[good & (trace.wet == wet)]).tolist():
                own = off[good & (trace.wet == wet) & (cell == c)]
                if own.size >= LEAST_BLOCKS:
                    cells.setdefault((wet, c), []).append((float(own.mean()), own.size))
    shared = [x for x in cells.values() if len(x) >= LEAST_DRIVES]
    if not shared or sum(n for x in shared for _, n in x) < LEAST_SHARE * judged or not pairs:
        return None
    between = sum(float(np.var([m for m, _ in x])) * len(x) for x in shared) / sum(len(x) - 1 for x in shared)
    at_once = NormalDist().inv_cdf(1.0 - 0.5 * BY_NOISE / len(traces[0].measured)) / Z95
    noise, seconds = at_once**2 * squares / pairs, pairs * traces[0].step / TOGETHER_S
    own = (len(traces) - 1.0, max(seconds, 1.0))
    t = student_quantile(0.975, satterthwaite((between, noise), own) if between + noise else own[0])
    return Spread(t * math.sqrt(between + noise), len(traces), t, math.sqrt(between), math.sqrt(noise))


def _unexplained(step: FloatArray, simulated: FloatArray, late: int) -> FloatArray:
    """Differences (m,) over `late` blocks less what those of the simulated signal, shifted by up to as many blocks,
    explain of them; those that are not known are left out."""
    every, blocks = max(1, late // PARTS), np.arange(simulated.size)
    simulated = smooth(simulated, 1.0, float(late))
    shifted = [np.interp(blocks - lag, blocks, simulated, np.nan, np.nan) for lag in range(-late, late + 1, every)]
    x = np.array([s[late:] - s[:-late] for s in shifted])
    good = np.isfinite(step) & np.isfinite(x).all(axis=0)
    if good.sum() <= 10 * len(x):
        return step[np.isfinite(step)]
    return np.asarray(step[good] - np.linalg.lstsq(x[:, good].T, step[good], rcond=None)[0] @ x[:, good])


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
