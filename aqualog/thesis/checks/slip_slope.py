"""The slip slope of the driven rear tyres, by passes; the detector of its loss, its reference, and other causes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from aqualog.core.intervals import wilson
from aqualog.core.records import DriveResult, FloatArray
from aqualog.core.vehicle import KEYS, Vehicle
from aqualog.detect.slip_slope.history import History, Rule, remembered
from aqualog.detect.slip_slope.watch import Memory
from aqualog.detect.stream import detect_drive
from aqualog.model.drawing import KMH, SCORING_POOL
from aqualog.model.effects import EFFECTS
from aqualog.model.programme import SEDAN, scene
from aqualog.model.scenario import SURFACES, Lane, Profile, Scenario
from aqualog.model.term import Model, Term
from aqualog.model.tyre import TYRES
from aqualog.thesis.checks.resistance import CONFIGURATIONS, LOADED, SLOW, UNLOADED, at_speeds
from aqualog.thesis.checks.spins import full_speed
from aqualog.thesis.claims import NEEDS_DATA, Check, Checks, judge, limit
from aqualog.thesis.evidence.drives import drives, made, variants
from aqualog.thesis.evidence.passes import HIGH, LOW, MEDIUM, SLOPE_EDGES, Pass, figures_of, initial_slope
from aqualog.thesis.evidence.scenes import MANY, SOME, SceneRun, known, run_of
from aqualog.thesis.evidence.seeds import (
    PASS_SEEDS,
    Maker,
    Plan,
    Rows,
    Statistic,
    Table,
    bootstrap,
    by_passes,
    cells_of,
    estimate,
    mean,
    mean_of,
    said,
    scatter,
    share,
    spread_over,
    told,
)

__all__ = ["CHECKS"]

WORN = Pass(94, wiggles=True)
VERY_WORN = Pass(100, tyre="very_worn_summer", h=0.8e-3, wiggles=True)
DRY_VERY_WORN = Pass(80, tyre="very_worn_summer", h=0.0, wiggles=True)
FULL_GRID = tuple(replace(VERY_WORN, kmh=v, wiggles=False) for v in range(104, 140, 4))
FALLING = ("very worn", "very worn 0.6 mm", "very worn 2.0 mm", "worn", "worn medium", "worn high")
DEPTHS = (0.8e-3, 1.1e-3, 1.3e-3, 2.0e-3)  # [m]
RAMPS = tuple(Pass(v, a=1.0, wiggles=True) for v in (78, 94))
STOPPING, TENTH = 0.2, 0.1
BIN_ERROR, BIN_SAMPLES = limit("bin_error", "C49.passes"), 200
BELOW_FULL, BELOW_TOLERANCE = limit("below_full", "C48.passes"), limit("below_tolerance", "C48.passes")  # [km/h]


def _wiggling(name: str) -> Pass:
    return replace(CONFIGURATIONS[name], wiggles=True)


def slopes_of(table: Table, p: Pass, speeds: Sequence[float], wheel: str = "rr") -> FloatArray:
    """Slope of a wheel, array (speeds, seeds)."""
    return cells_of(table, at_speeds(p, speeds), f"slope_{wheel}")


def _c48(table: Table) -> Check:
    wet, dry = table[VERY_WORN].of("slope_rr"), mean(table[DRY_VERY_WORN].of("slope_rr"))
    value, ci = estimate(lambda r: mean(wet[r]) / dry, wet.size)
    full, full_ci = estimate(full_speed(table, FULL_GRID), wet.size)
    is_near = abs(full - VERY_WORN.kmh - BELOW_FULL) <= BELOW_TOLERANCE
    outcome = f"{mean(wet):.1f} of {dry:.1f}: {told(value, ci, 2)}; full aquaplaning at {told(full, full_ci)} km/h"
    late = "" if is_near else " This tyre floats fully at another speed than the thesis reports of its own."
    whole, fields = ci[1] < 0.8 and is_near, {"away": late}
    return judge("C48.passes", outcome, whole=whole, part=value < 1.0, value=value, ci95=ci, fields=fields)


def _c49(table: Table) -> Check:
    passes = [*at_speeds(WORN), *RAMPS]
    points, dry = cells_of(table, passes, "points"), cells_of(table, passes, "slope_dry")
    friction, edges = SEDAN.mu_max * TYRES[WORN.tyre].wet_friction, SLOPE_EDGES
    bin_of = np.digitize(points[..., 0], edges)

    def slope(x: FloatArray, reference: float) -> float:
        return initial_slope(x[:, 1], x[:, 2], friction=friction, dry=reference)

    @cache  # both errors are of the same draws
    def errors(draw: bytes) -> tuple[float, float, FloatArray]:
        rows = np.frombuffer(draw, dtype=np.intp)
        some, where, reference = points[:, rows], bin_of[:, rows], float(np.mean(dry[:, rows]))
        parts = [some[where == k] for k in range(1, edges.size)]
        parts = [x for x in parts if x.shape[0] >= BIN_SAMPLES]
        truth = np.array([x[:, 3].mean() for x in parts])
        binned = np.array([slope(x, reference) for x in parts]) / truth - 1.0
        whole = slope(np.concatenate(parts), reference) / truth - 1.0
        return float(np.sqrt(np.mean(binned**2))), float(np.sqrt(np.mean(whole**2))), binned

    n = points.shape[1]
    value, ci = estimate(lambda r: errors(r.tobytes())[0], n)
    without, ci_without = estimate(lambda r: errors(r.tobytes())[1], n)
    binned = errors(np.arange(n).tobytes())[2]
    at = [v for k, v in enumerate(edges[:-1] + 5.0) if np.count_nonzero(bin_of == k + 1) >= BIN_SAMPLES]
    whole, part = value < BIN_ERROR and value < 0.5 * without, value < without
    outcome = (
        f"rms error {told(100 * value, (100 * ci[0], 100 * ci[1]))} % in bins, "
        f"{told(100 * without, (100 * ci_without[0], 100 * ci_without[1]))} % without; "
        + ", ".join(f"{v:.0f} km/h: {100 * e:+.1f} %" for v, e in zip(at, binned, strict=True))
    )
    return judge("C49.passes", outcome, whole=whole, part=part, value=value, ci95=ci)


def _c50(table: Table) -> Check:
    rows, spans = [], []
    for v in SLOW:
        cells = {h: table[replace(WORN, kmh=v, h=h)] for h in DEPTHS}
        # the thesis' own condition: as long as the front tyres do not aquaplane fully
        kept = [c.of("slope_rr") for c in cells.values() if c.of("any_stop").mean() < STOPPING]
        means = [mean(x) for x in kept]
        rows.append((v, len(kept), max(means) - min(means), max(scatter(x) for x in kept), float(np.mean(means))))
        spans.append(kept)
    inside = [s < max(noise, TENTH * m) for _, _, s, noise, m in rows]

    def worst(r: Rows) -> float:
        means = [[mean(x[r]) for x in kept] for kept in spans]
        return max((max(m) - min(m)) / float(np.mean(m)) for m in means)

    value, ci = estimate(worst, len(table[WORN].figures))
    outcome = (
        "; ".join(f"{v} km/h: {s:.1f} against {noise:.1f} (slope {m:.1f}, {k} depths)" for v, k, s, noise, m in rows)
        + f"; largest share of the slope {told(value, ci, 2)}"
    )
    return judge("C50.passes", outcome, whole=all(inside), part=sum(inside) > len(inside) / 2, value=value, ci95=ci)


def _gradient(values: FloatArray) -> Statistic:
    """Gradient over `SLOW` of the mean over some of the seeds; values (speeds, seeds)."""
    return lambda rows: float(np.polyfit(SLOW, np.nanmean(values[:, rows], axis=1), 1)[0])


def _c51(table: Table) -> Check:
    found = {}
    for name in FALLING:
        for w in ("rl", "rr"):
            x = slopes_of(table, _wiggling(name), SLOW, w)
            found[f"{name} {w}"] = estimate(_gradient(x), x.shape[1], of=2 * len(FALLING))
    falling = [x < 0.0 for x, _ in found.values()]
    value, ci = max(found.values())
    outcome = "per km/h: " + ", ".join(f"{k} {told(*x, 2)}" for k, x in found.items())
    return judge("C51.passes", outcome, whole=all(falling), part=bool(np.mean(falling) >= 0.8), value=value, ci95=ci)


def _c52(table: Table) -> Check:
    left, right = (slopes_of(table, WORN, SLOW, w) for w in ("rl", "rr"))
    uneven = [float(np.mean([scatter(x) / mean(x) for x in side])) for side in (left, right)]
    higher = float(np.nanmean(left)) > float(np.nanmean(right))
    value, ci = estimate(lambda r: float(np.nanmean(left[:, r]) / np.nanmean(right[:, r])), left.shape[1])
    ratio = said(lambda r: _ratio(_unevenness(left[:, r]), _unevenness(right[:, r])), left.shape[1], 2)
    outcome = (
        f"left over right {told(value, ci, 3)}; scatter {uneven[0]:.3f} left, {uneven[1]:.3f} right, ratio {ratio}"
    )
    whole = higher and uneven[0] > uneven[1]
    return judge("C52.passes", outcome, whole=whole, part=higher or uneven[0] > uneven[1], value=value, ci95=ci)


def _ratio(a: float, b: float) -> float:
    return a / b if b > 0.0 else float("nan")


def _unevenness(values: FloatArray) -> float:
    return float(np.nanmean(np.nanstd(values, axis=1, ddof=1) / np.nanmean(values, axis=1)))


FEW = (70, 86, 102)  # [km/h]
WINTER_SPEEDS, WINTER_DEPTHS = (70, 90, 110), (1.3e-3, 2.0e-3)
SLIGHT = limit("slight", "C55.passes")  # of the slope


def _levels(values: FloatArray) -> list[float]:
    return [mean(x) for x in values]


def _c53(table: Table) -> Check:
    values = {
        n: slopes_of(table, replace(WORN, p=p), FEW) for n, p in (("low", LOW), ("medium", MEDIUM), ("high", HIGH))
    }
    level = {n: _levels(x) for n, x in values.items()}
    drop = {n: x[0] - x[-1] for n, x in level.items()}
    gap = [abs(level["low"][i] - level["high"][i]) for i in (0, -1)]
    smaller = level["high"][0] < level["medium"][0] < level["low"][0] * 1.001
    flatter = drop["high"] < 0.7 * drop["low"]

    def share(rows: Rows) -> float:
        high, low = (mean(values[n][0, rows]) - mean(values[n][-1, rows]) for n in ("high", "low"))
        return high / low

    value, ci = estimate(share, values["low"].shape[1])
    outcome = (
        "; ".join(f"{n}: " + ", ".join(f"{x:.1f}" for x in level[n]) for n in level)
        + f" at {', '.join(map(str, FEW))} km/h; decrease at high over low {told(value, ci, 2)}; gap {gap[0]:.1f} "
        f"to {gap[1]:.1f}"
    )
    whole = smaller and flatter and gap[1] < gap[0]
    return judge("C53.passes", outcome, whole=whole, part=smaller and flatter, value=value, ci95=ci)


def _c54(table: Table) -> Check:
    winter = {h: slopes_of(table, Pass(90, tyre="new_winter", h=h, wiggles=True), WINTER_SPEEDS) for h in WINTER_DEPTHS}
    rows = {h: (mean(x[0]) - mean(x[-1]), max(scatter(y) for y in x), mean(x[0])) for h, x in winter.items()}
    worn = _levels(slopes_of(table, WORN, (70, 102)))
    falls = worn[1] < 0.8 * worn[0]
    still, nearly = (all(abs(d) < max(s, k * m) for d, s, m in rows.values()) for k in (0.05, 0.10))

    def worst(r: Rows) -> float:
        return max((mean(x[0, r]) - mean(x[-1, r])) / mean(x[0, r]) for x in winter.values())

    value, ci = estimate(worst, winter[WINTER_DEPTHS[0]].shape[1])
    outcome = (
        "; ".join(f"{1e3 * h:.1f} mm: {d:+.2f} of {m:.1f} (scatter {s:.2f})" for h, (d, s, m) in rows.items())
        + f", largest loss {told(100 * value, (100 * ci[0], 100 * ci[1]))} %; worn {worn[0]:.1f} to {worn[1]:.1f}"
    )
    return judge("C54.passes", outcome, whole=still and falls, part=nearly and falls, value=value, ci95=ci)


def _c55(table: Table) -> Check:
    base = slopes_of(table, replace(UNLOADED, wiggles=True), FEW)
    cases = {k: slopes_of(table, replace(p, wiggles=True), FEW) for k, p in LOADED.items()}
    change = {k: np.nanmean(x, axis=0) - np.nanmean(base, axis=0) for k, x in cases.items()}
    found = {k: estimate(mean_of(x), x.size, of=len(change)) for k, x in change.items()}
    above = [x > 0.0 for x, _ in found.values()]
    share = max(x for x, _ in found.values()) / float(np.nanmean(base))
    is_slight = share <= SLIGHT
    value, ci = min(found.values())
    outcome = f"{np.nanmean(base):.1f}; " + ", ".join(f"{k} {told(*x, 2)}" for k, x in found.items()) + " more"
    more = "" if all(above) else " Not each of them raises the slope."
    more += "" if is_slight else f" The largest is {share:.0%} of the slope, which is more than slight."
    whole = all(above) and is_slight
    return judge("C55.passes", outcome, whole=whole, part=sum(above) >= 2, value=value, ci95=ci, fields={"more": more})


SCENE = "2.25"  # rear-wheel drive, worn summer tyres, low pressure, 0.8 mm
RUNS = 12
ENTRY, EXIT, END = 12.0, 18.0, 20.0  # [s]
MANOEUVRES: dict[str, Profile] = {
    "constant speed": ((0.0, 100.0 * KMH),),
    "moderate acceleration": ((0.0, 92.0 * KMH), (ENTRY, 92.0 * KMH), (END, 92.0 * KMH + 0.8 * (END - ENTRY))),
}
# [-] utilisation that is high: what estimators of the maximum friction need (thesis 1)
HIGH_UTILISATION = limit("high", "C47.drives")


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
    gentle = [np.isfinite(f.after_s) and f.utilisation < HIGH_UTILISATION for f in found]
    k, early = sum(gentle), sum(f.is_early for f in found)
    there = [f.after_s for f in found if np.isfinite(f.after_s)]
    when = f"after {np.median(there):.2f} s (median)" if there else "never"
    whole = k >= MANY * n and early == 0
    outcome = (
        f"{k} of {n} ({len(there)} found at all), {when}; traction coefficient at most {max(f.mu for f in found):.3f}, "
        f"utilisation {max(f.utilisation for f in found):.2f}; found before the lane in {early}"
    )
    speed = "100 km/h" if manoeuvre == "constant speed" else "0.8 m/s^2 from 92 km/h"
    fields = {"manoeuvre": manoeuvre, "speed": speed}
    return judge("C47.drives", outcome, whole=whole, part=k >= SOME * n, value=k / n, ci95=wilson(k, n), fields=fields)


def detected(plan: Plan) -> Checks:
    """C47 at constant speed and under moderate acceleration."""
    items = [(m, s) for m in MANOEUVRES for s in plan.first(RUNS)]
    found = spread_over(_found, items, plan, "drives")
    by_manoeuvre = {m: [f for (name, _), f in zip(items, found, strict=True) if name == m] for m in MANOEUVRES}
    return tuple(_check(m, f) for m, f in by_manoeuvre.items())


def _winter() -> Iterator[Pass]:
    yield from at_speeds(WORN, (70, 102))
    for h in WINTER_DEPTHS:
        yield from at_speeds(Pass(90, tyre="new_winter", h=h, wiggles=True), WINTER_SPEEDS)


_CAR = replace(SCORING_POOL.vehicles[0], given=frozenset({"name", "drivetrain", *KEYS}))
_UNKNOWN = replace(_CAR, given=_CAR.given - {"tyre.slip_slope_f", "tyre.slip_slope_r"})
_GAINS = (0.45, 1.8)  # slope of the tyres on the car over that in the vehicle file: soft winter tyres, stiff worn ones
_DRY_S, _WET_S, _ENTRY = 45.0, 40.0, 25.0  # [s]


def _drive(
    gain: float, seed: int, memory: Memory | None = None, *, car: Vehicle = _CAR, snow: bool = False,
    seconds: float = _DRY_S, draw: int = 56,
) -> DriveResult:  # fmt: skip
    """A drive on tyres of another slope, with speeds drawn from `draw`, under the detectors."""
    rng = np.random.default_rng([seed, draw])
    speed = tuple((float(t), float(rng.uniform(70.0, 105.0)) / 3.6) for t in np.arange(0.0, seconds + 8.0, 8.0))
    lanes = (Lane(_ENTRY, seconds, surface=SURFACES["snow"]),) if snow else ()
    tyre, of_noise = TYRES["worn_summer"], seed + 500 * (draw - 56)
    scenario = Scenario(car, tyre, tyre, duration_s=seconds, seed=of_noise, speed=speed, lanes=lanes)
    model = Model((Term(EFFECTS["slip_stiffness"], {"gain": gain}, None),))
    d = made("reference", seed, scenario, car, model)
    return detect_drive(d.signals, d.vehicle, memory=memory)


def _drops(result: DriveResult, after: float = 0.0) -> bool:
    return any(e.detector == "slip_slope_drop" and e.start_s >= after for e in result.events)


def _history(plan: Plan) -> Check:
    """C56: reference from the vehicle file against the largest slope of the configuration's history."""
    false: dict[str, int] = {"file": 0, "max": 0, "robust": 0}
    missed = dict(false)
    n = 0
    for gain in _GAINS:
        for seed in plan.first(4):
            n += 1
            dry = _drive(gain, seed)
            rules: tuple[Rule, ...] = ("max", "robust")
            # the file's own slope is removed, so that the first drive alone determines the slope of these tyres
            learnt = remembered(History(), _CAR.name, _drive(gain, seed, car=_UNKNOWN, draw=57).slopes)
            memories: dict[str, Memory | None] = {"file": None, **{r: Memory(learnt, rule=r) for r in rules}}
            false["file"] += int(_drops(dry))
            for name, memory in memories.items():
                if name != "file":
                    false[name] += int(_drops(_drive(gain, seed + 1, memory)))
                snow = _drive(gain, seed + 2, memory, snow=True, seconds=_WET_S)
                missed[name] += int(not _drops(snow, _ENTRY))
    wrong = {k: false[k] + missed[k] for k in false}
    whole = wrong["max"] <= 0.1 * 2 * n and wrong["file"] >= 3 * max(wrong["max"], 1)
    outcome = (
        f"false drops on dry road {false['file']} (file), {false['max']} (largest of the history), "
        f"{false['robust']} (upper quartile of its means, the default) of {n} drives; snow missed "
        f"{missed['file']}, {missed['max']}, {missed['robust']} of {n}"
    )
    ci95 = wilson(wrong["max"], 2 * n)
    part = wrong["max"] < wrong["file"]
    return judge("C56.drives", outcome, whole=whole, part=part, value=wrong["max"] / (2 * n), ci95=ci95)


