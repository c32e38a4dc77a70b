"""Cars as numbers, SI and ISO 8855: x forward, y left, z up; pitch positive nose down, roll positive left side up.

Wheels stand in the order fl, fr, rl, rr.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from aqualog.core.vehicle import KEYS, Vehicle

from .tyre import LAW, tmeasy

__all__ = [
    "ARCHETYPES", "FILE_ERRORS", "NO_ODD", "SPREAD", "Car", "Odd", "draw_car", "of_the_day", "settle", "vehicle_file",
]  # fmt: skip

G = 9.81
SPREAD: Mapping[str, float] = {"mass": 0.004, "drag_area": 0.015, "rolling_resistance": 0.015, "torque_gain": 0.003}
"""Standard deviation from day to day, relative: fuel, wind, temperature, friction of the driveline."""
FILE_ERRORS: Mapping[str, float] = {
    "mass": 0.002, "drag_area": 0.008, "rolling_resistance": 0.008, "r_e": 3e-4, "r_l": 5e-4, "inertia": 0.04,
    "slip_slope": 0.02, "torque_gain": 0.002, "h_cg": 0.03, "track": 0.005, "l_f": 0.003, "mu_max": 0.05,
}  # fmt: skip
"""What a calibration leaves, standard deviations, relative: of the vehicle file against the car on a mean day."""
PRESSED = 0.972  # loaded radius over the rolling one
WHEEL_SPREAD = 1.5e-4  # radius of a wheel against its axle's, relative


class Car(NamedTuple):
    """A car on its tyres; arrays (4,) by wheel, (2,) by axle. Neutral values of the last ones change nothing."""

    mass: float
    l_f: float
    l_r: float
    h_cg: float
    track: float
    I_xx: float
    I_yy: float
    I_zz: float
    unsprung: np.ndarray
    spring: np.ndarray
    damper: np.ndarray
    bar: np.ndarray
    anti: float  # share of pitch and roll moments that links carry past the springs
    tyre_spring: np.ndarray
    tyre_damper: np.ndarray
    static: np.ndarray  # [N] loads at rest
    drag_area: float
    air_density: float
    lift_f: float  # [m^2] lift area on an axle
    lift_r: float
    wind: float
    r_e: np.ndarray
    rim: np.ndarray  # [kg m^2]
    belt: np.ndarray
    torsion: np.ndarray  # [N m/rad] belt to rim
    torsion_damper: np.ndarray
    slope: np.ndarray  # dF/ds / F_z at the origin
    cornering: np.ndarray
    load_law: np.ndarray  # relative change of the slope per relative change of the load
    load_ref: np.ndarray
    mu: np.ndarray
    bristle_x: np.ndarray  # [m] relaxation of the contact
    bristle_y: np.ndarray
    roll_0: np.ndarray  # rolling resistance, and what it gains with speed / (30 m/s) to the 1st and 4th power
    roll_1: float
    roll_4: float
    split_rear: float
    shaft: np.ndarray  # [N m/rad] by axle
    shaft_damper: np.ndarray
    backlash: float  # [rad]
    turning: np.ndarray  # [kg m^2] engine or motor at the wheels, by gear
    is_electric: float
    power: float
    brake_front: float
    torque_gain: float
    growth: np.ndarray
    slope_drift: np.ndarray
    brake_drag: np.ndarray
    corner_drag: float
    warm_extra: float
    warm_time: float
    towed: float
    leak_start: float
    leak_time: float
    leak_radius: np.ndarray
    leak_slope: np.ndarray
    water_gain: np.ndarray
    contact_gain: np.ndarray
    track_film: float
    law: np.ndarray = LAW  # of water


class Odd(NamedTuple):
    """Forms that no effect has; a first number of nought switches each off. `hidden.KINDS` says what they mean."""

    hump: np.ndarray = np.array([0.0, 20.0, 3.0])  # N, m/s, m/s
    saddle: np.ndarray = np.array([0.0, 200.0, 80.0])  # share, N m, N m
    interval: np.ndarray = np.array([0.0, 60.0, 75.0])  # N, s, s
    waves: np.ndarray = np.array([0.0, 150.0, 0.0])  # N, m, rad
    steering: np.ndarray = np.array([0.0])  # N/rad
    hours: np.ndarray = np.array([0.0, 0.3, 0.7])  # N, shares of the drive
    valley: np.ndarray = np.array([0.0, 20.0, 4.0, 400.0, 150.0])  # N, m/s, m/s, N m, N m
    turning: np.ndarray = np.array([0.0])  # s/rad, share of the slope lost per yaw rate
    ripple: np.ndarray = np.array([0.0, 0.0, 1.0])  # N m, wheel, times a turn
    linger: np.ndarray = np.array([0.0, 20.0])  # N m, s
    chafe: np.ndarray = np.array([0.0, 1.0, 0.9, 0.2])  # N, side of the bend, m/s^2, m/s^2
    hum: np.ndarray = np.array([0.0, 20.0, 2.0])  # share of the slope, m/s, m/s
    stretch: np.ndarray = np.array([0.0, 700.0, 0.0])  # N at 20 m/s, m, rad
    soft: np.ndarray = np.array([0.0])  # share of the slope
    agate: np.ndarray = np.array([0.0, 0.1])  # N, rad/s
    beryl: np.ndarray = np.array([0.0, 60.0, 75.0])  # N at 20 m/s, s, s
    galena: np.ndarray = np.array([0.0, 300.0, 0.0])  # share of the slope, m, rad
    jasper: np.ndarray = np.array([0.0, 0.0, 1.0, 0.7, 0.2])  # relative, wheel, side of the bend, m/s^2, m/s^2
    zircon: np.ndarray = np.array([0.0])  # rad
    garnet: np.ndarray = np.array([0.0, 0.6])  # N s^2/m, m/s^2
    pyrite: np.ndarray = np.array([0.0, 20.0, 5.0])  # N at 20 m/s, m/s, m/s
    rutile: np.ndarray = np.array([0.0])  # share of the slope
    talc: np.ndarray = np.array([0.0])  # 1/(kN m (10 m/s))
    albite: np.ndarray = np.array([0.0, 30.0, 0.0])  # W, s, rad
    calcite: np.ndarray = np.array([0.0])  # 1/m
    spinel: np.ndarray = np.array([0.0, 0.3])  # N m, rad/s


NO_ODD = Odd()


class Archetype(NamedTuple):
    """What a kind of car is drawn around."""

    drivetrain: str
    split_rear: float
    electric: bool
    mass: float
    base: float
    front: float  # share of the weight
    h_cg: float
    track: float
    drag_area: float
    roll: float
    r_e: float
    inertia: float
    slope: float


ARCHETYPES = (
    Archetype("rwd", 1.0, False, 1640.0, 2.81, 0.51, 0.55, 1.56, 0.65, 0.0102, 0.316, 1.10, 31.0),
    Archetype("fwd", 0.0, False, 1330.0, 2.60, 0.61, 0.53, 1.51, 0.63, 0.0097, 0.305, 0.95, 28.0),
    Archetype("awd", 0.55, False, 2050.0, 2.87, 0.53, 0.64, 1.63, 0.84, 0.0105, 0.352, 1.70, 30.0),
    Archetype("rwd", 1.0, True, 1890.0, 2.77, 0.48, 0.52, 1.59, 0.57, 0.0091, 0.334, 1.55, 27.0),
    Archetype("awd", 0.60, True, 2260.0, 2.93, 0.49, 0.51, 1.64, 0.58, 0.0089, 0.346, 1.80, 26.0),
)


def draw_car(rng: np.random.Generator) -> tuple[Car, str]:
    """A car on a mean day, and its drivetrain."""
    a = ARCHETYPES[rng.integers(len(ARCHETYPES))]

    def about(x: float, share: float) -> float:
        return float(x * (1.0 + share * np.clip(rng.standard_normal(), -2.0, 2.0)))

    mass, base, front = about(a.mass, 0.03), about(a.base, 0.01), about(a.front, 0.02)
    l_r = front * base
    axles = np.array([front, front, 1.0 - front, 1.0 - front])
    static = 0.5 * mass * G * axles
    unsprung = np.array([38.0, 38.0, 36.0, 36.0]) * mass / 1600.0
    corner = 0.5 * mass * axles - unsprung
    spring = corner * (2.0 * np.pi * np.array([1.25, 1.25, 1.42, 1.42])) ** 2  # rides at the front softer
    tyre = np.full(4, about(215e3, 0.05)) * mass / 1600.0
    r_e = about(a.r_e, 0.02)
    inertia = about(a.inertia, 0.06)
    driven = np.array([a.split_rear < 1.0] * 2 + [a.split_rear > 0.0] * 2)
    rim = np.where(driven, 0.62, 0.55) * inertia
    slope = np.repeat([about(a.slope, 0.06), about(a.slope, 0.06)], 2)
    ratios = np.array([9.4]) if a.electric else np.array([13.6, 8.1, 5.5, 4.2, 3.3, 2.7])
    engine = 0.055 if a.electric else 0.2
    ones = np.ones(4)
    car = Car(
        mass=mass, l_f=base - l_r, l_r=l_r, h_cg=about(a.h_cg, 0.03), track=about(a.track, 0.01),
        I_xx=0.32 * mass, I_yy=0.98 * mass * l_r * (base - l_r) * 0.95, I_zz=1.02 * mass * l_r * (base - l_r),
        unsprung=unsprung, spring=spring, damper=2.0 * 0.29 * np.sqrt(spring * corner),
        bar=np.array([0.55, 0.3]) * spring[[0, 2]], anti=0.18,
        tyre_spring=tyre, tyre_damper=np.full(4, 140.0), static=static,
        drag_area=about(a.drag_area, 0.04), air_density=1.204, lift_f=0.05, lift_r=0.09, wind=0.0,
        r_e=r_e * (1.0 + WHEEL_SPREAD * rng.standard_normal(4)),
        rim=rim, belt=0.45 * inertia * ones, torsion=8.5e4 * ones, torsion_damper=60.0 * ones,
        slope=slope, cornering=np.array([15.0, 15.0, 19.0, 19.0]) * about(1.0, 0.06),
        load_law=np.full(4, rng.normal(0.18, 0.07)), load_ref=static.copy(), mu=np.full(4, about(1.04, 0.03)),
        bristle_x=0.04 * ones, bristle_y=0.2 * ones,
        roll_0=np.full(4, about(a.roll, 0.06)), roll_1=4e-4, roll_4=2.5e-4,
        split_rear=a.split_rear, shaft=np.full(2, about(9500.0, 0.1)), shaft_damper=np.full(2, 55.0),
        backlash=0.0 if a.electric else 0.006, turning=engine * ratios**2, is_electric=float(a.electric),
        power=about(105.0, 0.1) * mass, brake_front=0.66, torque_gain=1.0, growth=0.0 * ones,
        slope_drift=0.0 * ones, brake_drag=0.0 * ones, corner_drag=0.0, warm_extra=0.0, warm_time=300.0, towed=0.0,
        leak_start=0.0, leak_time=1.0, leak_radius=0.0 * ones, leak_slope=0.0 * ones, water_gain=ones.copy(),
        contact_gain=ones.copy(), track_film=4e-4,
    )  # fmt: skip
    return car, a.drivetrain


def settle(car: Car) -> Car:
    """The car with the loads at rest that its mass and axles give."""
    base = car.l_f + car.l_r
    axles = np.array([car.l_r, car.l_r, car.l_f, car.l_f]) / base
    return car._replace(static=0.5 * car.mass * G * axles)


def of_the_day(car: Car, rng: np.random.Generator) -> Car:
    """The same car on another day."""
    by = {name: 1.0 + sd * rng.standard_normal() for name, sd in SPREAD.items()}
    return settle(car._replace(
        mass=car.mass * by["mass"], drag_area=car.drag_area * by["drag_area"],
        roll_0=car.roll_0 * by["rolling_resistance"], torque_gain=car.torque_gain * by["torque_gain"],
    ))  # fmt: skip


def gradients(car: Car) -> tuple[float, float]:
    """Pitch and roll per acceleration at rest on the springs, nose up and right side down positive [rad/(m/s^2)]."""
    base = car.l_f + car.l_r
    series = 1.0 / (1.0 / car.spring + 1.0 / car.tyre_spring)
    x = np.array([car.l_f, car.l_f, -car.l_r, -car.l_r])
    K = np.array([[series.sum(), -(series * x).sum()], [-(series * x).sum(), (series * x * x).sum()]])
    moment = (1.0 - car.anti) * car.h_cg * car.mass
    direct = car.anti * car.h_cg * car.mass / base**2 * (2.0 / car.tyre_spring.mean())
    pitch = float(np.linalg.solve(K, [0.0, moment])[1] + 0.5 * direct)
    half = 0.5 * car.track
    stiff = car.spring + 2.0 * np.repeat(car.bar, 2)
    roll_stiff = (half * half / (1.0 / stiff + 1.0 / car.tyre_spring)).sum()
    tyres = half * half * car.tyre_spring.sum()
    return pitch, float(((1.0 - car.anti) / roll_stiff + car.anti / tyres) * car.h_cg * car.mass)


def vehicle_file(car: Car, drivetrain: str, rng: np.random.Generator) -> Vehicle:
    """What a calibration of the car on a mean day would write, with the errors that it leaves."""
    roll, area = _constant_and_square(car)
    inertia = (car.rim + car.belt)[[0, 2]]

    def off(name: str, x: float) -> float:
        return round(float(x * (1.0 + FILE_ERRORS[name] * rng.standard_normal())), 6)

    r_e = [off("r_e", x) for x in (car.r_e[:2].mean(), car.r_e[2:].mean())]
    base, l_f = round(car.l_f + car.l_r, 4), off("l_f", car.l_f)
    mass, drag, rolling = off("mass", car.mass), off("drag_area", area), off("rolling_resistance", roll)
    return Vehicle(
        name="car", drivetrain=drivetrain, mass=mass, l_f=l_f, l_r=round(base - l_f, 6),  # type: ignore[arg-type]
        h_cg=off("h_cg", car.h_cg), track=off("track", car.track), drag_area=drag, air_density=car.air_density,
        rolling_resistance=rolling, torque_split_rear=car.split_rear, torque_gain=off("torque_gain", car.torque_gain), r_e_f=r_e[0], r_e_r=r_e[1],
        r_l_f=off("r_l", PRESSED * car.r_e[0]), r_l_r=off("r_l", PRESSED * car.r_e[2]), inertia_f=off("inertia", inertia[0]),
        inertia_r=off("inertia", inertia[1]), slip_slope_f=off("slip_slope", _secant(car, 0)),
        slip_slope_r=off("slip_slope", _secant(car, 2)), mu_max=off("mu_max", car.mu[0]),
        spread={
            "mass": round(mass * SPREAD["mass"], 2), "drag_area": round(drag * SPREAD["drag_area"], 4),
            "rolling_resistance": round(rolling * SPREAD["rolling_resistance"], 6),
            "torque_gain": SPREAD["torque_gain"],
        },
        given=frozenset({"name", "drivetrain", *KEYS}),
    )  # fmt: skip


def _constant_and_square(car: Car) -> tuple[float, float]:
    """Rolling resistance and drag area by which a balance without the other powers of speed fits the log's best.

    The wind that holds the car at its height and lifts its axles also turns its nose, and the accelerometer with it: the
    log shows a drag area less by that.
    """
    v = np.linspace(3.0, 38.0, 200)
    lift = 0.5 * car.air_density * (car.lift_f + car.lift_r) * v**2
    weight = car.mass * G
    roll = car.roll_0.mean() + car.roll_1 * (v / 30.0) + car.roll_4 * (v / 30.0) ** 4
    force = roll * (weight - lift) + 0.5 * car.air_density * car.drag_area * v**2
    form = np.stack([np.full(v.size, weight), 0.5 * car.air_density * v**2], axis=1)
    fit = np.linalg.lstsq(form, force, rcond=None)[0]
    nose = car.h_cg * car.drag_area + car.l_f * car.lift_f - car.l_r * car.lift_r
    return float(fit[0]), float(fit[1] - G * gradients(car)[0] / car.h_cg * nose)


def _secant(car: Car, i: int) -> float:
    """Slope at the origin of the parabola of bristles that fits the tyre best up to a fifth of the load."""
    s = np.linspace(1e-4, 0.2 / car.slope[i], 60)
    F = np.array([tmeasy(x, 0.0, 1e3, car.mu[i], car.slope[i], car.cornering[i])[0] for x in s]) / 1e3
    slopes = car.slope[i] * np.linspace(0.85, 1.1, 501)
    left = 1.0 - np.minimum(slopes[:, None] * s / (3.0 * car.mu[i]), 1.0)
    error = ((car.mu[i] * (1.0 - left**3) - F) ** 2).sum(axis=1)
    return float(slopes[error.argmin()])
