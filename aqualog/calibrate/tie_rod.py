"""Identify the transfer from wheel forces to tie rods from a dry drive."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aqualog.calibrate.design import BESIDE_S, BRAKE_PRESSURE, Drive, widened
from aqualog.calibrate.records import TieRodFit
from aqualog.core.errors import FitError
from aqualog.core.intervals import jackknife_sd, student_quantile
from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.features.stream import INPUTS, FeatureStream
from aqualog.physics.load import G

__all__ = ["fit_tie_rod", "transfers"]

A_Y_MAX = 4.0  # [m/s^2] beyond, tyres and loads leave what a polynomial of low order follows
V_MIN = 8.0  # [m/s] as the detector
A_BRAKED = -2.0  # [m/s^2] neither engine nor resistance decelerates a car more
LIFTED = -0.06  # of the weight: more than an engine's drag
LEAST_S = 20.0  # [s]
BLOCK_S = 8.0  # [s] about two periods of a slalom
F_Y_RANGE_MIN = 300.0  # [N] standard deviation below which a drive has not steered
F_X_RANGE_MIN = 60.0  # [N]


def transfers(
    drives: Sequence[Drive], vehicle: Vehicle, *, torque_scale: float = 1.0
) -> tuple[dict[str, TieRodFit], tuple[str, ...]]:
    """Fit the polynomials of tie rods and steering torque, each from its most informative drive; else return why not.

    The forces are those of the detectors' own model (`features.steering_model`), probed with unit polynomials, so that
    identification and detection use the same model. The vehicle's mass scales them: it must be the one that goes with
    the result. So does `torque_scale`, the factor on torques that are read from now on. [-]
    """
    found: dict[str, TieRodFit] = {}
    reasons = []
    for section, signals in (("tie_rod", ("tie_rod_fl", "tie_rod_fr")), ("steering_torque", ("steering_torque",))):
        fits = []
        for d in drives:
            if not {*signals, "a_y", "yaw_rate"} <= set(d.columns):
                continue
            F_y, measured = _probed(d, vehicle, section, {"c_y": (1.0,)}, torque_scale)
            F_x, _ = _probed(d, vehicle, section, {"c_x": (1.0,)}, torque_scale)
            # left and right turn the steering alike, so that even powers of the axle's force give no torque
            degree = 2 if section == "tie_rod" else 1
            try:
                fits.append(fit_tie_rod(F_y, F_x, measured, dt=d.dt, used=_telling(d, vehicle), degree=degree))
            except FitError as error:
                reasons.append(f"{section} polynomial ({d.name}): {error.line()}")
        if fits:
            found[section] = max(fits, key=lambda f: f.seconds * f.explained)
    causes = tuple(r for r in reasons if r.split(" ", 1)[0] not in found)
    return found, causes


def _telling(drive: Drive, vehicle: Vehicle) -> BoolArray:
    """Flag dry, moving, unbraked samples in the polynomial's range, as the detector: brakes act on another lever."""
    columns, f = drive.columns, drive.features
    torque = np.sum([columns[f"torque_{w}"] for w in WHEELS if f"torque_{w}" in columns], axis=0)
    with np.errstate(invalid="ignore"):
        if "brake_pressure" in columns:
            braked = columns["brake_pressure"] > BRAKE_PRESSURE
        else:
            braked = (f["a_kin_slow"] < A_BRAKED) | (torque / vehicle.arm("fl") < LIFTED * vehicle.mass * G)
        bits: BoolArray = drive.dry & (np.abs(f["a_y_slow"]) < A_Y_MAX) & (f["v_x_hat"] > V_MIN)
    return bits & ~widened(braked, max(round(BESIDE_S / drive.dt), 1))


def _probed(
    drive: Drive, vehicle: Vehicle, section: str, unit: dict[str, tuple[float, ...]], torque_scale: float
) -> tuple[FloatArray, FloatArray]:
    """Return model and measurement (m, n), with a polynomial that passes one force unchanged."""
    rods, torque = (unit, {}) if section == "tie_rod" else ({}, unit)
    probe = replace(vehicle, tie_rod=rods, steering_torque=torque)
    columns = {s: x * torque_scale if s.startswith("torque_") else x for s, x in drive.columns.items() if s in INPUTS}
    f = FeatureStream(probe, drive.dt, columns).push(columns)
    if section == "steering_torque":
        return f["steering_hat"][None, :], f["steering_meas"][None, :]
    names = ("fl", "fr")
    return np.array([f[f"tie_rod_hat_{w}"] for w in names]), np.array([f[f"tie_rod_meas_{w}"] for w in names])


