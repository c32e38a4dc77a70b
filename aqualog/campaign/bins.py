"""Cells of a campaign: samples by configuration, wheel or side, road and speed."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aqualog.campaign.definition import Campaign, Run, group_keys
from aqualog.campaign.matrix import campaign_matrix
from aqualog.campaign.measure import REASONS
from aqualog.campaign.results import CampaignData, RunInfo, RunSamples
from aqualog.core.errors import ConfigError
from aqualog.core.notation import SIDES, WHEELS
from aqualog.core.records import BoolArray, FloatArray

__all__ = [
    "DEPTH_KEYS", "KMH", "NO_DRIVETRAIN", "ROADS", "Cell", "Group", "Picked", "Plan", "Pool", "cells",
    "check_plan", "driven_of", "free_of", "group_of", "plan", "pooled", "road_of",
    "sort_key",
]  # fmt: skip

KMH = 1.0 / 3.6  # [m/s]
ROADS = ("wet", "dry", "both")
DEPTH_KEYS = ("water_depth_mm", "water_depth_left_mm")
SIDE = "side"
NO_DRIVETRAIN = "the vehicle file does not say which axle is driven"
_APART = 10_000_000  # distance between the steps of two wheels of one run, which are not neighbours

Group = tuple[tuple[str, float | str | None], ...]
"""Keys with their values; None where a run gives no value."""


class Picked(NamedTuple):
    """Columns (n,) of a run and a wheel, `v_x` among them, and samples that do not count, by reason."""

    columns: dict[str, FloatArray]
    without: dict[str, BoolArray] = {}  # noqa: RUF012 - never written to


class Pool(NamedTuple):
    """Samples of several runs, arrays (n,): `run` index and `step` ascending, and columns by name."""

    run: NDArray[np.int64]
    step: NDArray[np.int64]
    columns: dict[str, FloatArray]

    def part(self, which: NDArray[np.int64] | BoolArray | slice) -> Pool:
        """Some of the samples."""
        return Pool(self.run[which], self.step[which], {k: x[which] for k, x in self.columns.items()})

    @property
    def runs(self) -> int:
        """Runs that have samples."""
        return int(np.unique(self.run).size)


@dataclass(frozen=True, slots=True)
class Plan:
    """How samples are put into cells: `keys` of the configuration, whether by side instead of by wheel, width of the
    speed bins [km/h], `road` as in `ROADS`.
    """

    keys: tuple[str, ...]
    by_side: bool = False
    width_kmh: float = 10.0
    road: str = "wet"

    @property
    def roads(self) -> tuple[str, ...]:
        """Roads of the table."""
        return ("wet", "dry") if self.road == "both" else (self.road,)


@dataclass(frozen=True, slots=True)
class Cell:
    """Samples of one configuration on one road at one place; `place` is a wheel, `left`, `right` or empty (the car).

    `low_kmh` and `high_kmh` are NaN for all speeds; `infos` are the runs that have samples here.
    """

    group: Group
    place: str
    road: str
    low_kmh: float
    high_kmh: float
    pool: Pool
    infos: tuple[RunInfo, ...] = field(default=(), compare=False)


def check_plan(campaign: Campaign, by: Sequence[str], *, width_kmh: float = 10.0, road: str = "wet") -> Plan:
    """Check the value of --by before any log is read.

    Without any name: the factors of the test matrix. Different cars are never put together.

    Raises
    ------
    ConfigError
        If no run has a key, or the road or width is not valid.
    """
    if road not in ROADS:
        raise ConfigError(f'road "{road}"', expected=" ".join(ROADS))
    if not 1.0 <= width_kmh <= 100.0:
        raise ConfigError(f"bin width {width_kmh:g} km/h", expected="1 to 100 km/h")
    names = [n for n in by if n != SIDE]
    keys = group_keys(names, campaign.keys) if names else ()
    if not by:
        keys = tuple(f.key for f in campaign_matrix(campaign).factors)
    if "vehicle" not in keys and len({r.vehicle.stem for r in campaign.runs}) > 1:
        keys = ("vehicle", *keys)
    return Plan(keys, SIDE in by, width_kmh, road)


def plan(data: CampaignData, by: Sequence[str], *, width_kmh: float = 10.0, road: str = "wet") -> Plan:
    """`check_plan` of a campaign with results."""
    return check_plan(data.configured.campaign, by, width_kmh=width_kmh, road=road)


def group_of(run: Run, keys: Sequence[str]) -> Group:
    """A run's values of the keys."""
    return tuple((k, run.vehicle.stem if k == "vehicle" else run.values.get(k)) for k in keys)


def driven_of(info: RunInfo) -> tuple[str, ...]:
    """Driven wheels of a run's car; all of them where its file does not say which: none has a slope (NO_DRIVETRAIN)."""
    return info.vehicle.driving


