"""Find stretches in which the car stands: a constant value there is no evidence of a dead sensor."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from aqualog.core.records import BoolArray, FloatArray, TimeArray

__all__ = ["SPEEDS", "StandWatch", "Stretch", "is_standing", "stand_watch_of", "standing_by", "standing_ns"]

Stretch = tuple[int, int]
"""First and last stamp. [ns]"""

SPEEDS = ("v_x", "omega_fl", "omega_fr", "omega_rl", "omega_rr")
"""Signals that show whether the car stands, the best one first."""

_STANDING = 0.5  # [m/s]
_STOPPING = 20.0  # [m/s^2] a speed that falls to zero faster is lost, and no car that stops
_SLACK = 1.0  # [m/s] of resolution and jitter
_GAP_NS = 2_500_000_000  # GNSS tells its speed once a second


def stand_watch_of(name: str, r_e: float | None) -> StandWatch | None:
    """Return the check of a speed, with the effective radius [m] of a wheel; None for signals that are no speed."""
    return StandWatch(1.0 if r_e is None else r_e) if name in SPEEDS else None


class StandWatch:
    """Check the samples of one speed, in any pieces. `scale` makes them m/s.

    `has_moved`: a sample so far was of a moving car.
    """

    def __init__(self, scale: float = 1.0) -> None:
        self._scale = scale
        self._last: tuple[int, float] | None = None
        self._since: int | None = None  # the stretch that is open
        self._is_sound = True  # it was reached as a car stops
        self.has_moved = False
        self._found: list[Stretch] = []

    def push(self, t_ns: TimeArray, x: FloatArray) -> None:
        """Take samples (n,) at strictly increasing stamps, finite."""
        if not t_ns.size:
            return
        v = np.abs(x) * self._scale
        t_last, v_last = self._last or (int(t_ns[0]), float(v[0]))
        dt = np.diff(t_ns, prepend=t_last)
        is_sound = np.abs(np.diff(v, prepend=v_last)) <= _STOPPING * dt * 1e-9 + _SLACK
        stands = v <= _STANDING
        self.has_moved |= not bool(stands.all())
        before = np.append(self._since is not None, stands[:-1])
        for k in np.flatnonzero((stands != before) | (dt > _GAP_NS)).tolist():
            if before[k]:
                end = int(t_ns[k - 1]) if k else t_last
                self._close(end, is_left_soundly=bool(stands[k] or is_sound[k]))
            if stands[k]:
                self._since, self._is_sound = int(t_ns[k]), bool(is_sound[k])
        self._last = int(t_ns[-1]), float(v[-1])

    def _close(self, end_ns: int, *, is_left_soundly: bool) -> None:
        assert self._since is not None
        if self._is_sound and is_left_soundly:
            self._found.append((self._since, end_ns))
        self._since = None

    def finish(self) -> tuple[Stretch, ...]:
        """List the stretches in which the car stands, in order."""
        if self._since is None or not self._is_sound or self._last is None:
            return tuple(self._found)
        return (*self._found, (self._since, self._last[0]))


def standing_by(watches: Iterable[StandWatch]) -> tuple[Stretch, ...]:
    """Return when the car stands, by the best speed that moves at all: one that never does may be dead."""
    found: tuple[Stretch, ...] = ()
    for watch in watches:
        if watch.has_moved:
            return watch.finish()
        found = found or watch.finish()
    return found


def is_standing(t_ns: TimeArray, stretches: Sequence[Stretch]) -> BoolArray:
    """Flag the steps (n-1,) between stamps (n,) through which the car stands from begin to end."""
    if not stretches or t_ns.size < 2:
        return np.zeros(max(t_ns.size - 1, 0), dtype=np.bool_)
    start, end = np.array(stretches, dtype=np.int64).T
    k = np.searchsorted(start, t_ns[:-1], side="right") - 1
    return np.asarray((k >= 0) & (t_ns[1:] <= end[k]))


def standing_ns(start_ns: int, end_ns: int, stretches: Sequence[Stretch]) -> int:
    """Return how much of a span of time the car stands. [ns]"""
    return sum(max(min(end_ns, b) - max(start_ns, a), 0) for a, b in stretches)