_YIELDING = ("snow_entry", "snow", "deep_snow", "gravel")


def _not_unique(plan: Plan) -> Check:
    """C57: roads that yield lower the slope; results of the drop alone and of the joint detector."""
    rows = {}
    for name in _YIELDING:
        found = [variants(d.name, d.seed) for d in drives((name,), plan, 12)]
        rows[name] = (len(found), *(sum(bool(v[k].any()) for v in found) for k in ("slope", "joint_criteria")))
    n, drops, joint = (sum(r[i] for r in rows.values()) for i in range(3))
    whole = drops >= 0.5 * n and joint <= 0.05 * n
    outcome = (
        f"drop alone {share(drops, n)}, joint detector 1 {share(joint, n)} of the drives ("
        + ", ".join(f"{k.replace('_', ' ')} {r[1]} and {r[2]} of {r[0]}" for k, r in rows.items())
        + ")"
    )
    part = joint <= 0.2 * drops and drops > 0
    return judge("C57.drives", outcome, whole=whole, part=part, value=drops / n, ci95=wilson(drops, n))


def _unchanged(plan: Plan) -> Checks:
    """C58: a damp road and dry ice must not be reported; that their slope is that of dry road is put in, not found."""
    rows = {}
    for name in ("damp", "ice"):
        found = [variants(d.name, d.seed) for d in drives((name,), plan, 8)]
        rows[name] = (*(sum(bool(v[k].any()) for v in found) for k in ("slope", "joint_criteria")), len(found))
    false = sum(r[0] for r in rows.values())
    joint = sum(r[1] for r in rows.values())
    n = sum(r[2] for r in rows.values())
    whole = false <= 0.05 * n and joint == 0
    outcome = (
        f"drop reported in {share(false, n)} of the drives (damp {rows['damp'][0]} of {rows['damp'][2]}, dry ice "
        f"{rows['ice'][0]} of {rows['ice'][2]}), joint warning in {joint}"
    )
    assumed = "the simulator's damp road and dry ice have the slope of the dry one by assumption"
    ci95 = wilson(false, n)
    return (
        judge("C58.drives_detection", outcome, whole=whole, part=joint == 0, value=false / n, ci95=ci95),
        judge("C58.drives_road", assumed, verdict=NEEDS_DATA),
    )


