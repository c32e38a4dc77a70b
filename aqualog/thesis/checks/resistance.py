"""The resistance measure: over speed, depth, tyre, pressure and load by passes; its sign, balance and sum."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from aqualog.core.records import BoolArray, FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.detect import cusum, resistance
from aqualog.detect.stream import Settings, detect_drive
from aqualog.model.effects import EFFECTS
from aqualog.model.log import as_signals
from aqualog.model.scenario import Scenario
from aqualog.model.sensors import IDEAL
from aqualog.model.simulate import simulate
from aqualog.model.situations import SCORING_POOL, draw
from aqualog.model.term import Model, Term
from aqualog.physics.load import G
from aqualog.physics.resistance import nominal_acceleration
from aqualog.thesis.claims import Check, Checks, judge, limit
from aqualog.thesis.evidence.drives import WATER, Taken, detected, drives, made, score, scored, threshold_for
from aqualog.thesis.evidence.passes import HIGH, LOW, MEDIUM, Pass
from aqualog.thesis.evidence.seeds import (
    Maker,
    Plan,
    Rows,
    Statistic,
    Table,
    bootstrap,
    by_passes,
    cells_of,
    estimate,
    first_speed,
    mean,
    mean_of,
    number,
    ratio_of_counts,
    said,
    scatter,
    told,
)

__all__ = ["CHECKS", "CONFIGURATIONS", "LOADED", "SLOW", "UNLOADED", "at_speeds"]

SLOW = (70, 78, 86, 94, 102)  # [km/h] below full aquaplaning
WORN, VERY_WORN = Pass(94), Pass(94, tyre="very_worn_summer")
NEW, WINTER = Pass(94, tyre="new_summer"), Pass(94, tyre="new_winter")
CONFIGURATIONS: Mapping[str, Pass] = {
    "very worn": VERY_WORN,
    "very worn 0.6 mm": replace(VERY_WORN, h=0.6e-3),
    "very worn 2.0 mm": replace(VERY_WORN, h=2.0e-3),
    "worn": WORN,
    "worn medium": replace(WORN, p=MEDIUM),
    "worn high": replace(WORN, p=HIGH),
    "worn front load": replace(WORN, load_front=270.0),
    "worn rear load": replace(WORN, load_rear=270.0),
    "new summer": NEW,
    "new summer 2.0 mm": replace(NEW, h=2.0e-3),
    "new winter": WINTER,
    "new winter 2.0 mm": replace(WINTER, h=2.0e-3),
}
DEPTHS = (0.6e-3, 0.8e-3, 1.1e-3, 1.3e-3, 2.0e-3)  # [m]
OUTER = (0.6e-3, 1.3e-3, 2.0e-3)  # those whose gradients are compared
THRESHOLD = 0.2  # [m/s^2]
THRESHOLD_SPEEDS = tuple(range(78, 118, 4))
V_FULL = limit("v_full", "C44.passes_speed")  # [km/h] below full aquaplaning of the anchor, 118 km/h
RISE_S = limit("rise_s", "C37.passes")


def at_speeds(p: Pass, speeds: Sequence[float] = SLOW) -> list[Pass]:
    """The same pass at several speeds [km/h]."""
    return [replace(p, kmh=v) for v in speeds]


def level_at(table: Table, p: Pass) -> float:
    """Mean resistance of a pass over the seeds. [m/s²]"""
    return mean(table[p].of("delta_a"))


def gradient_of(table: Table, p: Pass) -> Statistic:
    """Gradient of the mean resistance over `SLOW`. [m/s² per km/h]"""
    values = cells_of(table, at_speeds(p), "delta_a")
    return lambda rows: float(np.polyfit(SLOW, values[:, rows].mean(axis=1), 1)[0])


def seeds_of(table: Table, p: Pass) -> int:
    """How many seeds a pass was driven with."""
    return len(table[p].figures)


def _c12(table: Table) -> Check:
    depths = (VERY_WORN, CONFIGURATIONS["very worn 0.6 mm"], CONFIGURATIONS["very worn 2.0 mm"])
    lever = {p.h: cells_of(table, at_speeds(p), "lever") for p in depths}
    by_h = [lever[h].mean(axis=1) for h in sorted(lever)]
    ahead = all((x > 0.0).all() for x in lever.values())
    grows_v = all(np.all(np.diff(x) > 0.0) for x in by_h)
    grows_h = bool(np.all(np.diff(np.stack(by_h), axis=0) > 0.0))

    def change(names: Sequence[str]) -> float:
        means = [np.mean([level_at(table, p) for p in at_speeds(CONFIGURATIONS[n])]) for n in names]
        return float(max(means) - min(means))

    speeds = [level_at(table, p) for p in at_speeds(VERY_WORN)]
    span = {
        "speed": max(speeds) - min(speeds), "depth": change(("very worn", "very worn 0.6 mm", "very worn 2.0 mm")),
        "pressure": change(("worn", "worn medium", "worn high")),
        "load": change(("worn", "worn front load", "worn rear load")),
    }  # fmt: skip
    mainly = min(span["speed"], span["depth"]) > max(span["pressure"], span["load"])
    shift, ci = estimate(lambda r: 1e3 * float(lever[2.0e-3][-1, r].mean()), seeds_of(table, VERY_WORN))
    grows = bool(ahead and grows_v and grows_h)
    outcome = (
        f"{1e3 * by_h[0][0]:.1f} mm at 70 km/h and 0.6 mm to {told(shift, ci)} mm at 102 km/h and 2.0 mm, grows "
        f"with speed {grows_v}, with depth {grows_h}; resistance ranges over "
        + ", ".join(f"{k} {x:.3f}" for k, x in span.items())
        + " m/s^2"
    )
    return judge("C12.passes", outcome, whole=grows and mainly, part=grows, value=shift, ci95=ci)


def _c37(table: Table) -> Check:
    c = table[VERY_WORN]
    wet, dry, rise = (c.of(k) for k in ("delta_a", "delta_a_dry", "rise_s"))
    step, ci = estimate(lambda r: float((wet - dry)[r].mean()), wet.size)
    whole = bool((wet - dry > 0.1).all() and (rise < RISE_S).all())
    outcome = (
        f"{dry.mean():+.3f} before, {wet.mean():.3f} m/s² on the lane: {told(step, ci, 3)} more; half of it after "
        f"{np.median(rise):.2f} s (at most {rise.max():.2f} s)"
    )
    return judge("C37.passes", outcome, whole=whole, part=bool((wet > dry).all()), value=step, ci95=ci)


def _c38(table: Table) -> Check:
    cells = {h: table[replace(VERY_WORN, h=h)].of("delta_a") for h in DEPTHS}
    level = {h: mean(x) for h, x in cells.items()}
    thin = [level[h] for h in DEPTHS[:-1]]
    noise = max(scatter(x) for x in cells.values())
    deep, flat = level[2.0e-3] - max(thin) > noise, max(thin) - min(thin) < noise
    value, ci = estimate(
        lambda r: float(cells[2.0e-3][r].mean() - max(cells[h][r].mean() for h in DEPTHS[:-1])), cells[2.0e-3].size
    )
    g = {h: said(scaled(gradient_of(table, replace(VERY_WORN, h=h))), cells[h].size) for h in OUTER}
    outcome = (
        ", ".join(f"{1e3 * h:.1f} mm: {x:.3f}" for h, x in level.items())
        + f" m/s², scatter {noise:.3f}; 2 mm above the others by {told(value, ci, 3)}; gradients "
        + ", ".join(f"{1e3 * h:.1f} mm: {x}" for h, x in g.items())
        + " 1e-3 m/s^2 per km/h"
    )
    return judge("C38.passes", outcome, whole=deep and flat, part=deep, value=value, ci95=ci)


def scaled(statistic: Statistic) -> Statistic:
    """A statistic in thousandths."""
    return lambda rows: 1e3 * statistic(rows)


def _c39(table: Table) -> Check:
    found = {
        name: estimate(scaled(gradient_of(table, p)), seeds_of(table, p), of=len(CONFIGURATIONS))
        for name, p in CONFIGURATIONS.items()
    }
    rising = [x > 0.0 for x, _ in found.values()]
    value, ci = min(found.values())
    outcome = "1e-3 m/s^2 per km/h: " + ", ".join(f"{name} {told(*x)}" for name, x in found.items())
    return judge("C39.passes", outcome, whole=all(rising), part=bool(np.mean(rising) >= 0.8), value=value, ci95=ci)


def _c44(table: Table) -> Checks:
    passes = [replace(WORN, kmh=v) for v in THRESHOLD_SPEEDS]
    above = cells_of(table, passes, "delta_a") > THRESHOLD
    partial = cells_of(table, passes, "is_partial") > 0.5
    n = above.shape[1]
    v, ci = estimate(first_speed(THRESHOLD_SPEEDS, above), n)

    def balanced(rows: Rows) -> float:
        a, p = above[:, rows], partial[:, rows]
        return float(0.5 * (a[p].mean() + (~a[~p]).mean())) if p.any() and not p.all() else float("nan")

    accuracy, span = estimate(balanced, n)
    there = bool(np.isfinite(accuracy))
    sides = f"{above[partial].mean():.2f} of the partial ones reach it, {above[~partial].mean():.2f} of the others"
    outcome = f"balanced accuracy {told(accuracy, span, 2)}: {sides}" if there else "all passes are alike"
    return (
        judge("C44.passes_speed", f"at {told(v, ci)} km/h", whole=v < V_FULL, **number(v, ci)),
        judge(
            "C44.passes_partial_aquaplaning", outcome, whole=there and accuracy >= 0.8,
            part=there and accuracy >= 0.65, **number(accuracy, span),
        ),
    )  # fmt: skip


def configured() -> Iterator[Pass]:
    """All combinations of tyre, depth, pressure and load at all speeds."""
    for p in CONFIGURATIONS.values():
        yield from at_speeds(p)


def at_depths(*passes: Pass, depths: Sequence[float]) -> list[Pass]:
    """The same passes at several depths [m], each at all speeds."""
    return [replace(p, kmh=v, h=h) for p in passes for h in depths for v in SLOW]


PRESSURES = (LOW, MEDIUM, HIGH)
LOAD_SPEEDS = (86, 94, 102)
LOADED = {
    "medium pressure": Pass(94, h=1.2e-3, p=MEDIUM),
    "front load": Pass(94, h=1.2e-3, load_front=270.0),
    "rear load": Pass(94, h=1.2e-3, load_rear=270.0),
}
UNLOADED = Pass(94, h=1.2e-3)
ONE_MM = 1.1e-3


def _compared(claim: str, other: Pass, depths: Sequence[float], table: Table) -> Check:
    """Very worn against another tyre at all speeds and depths (Figures 2.12 and 2.13)."""
    pairs = [(replace(VERY_WORN, kmh=v, h=h), replace(other, kmh=v, h=h)) for h in depths for v in SLOW]
    a, b = (cells_of(table, [p[k] for p in pairs], "delta_a") for k in (0, 1))
    lower = [bool(x.mean() < y.mean()) for x, y in zip(b, a, strict=True)]
    value, ci = estimate(lambda r: float(b[:, r].mean() / a[:, r].mean()), a.shape[1])
    outcome = f"lower at {sum(lower)} of {len(lower)}; {told(value, ci, 2)} of it in the mean"
    return judge(f"{claim}.passes", outcome, whole=all(lower) and ci[1] < 1.0, part=ci[1] < 1.0, value=value, ci95=ci)


def _c42(table: Table) -> Check:
    names = ("very worn", "new summer", "new winter")
    n = seeds_of(table, VERY_WORN)
    gradient = {k: gradient_of(table, CONFIGURATIONS[k]) for k in names}
    g = {k: f(np.arange(n)) for k, f in gradient.items()}
    level = {k: level_at(table, CONFIGURATIONS[k]) for k in names}
    values = {k: table[CONFIGURATIONS[k]].of("delta_a") for k in names}

    def worst(rows: Rows) -> float:
        return max(float(values[k][rows].mean() / values[names[0]][rows].mean()) for k in names[1:])

    value, ci = estimate(worst, n)

    def below(share: float) -> bool:
        return all(g[k] < share * g[names[0]] and level[k] < share * level[names[0]] for k in names[1:])

    outcome = (
        "; ".join(f"{k}: {level[k]:.3f} m/s^2, {said(scaled(gradient[k]), n)} 1e-3 m/s^2 per km/h" for k in names)
        + f"; larger level over that of very worn {told(value, ci, 2)}"
    )
    return judge("C42.passes", outcome, whole=below(0.5), part=below(1.0), value=value, ci95=ci)


def _c43(table: Table) -> Check:
    rows = []
    for v in SLOW:
        x = [table[replace(WORN, kmh=v, p=p)].of("delta_a") for p in PRESSURES]
        rows.append((v, _range_of(x), max(scatter(y) for y in x)))
    inside = [s < noise for _, s, noise in rows]
    values = [cells_of(table, at_speeds(replace(WORN, p=p)), "delta_a").mean(axis=0) for p in PRESSURES]
    value, ci = estimate(lambda r: _range_of([x[r] for x in values]), values[0].size)
    outcome = (
        "; ".join(f"{v} km/h: {s:.3f} against {noise:.3f}" for v, s, noise in rows)
        + f" m/s^2; in the mean {told(value, ci, 3)}"
    )
    return judge("C43.passes", outcome, whole=all(inside), part=sum(inside) > len(inside) / 2, value=value, ci95=ci)


def _range_of(values: Sequence[FloatArray]) -> float:
    means = [mean(x) for x in values]
    return max(means) - min(means)


def _c45(table: Table) -> Check:
    base = cells_of(table, at_speeds(UNLOADED, LOAD_SPEEDS), "delta_a").mean(axis=0)
    change = {
        k: cells_of(table, at_speeds(p, LOAD_SPEEDS), "delta_a").mean(axis=0) - base for k, p in LOADED.items()
    }  # fmt: skip
    found = {k: estimate(mean_of(x), base.size, of=len(change)) for k, x in change.items()}
    below = [x < 0.0 for x, _ in found.values()]
    value, ci = max(found.values())
    outcome = f"{base.mean():.3f} m/s^2; " + ", ".join(f"{k} {told(*x, 3)}" for k, x in found.items()) + " more"
    return judge("C45.passes", outcome, whole=all(below), part=sum(below) >= 2, value=value, ci95=ci)


def _depths() -> Iterator[Pass]:
    yield from (replace(VERY_WORN, h=h) for h in DEPTHS)
    yield from at_depths(VERY_WORN, depths=OUTER)


_SETTLED = 300  # samples
_PER_WATER, _PER_OTHER = 6, 3  # seeds of each situation
_NOISY = ("gear_shifts", "rough_asphalt", "kerbs_and_holes", "hilly", "motorway", "hard_acceleration", "dry_cruise")


def _measure(scenario: Scenario, model: Model = Model(), believed: Vehicle | None = None) -> FloatArray:  # noqa: B008
    """Resistance measure of a drive, settled. [m/s²]"""
    car = believed or scenario.vehicle
    signals = as_signals(simulate(scenario, model), vehicle=car, truth=False)
    result = detect_drive(signals, car, settings=Settings(learns_offset=False))
    return np.asarray(result.features["delta_a_x"].to_numpy()[_SETTLED:])


def _sign(plan: Plan) -> Check:
    """C34: a known extra torque against the wheels, and one with them."""
    wanted, found = [], []
    rng = np.random.default_rng(plan.seeds[0])
    car = Vehicle(name="test", given=frozenset({"drivetrain", "mass"}))
    for seed in plan.first(20):
        torque = float(rng.uniform(-5.0, 80.0))
        v, a = rng.uniform(18.0, 35.0), rng.uniform(-0.3, 0.8)
        scenario = Scenario(car, duration_s=10.0, seed=seed, speed=((0.0, v), (10.0, v + 10.0 * a)), sensors=IDEAL)
        model = Model((Term(EFFECTS["brake_drag"], {"torque": torque}, None),))
        found.append(float(_measure(scenario, model).mean() - _measure(scenario).mean()))
        wanted.append(4.0 * torque / car.arm("fl") / car.mass)
    gain, offset = np.polyfit(wanted, found, 1)
    left = float(np.abs(np.array(found) - wanted).max())
    whole = abs(gain - 1.0) < 0.02 and left < 0.01
    outcome = (
        f"slope {gain:.4f}, offset {offset:+.4f} m/s², largest deviation {left:.4f} m/s² over {len(found)} "
        f"pairs of drives ({min(wanted):+.2f} to {max(wanted):.2f} m/s²)"
    )
    ci95 = bootstrap(np.column_stack([wanted, found]), lambda x: float(np.polyfit(x[:, 0], x[:, 1], 1)[0]))
    return judge("C34.drives", outcome, whole=whole, part=gain > 0.0, value=float(gain), ci95=ci95)


def _balance(plan: Plan) -> Check:
    """C35: formula by hand, and its remainder on dry drives with all parameters known."""
    rng = np.random.default_rng(plan.seeds[0])
    n = 2000
    T, F_z = rng.uniform(-500.0, 800.0, (4, n)), rng.uniform(2e3, 6e3, (4, n))
    v, r_l, m, r_w = rng.uniform(5.0, 50.0, n), rng.uniform(0.28, 0.36, 4), 1700.0, 0.011
    by_hand = [
        (sum(T[i, k] / r_l[i] - r_w * F_z[i, k] for i in range(4)) - 0.5 * 0.66 * 1.2 * v[k] ** 2) / m for k in range(n)
    ]
    ours = nominal_acceleration(
        T, F_z, v, np.zeros((4, n)), arm=r_l, inertia=np.ones(4), mass=m, r_w=r_w, drag_area=0.66, air_density=1.2
    )
    worst = float(np.abs(ours - by_hand).max())
    rms, mean, spin = [], [], []
    for seed in plan.first(20):
        drawn = draw("hilly", seed, SCORING_POOL)
        scenario = replace(drawn.scenario, duration_s=40.0, wind=(), head_wind=0.0, sensors=IDEAL)
        x = _measure(scenario, drawn.model)
        rms.append(float(np.sqrt(np.mean(x**2))))
        mean.append(float(x.mean()))
        # as printed, without the inertia of the wheels: what 1 m/s^2 shows
        car = scenario.vehicle
        spin.append(sum(car.inertia(w) / (car.r_e(w) * car.arm(w)) for w in ("fl", "fr", "rl", "rr")) / car.mass)
    right = worst < 1e-12 and max(rms) < 0.03
    outcome = (
        f"{worst:.1e} over {n} random states; rms {np.mean(rms):.4f} m/s² (largest {max(rms):.4f}) over "
        f"{len(rms)} drives with grades of up to 8 %; without the wheels' inertia, as printed, "
        f"{100 * np.mean(spin):.1f} % of the acceleration would show"
    )
    return judge("C35.drives", outcome, whole=False, part=right, value=float(np.mean(rms)), ci95=bootstrap(rms))


def _trusted(d: Taken) -> FloatArray:
    """The measure that the detector sums up: without its dry offset, nothing under braking. (n,) [m/s²]"""
    result = detected(d)
    track = next(t for t in result.tracks if t.detector == "resistance")
    f = result.features
    x = f["delta_a_x"].to_numpy() - f["delta_a_x_offset"].to_numpy()
    # under braking the detector lets its sum fall: there neither way may alarm
    torque = np.array([d.signals.array(f"torque_{w}") for w in ("fl", "fr", "rl", "rr")])
    braking = np.nan_to_num(torque.sum(axis=0)) < -0.02 * d.vehicle.mass * G * d.vehicle.r_e_f
    x = resistance.trusted_measure(x, f["v_x_hat"].to_numpy(), f["a_y_slow"].to_numpy(), braking)
    return np.where(np.isnan(track.statistic), np.nan, x)


def _not_directly(plan: Plan) -> Check:
    """C46: false alarms of a direct threshold and of the sum at the same recall of partial aquaplaning."""
    water = [(d, _trusted(d)) for d in drives(WATER, plan, _PER_WATER)]
    other = [(d, _trusted(d)) for d in drives(_NOISY, plan, _PER_OTHER)]

    def summed(d: Taken, x: FloatArray, threshold: float) -> BoolArray:
        p = resistance.alarm_params(d.signals.dt, threshold)
        return cusum.scan(p, cusum.initial_state(), x)[1]

    by_sum = scored(water, other, summed, "partial")
    direct = scored(water, other, lambda _, x, threshold: np.nan_to_num(x) > threshold, "partial")
    recall = by_sum(0.2).recall
    limit_sum, g = threshold_for(recall, np.geomspace(0.02, 1.0, 30).tolist(), by_sum)
    limit_direct, plain = threshold_for(recall, np.geomspace(0.05, 0.8, 30).tolist(), direct)
    at_thesis = direct(resistance.LEVEL)
    whole = g.episodes > 20 and plain.false > 0 and g.false <= 0.5 * plain.false
    outcome = (
        f"sum, beyond {limit_sum:.2f} m/s: {g.in_words()}; direct, beyond {limit_direct:.2f} m/s²: {plain.in_words()}; "
        f"direct at 0.2 m/s²: {at_thesis.false} false alarms"
    )
    value = g.false / max(plain.false, 1)
    ci95 = ratio_of_counts(g.false, plain.false)
    return judge("C46.drives", outcome, whole=whole, part=g.false < plain.false, value=value, ci95=ci95)


# what changes in operation: passengers and luggage; tyres from 0 to 40 degC (8 % per 10 K, [unece_r117_2011]) or soft
# ones; a roof rack; wear of a millimetre; the air by 15 degC (K)
_CHANGES = {"mass": 300.0, "rolling_resistance": 0.30, "drag_area": 0.10, "radius": 0.003, "air_density": 0.05}
_STATES = {"80 km/h": (80.0, 0.0), "120 km/h": (120.0, 0.0), "80 km/h, 1 m/s^2": (80.0, 1.0)}


def _nominal(car: Vehicle, torque: float, v: float, a: float) -> float:
    """Nominal acceleration of a car that is driven at the rear. [m/s²]"""
    T = np.array([[0.0], [0.0], [0.5 * torque], [0.5 * torque]])
    nominal = nominal_acceleration(
        T, np.full((4, 1), 0.25 * car.mass * G), np.array([v]), np.full((4, 1), a / car.r_e_r),
        arm=np.full(4, car.arm("rr")), inertia=np.full(4, car.inertia_r), mass=car.mass, r_w=car.rolling_resistance,
        drag_area=car.drag_area, air_density=car.air_density,
    )  # fmt: skip
    return float(nominal[0])


def _parameters() -> dict[str, dict[str, float]]:
    """How far the measure is off when one parameter has changed and the vehicle file has not, by driving state."""
    car = Vehicle(name="test", given=frozenset({"drivetrain", "mass"}))
    out: dict[str, dict[str, float]] = {}
    for key, change in _CHANGES.items():
        if key == "mass":
            true = replace(car, mass=car.mass + change)
        elif key == "radius":
            true = replace(car, r_e_f=car.r_e_f * (1.0 + change), r_e_r=car.r_e_r * (1.0 + change))
        else:
            true = replace(car, **{key: getattr(car, key) * (1.0 + change)})
        for state, (kmh, a) in _STATES.items():
            v, torque = kmh / 3.6, 600.0
            # the torque with which the changed car drives so, by two points of a line
            low, high = _nominal(true, 0.0, v, a), _nominal(true, torque, v, a)
            needed = torque * (a - low) / (high - low)
            out.setdefault(key, {})[state] = _nominal(car, needed, v, a) - a
    return out


def _laden(seed: int) -> tuple[Scenario, Vehicle, Model]:
    """A dry drive with 150 to 400 kg and tyres of 20 to 60 % more resistance that the vehicle file does not know."""
    drawn = draw("dry_cruise", seed, SCORING_POOL)
    rng = np.random.default_rng([seed, 36])
    load, extra = float(rng.uniform(150.0, 400.0)), float(rng.uniform(0.2, 0.6))
    term = Term(EFFECTS["rolling_resistance"], {"delta_r_w": extra * drawn.scenario.vehicle.rolling_resistance}, None)
    scenario = replace(drawn.scenario, load_front=0.4 * load, load_rear=0.6 * load)
    return scenario, drawn.believed, Model((*drawn.model.terms, term))


def _most_important(plan: Plan) -> Checks:
    effect = _parameters()
    size = {key: max(abs(x) for x in states.values()) for key, states in effect.items()}
    order = sorted(size, key=lambda k: -size[k])
    first = set(order[:2]) == {"mass", "rolling_resistance"}
    cars = [made("laden", s, *(_laden(s))) for s in plan.first(15)]
    alarms, off = {}, {}
    for name, learns in (("learnt", True), ("as in the file", False)):
        bits: list[tuple[Taken, BoolArray]] = []
        left = []
        for d in cars:
            result = detected(d, Settings(learns_offset=learns))
            track = next(t for t in result.tracks if t.detector == "resistance")
            bits.append((d, track.active))
            x = result.features["delta_a_x"].to_numpy()
            if learns:
                x = x - result.features["delta_a_x_offset"].to_numpy()
            left.append(float(abs(np.nanmean(x[x.size // 2 :]))))
        alarms[name], off[name] = score([], bits), float(np.mean(left))
    helps = off["learnt"] < 0.5 * off["as in the file"]
    words = "; ".join(
        f"{key.replace('_', ' ')} {100 * effect[key]['80 km/h']:+.1f}, {100 * effect[key]['120 km/h']:+.1f}, "
        f"{100 * effect[key]['80 km/h, 1 m/s^2']:+.1f}"
        for key in order
    )
    sensitive = judge(
        "C36.drives_sensitivity", f"in 0.01 m/s² at 80 km/h, at 120 km/h and at 80 km/h under 1 m/s²: {words}",
        whole=first, part=order[0] in ("mass", "rolling_resistance"),
        value=min(size["mass"], size["rolling_resistance"]), fields={"second": order[1].replace("_", " ")},
    )  # fmt: skip
    outcome = (
        f"mean error {off['as in the file']:.3f} m/s² with the file's parameters, {off['learnt']:.3f} with the "
        f"dry offset learnt; alarms of the resistance {alarms['as in the file'].false} and "
        f"{alarms['learnt'].false} in {alarms['learnt'].dry_s / 3600.0:.1f} h"
    )
    part, ratio = off["learnt"] < off["as in the file"], off["learnt"] / off["as in the file"]
    return sensitive, judge("C36.drives_dry_estimate", outcome, whole=helps, part=part, value=ratio)


CHECKS = (
    by_passes("C12", configured, _c12),
    by_passes("C37", lambda: (VERY_WORN,), _c37),
    by_passes("C38", _depths, _c38),
    by_passes("C39", configured, _c39),
    by_passes("C44", lambda: (replace(WORN, kmh=v) for v in THRESHOLD_SPEEDS), _c44),
    by_passes(
        "C40", lambda: at_depths(VERY_WORN, NEW, depths=(ONE_MM, 2.0e-3)),
        lambda t: _compared("C40", NEW, (ONE_MM, 2.0e-3), t),
    ),
    by_passes(
        "C41", lambda: at_depths(VERY_WORN, WINTER, depths=(1.3e-3, 2.0e-3)),
        lambda t: _compared("C41", WINTER, (1.3e-3, 2.0e-3), t),
    ),
    by_passes("C42", configured, _c42),
    by_passes("C43", lambda: (q for p in PRESSURES for q in at_speeds(replace(WORN, p=p))), _c43),
    by_passes("C45", lambda: (q for p in (UNLOADED, *LOADED.values()) for q in at_speeds(p, LOAD_SPEEDS)), _c45),
    Maker(("C34",), _sign, spreads=True),
    Maker(("C35",), _balance, spreads=True),
    Maker(("C46",), _not_directly, spreads=True),
    Maker(("C36",), _most_important),
)  # fmt: skip
