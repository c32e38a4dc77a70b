"""Estimate the effective radii of the wheels: their size with a velocity, their ratio without one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from aqualog.calibrate import words
from aqualog.calibrate.design import WINDOW_S, Drive, lag_between
from aqualog.calibrate.records import Parameter
from aqualog.calibrate.spread import BLOCKS_MIN, DRIVES_MIN, Spread, combined, half_width, jackknife, stratified
from aqualog.core.notation import AXLES, WHEELS
from aqualog.core.records import FloatArray
from aqualog.core.vehicle import Drivetrain, Vehicle
from aqualog.features.smoothing import earlier
from aqualog.physics.load import G

__all__ = ["Radii", "fit_radii", "radii_of_blocks", "radii_spread", "radius_parameters"]

V_MIN = 8.0  # [m/s]
A_MAX = 2.0  # [m/s^2]
BLOCK = 20  # windows
SLIP_SD = 2e-5  # [-] of a driven wheel: 5 % of the slip r_w / C that it rolls freely with (D)
AWD_SD = 7e-5  # [-] with no free wheel: 5 ms of clock at 0.3 m/s^2 of coasting and 22 m/s (D)


class Radii(NamedTuple):
    """Effective radii of freely rolling wheels, front and rear [m] (NaN without v_x), and front over rear [-]."""

    r_e_f: float
    r_e_r: float
    r_e_ratio: float


def radii_of_blocks(drive: Drive, vehicle: Vehicle) -> list[FloatArray]:
    """Cut one drive into blocks of windows, each (k, 6).

    Columns: v / omega_f, v / omega_r [m], omega_r / omega_f, force over weight, acceleration over speed [1/s],
    acceleration [m/s²].

    Empty where a wheel speed is missing. The wheels of an axle are averaged, so that the effects of a slight curve on
    left and right cancel.
    """
    if any(f"omega_{w}" not in drive.columns for w in WHEELS):
        return []
    f, r = (np.mean([drive.columns[f"omega_{w}"] for w in AXLES[a]], axis=0) for a in ("f", "r"))
    v = np.full(f.size, math.nan)
    if drive.has_velocity:
        # 0.1 s of delay at the 0.3 m/s^2 of a coasting car would be 0.1 % of radius; free wheels tell it, driven ones
        # lead the velocity by their slip
        v = drive.columns["v_x"]
        if _way(vehicle) != "awd":
            free = f if _way(vehicle) == "rwd" else r
            v = earlier(v, lag_between(np.gradient(v, drive.dt), np.gradient(free, drive.dt), drive.dt), drive.dt)
    n = max(round(WINDOW_S / drive.dt), 1)
    rows = f.size // n
    with np.errstate(invalid="ignore"):
        good = drive.used & (f > V_MIN / vehicle.r_e_f) & (r > V_MIN / vehicle.r_e_r) & (np.abs(drive.a_x) < A_MAX)
    good &= np.isfinite(v) if drive.has_velocity else True
    full = good[: rows * n].reshape(rows, n).all(axis=1)
    means = (
        x[: rows * n].reshape(rows, n).mean(axis=1)[full]
        for x in (f, r, v, drive.force, np.gradient(drive.v, drive.dt))
    )
    f, r, v, force, a_kin = means
    table = np.column_stack([v / f, v / r, r / f, force / (vehicle.mass * G), a_kin / (f * vehicle.r_e_f), a_kin])
    return [
        table[i : i + BLOCK] for i in range(0, table.shape[0], BLOCK) if table[i : i + BLOCK].shape[0] >= BLOCK // 2
    ]


def fit_radii(drives: Sequence[Sequence[FloatArray]], drivetrain: Drivetrain) -> Radii:
    """Estimate the radii of wheels at zero torque.

    Parameters
    ----------
    drives : sequence of sequences of array (k, 6)
        Blocks of each drive by `radii_of_blocks`.
    drivetrain : {"fwd", "rwd", "awd"}

    v / omega of a free axle is its radius plus the effect of its delay: a / v times some 10 ms. Each drive has its
    own delay, which the peak of a correlation does not resolve. v / omega of a driven wheel falls with the force by the
    slip (3.13), a cubic for the brush, of which only the value at zero counts. It also changes with the acceleration,
    through the slip of the free wheels' inertia. At zero force a wheel rolls freely; the slip of its own rolling
    resistance, r_w / C (0.04 %), is part of the radius. On AWD cars all drives share one delay.
    """
    of_drives = [np.concatenate(list(b)) for b in drives if len(b)]
    x = np.concatenate(of_drives)
    one, force = np.ones(x.shape[0]), x[:, 3] / max(np.abs(x[:, 3]).max(), 1e-300)  # absurd ones have no cube
    driven = [one, force, force**2, force**3]
    if drivetrain == "awd":
        return Radii(*(_constant([*driven, x[:, 4]], x[:, i]) for i in range(3)))
    index = np.repeat(np.arange(len(of_drives)), [d.shape[0] for d in of_drives])
    delays = [np.where(index == j, x[:, 4], 0.0) for j in range(len(of_drives))]
    ratio = _constant([*driven, x[:, 5]], x[:, 2])
    if drivetrain == "rwd":
        front = _constant([one, *delays], x[:, 0])
        return Radii(front, front / ratio, ratio)
    rear = _constant([one, *delays], x[:, 1])
    return Radii(rear * ratio, rear, ratio)


def _constant(columns: Sequence[FloatArray], y: FloatArray) -> float:
    """Fit the coefficient of the first column by least squares; NaN where y is missing."""
    return float(np.linalg.lstsq(np.column_stack(columns), y, rcond=None)[0][0]) if np.isfinite(y).all() else math.nan


def radii_spread(drives: Sequence[Sequence[FloatArray]], drivetrain: Drivetrain) -> Spread:
    """Leave out blocks of 40 s in turn within their drive; from four drives on, whole drives, too."""

    def without(j: int, k: int) -> dict[str, float]:
        kept = [b for i, b in enumerate(drives[j]) if i != k]
        return fit_radii([*drives[:j], kept, *drives[j + 1 :]], drivetrain)._asdict()

    within = stratified([[without(j, k) for k in range(len(blocks))] for j, blocks in enumerate(drives)])
    if len(drives) < DRIVES_MIN:
        return within
    left = [fit_radii([*drives[:j], *drives[j + 1 :]], drivetrain)._asdict() for j in range(len(drives))]
    return combined(within, Spread(*jackknife(left), by_drive=True))


def radius_parameters(drives: Sequence[Drive], vehicle: Vehicle) -> list[Parameter]:
    """Return the radii of both axles and their ratio, with intervals by `radii_spread` and the model error."""
    by_drive = [b for b in (radii_of_blocks(d, vehicle) for d in drives) if b]
    units = {"r_e_f": "m", "r_e_r": "m", "r_e_ratio": "-"}
    file = {"r_e_f": vehicle.r_e_f, "r_e_r": vehicle.r_e_r, "r_e_ratio": vehicle.r_e_f / vehicle.r_e_r}
    if sum(len(b) for b in by_drive) < BLOCKS_MIN:
        why = words.radius_unknown(ratio_known=False) if not by_drive else words.RADIUS_SHORT
        return [_untold(n, file[n], u, why) for n, u in units.items()]
    best = fit_radii(by_drive, _way(vehicle))
    spread = radii_spread(by_drive, _way(vehicle))
    parameters = []
    for name, unit in units.items():
        value = float(getattr(best, name))
        if not math.isfinite(value):
            parameters.append(_untold(name, file[name], unit, words.radius_unknown(ratio_known=True)))
            continue
        half = math.hypot(half_width(spread.sd[name], spread.dof[name]), 1.96 * _model_sd(name, vehicle) * value)
        remark = "front over rear" if name == "r_e_ratio" else "v_x taken as true"
        parameters.append(
            Parameter(
                name, value, (value - half, value + half), unit, identified=True, remark=remark, file_value=file[name]
            )
        )
    return parameters


def _model_sd(name: str, vehicle: Vehicle) -> float:
    """Return the error that the regression leaves in a radius after any number of drives; 0 on a free axle. [-]"""
    if _way(vehicle) == "awd":
        return AWD_SD
    return 0.0 if name == ("r_e_f" if _way(vehicle) == "rwd" else "r_e_r") else SLIP_SD


def _way(vehicle: Vehicle) -> Drivetrain:
    """Return the driven axles of the regression: both where they are not known, which holds for every car."""
    return vehicle.drivetrain if vehicle.knows_drivetrain else "awd"


def _untold(name: str, value: float, unit: str, why: str) -> Parameter:
    return Parameter(name, value, (math.nan, math.nan), unit, identified=False, why_not=why, file_value=value)
