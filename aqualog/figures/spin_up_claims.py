"""Passes in which driven wheels spin up: which ones, and claims of Figures 2.5 to 2.7."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from aqualog.campaign.bins import Pool
from aqualog.campaign.samples import RunInfo, RunSamples
from aqualog.campaign.spin_ups import is_spinning
from aqualog.core.records import BoolArray, FloatArray
from aqualog.figures.evidence import KMH, Evidence
from aqualog.figures.measures import TEN, Effect, difference, pool_of, trend
from aqualog.figures.passes import full_speed, over_passes, passes_of
from aqualog.figures.record import Finding, judged
from aqualog.figures.selection import FAMILIES, NotInCampaign, Selected, Wish, choose, value_of
from aqualog.figures.tyres import WORN

__all__ = [
    "WISH",
    "chosen_spin_ups",
    "falling_traction",
    "far_below",
    "irregular",
    "sides_differ",
    "spin_up_pool",
    "spins",
]

WISH = Wish((), WORN, "highest", 1.3)
_FAR = 20.0  # [km/h] "far below" the speed of full aquaplaning
_IRREGULAR = 10.0  # [km/h] over which passes with and without a spin-up mix
_LEAST = 5  # passes
_LEAST_STEPS = 2  # of 0.1 s that a wheel spins


def chosen_spin_ups(evidence: Evidence, number: str) -> tuple[Selected, list[RunInfo]]:
    """Runs of the configuration that is shown, and those of them in which a driven wheel spins up.

    Raises
    ------
    NotInCampaign
    """
    needs = "passes over water in which a driven wheel spins up"
    runs = evidence.data.runs
    with_some = [r for r in runs if r.is_done and not evidence.has_water(r) and spins(evidence, r)]
    if not with_some:
        raise NotInCampaign(f"needs {needs}: none of {len(runs)} runs has one", where=f"figure {number}")
    # the configuration by the runs that spin up; of it all runs count
    narrow = choose(
        with_some, WISH, campaign=evidence.name, number=number, is_of_use=evidence.has_water, needs=needs
    )  # fmt: skip
    like = narrow.runs[0]
    selected = choose(
        runs, WISH, campaign=evidence.name, number=number, needs=needs,
        is_of_use=lambda r: evidence.has_water(r) or ("" if _like(r) == _like(like) else "in another configuration"),
    )  # fmt: skip
    return selected, [r for r in selected.runs if spins(evidence, r)]


def _like(info: RunInfo) -> tuple[object, ...]:
    return tuple(value_of(info, f) for f in FAMILIES)


def spins(evidence: Evidence, info: RunInfo) -> bool:
    """Whether a driven wheel spins up on the water: by its slip, since the detector leaves out wheels that still have
    grip."""
    samples, wet = evidence.wet(info)
    return any(int(np.count_nonzero(wet & is_spinning(samples, w))) >= _LEAST_STEPS for w in info.vehicle.driven)


def far_below(evidence: Evidence, runs: Sequence[RunInfo]) -> list[Finding]:
    """C20: spin-ups far below full aquaplaning, by the torque."""
    facts = [evidence.of(r) for r in runs]
    v = np.array([f.v for f in facts])
    hit = np.array([float(spins(evidence, r)) for r in runs])
    if len(runs) < _LEAST or not hit.any():
        return []
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
    return [
        Finding(
            "C20",
            "Spin-ups occur at speeds far below full aquaplaning, depending on the drive torque.",
            f"the slowest pass with a spin-up is at least {_FAR:g} km/h below full aquaplaning (or below the fastest "
            "pass, "
            "if that is not reached), and at equal speed a larger traction demanded before the water makes a spin-up "
            "likelier: interval above 0 (value); in part: one of both",
            f"slowest pass with a spin-up {v[hit > 0].min() / KMH:.0f} km/h; {what}{told}; {int(hit.sum())} of "
            f"{hit.size} "
            "passes spin up",
            judged(whole=is_far and is_driven, part=is_far or is_driven),
            "" if is_far and is_driven else
            "The influence of the torque does not exceed the scatter." if is_far else
            "Spin-ups begin close to full aquaplaning.",
            None if by_torque is None else by_torque.value, None if by_torque is None else by_torque.ci,
            "per 0.01" if by_torque is not None else "",
        )
    ]  # fmt: skip


def _demand(evidence: Evidence, info: RunInfo) -> float:
    """Mean traction of the driven wheels on the dry road before the water; NaN without. [-]"""
    samples = evidence.data.samples(info)
    before = (samples.on_water == 0.0) & (samples.t < evidence.of(info).entry)
    mu = np.array([samples.array(f"mu_{w}")[before] for w in info.vehicle.driven])
    return float(np.nanmean(mu)) if np.isfinite(mu).any() else float("nan")


def irregular(evidence: Evidence, runs: Sequence[RunInfo]) -> list[Finding]:
    """C21: passes with and without a spin-up mix over the speeds."""
    hit = np.array([spins(evidence, r) for r in runs])
    v = np.array([evidence.of(r).v for r in runs]) / KMH
    if len(runs) < _LEAST or not hit.any():
        return []
    mixed = float(v[~hit].max() - v[hit].min()) if not hit.all() else float("-inf")
    whole = mixed >= _IRREGULAR
    return [
        Finding(
            "C21",
            "Spin-ups at the rear occur irregularly over the speed.",
            f"the fastest pass without a spin-up is at least {_IRREGULAR:g} km/h faster than the slowest one with; "
            "in part: "
            "faster at all",
            f"with a spin-up from {v[hit].min():.0f} km/h on, without one up to "
            + (f"{v[~hit].max():.0f} km/h" if not hit.all() else "no speed: all passes spin up"),
            judged(whole=whole, part=mixed > 0.0),
            "" if whole else "From one speed on nearly all passes spin up.",
            mixed if np.isfinite(mixed) else None, None, "km/h",
        )
    ]  # fmt: skip


def spin_up_pool(evidence: Evidence, runs: Sequence[RunInfo], wheel: str) -> Pool | None:
    """Traction coefficient of a wheel from its torque during its spin-ups on water; None without."""

    def columns(info: RunInfo, samples: RunSamples) -> tuple[BoolArray, FloatArray]:
        return is_spinning(samples, wheel) & (samples.on_water == 1.0), samples.array(f"mu_{wheel}")

    return pool_of(evidence, runs, columns)


def falling_traction(pools: dict[str, Pool]) -> list[Finding]:
    """C22: the traction coefficient in spin-ups falls with speed."""
    effects = {w: e for w, p in pools.items() if (e := trend(p)).ci is not None}
    if not effects:
        return []
    down = [w for w, e in effects.items() if e.is_below]
    worst = max(effects.values(), key=lambda e: e.high)
    whole = len(down) == len(effects)
    return [
        Finding(
            "C22",
            "The mean traction coefficient in spin-ups falls with speed, in agreement with (2.1).",
            "the interval of its gradient is below 0 for every driven wheel; in part: for one",
            "per 10 km/h: " + "; ".join(f"{w} {e.words(4)}" for w, e in effects.items()),
            judged(whole=whole, part=bool(down)),
            "" if whole else _unsure(effects, pools),
            worst.value, worst.ci, "per 10 km/h",
        )
    ]  # fmt: skip


def _unsure(effects: Mapping[str, Effect], pools: Mapping[str, Pool]) -> str:
    rising = [w for w, e in effects.items() if e.is_above]
    if rising:
        return f"It rises at {', '.join(rising)}."
    words = (f"{w}: {p.runs} runs at {p.columns['v_x'].min() / KMH:.0f} to {p.columns['v_x'].max() / KMH:.0f} km/h"
             for w, p in pools.items())  # fmt: skip
    return f"The spin-ups are too few or cover too small a range of speed ({'; '.join(words)})."


def sides_differ(pools: dict[str, Pool]) -> list[Finding]:
    """C23: left and right differ, because there is less water on the left."""
    left, right = (next((p for w, p in pools.items() if w[1] == side), None) for side in "lr")
    found = difference(right, left) if left is not None and right is not None else None
    if found is None:
        return []
    level = found[0]
    return [
        Finding(
            "C23",
            "The curves of rear left and rear right differ, because the water on the left is lower and more irregular.",
            "left less right at equal speed: the interval is above 0; in part: it is above 0 in the mean",
            f"left less right {level.words(4)}",
            judged(whole=level.is_above, part=level.value > 0.0),
            "" if level.is_above else
            "The two sides do not differ significantly." if level.low <= 0.0 <= level.high else
            "The right wheel carries more.",
            level.value, level.ci, "-",
        )
    ]  # fmt: skip
