"""Common parts of all situations: pools of cars, tyres and waters, a way to drive, weather, and random numbers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from aqualog.core.vehicle import Vehicle
from aqualog.model.effects import EFFECTS
from aqualog.model.plant import understeer_gradient
from aqualog.model.scenario import SURFACES, Profile, Scenario, Surface
from aqualog.model.sensors import Sensors
from aqualog.model.term import Model, Term
from aqualog.model.tyre import TYRES, Tyre
from aqualog.physics.load import G

__all__ = [
    "KMH", "SCORING_POOL", "TUNING_POOL", "Drawing", "Drawn", "Pool", "Taken", "full_speed", "lagging_torque",
    "slalom_angle", "terms",
]  # fmt: skip

Range = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Pool:
    """What a situation may draw, SI.

    `depths` [m] of water and `pressures` [Pa] of tyres are lists of values; `snow`, `ice`, `wet_ice` and `damp` ranges
    of a surface's friction [-]; `seed_offset` keeps the random numbers of two pools apart.
    """

    name: str
    vehicles: tuple[Vehicle, ...]
    tyres: tuple[Tyre, ...]
    depths: tuple[float, ...]
    pressures: tuple[float, ...]
    snow: Range
    ice: Range
    wet_ice: Range
    damp: Range
    seed_offset: int


_WORN, _NEW, _WINTER = TYRES["worn_summer"], TYRES["new_summer"], TYRES["new_winter"]

TUNING_POOL = Pool(
    "tuning",
    vehicles=(
        Vehicle(
            name="saloon rwd", drivetrain="rwd", torque_split_rear=1.0, mass=1640.0, l_f=1.34, l_r=1.47, h_cg=0.53,
            track=1.56, drag_area=0.64, rolling_resistance=0.0103, slip_slope_f=31.0, slip_slope_r=31.0,
        ),
        Vehicle(
            name="hatchback fwd", drivetrain="fwd", torque_split_rear=0.0, mass=1380.0, l_f=1.06, l_r=1.56, h_cg=0.55,
            track=1.53, drag_area=0.63, rolling_resistance=0.0100, slip_slope_f=29.0, slip_slope_r=29.0,
        ),
        Vehicle(
            name="off-roader awd", drivetrain="awd", torque_split_rear=0.6, mass=2010.0, l_f=1.41, l_r=1.43, h_cg=0.64,
            track=1.63, drag_area=0.92, rolling_resistance=0.0110, r_e_f=0.354, r_e_r=0.354, r_l_f=0.345, r_l_r=0.345,
            inertia_f=1.8, inertia_r=1.8, slip_slope_f=32.0, slip_slope_r=32.0,
        ),
    ),
    tyres=(
        _WORN,
        replace(_WORN, name="half_worn_summer", tread_depth=3.2e-3, slip_slope_factor=0.97),
        replace(_WINTER, name="worn_winter", tread_depth=3.0e-3, slip_slope_factor=0.85),
    ),
    depths=(0.8e-3, 1.3e-3, 1.8e-3),
    pressures=(1.9e5, 2.3e5),
    snow=(0.20, 0.40), ice=(0.09, 0.16), wet_ice=(0.04, 0.08), damp=(0.75, 0.92), seed_offset=0,
)  # fmt: skip
"""For choosing thresholds."""

SCORING_POOL = Pool(
    "scoring",
    vehicles=(
        Vehicle(
            name="estate rwd", drivetrain="rwd", torque_split_rear=1.0, mass=1790.0, l_f=1.42, l_r=1.48, h_cg=0.56,
            track=1.58, drag_area=0.68, rolling_resistance=0.0108, r_e_f=0.322, r_e_r=0.322, r_l_f=0.314, r_l_r=0.314,
            inertia_f=1.25, inertia_r=1.25, slip_slope_f=34.0, slip_slope_r=34.0,
        ),
        Vehicle(
            name="people carrier fwd", drivetrain="fwd", torque_split_rear=0.0, mass=1650.0, l_f=1.22, l_r=1.57,
            h_cg=0.61, track=1.56, drag_area=0.80, rolling_resistance=0.0112, r_e_f=0.326, r_e_r=0.326, r_l_f=0.318,
            r_l_r=0.318, inertia_f=1.2, inertia_r=1.2, slip_slope_f=30.0, slip_slope_r=30.0,
        ),
        Vehicle(
            name="saloon awd", drivetrain="awd", torque_split_rear=0.55, mass=1810.0, l_f=1.36, l_r=1.50, h_cg=0.54,
            track=1.59, drag_area=0.66, rolling_resistance=0.0104, r_e_f=0.334, r_e_r=0.334, r_l_f=0.326, r_l_r=0.326,
            inertia_f=1.4, inertia_r=1.4, slip_slope_f=28.0, slip_slope_r=28.0,
        ),
    ),
    tyres=(
        TYRES["very_worn_summer"],
        replace(_NEW, name="used_summer", tread_depth=4.0e-3, slip_slope_factor=0.94),
        replace(_WINTER, name="used_winter", tread_depth=4.5e-3, slip_slope_factor=0.80),
    ),
    depths=(0.6e-3, 1.1e-3, 1.6e-3, 2.2e-3),
    pressures=(2.1e5, 2.5e5),
    snow=(0.20, 0.40), ice=(0.08, 0.15), wet_ice=(0.04, 0.08), damp=(0.75, 0.92), seed_offset=1_000_000,
)  # fmt: skip
"""For reported figures only."""


KMH = 1.0 / 3.6  # [m/s]
TORQUE_SIGNALS = ("torque_fl", "torque_fr", "torque_rl", "torque_rr")


class Taken(NamedTuple):
    """Result of a situation for a drawing: the drive, terms on top, and a sentence about the random choices."""

    scenario: Scenario
    model: Model
    note: str


@dataclass(frozen=True, slots=True)
class Drawn:
    """One drive of a situation; `believed` is the car as the detector's vehicle file has it."""

    name: str
    kind: str
    scenario: Scenario
    model: Model
    believed: Vehicle
    note: str


