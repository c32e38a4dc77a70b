"""Claim that a loss of slip slope is found in ordinary driving (C47): the detector itself, on simulated signals."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aqualog.evaluate.intervals import wilson
from aqualog.figures.scene_study import MANY, SOME, SceneRun, known, run_of
from aqualog.model.scenario import Lane, Profile, Scenario
from aqualog.model.thesis_scenes import scene
from aqualog.reproduce.check import Check, Checks, Plan
from aqualog.reproduce.passes import KMH
from aqualog.reproduce.tables import SHAPE, spread_over
from aqualog.reproduce.verdict import judged

__all__ = ["Found", "detected", "scenario_of"]

SCENE = "2.25"  # rear-wheel drive, worn summer tyres, low pressure, 0.8 mm
RUNS = 12
ENTRY, EXIT, END = 12.0, 18.0, 20.0  # [s]
MANOEUVRES: dict[str, Profile] = {
    "constant speed": ((0.0, 100.0 * KMH),),
    "moderate acceleration": ((0.0, 92.0 * KMH), (ENTRY, 92.0 * KMH), (END, 92.0 * KMH + 0.8 * (END - ENTRY))),
}
HIGH = 0.6  # [-] utilisation that is high: what estimators of the maximum friction need (thesis 1)


@dataclass(frozen=True, slots=True)
class Found:
    """One drive.

    `after_s`: time from the entry to the first loss of slope found on the lane, NaN without one [s]; `mu`: largest
    traction coefficient of a rear wheel until then [-]; `utilisation`: 95 % quantile of it over the residual friction
    [-]; `is_early`: found before the lane.
    """

    after_s: float
    mu: float
    utilisation: float
    is_early: bool


def scenario_of(manoeuvre: str, seed: int) -> Scenario:
    """The drive: dry road, 6 s of water."""
    wet = scene(SCENE)
    lane = wet.lanes[0]
    lane = Lane(ENTRY, EXIT, depth_left=lane.depth_left, depth_right=lane.depth_right,
                irregularity_left=lane.irregularity_left)  # fmt: skip
    return replace(wet, speed=MANOEUVRES[manoeuvre], lanes=(lane,), duration_s=END, seed=seed)


def _found(item: tuple[str, int]) -> Found:
    r = run_of(scenario_of(*item), known(SCENE))
    times = r.events("slip_slope_drop")
    on = [t for t in times if r.entry <= t <= r.exit]
    mu, share = _used(r, min(on, default=r.exit))
    return Found(min(on) - r.entry if on else np.nan, mu, share, any(t < r.entry for t in times))


def _used(r: SceneRun, until: float) -> tuple[float, float]:
    span = r.within(r.entry, until + r.result.signals.dt)
    mu = [np.abs(r.signal(f"true_force_x_{w}") / r.signal(f"true_load_{w}"))[span] for w in ("rl", "rr")]
    friction = [np.maximum(r.signal(f"true_mu_max_{w}")[span], 1e-3) for w in ("rl", "rr")]
    return float(np.max(mu)), float(max(np.quantile(a / b, 0.95) for a, b in zip(mu, friction, strict=True)))


def _check(manoeuvre: str, found: list[Found]) -> Check:
    n = len(found)
    gentle = [np.isfinite(f.after_s) and f.utilisation < HIGH for f in found]
    k, early = sum(gentle), sum(f.is_early for f in found)
    there = [f.after_s for f in found if np.isfinite(f.after_s)]
    when = f"after {np.median(there):.2f} s (median)" if there else "never"
    whole = k >= MANY * n and early == 0
    return Check(
        "C47",
        f"a loss of half the dry slope found on the lane, with less than {HIGH:.0%} of the residual friction used by "
        f"either rear wheel until then (95 % quantile), in {MANY:.0%} of the drives, and none found before it in any; "
        f"with a difference: in {SOME:.0%}",
        f"{k} of {n} ({len(there)} found at all), {when}; traction coefficient at most "
        f"{max(f.mu for f in found):.3f}, utilisation {max(f.utilisation for f in found):.2f}; found "
        f"before the lane in {early}",
        judged(whole=whole, part=k >= SOME * n), part=manoeuvre, value=k / n, ci95=wilson(k, n),
        reason=SHAPE if whole else SHAPE
        + " In the other drives it is not found, not without high utilisation, or before the lane.",
        source="default detector with its sensors, slope remembered from a dry drive; 0.8 mm, "
        + ("100 km/h" if manoeuvre == "constant speed" else "0.8 m/s^2 from 92 km/h"),
    )  # fmt: skip


def detected(plan: Plan) -> Checks:
    """C47 at constant speed and under moderate acceleration."""
    items = [(m, s) for m in MANOEUVRES for s in plan.first(RUNS)]
    found = spread_over(_found, items, plan, "drives")
    by_manoeuvre = {m: [f for (name, _), f in zip(items, found, strict=True) if name == m] for m in MANOEUVRES}
    return tuple(_check(m, f) for m, f in by_manoeuvre.items())
