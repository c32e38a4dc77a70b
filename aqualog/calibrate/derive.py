"""Parameters of a car from the balance's coefficients and what is known from elsewhere, and a vehicle with them."""

from __future__ import annotations

import math
from collections.abc import Collection, Container, Mapping, Sequence
from dataclasses import replace

import numpy as np

from aqualog.calibrate import words
from aqualog.calibrate.balance import Balance, Sample, fit_balance
from aqualog.calibrate.records import Parameter, TieRodFit
from aqualog.calibrate.spread import Spread, half_width
from aqualog.core.errors import ConfigError
from aqualog.core.intervals import Z95
from aqualog.core.provenance import provenance_of, uncertainty
from aqualog.core.vehicle import KEYS, WATER, Provenance, Vehicle, WaterNumber
from aqualog.physics.load import G
from aqualog.physics.rolling import rolling_rise

__all__ = [
    "FIXABLE", "GAIN_SD", "balance_parameters", "calibrated", "check_fixed", "contradicted", "derived", "estimates",
    "identified_values", "keeping", "rotating_share", "unbalanced_parameters",
]  # fmt: skip

FIXABLE: Mapping[str, tuple[float, float]] = {
    **{n: (KEYS[n].low, KEYS[n].high) for n in ("mass", "rolling_resistance", "drag_area")},
    "torque_gain": (0.2, 5.0),
}
"""Values that can be given as known, with their bounds."""

GAIN_SD = 0.02  # [-] of a torque signal whose scale nobody has checked (K; axle efficiency alone is 0.95-0.97, V)
RISE_SD = 3.0**-0.5
"""[-] rms rise of a tyre's rolling resistance with speed over that of MF6.1: evenly between none and all of it (K)."""
WIDE: Mapping[str, float] = {"mass": 0.10, "torque_gain": 0.10, "mass_per_gain": 0.10, "drag_area": 0.5}
"""Half of an interval over its value beyond which a parameter is not identified."""
WIDE_ROLLING = (
    0.005  # [-] the same for r_w, not over its value: else only drives that show too much of it would tell it
)

_UNITS = {"mass_per_gain": "kg", "mass": "kg", "torque_gain": "-", "drag_area": "m^2", "rolling_resistance": "-"}


def check_fixed(fixed: Mapping[str, float]) -> None:
    """Refuse unknown names and impossible values.

    Raises
    ------
    ConfigError
    """
    for name, value in fixed.items():
        if name not in FIXABLE:
            raise ConfigError(f'fix "{name}" is not known', expected=", ".join(FIXABLE))
        low, high = FIXABLE[name]
        if not low <= value <= high:
            raise ConfigError(f"fix {name}={value:g}", expected=f"a value between {low:g} and {high:g}")


def derived(balance: Balance, fixed: Mapping[str, float]) -> dict[str, float]:
    """Parameters by name.

    `mass_per_gain` is what the balance identifies. A given mass or torque gain splits it; without either the gain is 1.
    """
    if "mass" in fixed:
        mass, gain = fixed["mass"], fixed.get("torque_gain", fixed["mass"] * balance.inverse_mass)
    else:
        gain = fixed.get("torque_gain", 1.0)
        mass = gain / balance.inverse_mass
    return {
        "mass_per_gain": 1.0 / balance.inverse_mass,
        "mass": mass,
        "torque_gain": gain,
        "drag_area": balance.drag * mass,
        "rolling_resistance": balance.rolling,
    } | dict(fixed)


def estimates(samples: Sequence[Sample], fixed: Mapping[str, float]) -> dict[str, float]:
    """`derived` from windows."""
    return derived(fit_balance(samples, fixed), fixed)


def _model_terms(found: Mapping[str, float], samples: Sequence[Sample], fixed: Mapping[str, float]) -> dict[str, float]:
    """What a rolling resistance that rises with speed does to drag area and rolling resistance: standard deviations.

    The balance has a constant part and one that goes with v^2, and takes such a rise for drag. It is the car's own, so
    that more drives do not reduce it. The rolling resistance is that at the speeds driven.
    """
    rises = [rolling_rise(s.windows.v) for s in samples]
    mean = float(np.concatenate(rises).mean())
    moved = [
        s._replace(windows=s.windows._replace(a_x=s.windows.a_x - G * (rise - mean)))
        for s, rise in zip(samples, rises, strict=True)
    ]
    other = estimates(moved, fixed)
    return {n: RISE_SD * abs(other[n] - found[n]) for n in ("drag_area", "rolling_resistance")}


