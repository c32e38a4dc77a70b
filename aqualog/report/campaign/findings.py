"""Regressions on a campaign's page: curves over speed per configuration, and speeds of full aquaplaning."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

from aqualog.campaign.bins import DEPTH_KEYS, Group, Plan, group_of
from aqualog.campaign.full_speed import FullSpeed, full_speeds
from aqualog.campaign.means import MeanRow, ResistanceTable, resistances
from aqualog.campaign.results import CampaignData
from aqualog.campaign.slip_slope import SlopeRow, SlopeTable, slip_slopes
from aqualog.core.intervals import NOWHERE, Interval
from aqualog.report.values import KMH

__all__ = [
    "Crossing", "Curve", "Findings", "Point", "crossing", "find", "groups_of", "resistance_curves", "slope_curves",
]  # fmt: skip

Report = Callable[[str], None]
_Row = TypeVar("_Row", SlopeRow, MeanRow)


@dataclass(frozen=True, slots=True)
class Point:
    """One speed bin. `value` is NaN where no estimate exists, and `reason` states why; `reliable`: `ci` exists too."""

    low_kmh: float
    high_kmh: float
    v_kmh: float
    value: float
    ci: Interval
    runs: int
    samples: int
    reliable: bool
    reason: str
    expected: float = math.nan


@dataclass(frozen=True, slots=True)
class Curve:
    """Values of one configuration at one place (wheel, side; empty: the car), by speed; `dry` level with interval."""

    group: Group
    place: str
    points: tuple[Point, ...]
    dry: float = math.nan
    dry_ci: Interval = NOWHERE
    dry_runs: int = 0

    @property
    def told(self) -> bool:
        """Whether any bin has a value."""
        return any(math.isfinite(p.value) for p in self.points)


@dataclass(frozen=True, slots=True)
class Findings:
    """Results of all regressions. `groups`: configurations of all runs, in order; `left_out`: samples by reason, per
    kind of regression; `notes`: remarks on the regressions for the reader; `dry`: resistance on dry road, of a campaign
    without water alone.
    """

    plan: Plan
    groups: tuple[Group, ...]
    slopes: tuple[Curve, ...] = ()
    resistance: tuple[Curve, ...] = ()
    full: tuple[FullSpeed, ...] = ()
    left_out: Mapping[str, Mapping[str, int]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    robust: bool = False
    dry: tuple[Curve, ...] = ()


def find(data: CampaignData, plan: Plan, *, robust: bool = False, report: Report = lambda _: None) -> Findings:
    """Run the regressions of a campaign.

    Parameters
    ----------
    data : CampaignData
    plan : Plan
        Configurations and bins.
    robust : bool
        Use Huber's weights [huber1981].
    report : callable
        Called with the name of each step.
    """
    report("slip slopes")
    slopes = slip_slopes(data, plan, robust=robust)
    report("resistance")
    resistance = resistances(data, plan, robust=robust)
    dry: tuple[Curve, ...] = ()
    if not any(r.road == "wet" for r in resistance.rows):
        dry = resistance_curves(resistances(data, replace(plan, road="dry"), robust=robust), "dry")
    groups = groups_of(data, plan.keys)
    report("speeds of full aquaplaning")
    notes = [
        f"{d.vehicle}: v_x is {1e3 * d.value:+.0f} ms later than the wheels (95 %: {1e3 * d.ci[0]:+.0f} … "
        f"{1e3 * d.ci[1]:+.0f} ms); every slip is corrected for it"
        if d.told else f"{d.vehicle}: delay of v_x not available ({d.reason})"
        for d in sorted(slopes.delays, key=lambda d: not d.told)
    ]  # fmt: skip
    return Findings(
        plan,
        groups,
        slope_curves(slopes),
        resistance_curves(resistance),
        full_speeds(data, plan, slopes),
        {"slip slope": slopes.left_out, "resistance": resistance.left_out},
        tuple(notes),
        robust,
        _among(dry, groups),
    )


def _among(dry: Sequence[Curve], groups: Sequence[Group]) -> tuple[Curve, ...]:
    """Curves on dry road, which know no depth, each under the first configuration that is its own but for that."""
    bare = {g: tuple(kv for kv in g if kv[0] not in DEPTH_KEYS) for g in reversed(groups)}
    own = {b: g for g, b in bare.items()}
    return tuple(replace(c, group=own[c.group]) for c in dry if c.group in own)


def groups_of(data: CampaignData, keys: Sequence[str]) -> tuple[Group, ...]:
    """Configurations of all runs, sorted: numbers, then texts, then missing values."""

    def rank(value: float | str | None) -> tuple[int, float, str]:
        if value is None:
            return 2, 0.0, ""
        return (1, 0.0, value) if isinstance(value, str) else (0, value, "")

    return tuple(sorted({group_of(info.run, keys) for info in data.runs}, key=lambda g: [rank(v) for _, v in g]))


def slope_curves(table: SlopeTable) -> tuple[Curve, ...]:
    """Rows on water as curves, each with the dry level of its configuration."""
    return tuple(
        Curve(
            group, place, tuple(_point(r, r.slope, r.slope_ci, r.expected.slope) for r in own), own[0].slope_dry,
            own[0].slope_dry_ci, own[0].runs_dry,
        )
        for (group, place), own in _on_road(table.rows, lambda r: r.wheel).items()
    )  # fmt: skip


def resistance_curves(table: ResistanceTable, road: str = "wet") -> tuple[Curve, ...]:
    """Rows on one road as curves."""
    return tuple(
        Curve(group, place, tuple(_point(r, r.value, r.ci) for r in own))
        for (group, place), own in _on_road(table.rows, lambda r: r.place, road).items()
    )


def _on_road(
    rows: Sequence[_Row], place_of: Callable[[_Row], str], road: str = "wet"
) -> dict[tuple[Group, str], list[_Row]]:
    found: dict[tuple[Group, str], list[_Row]] = {}
    for r in rows:
        if r.road == road:
            found.setdefault((r.group, place_of(r)), []).append(r)
    return found


def _point(r: SlopeRow | MeanRow, value: float, ci: Interval, expected: float = math.nan) -> Point:
    # an empty bin has no mean speed, but a middle
    v_kmh = KMH * r.v_mean if math.isfinite(r.v_mean) else 0.5 * (r.low_kmh + r.high_kmh)
    return Point(r.low_kmh, r.high_kmh, v_kmh, value, ci, r.runs, r.samples, r.reliable, r.reason, expected)


# --- where a curve passes a level ------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Crossing:
    """`v_kmh` where the level is passed for the first time, NaN if it is not; `ci` where the ends of the band pass it
    (an end that does not is infinite). `to_kmh`: speed up to which there are values.
    """

    v_kmh: float
    ci: tuple[float, float]
    to_kmh: float


def crossing(curve: Curve, level: float, *, rising: bool) -> Crossing | None:
    """Interpolate linearly between the bins that have an interval; None with fewer than two of them.

    Parameters
    ----------
    curve : Curve
    level : float
        In the unit of the curve.
    rising : bool
        Whether the level is passed from below.
    """
    points = [p for p in curve.points if p.reliable]
    if len(points) < 2:
        return None
    # the end of the band that passes first gives the lower speed
    first, last = (1, 0) if rising else (0, 1)
    low = _passed(points, [p.ci[first] for p in points], level, rising=rising)
    high = _passed(points, [p.ci[last] for p in points], level, rising=rising)
    middle = _passed(points, [p.value for p in points], level, rising=rising)
    begin = points[0].v_kmh
    return Crossing(
        middle, (-math.inf if low == begin else low, math.inf if math.isnan(high) else high), points[-1].v_kmh
    )


def _passed(points: Sequence[Point], values: Sequence[float], level: float, *, rising: bool) -> float:
    """Speed at which values reach the level; the first point's if they have already; NaN if they do not."""
    sign = 1.0 if rising else -1.0
    above = [sign * (v - level) for v in values]
    if above[0] >= 0.0:
        return points[0].v_kmh
    for i in range(1, len(above)):
        if above[i] >= 0.0:
            share = above[i - 1] / (above[i - 1] - above[i])
            return points[i - 1].v_kmh + share * (points[i].v_kmh - points[i - 1].v_kmh)
    return math.nan
