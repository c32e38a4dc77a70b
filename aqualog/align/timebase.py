"""Time stamps of one source: classified, repaired where the fault is understood, and counted.

| fault | how it looks | rule |
|---|---|---|
| duplicate | same stamp again | the later sample wins |
| back-step | up to 1 s back | sorted into place |
| wrap | back by 2^16, 2^32, ... ticks of the counter | unwrapped |
| reset | back by more than 1 s, no wrap | goes on 1 s after the last sample: the true pause is unknown |
| pause | more than 1 s and 10 sample times without a sample | left as a gap |
"""

from __future__ import annotations

import numpy as np

from aqualog.align.resample import MEDIAN_OF
from aqualog.align.shared import OfLast
from aqualog.types import TimeArray, TimeFaults

__all__ = ["ClockRepair"]

_SECOND = 1_000_000_000
_TICKS_NS = (1, 100, 1_000, 10_000, 100_000, 1_000_000, 10_000_000, 1_000_000_000)
_WIDTHS = (16, 24, 32)
_WRAPS_NS = tuple(sorted({(1 << w) * tick for w in _WIDTHS for tick in _TICKS_NS} | {24 * 3600 * _SECOND}))


class ClockRepair:
    """Repairs the time vectors of one file.

    Channels of one file may have vectors of their own; a reset shifts all of them by the same amount, so that they
    stay in step. A vector that several of them share is repaired once, and so is what is given back for it.
    """

    def __init__(self) -> None:
        self._shifts: list[int] = []
        self._of_last = OfLast(self._repaired)

    def repair(self, t_ns: TimeArray) -> tuple[TimeArray, TimeArray, TimeFaults]:
        """Repair one vector.

        Parameters
        ----------
        t_ns : int64 array (n,)
            Stamps in file order; not changed.

        Returns
        -------
        t_ns : int64 array (m,)
            Strictly increasing stamps, m <= n.
        order : int64 array (m,)
            Which sample of the input belongs to each stamp.
        faults : TimeFaults
        """
        return self._of_last(t_ns)

    def _repaired(self, t_ns: TimeArray) -> tuple[TimeArray, TimeArray, TimeFaults]:
        n = t_ns.size
        if n < 2:
            return t_ns.copy(), np.arange(n), TimeFaults()
        steps = np.diff(t_ns)
        period = _median_period(steps)
        fixed, wraps, resets = t_ns, 0, 0
        if (steps < -_SECOND).any():
            fixed, wraps, resets = self._large_steps(t_ns, steps, period)
            steps = np.diff(fixed)
        back_steps = int((steps < 0).sum())
        order = np.arange(n)
        if back_steps:
            order = np.argsort(fixed, kind="stable")
            fixed = fixed[order]
            steps = np.diff(fixed)
        duplicates = int((steps == 0).sum())
        if duplicates:
            last = np.append(steps != 0, True)
            fixed, order = fixed[last], order[last]
            steps = np.diff(fixed)
        pauses = int((steps > max(10 * period, _SECOND)).sum())
        return fixed.copy(), order, TimeFaults(duplicates, back_steps, resets, wraps, max(pauses - resets, 0))

    def _large_steps(self, t_ns: TimeArray, steps: TimeArray, period: int) -> tuple[TimeArray, int, int]:
        shift = np.zeros(t_ns.size, dtype=np.int64)
        wraps = resets = 0
        for i in np.flatnonzero(steps < -_SECOND):
            wrap = _wrap_of(int(-steps[i]) + period, period)
            if wrap is not None:
                shift[i + 1 :] += wrap
                wraps += 1
                continue
            own = int(-steps[i]) + _SECOND
            if resets < len(self._shifts) and abs(self._shifts[resets] - own) < 2 * _SECOND:
                own = self._shifts[resets]
            elif resets == len(self._shifts):
                self._shifts.append(own)
            shift[i + 1 :] += own
            resets += 1
        return t_ns + shift, wraps, resets


def _median_period(steps: TimeArray) -> int:
    positive = steps[:MEDIAN_OF][steps[:MEDIAN_OF] > 0]
    return int(np.median(positive)) if positive.size else 0


def _wrap_of(span: int, period: int) -> int | None:
    """The counter length that explains a jump back, if one does within a few sample times."""
    tolerance = max(3 * period, 2_000_000)
    for wrap in _WRAPS_NS:
        # a counter wraps from its very end to its very start, so a short span cannot be told from a restart
        if abs(span - wrap) <= tolerance and wrap > 20 * _SECOND:
            return wrap
    return None