def balance_parameters(
    found: Mapping[str, float], spread: Spread, fixed: Mapping[str, float], vehicle: Vehicle, samples: Sequence[Sample],
    rotating: float = 0.0,
) -> list[Parameter]:  # fmt: skip
    """Return the parameters of the balance with intervals, and why one is not identified.

    Without a given mass or torque gain, the gain's 2 % enter the intervals of mass and drag area. All drives share the
    one signal, so more drives do not reduce this part. Nor do they that of inertias and radii, see `rotating_share`,
    and that of a rolling resistance that rises with speed, see `_model_terms`.
    """
    of_model = _model_terms(found, samples, fixed)
    has_scale = "mass" in fixed or "torque_gain" in fixed
    parameters: list[Parameter] = []
    for name, unit in _UNITS.items():
        value, file_value = found[name], _file_value(name, vehicle)
        if name in fixed:
            parameters.append(_given(name, value, file_value))
            continue
        half = half_width(spread.sd[name], spread.dof[name])
        shared = rotating * value if name in ("mass_per_gain", "mass", "torque_gain") else 0.0
        half = math.hypot(half, 1.96 * shared, 1.96 * of_model.get(name, 0.0))
        if name in ("mass", "drag_area") and not has_scale:
            half = math.hypot(half, 1.96 * GAIN_SD * value)
        limit = WIDE_ROLLING if name == "rolling_resistance" else WIDE[name] * value
        why = words.why_not(name, value, half, limit, samples, has_scale=has_scale)
        if name == "rolling_resistance" and not why and parameters and not parameters[0].identified:
            why = words.NO_SLOPE  # without a slope the balance has no level either
        if name in KEYS and not why and not KEYS[name].low <= value <= KEYS[name].high:
            why = words.outside(KEYS[name])
        remark = "" if why else words.remark(name, has_scale=has_scale, by_drive=spread.by_drive, samples=samples)
        # without a scale the gain is an assumption, not an estimate
        ci = (math.nan, math.nan) if name == "torque_gain" and not has_scale else (value - half, value + half)
        parameters.append(Parameter(name, value, ci, unit, not why, why, remark, file_value, shared=shared))
    return parameters


def rotating_share(car: Vehicle, mass: float) -> float:
    """Return the standard deviation of the mass from what is not known of the wheels' inertias and radii, over it. [-]

    The balance's force is (T - I dω/dt) / r: 2 I / r² of an axle is taken for mass, and a radius scales all of it.
    """
    share = {"f": 1.0 - car.torque_split_rear, "r": car.torque_split_rear}
    radius = sum(x * uncertainty(car, f"wheels.r_e_{a}") / car.r_e(f"{a}l") for a, x in share.items())
    spun = (2.0 * uncertainty(car, f"wheels.inertia_{a}") / car.r_e(f"{a}l") ** 2 for a in share)
    return math.hypot(radius, *(x / mass for x in spun))


def unbalanced_parameters(fixed: Mapping[str, float], vehicle: Vehicle, why: str) -> list[Parameter]:
    """Return the parameters of a balance that the drives do not allow, with the reason; those given stay."""
    unknown = (math.nan, math.nan)
    return [
        _given(n, fixed[n], _file_value(n, vehicle)) if n in fixed
        else Parameter(n, math.nan, unknown, unit, identified=False, why_not=why, file_value=_file_value(n, vehicle))
        for n, unit in _UNITS.items()
    ]  # fmt: skip


def _file_value(name: str, vehicle: Vehicle) -> float:
    """Return the vehicle file's value. A gain is that of the torques as they were read: the file's is in them."""
    return float(getattr(vehicle, name)) if name in KEYS and name != "torque_gain" else math.nan


def _given(name: str, value: float, file_value: float) -> Parameter:
    return Parameter(name, value, (value, value), _UNITS[name], identified=True, remark="given", file_value=file_value)


