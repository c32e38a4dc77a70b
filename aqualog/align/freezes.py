"""Find stretches in which a sensor repeats its last value while the car drives on.

A measured speed or torque never keeps its last digit for long. On five measured cars the longest such stretch of a
moving wheel is 0.9 s, of a torque 18 s. The check judges a signal only if it shows noise elsewhere. It therefore never
reports a coarse signal at constant speed, or one that was calculated. A standing wheel, a torque of zero, and any
torque, acceleration or yaw rate of a standing car may keep their value for any time. A wheel whose first value lasts
until a step that no wheel can make was not measured before that step: control units send zeros or a code before their
sensors are awake. Zeros of the first half second that end in one step, as `StartWatch` says, are no message either: a
locked wheel stands longer, and turns up over several samples. A speed that keeps one value through the whole log, while
another speed shows a drive, was never measured; nor was such an `a_x` beside a speed with noise. In any other channel
only one stop that is unlike the rest of the signal is reported.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from aqualog.align.glitches import is_leap
from aqualog.core.records import BoolArray, FloatArray, TimeArray

__all__ = [
    "SPEEDS", "Freeze", "FreezeWatch", "StandWatch", "StartWatch", "Stop", "Stretch", "dead_speeds", "freeze_note",
    "joined_note", "limits_of", "longest_stop", "stand_watch_of", "standing_by", "unread", "unread_note", "watch_of",
    "while_moving", "within",
]  # fmt: skip

Freeze = tuple[int, int]
"""Stamps of the last sample that counts and of the last that repeats it. [ns]"""

Stretch = tuple[int, int]
"""First and last stamp of a time at standstill. [ns]"""

SPEEDS = ("v_x", "omega_fl", "omega_fr", "omega_rl", "omega_rr")
"""Signals that show whether the car stands, the best one first."""

_SPEED = (2.0, 2.0, 0.03)  # least time [s]; speed below which a car counts as standing, coarsest step [m/s]
_TORQUE = (60.0, 0.0, np.inf)  # [s], [N*m], [N*m]
_BODY = (10.0, -1.0, np.inf)  # accelerations and yaw rate, which may stand at zero too
_OF_BODY = ("a_x", "a_y", "yaw_rate")
_MOST_BETWEEN = 0.3  # [s] mean time between two changes of a signal that is judged
_TIMES_LONGER = 20  # than that time
_LEAST_CHANGES = 50
_FINEST = 1.5  # times the finest step of a signal is still that step
_NOISE = 0.05  # least share of steps against the step before: measured speeds have 0.11 and more
_STILL = 3  # samples that repeat the first one, at least, of a sensor that is not awake yet
_GAP_NS = 1_000_000_000
_UNREAD_NS = 500_000_000  # longest time before the first message of a signal; a wheel locks for longer
_BEGIN_NS = 6_000_000_000  # by which a first message is judged: some samples of a GNSS
_AT_ONCE = 5.0  # times the largest step behind it: so far a signal leaps with its first message
# of channels of any kind
_STOP_S = 10.0
_TIMES_USUAL = 20.0
_LEAST_MOVING = 100  # changes, to know a channel by
_LIVELY = 0.2  # of the samples differ from the one before: such a signal does not stand still by itself
_SLOW = 0.02  # of the time outside
_CREEP_S = 1.0  # [s] a stop of which the car moves for less is one at rest
_STANDING = 0.5  # [m/s]
_STOPPING = 20.0  # [m/s^2] a speed that falls to zero faster is lost, and no car that stops
_SLACK = 2.0  # [m/s] of resolution and jitter; slower, wheel speed sensors may tell zero
_PAUSE_NS = 2_500_000_000  # GNSS tells its speed once a second
_AT_REST = (3, 1.0)  # more stops of so many seconds at the same value: where the signal rests (a pedal, an idle torque)


class Stop(NamedTuple):
    """A stretch in which a channel stands still: length, start [s], value.

    `moving_s`: part of it in which the car is known to move; `share`: samples outside that differ from the one before.
    """

    length_s: float
    from_s: float
    value: float
    moving_s: float
    share: float


def watch_of(name: str, r_e: float | None) -> FreezeWatch | None:
    """Return the check for a signal (`r_e` [m] of a wheel); None for signals that may keep a value."""
    if name == "v_x":
        return FreezeWatch(*_SPEED)
    if name.startswith("omega_") and r_e is not None:
        return FreezeWatch(_SPEED[0], _SPEED[1] / r_e, _SPEED[2] / r_e, r_e=r_e)
    limits = limits_of(name)
    return FreezeWatch(*limits) if limits else None


def limits_of(name: str) -> tuple[float, float, float] | None:
    """Return the limits of a signal that may keep its value while the car stands; None for other signals."""
    return _BODY if name in _OF_BODY else _TORQUE if name.startswith("torque_") else None


class FreezeWatch:
    """Check the samples of one signal, which may arrive in pieces.

    `least_s` is the shortest stretch [s], `standing` the magnitude up to which the signal may keep its value,
    `coarsest` the largest step between levels of a signal that is judged. With `r_e` [m], that of a wheel, its sensor
    may wake up late.
    """

    def __init__(self, least_s: float, standing: float, coarsest: float, *, r_e: float | None = None) -> None:
        self._least_ns, self._standing, self._coarsest = round(least_s * 1e9), standing, coarsest
        self._t: TimeArray = np.zeros(0, dtype=np.int64)  # the last sample
        self._x: FloatArray = np.zeros(0)
        self._since, self._into = 0, np.nan
        self._sign = 0.0
        self._changes = self._turns = self._moving_ns = 0
        self._smallest = np.inf
        self._r_e = r_e
        self._first_ns, self._still = 0, 0
        self._is_awake = r_e is None
        self._asleep: Freeze | None = None
        self._long: list[tuple[int, int, float, float]] = []  # with the steps that lead to and from it; NaN: not known

    def push(self, t_ns: TimeArray, x: FloatArray) -> None:
        """Take samples (n,) at strictly increasing stamps, finite."""
        from aqualog.align.lines import kept_values  # where no signal is checked, nothing is compiled

        if not t_ns.size:
            return
        if not self._t.size:
            self._since = self._first_ns = int(t_ns[0])
        t, x = (np.concatenate([self._t, t_ns]), np.concatenate([self._x, x])) if self._t.size else (t_ns, x)
        self._t, self._x = t[-1:].copy(), x[-1:].copy()
        if not self._is_awake:
            self._wake(t, x)
        limits, before = (self._standing, self._least_ns, _GAP_NS), (self._since, self._into, self._sign)
        after, counts, smallest, ends, steps = kept_values(t, x, limits, before)
        self._since, self._into, self._sign = after
        sums = self._moving_ns, self._changes, self._turns
        self._moving_ns, self._changes, self._turns = np.add(sums, counts).tolist()
        self._smallest = min(self._smallest, smallest)
        self._long += [(*a, *b) for a, b in zip(ends.tolist(), steps.tolist(), strict=True)]

    def _wake(self, t: TimeArray, x: FloatArray) -> None:
        assert self._r_e is not None
        changes = x[1:] != x[:-1]
        if not changes.any():
            self._still += changes.size
            return
        k = int(np.argmax(changes))
        self._is_awake = True
        if self._still + k >= _STILL and is_leap(np.diff(t[k : k + 2]), self._r_e * np.diff(x[k : k + 2]))[0]:
            self._asleep = self._first_ns - 1, int(t[k])

    @property
    def is_noisy(self) -> bool:
        """Whether the signal has noise of its own, so that a sensor made it."""
        return self._changes >= _LEAST_CHANGES and self._turns >= _NOISE * self._changes

    @property
    def whole(self) -> Freeze | None:
        """The whole log if the signal keeps one value in it, without a gap."""
        is_even = self._t.size > 0 and not (self._changes or self._long)
        return (self._since - 1, int(self._t[0])) if is_even else None

    def finish(self) -> tuple[Freeze, ...]:
        """List the stretches in which the signal is frozen, in order."""
        if self._asleep is None:
            return self._frozen()
        return (self._asleep, *(f for f in self._frozen() if f[0] > self._asleep[1]))

    def _frozen(self) -> tuple[Freeze, ...]:
        long = list(self._long)
        if self._t.size and self._t[0] - self._since >= self._least_ns and abs(self._x[0]) > self._standing:
            long.append((self._since, int(self._t[0]), self._into, np.nan))
        if not long or not self.is_noisy or self._smallest > self._coarsest:
            return ()
        # a coarse signal may stand by itself: it comes and goes by its finest step, a sensor that wakes up does not
        by = np.array(long)[:, 2:]
        is_own = (by <= _FINEST * self._smallest).all(axis=1)
        is_own |= is_own.any() & ((by <= _FINEST * self._smallest) | np.isnan(by)).all(axis=1)
        found = [(start, end) for (start, end, *_), own in zip(long, is_own.tolist(), strict=True) if not own]
        between = (self._moving_ns - sum(end - start for start, end in found)) / self._changes
        if between > _MOST_BETWEEN * 1e9:
            return ()
        return tuple((start, end) for start, end in found if end - start >= _TIMES_LONGER * between)


def longest_stop(t_ns: TimeArray, values: FloatArray, standing: Sequence[Stretch] = ()) -> Stop | None:
    """Return the longest stop of a channel (n,) of unknown kind that is unlike the rest of it; None without one.

    Time at standstill (`standing`) does not count. The check for known signals would take a released pedal for a dead
    sensor, so this one is stricter. The stop must last at least 10 s, at a value other than zero. Stops a twentieth as
    long must fill next to none of the time outside it (and outside stops half as long). That passes over coarse or slow
    signals, which repeat values all the time. It also passes over a value at which the signal stands again and again:
    there it rests.
    """
    steps_ns = np.diff(t_ns)
    is_moving = ~is_standing(t_ns, standing)
    moved_ns = np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(np.where(is_moving, steps_ns, 0))])
    # over a pause, or to a stamp from elsewhere, nobody has seen it stand
    longest_ns = max(_GAP_NS, 10.0 * float(np.median(steps_ns[steps_ns > 0]))) if (steps_ns > 0).any() else _GAP_NS
    same = (values[1:] == values[:-1]) & (steps_ns > 0) & (steps_ns <= longest_ns) & (values[1:] != 0.0)
    begin, end = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(np.int8))).reshape(-1, 2).T
    moving_s = (moved_ns[end] - moved_ns[begin]) * 1e-9
    lengths_s = np.where((moving_s >= _CREEP_S) | (len(standing) == 0), (t_ns[end] - t_ns[begin]) * 1e-9, 0.0)
    at = values[begin]

    def is_rest(value: float) -> bool:
        more, least_s = _AT_REST
        return int(((at == value) & (lengths_s >= least_s)).sum()) > more

    candidates = [k for k in np.flatnonzero(moving_s >= _STOP_S).tolist() if not is_rest(at[k])]
    if not candidates:
        return None
    k = max(candidates, key=lambda i: lengths_s[i])
    longest = float(lengths_s[k])
    stops = lengths_s >= longest / 2.0
    rest_s = float(t_ns[-1] - t_ns[0]) * 1e-9 - float(lengths_s[stops].sum())
    slow_s = float(lengths_s[~stops & (lengths_s >= longest / _TIMES_USUAL)].sum())
    is_judged = (values[1:] != 0.0) & is_moving
    for i in np.flatnonzero(stops).tolist():
        is_judged[begin[i] : end[i]] = False
    changes, steps = int((is_judged & ~same).sum()), int(is_judged.sum())
    if slow_s > _SLOW * rest_s or changes < max(_LEAST_MOVING, _LIVELY * steps):
        return None
    first, last = int(t_ns[begin[k]]), int(t_ns[end[k]])
    return Stop((last - first) * 1e-9, (first - int(t_ns[0])) * 1e-9, float(at[k]), float(moving_s[k]), changes / steps)


def while_moving(freezes: Sequence[Freeze], standing: Sequence[Stretch], least_s: float) -> tuple[Freeze, ...]:
    """Return the freezes that last at least `least_s` [s] without the time at standstill."""
    least_ns = round(least_s * 1e9)
    return tuple((a, b) for a, b in freezes if b - a - standing_ns(a, b, standing) >= least_ns)


def within(t_ns: TimeArray, stretches: tuple[Stretch, ...], *, has_end: bool) -> BoolArray:
    """Return which samples (n,) lie in stretches, without the first stamp of each; the last one with `has_end`."""
    out = np.zeros(t_ns.size, dtype=np.bool_)
    for start, end in stretches:
        last = np.searchsorted(t_ns, end, side="right" if has_end else "left")
        out[np.searchsorted(t_ns, start, side="right") : last] = True
    return out


def joined_note(where: str, count: int, first_ns: int, lines: tuple[Stretch, ...]) -> str:
    """Describe what was left out because no sensor made it; `first_ns` is the signal's first stamp."""
    spans = ", ".join(f"{(a - first_ns) * 1e-9:.1f} to {(b - first_ns) * 1e-9:.1f} s" for a, b in lines[:3])
    more = f" and {len(lines) - 3} more times" if len(lines) > 3 else ""
    return f"{where}: {count} samples ({spans}{more}) lie on a straight line: a gap that was filled, left out"


