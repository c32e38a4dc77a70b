"""Parameters that the resistance measure depends on, and the benefit of an estimate on dry road."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aqualog.core.records import BoolArray
from aqualog.core.vehicle import Vehicle
from aqualog.detect.stream import Settings
from aqualog.model.effects import EFFECTS
from aqualog.model.scenario import Scenario
from aqualog.model.situations import SCORING_POOL, draw
from aqualog.model.term import Model, Term
from aqualog.physics.load import G
from aqualog.physics.resistance import nominal_acceleration
from aqualog.reproduce.check import Check, Checks, Maker, Plan
from aqualog.reproduce.drawn import Taken, detected, made, score
from aqualog.reproduce.verdict import judged

__all__ = ["CHECKS", "SEEDS"]

SEEDS = range(11000, 11200)
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
        Check(
            "C36",
            "of what changes in operation (300 kg; rolling resistance 30 %, drag area 10 %, radius 0.3 %, air 5 %) "
            "mass and rolling resistance move the measure most; in part: the larger one of them is first",
            f"in 0.01 m/s² at 80 km/h, at 120 km/h and at 80 km/h under 1 m/s²: {words}",
            judged(whole=first, part=order[0] in ("mass", "rolling_resistance")),
            part="sensitivity",
            value=min(size["mass"], size["rolling_resistance"]),
            unit="m/s^2",
            reason="" if first else f"At 120 km/h {order[1].replace('_', ' ')} moves it more.",
            source="2.10, by changing one parameter",
        ),
        Check(
            "C36",
            "dry drives with unknown load and tyres: learning on dry road at least halves the mean error of the "
            "measure",
            f"mean error {off['as in the file']:.3f} m/s² with the file's parameters, {off['learnt']:.3f} with the "
            f"dry offset learnt; alarms of the resistance {alarms['as in the file'].false} and "
            f"{alarms['learnt'].false} in {alarms['learnt'].dry_s / 3600.0:.1f} h",
            judged(whole=helps, part=off["learnt"] < off["as in the file"]),
            part="dry estimate",
            value=off["learnt"] / off["as in the file"],
            reason="" if helps else "Only one offset is learnt, not the parameters themselves.",
            source="drawn situations with load and rolling resistance",
        ),
    )


CHECKS: tuple[tuple[tuple[str, ...], Maker], ...] = ((("C36",), _most_important),)
