"""Minor spin-downs over speed: how often, in how many passes, how deep."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aqualog.campaign.bins import KMH, Group, Plan, free_of, group_of, sort_key
from aqualog.campaign.results import SETTLING_S, CampaignData, RunInfo
from aqualog.core.intervals import Interval, poisson, wilson
from aqualog.core.records import FloatArray

__all__ = ["Pass", "SpinDownRow", "minor_spin_downs", "passes"]

LEAST_S = 0.5  # [s] on the lane that count as a pass
SETTLED_S = 1.0  # [s] on the lane, from which on the margin has seen the water
Z90 = 1.644854  # 95 % quantile of the normal distribution
FULL_SLIP = -0.5  # [-] a wheel that has lost half of its speed floats; smaller dips recover by themselves


@dataclass(frozen=True, slots=True)
class Pass:
    """One run over the watered lane: mean speed [m/s], time and distance from entry to exit, and per free wheel:
    `minor` spin-downs begun there, `full` spin-downs (found by their detector, and half of the speed lost), `deepest`
    slip, rim against car. `foretold`: logarithm of the speed of full aquaplaning [ln(m/s)] that the margin expects, and
    its standard deviation, means over the lane from `SETTLED_S` on; NaN without one.
    """

    info: RunInfo
    v_mean: float
    seconds: float
    metres: float
    minor: dict[str, int]
    full: dict[str, int]
    deepest: dict[str, float]
    foretold: tuple[float, float] = (math.nan, math.nan)


@dataclass(frozen=True, slots=True)
class SpinDownRow:
    """A bin of speed: `passes`, `events` of minor spin-downs begun on the lane, `per_s` and `per_100_m` with `per_s_ci`
    (counts, Poisson; exact [garwood1936]), `share` of the passes with at least one (Wilson [wilson1927]), passes with a
    `full` spin-down, in which minor ones have no place, `deepest` slip: median of the passes' deepest [-]. Bins are of
    the pass's mean speed.
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
        wheels = free_of(info)
        seconds = float(np.count_nonzero(wet)) * samples.step_s + 2.0 * SETTLING_S
        slips = {w: samples.array(f"slip_min_{w}")[wet] for w in wheels}
        deepest = {w: float(np.nanmin(x)) if np.isfinite(x).any() else math.nan for w, x in slips.items()}
        minor, full = (
            {w: sum(e["detector"] == d and e["wheel"] == w and start <= e["start_s"] <= end for e in info.events)
             for w in wheels} for d in ("minor_spin_down", "spin_down")
        )  # fmt: skip
        full = {w: n if deepest[w] <= FULL_SLIP else 0 for w, n in full.items()}
        mean = float(v.mean())
        settled = wet & (samples.t >= float(t[0]) + SETTLED_S)
        foretold = _foretold(*(samples.array(f"v_full{end}")[settled] for end in ("", "_low", "_high")))
        found.append(Pass(info, mean, seconds, mean * seconds, minor, full, deepest, foretold))
    return found


def _foretold(v_full: FloatArray, low: FloatArray, high: FloatArray) -> tuple[float, float]:
    known = np.isfinite(v_full) & (low > 0.0) & np.isfinite(high)
    if not known.any():
        return math.nan, math.nan
    spread = np.log(high[known] / low[known]) / (2.0 * Z90)
    return float(np.log(v_full[known]).mean()), float(spread.mean())


def minor_spin_downs(data: CampaignData, plan: Plan) -> tuple[SpinDownRow, ...]:
    """Rows per configuration, free wheel and bin of the pass's mean speed. Thesis: Figs 2.3 and 2.4 (C14 to C19)."""
    members: dict[tuple[Group, str, int], list[Pass]] = {}
    for p in passes(data):
        number = int(p.v_mean / KMH // plan.width_kmh)
        for wheel in p.minor:
            members.setdefault((group_of(p.info.run, plan.keys), wheel, number), []).append(p)
    in_order = sorted(members, key=lambda key: (sort_key(key[:2]), key[2]))
    return tuple(_row(key, members[key], plan.width_kmh) for key in in_order)


def _row(key: tuple[Group, str, int], found: Sequence[Pass], width: float) -> SpinDownRow:
    group, wheel, number = key
    events = sum(p.minor[wheel] for p in found)
    seconds, metres = sum(p.seconds for p in found), sum(p.metres for p in found)
    low, high = poisson(events)
    hit = sum(p.minor[wheel] > 0 for p in found)
    depths = [p.deepest[wheel] for p in found if math.isfinite(p.deepest[wheel])]
    return SpinDownRow(
        group, wheel, number * width, (number + 1) * width, len(found), seconds, events, events / seconds,
        (low / seconds, high / seconds), 100.0 * events / metres, hit / len(found), wilson(hit, len(found)),
        sum(p.full[wheel] > 0 for p in found), float(np.median(depths)) if depths else math.nan,
    )  # fmt: skip
