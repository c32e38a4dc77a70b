"""Offsets: what accelerometers and gyro show while the car stands."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from aqualog.checks.doubts import Change, Doubt
from aqualog.checks.windows import Windows
from aqualog.core.intervals import half_width
from aqualog.core.records import BoolArray, FloatArray

__all__ = ["OFFSETS", "Offset", "offset_doubts", "offsets"]

STILL = 0.1  # [m/s] wheels; GNSS needs three times that
STILL_GNSS = 0.3
EDGE = 2  # windows at either end of a stop in which the car still rocks
LEAST_S = 2.0  # [s] of a stop
APART = 50.0  # [m] driven between two stops at different places
PRIOR = 4.0  # stops that the usual slope counts as
MOVED = 5.0  # [m/s] a speed that never gets there shows no stop
LEAST_MOVED_S = 20.0
MOST_ACCELERATION = 3.0  # [m/s^2] a sensor that is mounted 18 deg off level
MOST_YAW_RATE = 0.1  # [rad/s] 6 deg/s: twice what data sheets of car gyros allow (K)


@dataclass(frozen=True, slots=True)
class _Kind:
    """`usual`: how stops differ, one standard deviation; `noted`: an offset surely beyond is reported; `digits`.

    `most`: what no offset of such a sensor reaches; a mean beyond is another unit or another channel.
    """

    usual: float
    noted: float
    most: float
    unit: str
    digits: int
    because: str


OFFSETS = {
    # the slope of the places where cars stop: 2.5 %; more than 3 % on average is no slope any more
    "a_x": _Kind(0.25, 0.3, MOST_ACCELERATION, "m/s²", 2, "the slope of the road is in the interval"),
    # 2.5 % more: the crown of a road is on the same side at every stop
    "a_y": _Kind(0.25, 0.55, MOST_ACCELERATION, "m/s²", 2, "the crossfall of the road is in the interval"),
    # 0.6 deg/s: at 30 m/s as much lateral acceleration as the offset of a_y that counts
    "yaw_rate": _Kind(0.002, 0.01, MOST_YAW_RATE, "rad/s", 4, ""),
}
"""Signals that are zero at standstill on level ground."""


@dataclass(frozen=True, slots=True)
class Offset:
    """Mean of a signal over the stops of a drive, with its 95 % interval, SI; `seconds` [s] at `stops` places."""

    symbol: str
    value: float
    ci95: tuple[float, float]
    seconds: float
    stops: int

    @property
    def counts(self) -> bool:
        """Whether it surely is beyond what does no harm."""
        low, high = self.ci95
        noted = OFFSETS[self.symbol].noted
        return (low > noted or high < -noted) and not self.is_absurd

    @property
    def is_absurd(self) -> bool:
        """Whether no sensor has it: it shows another unit or another channel."""
        return abs(self.value) > OFFSETS[self.symbol].most


def offsets(windows: Windows) -> list[Offset]:
    """Return the offset of each signal of `OFFSETS`; none without a stop.

    Stops differ by the slope of their place. With k of them its variance is that of `usual`, counted as four stops,
    and of the k together; the interval is Student's.
    """
    places, seconds = _places(windows)
    found = []
    for symbol, kind in OFFSETS.items():
        if symbol not in windows or not places:
            continue
        x = windows[symbol]
        means = np.array([m for own in places if math.isfinite(m := _mean(x[own]))])
        if not means.size:
            continue
        dof = PRIOR + means.size - 1.0
        variance = (PRIOR * kind.usual**2 + float(((means - means.mean()) ** 2).sum())) / dof
        half = half_width(math.sqrt(variance / means.size), dof)
        value = float(means.mean())
        found.append(Offset(symbol, value, (value - half, value + half), seconds, means.size))
    return found


def offset_doubts(windows: Windows) -> Iterator[Doubt]:
    """Yield the offsets that count, and means that are no offset: of the kind `channel`."""
    found = offsets(windows)
    if not any((o.counts or o.is_absurd) and o.symbol != "a_x" for o in found):
        yield from _apart(windows)
    for o in found:
        kind = OFFSETS[o.symbol]
        if o.is_absurd:
            what = f"{o.symbol} shows {o.value:+.{kind.digits}f} {kind.unit} at standstill; no sensor is so far off"
            advice = f"check its channel and unit in the signal map (an offset is at most {kind.most:g} {kind.unit})"
            yield Doubt("channel", (o.symbol,), what, advice, value=o.value, ci95=o.ci95)
        if not o.counts:
            continue
        value, low, high = (f"{x:+.{kind.digits}f}" for x in (o.value, *o.ci95))
        places = "place" if o.stops == 1 else "places"
        what = (
            f"{o.symbol} shows {value} {kind.unit} at standstill (95 % {low} to {high}; {o.seconds:.0f} s at {o.stops} "
            f"{places}{'; ' + kind.because if kind.because else ''})"
        )
        change = Change(offset=round(o.value, kind.digits))
        yield Doubt("offset", (o.symbol,), what, ways=({o.symbol: change},), value=o.value, ci95=o.ci95)


def _apart(windows: Windows) -> Iterator[Doubt]:
    """Yield `a_y` and `yaw_rate` that lie further apart than a car can slide sideways, without a stop too."""
    if not windows.speed.size or "a_y" not in windows or "yaw_rate" not in windows:
        return
    with np.errstate(invalid="ignore"):
        apart = (windows["a_y"] - windows.speed * windows["yaw_rate"])[windows.speed > MOVED]
    apart = apart[np.isfinite(apart)]
    value = float(np.median(apart)) if apart.size * windows.step_s >= LEAST_MOVED_S else 0.0
    if abs(value) > MOST_ACCELERATION:
        what = f"a_y lies {value:+.1f} m/s² from yaw_rate times v in the middle of the drive; no car slides like that"
        advice = "check channel, unit, sign and offset of both in the signal map, unless all of it was on a steep bank"
        yield Doubt("channel", ("a_y", "yaw_rate"), what, advice, value=value)


def _mean(x: FloatArray) -> float:
    known = x[np.isfinite(x)]
    return float(known.mean()) if known.size else math.nan


def _places(windows: Windows) -> tuple[list[FloatArray], float]:
    """Return the windows of the stops, by place, and how long they are together. [s]"""
    speed, step = windows.speed, windows.step_s
    limit = STILL if windows.wheels else STILL_GNSS
    with np.errstate(invalid="ignore"):
        moves = int((speed > MOVED).sum()) * step
        still: BoolArray = np.abs(speed) < limit
    if moves < LEAST_MOVED_S:
        return [], 0.0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(np.int8)))
    way = np.concatenate([[0.0], np.cumsum(np.where(np.isfinite(speed), speed, 0.0) * step)])
    places: list[FloatArray] = []
    last = -math.inf
    seconds = 0.0
    for start, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        first, after = start + EDGE * (start > 0), end - EDGE * (end < speed.size)
        if (after - first) * step < LEAST_S:
            continue
        own = np.arange(first, after)
        if places and way[start] - last < APART:
            places[-1] = np.concatenate([places[-1], own])
        else:
            places.append(own)
        last = float(way[end])
        seconds += own.size * step
    return places, seconds
