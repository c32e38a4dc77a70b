"""Simulated passes over a watered lane; truth, not detectors.

One parameter set serves all passes (aqualog.model.tyre). A pass is named by what is varied; the car, its driver and the
lane's place are the same in all.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from aqualog.core.notation import WHEELS
from aqualog.core.records import FloatArray
from aqualog.model.programme import LEFT_SHARE, SEDAN
from aqualog.model.scenario import Lane, Profile, Scenario
from aqualog.model.sensors import IDEAL
from aqualog.model.simulate import assemble, drive_truth
from aqualog.model.tyre import TYRES
from aqualog.physics.load import wheel_loads
from aqualog.physics.resistance import nominal_acceleration
from aqualog.physics.slip import wheel_slip
from aqualog.physics.traction import traction_coefficient

__all__ = [
    "DIP", "DURATION", "ENTRY", "EXIT", "HIGH", "KMH", "LOW", "MEDIUM", "SPIN_UP", "STOP", "Pass", "drive_pass",
    "events", "resistance", "scenario_of", "slip_and_traction", "slope_of", "wheel_dip",
]  # fmt: skip

KMH = 1.0 / 3.6
LOW, MEDIUM, HIGH = 1.9e5, 2.3e5, 2.8e5  # [Pa]
ENTRY, EXIT, DURATION = 2.0, 7.0, 8.0  # [s]
LEFT_IRREGULARITY = 0.5  # with `LEFT_SHARE`: significantly lower and more irregular on the left (thesis 2.1)
DIP = -0.02  # [-] a minor spin-down: the rim 2 % slower than the car
STOP = -0.5  # [-] a full spin-down: less than half of its speed
SPIN_UP = 0.05  # [-]
_GAP_S = 0.1  # [s] dips closer than this are one


@dataclass(frozen=True, slots=True)
class Pass:
    """One pass: speed in the middle of the lane [km/h], tyre, pressure [Pa], depth in the right track [m], loads [kg].

    `a` [m/s²]: speed rises through the pass; `wiggles`: drive torque that varies by 250 N·m with 1 s, for a slope to
    be regressed; `kick` [N·m]: extra drive torque for 0.7 s on the lane; `even`: both tracks alike; `scatter` scales
    the fluctuation of the contact. A depth of 0 is a dry road.
    """

    kmh: float
    tyre: str = "worn_summer"
    p: float = LOW
    h: float = 1.3e-3
    load_front: float = 0.0
    load_rear: float = 0.0
    a: float = 0.0
    wiggles: bool = False
    kick: float = 0.0
    even: bool = False
    scatter: float = 1.0


def scenario_of(p: Pass, seed: int) -> Scenario:
    """The drive behind a pass: 8 s, water from 2 to 7 s."""
    lane = Lane(
        ENTRY, EXIT,
        depth_left=p.h * (1.0 if p.even else LEFT_SHARE), depth_right=p.h,
        irregularity_left=0.05 if p.even else LEFT_IRREGULARITY, irregularity_right=0.05,
    )  # fmt: skip
    v = p.kmh * KMH
    speed: Profile = ((0.0, v),)
    if p.a != 0.0:
        speed = ((0.0, v - p.a * 4.5), (DURATION, v + p.a * (DURATION - 4.5)))
    tyre = TYRES[p.tyre]
    return Scenario(
        SEDAN, tyre, tyre, p.p, p.p, p.load_front, p.load_rear, DURATION, 100.0, seed, speed,
        (lane,) if p.h > 0.0 else (), extra_torque=_torque(p), water_scatter=p.scatter, sensors=IDEAL,
    )  # fmt: skip


def _torque(p: Pass) -> Profile:
    if p.kick:
        return ((0.0, 0.0), (3.0, 0.0), (3.05, p.kick), (3.75, p.kick), (3.8, 0.0), (DURATION, 0.0))
    if p.wiggles:
        t = np.arange(0.0, DURATION, 0.05)
        return tuple((float(x), float(250.0 * np.sin(2.0 * np.pi * x))) for x in t)
    return ()


def drive_pass(p: Pass, seed: int) -> tuple[FloatArray, Mapping[str, FloatArray], Scenario]:
    """Time (n,) [s], columns of the truth, and the scenario."""
    scenario = scenario_of(p, seed)
    truth = drive_truth(assemble(scenario))
    return truth.t, truth.columns, scenario


def wheel_dip(c: Mapping[str, FloatArray], wheel: str) -> FloatArray:
    """(omega r_e - v) / v of a wheel, array (n,). [-]"""
    dip: FloatArray = (c[f"omega_{wheel}"] * SEDAN.r_e(wheel) - c["true_v_x"]) / c["true_v_x"]
    return dip


def events(t: FloatArray, x: FloatArray, level: float, gap: float = _GAP_S) -> list[tuple[float, float]]:
    """Start [s] and extreme of each stretch where x < level; stretches closer than `gap` [s] are one."""
    below = np.flatnonzero(x < level)
    if below.size == 0:
        return []
    parts = np.split(below, np.flatnonzero(np.diff(t[below]) > gap) + 1)
    return [(float(t[p[0]]), float(x[p].min())) for p in parts]


def resistance(t: FloatArray, c: Mapping[str, FloatArray], scenario: Scenario) -> FloatArray:
    """Resistance measure (2.9) with the vehicle's own dry parameters and load, array (n,). [m/s²]"""
    car = scenario.vehicle
    mass = car.mass + scenario.load_front + scenario.load_rear
    l_f = (car.mass * car.l_f + scenario.load_rear * car.wheelbase) / mass
    loads = wheel_loads(c["a_x"], c["a_y"], mass=mass, l_f=l_f, l_r=car.wheelbase - l_f, h_cg=car.h_cg, track=car.track)
    torque = np.array([c[f"torque_{w}"] for w in WHEELS])
    omega_dot = np.array([np.gradient(c[f"omega_{w}"], t) for w in WHEELS])
    nominal = nominal_acceleration(
        torque, loads, c["true_v_x"], omega_dot, r_l=np.array([car.r_l(w) for w in WHEELS]),
        inertia=np.array([car.inertia(w) for w in WHEELS]), mass=mass, r_w=car.rolling_resistance,
        drag_area=car.drag_area, air_density=car.air_density,
    )  # fmt: skip
    return np.asarray(nominal - c["a_x"], dtype=np.float64)


def slip_and_traction(
    t: FloatArray, c: Mapping[str, FloatArray], wheel: str, scenario: Scenario
) -> tuple[FloatArray, FloatArray]:
    """Slip (3.13) and traction coefficient of a wheel from its torque and true load, arrays (n,). [-]"""
    car = scenario.vehicle
    omega = c[f"omega_{wheel}"]
    s = wheel_slip(omega, c["true_v_x"], car.r_e(wheel))
    mu = traction_coefficient(
        c[f"torque_{wheel}"], c[f"true_load_{wheel}"], np.gradient(omega, t), r_l=car.r_l(wheel),
        inertia=car.inertia(wheel), r_w=car.rolling_resistance,
    )  # fmt: skip
    return np.asarray(s, dtype=np.float64), np.asarray(mu, dtype=np.float64)


def slope_of(s: FloatArray, mu: FloatArray) -> float:
    """Slip slope by regression of slip on traction, for slip is the noisy one; arrays (n,). [-]"""
    A = np.column_stack([mu, np.ones_like(mu)])
    k, _ = np.linalg.lstsq(A, s, rcond=None)[0]
    return float(1.0 / k)
