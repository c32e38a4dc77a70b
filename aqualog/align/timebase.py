"""Repair the time stamps of one source: classify faults, repair those that are understood, count all.

| fault | how it looks | rule |
|---|---|---|
| duplicate | same stamp again | the later sample wins |
| rounded | the same number of samples on each stamp, with values that differ | spread evenly up to the next stamp |
| back-step | up to 1 s back | sorted into place |
| clock set back | up to 1 s back, then through the same times again | the later samples win, as of duplicates |
| stray | up to 100 samples elsewhere, then on as before; at either end a day or more away | left out |
| wrap | back by 2^16, 2^32, ... ticks of the counter, a minute, an hour, a day, a week | unwrapped |
| doubled block | back by more than 1 s, then the same uneven stamps again up to where it was | the later copy wins |
| block written twice | back, then rows with the same stamps and the same changing values | counted once, no loss |
| reset | back by more than 1 s, no wrap | goes on 1 s after the last sample: the true pause is unknown |
| pause | more than 1 s and 10 sample times without a sample | left as a gap |
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from aqualog.core.records import BoolArray, Channel, FloatArray, TimeArray, TimeFaults

__all__ = ["DAY_NS", "MEDIAN_OF", "ClockRepair", "OfLast", "with_spread_stamps", "without_copies"]

MEDIAN_OF = 1 << 18  # steps, the first ones: a log that is read in pieces has the same median

_Value = TypeVar("_Value")
_Key = TypeVar("_Key", bound=Hashable)

_SECOND = 1_000_000_000
_EVEN, _LEAST_UNEVEN = 1e-3, 3  # of the sample time; steps by which a block of stamps is known again
_LEAST_CHANGES = 3  # of values, by which a block of rows is: no second pass of a sensor repeats them
_TICKS_NS = (1, 100, 1_000, 10_000, 100_000, 1_000_000, 10_000_000, 1_000_000_000)
_WIDTHS = (16, 24, 32)
_CLOCKS_S = (60, 3600, 24 * 3600, 7 * 24 * 3600)  # of the minute, the hour, the day, the (GNSS) week
_WRAPS_NS = tuple(sorted({(1 << w) * tick for w in _WIDTHS for tick in _TICKS_NS} | {s * _SECOND for s in _CLOCKS_S}))
DAY_NS = 24 * 3600 * _SECOND
_STRAYS = 100  # samples, at most, that have a stamp from elsewhere
_SET_BACK = 5  # samples, at least, that a clock that was set back goes through once more
_MOST_AGAIN = 20_000  # samples that are looked at
_LEAST_ROUNDED, _LEAST_SHARING, _REGULAR = 5, 2.25, 0.95  # stamps; samples on each; share of stamps that are alike


class OfLast(Generic[_Value]):
    """A function of one array; the answers for the last three are kept, and serve all arrays of the same content."""

    def __init__(self, function: Callable[[NDArray[Any]], _Value]) -> None:
        self._function = function
        self._last: deque[tuple[NDArray[Any], _Value]] = deque(maxlen=3)

    def __call__(self, array: NDArray[Any]) -> _Value:
        """Return the answer for this array, which stays unchanged."""
        for known, answer in self._last:
            if known is array or np.array_equal(known, array):
                return answer
        self._last.append((array, self._function(array)))
        return self._last[-1][1]


class ClockRepair:
    """Repair the time vectors of one file.

    Channels of one file may have vectors of their own. A reset shifts all of them by the same amount, so that they stay
    in step. A vector that several channels share is repaired once, and they share the result.
    """

    def __init__(self) -> None:
        self._shifts: list[int] = []
        self._of_last = OfLast(self._repaired)

    def repair(self, t_ns: TimeArray) -> tuple[TimeArray, TimeArray, TimeFaults]:
        """Repair one vector of stamps (n,) in file order, which is not changed. [ns]

        Returns strictly increasing stamps (m,), m <= n, which sample of the input belongs to each (m,), and the faults.
        """
        return self._of_last(t_ns)

    def _repaired(self, t_ns: TimeArray) -> tuple[TimeArray, TimeArray, TimeFaults]:
        n = t_ns.size
        order = np.arange(n)
        if n < 2:
            return t_ns.copy(), order, TimeFaults()
        steps = np.diff(t_ns)
        forward = steps[:MEDIAN_OF][steps[:MEDIAN_OF] > 0]
        period = int(np.median(forward)) if forward.size else 0
        fixed, strays = t_ns, 0
        wraps: list[int] = []
        resets: list[int] = []
        first: dict[str, int] = {}  # stamps
        if (steps < -_SECOND).any() or (steps > DAY_NS).any():
            is_stray = _is_stray(t_ns, steps, period)
            order = np.flatnonzero(~is_stray)
            strays = n - order.size
            fixed = t_ns[order]
            fixed, wraps, resets = self._large_steps(fixed, np.diff(fixed), period)
            steps = np.diff(fixed)
            if strays:  # behind the last sample before it
                first["strays"] = int(fixed[max(int(np.argmax(is_stray)) - 1, 0)])
            first |= {kind: int(fixed[at[0]]) for kind, at in (("resets", resets), ("wraps", wraps)) if at}
        begins = fixed[resets]
        back_steps = int((steps < 0).sum())
        again = 0
        if back_steps:
            first["back_steps"] = int(fixed[np.argmax(steps < 0)])
            is_again = _is_again(fixed, steps, period)
            again = int(is_again.sum())
            if again:
                first["duplicates"] = int(fixed[np.argmax(is_again)])
            fixed, order = fixed[~is_again], order[~is_again]
            by_time = np.argsort(fixed, kind="stable")
            fixed, order = fixed[by_time], order[by_time]
            steps = np.diff(fixed)
        duplicates = again + int((steps == 0).sum())
        if duplicates > again:
            first["duplicates"] = min(int(fixed[np.argmax(steps == 0)]), first.get("duplicates", int(fixed[-1])))
            last = np.append(steps != 0, True)
            fixed, order = fixed[last], order[last]
            steps = np.diff(fixed)
        is_pause = (steps > max(10 * period, _SECOND)) & ~np.isin(fixed[:-1], begins)
        if is_pause.any():
            first["pauses"] = int(fixed[np.argmax(is_pause)])
        begin = int(fixed[0])
        places = {kind: (at - begin) * 1e-9 for kind, at in first.items()}
        return fixed.copy(), order, TimeFaults(
            duplicates, back_steps, len(resets), len(wraps), int(is_pause.sum()), strays=strays, first_s=places
        )  # fmt: skip

    def _large_steps(self, t_ns: TimeArray, steps: TimeArray, period: int) -> tuple[TimeArray, list[int], list[int]]:
        """Return stamps (n,) without them, and the samples before wraps and before resets."""
        shift = np.zeros(t_ns.size, dtype=np.int64)
        wraps: list[int] = []
        resets: list[int] = []
        begin = 0
        for i in np.flatnonzero(steps < -_SECOND):
            if _is_doubled(t_ns, begin, int(i)):  # nothing to shift: what comes after goes on where it stopped
                continue
            begin = int(i) + 1
            # a counter wraps from its very end to its very start: a short span may also be a restart
            off = max(3 * period, 2_000_000)
            span = int(-steps[i]) + period
            wrap = next((w for w in _WRAPS_NS if abs(span - w) <= off and w > 20 * _SECOND), None)
            if wrap is not None:
                shift[i + 1 :] += wrap
                wraps.append(int(i))
                continue
            own = int(-steps[i]) + _SECOND
            known = len(resets)
            if known < len(self._shifts) and abs(self._shifts[known] - own) < 2 * _SECOND:
                own = self._shifts[known]
            elif known == len(self._shifts):
                self._shifts.append(own)
            shift[i + 1 :] += own
            resets.append(int(i))
        return t_ns + shift, wraps, resets


def _is_stray(t_ns: TimeArray, steps: TimeArray, period: int) -> BoolArray:
    """Flag stamps (n,) that come from elsewhere: the stamps before and behind them belong together.

    Taken for a reset, such a stamp would move the rest of one channel and not that of the others.
    """
    stray = np.zeros(t_ns.size, dtype=np.bool_)
    leaps = np.abs(steps) > _SECOND
    for k in np.flatnonzero(steps < -_SECOND).tolist():
        if stray[k] or stray[k + 1]:
            continue
        # the way ends with the step back (stamps ahead of their time) or begins with it (stamps behind their time)
        first = max(k - _STRAYS, 0)
        begins = first + np.flatnonzero(leaps[first:k] & (steps[first:k] > 0))
        ends = k + 1 + np.flatnonzero(leaps[k + 1 : k + 1 + _STRAYS] & (steps[k + 1 : k + 1 + _STRAYS] > 0))
        ways = [(int(i), k) for i in begins[::-1]] + [(k, int(j)) for j in ends]
        for before, last in ways:
            step = int(t_ns[last + 1] - t_ns[before])
            if 0 < step <= (last - before + 1) * 2 * period + _SECOND:
                stray[before + 1 : last + 1] = True
                break
    # a first header without a time, a last record that was cut
    few = min(_STRAYS, t_ns.size // 10)
    for k in np.flatnonzero(steps > DAY_NS).tolist():
        if k < few:
            stray[: k + 1] = True
        elif k + 1 >= t_ns.size - few:
            stray[k + 1 :] = True
    return stray


def _is_again(t_ns: TimeArray, steps: TimeArray, period: int) -> BoolArray:
    """Flag stamps (n,) that a clock set back by up to 1 s passes a second time.

    A late sample fills a hole among those before it. A clock that was set back leaves no hole: sorting would mix the
    samples of two times.
    """
    again = np.zeros(t_ns.size, dtype=np.bool_)
    for k in np.flatnonzero(steps <= min((1 - _SET_BACK) * period, -1)).tolist():
        most = min(int(-steps[k]) // max(period, 1) * 2 + _SET_BACK, _MOST_AGAIN)
        behind, before = t_ns[k + 1 : k + 2 + most], t_ns[max(k + 1 - most, 0) : k + 1]
        through = int(np.searchsorted(np.maximum.accumulate(behind), t_ns[k]))  # samples until it is where it was
        start = k + 1 - int((before >= t_ns[k + 1]).sum())
        ways = np.concatenate([np.diff(behind[: through + 1]), np.diff(t_ns[start : k + 1])])
        if min(through, k + 1 - start) >= _SET_BACK and through < behind.size and ways.size:
            again[start : k + 1] = bool(ways.min() >= 0 and ways.max() <= 3 * period)
    return again


def _is_doubled(t_ns: TimeArray, begin: int, last: int) -> bool:
    """Return whether the block that ends at sample `last` follows once more, as a disk or stick may write it.

    `begin` is the last restart of the clock: a drive that repeats all stamps since then is another drive on the same
    clock. Stamps on an even grid prove nothing, since a clock that was set back has them, too. The sample at the joint
    may consist of two halves, so that its own stamp need not come again.
    """
    first = np.flatnonzero(t_ns[begin : last + 1] == t_ns[last + 1])
    if not first.size or first[-1] == 0:
        return False
    block = t_ns[begin + int(first[-1]) : last + 1]
    steps = np.diff(block[:-1])
    uneven = int((np.abs(steps - np.median(steps)) > _EVEN * np.median(steps)).sum()) if steps.size else 0
    return uneven >= _LEAST_UNEVEN and bool(np.array_equal(block[:-1], t_ns[last + 1 : last + block.size]))


def without_copies(channels: Mapping[_Key, Channel]) -> tuple[dict[_Key, Channel], tuple[str, ...]]:
    """Leave out rows of the channels of a drive that a logger has written twice; nothing is lost by them.

    Returns the channels, and a note for each file with such rows.
    """
    kept = dict(channels)
    notes: dict[str, str] = {}
    left = [key for key, c in channels.items() if (np.diff(c.t_ns) < 0).any()]
    while left:
        file, t = channels[left[0]].info.file, channels[left[0]].t_ns
        own = [k for k in left if channels[k].info.file == file and np.array_equal(channels[k].t_ns, t)]
        left = [k for k in left if k not in own]
        is_copy = _written_twice(t, [channels[k].values for k in own])
        if not is_copy.any():
            continue
        for k in own:
            kept[k] = replace(channels[k], t_ns=t[~is_copy], values=channels[k].values[~is_copy])
        begin, end = (float(x - t[0]) * 1e-9 for x in (t[is_copy].min(), t[is_copy].max()))
        rows = f"{int(is_copy.sum())} rows from {begin:.2f} to {end:.2f} s"
        notes.setdefault(file, f"{file}: {rows} stand twice, with the same stamps and values: counted once")
    return kept, tuple(notes.values())


def with_spread_stamps(channels: Mapping[_Key, Channel]) -> tuple[dict[_Key, Channel], tuple[str, ...]]:
    """Spread samples that share rounded stamps, as of 100 Hz written with one decimal, evenly between the stamps.

    Returns the channels, and a note for each file with such stamps. Channels with the same stamps stay together: one
    that moves shows that each row is a sample; where all of them repeat their values, no row is one of its own.
    """
    of_last = OfLast(_spread)
    found = {key: own for key, c in channels.items() if (own := of_last(c.t_ns)) is not None}

    def clock(c: Channel) -> tuple[str, int, int, int]:
        return c.info.file, c.t_ns.size, int(c.t_ns[0]), int(c.t_ns[-1])

    def moves(c: Channel) -> bool:
        same = np.diff(c.t_ns) == 0
        return 2 * int((np.diff(c.values)[same] != 0.0).sum()) >= int(same.sum())

    moving = {clock(channels[key]) for key in found if moves(channels[key])}
    spread = dict(channels)
    notes: dict[str, str] = {}
    for key, (t_ns, *steps) in found.items():
        c = channels[key]
        if clock(c) not in moving:
            continue
        spread[key] = replace(c, t_ns=t_ns)
        step, period = (f"{x * 1e-9:.4g} s" for x in steps)
        what = f"its time stamps are rounded to {step}; samples that share one are spread evenly, {period} apart"
        notes.setdefault(c.info.file, f"{c.info.file}: {what}")
    return spread, tuple(notes.values())


def _spread(t_ns: TimeArray) -> tuple[TimeArray, float, float] | None:
    """Stamps (n,) spread evenly, the step they are rounded to and that between samples [ns]; None if not rounded."""
    starts = np.flatnonzero(np.append(True, np.diff(t_ns) != 0))
    if not _LEAST_ROUNDED <= starts.size < t_ns.size / _LEAST_SHARING:
        return None
    steps, count = np.diff(t_ns[starts]), np.diff(np.append(starts, t_ns.size))
    step, usual = float(np.median(steps)), float(count[1:-1].mean())
    is_usual = np.abs(count[1:-1] - usual) <= max(1.25, 0.25 * usual)  # a log begins and ends between two stamps
    is_even = np.abs(steps - step) <= 0.01 * step
    if is_usual.mean() < _REGULAR or is_even.mean() < _REGULAR:
        return None
    period = step / float(count[1:-1][is_usual].mean())
    # what is cut off begins in the middle of a step if it is rounded, at its start if it is truncated
    middle = (step - period) / 2.0 if count[0] > 0.75 * usual else 0.0
    spread = np.empty_like(t_ns)
    for runs in np.split(np.arange(starts.size), np.flatnonzero(~is_even) + 1):
        at, inner = starts[runs], runs[1:-1]
        k = np.arange(at[0], at[-1] + count[runs[-1]])
        if inner.size < 2:
            offset = period * (k - np.repeat(at, count[runs])) - (step / 2.0 if not middle else 0.0)
            spread[k] = t_ns[k] + np.round(offset).astype(np.int64)
            continue
        k_mid, t_mid = starts[inner] + (count[inner] - 1) / 2.0, t_ns[starts[inner]] - t_ns[at[0]] + middle
        t = np.interp(k, k_mid, t_mid)
        t = np.where(k < k_mid[0], t_mid[0] + period * (k - k_mid[0]), t)
        t = np.where(k > k_mid[-1], t_mid[-1] + period * (k - k_mid[-1]), t)
        spread[k] = t_ns[at[0]] + np.round(t).astype(np.int64)
    return spread, step, period


def _written_twice(t_ns: TimeArray, columns: Sequence[FloatArray]) -> BoolArray:
    """Flag rows (n,) that repeat those before them in stamps and all values, as a logger writes a buffer twice.

    Rows whose values do not change prove nothing: a car that stands has them again after its clock was set back.
    """
    copies = np.zeros(t_ns.size, dtype=np.bool_)
    for k in np.flatnonzero(np.diff(t_ns) < 0).tolist():
        same = np.flatnonzero(t_ns[: k + 1] == t_ns[k + 1])
        if not same.size:
            continue
        first = int(same[-1])
        rows = min(k + 1 - first, t_ns.size - k - 1)
        block, again = slice(first, first + rows), slice(k + 1, k + 1 + rows)
        changes = np.zeros(max(rows - 1, 0), dtype=np.bool_)
        for x in columns:
            changes |= np.abs(np.diff(x[block])) > 0.0  # not from or to a missing value
        is_same = all(np.array_equal(x[block], x[again], equal_nan=True) for x in columns)
        if is_same and np.array_equal(t_ns[block], t_ns[again]) and int(changes.sum()) >= _LEAST_CHANGES:
            copies[again] = True
    return copies
