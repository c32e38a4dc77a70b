"""The motion of a drive on an even grid of 0.1 s, against which its channels are held: speed, its change, turning."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from aqualog.align.grid import linear
from aqualog.align.timebase import ClockRepair
from aqualog.core.records import Channel, FloatArray, TimeArray

__all__ = [
    "Fit", "Motion", "clean_samples", "derivative", "even_times", "fit", "on_grid", "smooth", "track", "wheel_turn",
]  # fmt: skip

GRID_NS = 100_000_000
_LONGEST_NS = 10**15  # 12 days: beyond, the time stamps jump
_LARGEST = 1e9  # in any unit: an epoch or a broken number
_WIDTH = 11  # points of the grid
_EARTH = 6.371e6  # mean radius [m]
_TRACK = 1.55  # of a car, where only the order of magnitude and the sign count [m]
_SLOW = 3.0  # below this speed a course from positions is noise [m/s]


@dataclass(frozen=True, slots=True)
class Motion:
    """What is known of the motion, each of shape (n,), NaN where it is not known.

    `grid`: stamps [ns]; `v`: speed [m/s]; `changes`: derivatives of speeds [m/s²], smoothed, the usual one first;
    `turns`: yaw rate [rad/s], left positive, smoothed, by what it was found from. `in_doubt`: the unit of a speed is.
    """

    grid: TimeArray
    v: FloatArray
    changes: tuple[FloatArray, ...]
    turns: tuple[tuple[str, FloatArray], ...] = ()
    in_doubt: bool = False


class Fit(NamedTuple):
    """How one signal follows another: correlation `r`, and the ratio of their scatter, expected over raw."""

    r: float
    factor: float


def clean_samples(channel: Channel, values: FloatArray | None = None) -> tuple[TimeArray, FloatArray]:
    """Stamps in order, and the finite values there: the channel's own, or these in place of them."""
    t, order, _ = ClockRepair().repair(channel.t_ns)
    x = (channel.values if values is None else values)[order]
    good = np.isfinite(x)
    return t[good], x[good]


def on_grid(channel: Channel, grid: TimeArray) -> FloatArray:
    """Return a channel's raw values on a grid (n,), NaN across gaps of more than 2 s and where nothing is so large."""
    t, x = clean_samples(channel)
    usable = np.abs(x) < _LARGEST
    t, x = t[usable], x[usable]
    return linear(t, x, grid, gap_ns=2_000_000_000)[0] if t.size else np.full(grid.size, np.nan)


def even_times(channel: Channel, least: int) -> TimeArray | None:
    """Stamps every 0.1 s over a channel; None if it has no more samples than `least`, or its stamps jump."""
    t, _ = clean_samples(channel)
    is_drive = t.size > least and int(t[-1]) - int(t[0]) < _LONGEST_NS
    return np.arange(t[0], t[-1], GRID_NS, dtype=np.int64) if is_drive else None


def smooth(x: FloatArray) -> FloatArray:
    """Return the mean over 1.1 s of samples (n,) on the grid; NaN at the ends, where there is less of it."""
    half = _WIDTH // 2
    if x.size < _WIDTH:
        return np.full(x.size, np.nan)
    return np.pad(np.convolve(x, np.ones(_WIDTH) / _WIDTH, mode="valid"), half, constant_values=np.nan)


def derivative(x: FloatArray) -> FloatArray:
    """Return the smoothed derivative of samples (n,) on the grid. [1/s]"""
    return smooth(np.gradient(x, GRID_NS * 1e-9)) if x.size >= _WIDTH else np.full(x.size, np.nan)


def fit(raw: FloatArray, expected: FloatArray) -> Fit:
    """Compare samples (n,) with what is expected there; NaN with less than 50 common samples or without any change."""
    good = np.isfinite(raw) & np.isfinite(expected)
    a, b = raw[good], expected[good]
    if a.size < 50 or a.std() == 0.0 or b.std() == 0.0:
        return Fit(np.nan, np.nan)
    return Fit(float(np.corrcoef(a, b)[0, 1]), float(b.std() / a.std()))


def wheel_turn(left: FloatArray, right: FloatArray) -> FloatArray:
    """Return the yaw rate from the speeds (n,) of an axle's wheels [m/s]. [rad/s]"""
    return smooth((right - left) / _TRACK)


def track(latitude: FloatArray, longitude: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return speed [m/s] and yaw rate [rad/s] along positions (n,) [deg] on the grid; the latter only when it moves."""
    north = np.gradient(np.radians(latitude), GRID_NS * 1e-9) * _EARTH
    east = np.gradient(np.radians(longitude), GRID_NS * 1e-9) * _EARTH * np.cos(np.radians(latitude))
    north, east = smooth(north), smooth(east)
    v = np.hypot(north, east)
    moves = v > _SLOW
    # the course turns by the cross product of velocity and acceleration over the square of the speed
    dn, de = np.gradient(north, GRID_NS * 1e-9), np.gradient(east, GRID_NS * 1e-9)
    turn = np.where(moves, (east * dn - north * de) / np.where(moves, v * v, 1.0), np.nan)
    return v, turn
