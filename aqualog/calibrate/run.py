"""Calibrate a car from dry drives."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from aqualog.calibrate import derive, words
from aqualog.calibrate.balance import Sample, energy_offset, fit_balance, residual
from aqualog.calibrate.design import Drive, prepare
from aqualog.calibrate.radii import radius_parameters
from aqualog.calibrate.records import Calibration, DriveFit, Parameter
from aqualog.calibrate.spread import DRIVES_MIN, Spread, half_width, jackknife_of, one_more, spread_of
from aqualog.calibrate.tie_rod import transfers
from aqualog.core.errors import FitError
from aqualog.core.notation import WHEELS
from aqualog.core.records import FloatArray, Signals
from aqualog.core.vehicle import SPREAD, Vehicle
from aqualog.physics.load import G

__all__ = ["calibrate", "drive_fits", "mass_difference"]


def mass_difference(mass: float, sd: float, others: Sequence[float]) -> tuple[float, float, float]:
    """Return the difference between a drive's mass and the mean of others, with the 95 % interval.

    Parameters
    ----------
    mass, sd : float
        Of the drive, and its standard deviation within the drive. [kg]
    others : sequence of float
        Masses by the other drives, each from that drive alone. [kg]

    Returns
    -------
    difference, low, high : float
        NaN with fewer than two others. [kg]

    Two drives with the same load differ by driver, fuel, rig, driveline temperature and all else that the balance does
    not know. The scatter among the other drives, times sqrt(1 + 1/J), is the difference to expect of this drive without
    any load. Its own scatter counts where it is larger.
    """
    n = len(others)
    if n < 2:
        return math.nan, math.nan, math.nan
    spread = float(np.std(others, ddof=1))
    half = half_width(math.sqrt(max(spread, sd) ** 2 + spread**2 / n), n - 1.0)
    difference = mass - float(np.mean(others))
    return difference, difference - half, difference + half


def drive_fits(
    drives: Sequence[Drive], samples: Sequence[Sample], found: Mapping[str, float], vehicle: Vehicle
) -> list[DriveFit]:
    """Fit a mass, an offset and a drift for each drive; torque gain and drag area are those of all drives."""
    fixed = {"torque_gain": found["torque_gain"], "drag_area": found["drag_area"]}
    alone = [_alone(s, fixed) for s in samples]
    k, drag = found["torque_gain"] / found["mass"], found["drag_area"] / found["mass"]
    fits = []
    for j, (drive, sample) in enumerate(zip(drives, samples, strict=True)):
        w, offset = sample.windows, sample.offset
        others = [m for i, (m, _) in enumerate(alone) if i != j and math.isfinite(m)]
        rest = residual(sample, inverse_mass=k, drag=drag, level=0.0, drift=0.0)
        t = w.t - (offset.t if math.isfinite(offset.t) else float(w.t.mean()))
        drift, level = np.polyfit(t, rest, 1) if w.v.size > 2 else (0.0, float(rest.mean()))
        after: FloatArray = rest - level - drift * t
        before: FloatArray = (
            w.a_x - w.force / vehicle.mass + vehicle.drag_area / vehicle.mass * w.drag + G * vehicle.rolling_resistance
        )
        rms_before, rms_after = (math.sqrt(float((x * x).mean())) for x in (before, after))
        fits.append(
            DriveFit(
                drive.name, *alone[j], mass_difference(*alone[j], others), offset.value, offset.sd, float(drift),
                drive.torque_lag_s, drive.v_lag_s, float(drive.used.sum()) * drive.dt, drive.driven_s, drive.left_out,
                rms_before, rms_after, w.v, w.force, before, after,
            )
        )  # fmt: skip
    return fits


def _alone(sample: Sample, fixed: Mapping[str, float]) -> tuple[float, float]:
    """Return the mass by one drive and its standard deviation within the drive; NaN if the drive is too short."""

    def mass(part: Sequence[Sample]) -> dict[str, float]:
        return {"mass": fixed["torque_gain"] / fit_balance(part, fixed).inverse_mass}

    try:
        return mass([sample])["mass"], jackknife_of(mass, [sample]).sd["mass"]
    except FitError:
        return math.nan, math.nan


LEAST_WINDOWS = 10  # of 2 s in a drive that contributes to the balance
OFFSET_WIDE = 0.1  # [m/s^2] half of the resistance threshold: an offset known worse than that is of no use


def calibrate(
    drives: Sequence[Signals], names: Sequence[str], vehicle: Vehicle, fixed: Mapping[str, float] | None = None, *,
    accept: bool = False,
) -> Calibration:  # fmt: skip
    """Estimate the parameters of a car from dry drives.

    Parameters
    ----------
    drives : sequence of Signals
        Dry roads, the same car with the same load.
    names : sequence of str
        Of the drives, for messages.
    vehicle : Vehicle
        Radii, inertias, axle distances, air density; its mass and resistances serve for comparison only.
    fixed : mapping, optional
        Values known from elsewhere, by the names of `derive.FIXABLE`.
    accept : bool
        Whether estimates replace values that the vehicle file gives and their intervals exclude.

    Returns
    -------
    Calibration

    Raises
    ------
    SignalError, FitError, ConfigError
        If a signal is missing, too little is driven, or a fixed value is impossible.
    """
    fixed = dict(fixed or {})
    derive.check_fixed(fixed)
    all_drives = [prepare(s, vehicle, n) for s, n in zip(drives, names, strict=True)]
    usable = [d for d in all_drives if d.windows.v.size >= LEAST_WINDOWS]
    if not usable:
        raise FitError(
            "no straight, unbraked, dry driving", where=", ".join(names),
            expected="stretches above 20 km/h (a slalom for the tie rods needs straight driving beside it)",
            hint="what was left out: " + "; ".join(f"{d.name}: {words.left_out(d.left_out)}" for d in all_drives),
        )  # fmt: skip
    radii = radius_parameters(usable, vehicle)
    odd_radii = derive.contradicted(radii, vehicle)
    rolling = derive.calibrated(vehicle, radii if accept else derive.keeping(radii, {p.name for p in odd_radii}))
    usable = _by_lever(usable, vehicle, rolling)
    samples = [Sample(d.windows, energy_offset(d)) for d in usable]
    # without the driven axle the torques of the log need not be all of the drive
    lacking = next((d.no_balance for d in usable if d.no_balance), "")
    if lacking:
        balance = _no_balance(usable, samples, fixed, vehicle, lacking)
    else:
        balance = _balance(usable, samples, fixed, vehicle, rolling)
    free, odd = balance, derive.contradicted(balance.parameters, vehicle)
    if not accept:
        balance, odd = _beside_kept(balance, usable, samples, fixed, vehicle, rolling)
    odd += odd_radii
    fits, found, spread = balance.fits, balance.found, free.spread
    estimated = (*balance.parameters, *radii, *_offsets(fits, samples, balance.levels, fixed))
    parameters = estimated if accept else derive.keeping(estimated, {p.name for p in odd})
    car = derive.calibrated(vehicle, parameters)
    scale = car.torque_gain / vehicle.torque_gain
    rods, missing = ({}, ()) if lacking else transfers(all_drives, car, torque_scale=scale)
    skipped = [
        f"{d.name}: hardly a stretch for the balance of forces" for d in all_drives if d.windows.v.size < LEAST_WINDOWS
    ]
    shown = {p.name for p in parameters if p.name in SPREAD and p.identified and p.name not in fixed}
    differing = {n: sd for n, sd in one_more(spread, len(samples)).items() if n in shown and sd > 0.0}
    contradictions = words.contradictions(odd, free.found, accepted=accept)
    written = derive.identified_values(parameters, vehicle)
    notes = (*contradictions, *words.notes(fits, samples, found, fixed, written, by_drive=spread.by_drive), *skipped)
    return Calibration(
        vehicle.name, parameters, tuple(fits), fixed, words.cannot_tell(parameters, missing), notes, rods, differing
    )


def _by_lever(drives: Sequence[Drive], before: Vehicle, after: Vehicle) -> list[Drive]:
    """The drives with the forces that their torques make on the radii that are written (E24)."""
    ratio = {w: before.arm(w) / after.arm(w) for w in WHEELS}
    if set(ratio.values()) == {1.0}:
        return list(drives)
    out = []
    for d in drives:
        torques = {w: d.columns[f"torque_{w}"] for w in WHEELS if f"torque_{w}" in d.columns}
        size = {w: float(np.sqrt(np.nanmean(x * x))) for w, x in torques.items()}
        factor = sum(ratio[w] * x for w, x in size.items()) / max(sum(size.values()), 1e-9)
        force = factor * d.windows.force
        out.append(d._replace(windows=d.windows._replace(force=force), force=factor * d.force))
    return out


class _Balanced(NamedTuple):
    """What the balance of forces of the drives has shown; `levels` (J,) of a_x without force and drag [m/s²]."""

    parameters: Sequence[Parameter]
    fits: list[DriveFit]
    found: Mapping[str, float]
    spread: Spread
    levels: Sequence[float]


def _balance(
    usable: Sequence[Drive], samples: Sequence[Sample], fixed: Mapping[str, float], vehicle: Vehicle, rolling: Vehicle
) -> _Balanced:
    best = fit_balance(samples, fixed)
    spread = spread_of(partial(derive.estimates, fixed=fixed), samples, drag=best.drag, air_density=vehicle.air_density)
    found = derive.derived(best, fixed)
    fits = drive_fits(usable, samples, found, vehicle)
    rotating = derive.rotating_share(rolling, found["mass_per_gain"])
    parameters = derive.balance_parameters(found, spread, fixed, vehicle, samples, rotating)
    return _Balanced(parameters, fits, found, spread, best.levels.tolist())


def _beside_kept(
    free: _Balanced, usable: Sequence[Drive], samples: Sequence[Sample], fixed: Mapping[str, float], vehicle: Vehicle,
    rolling: Vehicle,
) -> tuple[_Balanced, list[Parameter]]:  # fmt: skip
    """The balance beside the values that the vehicle file keeps, and the estimates that contradict these.

    What goes into the file must fit what stays in it. A rolling resistance is found anew with a drag area that is kept.
    With another mass than that of the drives the balance fits nothing: the file keeps all of it.
    """
    balance, odd = free, derive.contradicted(free.parameters, vehicle)
    while (new := derive.contradicted(balance.parameters, vehicle)) and "mass" not in {p.name for p in odd}:
        fixed = {**fixed, **{p.name: p.file_value for p in new}}
        balance = _balance(usable, samples, fixed, vehicle, rolling)
        odd += [p for p in derive.contradicted(balance.parameters, vehicle) if p.name not in fixed]
    own = {p.name: p for p in odd}
    return balance._replace(parameters=[own.get(p.name, p) for p in balance.parameters]), odd


def _no_balance(
    usable: Sequence[Drive], samples: Sequence[Sample], fixed: Mapping[str, float], vehicle: Vehicle, why: str
) -> _Balanced:
    """Return the parameters without values, but for what is given, and of each drive what its torques do not enter."""
    none = np.empty(0)
    fits = [
        DriveFit(
            d.name, math.nan, math.nan, (math.nan,) * 3, s.offset.value, s.offset.sd, math.nan, d.torque_lag_s,
            d.v_lag_s, float(d.used.sum()) * d.dt, d.driven_s, d.left_out, math.nan, math.nan, none, none, none, none,
        )
        for d, s in zip(usable, samples, strict=True)
    ]  # fmt: skip
    parameters = derive.unbalanced_parameters(fixed, vehicle, why)
    spread = Spread({}, {}, by_drive=len(usable) >= DRIVES_MIN)
    return _Balanced(parameters, fits, dict(fixed), spread, [math.nan] * len(fits))


def _offsets(
    fits: Sequence[DriveFit], samples: Sequence[Sample], levels: Sequence[float], fixed: Mapping[str, float]
) -> list[Parameter]:
    """Estimate the accelerometer's offset in each drive; a given rolling resistance yields it without any height."""
    parameters = []
    for fit, sample, level in zip(fits, samples, levels, strict=True):
        name = "accelerometer_offset" if len(fits) == 1 else f"accelerometer_offset[{fit.name}]"
        value, half = fit.offset, 1.96 * fit.offset_sd
        remark = "from velocity and altitude" if sample.offset.has_height else "from velocity, the drive taken as level"
        if "rolling_resistance" in fixed and not sample.offset.has_height and math.isfinite(level):
            value, half = level + G * fixed["rolling_resistance"], math.nan
            remark = "from the rolling resistance given; a wind is in it"
            parameters.append(Parameter(name, value, (math.nan, math.nan), "m/s^2", identified=True, remark=remark))
            continue
        known = math.isfinite(half) and half < OFFSET_WIDE
        why = "" if known else "the drive is too short for its energy balance; 5 km without altitude are enough"
        parameters.append(
            Parameter(name, value, (value - half, value + half), "m/s^2", known, why, remark if known else "")
        )
    return parameters
