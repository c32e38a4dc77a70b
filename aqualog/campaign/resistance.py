"""Resistance measure over speed: one row per configuration, road and bin of speed."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from aqualog.campaign.bins import DEPTH_KEYS, Cell, Group, Picked, Plan, cells
from aqualog.campaign.regress import NOWHERE, Design, Interval, estimate
from aqualog.campaign.samples import CampaignData, RunInfo, RunSamples
from aqualog.campaign.slip_slope import LIMITS, Limits, too_few_runs
from aqualog.core.records import FloatArray

__all__ = ["MeanRow", "ResistanceTable", "dry_level", "mean_of_cell", "resistances"]

DRY_S = 1.0  # [s] of dry driving before the lane that a run's own level needs


@dataclass(frozen=True, slots=True)
class MeanRow:
    """A cell's mean: `value` with `ci`, `scatter` standard deviation from run to run, `dof` of the interval.

    `reliable`: an interval exists; `reason` why there is no value or no interval.
    """

    group: Group
    place: str
    road: str
    low_kmh: float
    high_kmh: float
    runs: int
    samples: int
    v_mean: float = math.nan
    value: float = math.nan
    ci: Interval = NOWHERE
    scatter: float = math.nan
    dof: float = math.nan
    reliable: bool = False
    reason: str = ""


@dataclass(frozen=True, slots=True)
class ResistanceTable:
    """Rows [m/s²], whether each run's own dry level is subtracted, samples left out by reason."""

    plan: Plan
    rows: tuple[MeanRow, ...]
    is_relative: bool
    left_out: Mapping[str, int]
    robust: bool


def resistances(
    data: CampaignData, plan: Plan, *, relative: bool = True, robust: bool = False, limits: Limits = LIMITS
) -> ResistanceTable:
    """Mean resistance measure of all cells.

    Parameters
    ----------
    data, plan
    relative : bool
        Subtract the run's own level on dry road before the lane (at least a second). This removes errors of mass,
        rolling resistance, grade and accelerometer offset. A run without such a stretch is left out and counted.
    robust : bool
        Huber's weights [huber1981].
    limits : Limits
        Least runs and samples.

    Thesis: Eq. (2.9), Figs 2.11 to 2.15.
    """
    left_out: Counter[str] = Counter()

    def columns(info: RunInfo, samples: RunSamples, _: str) -> Picked | str:
        delta = samples.array("delta_a_x")
        if np.isnan(delta).all():
            return "no resistance measure: no torque of the driven wheels, or no a_x"
        level = 0.0
        if relative:
            found = dry_level(samples, delta)
            if found is None:
                return f"less than {DRY_S:g} s of dry driving before the lane"
            level = found
        return Picked({"v_x": samples.array("v_x"), "y": delta - level})

    rows: list[MeanRow] = []
    for road in plan.roads:
        keys = plan.keys if road == "wet" else tuple(k for k in plan.keys if k not in DEPTH_KEYS)
        found, without = cells(data, plan, wheels=lambda _: ("",), columns=columns, road=road, keys=keys)
        left_out.update(without)
        rows += [mean_of_cell(c, "y", limits, robust=robust) for c in found]
    return ResistanceTable(plan, tuple(rows), relative, dict(left_out), robust)


def dry_level(samples: RunSamples, delta: FloatArray) -> float | None:
    """Mean over usable dry samples before the lane (of a dry run: all); None with less than a second of them."""
    wet = np.flatnonzero(samples.on_water == 1.0)
    before = np.arange(delta.size) < (wet[0] if wet.size else delta.size)
    good = before & (samples.on_water == 0.0) & samples.is_usable & np.isfinite(delta)
    return float(np.mean(delta[good])) if np.count_nonzero(good) * samples.step_s >= DRY_S else None


def mean_of_cell(cell: Cell, column: str, limits: Limits = LIMITS, *, robust: bool = False) -> MeanRow:
    """Mean of a column, whose level scatters from run to run (a random-effects mean with Student's t)."""
    pool = cell.pool
    y = pool.columns[column]
    bare = (cell.group, cell.place, cell.road, cell.low_kmh, cell.high_kmh, pool.runs, y.size)
    v = float(np.mean(pool.columns["v_x"]))
    if y.size < limits.samples:
        return MeanRow(*bare, v, reason=f"{y.size} samples, at least {limits.samples} needed")
    design = Design(np.ones((1, y.size)), y, pool.run, pool.step, (True,), (False,))
    found = estimate(design, robust=robust)
    value, scatter, dof = float(found.value[0]), float(found.scatter[0]), float(found.dof[0])
    if found.runs < limits.runs:
        return MeanRow(*bare, v, value, reason=too_few_runs(found.runs, limits))
    return MeanRow(*bare, v, value, found.interval(0), scatter, dof, reliable=True)