def freeze_note(where: str, count: int, first_ns: int, freezes: tuple[Freeze, ...]) -> str:
    """Describe what was left out because the sensor stood still; `first_ns` is the signal's first stamp."""
    longest, after = max(end - start for start, end in freezes), max(freezes[0][0] - first_ns, 0)
    return (
        f"{where}: {count} samples (first at {after * 1e-9:.2f} s) only repeat the one before, for up to "
        f"{longest * 1e-9:.1f} s; the signal is frozen there, left out"
    )


# --- zeros before the first message


class StartWatch:
    """Keep the begin of one signal, in any pieces. `scale` makes a speed m/s; None for other signals."""

    def __init__(self, scale: float | None) -> None:
        self.scale = scale
        self._t: TimeArray = np.zeros(0, dtype=np.int64)
        self._x: FloatArray = np.zeros(0)

    def push(self, t_ns: TimeArray, x: FloatArray) -> None:
        """Take samples (n,) at strictly increasing stamps, finite."""
        first = self._t[:1] if self._t.size else t_ns[:1]
        if t_ns.size and t_ns[0] <= first[0] + _BEGIN_NS:
            end = int(np.searchsorted(t_ns, first[0] + _BEGIN_NS, side="right"))
            self._t, self._x = np.concatenate([self._t, t_ns[:end]]), np.concatenate([self._x, x[:end]])

    def finish(self) -> Freeze | None:
        """Return the zeros before the first message; None without any.

        They end in one step, far larger than those that follow. A speed leaps by more than a car that starts can. A
        signal that is held on a finer grid has the time in which it is held for that.
        """
        n = int(np.argmax(self._x != 0.0)) if self._x.size else 0
        t, x = self._t[n:], self._x[n:]
        changes = np.flatnonzero(np.diff(x))
        if not n or self._t[n - 1] - self._t[0] > _UNREAD_NS or changes.size < 3:
            return None
        behind = max(int(np.searchsorted(t, t[0] + _UNREAD_NS)), int(changes[2]) + 2)
        if abs(x[0]) <= _AT_ONCE * np.abs(np.diff(x[:behind])).max():
            return None
        step_ns = max(int(t[0] - self._t[n - 1]), int(np.diff(t[changes]).min()))
        if self.scale is not None and abs(x[0]) * self.scale <= _STOPPING * step_ns * 1e-9 + _SLACK:
            return None
        return int(self._t[0]) - 1, int(self._t[n - 1])


