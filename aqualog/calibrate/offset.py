"""Estimate the offset of the accelerometer from the energy balance of a drive, by velocity and height."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from aqualog.calibrate.design import Drive
from aqualog.physics.load import G

__all__ = ["ALTITUDE_SD", "CLIMB_SD", "Offset", "energy_offset"]

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
