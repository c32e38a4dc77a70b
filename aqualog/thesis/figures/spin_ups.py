"""Figures 2.5 to 2.7: driven wheels spin up in passes over water, over time and over speed, and their traction."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from aqualog.campaign.bins import Plan, Pool
from aqualog.campaign.means import is_spinning, spin_ups
from aqualog.campaign.results import RunInfo
from aqualog.report.theme import wheel_colour
from aqualog.thesis.catalogue import figure_of, needs_of
from aqualog.thesis.claims import Check, judge, limit
from aqualog.thesis.evidence import measures
from aqualog.thesis.evidence.campaign import KMH, Evidence
from aqualog.thesis.evidence.selection import FAMILIES, NotInCampaign, Selected, value_of
from aqualog.thesis.figures.panels import V_KMH, WHEEL_WORDS, clouds, means_line, means_table, speed_panels, spread_over
from aqualog.thesis.record import Axis, Figure, Line, Panel

__all__ = ["FIGURES"]

_FAR = limit("far", "C20.figure")  # [km/h] "far below" the speed of full aquaplaning
_IRREGULAR = limit("irregular", "C21.figure")  # [km/h] over which passes with and without a spin-up mix
_LEAST = 5  # passes
_LEAST_STEPS = 2  # of 0.1 s that a wheel spins


def chosen_spin_ups(evidence: Evidence, number: str) -> tuple[Selected, list[RunInfo]]:
    """Runs of the configuration that is shown, and those of them in which a driven wheel spins up."""
    runs = evidence.data.runs
    with_some = [r for r in runs if r.is_done and not evidence.has_water(r) and spins(evidence, r)]
    if not with_some:
        raise NotInCampaign(f"needs {needs_of(number)}: none of {len(runs)} runs has one", where=f"figure {number}")
    # the configuration by the runs that spin up; of it all runs count
    like = _like(evidence.choose(number, evidence.has_water, with_some).runs[0])
    selected = evidence.choose(
        number, lambda r: evidence.has_water(r) or ("" if _like(r) == like else "in another configuration")
    )
    return selected, [r for r in selected.runs if spins(evidence, r)]


def _like(info: RunInfo) -> tuple[object, ...]:
    return tuple(value_of(info, f) for f in FAMILIES)


def spins(evidence: Evidence, info: RunInfo) -> bool:
    """Whether a driven wheel spins up on the water: by its slip, since the detector leaves out wheels that still have
    grip."""
    samples, wet = evidence.wet(info)
    return any(int(np.count_nonzero(wet & is_spinning(samples, w))) >= _LEAST_STEPS for w in info.vehicle.driven)


def far_below(evidence: Evidence, runs: Sequence[RunInfo]) -> Check | None:
    """C20: spin-ups far below full aquaplaning, by the torque."""
    facts = [evidence.of(r) for r in runs]
    v = np.array([f.v for f in facts])
    hit = np.array([float(spins(evidence, r)) for r in runs])
    if len(runs) < _LEAST or not hit.any():
        return None
    full = measures.full_speed(measures.passes_of(evidence, runs))
    known = bool(np.isfinite(full))
    away = ((full if known else float(v.max())) - float(v[hit > 0].min())) / KMH
    demand = np.array([_demand(evidence, r) for r in runs])
    there = np.isfinite(demand)
    effects = (
        measures.over_passes(
            [np.ones(v.size)[there], (v[there] - v[there].mean()) / measures.TEN, demand[there] / 0.01], hit[there]
        )
        if there.sum() > _LEAST
        else None
    )
    by_torque = effects[2] if effects is not None else None
    is_far = away >= _FAR
    what = (
        f"full aquaplaning at {full / KMH:.0f} km/h"
        if known
        else f"the fastest pass, {v.max() / KMH:.0f} km/h, still below full aquaplaning"
    )
    if by_torque is None:
        is_driven, value, ci95, unit, told = False, None, None, "", "the traction demanded is not known"
    else:
        is_driven, value, ci95, unit = by_torque.is_above, by_torque.value, by_torque.ci, "per 0.01"
        told = "share of passes with a spin-up per 0.01 of traction demanded before the water, at equal speed: "
        told += by_torque.words(3)
    outcome = (
        f"slowest pass with a spin-up {v[hit > 0].min() / KMH:.0f} km/h; {what}; {told}; {int(hit.sum())} of "
        f"{hit.size} passes spin up"
    )
    whole, part = is_far and is_driven, is_far or is_driven
    close = "The influence of the torque does not exceed the scatter." if is_far else ""
    reason = "" if whole else close or "Spin-ups begin close to full aquaplaning."
    return judge("C20.figure", outcome, whole=whole, part=part, value=value, ci95=ci95, unit=unit, reason=reason)


def _demand(evidence: Evidence, info: RunInfo) -> float:
    """Mean traction of the driven wheels on the dry road before the water; NaN without. [-]"""
    samples = evidence.data.samples(info)
    before = (samples.on_water == 0.0) & (samples.t < evidence.of(info).entry)
    mu = np.array([samples.array(f"mu_{w}")[before] for w in info.vehicle.driven])
    return float(np.nanmean(mu)) if np.isfinite(mu).any() else float("nan")


def irregular(evidence: Evidence, runs: Sequence[RunInfo]) -> Check | None:
    """C21: passes with and without a spin-up mix over the speeds."""
    hit = np.array([spins(evidence, r) for r in runs])
    v = np.array([evidence.of(r).v for r in runs]) / KMH
    if len(runs) < _LEAST or not hit.any():
        return None
    mixed = float(v[~hit].max() - v[hit].min()) if not hit.all() else float("-inf")
    whole = mixed >= _IRREGULAR
    outcome = f"with a spin-up from {v[hit].min():.0f} km/h on, without one up to " + (
        f"{v[~hit].max():.0f} km/h" if not hit.all() else "no speed: all passes spin up"
    )
    return judge("C21.figure", outcome, whole=whole, part=mixed > 0.0, value=mixed)


def falling_traction(pools: dict[str, Pool]) -> Check | None:
    """C22: the traction coefficient in spin-ups falls with speed."""
    effects = {w: e for w, p in pools.items() if (e := measures.trend(p)).ci is not None}
    if not effects:
        return None
    down = [w for w, e in effects.items() if e.is_below]
    worst = max(effects.values(), key=lambda e: e.high)
    whole = len(down) == len(effects)
    outcome = "per 10 km/h: " + "; ".join(f"{w} {e.words(4)}" for w, e in effects.items())
    fields = {"why": _unsure(effects, pools)}
    return judge("C22.figure", outcome, whole=whole, part=bool(down), value=worst.value, ci95=worst.ci, fields=fields)


def _unsure(effects: Mapping[str, measures.Effect], pools: Mapping[str, Pool]) -> str:
    rising = [w for w, e in effects.items() if e.is_above]
    if rising:
        return f"It rises at {', '.join(rising)}."
    words = (f"{w}: {p.runs} runs at {p.columns['v_x'].min() / KMH:.0f} to {p.columns['v_x'].max() / KMH:.0f} km/h"
             for w, p in pools.items())  # fmt: skip
    return f"The spin-ups are too few or cover too small a range of speed ({'; '.join(words)})."


def sides_differ(pools: dict[str, Pool]) -> Check | None:
    """C23: left and right differ, because there is less water on the left."""
    left, right = (next((p for w, p in pools.items() if w[1] == side), None) for side in "lr")
    found = measures.difference(right, left) if left is not None and right is not None else None
    if found is None:
        return None
    level = found[0]
    outcome = f"left less right {level.words(4)}"
    whole, part = level.is_above, level.value > 0.0
    unsure = level.low <= 0.0 <= level.high
    reason = "The two sides do not differ significantly." if unsure else "The right wheel carries more."
    reason = "" if whole else reason
    return judge("C23.figure", outcome, whole=whole, part=part, value=level.value, ci95=level.ci, reason=reason)


_PANELS = 4


def figure_2_05(number: str, evidence: Evidence) -> Figure:
    """Four passes with spin-ups over time; C20 and C21 over all passes of the configuration."""
    selected, spun = chosen_spin_ups(evidence, number)
    v = [evidence.of(r).v for r in spun]
    shown = spread_over(spun, evidence, list(np.linspace(min(v), max(v), _PANELS)))
    counted = {r.index: "drawn, and counted" if r in shown else "counted" for r in selected.runs}
    checks = (far_below(evidence, selected.runs), irregular(evidence, selected.runs))
    return figure_of(
        number, speed_panels(evidence, shown), checks, runs=selected.used(counted), fixed=selected.fixed,
        slowest=min(v) / KMH, fastest=max(v) / KMH,
    )  # fmt: skip


def figure_2_06(number: str, evidence: Evidence) -> Figure:
    """Clouds of slips of the driven wheels; C20 and C21."""
    selected, spun = chosen_spin_ups(evidence, number)
    lines = clouds(evidence, selected.runs, "slip_max", selected.runs[0].vehicle.driven)
    if not lines:
        raise NotInCampaign(
            "needs wheel speeds and the car's speed on water: no slip in any pass", where=f"figure {number}"
        )
    panel = Panel("Slip of the driven wheels", V_KMH, Axis("slip (3.13)"), tuple(lines))
    checks = (far_below(evidence, selected.runs), irregular(evidence, selected.runs))
    return figure_of(
        number, (panel,), checks, runs=selected.used(_with_or_without(selected, spun)), fixed=selected.fixed,
        spun=len(spun), passes=len(selected.runs),
    )  # fmt: skip


def _with_or_without(selected: Selected, spun: Sequence[RunInfo]) -> dict[int, str]:
    """What each run is shown as, by its index."""
    return {r.index: "with spin-up" if r in spun else "without spin-up" for r in selected.runs}


_MU = Axis("traction coefficient")


def _lower_bound(evidence: Evidence, spun: Sequence[RunInfo]) -> list[Line]:
    """Means of the traction that is left to push the car."""
    rows = [r for r in spin_ups(evidence.part(spun), Plan(()), residual=True) if math.isfinite(r.value)]
    lines = []
    for i, wheel in enumerate(dict.fromkeys(r.place for r in rows)):
        of = [r for r in rows if r.place == wheel]
        v = np.array([0.5 * (r.low_kmh + r.high_kmh) + 0.4 * (2 * i - 1) for r in of])
        low, high = (np.array([r.ci[k] for r in of]) for k in (0, 1))
        lines.append(
            Line(WHEEL_WORDS[wheel], v, np.array([r.value for r in of]), low=low, high=high, colour=wheel_colour(wheel),
                 width=1.6, mode="lines+markers")
        )  # fmt: skip
    return lines


def _traction_of(wheel: str) -> measures.Columns:
    """Traction coefficient of a wheel from its torque, while it spins on water."""
    return lambda _, s: (is_spinning(s, wheel) & (s.on_water == 1.0), s.array(f"mu_{wheel}"))


def figure_2_07(number: str, evidence: Evidence) -> Figure:
    """Mean traction coefficient per bin of speed and wheel; C22 and C23."""
    selected, spun = chosen_spin_ups(evidence, number)
    wheels = selected.runs[0].vehicle.driven
    pools = {w: p for w in wheels if (p := measures.pool_of(evidence, spun, _traction_of(w))) is not None}
    means = {w: m for w, p in pools.items() if (m := measures.bin_means(p)).v_kmh.size}
    if not means:
        raise NotInCampaign(
            "needs the torque of the driven wheels in spin-ups on water: no traction in any", where=f"figure {number}"
        )  # fmt: skip
    lines = tuple(
        means_line(WHEEL_WORDS[w], m, (wheel_colour(w), "solid", "circle"), shift=0.4 * (2 * i - 1))
        for i, (w, m) in enumerate(means.items())
    )
    panels = [Panel("Traction coefficient in spin-ups, from the torque", V_KMH, _MU, lines)]
    if low := _lower_bound(evidence, spun):
        panels.append(Panel("Less the water's share of the torque (lower bound)", V_KMH, _MU, tuple(low)))
    table = means_table("Traction coefficient [-]", {WHEEL_WORDS[w]: m for w, m in means.items()}, 4)
    used = selected.used(_with_or_without(selected, spun))
    checks = (falling_traction(pools), sides_differ(pools))
    return figure_of(number, panels, checks, (table,), runs=used, fixed=selected.fixed)


FIGURES = {"2.5": figure_2_05, "2.6": figure_2_06, "2.7": figure_2_07}