DIGITS = 7  # of a value in a file: more than any interval has
_KEYS = {
    "mass": "mass", "drag_area": "drag_area", "rolling_resistance": "rolling_resistance", "r_e_f": "wheels.r_e_f",
    "r_e_r": "wheels.r_e_r", "torque_gain": "torque_gain",
}  # fmt: skip


def contradicted(parameters: Sequence[Parameter], vehicle: Vehicle) -> list[Parameter]:
    """Return the estimates that are farther from what the vehicle file knows than both are unsure of: 95 %.

    Its guesses are no knowledge. The torque gain does not count: it belongs to the torques as they are read. What
    `--fix` gives is no estimate.
    """
    radii = {"wheels.r_e_f", "wheels.r_e_r"}
    needs = {**{n: {key} for n, key in _KEYS.items() if n != "torque_gain"}, "r_e_ratio": radii}
    known = {key for key in vehicle.given & KEYS.keys() if provenance_of(vehicle, key).source != "guess"}
    return [
        p
        for p in parameters
        if p.identified and (own := needs.get(p.name, {""})) <= known and p.ci95[0] < p.ci95[1]
        and not _is_alike(p, [_relative(vehicle, key) for key in own])
    ]  # fmt: skip


def _relative(vehicle: Vehicle, key: str) -> float:
    return uncertainty(vehicle, key) / (abs(float(getattr(vehicle, KEYS[key].name))) or 1.0)


def _is_alike(p: Parameter, relative: Sequence[float]) -> bool:
    """Whether an estimate is the file's value, of which each part is known to a `relative` standard deviation."""
    of_file = Z95 * math.hypot(*relative) * abs(p.file_value)
    own = p.value - p.ci95[0] if p.file_value < p.value else p.ci95[1] - p.value
    return abs(p.value - p.file_value) <= math.hypot(own, of_file)


def keeping(parameters: Sequence[Parameter], odd: Container[str]) -> tuple[Parameter, ...]:
    """Return the parameters, marked as kept those of these names, which contradict the vehicle file.

    With a mass that is kept all of the balance is: drag area and rolling resistance are those of the drives' mass.
    """
    own = {"mass", "drag_area", "rolling_resistance"} if "mass" in odd else set()
    along = {p.name for p in parameters if p.name in own and p.identified and p.remark != "given"}
    return tuple(
        replace(p, kept=True, remark=words.kept(p, alone=p.name in odd)) if p.name in odd or p.name in along else p
        for p in parameters
    )


def identified_values(parameters: Sequence[Parameter], vehicle: Vehicle) -> dict[str, tuple[float, Parameter]]:
    """Return the identified values by key of the vehicle file (`wheels.r_e_f`), each with the parameter it comes from.

    A value of the file that is kept is not among them. A ratio of radii without their size keeps the file's mean
    radius. The torque gain applies to the torques as they were read, which the file's own gain has already multiplied.
    """
    own = [p for p in parameters if p.identified and not p.kept]
    found = {_KEYS[p.name]: (p.value, p) for p in own if p.name in _KEYS}
    if "torque_gain" in found:
        gain, p = found["torque_gain"]
        found["torque_gain"] = (gain * vehicle.torque_gain, p)
    ratio = next((p for p in own if p.name == "r_e_ratio"), None)
    sizes = [p for p in parameters if p.name in ("r_e_f", "r_e_r") and p.identified]
    if ratio is not None and not sizes:
        mean = 0.5 * (vehicle.r_e_f + vehicle.r_e_r)
        found["wheels.r_e_f"] = (2.0 * mean * ratio.value / (1.0 + ratio.value), ratio)
        found["wheels.r_e_r"] = (2.0 * mean / (1.0 + ratio.value), ratio)
    return {key: (float(f"{value:.{DIGITS}g}"), p) for key, (value, p) in found.items()}


