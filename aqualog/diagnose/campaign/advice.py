"""Runs to drive next: those in which the remaining causes predict the most different slip and resistance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray
from aqualog.diagnose.campaign.compete import Option
from aqualog.diagnose.campaign.expect import Driven, respond
from aqualog.diagnose.campaign.passes import CONTACT_MIN, LOST_MAX, RESISTANCE, Passes
from aqualog.diagnose.campaign.refit import Fit
from aqualog.diagnose.records import Manoeuvre
from aqualog.model.scenario import Lane, Scenario
from aqualog.model.simulate import assemble
from aqualog.model.term import Model
from aqualog.model.tyre import TYRES
from aqualog.physics.load import G, wheel_loads
from aqualog.physics.resistance import air_drag

__all__ = ["advice"]

RUNS = 5
MINUTES = 3.0  # of a run with its way back (K)
ENOUGH = 10.8  # lambda from which two causes are confused less than once in twenty times
SPEEDS = (60, 70, 80, 90, 100, 110)  # [km/h]
DEPTHS = (0.6, 1.3, 2.0, 2.5)  # [mm]
WAY = 130.0  # [m] of lane (thesis Fig. 2.25)
_FRONT_AWAY = 1.0  # [m] of film that a front wheel leaves, where the rear wheels run beside its track: all of it


class _Run(NamedTuple):
    """A run that could be driven; `beside`: the rear wheels beside the front ones' track."""

    name: str
    words: str
    scenario: Scenario
    v: float
    a: float = 0.0
    beside: bool = False


def advice(passes: Passes, rivals: Sequence[Option], scatter: Fit) -> Manoeuvre | None:
    """Five runs of the catalogue that best distinguish the two most likely sets; `none` where no run does, None with
    fewer than two sets."""
    if len(rivals) < 2:
        return None
    first, second = rivals[:2]
    pair = (first.refit.keys, second.refit.keys)
    now = 2.0 * max(first.evidence - second.evidence, 0.0)
    runs = _catalogue(passes)
    (a, variances, usable), (b, _, usable_b) = (_expected(runs, o.refit.model, passes) for o in (first, second))
    energy = np.zeros(len(runs))
    for k in np.flatnonzero(usable & usable_b):
        c = np.flatnonzero(np.isfinite(a[k] - b[k]))
        road = 2.0 * runs[k].scenario.tyre_front.scatter_length / WAY
        v = scatter.sigma[np.ix_(c, c)] + np.diag(scatter.kappa[c] * variances[k, c] * road)
        energy[k] = RUNS * (a[k, c] - b[k, c]) @ np.linalg.solve(v, a[k, c] - b[k, c])
    best, most = runs[int(np.argmax(energy))], float(energy.max())
    if now + most < 2.0 * now + 1.0:
        sentence = f"No run of the catalogue distinguishes {pair[0]} from {pair[1]}."
        return Manoeuvre("none", (pair,), sentence, now, now + most, 0.0)
    sentence = f"Drive {RUNS} runs {best.words}: they would distinguish {pair[0]} from {pair[1]}"
    sentence += "." if now + most >= ENOUGH else " better, but probably not with certainty."
    return Manoeuvre(best.name, (pair,), sentence, now, now + most, RUNS * MINUTES)