def fit_tie_rod(
    F_y_outward: FloatArray, F_x: FloatArray, measured: FloatArray, *, dt: float, used: BoolArray | None = None,
    degree: int = 2,
) -> TieRodFit:  # fmt: skip
    """Fit the polynomial of a tie-rod force in the forces of its wheel.

    Parameters
    ----------
    F_y_outward, F_x : array (m, n)
        Forces of m wheels (left and right share the coefficients); lateral ones away from the centre line. [N]
    measured : array (m, n)
        Tie-rod forces, compression positive, filtered as the forces are; NaN where missing. [N]
    dt : float
        Sample time. [s]
    used : bool array (n,), optional
        Dry, moving.
    degree : int
        Of the polynomial in F_y; in F_x it is 1.

    Returns
    -------
    TieRodFit
        `c0`, `c_y` (degree values), `c_x` as `physics.steering.tie_rod_force` takes them; c_x is 0 with an infinite
        interval where the longitudinal force hardly changes.

    Raises
    ------
    FitError
        If there are less than 20 s, or the car was hardly steered.

    Least squares, with intervals from leaving out blocks of 8 s in turn. The explained share is that of the variance of
    all rods together.

    Thesis: 2.4, polynomials from a multi-body model; here from the drive itself.
    """
    good = np.isfinite(F_y_outward) & np.isfinite(F_x) & np.isfinite(measured)
    if used is not None:
        good &= used[None, :]
    seconds = float(good.any(axis=0).sum()) * dt
    if seconds < LEAST_S:
        raise FitError(f"{seconds:.0f} s with tie-rod and lateral forces", expected=f"{LEAST_S:g} s of dry driving")
    y, x, f = F_y_outward[good], F_x[good], measured[good]
    if float(np.std(y)) < F_Y_RANGE_MIN:
        raise FitError(
            f"the front wheels' lateral force varies by {float(np.std(y)):.0f} N rms",
            expected=f"{F_Y_RANGE_MIN:g} N for a polynomial of it", hint="a dry slalom with 2 m/s^2",
        )  # fmt: skip
    has_x = float(np.std(x)) >= F_X_RANGE_MIN
    scale = float(np.std(y))
    columns = [np.ones_like(y), *((y / scale) ** k for k in range(1, degree + 1)), *([x / scale] if has_x else [])]
    block = np.broadcast_to(np.arange(good.shape[1]) // max(round(BLOCK_S / dt), 1), good.shape)[good]
    table = np.column_stack(columns)
    best = np.asarray(np.linalg.lstsq(table, f, rcond=None)[0], dtype=np.float64)
    residual = f - table @ best
    gram, right = table.T @ table, table.T @ f
    parts = [(table[block == b], f[block == b]) for b in np.unique(block)]
    left = [np.linalg.lstsq(gram - x.T @ x, right - x.T @ y, rcond=None)[0] for x, y in parts]
    half = student_quantile(0.975, max(len(parts) - 1.0, 1.0)) * jackknife_sd(np.array(left))
    units = np.array([1.0, *(scale**k for k in range(1, degree + 1)), *([scale] if has_x else [])])
    values, low, high = best / units, (best - half) / units, (best + half) / units
    pairs = [(float(a), float(b)) for a, b in zip(low, high, strict=True)]
    coefficients = {
        "c0": (float(values[0]),),
        "c_y": tuple(float(c) for c in values[1 : degree + 1]),
        "c_x": (float(values[-1]),) if has_x else (0.0,),
    }
    intervals = {
        "c0": (pairs[0],),
        "c_y": tuple(pairs[1 : degree + 1]),
        "c_x": (pairs[-1],) if has_x else ((-math.inf, math.inf),),
    }
    explained = 1.0 - float(residual @ residual) / float(((f - f.mean()) ** 2).sum())
    sigma = math.sqrt(float(residual @ residual) / residual.size)
    return TieRodFit(coefficients, intervals, sigma, explained, seconds)
