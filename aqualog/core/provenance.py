"""How sure the values of a vehicle file are: the standard deviation of each, by where it comes from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from aqualog.core.vehicle import KEYS, Provenance, Vehicle

__all__ = ["TYPICAL", "Share", "Typical", "provenance_of", "uncertainty"]


class Share(float):
    """A standard deviation as a share of the value; a plain number is one in the key's unit."""


@dataclass(frozen=True, slots=True)
class Typical:
    """Standard deviations of a key by source, and why they are of this size."""

    measured: float
    calibrated: float
    data_sheet: float
    guess: float
    why: str


def _shares(measured: float, calibrated: float, data_sheet: float, guess: float, why: str) -> Typical:
    return Typical(Share(measured), Share(calibrated), Share(data_sheet), Share(guess), why)


_AXLE = Typical(0.015, 0.03, Share(0.03), Share(0.08), "scales under the wheels show it to 10 kg; load moves it (K)")
_RADIUS = _shares(0.001, 0.0003, 0.01, 0.015, "roll-out of ten turns; `calibrate` finds it to 0.03 %; wear is 1 % (K)")
_LOADED = _shares(0.005, 0.005, 0.015, 0.02, "a ruler shows 2 mm of 310; pressure and load move it (K)")
_INERTIA = _shares(0.05, 0.15, 0.20, 0.30, "1.0-1.8 kg*m^2 with brake and driveline (K)")
_SLOPE = _shares(0.05, 0.10, 0.20, 0.25, "25 to 40 over tyres of one size; temperature and wear (K)")

TYPICAL: Mapping[str, Typical] = {
    "mass": Typical(10.0, Share(0.02), Share(0.03), Share(0.08), "scales; a torque's scale; equipment and driver (K)"),
    "l_f": _AXLE,
    "l_r": _AXLE,
    "h_cg": _shares(0.03, 0.05, 0.05, 0.10, "tilting tests scatter by 3 %; load raises it (K)"),
    "track": _shares(0.003, 0.01, 0.01, 0.03, "a tape shows 5 mm; wheels with another offset (K)"),
    "drag_area": _shares(0.02, 0.04, 0.08, 0.20, "tunnel against road; height, wheels, boxes; car to car (K)"),
    "air_density": _shares(0.005, 0.01, 0.03, 0.05, "a barometer at hand; 15 degC are 5 %, 400 m of height 4 % (D)"),
    "rolling_resistance": _shares(0.05, 0.08, 0.20, 0.30, "drum against road; surface, warmth; 0.007-0.017 (V)"),
    "torque_split_rear": Typical(0.02, 0.03, 0.05, 0.15, "clutches share the torque as they are driven (K)"),
    "torque_gain": _shares(0.01, 0.01, 0.05, 0.20, "axle efficiency 0.95-0.97 (V); a motor's gave 0.82 (D)"),
    "driveline_inertia": Typical(0.2, 0.5, 1.0, 1.5, "changes with the square of the gear (K)"),
    "steering_ratio": _shares(0.005, 0.01, 0.03, 0.10, "a turning plate; many ratios vary with the angle (K)"),
    "wheels.r_e_f": _RADIUS,
    "wheels.r_e_r": _RADIUS,
    "wheels.r_l_f": _LOADED,
    "wheels.r_l_r": _LOADED,
    "wheels.inertia_f": _INERTIA,
    "wheels.inertia_r": _INERTIA,
    "tyre.slip_slope_f": _SLOPE,
    "tyre.slip_slope_r": _SLOPE,
    "tyre.mu_max": _shares(0.05, 0.10, 0.15, 0.20, "tyre and asphalt, 0.8 to 1.2 (K)"),
}
"""By key of the vehicle file, for a value whose file gives no standard deviation of its own."""


def provenance_of(vehicle: Vehicle, path: str) -> Provenance:
    """Where the value of a key (`wheels.r_e_f`) comes from.

    A key that is set counts as from a data sheet unless the file says more, and as calibrated if it stands in `spread`:
    only drives of this car show how much they differ. One that is not set is a guess: the default of another car,
    whatever else was said of it.
    """
    said = vehicle.provenance.get(path)
    if path in vehicle.given:
        return said or Provenance("calibrated" if path in vehicle.spread else "data_sheet")
    return said if said is not None and said.source == "guess" else Provenance("guess")


def uncertainty(vehicle: Vehicle, path: str) -> float:
    """Standard deviation of the value of a key (`wheels.r_e_f`), in the key's unit.

    It is that of the value itself. What drives of the same car differ by is `Vehicle.spread`, and comes on top.

    Raises
    ------
    KeyError
        If there is no such key.
    """
    key, said = KEYS[path], provenance_of(vehicle, path)
    if said.sd is not None:
        return said.sd
    if path == "torque_split_rear" and path not in vehicle.given and vehicle.drivetrain != "awd":
        return 0.0  # one axle is driven: it follows the drivetrain
    typical: float = getattr(TYPICAL[path], said.source)
    return typical * abs(float(getattr(vehicle, key.name))) if isinstance(typical, Share) else typical
