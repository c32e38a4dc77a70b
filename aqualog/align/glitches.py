"""Find samples that no car can produce: dropouts of a speed, spikes of a wheel, of the body or of the steering."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from aqualog.core.records import BoolArray, FloatArray, TimeArray

__all__ = [
    "KNOWN_NS", "RETURN_NS", "RIM_LIMIT", "Glitches", "Leap", "glitches_of", "is_leap", "lost_speed",
    "sensor_glitches", "spikes",
]  # fmt: skip

RIM_LIMIT = 400.0  # [m/s^2] at the rim; a locking wheel reaches 100, a spin-down in full aquaplaning 50
_SLACK = 1.0  # [m/s] at the rim: resolution and stamps that jitter
RETURN_NS = 1_000_000_000
_AHEAD_NS = 500_000_000  # behind a leap, by which its stamps are judged
KNOWN_NS = RETURN_NS + _AHEAD_NS
"""Time that must be known behind a sample to judge it; before it two samples suffice."""
_BURST = 0.3  # of the usual sample time: stamps that are closer came from a buffer
_LATE_NS = 200_000_000  # by which stamps of a burst may be off
_STANDS = 10  # samples of one value, at least, that are no slow signal's
_SPIKE_NS = 150_000_000  # longest spike; a blow is over in less, and a car that brakes takes longer
_STOPPING = 20.0  # [m/s^2] a speed that falls to zero faster is lost, and no car that stops
_STANDS_BELOW = 2.0  # [m/s] speeds that receivers and control units may tell as zero


class Leap(NamedTuple):
    """Limits of a car: no change by more than `step` + `rate` [1/s] x sample time that comes `back` as near as that.

    In the signal's unit.
    """

    rate: float
    step: float
    back: float


# five measured cars step by 9.5 m/s^2 from sample to sample at most (a phone's, 100 Hz), else by 4.3
_ACCELERATION = Leap(50.0, 12.0, 4.0)
# a car on a race track: 5.6 rad/s^2; 9.2 rad/s at the steering wheel
_YAW = Leap(20.0, 0.4, 0.2)
_STEERING = Leap(3.0, 0.1, 0.05)
_RATIO = 15.0  # of steering wheel to road wheels, about
_LEAPS = {
    "a_x": _ACCELERATION,
    "a_y": _ACCELERATION,
    "yaw_rate": _YAW,
    "steer_angle": _STEERING,
    "steering_wheel_angle": Leap(*(_RATIO * x for x in _STEERING)),
}


class Glitches(NamedTuple):
    """How to find the glitches of a signal, from stamps (n,) [ns] and samples (n,), and the note on them."""

    find: Callable[[TimeArray, FloatArray], BoolArray]
    what: str


def glitches_of(name: str, r_e: float | None) -> Glitches | None:
    """Return the check for a signal, with the effective radius [m] of a wheel; None for signals that may leap."""
    if name.startswith("omega_") and r_e is not None:
        return Glitches(
            partial(sensor_glitches, r_e=r_e), "step faster than a wheel can; sensor dropouts or spikes, left out"
        )
    if name in _LEAPS:
        find = partial(spikes, leap=_LEAPS[name])
        return Glitches(find, "leap from what is before and behind them as no car can; spikes, left out")
    if name == "v_x":
        return Glitches(lost_speed, "are zero at once, as no car stops; dropouts, left out")
    return None


def sensor_glitches(t_ns: TimeArray, omega: FloatArray, *, r_e: float) -> BoolArray:
    """Flag samples of a wheel speed that the wheel did not make.

    Of finite samples (n,) [rad/s] at strictly increasing stamps (n,), and the effective radius [m].

    Returns
    -------
    bool array (n,)
        From a step faster than `RIM_LIMIT` to the step back within 1 s. Without a step back: as long as the signal
        stands at exactly zero (a dead sensor) or, for 1 s or more, at any one value (a code for "no value"). A leap
        between moving values does not count if its stamps are of a burst, or if neighbouring samples were lost.
    """
    glitch = np.zeros(omega.size, dtype=bool)
    if omega.size < 3:
        return glitch
    v = omega * r_e
    jumps = [i for i in _jumps(t_ns, v, RIM_LIMIT, _SLACK) if not _is_of_the_stamps(t_ns, v, i)]
    done = -1
    for position, i in enumerate(jumps):
        if i < done:
            continue
        back = next(
            (
                j
                for j in _soon_after(jumps, position, t_ns, RETURN_NS)
                if abs(v[j + 1] - v[i]) <= RIM_LIMIT * 0.25 * float(t_ns[j + 1] - t_ns[i]) * 1e-9 + _SLACK
            ),
            None,
        )
        if back is not None:
            glitch[i + 1 : back + 1] = True
            done = back + 1
        elif omega[i + 1] == 0.0 or _is_code(t_ns, omega, i + 1):
            moving = np.flatnonzero(omega[i + 1 :] != omega[i + 1])
            end = i + 1 + (int(moving[0]) if moving.size else omega.size)
            glitch[i + 1 : end] = True
            done = end
    return glitch


def spikes(t_ns: TimeArray, x: FloatArray, *, leap: Leap = _ACCELERATION) -> BoolArray:
    """Flag samples of an acceleration, a yaw rate or a steering angle that the car did not make.

    Of finite samples (n,) at strictly increasing stamps (n,), by the limits of a car in their unit; default those of an
    acceleration [m/s²]. Returns bool (n,), true from a step that no car makes to the step back, within 150 ms.
    """
    spike = np.zeros(x.size, dtype=np.bool_)
    if x.size < 3:
        return spike
    jumps = _jumps(t_ns, x, leap.rate, leap.step)
    done = -1
    for position, i in enumerate(jumps):
        if i < done:
            continue
        for j in _soon_after(jumps, position, t_ns, _SPIKE_NS):
            if abs(x[j + 1] - x[i]) <= leap.back:
                spike[i + 1 : j + 1] = True
                done = j + 1
                break
    return spike


def _jumps(t_ns: TimeArray, x: FloatArray, rate: float, step: float) -> list[int]:
    """Return the samples (n,) behind which x changes by more than `rate` [1/s] x sample time + `step`."""
    dt_ns, dx = np.diff(t_ns), np.diff(x)
    if max(np.fmax.reduce(dx), -np.fmin.reduce(dx)) <= rate * dt_ns.min() * 1e-9 + step:  # as in most signals
        return []
    return np.flatnonzero(np.abs(dx) > rate * dt_ns * 1e-9 + step).tolist()


def _soon_after(jumps: Sequence[int], position: int, t_ns: TimeArray, span_ns: int) -> Iterator[int]:
    """Return the jumps after one of them, up to so much later: a sensor that shakes has very many."""
    for k in range(position + 1, len(jumps)):
        if t_ns[jumps[k]] - t_ns[jumps[position]] > span_ns:
            return
        yield jumps[k]


def lost_speed(t_ns: TimeArray, v: FloatArray) -> BoolArray:
    """Flag samples of a reference speed that are zero because the reference was lost.

    Of finite samples (n,) [m/s] at strictly increasing stamps (n,). Returns bool (n,), true in stretches of exactly
    zero into which it falls faster than a car stops. A zero is kept if the value before it was a repeated one: a slow
    signal is held there on a finer grid, and the rate of its fall is unknown.
    """
    lost = np.zeros(v.size, dtype=np.bool_)
    if v.size < 2:
        return lost
    is_zero = v[1:] == 0.0
    if not is_zero.any():
        return lost
    is_live = np.append(True, v[1:-1] != v[:-2])
    falls = is_zero & is_live & (np.abs(v[:-1]) > _STOPPING * np.diff(t_ns) * 1e-9 + _STANDS_BELOW)
    ends = np.append(np.flatnonzero(v != 0.0), v.size)
    for i in np.flatnonzero(falls).tolist():
        lost[i + 1 : ends[np.searchsorted(ends, i + 1)]] = True
    return lost


def is_leap(dt_ns: TimeArray, dv: FloatArray) -> BoolArray:
    """Flag steps (n,) of a wheel's speed [m/s at the rim] that no wheel can make in their time [ns]."""
    return np.abs(dv) > RIM_LIMIT * dt_ns * 1e-9 + _SLACK


