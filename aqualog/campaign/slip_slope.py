"""Slip slope over speed: one row per configuration, driven wheel, road and bin of speed."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from aqualog.campaign.bins import DEPTH_KEYS, NO_DRIVETRAIN, Cell, Group, Picked, Plan, Pool, cells, driven_of
from aqualog.campaign.delay import Delay, Source, delays, late_slip, source_of
from aqualog.campaign.expected import LINEAR, Expected, contact_of, expected_of_runs, friction_of, tangent_of
from aqualog.campaign.results import CampaignData, RunInfo, RunSamples
from aqualog.core.intervals import NOWHERE, Interval, student_quantile
from aqualog.core.moments import Design
from aqualog.core.notation import SIDES
from aqualog.core.records import FloatArray
from aqualog.core.regression import NOISE_MAX, ByRun, Estimate, estimate

__all__ = [
    "LIMITS", "Limits", "SlopeRow", "SlopeTable", "at_zero_slip", "contact", "fit_slope", "slip_slopes", "too_few_runs",
]  # fmt: skip

S_MAX = 0.10  # [-] a wheel with more slip spins; a lower limit would cut off small contacts (0.3 over 3 is 0.1)
WIND_UP = 0.30  # [-] traction beyond which the curve bends, as in `aqualog slip-slope`
TIED = 0.3  # [-] correlation of traction and speed in a bin, from which on one hides in the other
SLOPE_MAX = 300.0  # [-] no tyre has more
SPAN_MAX = 3.0  # [-] upper over lower end of an interval; wider ones show little more than that a slope exists


@dataclass(frozen=True, slots=True)
class Limits:
    """Least data for a slope: `runs` for an interval, `samples`, and `mu_range` (5 to 95 % of the traction)."""

    runs: int = 3
    samples: int = 20
    mu_range: float = 0.02


LIMITS = Limits()


def too_few_runs(runs: int, limits: Limits) -> str:
    """Why there is no interval."""
    word = "run" if runs == 1 else "runs"
    return f"{runs} {word}: the scatter from run to run is not known, at least {limits.runs} needed"


@dataclass(frozen=True, slots=True)
class SlopeRow:
    """A cell's slope.

    `slope` [-]: slope of the regression line of F_x / F_z over slip within `mu_range` (5 to 95 % of the traction
    driven). The brush's curve bends (E22), so C_s / F_z, its tangent at zero slip, is larger: by a tenth on dry road at
    the thesis' tractions, by a sixth on water, by nearly half where little contact is left. `slope_ci`; `intercept`
    slip without traction [-], `intercept_ci`; `r2` share of the slip's variance that the line explains; `attenuation`
    bias of 1 / slope by traction noise, as a share; it is corrected; `scatter` standard deviation of the slope from run
    to run, relative; `dof` of the interval. `reliable`: a slope with an interval that spans less than `SPAN_MAX`, from
    a line that explains more than a constant. `reason` why there is no slope, no interval, or no reliable one.
    `slope_dry` with interval and runs: same configuration and wheel off the lane, all speeds, over `mu_range_dry`.
    `by_run`: parts of the runs in the error of 1 / slope, over its standard error: bins of the same runs err together.
    `contact_ratio` L [-]: see `contact`. `friction` (dry, wet) used for it. `expected`: the model's slope over the same
    traction. NaN without an estimate.
    """

    group: Group
    wheel: str
    road: str
    low_kmh: float
    high_kmh: float
    runs: int
    samples: int
    mu_range: Interval
    v_mean: float = math.nan
    slope: float = math.nan
    slope_ci: Interval = NOWHERE
    intercept: float = math.nan
    intercept_ci: Interval = NOWHERE
    r2: float = math.nan
    attenuation: float = math.nan
    scatter: float = math.nan
    dof: float = math.nan
    reliable: bool = False
    reason: str = ""
    slope_dry: float = math.nan
    slope_dry_ci: Interval = NOWHERE
    runs_dry: int = 0
    mu_range_dry: Interval = NOWHERE
    friction: tuple[float, float] = LINEAR
    contact_ratio: float = math.nan
    contact_ratio_ci: Interval = NOWHERE
    expected: Expected = field(default_factory=Expected)
    by_run: ByRun = field(default=ByRun(), compare=False, repr=False)

    @property
    def told(self) -> bool:
        """Whether there is a slope."""
        return math.isfinite(self.slope)

    @property
    def over_dry(self) -> tuple[float, Interval]:
        """Slope over the dry one, with interval: both as shares of their slopes, assumed to be independent."""
        down, up = (
            math.hypot(math.log(self.slope_ci[i] / self.slope), math.log(self.slope_dry_ci[1 - i] / self.slope_dry))
            for i in (0, 1)
        )
        ratio = self.slope / self.slope_dry
        return ratio, (ratio * math.exp(-down), ratio * math.exp(up))


@dataclass(frozen=True, slots=True)
class SlopeTable:
    """Rows, the dry references (all speeds) among them as `dry`, delays of v_x by car, samples left out by reason.

    `dry_left_out`: those of the references. `elsewhere`: without any row, the other roads that have some.
    """

    plan: Plan
    rows: tuple[SlopeRow, ...]
    dry: tuple[SlopeRow, ...]
    delays: tuple[Delay, ...]
    left_out: Mapping[str, int]
    robust: bool
    dry_left_out: Mapping[str, int] = field(default_factory=dict)
    elsewhere: tuple[str, ...] = ()


def slip_slopes(data: CampaignData, plan: Plan, *, robust: bool = False, limits: Limits = LIMITS) -> SlopeTable:
    """Slopes of all cells.

    The dry reference of a row is that of its configuration without the water's depth; the same runs before and after
    the lane count too.

    A slope is reported where the interval of 1 / slope excludes 0. Where few cells meet this, they are a selection: on
    simulated data (`tests/campaign/slope_coverage.py`) the reported intervals hold the truth in 83 of 100 cells with
    three runs, and in 92 to 95 with five where most cells are reported. Where the traction hardly varies they hold it
    in 66. Where the traction noise is large, reported cells are those with small noise by chance, and the correction is
    too large for them: with three runs and a noise of 0.010 the reported slopes are up to 15 % high.

    Thesis: section 2.3, Figs 2.16 to 2.20; (2.2) for the contact ratio.
    """
    late = delays(data)
    left_out: Counter[str] = Counter()

    def columns(info: RunInfo, samples: RunSamples, wheel: str) -> Picked | str:
        if not info.vehicle.knows_drivetrain:
            return NO_DRIVETRAIN
        slip, mu = samples.array(f"slip_{wheel}"), samples.array(f"mu_{wheel}")
        if np.isnan(slip).all():
            return _without_slip(info)
        if np.isnan(mu).all():
            return "no traction: no torque of the driven wheels"
        without = {
            "the wheel spins": samples.around(samples.bits(f"spin_{wheel}") | (np.abs(slip) > S_MAX)),
            f"traction beyond {WIND_UP:g}": np.abs(mu) > WIND_UP,
        }
        u = np.zeros_like(slip)
        if (own := late.get(source_of(info))) is not None:
            added, u = late_slip(samples, own.value if own.told else 0.0)
            slip = slip - added
        return Picked({"v_x": samples.array("v_x"), "slip": slip, "mu": mu, "u": u}, without)

    def of(road: str, keys: tuple[str, ...], without: Counter[str], *, by_speed: bool) -> list[SlopeRow]:
        found, lost = cells(data, plan, wheels=driven_of, columns=columns, road=road, by_speed=by_speed, keys=keys)
        without.update(lost)
        return [_row(c, late, limits, robust=robust) for c in found]

    dry_keys = tuple(k for k in plan.keys if k not in DEPTH_KEYS)
    dry_left_out: Counter[str] = Counter()
    dry = of("dry", dry_keys, dry_left_out, by_speed=False)
    reference = {(r.group, r.wheel): r for r in dry}
    rows = [
        _with_dry(r, reference.get((tuple((k, v) for k, v in r.group if k not in DEPTH_KEYS), r.wheel)))
        for road in plan.roads
        for r in of(road, plan.keys if road == "wet" else dry_keys, left_out, by_speed=True)
    ]
    others = [] if rows else sorted({"wet", "dry"} - set(plan.roads))
    elsewhere = tuple(r for r in others if (dry if r == "dry" else of(r, plan.keys, Counter(), by_speed=False)))
    return SlopeTable(
        plan, tuple(rows), tuple(dry), tuple(late.values()), dict(left_out), robust, dict(dry_left_out), elsewhere
    )  # fmt: skip


def _without_slip(info: RunInfo) -> str:
    """Why a run has no slip of its driven wheels."""
    missing = [f"omega_{w}" for w in driven_of(info) if f"omega_{w}" not in info.about.get("signals", ())]
    if missing:
        return f"no slip: wheel speeds are missing ({', '.join(missing)})"
    return "no slip: neither v_x nor a free wheel on the wheel's side"


def _row(cell: Cell, late: Mapping[Source, Delay], limits: Limits, *, robust: bool) -> SlopeRow:
    pool = cell.pool
    mu = pool.columns["mu"]
    v = float(np.mean(pool.columns["v_x"]))
    low, high = (float(x) for x in np.quantile(mu, (0.05, 0.95)))
    wheels = SIDES.get(cell.place, (cell.place,))
    model = expected_of_runs(cell.infos, wheels, v, wet=cell.road == "wet", mu_range=(low, high))
    bare = SlopeRow(
        cell.group, cell.place, cell.road, cell.low_kmh, cell.high_kmh, pool.runs, mu.size, (low, high), v,
        friction=friction_of(cell.infos), expected=model,
    )  # fmt: skip
    return fit_slope(bare, pool, [late.get(source_of(i)) for i in cell.infos], limits, robust=robust)


def fit_slope(
    bare: SlopeRow, pool: Pool, late: Sequence[Delay | None], limits: Limits = LIMITS, *, robust: bool = False
) -> SlopeRow:
    """Fill in the slope of a row, which has counts, from a pool with columns `mu`, `slip`, `u` and `v_x`.

    `late`: delay of v_x in each run, in order, which is taken off the slip already; None: the slip is not against v_x.
    `u`: change of the slip with that delay, a / v.
    """
    mu, slip, u = (pool.columns[n] for n in ("mu", "slip", "u"))
    if mu.size < limits.samples:
        return replace(bare, reason=f"{mu.size} samples, at least {limits.samples} needed")
    if not bare.mu_range[1] - bare.mu_range[0] >= limits.mu_range:
        return replace(
            bare, reason=f"the traction varies by {bare.mu_range[1] - bare.mu_range[0]:.3f} only (5 to 95 %), at least "
            f"{limits.mu_range:g} needed",
        )  # fmt: skip
    half_tau = max((d.half for d in late if d is not None and d.told), default=0.0)
    is_open = any(d is not None and not d.told for d in late)
    columns, scatters, noisy = [mu, np.ones_like(mu)], [True, True], [True, False]
    # on water the slope changes with the speed, and mu / v looks like a / v: there, the one hides in the other
    if is_open and bare.road == "dry" and np.ptp(u) > 0.0:
        columns, scatters, noisy = [*columns, u], [*scatters, False], [*noisy, False]
    x, v = mu - mu.mean(), pool.columns["v_x"]
    # where the traction follows the speed, its coefficient would hold the change of the slope with the speed
    if bare.road == "wet" and abs(float(np.mean(x * (v - v.mean())))) > TIED * float(mu.std() * v.std()):
        columns, scatters, noisy = [*columns, mu * (v - v.mean())], [*scatters, False], [*noisy, False]
    found = estimate(
        Design(np.stack(columns), slip, pool.run, pool.step, tuple(scatters), tuple(noisy)), robust=robust
    )  # fmt: skip
    # error of 1 / slope per error of the delay: slope of a / v over the traction, within and between the runs
    shared = abs(float(np.mean(x * u)) / float(np.mean(x * x)))
    return _told(bare, found, columns, slip, half_tau * shared, limits, is_open=is_open)


def _told(
    bare: SlopeRow, found: Estimate, columns: list[FloatArray], slip: FloatArray, late_half: float, limits: Limits, *,
    is_open: bool,
) -> SlopeRow:  # fmt: skip
    k = float(found.value[0])
    half = math.hypot(float(found.half[0]), late_half)
    low, high = k - half, k + half
    open_word = ", because the delay of v_x is not known" if is_open else ""
    few = found.runs < limits.runs
    reason = ""
    if found.attenuation > NOISE_MAX:
        reason = f"{100.0 * min(found.attenuation, 1.0):.0f} % of the variation of the traction is noise"
    elif not few and not low > 0.0 < high:
        reason = (
            f"1 / slope is {k:.3f} with a 95 % interval of {low:.3f} ... {high:.3f}, which includes 0{open_word}"
            if high > 0.0 else f"slip falls with traction (1 / slope is {k:.3f})"
        )  # fmt: skip
    elif not k > 1.0 / SLOPE_MAX:
        reason = f"1 / slope is {k:.4f}: less than any tyre has{open_word}"
    line = found.value @ np.stack(columns)
    total = float(np.sum((slip - slip.mean()) ** 2))
    r2 = 1.0 - float(np.sum((slip - line) ** 2)) / total if total > 0.0 else math.nan
    row = replace(bare, r2=r2, attenuation=found.attenuation, dof=float(found.dof[0]))
    if reason:
        return replace(row, reason=reason)
    row = replace(row, slope=1.0 / k, intercept=float(found.value[1]), scatter=float(found.scatter[0]) / k)
    if few:
        return replace(row, reason=too_few_runs(found.runs, limits))
    if is_open and bare.road == "wet":
        return replace(row, reason="the delay of v_x is not known: dry driving at different accelerations shows it")
    own = found.by_run[0]
    own = own._replace(part=own.part * student_quantile(0.975, row.dof) / half)
    row = replace(row, slope_ci=(1.0 / high, 1.0 / low), intercept_ci=found.interval(1), by_run=own)
    doubt = ""
    if high / low > SPAN_MAX:
        doubt = f"the interval spans a factor of {high / low:.1f}, at most {SPAN_MAX:g} is reliable"
    elif r2 < 0.0:
        doubt = f"r2 is {r2:.2f}: a constant slip explains the samples better than the line"
    return replace(row, reliable=not doubt, reason=doubt)


def contact(row: SlopeRow, dry: SlopeRow, slope: FloatArray, slope_dry: FloatArray) -> FloatArray:
    """Contact L of a row on water, for other values of both slopes than the rows' own too.

    The L of the brush whose regression line over the row's tractions has the row's slope. Its tangent at zero slip
    follows in the same way from the dry slope over the dry tractions. sqrt(slope / slope_dry), (2.2), would divide two
    slopes of curves that bend differently, and would be 0.02 to 0.09 low. The friction is known to 10 or 20 % only: 20
    % change L by 0.01 at 0.8 and above, by 0.02 at 0.6. Arrays broadcast; see `contact_of` for limits.
    """
    tangent = tangent_of(slope_dry, dry.friction[0], dry.mu_range)
    return contact_of(slope / tangent, row.friction[1], row.mu_range)


def at_zero_slip(row: SlopeRow) -> SlopeRow:
    """A row on water with its slopes at zero slip, C_s / F_z; as it is without a slope or a dry one.

    The dry tangent times L² (2.2), with the L of `contact`: the regression line lies below, more so the more traction
    is driven and the less contact is left. The interval is that of the wet line; the dry one is common to all speeds.
    """
    if not (row.told and math.isfinite(row.slope_dry)):
        return row
    of_dry = replace(row, mu_range=row.mu_range_dry)
    wet = np.array([row.slope, *row.slope_ci])
    slope, low, high = (float(x) ** 2 for x in contact(row, of_dry, wet, np.array(row.slope_dry)))
    tangent = float(tangent_of(np.array(row.slope_dry), row.friction[0], row.mu_range_dry))
    ratio = tangent / row.slope_dry
    return replace(
        row, slope=tangent * slope, slope_ci=(tangent * low, tangent * high), slope_dry=tangent,
        slope_dry_ci=(ratio * row.slope_dry_ci[0], ratio * row.slope_dry_ci[1]),
    )  # fmt: skip


def _with_dry(row: SlopeRow, dry: SlopeRow | None) -> SlopeRow:
    if dry is None or not dry.told:
        return row
    row = replace(
        row, slope_dry=dry.slope, slope_dry_ci=dry.slope_ci, runs_dry=dry.runs, mu_range_dry=dry.mu_range
    )  # fmt: skip
    if not row.told or row.road != "wet":
        return row
    ratio, ends = row.over_dry
    slopes = dry.slope * np.array([ratio, *ends])
    L, low, high = (float(x) for x in contact(row, dry, slopes, np.array(dry.slope)))
    return replace(row, contact_ratio=L, contact_ratio_ci=(low, high))
