"""Common parts of all situations: a car on tyres, a way to drive, weather, and random numbers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from aqualog.core.vehicle import Vehicle
from aqualog.model.effects import EFFECTS
from aqualog.model.plant import understeer_gradient
from aqualog.model.pools import Pool
from aqualog.model.scenario import SURFACES, Profile, Scenario, Surface
from aqualog.model.sensors import Sensors
from aqualog.model.term import Model, Term
from aqualog.model.tyre import Tyre
from aqualog.physics.load import G

__all__ = ["KMH", "Drawing", "Drawn", "Taken", "full_speed", "lagging_torque", "slalom_angle", "terms"]

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
