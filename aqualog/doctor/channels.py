"""Faults of single channels: of their time stamps, and of their values."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from aqualog.align.overview import ChannelOverview
from aqualog.doctor.records import Finding, Level
from aqualog.types import Channel, TimeFaults

__all__ = ["channel_findings", "frozen_longest"]

_LIVELY = 0.2  # of the samples differ from the one before: such a signal does not stand still by itself
_FROZEN_S = 10.0
_TIMES_USUAL = 20.0
_LEAST = 100  # changes, to know a channel by
_SLOW = 0.02  # of the time outside
_HABIT = 0.01  # of the stamps doubled here and there are a logger's habit; more are samples lost to a wrong clock
_TIMES: dict[str, tuple[Level, str, str]] = {
    "duplicates": ("lost", "time stamps doubled; the last sample of each is kept", "check the logger's clock"),
    "back_steps": ("mended", "time stamps out of order; samples are sorted by time", ""),
    "resets": (
        "mended", "resets of the clock; what follows is put behind what came before, the pause between is not known",
        "cut the log there if it holds two drives",
    ),
    "wraps": ("mended", "overflows of the time counter; undone", ""),
    "pauses": ("doubt", "pauses of the recording; nothing is judged in them", ""),
}  # fmt: skip


def channel_findings(found: Sequence[ChannelOverview], channels: Sequence[Channel]) -> Iterator[Finding]:
    """Findings of all channels of a drive.

    Parameters
    ----------
    found : sequence of ChannelOverview
    channels : sequence of Channel
        In the same order.

    Channels of one file share their clock: a fault of the stamps that several have alike is told once, of the first.
    """
    told: set[tuple[str, str, int]] = set()
    for own, channel in zip(found, channels, strict=True):
        for kind in TimeFaults.__slots__:
            count = getattr(own.faults, kind)
            if count and (own.file, kind, count) not in told:
                told.add((own.file, kind, count))
                level, what, advice = _TIMES[kind]
                if kind == "duplicates" and count <= _HABIT * own.samples:
                    level = "mended"
                yield Finding(level, kind, own.file, own.path, f"{count} {what}", advice, count, own.samples)
        yield from _of_values(own, channel)


def _of_values(own: ChannelOverview, channel: Channel) -> Iterator[Finding]:
    if own.samples == 0:
        yield Finding("doubt", "empty", own.file, own.path, "has no sample")
        return
    if own.not_finite:
        what = f"{own.not_finite} of {own.samples} samples are no numbers (NaN, infinite, marked invalid); not used"
        yield Finding("doubt", "not_finite", own.file, own.path, what, "", own.not_finite, own.samples)
    if own.remark and own.remark not in ("constant", "no value"):
        what, _, advice = own.remark.partition(": ")
        yield Finding("doubt", "code", own.file, own.path, what, advice)
    seconds, at_s, value = frozen_longest(channel)
    if seconds >= _FROZEN_S:
        what = f"stands at {value:g} for {seconds:.0f} s (from {at_s:.0f} s), though it changes all the time elsewhere"
        yield Finding("doubt", "frozen", own.file, own.path, what, "do not believe what rests on it there")


def frozen_longest(channel: Channel) -> tuple[float, float, float]:
    """Longest time that a channel stands still as it does nowhere else: how long [s], from when [s], at what value.

    0.0, 0.0, NaN if there is none. A signal with noise hardly ever repeats itself; one that is coarse or slow does all
    the time, and a car at rest stands at zero: both are let be. So the stop must be one of a value other than zero, of
    at least 10 s, and next to nothing of the time outside it (and stops half as long) may lie in stops that are a
    twentieth as long.
    """
    values, t_ns = channel.values, channel.t_ns
    same = (values[1:] == values[:-1]) & (np.diff(t_ns) > 0) & (values[1:] != 0.0)
    begin, end = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(np.int8))).reshape(-1, 2).T
    lengths_s = (t_ns[end] - t_ns[begin]) * 1e-9
    longest = float(lengths_s.max(initial=0.0))
    if longest < _FROZEN_S:
        return 0.0, 0.0, np.nan
    stops = lengths_s >= longest / 2.0
    rest_s = float(t_ns[-1] - t_ns[0]) * 1e-9 - float(lengths_s[stops].sum())
    slow_s = float(lengths_s[~stops & (lengths_s >= longest / _TIMES_USUAL)].sum())
    is_set = values[1:] != 0.0
    moving, steps = int((is_set & ~same).sum()), int(is_set.sum() - (end - begin)[stops].sum())
    if slow_s > _SLOW * rest_s or moving < max(_LEAST, _LIVELY * steps):
        return 0.0, 0.0, np.nan
    k = int(np.argmax(lengths_s))
    return longest, float(t_ns[begin[k]] - t_ns[0]) * 1e-9, float(values[begin[k]])