def _pressure_and_tread(plan: Plan) -> Check:
    """C118: share of the slope that is lost between 70 and 102 km/h."""
    seeds = plan.first(8)

    def lost(p: Pass, fast: float) -> list[float]:
        out = []
        for seed in seeds:
            slow_, fast_ = (figures_of(replace(p, kmh=v), seed).slope_rr for v in (70.0, fast))
            if math.isfinite(slow_) and math.isfinite(fast_):
                out.append(1.0 - fast_ / slow_)
        return out

    base = Pass(70.0, wiggles=True)
    low, high = lost(base, 102.0), lost(replace(base, p=HIGH), 102.0)
    winter = lost(replace(base, tyre="new_winter", p=LOW), 110.0)
    ratio = float(np.mean(high) / np.mean(low))
    less, none = ratio < 0.7, abs(float(np.mean(winter))) < 0.05
    whole = less and none
    interval = bootstrap(np.array([low, high]).T, lambda x: float(x[:, 1].mean() / x[:, 0].mean()))
    outcome = (
        f"reduction {100 * np.mean(low):.0f} % at low and {100 * np.mean(high):.0f} % at high pressure; new "
        f"winter {100 * np.mean(winter):+.1f} % ({100 * min(winter):+.1f} to {100 * max(winter):+.1f} %, "
        f"{len(winter)} runs)"
    )
    ci95 = (min(interval), max(interval))
    return judge("C118.drives", outcome, whole=whole, part=less or none, value=ratio, ci95=ci95)


