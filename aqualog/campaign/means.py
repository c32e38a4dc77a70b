"""Means over cells: resistance measure, and traction of driven wheels while they spin up."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from aqualog.campaign.bins import DEPTH_KEYS, NO_DRIVETRAIN, Cell, Group, Picked, Plan, cells, driven_of
from aqualog.campaign.results import CampaignData, RunInfo, RunSamples
from aqualog.campaign.slip_slope import LIMITS, Limits, too_few_runs
from aqualog.core.intervals import NOWHERE, Interval
from aqualog.core.moments import Design
from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray
from aqualog.core.regression import estimate
from aqualog.features.stream import loads_of_car
from aqualog.physics.traction import residual_traction

__all__ = [
    "SPINNING", "MeanRow", "ResistanceTable", "dry_level", "is_spinning", "mean_of_cell", "resistances", "spin_ups",
]  # fmt: skip

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
    """Rows [m/s²], whether each run's own dry level is subtracted, samples left out by reason.

    `elsewhere`: without any row, the other roads that have some.
    """

    plan: Plan
    rows: tuple[MeanRow, ...]
    is_relative: bool
    left_out: Mapping[str, int]
    robust: bool
    elsewhere: tuple[str, ...] = ()


def resistances(
    data: CampaignData, plan: Plan, *, relative: bool = True, robust: bool = False, limits: Limits = LIMITS
) -> ResistanceTable:
    """Mean resistance measure of all cells.

    `relative`: subtract the run's own level on dry road before the lane (at least a second). This removes errors of
    mass, rolling resistance, grade and accelerometer offset. A run without such a stretch is left out and counted.
    `robust`: Huber's weights [huber1981].

    Thesis: Eq. (2.9), Figs 2.11 to 2.15.
    """
    left_out: Counter[str] = Counter()

    def columns(info: RunInfo, samples: RunSamples, _: str) -> Picked | str:
        delta = samples.array("delta_a_x")
        if np.isnan(delta).all():
            if not info.vehicle.knows_drivetrain:
                return NO_DRIVETRAIN
            return "no resistance measure: no torque of the driven wheels, or no a_x"
        level = 0.0
        if relative:
            found = dry_level(samples, delta)
            if found is None:
                return f"less than {DRY_S:g} s of dry driving before the lane"
            level = found
        return Picked({"v_x": samples.array("v_x"), "y": delta - level})

    def of(road: str) -> tuple[list[Cell], Counter[str]]:
        keys = plan.keys if road == "wet" else tuple(k for k in plan.keys if k not in DEPTH_KEYS)
        return cells(data, plan, wheels=lambda _: ("",), columns=columns, road=road, keys=keys)

    rows: list[MeanRow] = []
    for road in plan.roads:
        found, without = of(road)
        left_out.update(without)
        rows += [mean_of_cell(c, "y", limits, robust=robust) for c in found]
    elsewhere = () if rows else tuple(r for r in sorted({"wet", "dry"} - set(plan.roads)) if of(r)[0])
    return ResistanceTable(plan, tuple(rows), relative, dict(left_out), robust, elsewhere)


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


SPIN_LIMITS = Limits(samples=3)
SPINNING = 0.10  # [-] slip from which a brush of slope 30 and friction 1 slides as a whole: 3 mu / C (D)


def spin_ups(
    data: CampaignData, plan: Plan, *, residual: bool = False, limits: Limits = SPIN_LIMITS
) -> tuple[MeanRow, ...]:
    """Mean traction coefficient [-] on the lane while a wheel spins up, per configuration, driven wheel and bin.

    `residual`: subtract the missing acceleration of the vehicle (`physics.traction.residual_traction`); the rest pushes
    the car and is a lower bound. Otherwise the traction is the torque minus the wheel's own acceleration; on water it
    also turns the wheel against the increased rolling resistance.

    Slip defines spinning (`is_spinning`), not the detector's events. The detector reports spin-ups only below a
    traction of 0.07, to exclude other slippery surfaces; a mean over its events would have no values above that.

    Thesis: Fig. 2.7.
    """

    def columns(info: RunInfo, samples: RunSamples, wheel: str) -> Picked | str:
        if not info.vehicle.knows_drivetrain:
            return NO_DRIVETRAIN
        mu = samples.array(f"mu_{wheel}")
        if np.isnan(mu).all():
            return "no traction: no torque of the driven wheels"
        if residual:
            car = info.vehicle
            a_x = np.nan_to_num(samples.array("a_x"))
            loads = loads_of_car(car, a_x, np.zeros_like(a_x))
            mu = residual_traction(mu, samples.array("delta_a_x"), loads[WHEELS.index(wheel)], mass=car.mass)
        return Picked({"v_x": samples.array("v_x"), "mu": mu}, {"no spin-up": ~is_spinning(samples, wheel)})

    found, _ = cells(data, plan, wheels=driven_of, columns=columns, road="wet", only_usable=False)
    return tuple(mean_of_cell(c, "mu", limits) for c in found)


def is_spinning(samples: RunSamples, wheel: str) -> BoolArray:
    """Steps in which the rim is all the time faster than the car by `SPINNING`."""
    with np.errstate(invalid="ignore"):
        spins: BoolArray = samples.array(f"slip_min_{wheel}") > SPINNING
    return spins