@dataclass(frozen=True, slots=True)
class Drawing:
    """Car, tyre and pressure [Pa] of a drive, and its random numbers."""

    rng: np.random.Generator
    pool: Pool
    vehicle: Vehicle
    tyre: Tyre
    p: float
    seed: int

    def between(self, low: float, high: float) -> float:
        """Return a random number, uniform between the two."""
        return float(self.rng.uniform(low, high))

    def one_of(self, *choices: Any) -> Any:
        """Return one of the choices."""
        return choices[int(self.rng.integers(len(choices)))]

    def drive(self, duration_s: float, speed: Profile, *, weather: bool = True, **given: Any) -> Scenario:
        """Return a drive of this car: with gusts (rms 1 m/s) and hills (rms 1 %) unless given or switched off."""
        if weather:
            given = {"wind": self.gusts(duration_s, 1.0), "grade": self.hills(0.01), **given}
        return Scenario(
            self.vehicle, self.tyre, self.tyre, self.p, self.p, duration_s=round(duration_s, 2), seed=self.seed,
            speed=speed, **given,
        )  # fmt: skip

    def gusts(self, duration_s: float, rms: float, *, mean: float = 0.0, every_s: float = 2.0) -> Profile:
        """Return head wind over time: independent knots `every_s` apart. [s, m/s]"""
        t = np.arange(0.0, duration_s + every_s, every_s)
        return tuple(zip(t.tolist(), (mean + rms * self.rng.standard_normal(t.size)).tolist(), strict=True))

    def hills(self, rms: float, *, every_m: float = 150.0, most: float = 0.08) -> Profile:
        """Return the slope angle over the way: independent knots `every_m` apart, over 6 km. [m, rad]"""
        s = np.arange(0.0, 6000.0, every_m)
        grade = np.clip(rms * self.rng.standard_normal(s.size), -most, most)
        return tuple(zip(s.tolist(), np.arctan(grade).tolist(), strict=True))

    def cruise(self, duration_s: float, v: float, *, spread: float = 0.08, a_most: float = 0.6) -> Profile:
        """Return a speed that varies about v [m/s] within a relative spread, no faster than `a_most`. [s, m/s]"""
        points = [(0.0, v)]
        while points[-1][0] < duration_s:
            step = self.between(4.0, 12.0)
            wanted = v * (1.0 + self.between(-spread, spread))
            change = min(max(wanted - points[-1][1], -a_most * step), a_most * step)
            points.append((points[-1][0] + step, points[-1][1] + change))
        return tuple(points)

    def surface(self, name: str, friction: tuple[float, float] | None = None, **changed: Any) -> Surface:
        """Return a surface of the catalogue with a friction drawn between two."""
        values = dict(changed) if friction is None else {"mu": self.between(*friction), **changed}
        return replace(SURFACES[name], **values)


def terms(*given: tuple[str, dict[str, float], str | None]) -> Model:
    """A model of (effect, values, place)."""
    return Model(tuple(Term(EFFECTS[name], values, where) for name, values, where in given))


def full_speed(drawing: Drawing, depth: float) -> float:
    """Return the full aquaplaning speed of a static front wheel in even water; over 1e4 if drained. [m/s]"""
    car, tyre = drawing.vehicle, drawing.tyre
    load = 0.5 * car.mass * G * car.l_r / car.wheelbase
    return float(tyre.full_speed(np.array(depth), np.array(load), p=drawing.p))


def slalom_angle(vehicle: Vehicle, tyre: Tyre, v: float, a_y: float) -> float:
    """Return the road-wheel angle for a lateral acceleration by the steady gain of the linear two-track model. [rad]

    For a_y well below the friction; near it tyres give less force.
    """
    return a_y * (vehicle.wheelbase / (v * v) + understeer_gradient(tyre.cornering_slope))


def lagging_torque(sensors: Sensors, lag_s: float) -> Sensors:
    """Sensors whose torque signals follow a first-order lag. [s]"""
    for name in TORQUE_SIGNALS:
        sensors = sensors.with_channel(name, replace(sensors.channels[name], lag_s=lag_s))
    return sensors
