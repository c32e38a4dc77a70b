"""Simulated passes over a watered lane, and what is read off them; truth, not detectors."""

import numpy as np

from aqualog.model.scenario import Lane, Scenario
from aqualog.model.sensors import IDEAL
from aqualog.model.simulate import assemble, drive_truth
from aqualog.model.tyre import TYRES
from aqualog.notation import WHEELS
from aqualog.physics.load import wheel_loads
from aqualog.physics.resistance import nominal_acceleration
from aqualog.physics.slip import wheel_slip
from aqualog.physics.traction import traction_coefficient
from aqualog.vehicle import Vehicle

SEDAN = Vehicle(name="sedan RWD", mass=1680.0, l_f=1.32, l_r=1.48, given=frozenset({"mass"}))
LOW, MEDIUM, HIGH = 1.9e5, 2.3e5, 2.8e5  # [Pa]
ENTRY, EXIT = 2.0, 7.0  # [s]
LEFT_SHARE, LEFT_IRREGULARITY = 0.6, 0.5  # thesis 2.1: significantly lower and more irregular on the left


def pass_over(
    kmh, *, seed, tyre="worn_summer", rear_tyre=None, p=LOW, h=1.3e-3, load_front=0.0, load_rear=0.0, a=0.0,
    torque=(), even=False, scatter=1.0, vehicle=SEDAN, exit_s=EXIT, duration=8.0,
):  # fmt: skip
    """One pass; the right track has the depth `h`, the left less and unevenly unless `even`."""
    lane = Lane(
        ENTRY, exit_s,
        depth_left=h * (1.0 if even else LEFT_SHARE), depth_right=h,
        irregularity_left=0.05 if even else LEFT_IRREGULARITY, irregularity_right=0.05,
    )  # fmt: skip
    v = kmh / 3.6
    speed = ((0.0, v),) if a == 0.0 else ((0.0, v - a * 4.5), (duration, v + a * (duration - 4.5)))
    return Scenario(
        vehicle, TYRES[tyre], TYRES[rear_tyre or tyre], p, p, load_front, load_rear, duration, 100.0, seed, speed,
        (lane,) if h > 0 else (), extra_torque=torque, water_scatter=scatter, sensors=IDEAL,
    )  # fmt: skip


def drive(**kw):
    scenario = pass_over(**kw)
    truth = drive_truth(assemble(scenario))
    return truth.t, dict(truth.columns), scenario


def wet(t):
    return (t > ENTRY + 0.2) & (t < EXIT - 0.1)


def wheel_dip(c, wheel, vehicle=SEDAN):
    """(omega r_e - v) / v."""
    return (c[f"omega_{wheel}"] * vehicle.r_e(wheel) - c["true_v_x"]) / c["true_v_x"]


def events(t, x, level, gap=0.1):
    """Start and extreme of each stretch where x < level; stretches closer than `gap` are one."""
    below = np.flatnonzero(x < level)
    if below.size == 0:
        return []
    parts = np.split(below, np.flatnonzero(np.diff(t[below]) > gap) + 1)
    return [(float(t[p[0]]), float(x[p].min())) for p in parts]


def resistance(t, c, scenario):
    """Resistance measure (2.9) with the vehicle's own dry parameters and load, low-passed over 0.2 s."""
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
    return nominal - c["a_x"]


def slip_and_traction(t, c, wheel, scenario):
    car = scenario.vehicle
    omega = c[f"omega_{wheel}"]
    s = wheel_slip(omega, c["true_v_x"], car.r_e(wheel))
    mu = traction_coefficient(
        c[f"torque_{wheel}"], c[f"true_load_{wheel}"], np.gradient(omega, t), r_l=car.r_l(wheel),
        inertia=car.inertia(wheel), r_w=car.rolling_resistance,
    )  # fmt: skip
    return s, mu


def slope_of(s, mu):
    """Slip slope by regression of slip on traction: slip is the noisy one."""
    A = np.column_stack([mu, np.ones_like(mu)])
    k, _ = np.linalg.lstsq(A, s, rcond=None)[0]
    return 1.0 / k