def unread(watches: Mapping[str, StartWatch]) -> dict[str, Freeze]:
    """Return the zeros before the first message by signal. Only a speed shows by itself that they are no values."""
    found = {name: zeros for name, w in watches.items() if (zeros := w.finish()) is not None}
    return found if any(watches[name].scale is not None for name in found) else {}


def unread_note(where: str, count: int) -> str:
    """Describe what was left out because no message had come yet."""
    first = "the first sample reads" if count == 1 else f"the first {count} samples read"
    return f"{where}: {first} 0 while the car rolls: no message had come yet, left out"


# --- when the car stands: a constant value there is no evidence of a dead sensor


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
        self._first_ns = self._driving_ns = 0
        self._low, self._high = np.inf, 0.0

    def push(self, t_ns: TimeArray, x: FloatArray) -> None:
        """Take samples (n,) at strictly increasing stamps, finite."""
        if not t_ns.size:
            return
        v = np.abs(x) * self._scale
        if self._last is None:
            self._first_ns = int(t_ns[0])
        t_last, v_last = self._last or (int(t_ns[0]), float(v[0]))
        dt = np.diff(t_ns, prepend=t_last)
        self._driving_ns += int(dt[(v > _SPEED[1]) & (dt <= _PAUSE_NS)].sum())
        self._low, self._high = min(self._low, float(v.min())), max(self._high, float(v.max()))
        stands = v <= _STANDING
        self.has_moved |= not bool(stands.all())
        before = np.append(self._since is not None, stands[:-1])
        for k in np.flatnonzero((stands != before) | (dt > _PAUSE_NS)).tolist():
            is_sound = abs(v[k] - (v[k - 1] if k else v_last)) <= _STOPPING * dt[k] * 1e-9 + _SLACK
            if before[k]:
                assert self._since is not None
                if self._is_sound and (stands[k] or is_sound):  # reached and left as a car stops and starts
                    self._found.append((self._since, int(t_ns[k - 1]) if k else t_last))
                self._since = None
            if stands[k]:
                self._since, self._is_sound = int(t_ns[k]), bool(is_sound)
        self._last = int(t_ns[-1]), float(v[-1])

    def finish(self) -> tuple[Stretch, ...]:
        """List the stretches in which the car stands, in order."""
        if self._since is None or not self._is_sound or self._last is None:
            return tuple(self._found)
        return (*self._found, (self._since, self._last[0]))

    def dead_beside(self, other: StandWatch) -> Freeze | None:
        """Return the whole log if this speed keeps one value in it while the other one shows a drive."""
        if self._last is None or other._last is None or self._low < self._high:
            return None
        # the drive that the other one shows must lie in the time of this one
        is_seen = self._first_ns - _GAP_NS <= other._first_ns and other._last[0] <= self._last[0] + _GAP_NS
        is_driving = other._driving_ns >= _SPEED[0] * 1e9
        is_apart = self._high <= _STANDING or other._high - other._low > _SPEED[1]
        return (self._first_ns - 1, self._last[0]) if is_seen and is_driving and is_apart else None


def dead_speeds(watches: Mapping[str, StandWatch]) -> dict[str, Freeze]:
    """Return the speeds that were never measured: they keep one value while another one shows a drive."""
    pairs = ((name, watch.dead_beside(other)) for name, watch in watches.items() for other in watches.values())
    return {name: dead for name, dead in pairs if dead is not None}


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