CHECKS = (
    Maker(("C47",), detected, PASS_SEEDS, spreads=True),
    by_passes("C48", lambda: (VERY_WORN, DRY_VERY_WORN, *FULL_GRID), _c48),
    by_passes("C49", lambda: (*at_speeds(WORN), *RAMPS), _c49),
    by_passes("C50", lambda: (WORN, *(q for h in DEPTHS for q in at_speeds(replace(WORN, h=h)))), _c50),
    by_passes("C51", lambda: (q for name in FALLING for q in at_speeds(_wiggling(name))), _c51),
    by_passes("C52", lambda: at_speeds(WORN), _c52),
    by_passes("C53", lambda: (q for p in (LOW, MEDIUM, HIGH) for q in at_speeds(replace(WORN, p=p), FEW)), _c53),
    by_passes("C54", _winter, _c54),
    by_passes(
        "C55",
        lambda: (replace(q, wiggles=True) for p in (UNLOADED, *LOADED.values()) for q in at_speeds(p, FEW)), _c55,
    ),
    Maker(("C56",), _history, spreads=True),
    Maker(("C57",), _not_unique, spreads=True),
    Maker(("C58",), _unchanged, spreads=True),
    Maker(("C118",), _pressure_and_tread, spreads=True),
)  # fmt: skip
