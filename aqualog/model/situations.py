"""Catalogue of driving situations: some with aquaplaning, and many that must not look like it."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from aqualog.core.errors import ConfigError
from aqualog.core.vehicle import KEYS, Vehicle
from aqualog.model.drawing import SCORING_POOL, TUNING_POOL, Drawing, Drawn, Pool, Taken
from aqualog.model.plant import build_plant
from aqualog.model.scenario import Scenario
from aqualog.model.situations_chassis import CHASSIS
from aqualog.model.situations_made import DRY, FAULTS, WATER

__all__ = ["SCORING_POOL", "SITUATIONS", "TUNING_POOL", "Drawn", "Pool", "Situation", "believed_vehicle", "draw"]

# how far a vehicle file is off, rms: weighed with a half-full tank and no driver, tyres of another batch (K)
MASS_ERROR, RADIUS_ERROR, ROLLING_ERROR, DRAG_ERROR, SLOPE_ERROR = 0.03, 0.002, 0.05, 0.05, 0.10


@dataclass(frozen=True, slots=True)
class Situation:
    """One situation: `make` turns a drawing of car and tyre into a drive. Nuisances must not raise an alarm."""

    name: str
    title: str
    kind: Literal["aquaplaning", "nuisance"]
    make: Callable[[Drawing], Taken]


SITUATIONS: dict[str, Situation] = {
    **{n: Situation(n, title, "aquaplaning", make) for n, (title, make) in WATER.items()},
    **{n: Situation(n, title, "nuisance", make) for n, (title, make) in (DRY | FAULTS | CHASSIS).items()},
}


def draw(name: str, seed: int, pool: Pool) -> Drawn:
    """Return one drive of a situation.

    Parameters
    ----------
    name : str
        In `SITUATIONS`.
    seed : int
        >= 0. The same name, seed and pool give the same drive; different pools share no random numbers.
    pool : Pool
        Cars, tyres and waters to draw from.

    Raises
    ------
    ConfigError
        If there is no such situation.
    """
    if name not in SITUATIONS:
        raise ConfigError(f'no situation "{name}"', expected=", ".join(SITUATIONS))
    situation = SITUATIONS[name]
    rng = np.random.default_rng([seed + pool.seed_offset, zlib.crc32(name.encode())])
    vehicle = pool.vehicles[int(rng.integers(len(pool.vehicles)))]
    tyre = pool.tyres[int(rng.integers(len(pool.tyres)))]
    p = pool.pressures[int(rng.integers(len(pool.pressures)))]
    scenario, model, note = situation.make(Drawing(rng, pool, vehicle, tyre, p, int(rng.integers(2**31))))
    return Drawn(name, situation.kind, scenario, model, believed_vehicle(scenario, rng), f"{vehicle.name}, {note}")


def believed_vehicle(scenario: Scenario, rng: np.random.Generator) -> Vehicle:
    """Return a realistic vehicle file of this car on these tyres, dry: all values given, each with some error.

    Loads, trailers and roof boxes of the drive are not in it; neither is a tie-rod polynomial.
    """
    car = scenario.vehicle
    plant = build_plant(car, scenario.tyre_front, scenario.tyre_rear, p_front=scenario.p_front, p_rear=scenario.p_rear)
    mass, front, rear, rolling, drag, slope_f, slope_r = (float(x) for x in rng.standard_normal(7))
    return replace(
        car,
        mass=car.mass * (1.0 + MASS_ERROR * mass),
        r_e_f=car.r_e_f * (1.0 + RADIUS_ERROR * front),
        r_l_f=car.r_l_f * (1.0 + RADIUS_ERROR * front),
        r_e_r=car.r_e_r * (1.0 + RADIUS_ERROR * rear),
        r_l_r=car.r_l_r * (1.0 + RADIUS_ERROR * rear),
        rolling_resistance=car.rolling_resistance * (1.0 + ROLLING_ERROR * rolling),
        drag_area=car.drag_area * (1.0 + DRAG_ERROR * drag),
        slip_slope_f=float(plant.slip_slope[0]) * (1.0 + SLOPE_ERROR * slope_f),
        slip_slope_r=float(plant.slip_slope[2]) * (1.0 + SLOPE_ERROR * slope_r),
        mu_max=float(plant.mu[0]),
        given=frozenset({"name", "drivetrain", *KEYS}),
    )
