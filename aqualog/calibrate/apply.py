"""Put the values of a calibration into a vehicle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from aqualog.calibrate.records import Parameter, TieRodFit
from aqualog.core.vehicle import Vehicle

__all__ = ["calibrated", "told"]

DIGITS = 7  # of a value in a file: more than any interval has
_KEYS = {
    "mass": "mass", "drag_area": "drag_area", "rolling_resistance": "rolling_resistance", "r_e_f": "wheels.r_e_f",
    "r_e_r": "wheels.r_e_r", "torque_gain": "torque_gain",
}  # fmt: skip


def told(parameters: Sequence[Parameter], vehicle: Vehicle) -> dict[str, tuple[float, Parameter]]:
    """Return the identified values by key of the vehicle file (`wheels.r_e_f`), each with the parameter it comes from.

    A ratio of radii without their size keeps the file's mean radius. The torque gain applies to the torques as they
    were read, which the file's own gain has already multiplied.
    """
    found = {_KEYS[p.name]: (p.value, p) for p in parameters if p.identified and p.name in _KEYS}
    if "torque_gain" in found:
        gain, p = found["torque_gain"]
        found["torque_gain"] = (gain * vehicle.torque_gain, p)
    ratio = next((p for p in parameters if p.name == "r_e_ratio" and p.identified), None)
    if ratio is not None and not {"wheels.r_e_f", "wheels.r_e_r"} & set(found):
        mean = 0.5 * (vehicle.r_e_f + vehicle.r_e_r)
        found["wheels.r_e_f"] = (2.0 * mean * ratio.value / (1.0 + ratio.value), ratio)
        found["wheels.r_e_r"] = (2.0 * mean / (1.0 + ratio.value), ratio)
    return {key: (float(f"{value:.{DIGITS}g}"), p) for key, (value, p) in found.items()}


def calibrated(
    vehicle: Vehicle,
    parameters: Sequence[Parameter],
    transfers: Mapping[str, TieRodFit] | None = None,
    spread: Mapping[str, float] | None = None,
) -> Vehicle:
    """Return the vehicle with the identified values; the others stay.

    Identified keys count as given. So do the loaded radii, once the effective ones are: forces depend on those that the
    calibration has used. A spread from drive to drive that the drives do not show stays that of the file.
    """
    values = told(parameters, vehicle)
    radii = {"wheels.r_l_f", "wheels.r_l_r"} if "wheels.r_e_f" in values else set()
    changed = {key.rsplit(".", 1)[-1]: value for key, (value, _) in values.items()}
    polynomials = {section: {**fit.coefficients, "sigma": (fit.sigma,)} for section, fit in (transfers or {}).items()}
    given = vehicle.given | set(values) | radii
    # the gain's is that of the torques as they were read, like the gain itself
    scale = {"torque_gain": vehicle.torque_gain}
    seen = {n: float(f"{sd * scale.get(n, 1.0):.{DIGITS}g}") for n, sd in (spread or {}).items()}
    both = {**vehicle.spread, **seen}
    return replace(vehicle, **changed, **polynomials, spread=both, given=frozenset(given))  # type: ignore[arg-type]
