"""Effective radii of the wheels: with a velocity their size, without one their ratio."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from aqualog.calibrate import words
from aqualog.calibrate.design import WINDOW_S, Drive
from aqualog.calibrate.lag import earlier, lag_between
from aqualog.calibrate.records import Parameter
from aqualog.calibrate.spread import BLOCKS_MIN, DRIVES_MIN, half_width, jackknife
from aqualog.notation import AXLES, WHEELS
from aqualog.physics.load import G
from aqualog.types import FloatArray
from aqualog.vehicle import Vehicle

__all__ = ["Radii", "fit_radii", "radii_of_blocks", "radius_parameters"]

V_MIN = 8.0  # [m/s]
A_MAX = 2.0  # [m/s^2]
BLOCK = 20  # windows
MODEL_SD: Mapping[str, float] = {"r_e_f": 7e-5, "r_e_r": 7e-5, "r_e_ratio": 5e-5}
"""What clocks (5 ms at 0.3 m/s^2 of coasting and 22 m/s), inertia and load transfer leave at zero torque (D). [-]"""


class Radii(NamedTuple):
    """Effective radii of freely rolling wheels, front and rear [m] (NaN without v_x), and front over rear [-]."""

    r_e_f: float
    r_e_r: float
    r_e_ratio: float


def radii_of_blocks(drive: Drive, vehicle: Vehicle) -> list[FloatArray]:
    """Windows of one drive in blocks, each (k, 5).

    v / omega_f, v / omega_r [m], omega_r / omega_f, force over weight, and on AWD cars acceleration over speed [1/s].

    Empty where a wheel speed is missing. The wheels of an axle are averaged: what a slight curve does to left and right
    cancels.
    """
    if any(f"omega_{w}" not in drive.columns for w in WHEELS):
        return []
    f, r = (np.mean([drive.columns[f"omega_{w}"] for w in AXLES[a]], axis=0) for a in ("f", "r"))
    v = np.full(f.size, math.nan)
    if drive.has_velocity:
        # 0.1 s of delay at the 0.3 m/s^2 of a coasting car would be 0.1 % of radius; free wheels share the velocity's
        # clock, driven ones lead it by their slip
        v = drive.columns["v_x"]
        if vehicle.drivetrain != "awd":
            free = f if vehicle.drivetrain == "rwd" else r
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
    late = a_kin / (f * vehicle.r_e_f) if vehicle.drivetrain == "awd" else np.zeros_like(force)
    table = np.column_stack([v / f, v / r, r / f, force / (vehicle.mass * G), late])
    return [
        table[i : i + BLOCK] for i in range(0, table.shape[0], BLOCK) if table[i : i + BLOCK].shape[0] >= BLOCK // 2
    ]


def fit_radii(blocks: Sequence[FloatArray]) -> Radii:
    """Radii of wheels that no torque drives.

    v / omega of a driven wheel falls with the force by the slip (3.13), a cubic for the brush, of which only the
    value at zero counts; on AWD cars, where no wheel tells a delay of v_x, it also falls with acceleration over speed.
    At zero a wheel rolls freely, and its own rolling resistance, a slip of r_w / C (0.03 %), is in the radius.
    """
    x = np.concatenate(list(blocks))
    columns = np.column_stack([np.ones(x.shape[0]), x[:, 3], x[:, 3] ** 2, x[:, 3] ** 3, x[:, 4]])

    def at_zero(y: FloatArray) -> float:
        return float(np.linalg.lstsq(columns, y, rcond=None)[0][0]) if np.isfinite(y).all() else math.nan

    return Radii(at_zero(x[:, 0]), at_zero(x[:, 1]), at_zero(x[:, 2]))


def radius_parameters(drives: Sequence[Drive], vehicle: Vehicle) -> list[Parameter]:
    """Radii of both axles and their ratio as parameters; whole drives left out from four on, else blocks of 40 s."""
    by_drive = [b for b in (radii_of_blocks(d, vehicle) for d in drives) if b]
    parts = [np.concatenate(b) for b in by_drive] if len(by_drive) >= DRIVES_MIN else [x for b in by_drive for x in b]
    units = {"r_e_f": "m", "r_e_r": "m", "r_e_ratio": "-"}
    file = {"r_e_f": vehicle.r_e_f, "r_e_r": vehicle.r_e_r, "r_e_ratio": vehicle.r_e_f / vehicle.r_e_r}
    if len(parts) < BLOCKS_MIN and len(by_drive) < DRIVES_MIN:
        why = words.radius_unknown(ratio_known=False) if not by_drive else words.RADIUS_SHORT
        return [
            Parameter(n, file[n], (math.nan, math.nan), u, identified=False, why_not=why, file_value=file[n])
            for n, u in units.items()
        ]
    best = fit_radii(parts)
    spread = jackknife([fit_radii([p for k, p in enumerate(parts) if k != j])._asdict() for j in range(len(parts))])
    parameters = []
    for name, unit in units.items():
        value = float(getattr(best, name))
        if not math.isfinite(value):
            why = words.radius_unknown(ratio_known=True)
            parameters.append(
                Parameter(
                    name, file[name], (math.nan, math.nan), unit, identified=False, why_not=why, file_value=file[name]
                )
            )
            continue
        half = math.hypot(half_width(spread[0][name], spread[1][name]), 1.96 * MODEL_SD[name] * value)
        remark = "front over rear" if name == "r_e_ratio" else "v_x taken as true"
        parameters.append(
            Parameter(
                name, value, (value - half, value + half), unit, identified=True, remark=remark, file_value=file[name]
            )
        )
    return parameters


def _untold(name: str, value: float, unit: str, why: str) -> Parameter:
    return Parameter(name, value, (math.nan, math.nan), unit, identified=False, why_not=why, file_value=value)
