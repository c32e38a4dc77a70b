"""Whether a run of the straight test is one: what was driven before the crossing."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from aqualog.core.records import BoolArray, FloatArray, Signals
from aqualog.trade.lane import Span, mean_over
from aqualog.trade.limits import StraightLimits

__all__ = ["Looked", "Seen", "longest_gap", "look", "torque_fall"]

_BEFORE_S = 1.0  # [s] over which the highest torque is taken
_MEAN_S = 0.1  # [s]
_LATE_S = 0.3  # [s] by which a torque signal may come after the speed


class Looked(NamedTuple):
    """What is looked at: the lane, slip (n,) [-] and speed (n,) [m/s], the place of the crossing in samples (or of the
    highest speed without one), and the driven wheels' torque (n,) [N·m].
    """

    span: Span
    slip: FloatArray
    v: FloatArray
    stop: float
    is_crossing: bool
    torque: FloatArray


class Seen(NamedTuple):
    """Why a run is not valid, what could not be checked, mean acceleration [m/s²], the share of its time that is on
    the lane, and largest yaw rate [rad/s].
    """

    reasons: tuple[str, ...]
    notes: tuple[str, ...]
    a_x: float
    wet: float
    yaw_rate: float


def look(signals: Signals, run: Looked, limits: StraightLimits) -> Seen:
    """Check a run by itself: gaps, entry, acceleration, yaw rate, shift, torque.

    Without a crossing the throttle must stay open on the whole lane, else the highest speed is the driver's.
    """
    t, dt = signals.array("t"), signals.dt
    t_stop = float(np.interp(run.stop, np.arange(t.size), t))
    until: BoolArray = (t >= min(run.span[0], float(t[int(run.stop)]))) & (t <= t_stop)
    reasons: list[str] = []
    notes: list[str] = []
    where = f"before {limits.level}" if run.is_crossing else "before the highest speed"
    gap = longest_gap(run.slip, until) * dt
    if gap > limits.lost:
        reasons.append(f"wheel speeds are missing for {gap:.2f} s {where}")
    if run.is_crossing and (came := t_stop - run.span[0]) < limits.entry:
        why = "the car entered it too fast" if came >= -limits.dry_gap else "the wheel spun before the water"
        when = f"{abs(came):.2f} s {'after' if came >= 0.0 else 'before'} the lane began"
        reasons.append(f"{limits.level} came {when}: {why}")
    if run.is_crossing and not np.isfinite(run.v[int(run.stop) : int(run.stop) + 2]).all():
        reasons.append("the speed is missing at the crossing")
    begin = max(t_stop - limits.a_x_window, run.span[0] - limits.dry_gap - limits.dry)
    a_x = _acceleration(t, run.v, (t > begin) & (t <= t_stop))
    if math.isnan(a_x):
        reasons.append(f"the acceleration {where} is not known")
    elif a_x < limits.a_x_least:
        reasons.append(f"the acceleration {where} is {a_x:.2f} m/s²: no full throttle")
    after: BoolArray = (t > t_stop) & (t <= run.span[1])
    if not run.is_crossing and after.sum() * dt >= _LATE_S and _acceleration(t, run.v, after) < -limits.a_x_least:
        highest = 3.6 * float(np.interp(t_stop, t, run.v))
        reasons.append(f"the speed falls on the lane from {highest:.1f} km/h on: the throttle was let go")
    yaw = mean_over(signals.array("yaw_rate"), _MEAN_S, dt)[until]
    largest = float(np.nanmax(np.abs(yaw))) if np.isfinite(yaw).any() else math.nan
    if largest > limits.yaw_rate:
        reasons.append(f"the yaw rate reaches {largest:.4f} rad/s {where}, at most {limits.yaw_rate:g} allowed")
    if math.isnan(largest):
        notes.append("no yaw_rate: whether the car ran straight is not checked, and the slip is not corrected for it")
    shift = _shift(signals, t, t_stop, limits.shift)
    if shift is None:
        notes.append("no gear: shifts are not looked for")
    elif shift:
        reasons.append(f"the gear changes within {limits.shift:g} s of the crossing")
    driven = until if run.is_crossing else until | (after & (t <= t_stop + _LATE_S))
    fall = torque_fall(mean_over(run.torque, _MEAN_S, dt), driven, max(1, round(_BEFORE_S / dt)))
    if math.isnan(fall):
        notes.append("no torque of the driven wheels: whether it was cut is not checked")
    elif fall > limits.torque_cut:
        by = f"by {100 * fall:.0f} %" if fall < 1.0 else "below zero"
        gear = signals.array("gear")[driven]
        gear = gear[np.isfinite(gear)]
        why = "in a gear shift" if gear.size and np.ptp(gear) > 0.0 else "it was cut"
        reasons.append(f"the torque falls {by} within a second {where}: {why}")
    wet = min((t_stop - run.span[0]) / (t_stop - begin), 1.0) if t_stop > begin else math.nan
    return Seen(tuple(reasons), tuple(notes), a_x, wet, largest)


def longest_gap(x: FloatArray, within: BoolArray) -> int:
    """Return the largest number of samples in a row that are missing within a stretch."""
    missing = np.concatenate([[False], ~np.isfinite(x) & within, [False]]).astype(np.int8)
    edges = np.diff(missing)
    lengths = np.flatnonzero(edges == -1) - np.flatnonzero(edges == 1)
    return int(lengths.max(initial=0))


def torque_fall(torque: FloatArray, within: BoolArray, samples: int) -> float:
    """Return the largest share by which a torque (n,) [N·m] lies below its highest of so many samples before.

    Only samples of the stretch count, on both sides. NaN without a torque above 0.
    """
    x = torque[within]
    x = x[np.isfinite(x)]
    if not (x > 0.0).any():
        return math.nan
    width = min(samples, x.size)
    padded = np.concatenate([np.full(width - 1, -np.inf), x])
    highest = np.lib.stride_tricks.sliding_window_view(padded, width).max(axis=1)
    return float(np.max(1.0 - x[highest > 0.0] / highest[highest > 0.0]))


def _acceleration(t: FloatArray, v: FloatArray, inside: BoolArray) -> float:
    """Return the slope of the speed over a stretch. [m/s²] An accelerometer's offset and the grade are not in it."""
    good = inside & np.isfinite(v)
    if good.sum() < 3:
        return math.nan
    away = t[good] - t[good].mean()
    return float(away @ v[good] / (away @ away))


def _shift(signals: Signals, t: FloatArray, t_stop: float, seconds: float) -> bool | None:
    """Return whether the gear changes about a time; None without a gear."""
    gear = signals.array("gear")
    near = gear[(np.abs(t - t_stop) <= seconds) & np.isfinite(gear)]
    return None if not near.size else bool(np.ptp(near) > 0.0)
