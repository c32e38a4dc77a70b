"""How far a vehicle file's values may be off, and differ from drive to drive, in the parameters of effects; the key
stands in the effect's row (`DayToDay.key` of the whole car, `DriveSearch.axle_key` of an axle)."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

from aqualog.core.notation import AXLES
from aqualog.core.provenance import provenance_of, uncertainty
from aqualog.core.vehicle import KEYS, Vehicle
from aqualog.diagnose.hypotheses import Hypothesis
from aqualog.diagnose.words import change_words, listed
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Model, Term

__all__ = [
    "as_value", "calibrated_enough", "day_to_day", "deviation", "in_words", "key_of", "not_calibrated", "with_known",
]  # fmt: skip

TORQUE_BY_DRIVE = 0.01  # relative, where a file gives no spread: a bus estimates its torque to 1 to 3 % (K)
_MATTERS = ("mass", "torque_gain", "wheels.r_e_f", "wheels.r_e_r")


def key_of(h: Hypothesis, name: str) -> str:
    """The key of the vehicle file (`wheels.r_e_f`) whose own value a parameter changes, that of the whole car there,
    that of an axle at the axle; empty without one."""
    p, start = h.parameter(name), h.effect.drive.axle_key
    if h.where is None and p.day_to_day is not None:
        return p.day_to_day.key
    return start + h.where if start and h.where in AXLES and p is h.effect.parameters[0] else ""


def deviation(h: Hypothesis, name: str, vehicle: Vehicle) -> float:
    """Standard deviation of the file's own value, of a key, of a known fault, or of both; 0 without, and of one drive
    alone. A share of the value where the parameter multiplies it (`torque_gain`, `tyre_radius`), else in the key's
    unit. Differences between drives (`day_to_day`) are independent of it."""
    if h.drive:
        return 0.0
    path, known = key_of(h, name), vehicle.known.get(h.key)
    fault = known.spread if known is not None and name == next(iter(known.values)) else 0.0
    if not path:
        return fault
    p, sd = h.parameter(name), own_sd(vehicle, path)
    is_sum = p.neutral == 0.0 and p.unit == KEYS[path].unit
    return math.hypot(fault, sd if is_sum else sd / float(getattr(vehicle, KEYS[path].name)))


def own_sd(vehicle: Vehicle, path: str) -> float:
    """Standard deviation of the file's own value of a key, in the key's unit; 0 for a mass and a gain that are bound:
    once drives have calibrated one of them, their ratio is known. A mass from a data sheet was not there when a gain
    was calibrated, which would have made it calibrated, or measured. A file that says of no value where it comes from
    is taken at its word; only axles whose key it does not set are those of another car."""
    if not vehicle.provenance and (path in vehicle.given or not path.endswith(("_f", "_r"))):
        return 0.0
    mass, gain = (provenance_of(vehicle, p).source for p in ("mass", "torque_gain"))
    is_bound = mass == "calibrated" or (gain == "calibrated" and mass == "measured")
    return 0.0 if is_bound and path in ("mass", "torque_gain") else uncertainty(vehicle, path)


def in_words(terms: Sequence[Term], asked: Sequence[Hypothesis], before: Model, vehicle: Vehicle) -> list[str]:
    """Values that a model has otherwise than before, each in standard deviations of the file's value."""
    known = {(t.effect.name, t.where): t.values for t in before.terms}
    asked_at = {(h.effect.name, h.where): h for h in asked if not h.drive}

    def said(t: Term) -> str:
        h = asked_at.get((t.effect.name, t.where))
        sds = {} if h is None else {n: deviation(h, n, vehicle) for n in t.values}
        return change_words(t, known.get((t.effect.name, t.where), {}), sds)

    return [*map(said, terms)]


def with_known(model: Model, vehicle: Vehicle) -> Model:
    """The model with the known faults of the car on top, unless it has them itself."""
    for key, fault in vehicle.known.items():
        term = Term(EFFECTS[key.partition("@")[0]], fault.values, key.partition("@")[2] or None)
        if all((t.effect, t.place) != (term.effect, term.place) for t in model.terms):
            model = model.with_term(term)
    return model


def calibrated_enough(vehicle: Vehicle) -> tuple[str, ...]:
    """The keys that matter for a diagnosis and are guesses: mass, torque gain, which a calibrated mass binds, and
    radii."""
    bound = {"torque_gain"} if provenance_of(vehicle, "mass").source == "calibrated" else set()
    return tuple(p for p in _MATTERS if provenance_of(vehicle, p).source == "guess" and p not in bound)


def not_calibrated(vehicle: Vehicle, channels: Collection[str]) -> str:
    """The sentence for a file that is not calibrated enough for these channels, and what to do; empty if it is. Without
    a torque neither mass nor torque gain matter."""
    needs = {"mass": "force_balance", "torque_gain": "force_balance"}
    keys = [k for k in calibrated_enough(vehicle) if needs.get(k, "slip") in " ".join(channels)]
    if not keys:
        return ""
    is_weighed = provenance_of(vehicle, "mass").source == "measured"
    known = "" if is_weighed else ", best with the weighed mass (--fix mass=...)"
    doubt = f"{listed(keys)} {'is a guess' if len(keys) == 1 else 'are guesses'}"
    if not vehicle.provenance:
        doubt = "it does not say where its values come from, so they count as exact"
    return f"This vehicle file was not calibrated: {doubt}; run `aqualog calibrate` on four or more dry drives{known}."


def day_to_day(h: Hypothesis, name: str, vehicle: Vehicle) -> float:
    """Standard deviation of a parameter from drive to drive, in the effect's unit; 0 where the file gives no value, and
    at a single axle. Each key of the file counts here once. A load of one of several drives looks like that drive's own
    error of torque."""
    row = h.parameter(name).day_to_day
    if row is None or h.where is not None:
        return 0.0
    if h.drive and row.kind == "inertia":
        share = vehicle.spread.get("torque_gain", TORQUE_BY_DRIVE * vehicle.torque_gain) / vehicle.torque_gain
        return row.value(math.hypot(vehicle.spread.get("mass", 0.0) / vehicle.mass, share), vehicle, h.where, 0.0)
    sd = vehicle.spread.get(row.key, 0.0)
    # the effect's gain is on top of the file's
    return sd / vehicle.torque_gain if row.key == "torque_gain" else sd


def as_value(h: Hypothesis, name: str, vehicle: Vehicle, speed: float) -> float:
    """Day-to-day differences of its kind and errors of the file, as a standard deviation of one of its parameters, in
    its unit; `speed`: at which its drag counts [m/s]."""
    row = h.parameter(name).day_to_day
    own = deviation(h, name, vehicle)
    if row is None:
        return own

    def off(key: str) -> float:
        return math.hypot(vehicle.spread.get(key, 0.0), 0.0 if h.drive else own_sd(vehicle, key))

    sd = {
        "inertia": math.hypot(off("mass") / vehicle.mass, off("torque_gain") / vehicle.torque_gain),
        "drag": off("drag_area"),
        "rolling": off("rolling_resistance"),
    }[row.kind]
    alike = row.value(sd, vehicle, h.where, speed)
    is_in = h.where is None and row.key  # the file's own value is one of those above
    return max(alike, own) if is_in else math.hypot(alike, own)
