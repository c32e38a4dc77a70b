"""Estimate what each drive shows by itself."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from aqualog.calibrate.balance import Sample, fit_balance, residual
from aqualog.calibrate.compare import mass_difference
from aqualog.calibrate.design import Drive
from aqualog.calibrate.records import DriveFit
from aqualog.calibrate.spread import jackknife_of
from aqualog.core.errors import FitError
from aqualog.core.records import FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.physics.load import G

__all__ = ["drive_fits"]


def drive_fits(
    drives: Sequence[Drive], samples: Sequence[Sample], found: Mapping[str, float], vehicle: Vehicle
) -> list[DriveFit]:
    """Fit a mass, an offset and a drift for each drive; torque gain and drag area are those of all drives."""
    fixed = {"torque_gain": found["torque_gain"], "drag_area": found["drag_area"]}
    alone = [_alone(s, fixed) for s in samples]
    known = [m for m, _ in alone if math.isfinite(m)]
    fits = []
    for j, (drive, sample) in enumerate(zip(drives, samples, strict=True)):
        mass, sd = alone[j]
        others = [m for k, (m, _) in enumerate(alone) if k != j and math.isfinite(m)] if known else []
        fits.append(_fit(drive, sample, mass, sd, others, found, vehicle))
    return fits


def _alone(sample: Sample, fixed: Mapping[str, float]) -> tuple[float, float]:
    """Return the mass by one drive and its standard deviation within the drive; NaN if the drive is too short."""

    def mass(part: Sample) -> dict[str, float]:
        return {"mass": fixed["torque_gain"] / fit_balance([part], fixed).inverse_mass}

    try:
        best = mass(sample)["mass"]
        return best, jackknife_of(lambda s: mass(s[0]), [sample]).sd["mass"]
    except FitError:
        return math.nan, math.nan


def _fit(
    drive: Drive,
    sample: Sample,
    mass: float,
    sd: float,
    others: Sequence[float],
    found: Mapping[str, float],
    vehicle: Vehicle,
) -> DriveFit:
    w = sample.windows
    k, drag = found["torque_gain"] / found["mass"], found["drag_area"] / found["mass"]
    rest = residual(sample, inverse_mass=k, drag=drag, level=0.0, drift=0.0)
    t = w.t - (sample.offset.t if math.isfinite(sample.offset.t) else float(w.t.mean()))
    drift, level = np.polyfit(t, rest, 1) if w.v.size > 2 else (0.0, float(rest.mean()))
    after: FloatArray = rest - level - drift * t
    before: FloatArray = (
        w.a_x - w.force / vehicle.mass + vehicle.drag_area / vehicle.mass * w.drag + G * vehicle.rolling_resistance
    )
    offset = sample.offset.value
    return DriveFit(
        drive.name, mass, sd, mass_difference(mass, sd, others), offset, sample.offset.sd, float(drift),
        drive.torque_lag_s, drive.v_lag_s, float(drive.used.sum()) * drive.dt, drive.driven_s, drive.left_out,
        _rms(before), _rms(after), w.v, w.force, before, after,
    )  # fmt: skip


def _rms(x: FloatArray) -> float:
    return math.sqrt(float((x * x).mean()))
