"""Resistance measure: its sign and balance, which parameters matter, and why it is summed up."""

from __future__ import annotations

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
from aqualog.thesis.claims import Check, Checks, judge
from aqualog.thesis.evidence.drives import WATER, Score, Taken, detected, drives, made, score, threshold_for
from aqualog.thesis.evidence.seeds import Maker, Plan, bootstrap, ratio_of_counts

__all__ = ["CHECKS"]

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
    car = Vehicle(name="test", given=frozenset({"mass"}))
    for seed in plan.first(20):
        torque = float(rng.uniform(-5.0, 80.0))
        v, a = rng.uniform(18.0, 35.0), rng.uniform(-0.3, 0.8)
        scenario = Scenario(car, duration_s=10.0, seed=seed, speed=((0.0, v), (10.0, v + 10.0 * a)), sensors=IDEAL)
        model = Model((Term(EFFECTS["brake_drag"], {"torque": torque}, None),))
        found.append(float(_measure(scenario, model).mean() - _measure(scenario).mean()))
        wanted.append(4.0 * torque / car.r_l("fl") / car.mass)
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
    by_hand = np.array(
        [
            (sum(T[i, k] / r_l[i] - r_w * F_z[i, k] for i in range(4)) - 0.5 * 0.66 * 1.2 * v[k] ** 2) / m
            for k in range(n)
        ]
    )
    ours = nominal_acceleration(
        T, F_z, v, np.zeros((4, n)), r_l=r_l, inertia=np.ones(4), mass=m, r_w=r_w, drag_area=0.66, air_density=1.2
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
        spin.append(sum(car.inertia(w) / (car.r_e(w) * car.r_l(w)) for w in ("fl", "fr", "rl", "rr")) / car.mass)
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
    braking = np.nan_to_num(torque.sum(axis=0)) < -0.02 * d.vehicle.mass * G * d.vehicle.r_l_f
    x = resistance.trusted_measure(x, f["v_x_hat"].to_numpy(), f["a_y_slow"].to_numpy(), braking)
    return np.where(np.isnan(track.statistic), np.nan, x)


def _not_directly(plan: Plan) -> Check:
    """C46: false alarms of a direct threshold and of the sum at the same recall of partial aquaplaning."""
    water = [(d, _trusted(d)) for d in drives(WATER, plan, _PER_WATER)]
    other = [(d, _trusted(d)) for d in drives(_NOISY, plan, _PER_OTHER)]

    def summed(d: Taken, x: FloatArray, threshold: float) -> BoolArray:
        p = resistance.alarm_params(d.signals.dt, threshold)
        return cusum.scan(p, cusum.initial_state(), x)[1]

    def by_sum(threshold: float) -> Score:
        return score(
            [(d, summed(d, x, threshold)) for d, x in water],
            [(d, summed(d, x, threshold)) for d, x in other],
            "partial",
        )

    def direct(threshold: float) -> Score:
        return score(
            [(d, np.nan_to_num(x) > threshold) for d, x in water],
            [(d, np.nan_to_num(x) > threshold) for d, x in other],
            "partial",
        )

    wanted = by_sum(0.2)
    limit_sum, g = threshold_for(wanted.recall, [float(v) for v in np.geomspace(0.02, 1.0, 30)], by_sum)
    limit, plain = threshold_for(wanted.recall, [float(v) for v in np.geomspace(0.05, 0.8, 30)], direct)
    at_thesis = direct(resistance.LEVEL)
    whole = g.episodes > 20 and plain.false > 0 and g.false <= 0.5 * plain.false
    outcome = (
        f"sum, beyond {limit_sum:.2f} m/s: {g.in_words()}; direct, beyond {limit:.2f} m/s²: {plain.in_words()}; "
        f"direct at 0.2 m/s²: {at_thesis.false} false alarms"
    )
    value = g.false / max(plain.false, 1)
    ci95 = ratio_of_counts(g.false, plain.false)
    return judge("C46.drives", outcome, whole=whole, part=g.false < plain.false, value=value, ci95=ci95)


# what changes in operation: passengers and luggage; tyres from 0 to 40 degC (8 % per 10 K, [unece_r117_2011]) or soft
# ones; a roof rack; wear of a millimetre; the air by 15 degC (K)
_CHANGES = {"mass": 300.0, "rolling_resistance": 0.30, "drag_area": 0.10, "loaded_radius": 0.003, "air_density": 0.05}
_STATES = {"80 km/h": (80.0, 0.0), "120 km/h": (120.0, 0.0), "80 km/h, 1 m/s^2": (80.0, 1.0)}


def _nominal(car: Vehicle, torque: float, v: float, a: float) -> float:
    F_z = np.full((4, 1), 0.25 * car.mass * G)
    T = np.array([[0.0], [0.0], [0.5 * torque], [0.5 * torque]])
    omega_dot = np.full((4, 1), a / car.r_e_r)
    r_l, inertia = np.full(4, car.r_l_r), np.full(4, car.inertia_r)
    return float(
        nominal_acceleration(
            T,
            F_z,
            np.array([v]),
            omega_dot,
            r_l=r_l,
            inertia=inertia,
            mass=car.mass,
            r_w=car.rolling_resistance,
            drag_area=car.drag_area,
            air_density=car.air_density,
        )[0]
    )


def _parameters() -> dict[str, dict[str, float]]:
    """How far the measure is off when one parameter has changed and the vehicle file has not, by driving state."""
    car = Vehicle(name="test", given=frozenset({"mass"}))
    out: dict[str, dict[str, float]] = {}
    for key, change in _CHANGES.items():
        if key == "mass":
            true = replace(car, mass=car.mass + change)
        elif key == "loaded_radius":
            true = replace(car, r_l_f=car.r_l_f * (1.0 + change), r_l_r=car.r_l_r * (1.0 + change))
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
    return (
        judge(
            "C36.drives_sensitivity",
            f"in 0.01 m/s² at 80 km/h, at 120 km/h and at 80 km/h under 1 m/s²: {words}",
            whole=first,
            part=order[0] in ("mass", "rolling_resistance"),
            value=min(size["mass"], size["rolling_resistance"]),
            fields={"second": order[1].replace("_", " ")},
        ),
        judge(
            "C36.drives_dry_estimate",
            f"mean error {off['as in the file']:.3f} m/s² with the file's parameters, {off['learnt']:.3f} with the "
            f"dry offset learnt; alarms of the resistance {alarms['as in the file'].false} and "
            f"{alarms['learnt'].false} in {alarms['learnt'].dry_s / 3600.0:.1f} h",
            whole=helps,
            part=off["learnt"] < off["as in the file"],
            value=off["learnt"] / off["as in the file"],
        ),
    )


CHECKS = (
    Maker(("C34",), _sign, spreads=True),
    Maker(("C35",), _balance, spreads=True),
    Maker(("C46",), _not_directly, spreads=True),
    Maker(("C36",), _most_important),
)
