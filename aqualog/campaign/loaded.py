"""The car as a run was driven, with the load from the campaign."""

from __future__ import annotations

from dataclasses import replace

from aqualog.campaign.records import Run
from aqualog.core.errors import ConfigError
from aqualog.core.vehicle import Vehicle
from aqualog.physics.load import centre_shift

__all__ = ["loaded", "loads_of"]


def loads_of(run: Run) -> tuple[float, float]:
    """Load over the front and over the rear axle of a run; 0 where none is given. [kg]"""
    front, rear = (run.values.get(f"load_{axle}_kg", 0.0) for axle in ("front", "rear"))
    return float(front), float(rear)


def loaded(vehicle: Vehicle, run: Run) -> Vehicle:
    """The vehicle with the run's load over its axles; the height of its centre of mass stays.

    Raises
    ------
    ConfigError
        If less than 30 % of the car's mass would remain, or no load on one axle.
    """
    for delta, x in zip(loads_of(run), (0.0, vehicle.wheelbase), strict=True):
        if delta == 0.0:
            continue
        mass = vehicle.mass + delta
        moved = centre_shift(vehicle.mass, vehicle.l_f, delta, x) if mass > 0.3 * vehicle.mass else float("nan")
        if not (vehicle.l_f + moved > 0.05 and vehicle.l_r - moved > 0.05):
            raise ConfigError(
                f"a load of {delta:g} kg on a car of {vehicle.mass:g} kg", where=", ".join(map(str, run.logs)),
                expected="load_front_kg and load_rear_kg that leave load on both axles",
            )  # fmt: skip
        vehicle = replace(vehicle, mass=mass, l_f=vehicle.l_f + moved, l_r=vehicle.l_r - moved)
    return vehicle
