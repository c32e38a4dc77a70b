"""Speed of full aquaplaning of a configuration: from slip slopes, minor spin-downs, full ones, and foretold."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aqualog.campaign.bins import DEPTH_KEYS, KMH, Group, Plan, group_of, sort_key
from aqualog.campaign.results import CampaignData
from aqualog.campaign.slip_slope import SLOPE_MAX, SlopeRow, SlopeTable, contact
from aqualog.campaign.spin_downs import Pass, passes
from aqualog.core.intervals import NOWHERE, Z95, Interval, student_quantile
from aqualog.core.records import BoolArray, FloatArray

__all__ = ["EVENTS", "FullSpeed", "fit_contact", "fit_half", "full_speeds"]

MINOR_BELOW = 20.0 * KMH  # [m/s] thesis 2.1 (C17): minor spin-downs begin so far below full aquaplaning
MINOR_HALF = 5.0 * KMH  # [m/s] tolerance of that, treated as a 95 % interval
DRAWS = 400
SEED = 20_240  # of the draws; another seed moves an interval's ends by a tenth of its width
LEAST_BINS = 3
LEAST_PASSES = 6
LEAST_EACH = 3  # passes with and without events; with fewer the interval is too narrow
SIGMA_MIN = 0.01  # [-] of a contact: a bin is not more accurate than that, because its water fluctuates
CONTACT_MAX = 0.92  # [-] a contact that stays above this does not show where it ends
EXTRAPOLATED = 1.5  # times the fastest bin: beyond it, the curve is a guess
FASTEST = 20  # power of the speed by which passes count: half of the weight 3.5 % below the fastest
SHARED = 0.5  # [-] of the variance of a pass: what passes of one tyre and water err by together, 0.36 to 0.8
UNLIKE = 0.2  # [-] standard deviation of the logarithm, from which on the margin says little more than tyres in general
_EXPONENTS = np.linspace(2.0, 8.0, 13)
_SPEEDS = np.arange(50.0, 250.5, 0.5) * KMH
_WIDTHS = np.array([1.0, 1.5, 2.0, 3.0, 4.5, 6.5, 9.5, 14.0]) * KMH

EVENTS = {
    "slip_slope": (
        "even contact ends",
        "the contact L = 1 - (v / v_full)^n estimated from the slip slopes reaches 0, on water as even as a bin's mean",
    ),
    "minor_spin_down": (
        "first loss + 20",
        "half of the passes have a minor spin-down of a free wheel, plus the thesis' 20 ± 5 km/h",
    ),
    "spin_down": (
        "half of passes stop a wheel",
        "half of the passes have a full spin-down of a free wheel; elsewhere the contact need not be 0",
    ),
    "margin": (
        "a free wheel stops",
        "a front wheel that rolls freely would stop, by the margin of passes that may all be slower",
    ),
}  # fmt: skip
"""Event at the speed of each method: in short, and in full."""


@dataclass(frozen=True, slots=True)
class FullSpeed:
    """Speed of full aquaplaning of a configuration.

    `way`: `slip_slope`, `minor_spin_down`, `spin_down`, `margin`; they are different `event`s, see `EVENTS`. `place` is
    a wheel, or `free` for the free wheels together.
    `v` with `ci` [m/s]; NaN without an estimate; an infinite upper end is open. `exponent` n of the contact's curve,
    NaN for the other methods. `rests_on`: bins or passes used. `reason` why there is no value.
    """

    group: Group
    place: str
    way: str
    v: float = math.nan
    ci: Interval = NOWHERE
    exponent: float = math.nan
    rests_on: str = ""
    reason: str = ""

    @property
    def event(self) -> str:
        """Event at this speed, in short."""
        return EVENTS[self.way][0]

    @property
    def defines(self) -> str:
        """Event at this speed, in full."""
        return EVENTS[self.way][1]


def full_speeds(data: CampaignData, plan: Plan, table: SlopeTable) -> tuple[FullSpeed, ...]:
    """Speeds of all configurations with water, by all four methods, in order of configuration.

    Intervals: 2.5 and 97.5 % of 400 repetitions. From slopes: the bins' slopes and the dry one, common to all of them,
    drawn from their intervals (Student's t, so that few runs give wide intervals). Residuals of L about the curve that
    exceed these intervals widen the result. From passes: bootstrap over the passes.

    The method by slopes extrapolates from a contact of 0.5 to 0.8 and assumes one constant v_full. For a rear wheel
    v_full is not constant: it falls with speed, since the front wheel leaves more water. On simulated campaigns of 871
    drives the intervals hold five of six rear wheels' speeds, whether that at the fastest passes or that at which it is
    reached. The other methods use events on uneven water and give speeds 15 to 20 km/h below the end of an even
    contact. The margin's passes share tyre, water and the laws that it errs by: half of the variance of one pass,
    which more passes do not lower. Of passes 15 to 45 km/h below full aquaplaning it is mostly too high.
    """
    rng = np.random.default_rng(SEED)
    by_wheel: dict[tuple[Group, str], list[SlopeRow]] = {}
    for row in (r for r in table.rows if r.road == "wet"):
        by_wheel.setdefault((row.group, row.wheel), []).append(row)
    dry = {(r.group, r.wheel): r for r in table.dry}
    found = [
        _from_slopes(group, wheel, rows, dry.get((tuple(x for x in group if x[0] not in DEPTH_KEYS), wheel)), rng)
        for (group, wheel), rows in by_wheel.items()
    ]
    by_group: dict[Group, list[Pass]] = {}
    for p in passes(data):
        by_group.setdefault(group_of(p.info.run, plan.keys), []).append(p)
    for group, members in by_group.items():
        found += [_from_passes(group, members, way, rng) for way in ("minor_spin_down", "spin_down")]
        found.append(_foretold(group, members))
    return tuple(sorted(found, key=lambda f: sort_key((f.group, ""))))


def _from_slopes(
    group: Group, wheel: str, rows: Sequence[SlopeRow], dry: SlopeRow | None, rng: np.random.Generator
) -> FullSpeed:
    """(a): the bins' contact along L = 1 - (v / v_full)^n."""
    bare = (group, wheel, "slip_slope")
    if dry is None or not dry.reliable:
        return FullSpeed(*bare, reason="no dry slope with an interval of this configuration")
    # a slope near full aquaplaning is small, so its interval is wide for a slope and narrow for a contact
    told = [r for r in rows if math.isfinite(r.contact_ratio + r.contact_ratio_ci[0])]
    on = f"{len(told)} bins"
    if len(told) < LEAST_BINS:
        return FullSpeed(*bare, rests_on=on, reason=f"a contact with an interval in {on}, at least {LEAST_BINS} needed")
    v = np.array([r.v_mean for r in told])
    L = np.array([r.contact_ratio for r in told])
    ends = np.array([contact(r, dry, np.array(r.slope_ci), np.array(dry.slope)) for r in told])
    sigma = np.maximum((ends[:, 1] - ends[:, 0]) / 4.0, SIGMA_MIN)
    on += f", {3.6 * v[0]:.0f} to {3.6 * v[-1]:.0f} km/h, contact down to {100 * min(L.min(), 1.0):.0f} %"
    best, exponent = fit_contact(v, L[None], sigma)
    lack = _lack(v, L, sigma, float(best[0]), float(exponent[0]))
    k_dry = _drawn(dry, rng)
    draws = np.stack([contact(r, dry, 1.0 / _drawn(r, rng), 1.0 / k_dry) for r in told], axis=1)
    draws += rng.normal(0.0, sigma * math.sqrt(lack**2 - 1.0), draws.shape)
    speeds, _ = fit_contact(v, draws, sigma)
    low, high = (float(x) for x in np.nanquantile(speeds, (0.025, 0.975)))
    limit = min(EXTRAPOLATED * float(v[-1]), float(_SPEEDS[-1]))
    ci = (low, high if high < limit else math.inf)
    if L.min() > CONTACT_MAX:
        return FullSpeed(*bare, ci=(low, math.inf), rests_on=on, reason="the contact falls too little to extrapolate")
    if float(best[0]) >= limit:
        reason = f"beyond {3.6 * limit:.0f} km/h: too far from the fastest bin"
        return FullSpeed(*bare, ci=(low, math.inf), rests_on=on, reason=reason)
    return FullSpeed(*bare, float(best[0]), ci, float(exponent[0]), on)


def _drawn(row: SlopeRow, rng: np.random.Generator) -> FloatArray:
    """1 / slope (b,) of a row, drawn from its interval and limited to the range of tyres."""
    low, high = 1.0 / row.slope_ci[1], 1.0 / row.slope_ci[0]
    scale = 0.5 * (high - low) / student_quantile(0.975, row.dof)
    return np.maximum(1.0 / row.slope + scale * rng.standard_t(row.dof, DRAWS), 1.0 / SLOPE_MAX)


def _lack(v: FloatArray, L: FloatArray, sigma: FloatArray, v_full: float, n: float) -> float:
    """Residuals of the curve relative to the bins' intervals, at least 1; the curve uses two degrees of freedom."""
    left = (L - np.maximum(1.0 - (v / v_full) ** n, 0.0)) / sigma
    return max(math.sqrt(float(left @ left) / (v.size - 2)), 1.0)


def fit_contact(v: FloatArray, contact: FloatArray, sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Fit L = 1 - (v / v_full)^n, 0 beyond v_full, in each row.

    Of speeds `v` (m,) [m/s], `contact` L (b, m) [-], of which NaN and what is not positive do not count, and standard
    deviations `sigma` (m,) [-]. Returns v_full (b,) in steps of 0.5 km/h up to 250 km/h [m/s] and n (b,) in 2 ... 8;
    NaN where fewer than two bins count.
    """
    share = v[None, None] / _SPEEDS[:, None, None]
    flat = np.maximum(1.0 - share ** _EXPONENTS[None, :, None], 0.0).reshape(-1, v.size)
    good = np.isfinite(contact) & (contact > 0.0)
    y = np.where(good, np.minimum(contact, 1.5), 0.0)
    w = good / sigma**2
    loss = (w @ (flat * flat).T) - 2.0 * ((w * y) @ flat.T)
    at = np.argmin(loss, axis=1)
    enough = good.sum(axis=1) >= 2
    v_full = np.where(enough, _SPEEDS[at // _EXPONENTS.size], np.nan)
    return v_full, np.where(enough, _EXPONENTS[at % _EXPONENTS.size], np.nan)


def _from_passes(group: Group, members: Sequence[Pass], way: str, rng: np.random.Generator) -> FullSpeed:
    """(b), (c): speed at which half of the passes have an event of the free wheels, by the speed of their first one."""
    bare = (group, "free", way)
    # a wheel that stops at once has no minor spin-downs, but its speed is above their beginning
    early = way == "minor_spin_down"
    begun = [[v for of in (p.full, *([p.minor] if early else [])) for own in of.values() for v in own] for p in members]
    hit = np.array([bool(at) for at in begun])
    # a pass without one had none up to its fastest speed
    v = np.array([min(at, default=p.v_held) for at, p in zip(begun, members, strict=True)])
    swept = np.array([bool(at) and p.went_without(x) for at, p, x in zip(begun, members, v, strict=True)])
    what = "minor or full spin-downs" if early else "full spin-downs"
    on = f"{int(hit.sum())} of {hit.size} passes with {what}, {3.6 * v.min():.0f} to {3.6 * v.max():.0f} km/h"
    if hit.size < LEAST_PASSES:
        return FullSpeed(*bare, rests_on=on, reason=f"{hit.size} passes, at least {LEAST_PASSES} needed")
    above = MINOR_BELOW if early else 0.0
    if hit.all() or not hit.any():
        word = "all passes have" if hit.all() else "no pass has"
        open_ci = (math.nan, float(v.min()) + above) if hit.all() else (float(v.max()), math.inf)
        return FullSpeed(*bare, ci=NOWHERE if early else open_ci, rests_on=on, reason=f"{word} {what}")
    fewer = min(int(hit.sum()), int((~hit).sum()))
    if fewer < LEAST_EACH:
        which = "with" if hit.sum() < hit.size - hit.sum() else "without"
        return FullSpeed(*bare, rests_on=on, reason=f"{fewer} passes {which} {what}, at least {LEAST_EACH} needed")
    times = rng.multinomial(hit.size, np.full(hit.size, 1.0 / hit.size), size=DRAWS).astype(np.float64)
    best = fit_half(v, hit, np.ones((1, hit.size)), swept)
    low, high = (float(x) for x in np.nanquantile(fit_half(v, hit, times, swept), (0.025, 0.975)))
    if not float(v.min()) - 5.0 * KMH <= float(best[0]) <= float(v.max()) + 5.0 * KMH:
        return FullSpeed(*bare, rests_on=on, reason="half of the passes would have one only outside the driven speeds")
    v_half, more = float(best[0]), MINOR_HALF if early else 0.0
    ci = v_half - math.hypot(v_half - low, more) + above, v_half + math.hypot(high - v_half, more) + above
    return FullSpeed(*bare, v_half + above, ci, rests_on=on)


def _foretold(group: Group, members: Sequence[Pass]) -> FullSpeed:
    """(d): mean of the speeds that the margin expects; the fastest passes, nearest to it, count most."""
    bare = (group, "free", "margin")
    m, s, v = np.array([(*p.foretold, p.v_held) for p in members if math.isfinite(p.foretold[0])]).reshape(-1, 3).T
    fastest = 3.6 * max(p.v_held for p in members)
    on = f"the margin of {m.size} of {len(members)} passes, the fastest at {fastest:.0f} km/h"
    w = (v / max(v, default=1.0)) ** FASTEST
    spread = float(w @ s / w.sum()) if m.size else math.inf
    if spread > UNLIKE:
        why = "too far below full aquaplaning" if m.size else "no pass in which the margin saw water"
        return FullSpeed(*bare, rests_on=on, reason=why)
    mean = float(w @ m / w.sum())
    half = Z95 * spread * math.sqrt(SHARED + (1.0 - SHARED) * float(w @ w / w.sum() ** 2))
    low, high = mean - half, mean + half
    return FullSpeed(*bare, math.exp(mean), (math.exp(low), math.exp(high)), rests_on=on)


def fit_half(v: FloatArray, hit: BoolArray, times: FloatArray, swept: BoolArray | None = None) -> FloatArray:
    """Speed (b,) [m/s] at which half of the passes have an event: logistic curve of greatest likelihood.

    Of speeds `v` (m,) [m/s], of its event or else its fastest, whether a pass has one (m,), and how often each counts
    (b, m), a fit per row. `swept` (m,): the pass came to its event from slower speeds, so that its own limit is v; else
    it is v or less. The width of the curve is kept within 1 ... 14 km/h, so that passes which separate cleanly have a
    speed too: the middle of the gap. NaN where a row has passes of one kind only.
    """
    z = (v[None, None] - _SPEEDS[:, None, None]) / _WIDTHS[None, :, None]
    log_p = -np.logaddexp(0.0, np.where(hit, -z, z))
    if swept is not None:  # the density of the curve
        log_p += np.where(swept, -np.logaddexp(0.0, z) - np.log(_WIDTHS / KMH)[None, :, None], 0.0)
    log_p = log_p.reshape(-1, v.size)
    likelihood = times @ log_p.T
    both = (times @ hit > 0.0) & (times @ ~hit > 0.0)
    # of equal ones the middle: passes that separate cleanly leave a gap
    near = likelihood >= likelihood.max(axis=1, keepdims=True) - 1e-3
    speed = np.repeat(_SPEEDS, _WIDTHS.size)
    middle = (near @ speed) / near.sum(axis=1)
    return np.where(both, middle, np.nan)