def _sd(key: str, value: float, p: Parameter, vehicle: Vehicle) -> float | None:
    """Return the standard deviation of a calibrated value, in the key's unit, so that 1.96 of it is the interval.

    A radius by the ratio alone is as sure as ratio and the file's mean radius, whose error both axles share. Errors of
    inertias and radii are left out: those keys have deviations of their own, which the same drives would count twice.
    """
    sd = 0.5 * (p.ci95[1] - p.ci95[0]) / 1.96
    if not math.isfinite(sd) or sd <= 0.0:
        return None
    if p.name == "r_e_ratio":
        mean = 0.5 * sum(uncertainty(vehicle, f"wheels.r_e_{axle}") for axle in "fr")
        share = 1.0 / (1.0 + p.value) / (p.value if key == "wheels.r_e_f" else 1.0)  # d ln r / d ratio
        sd = math.hypot(share * value * sd, mean)
    elif p.value:  # of the gain that the file has already
        sd = math.sqrt(max(sd**2 - p.shared**2, 0.0)) * abs(value / p.value)
    return float(f"{sd:.3g}")


def _provenances(
    vehicle: Vehicle, values: Mapping[str, tuple[float, Parameter]], given: frozenset[str], kept: Collection[str]
) -> dict[str, Provenance]:
    """Return where the values of a calibrated vehicle come from; those of keys that are kept, from where they did.

    What was fixed is measured, if the file does not say more of the same value. Without a given scale the mass rests on
    the torques: their gain stays a guess, but one that this mass binds.
    """
    found = {**{key: provenance_of(vehicle, key) for key in kept}, **vehicle.provenance}
    for key, (value, p) in values.items():
        if p.remark != "given":
            found[key] = Provenance("calibrated", _sd(key, value, p, vehicle))
        elif key not in found or not math.isclose(value, getattr(vehicle, KEYS[key].name), rel_tol=1e-6):
            found[key] = Provenance("measured")
    is_bound = "mass" in values and values["mass"][1].remark != "given" and "torque_gain" not in values
    if is_bound and provenance_of(vehicle, "torque_gain") == Provenance("guess"):
        found["torque_gain"] = Provenance("guess", float(f"{GAIN_SD * vehicle.torque_gain:.3g}"))
    unsaid = given - vehicle.given - set(found)
    return {**found, **dict.fromkeys(sorted(unsaid), Provenance("guess"))}


def _water_numbers(parameters: Sequence[Parameter]) -> dict[str, WaterNumber]:
    """Numbers of the law of water that passes have identified; 1.96 of the deviation is half of the interval."""
    own = (p for p in parameters if p.name in WATER and p.identified and not p.kept)
    return {p.name: WaterNumber(_rounded(p.value), _rounded((p.ci95[1] - p.ci95[0]) / 3.92)) for p in own}


def _rounded(x: float) -> float:
    return float(f"{x:.{DIGITS}g}")


def calibrated(
    vehicle: Vehicle,
    parameters: Sequence[Parameter],
    transfers: Mapping[str, TieRodFit] | None = None,
    spread: Mapping[str, float] | None = None,
) -> Vehicle:
    """Return the vehicle with the identified values; the others stay.

    Identified keys count as given. So do the loaded radii, once the effective ones are: forces depend on those that the
    calibration has used. A spread from drive to drive that the drives do not show stays that of the file, and so does
    the provenance of what is not estimated.
    """
    values = identified_values(parameters, vehicle)
    radii = {"wheels.r_l_f", "wheels.r_l_r"} if "wheels.r_e_f" in values else set()
    changed = {key.rsplit(".", 1)[-1]: value for key, (value, _) in values.items()}
    polynomials = {section: {**fit.coefficients, "sigma": (fit.sigma,)} for section, fit in (transfers or {}).items()}
    given = vehicle.given | set(values) | radii
    # the gain's is that of the torques as they were read, like the gain itself
    scale = {"torque_gain": vehicle.torque_gain}
    seen = {n: float(f"{sd * scale.get(n, 1.0):.{DIGITS}g}") for n, sd in (spread or {}).items()}
    kept = [_KEYS[p.name] for p in parameters if p.kept and p.name in _KEYS]
    tables = {"spread": {**vehicle.spread, **seen}, "provenance": _provenances(vehicle, values, given, kept)}
    water = {**vehicle.water, **_water_numbers(parameters)}
    return replace(vehicle, **changed, **polynomials, **tables, water=water, given=given)  # type: ignore[arg-type]
