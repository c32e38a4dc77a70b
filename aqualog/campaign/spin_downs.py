"""Minor spin-downs over speed: how often, in how many passes, how deep."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from aqualog.campaign.bins import KMH, Group, Plan, free_of, group_of, sort_key
from aqualog.campaign.results import SETTLING_S, CampaignData, RunInfo
from aqualog.core.intervals import Interval, poisson, wilson, worth
from aqualog.core.records import FloatArray

__all__ = ["Pass", "SpinDownRow", "minor_spin_downs", "passes"]

LEAST_S = 0.5  # [s] on the lane that count as a pass
SETTLED_S = 1.0  # [s] on the lane, from which on the margin has seen the water
Z90 = 1.644854  # 95 % quantile of the normal distribution
SWEPT = 2.0 * KMH  # [m/s] slower than an event, as far as a speed that is held varies
FULL_SLIP = -0.5  # [-] a wheel that has lost half of its speed floats; smaller dips recover by themselves


@dataclass(frozen=True, slots=True)
class Pass:
    """One run over the watered lane: samples `step_s` apart of the speed `v` (m,) [m/s] and of the `slip` (m,), rim
    against car, of each free wheel. Speeds [m/s] at which a wheel began a `minor` spin-down there, and at which it had
    lost half of its own in a `full` one that its detector found (the first; empty without). `foretold`: logarithm of
    the speed of full aquaplaning [ln(m/s)] that the margin expects, and its standard deviation, means over the lane
    from `SETTLED_S` on; NaN without one.
    """

    info: RunInfo
    step_s: float
    v: FloatArray
    slip: Mapping[str, FloatArray]
    minor: Mapping[str, tuple[float, ...]]
    full: Mapping[str, tuple[float, ...]]
    foretold: tuple[float, float] = (math.nan, math.nan)

    @property
    def v_mean(self) -> float:
        """Mean speed. [m/s]"""
        return float(self.v.mean())

    @property
    def v_held(self) -> float:
        """Speed that the pass had or exceeded for half a second. [m/s]"""
        return float(np.sort(self.v)[-min(math.ceil(LEAST_S / self.step_s), self.v.size)])

    def went_without(self, v: float) -> bool:
        """Whether the pass was slower than `v` [m/s] by `SWEPT` for half a second before it first came to v.

        Where an event begins at v, the pass shows that slower speeds do without it.
        """
        before = self.v[: int(np.argmax(self.v >= v))] if (self.v >= v).any() else self.v
        return int((before <= v - SWEPT).sum()) >= math.ceil(LEAST_S / self.step_s)

    @property
    def seconds(self) -> float:
        """Time from entry to exit. [s]"""
        return self.v.size * self.step_s + 2.0 * SETTLING_S

    @property
    def deepest(self) -> dict[str, float]:
        """Deepest slip of each free wheel. [-]"""
        return {w: float(np.nanmin(x)) if np.isfinite(x).any() else math.nan for w, x in self.slip.items()}


@dataclass(frozen=True, slots=True)
class SpinDownRow:
    """A bin of speed: `passes` that were in it for half a second, or had an event there, `events` of minor spin-downs
    begun in it, `per_s` and `per_100_m` with `per_s_ci` (exact Poisson [garwood1936], of as many events as those of the
    passes are `worth`; with one pass as if each came alone), `share` of the passes with at least one (Wilson
    [wilson1927]), passes with a `full` spin-down in it, in which minor ones have no place,
    `deepest` slip: median of the passes' deepest in it [-].
    """

    group: Group
    wheel: str
    low_kmh: float
    high_kmh: float
    passes: int
    seconds: float
    events: int
    per_s: float
    per_s_ci: Interval
    per_100_m: float
    share: float
    share_ci: Interval
    full: int
    deepest: float


def passes(data: CampaignData) -> list[Pass]:
    """All runs with at least half a second on the lane, of cars whose free wheels are known."""
    found = []
    for info in (i for i in data.done if i.vehicle.knows_drivetrain):
        samples = data.samples(info)
        wet = (samples.on_water == 1.0) & np.isfinite(samples.array("v_x"))
        if np.count_nonzero(wet) * samples.step_s < LEAST_S:
            continue
        v, t = samples.array("v_x")[wet], samples.t[wet]
        # with what has not settled yet: fast wheels slow down at once
        start, end = float(t[0]) - SETTLING_S - samples.step_s, float(t[-1]) + SETTLING_S
        slip = {w: samples.array(f"slip_min_{w}")[wet] for w in free_of(info)}
        minor, downs = (
            {w: [e["start_s"] for e in info.events
                 if e["detector"] == d and e["wheel"] == w and start <= e["start_s"] <= end] for w in slip}
            for d in ("minor_spin_down", "spin_down")
        )  # fmt: skip
        full = {w: v[x <= FULL_SLIP][:1].tolist() if downs[w] else [] for w, x in slip.items()}
        settled = wet & (samples.t >= float(t[0]) + SETTLED_S)
        foretold = _foretold(*(samples.array(f"v_full{end}")[settled] for end in ("", "_low", "_high")))
        found.append(Pass(
            info, samples.step_s, v, slip, {w: tuple(np.interp(at, t, v).tolist()) for w, at in minor.items()},
            {w: tuple(x) for w, x in full.items()}, foretold,
        ))  # fmt: skip
    return found


def _foretold(v_full: FloatArray, low: FloatArray, high: FloatArray) -> tuple[float, float]:
    known = np.isfinite(v_full) & (low > 0.0) & np.isfinite(high)
    if not known.any():
        return math.nan, math.nan
    spread = np.log(high[known] / low[known]) / (2.0 * Z90)
    return float(np.log(v_full[known]).mean()), float(spread.mean())


def minor_spin_downs(data: CampaignData, plan: Plan) -> tuple[SpinDownRow, ...]:
    """Rows per configuration, free wheel and bin of the speed that it had. Thesis: Figs 2.3 and 2.4 (C14 to C19)."""
    members: dict[tuple[Group, str, int], list[_Part]] = {}
    width = plan.width_kmh * KMH
    for p in passes(data):
        number = (p.v // width).astype(int)
        for wheel, x in p.slip.items():
            minor, full = ([int(v // width) for v in of[wheel]] for of in (p.minor, p.full))
            for n in {*number.tolist(), *minor, *full}:
                own = number == n
                seconds = float(own.sum() * p.step_s + SETTLING_S * (int(own[0]) + int(own[-1])))
                if seconds >= LEAST_S or n in minor or n in full:
                    v = float(p.v[own].mean()) if own.any() else 0.0
                    deepest = float(np.nanmin(x[own])) if np.isfinite(x[own]).any() else math.nan
                    part = _Part(seconds, v * seconds, minor.count(n), n in full, deepest)
                    members.setdefault((group_of(p.info.run, plan.keys), wheel, n), []).append(part)
    in_order = sorted(members, key=lambda key: (sort_key(key[:2]), key[2]))
    return tuple(_row(key, members[key], plan.width_kmh) for key in in_order)


class _Part(NamedTuple):
    """What a wheel did on a pass in a bin of speed, over `seconds` [s] and `metres` [m]."""

    seconds: float
    metres: float
    minor: int
    is_full: bool
    deepest: float


def _row(key: tuple[Group, str, int], found: Sequence[_Part], width: float) -> SpinDownRow:
    group, wheel, number = key
    events = sum(p.minor for p in found)
    seconds, metres = sum(p.seconds for p in found), sum(p.metres for p in found)
    each = worth([p.minor for p in found], [p.seconds for p in found], of_shares=False)
    low, high = poisson(each * events)
    hit = sum(p.minor > 0 for p in found)
    depths = [p.deepest for p in found if math.isfinite(p.deepest)]
    return SpinDownRow(
        group, wheel, number * width, (number + 1) * width, len(found), seconds, events, _over(events, seconds),
        (_over(low / each, seconds), _over(high / each, seconds)), 100.0 * _over(events, metres), hit / len(found),
        wilson(hit, len(found)), sum(p.is_full for p in found), float(np.median(depths)) if depths else math.nan,
    )  # fmt: skip


def _over(count: float, exposure: float) -> float:
    return count / exposure if exposure > 0.0 else math.nan
