"""Figures 2.5 to 2.7: driven wheels spin up in passes over water, over time and over speed, and their traction."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from aqualog.campaign.bins import Plan, Pool
from aqualog.campaign.means import is_spinning, spin_ups
from aqualog.campaign.results import RunInfo, RunSamples
from aqualog.core.records import BoolArray, FloatArray
from aqualog.report.theme import wheel_colour
from aqualog.thesis.catalogue import figure_of, needs_of
from aqualog.thesis.claims import Check, judge, limit
from aqualog.thesis.evidence.campaign import KMH, Evidence
from aqualog.thesis.evidence.measures import (
    TEN,
    Effect,
    bin_means,
    difference,
    full_speed,
    over_passes,
    passes_of,
    pool_of,
    trend,
)
from aqualog.thesis.evidence.selection import FAMILIES, NotInCampaign, Selected, value_of
from aqualog.thesis.figures.run_panels import V_KMH, clouds, means_line, means_table, speed_panels, spread_over
from aqualog.thesis.figures.time_panels import WHEEL_WORDS
from aqualog.thesis.record import Axis, Figure, Line, Panel

__all__ = ["FIGURES"]

_FAR = limit("far", "C20.figure")  # [km/h] "far below" the speed of full aquaplaning
_IRREGULAR = limit("irregular", "C21.figure")  # [km/h] over which passes with and without a spin-up mix
_LEAST = 5  # passes
_LEAST_STEPS = 2  # of 0.1 s that a wheel spins


def chosen_spin_ups(evidence: Evidence, number: str) -> tuple[Selected, list[RunInfo]]:
    """Runs of the configuration that is shown, and those of them in which a driven wheel spins up.

    Raises
    ------
    NotInCampaign
    """
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
    full = full_speed(passes_of(evidence, runs))
    known = bool(np.isfinite(full))
    away = ((full if known else float(v.max())) - float(v[hit > 0].min())) / KMH
    demand = np.array([_demand(evidence, r) for r in runs])
    there = np.isfinite(demand)
    effects = (
        over_passes([np.ones(v.size)[there], (v[there] - v[there].mean()) / TEN, demand[there] / 0.01], hit[there])
        if there.sum() > _LEAST
        else None
    )
    by_torque = effects[2] if effects is not None else None
    is_far, is_driven = away >= _FAR, by_torque is not None and by_torque.is_above
    what = (
        f"full aquaplaning at {full / KMH:.0f} km/h"
        if known
        else f"the fastest pass, {v.max() / KMH:.0f} km/h, still below full aquaplaning"
    )
    told = (
        f"; share of passes with a spin-up per 0.01 of traction demanded before the water, at equal speed: "
        f"{by_torque.words(3)}"
        if by_torque is not None
        else "; the traction demanded is not known"
    )
    outcome = (
        f"slowest pass with a spin-up {v[hit > 0].min() / KMH:.0f} km/h; {what}{told}; {int(hit.sum())} of "
        f"{hit.size} "
        "passes spin up"
    )
    return judge(
        "C20.figure",
        outcome,
        whole=is_far and is_driven,
        part=is_far or is_driven,
        value=None if by_torque is None else by_torque.value,
        ci95=None if by_torque is None else by_torque.ci,
        unit="per 0.01" if by_torque is not None else "",
        reason=""
        if is_far and is_driven
        else "The influence of the torque does not exceed the scatter."
        if is_far
        else "Spin-ups begin close to full aquaplaning.",
    )


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
    return judge("C21.figure", outcome, whole=whole, part=mixed > 0.0, value=mixed if np.isfinite(mixed) else None)


def spin_up_pool(evidence: Evidence, runs: Sequence[RunInfo], wheel: str) -> Pool | None:
    """Traction coefficient of a wheel from its torque during its spin-ups on water; None without."""

    def columns(info: RunInfo, samples: RunSamples) -> tuple[BoolArray, FloatArray]:
        return is_spinning(samples, wheel) & (samples.on_water == 1.0), samples.array(f"mu_{wheel}")

    return pool_of(evidence, runs, columns)


def falling_traction(pools: dict[str, Pool]) -> Check | None:
    """C22: the traction coefficient in spin-ups falls with speed."""
    effects = {w: e for w, p in pools.items() if (e := trend(p)).ci is not None}
    if not effects:
        return None
    down = [w for w, e in effects.items() if e.is_below]
    worst = max(effects.values(), key=lambda e: e.high)
    whole = len(down) == len(effects)
    outcome = "per 10 km/h: " + "; ".join(f"{w} {e.words(4)}" for w, e in effects.items())
    fields = {"why": _unsure(effects, pools)}
    return judge("C22.figure", outcome, whole=whole, part=bool(down), value=worst.value, ci95=worst.ci, fields=fields)


def _unsure(effects: Mapping[str, Effect], pools: Mapping[str, Pool]) -> str:
    rising = [w for w, e in effects.items() if e.is_above]
    if rising:
        return f"It rises at {', '.join(rising)}."
    words = (f"{w}: {p.runs} runs at {p.columns['v_x'].min() / KMH:.0f} to {p.columns['v_x'].max() / KMH:.0f} km/h"
             for w, p in pools.items())  # fmt: skip
    return f"The spin-ups are too few or cover too small a range of speed ({'; '.join(words)})."


def sides_differ(pools: dict[str, Pool]) -> Check | None:
    """C23: left and right differ, because there is less water on the left."""
    left, right = (next((p for w, p in pools.items() if w[1] == side), None) for side in "lr")
    found = difference(right, left) if left is not None and right is not None else None
    if found is None:
        return None
    level = found[0]
    outcome = f"left less right {level.words(4)}"
    part = level.value > 0.0
    reason = (
        ""
        if level.is_above
        else "The two sides do not differ significantly."
        if level.low <= 0.0 <= level.high
        else "The right wheel carries more."
    )
    return judge(
        "C23.figure", outcome, whole=level.is_above, part=part, value=level.value, ci95=level.ci, reason=reason
    )


_PANELS = 4


def figure_2_05(number: str, evidence: Evidence) -> Figure:
    """Four passes with spin-ups over time; C20 and C21 over all passes of the configuration.

    Raises
    ------
    NotInCampaign
    """
    selected, spun = chosen_spin_ups(evidence, number)
    v = [evidence.of(r).v for r in spun]
    shown = spread_over(spun, evidence, list(np.linspace(min(v), max(v), _PANELS)))
    drawn = {r.index for r in shown}
    return figure_of(
        number,
        tuple(speed_panels(evidence, shown)),
        (far_below(evidence, selected.runs), irregular(evidence, selected.runs)),
        runs=selected.used({r.index: "drawn, and counted" if r.index in drawn else "counted" for r in selected.runs}),
        fixed=selected.fixed,
        slowest=min(v) / KMH,
        fastest=max(v) / KMH,
    )


def figure_2_06(number: str, evidence: Evidence) -> Figure:
    """Clouds of slips of the driven wheels; C20 and C21.

    Raises
    ------
    NotInCampaign
    """
    selected, spun = chosen_spin_ups(evidence, number)
    lines = clouds(evidence, selected.runs, "slip_max", selected.runs[0].vehicle.driven)
    if not lines:
        raise NotInCampaign(
            "needs wheel speeds and the car's speed on water: no slip in any pass", where=f"figure {number}"
        )
    return figure_of(
        number,
        (Panel("Slip of the driven wheels", V_KMH, Axis("slip", "%"), tuple(lines)),),
        (far_below(evidence, selected.runs), irregular(evidence, selected.runs)),
        runs=selected.used({r.index: "with spin-up" if r in spun else "without spin-up" for r in selected.runs}),
        fixed=selected.fixed,
        spun=len(spun),
        passes=len(selected.runs),
    )


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


def figure_2_07(number: str, evidence: Evidence) -> Figure:
    """Mean traction coefficient per bin of speed and wheel; C22 and C23.

    Raises
    ------
    NotInCampaign
    """
    selected, spun = chosen_spin_ups(evidence, number)
    wheels = selected.runs[0].vehicle.driven
    pools = {w: p for w in wheels if (p := spin_up_pool(evidence, spun, w)) is not None}
    means = {w: m for w, p in pools.items() if (m := bin_means(p)).v_kmh.size}
    if not means:
        raise NotInCampaign(
            "needs the torque of the driven wheels in spin-ups on water: no traction in any", where=f"figure {number}"
        )  # fmt: skip
    lines = [
        means_line(WHEEL_WORDS[w], m, (wheel_colour(w), "solid", "circle"), shift=0.4 * (2 * i - 1))
        for i, (w, m) in enumerate(means.items())
    ]
    low = tuple(_lower_bound(evidence, spun))
    return figure_of(
        number,
        (
            Panel("Traction coefficient in spin-ups, from the torque", V_KMH, _MU, tuple(lines)),
            *([Panel("Less the water's share of the torque (lower bound)", V_KMH, _MU, low)] if low else []),
        ),
        (falling_traction(pools), sides_differ(pools)),
        (means_table("Traction coefficient [-]", {WHEEL_WORDS[w]: m for w, m in means.items()}, 4),),
        runs=selected.used({r.index: "with spin-up" if r in spun else "without spin-up" for r in selected.runs}),
        fixed=selected.fixed,
    )


FIGURES = {"2.5": figure_2_05, "2.6": figure_2_06, "2.7": figure_2_07}
