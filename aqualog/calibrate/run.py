"""Calibrate a car from dry drives."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial

from aqualog.calibrate import words
from aqualog.calibrate.apply import calibrated
from aqualog.calibrate.balance import Sample, fit_balance
from aqualog.calibrate.derive import balance_parameters, check_fixed, derived, estimates
from aqualog.calibrate.design import prepare
from aqualog.calibrate.fits import drive_fits
from aqualog.calibrate.offset import energy_offset
from aqualog.calibrate.radii import radius_parameters
from aqualog.calibrate.records import Calibration, DriveFit, Parameter
from aqualog.calibrate.spread import one_more, spread_of
from aqualog.calibrate.tie_rod import transfers
from aqualog.core.errors import FitError
from aqualog.core.records import Signals
from aqualog.core.vehicle import SPREAD, Vehicle
from aqualog.physics.load import G

__all__ = ["calibrate"]

LEAST_WINDOWS = 10  # of 2 s in a drive that contributes to the balance
OFFSET_WIDE = 0.1  # [m/s^2] half of the resistance threshold: an offset known worse than that is of no use


def calibrate(
    drives: Sequence[Signals], names: Sequence[str], vehicle: Vehicle, fixed: Mapping[str, float] | None = None
) -> Calibration:
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

    Returns
    -------
    Calibration

    Raises
    ------
    SignalError, FitError, ConfigError
        If a signal is missing, too little is driven, or a fixed value is impossible.
    """
    fixed = dict(fixed or {})
    check_fixed(fixed)
    all_drives = [prepare(s, vehicle, n) for s, n in zip(drives, names, strict=True)]
    usable = [d for d in all_drives if d.windows.v.size >= LEAST_WINDOWS]
    if not usable:
        raise FitError(
            "no straight, unbraked, dry driving", where=", ".join(names),
            expected="stretches above 20 km/h (a slalom for the tie rods needs straight driving beside it)",
            hint="what was left out: " + "; ".join(f"{d.name}: {words.left_out(d.left_out)}" for d in all_drives),
        )  # fmt: skip
    samples = [Sample(d.windows, energy_offset(d)) for d in usable]
    best = fit_balance(samples, fixed)
    spread = spread_of(partial(estimates, fixed=fixed), samples, drag=best.drag, air_density=vehicle.air_density)
    found = derived(best, fixed)
    fits = drive_fits(usable, samples, found, vehicle)
    parameters = (
        *balance_parameters(found, spread, fixed, vehicle, samples),
        *radius_parameters(usable, vehicle),
        *_offsets(fits, samples, best.levels.tolist(), fixed),
    )
    car = calibrated(vehicle, parameters)
    rods, missing = transfers(all_drives, car, torque_scale=car.torque_gain / vehicle.torque_gain)
    skipped = [
        f"{d.name}: hardly a stretch for the balance of forces" for d in all_drives if d.windows.v.size < LEAST_WINDOWS
    ]
    told = {p.name for p in parameters if p.identified and p.name not in fixed}
    differing = {n: sd for n, sd in one_more(spread, len(samples)).items() if n in SPREAD and n in told and sd > 0.0}
    notes = (*words.notes(fits, samples, found, fixed, by_drive=spread.by_drive), *skipped)
    return Calibration(
        vehicle.name, parameters, tuple(fits), fixed, words.cannot_tell(parameters, missing), notes, rods, differing
    )


def _offsets(
    fits: Sequence[DriveFit], samples: Sequence[Sample], levels: Sequence[float], fixed: Mapping[str, float]
) -> list[Parameter]:
    """Estimate the accelerometer's offset in each drive; a given rolling resistance yields it without any height."""
    parameters = []
    for fit, sample, level in zip(fits, samples, levels, strict=True):
        name = "accelerometer_offset" if len(fits) == 1 else f"accelerometer_offset[{fit.name}]"
        value, half = fit.offset, 1.96 * fit.offset_sd
        remark = "from velocity and altitude" if sample.offset.has_height else "from velocity, the drive taken as level"
        if "rolling_resistance" in fixed and not sample.offset.has_height:
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