def _catalogue(passes: Passes) -> list[_Run]:
    """Runs around the configuration that was driven most on water."""
    wet = [t.scenario for t in passes.told if t.wet is not None]
    usual = max(wet, key=lambda s: sum(o.tyre_front is s.tyre_front and o.p_rear == s.p_rear for o in wet))
    right = usual.lanes[0].depth_right
    share = usual.lanes[0].depth_left / right if right > 0.0 else 1.0
    usual = replace(usual, load_front=0.0, load_rear=0.0)
    out = []
    for kmh in SPEEDS:
        for mm in DEPTHS:
            lane = Lane(0.0, 1e9, depth_left=share * mm * 1e-3, depth_right=mm * 1e-3)
            scenario = replace(usual, lanes=(lane,))
            at = f"{kmh} km/h and {mm:g} mm"
            v = kmh / 3.6
            out += [
                _Run(f"constant_{kmh}_{mm:g}", f"at {at}", scenario, v),
                _Run(f"accelerated_{kmh}_{mm:g}", f"with 1 m/s² at {at}", scenario, v, 1.0),
                _Run(f"beside_track_{kmh}_{mm:g}", f"at {at} with the rear wheels beside the front ones' track",
                     scenario, v, beside=True),
                _Run(f"rear_load_{kmh}_{mm:g}", f"at {at} with 270 kg over the rear axle",
                     replace(scenario, load_rear=270.0), v, 1.0),
                _Run(f"even_water_{kmh}_{mm:g}", f"at {at} with both tracks alike",
                     replace(scenario, lanes=(replace(lane, depth_left=mm * 1e-3),)), v),
            ]  # fmt: skip
            for name in sorted(set(TYRES) - {usual.tyre_front.name}):
                tyre = TYRES[name]
                words = f"at {at} on {name.replace('_', ' ')} tyres"
                out.append(_Run(f"{name}_{kmh}_{mm:g}", words, replace(scenario, tyre_front=tyre, tyre_rear=tyre), v))
    return out


def _expected(runs: Sequence[_Run], model: Model, passes: Passes) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Channels (k, c) on the water, NaN for the dry ones, their variances along the lane, and whether a steady
    expectation holds."""
    setups = []
    for run in runs:
        setup = assemble(run.scenario, model)
        if run.beside:
            plant = setup.plant._replace(h_track=np.full(4, _FRONT_AWAY), track_irregularity=np.zeros(4))
            setup = setup._replace(plant=plant)
        setups.append(setup)
    k = len(runs)
    which, on, off = np.arange(k), np.ones(k, dtype=np.bool_), np.zeros(k, dtype=np.bool_)
    v, a = np.array([r.v for r in runs]), np.array([r.a for r in runs])
    water = respond(setups, which, on, Driven(v, a, np.zeros((4, k)))).resistance
    dry = respond(setups, which, off, Driven(v, a, _traction(runs, np.zeros(k))))
    wet = respond(setups, which, on, Driven(v, a, _traction(runs, water)))
    values, variances = np.full((2, k, len(passes.names)), np.nan)
    for c, name in enumerate(passes.names):
        if name == RESISTANCE:
            values[:, c], variances[:, c] = wet.resistance, wet.resistance_variance
        elif name.startswith("slip_slope_"):
            i = WHEELS.index(name[-2:])
            values[:, c], variances[:, c] = wet.slip[i] - dry.slip[i], wet.slip_variance[i]
    usable = (wet.lost.max(axis=0) <= LOST_MAX) & (wet.contact.min(axis=0) >= CONTACT_MIN)
    return values, variances, np.asarray(usable)


def _traction(runs: Sequence[_Run], water: FloatArray) -> FloatArray:
    """Traction (4, k) as torques give it, of a driver who holds speed and acceleration against the water."""
    out = np.empty((4, len(runs)))
    for k, run in enumerate(runs):
        car = run.scenario.vehicle
        a = np.array([run.a])
        F_z = wheel_loads(a, np.zeros(1), mass=car.mass, l_f=car.l_f, l_r=car.l_r, h_cg=car.h_cg, track=car.track)[:, 0]
        drag = float(air_drag(np.array([run.v]), drag_area=car.drag_area, air_density=car.air_density)[0])
        driving = car.mass * (run.a + float(water[k])) + drag + car.rolling_resistance * car.mass * G
        share = 0.5 * np.array([1.0 - car.torque_split_rear] * 2 + [car.torque_split_rear] * 2)
        out[:, k] = share * driving / F_z - car.rolling_resistance
    return out
