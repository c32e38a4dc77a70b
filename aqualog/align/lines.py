"""Find stretches that a logger filled with a straight line where it had no samples.

A measured speed, acceleration or torque never runs straight for long. In measured drives the longest stretch is 3 s,
of a torque that a control unit calculates. A line is one up to the resolution of the signal. The check judges only
signals whose noise elsewhere is larger than their resolution. It therefore never reports a coarse signal, a constant
speed, or a signal that was calculated. Blocks of a second begin at the first sample of the signal, so that the result
does not depend on how the signal is cut into pieces.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from aqualog.core.compiled import compiled, plain
from aqualog.core.records import BoolArray, FloatArray, TimeArray

__all__ = ["LineWatch", "kept_values", "line_watch_of"]

_BLOCK_NS = 1_000_000_000
_LEAST_SAMPLES = 5  # of a block that is judged
_LEAST_S = {"torque": 10.0, "": 5.0}  # control units let torques rise evenly
_JUDGED = ("v_x", "a_x", "a_y", "yaw_rate", "steer", "omega_", "torque_")
_WITHIN = 1.05  # resolutions off the line between two rounded samples
_ROUNDING = 2e-7  # of a number in 32 bits
_RISE = 20.0  # resolutions from its beginning to its end: less is a constant value
_NOISE = 3.0  # times as far off a line as a line may be is the signal elsewhere, in the middle
_TURNS = 0.05  # least share of steps against the step before, elsewhere: measured speeds have 0.11 and more
_OFTEN = 0.1  # of the blocks elsewhere that are straight: then the signal runs straight by itself
_LEAST_BLOCKS = 30  # elsewhere, to know a signal by


class _Block(NamedTuple):
    """What is kept of blocks (b,): first sample, first sample behind, largest distance from the line between, counts.

    `after_ns`, `after`: of the block's own last sample where no other follows at once.
    """

    t_ns: TimeArray
    x: FloatArray
    after_ns: TimeArray
    after: FloatArray
    off: FloatArray
    samples: TimeArray
    changes: TimeArray
    turns: TimeArray


def line_watch_of(name: str) -> LineWatch | None:
    """Return the check for a signal; None for those that may run straight, as heights and temperatures do."""
    if not name.startswith(_JUDGED):
        return None
    return LineWatch(_LEAST_S["torque" if name.startswith("torque_") else ""])


class LineWatch:
    """Check the samples of one signal, which may arrive in pieces. `least_s` is the shortest stretch. [s]"""

    def __init__(self, least_s: float) -> None:
        self._least_ns = round(least_s * 1e9)
        self._first_ns: int | None = None
        self._t: TimeArray = np.zeros(0, dtype=np.int64)  # of the block that is open
        self._x: FloatArray = np.zeros(0)
        self._finest = np.inf
        self._kept: list[_Block] = []

    def push(self, t_ns: TimeArray, x: FloatArray) -> None:
        """Take samples (n,) at strictly increasing stamps, finite."""
        if not t_ns.size:
            return
        if self._first_ns is None:
            self._first_ns = int(t_ns[0])
        t, x = (np.concatenate([self._t, t_ns]), np.concatenate([self._x, x])) if self._t.size else (t_ns, x)
        start = _starts(t, self._first_ns)
        whole = int(start[-1])
        self._t, self._x = t[whole:].copy(), x[whole:].copy()
        if whole:
            self._add(t[: whole + 1], x[: whole + 1], start)

    def _add(self, t: TimeArray, x: FloatArray, edges: TimeArray) -> None:
        """Take the blocks between edges (b + 1,) of samples, with the one sample behind them if there is one."""
        start = edges[:-1]
        after, off, changes, turns, finest = _measured(*plain(t, x, edges))
        self._finest = min(self._finest, finest)
        self._kept.append(_Block(t[start], x[start], t[after], x[after], off, np.diff(edges), changes, turns))

    def finish(self) -> tuple[tuple[int, int], ...]:
        """List the stretches that are lines, in order: the last sample before, and the first behind."""
        if self._t.size:
            self._add(self._t, self._x, np.array([0, self._t.size]))
            self._t, self._x = self._t[:0], self._x[:0]
        if not self._kept or not np.isfinite(self._finest):
            return ()
        b = _Block(*(np.concatenate(parts) for parts in zip(*self._kept, strict=True)))
        self._kept = [b]
        may_be_off = _WITHIN * self._finest + _ROUNDING * np.maximum(np.abs(b.x), np.abs(b.after))
        is_judged = b.samples >= _LEAST_SAMPLES
        is_line: BoolArray = is_judged & (b.off <= may_be_off)
        found = [
            (i, k)
            for i, k in _runs(b, is_line, may_be_off)
            if b.after_ns[k] - b.t_ns[i] >= self._least_ns and abs(b.after[k] - b.x[i]) >= _RISE * may_be_off[i]
        ]
        if not found:
            return ()
        outside = is_judged & ((b.off > may_be_off) | (np.abs(b.after - b.x) > may_be_off))
        for i, k in found:
            outside[i : k + 1] = False
        noisy = outside & ~is_line
        if int(noisy.sum()) < max(_LEAST_BLOCKS, (1.0 - _OFTEN) * int(outside.sum())):
            return ()
        if float(np.median(b.off[noisy] / may_be_off[noisy])) < _NOISE:
            return ()
        if int(b.turns[noisy].sum()) < _TURNS * int(b.changes[noisy].sum()):
            return ()
        return tuple((int(b.t_ns[i]), int(b.after_ns[k])) for i, k in found)


@compiled
def _starts(t, first_ns):  # type: ignore[no-untyped-def]
    """Return where the blocks begin that have samples."""
    start, blocks, edge = np.empty_like(t), 0, first_ns
    for k in range(t.size):
        if t[k] >= edge:
            start[blocks] = k
            blocks += 1
            edge += ((t[k] - edge) // _BLOCK_NS + 1) * _BLOCK_NS
    return start[:blocks]


@compiled
def _measured(t, x, edges):  # type: ignore[no-untyped-def]
    """Per block what `_Block` keeps: last sample or first behind, distance, counts; and the smallest step. (b,)"""
    blocks = edges.size - 1
    after, off = np.empty(blocks, dtype=np.int64), np.zeros(blocks)
    changes, turns, finest = np.zeros(blocks, dtype=np.int64), np.zeros(blocks, dtype=np.int64), np.inf
    for k in range(1, x.size):
        if x[k] != x[k - 1]:
            finest = min(finest, abs(x[k] - x[k - 1]))
    for b in range(blocks):
        i, end = edges[b], edges[b + 1]
        j = min(end, t.size - 1)
        if t[j] - t[end - 1] > _BLOCK_NS:
            j = end - 1
        after[b] = j
        span, rise = max(t[j] - t[i], 1), x[j] - x[i]
        far, n_changes, n_turns = 0.0, 0, 0
        for k in range(i, end):
            far = max(far, abs(x[k] - (x[i] + rise * ((t[k] - t[i]) / span))))
            n_changes += k > i and x[k] != x[k - 1]
            n_turns += k > i + 1 and (x[k - 1] - x[k - 2]) * (x[k] - x[k - 1]) < 0.0
        off[b], changes[b], turns[b] = far, n_changes, n_turns
    return after, off, changes, turns, finest


@compiled
def kept_values(t, x, limits, state):  # type: ignore[no-untyped-def]
    """Return what `FreezeWatch` keeps of samples (n,): the last value's start [ns], the step to it, sign of the last
    change; time that the car moved [ns], changes and turns in it; the smallest change; ends [ns] of long values and the
    steps at them, (m, 2) each.
    """
    (standing, least_ns, gap_ns), (since, into, sign) = limits, state
    moving_ns = changes = turns = 0
    smallest, found = np.inf, 0
    ends, steps = np.empty((t.size, 2), dtype=np.int64), np.empty((t.size, 2))
    for k in range(t.size - 1):
        step, dt = x[k + 1] - x[k], t[k + 1] - t[k]
        is_gap, is_fast = dt > gap_ns, abs(x[k]) > standing
        if is_fast and abs(x[k + 1]) > standing and not is_gap:
            moving_ns += dt
            if step != 0.0:
                changes += 1
                turns += step * sign < 0.0
                sign = math.copysign(1.0, step)
                smallest = min(smallest, abs(step))
        if step != 0.0 or is_gap:
            out = np.nan if is_gap else abs(step)
            if is_fast and t[k] - since >= least_ns:
                ends[found, 0], ends[found, 1], steps[found, 0], steps[found, 1] = since, t[k], into, out
                found += 1
            since, into = t[k + 1], out
    return (since, into, sign), (moving_ns, changes, turns), smallest, ends[:found], steps[:found]


def _runs(b: _Block, is_line: BoolArray, off: FloatArray) -> list[tuple[int, int]]:
    """Return first and last block of runs on one line, each as long as it gets from its beginning on."""
    found: list[tuple[int, int]] = []
    low, high = -np.inf, np.inf
    for k in np.flatnonzero(is_line).tolist():
        first = found[-1][0] if found and found[-1][1] == k - 1 and b.t_ns[k] == b.after_ns[k - 1] else k
        slopes = _slopes(b, first, k, off[k])
        if first != k:
            low, high = max(low, slopes[0]), min(high, slopes[1])
            if low <= high:
                found[-1] = first, k
                continue
        found.append((k, k))
        low, high = _slopes(b, k, k, off[k])
    return found


def _slopes(b: _Block, first: int, k: int, off: float) -> tuple[float, float]:
    """Return the slopes between which a line from the first sample of a block ends within `off` of block k's end."""
    way_ns, rise = max(float(b.after_ns[k] - b.t_ns[first]), 1.0), float(b.after[k] - b.x[first])
    return (rise - off) / way_ns, (rise + off) / way_ns
