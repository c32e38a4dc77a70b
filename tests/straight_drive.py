"""A straight drive with a known slip slope, for tests of its regression; nothing of the package computes the truth."""

import numpy as np
import polars as pl

from aqualog.core.records import Quality, Signals
from aqualog.core.vehicle import Vehicle

G = 9.80665
GIVEN = frozenset({"drivetrain", "mass", "l_f", "l_r"})
RWD = Vehicle(name="rwd", given=GIVEN, l_f=1.35, l_r=1.46)
FWD = Vehicle(name="fwd", drivetrain="fwd", torque_split_rear=0.0, given=GIVEN)
AWD = Vehicle(name="awd", drivetrain="awd", torque_split_rear=0.6, given=GIVEN)
C = 30.0
WHEELS = ("fl", "fr", "rl", "rr")


def drive(
    car,
    *,
    seconds=240.0,
    rate=20.0,
    slope=C,
    seed=0,
    brakes=True,
    torque=True,
    grade=0.03,
    late=0.0,
    noise=5e-4,
    keep=(),
    even=False,
    late_v=0.0,
    speeds=None,
    noise_torque=0.0,
):
    """A straight drive over rolling country with changing traction; every quantity follows from the traction.

    `noise` is that of each wheel speed, rms, as a share of 22 m/s; `late` [s] by which the wheels follow the force;
    `late_v` [s] by which v_x is late; `speeds` (low, high) [m/s] between which it goes in two minutes; `noise_torque` of
    each torque as a share of the wheel's load times radius.
    """
    rng = np.random.default_rng(seed)
    dt = 1.0 / rate
    n = round(seconds * rate)
    t = dt * np.arange(n)
    theta = grade * np.sin(2 * np.pi * t / 40.0)
    swing = 0.0 if even else 0.9 * np.sin(2 * np.pi * t / 17.0) + 0.5 * np.sin(2 * np.pi * t / 7.3)
    a_kin = swing + np.zeros(n)
    if speeds is not None:
        a_kin = a_kin + 0.5 * (speeds[1] - speeds[0]) * 2 * np.pi / 120.0 * np.cos(2 * np.pi * t / 120.0)
    v = (22.0 if speeds is None else 0.5 * sum(speeds)) + np.cumsum(a_kin) * dt
    a_x = a_kin + G * theta
    axles = [G * car.l_r - a_x * car.h_cg, G * car.l_f + a_x * car.h_cg]
    load = np.repeat(0.5 * car.mass / (car.l_f + car.l_r) * np.array(axles), 2, axis=0)
    driven = [i for i, w in enumerate(WHEELS) if w in car.driven]
    free = [i for i in range(4) if i not in driven]
    force = car.mass * a_x + 0.5 * car.drag_area * car.air_density * v**2
    force = force + car.rolling_resistance * load[free].sum(axis=0)
    force = force + sum(car.inertia(WHEELS[i]) / car.r_e(WHEELS[i]) ** 2 for i in free) * a_kin
    share = np.array([1 - car.torque_split_rear] * 2 + [car.torque_split_rear] * 2) / 2.0
    columns = {"t": t, "yaw_rate": np.zeros(n), "a_y": np.zeros(n)}
    for i, w in enumerate(WHEELS):
        own = -car.rolling_resistance - car.inertia(w) / car.r_e(w) ** 2 * a_kin / load[i]  # of a free wheel
        mu = share[i] * force / load[i] if i in driven else own
        moved = np.interp(t - late, t, mu)
        slip = moved / slope + (0.002 if i in driven else 0.0)
        columns[f"omega_{w}"] = v / (1.0 - slip) / car.r_e(w) + rng.normal(0.0, noise * 22.0 / car.r_e(w), n)
        if i in driven and torque:
            columns[f"torque_{w}"] = (
                (mu + car.rolling_resistance) * load[i] * car.arm(w) + car.inertia(w) * a_kin / car.r_e(w)
            )  # fmt: skip
    columns["a_x"] = a_x + rng.normal(0.0, 0.05, n)
    columns["v_x"] = np.interp(t - late_v, t, v) + rng.normal(0.0, 0.005, n)
    for i in driven:
        if noise_torque and torque:
            columns[f"torque_{WHEELS[i]}"] += noise_torque * load[i] * car.arm(WHEELS[i]) * rng.normal(size=n)
    if brakes:
        columns["brake_pressure"] = np.zeros(n)
    for name in keep and set(columns) - {"t", *keep}:
        del columns[name]
    return Signals(pl.DataFrame(columns), round(1e9 / rate), None, {}, Quality(), ("made.csv",))
