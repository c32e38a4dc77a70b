"""The dry balance of forces of one or more drives by regression, and the offset of each accelerometer."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from aqualog.calibrate.design import Drive, Windows
from aqualog.core.errors import FitError
from aqualog.core.records import FloatArray
from aqualog.physics.load import G

__all__ = ["ALTITUDE_SD", "CLIMB_SD", "Balance", "Offset", "Sample", "energy_offset", "fit_balance", "residual"]

CLIMB_SD = 20.0  # [m] net climb of a drive whose height is not known (K: drives end near where they began)
ALTITUDE_SD = 4.0  # [m] error of a height, GNSS or map, at each end of a drive (K)
V_STOPPED = 0.5  # [m/s]


class Offset(NamedTuple):
    """`value` [m/s²] at the time `t` [s] of the drive, `sd` by the height; `has_height`; way [m]."""

    value: float
    sd: float
    t: float
    has_height: bool
    way: float


def energy_offset(drive: Drive) -> Offset:
    """Estimate the offset of the accelerometer over one drive.

    b = (int v a_x dt - Delta(v² / 2) - g Delta h) / way. Along the way the specific force lifts and accelerates the
    car, whatever grade, brake, torque or wind acts (E2). Only the heights at both ends count. Without an altitude
    Delta h is 0 ± 20 m. The value is that of an evenly drifting offset at the mean time of the way, int v t dt / way.

    Gaps in a_x or v are left out with the energy and height gained within them. The result is NaN, with an infinite sd,
    where the drive is shorter than 500 m.
    """
    v, a, dt = drive.v, drive.a_x, drive.dt
    good = np.isfinite(v + a)
    height = drive.altitude
    if height is not None:
        good &= np.isfinite(height)
    pair = good[1:] & good[:-1] & (v[1:] + v[:-1] > 2.0 * V_STOPPED)
    mean_v = 0.5 * (v[1:] + v[:-1])[pair]
    way = float(mean_v.sum() * dt)
    if way < 500.0:
        return Offset(math.nan, math.inf, math.nan, height is not None, way)
    work = float((mean_v * 0.5 * (a[1:] + a[:-1])[pair]).sum() * dt)
    kinetic = float((0.5 * (v[1:] ** 2 - v[:-1] ** 2))[pair].sum())
    t = np.arange(v.size) * dt
    middle = float((mean_v * t[1:][pair]).sum() * dt) / way
    climb, sd = 0.0, CLIMB_SD
    if height is not None:
        climb = float((height[1:] - height[:-1])[pair].sum())
        sd = ALTITUDE_SD * math.sqrt(2.0)
    return Offset((work - kinetic - G * climb) / way, G * sd / way, middle, height is not None, way)


LEAST_WINDOWS = 20


class Sample(NamedTuple):
    """Windows of a drive with the offset of its accelerometer."""

    windows: Windows
    offset: Offset


class Balance(NamedTuple):
    """Estimates: `inverse_mass` torque gain over mass [1/kg], `drag` drag area over mass [m²/kg], `levels` (J,) a_x
    without force and drag at the offset's time [m/s²], `drifts` (J,) of it [m/s³], `rolling` r_w [-], `condition` of
    the scaled columns of force and drag [-].
    """  # fmt: skip

    inverse_mass: float
    drag: float
    levels: FloatArray
    drifts: FloatArray
    rolling: float
    condition: float


def fit_balance(samples: Sequence[Sample], fixed: Mapping[str, float]) -> Balance:
    """Fit a_x = k F - kappa D + level_j + drift_j (t - t_j) by least squares over the windows of all drives.

    Parameters
    ----------
    samples : sequence of Sample
    fixed : mapping
        Known values; `mass` with `torque_gain` fixes k, `drag_area` couples kappa to it.

    Returns
    -------
    Balance
        level_j = b_j - g r_w with the offset b_j of the drive's accelerometer. Specific force: no grade (E2). The force
        is that of the torque less the part that spins the wheels (E5).

    Raises
    ------
    FitError
        If there are fewer than 20 windows, or their forces are all alike.

    Errors in the force make k too small; means over 2 s leave little of them. A wind enters kappa and the levels.

    Thesis: Eq. (2.9), (2.10) with a measure of zero.
    """
    count = sum(s.windows.v.size for s in samples)
    if count < LEAST_WINDOWS:
        raise FitError(
            f"{count} windows of straight, unbraked, dry driving", expected=f"{LEAST_WINDOWS} of 2 s at the least",
            hint="longer drives; the table of what was left out says why",
        )  # fmt: skip
    a = np.concatenate([_centred(s, s.windows.a_x) for s in samples])
    force = np.concatenate([_centred(s, s.windows.force) for s in samples])
    drag = np.concatenate([_centred(s, s.windows.drag) for s in samples])
    k_known = fixed["torque_gain"] / fixed["mass"] if {"mass", "torque_gain"} <= set(fixed) else None
    inverse_mass, kappa, condition = _slopes(a, force, drag, k_known, fixed)
    levels, drifts = np.empty(len(samples)), np.empty(len(samples))
    for j, s in enumerate(samples):
        rest = s.windows.a_x - inverse_mass * s.windows.force + kappa * s.windows.drag
        drifts[j], levels[j] = _line(s, rest)
    rolling = math.nan  # mean of (b_j - level_j) / g, weighted by how well each offset is known
    known = np.array([math.isfinite(s.offset.value) for s in samples])
    if known.any():
        b = np.array([s.offset.value for s in samples])[known]
        sd = np.array([max(s.offset.sd, 0.01) for s in samples])[known]
        weight = sd**-2 / (sd**-2).sum()
        rolling = float((weight * (b - levels[known])).sum()) / G
    return Balance(inverse_mass, kappa, levels, drifts, rolling, condition)


def residual(sample: Sample, *, inverse_mass: float, drag: float, level: float, drift: float) -> FloatArray:
    """Return the residual of a_x in each window. [m/s²]"""
    w = sample.windows
    return w.a_x - inverse_mass * w.force + drag * w.drag - level - drift * (w.t - _time(sample))


def _slopes(
    a: FloatArray, force: FloatArray, drag: FloatArray, k_known: float | None, fixed: Mapping[str, float]
) -> tuple[float, float, float]:
    if "drag_area" in fixed:
        area = fixed["drag_area"]
        if "mass" in fixed:
            kappa = area / fixed["mass"]
            return (k_known if k_known is not None else _slope(force, a + kappa * drag)), kappa, 1.0
        area = area / fixed.get("torque_gain", 1.0)  # kappa = drag_area / m and k = gain / m: one column
        k = _slope(force - area * drag, a)
        return k, k * area, 1.0
    if k_known is not None:
        return k_known, -_slope(drag, a - k_known * force), 1.0
    columns = np.column_stack([force, drag])
    scale = np.linalg.norm(columns, axis=0)
    if not (scale > 0.0).all():
        raise FitError("force or speed never changes", expected="a drive with different speeds and accelerations")
    scaled = columns / scale
    solution = np.linalg.lstsq(scaled, a, rcond=None)[0] / scale
    return float(solution[0]), -float(solution[1]), float(np.linalg.cond(scaled))


def _slope(x: FloatArray, y: FloatArray) -> float:
    square = float(x @ x)
    if not square > 0.0:
        raise FitError("force or speed never changes", expected="a drive with different speeds and accelerations")
    return float(x @ y) / square


def _time(sample: Sample) -> float:
    return sample.offset.t if math.isfinite(sample.offset.t) else float(sample.windows.t.mean())


def _line(sample: Sample, y: FloatArray) -> tuple[float, float]:
    """Fit the slope over time, and the level at the offset's time."""
    t = sample.windows.t - sample.windows.t.mean()
    square = float(t @ t)
    slope = float(t @ y) / square if square > 0.0 else 0.0
    return slope, float(y.mean()) + slope * (_time(sample) - float(sample.windows.t.mean()))


def _centred(sample: Sample, y: FloatArray) -> FloatArray:
    """Remove from a column the level and drift that each drive has of its own."""
    if y.size == 0:
        return y
    slope, _ = _line(sample, y)
    t = sample.windows.t
    centred: FloatArray = y - y.mean() - slope * (t - t.mean())
    return centred