def _is_of_the_stamps(t_ns: TimeArray, v: FloatArray, i: int) -> bool:
    """Return whether the leap behind sample `i` comes from the stamps and not from the wheel.

    A buffer that is read late gives its samples stamps that are too close. Of doubled stamps the last sample counts, so
    that it is early by the length of the hole behind it. A wheel under ABS also leaps in such a time. A signal that
    stands at one value, or at zero, on a side of the leap is a dropout all the same.
    """
    if v[i] == 0.0 or v[i + 1] == 0.0 or (i and v[i - 1] == v[i]) or (i + 2 < v.size and v[i + 2] == v[i + 1]):
        return False
    ahead = np.diff(t_ns[i + 1 : int(np.searchsorted(t_ns, t_ns[i + 1] + _AHEAD_NS)) + 1])
    if not ahead.size:
        return False
    own = int(t_ns[i + 1] - t_ns[i])
    late = _LATE_NS if own < _BURST * float(np.median(ahead)) else min(int(ahead[0]), _LATE_NS)
    return late > 1.5 * own and not bool(is_leap(np.array([own + late]), v[i + 1 : i + 2] - v[i])[0])


def _is_code(t_ns: TimeArray, omega: FloatArray, start: int) -> bool:
    """Return whether the signal stands at one value from a sample on until 1 s later."""
    end = int(np.searchsorted(t_ns, t_ns[start] + RETURN_NS, side="left"))
    return end < t_ns.size and end - start >= _STANDS and bool((omega[start : end + 1] == omega[start]).all())
