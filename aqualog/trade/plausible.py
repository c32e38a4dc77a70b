"""Whether `v_x` can be the speed of the car: by the wheels that it drives on, and by the yaw rate in a curve."""

from __future__ import annotations

import numpy as np

from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, Signals

__all__ = ["wrong_curve", "wrong_speed"]

RADII = (0.2, 0.6)  # [m] effective, from small cars to lorries (K)
_OMEGA_LEAST, _V_LEAST = 1.0, 3.0  # [rad/s], [m/s] below, a wheel or the car may stand
_CURVE_SHARE = 0.3  # of the lateral acceleration: body roll and side slip change it by less (K)
_YAW_LEAST = 0.02  # [rad/s] less may be an offset


def wrong_speed(signals: Signals, within: BoolArray) -> str:
    """Why `v_x` cannot be the car's speed on a stretch without much slip: the radius that it gives the wheels.

    Empty where it can, or where the log lacks it or the wheels. A unit taken for another (km/h, rpm) shows here.
    """
    v = signals.array("v_x")
    radii = []
    for wheel in WHEELS:
        omega = signals.array(f"omega_{wheel}")
        good = within & (omega > _OMEGA_LEAST) & (v > _V_LEAST)
        if good.any():
            radii.append(float(np.median(v[good] / omega[good])))
    radius = float(np.median(radii)) if radii else RADII[0]
    if RADII[0] <= radius <= RADII[1]:
        return ""
    return f"v_x and the wheel speeds give a radius of {radius:.2f} m: check their units in the map"


def wrong_curve(signals: Signals, within: BoolArray) -> str:
    """Why speed, yaw rate and lateral acceleration cannot be of one steady circle; empty where they can (n,)."""
    v, yaw, a_y = (float(np.nanmean(x)) if np.isfinite(x).any() else np.nan for x in _inside(signals, within))
    if not abs(yaw) > _YAW_LEAST or abs(v * yaw - a_y) <= _CURVE_SHARE * abs(a_y):
        return ""
    return f"v_x times yaw_rate is {v * yaw:.2f} m/s², a_y {a_y:.2f} m/s²: check their units and signs in the map"


def _inside(signals: Signals, within: BoolArray) -> list[np.ndarray]:
    return [signals.array(n)[within] for n in ("v_x", "yaw_rate", "a_y")]