def free_of(info: RunInfo) -> tuple[str, ...]:
    """Wheels that are not driven; of an all-wheel-drive car the front ones, which meet the water first."""
    return tuple(w for w in WHEELS if w[0] == info.vehicle.watched_axle)


def road_of(samples: RunSamples, road: str) -> BoolArray:
    """Samples on the watered lane, or off it."""
    here: BoolArray = samples.on_water == (1.0 if road == "wet" else 0.0)
    return here


def cells(
    data: CampaignData, plan: Plan, *, wheels: Callable[[RunInfo], Sequence[str]],
    columns: Callable[[RunInfo, RunSamples, str], Picked | str], road: str, by_speed: bool = True,
    keys: tuple[str, ...] | None = None, only_usable: bool = True,
) -> tuple[list[Cell], Counter[str]]:  # fmt: skip
    """Cells of one road, in order of configuration, place and speed; and samples left out by reason.

    Parameters
    ----------
    wheels : callable
        Wheels of a run's car that count; `("",)` for the car as a whole.
    columns : callable
        Columns to use of a run and a wheel, or the reason for a missing column. Samples with a NaN are left out.
    road, by_speed
        `wet` or `dry`; in bins of speed, or all speeds together.
    keys : tuple of str, optional
        Other keys than the plan's.
    only_usable : bool
        Straight driving without brakes only.
    """
    keys = plan.keys if keys is None else keys
    left_out: Counter[str] = Counter()
    parts: dict[tuple[Group, str], list[tuple[RunInfo, int, NDArray[np.int64], dict[str, FloatArray]]]] = {}
    for info in data.done:
        samples = data.samples(info)
        on_road = road_of(samples, road)
        if np.isnan(samples.on_water).all():
            left_out["on or off the water is not known"] += int(samples.t.size)
        reason = samples.array("reason").astype(np.int64)
        good = on_road & (reason == 0) if only_usable else on_road
        if only_usable:
            for code in np.unique(reason[on_road & (reason > 0)]):
                left_out[REASONS[code]] += int(np.count_nonzero(on_road & (reason == code)))
        if not good.any():
            continue
        for number, wheel in enumerate(wheels(info)):
            found = columns(info, samples, wheel)
            if isinstance(found, str):
                left_out[found] += int(np.count_nonzero(good))
                continue
            left = good.copy()
            for why, which in found.without.items():
                left_out[why] += int(np.count_nonzero(left & which))
                left &= ~which
            whole = left & np.all([np.isfinite(x) for x in found.columns.values()], axis=0)
            left_out["signals missing"] += int(np.count_nonzero(left & ~whole))
            index = np.flatnonzero(whole)
            if index.size:
                step = index + number * _APART
                place = next(s for s, ws in SIDES.items() if wheel in ws) if plan.by_side and wheel else wheel
                part = (info, info.index, step, {k: x[index] for k, x in found.columns.items()})
                parts.setdefault((group_of(info.run, keys), place), []).append(part)
    out = []
    for (group, place), pieces in sorted(parts.items(), key=lambda item: sort_key(item[0])):
        pool = pooled([(i, step, c) for _, i, step, c in pieces])
        infos = {info.index: info for info, *_ in pieces}
        bin_of = np.floor(pool.columns["v_x"] / KMH / plan.width_kmh) if by_speed else np.full(pool.run.size, math.nan)
        if by_speed:  # the samples of a bin side by side, in their order
            order = np.argsort(bin_of, kind="stable")
            pool, bin_of = pool.part(order), bin_of[order]
        bins, starts = np.unique(bin_of, return_index=True)
        for k, start, end in zip(bins.tolist(), starts, [*starts[1:], bin_of.size], strict=True):
            here = pool.part(slice(start, end))
            low, high = k * plan.width_kmh, (k + 1.0) * plan.width_kmh
            out.append(Cell(group, place, road, low, high, here, tuple(infos[i] for i in np.unique(here.run))))
    return out, Counter({k: n for k, n in left_out.items() if n})


def pooled(pieces: Sequence[tuple[int, NDArray[np.int64], dict[str, FloatArray]]]) -> Pool:
    """Samples of (run, step, columns), by run and step."""
    run = np.concatenate([np.full(step.size, i, dtype=np.int64) for i, step, _ in pieces])
    step = np.concatenate([s for _, s, _ in pieces])
    order = np.lexsort((step, run))
    names = pieces[0][2].keys()
    return Pool(run[order], step[order], {k: np.concatenate([c[k] for *_, c in pieces])[order] for k in names})


def sort_key(item: tuple[Group, str]) -> tuple[tuple[tuple[int, float, str], ...], str]:
    """Return the key by which configurations and places are sorted: numbers by size, what is not stated last."""
    group, place = item
    ranked = tuple(
        (2, 0.0, "") if x is None else (0, x, "") if isinstance(x, float) else (1, 0.0, x) for _, x in group
    )  # fmt: skip
    return ranked, place
