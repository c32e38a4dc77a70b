"""Summarise a channel: rate, range, gaps, faults."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from aqualog.align.clean import span_of
from aqualog.align.timebase import ClockRepair
from aqualog.core.records import Channel, FloatArray, TimeFaults
from aqualog.core.units import is_unit, parse_unit

__all__ = ["ChannelOverview", "find_mounting", "overview", "rotated_triples"]

_G = 9.80665


@dataclass(frozen=True, slots=True)
class ChannelOverview:
    """Figures of one channel; `low`, `high`, `mean` in the channel's own unit, NaN without a finite sample."""

    file: str
    path: str
    name: str
    unit: str
    samples: int
    rate_hz: float
    start_s: float
    end_s: float
    low: float
    high: float
    mean: float
    not_finite: int
    gaps: int
    longest_gap_s: float
    faults: TimeFaults
    remark: str = ""


@np.errstate(over="ignore", invalid="ignore")
def overview(channel: Channel, *, origin_ns: int) -> ChannelOverview:
    """Summarise one channel. Times count from `origin_ns`; a gap is more than five median sample times."""
    t_ns, _, faults = ClockRepair().repair(channel.t_ns)
    finite = channel.values[np.isfinite(channel.values)]
    steps, span = np.diff(t_ns), span_of(t_ns)
    gaps = steps[steps > 5 * max(span.period_ns, 1)]
    return ChannelOverview(
        file=channel.info.file,
        path=channel.info.path,
        name=channel.info.name,
        unit=channel.info.unit,
        samples=channel.values.size,
        rate_hz=span.rate_hz,
        start_s=float(t_ns[0] - origin_ns) * 1e-9 if t_ns.size else np.nan,
        end_s=float(t_ns[-1] - origin_ns) * 1e-9 if t_ns.size else np.nan,
        low=float(finite.min()) if finite.size else np.nan,
        high=float(finite.max()) if finite.size else np.nan,
        mean=float(finite.mean()) if finite.size else np.nan,
        not_finite=int(channel.values.size - finite.size),
        gaps=int(gaps.size),
        longest_gap_s=float(gaps.max()) * 1e-9 if gaps.size else 0.0,
        faults=faults,
        remark=_remark(channel, finite),
    )


def _remark(channel: Channel, finite: FloatArray) -> str:
    if finite.size == 0:
        return "no value"
    if finite.size > 10 and finite.min() == finite.max():
        return "constant"
    top = finite.max()
    is_last = top >= 511 and float(top + 1).is_integer() and (int(top) + 1) & int(top) == 0
    is_code = is_last and finite.size > 10 and (finite == top).mean() < 0.2
    # the last but one of a width is a code, too, where nothing comes near it: a measured value climbs there
    is_next = top >= 510 and float(top).is_integer() and (int(top) + 2) & (int(top) + 1) == 0
    if is_next and 3 <= (finite == top).sum() < 0.2 * finite.size:
        is_code = is_code or finite[finite < top].max() < 0.8 * top
    if is_code:
        return f"{top:.0f} looks like an error code: invalid = [{top:.0f}] in the map"
    if finite.size > 100:
        inner_low, inner_high = np.percentile(finite, (1.0, 99.0))
        reach = 3.0 * (inner_high - inner_low)
        for value, is_far in ((finite.min(), finite.min() < inner_low - reach), (top, top > inner_high + reach)):
            if is_far and abs(value) > 3.0 and (finite == value).sum() >= 3:
                return f"{value:g} stands apart, perhaps a code: invalid = [{value:g}] in the map"
    return ""


def find_mounting(found: Sequence[ChannelOverview]) -> list[str]:
    """Return sentences on three-axis accelerometers whose vertical is not z.

    Gravity shows how a sensor is mounted. On a car whose sensor stands upright, the mean of z is about 1 g and the
    means of x and y are small.
    """
    sentences = []
    for stem, axes in _triples(found).items():
        mean, down, tilt = _gravity(axes)
        if down is None:
            continue
        listed = ", ".join(f"{a} {mean[a]:+.2f}" for a in "xyz")
        if down != "z":
            sentences.append(
                f"{stem}: gravity is on {down} (mean {listed} m/s²), so the sensor is mounted rotated; its axes are "
                f"not the car's: {down} is vertical and carries no driving acceleration"
            )
        elif tilt > 3.0:
            sentences.append(f"{stem}: tilted by {tilt:.0f} deg (mean {listed} m/s²); x and y hold part of gravity")
    return sentences


def rotated_triples(found: Iterable[ChannelOverview]) -> list[tuple[dict[str, ChannelOverview], str]]:
    """Return the axes of each accelerometer whose vertical is not z, and the one that points up, such as `-x`."""
    triples = []
    for axes in _triples(found).values():
        mean, down, _ = _gravity(axes)
        if down in ("x", "y"):
            triples.append((axes, f"{'-' if mean[down] < 0.0 else ''}{down}"))  # at rest it measures 1 g upwards
    return triples


def _gravity(axes: dict[str, ChannelOverview]) -> tuple[dict[str, float], str | None, float]:
    """Return the mean of each axis [m/s²], the axis with gravity (None if the sum is not 1 g), tilt from it [deg]."""
    factor = _acceleration_factor(axes["x"].unit)
    mean = {a: axes[a].mean * factor for a in "xyz"}
    total = float(np.sqrt(sum(v * v for v in mean.values())))
    if not 0.8 * _G < total < 1.2 * _G:
        return mean, None, 0.0
    down = max(mean, key=lambda a: abs(mean[a]))
    return mean, down, float(np.degrees(np.arccos(min(abs(mean[down]) / total, 1.0))))


def _triples(found: Iterable[ChannelOverview]) -> dict[str, dict[str, ChannelOverview]]:
    groups: dict[str, dict[str, ChannelOverview]] = {}
    for channel in found:
        axis = channel.name[-1:].lower()
        if axis in "xyz" and axis and _acceleration_factor(channel.unit) > 0 and np.isfinite(channel.mean):
            groups.setdefault(f"{channel.file}:{channel.path[:-1]}*", {})[axis] = channel
    return {stem: axes for stem, axes in groups.items() if len(axes) == 3}


def _acceleration_factor(unit: str) -> float:
    if not is_unit(unit) or parse_unit(unit).dimension != "acceleration":
        return 0.0
    return parse_unit(unit).factor
