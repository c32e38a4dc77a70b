"""How far the values of a vehicle file may be off themselves, expressed in the parameters of effects.

The key stands in the effect's row: `DayToDay.key` of the whole car, `DriveSearch.unset` of an axle.
"""

from __future__ import annotations

from aqualog.core.notation import AXLES
from aqualog.core.provenance import provenance_of, uncertainty
from aqualog.core.vehicle import KEYS, Vehicle
from aqualog.diagnose.hypotheses import Hypothesis

__all__ = ["calibrated_enough", "deviation", "key_of", "not_calibrated"]

_MATTERS = ("mass", "torque_gain", "wheels.r_e_f", "wheels.r_e_r")


def key_of(h: Hypothesis, name: str) -> str:
    """The key of the vehicle file (`wheels.r_e_f`) whose own value a parameter changes; empty without one.

    Each key counts at one place: that of the whole car there, that of an axle at the axle.
    """
    p, unset = h.parameter(name), h.effect.drive.unset
    if h.where is None and p.day_to_day is not None:
        return p.day_to_day.key
    return unset[0] + h.where if unset is not None and h.where in AXLES and p is h.effect.parameters[0] else ""


def deviation(h: Hypothesis, name: str, vehicle: Vehicle) -> float:
    """Standard deviation of the file's own value, in the unit of an effect's parameter; 0 where no key holds it.

    A share of the value where the parameter multiplies it (`torque_gain`, `tyre_radius`), else in the key's unit.
    Differences between drives (`day_to_day`) are not in it, and independent of it.
    """
    path = key_of(h, name)
    if not path:
        return 0.0
    p, sd = h.parameter(name), uncertainty(vehicle, path)
    is_sum = p.neutral == 0.0 and p.unit == KEYS[path].unit
    return sd if is_sum else sd / float(getattr(vehicle, KEYS[path].name))


def calibrated_enough(vehicle: Vehicle) -> tuple[str, ...]:
    """The keys that matter for a diagnosis and are guesses: mass, torque gain and radii; empty if it is enough.

    A mass that is calibrated binds the torque gain: the drives have shown their ratio.
    """
    source = {path: provenance_of(vehicle, path).source for path in _MATTERS}
    bound = {"torque_gain"} if source["mass"] == "calibrated" else set()
    return tuple(path for path in _MATTERS if source[path] == "guess" and path not in bound)


def not_calibrated(vehicle: Vehicle) -> str:
    """The sentence for a file that is not calibrated enough, and what to do; empty if it is."""
    keys = calibrated_enough(vehicle)
    if not keys:
        return ""
    listed = " and ".join(filter(None, (", ".join(keys[:-1]), keys[-1])))
    known = (
        "" if provenance_of(vehicle, "mass").source == "measured" else ", best with the weighed mass (--fix mass=...)"
    )
    return (
        f"This vehicle file was not calibrated: {listed} {'is a guess' if len(keys) == 1 else 'are guesses'}; run "
        f"`aqualog calibrate` on four or more dry drives{known}."
    )
