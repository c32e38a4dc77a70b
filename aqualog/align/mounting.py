"""Signals of an IMU that is mounted turned by right angles: gravity says which axis is up, the speed which is ahead."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aqualog.align.motion import Fit, Motion, fit, on_grid, smooth
from aqualog.core.records import Channel
from aqualog.core.units import is_unit, parse_unit

__all__ = ["Axis", "gyro_beside", "turned_axes"]

_SURE = 0.7  # correlation with the derivative of the speed that names the axis ahead
_CLEAR = 2.0  # by how much it is above that of the other level axis
_AXES = "xyz"


@dataclass(frozen=True, slots=True)
class Axis:
    """A channel that is a signal of the car, but for its sign (`scale`, 1 or -1), and why."""

    channel: Channel
    scale: float
    reason: str


def gyro_beside(channels: Sequence[Channel], accelerometer: Channel) -> dict[str, Channel]:
    """Return the three rates by axis that stand in the group of an accelerometer's axis; empty without all of them."""
    group = accelerometer.info.path.rpartition(".")[0]
    found = {
        c.info.name[-1:].lower(): c
        for c in channels
        if c.info.file == accelerometer.info.file and c.info.path.rpartition(".")[0] == group
        and is_unit(c.info.unit) and parse_unit(c.info.unit).dimension == "angular_speed"
    }  # fmt: skip
    return found if set(found) == set(_AXES) else {}


def turned_axes(
    acceleration: Mapping[str, Channel], rate: Mapping[str, Channel], up: str, motion: Motion
) -> dict[str, Axis]:
    """Return a_x, a_y and yaw_rate by symbol; empty where the speed does not show which axis points ahead.

    Parameters
    ----------
    acceleration, rate : mapping of axis (x, y, z) to Channel
        The sensor's right-handed axes; `rate` may be empty.
    up : str
        The axis that points up, such as `x` or `-x`.
    motion : Motion
    """
    level = [a for a in _AXES if a != up[-1]]
    fits = {a: _best(acceleration[a], motion) for a in level}
    ahead, side = sorted(level, key=lambda a: -np.nan_to_num(abs(fits[a].r)))
    r, other = fits[ahead].r, np.nan_to_num(abs(fits[side].r))
    if not abs(r) >= max(_SURE, _CLEAR * other):
        return {}
    vertical = (-1.0 if up.startswith("-") else 1.0) * np.eye(3)[_AXES.index(up[-1])]
    forward = np.sign(r) * np.eye(3)[_AXES.index(ahead)]
    left = np.cross(vertical, forward)  # of a car, too, z times x is y
    mounted = f"the sensor is mounted with {up} up"
    found = {
        "a_x": Axis(acceleration[ahead], float(np.sign(r)),
                    f"{mounted}; correlation {r:+.2f} with the derivative of the speed"),
        "a_y": Axis(acceleration[side], float(left[_AXES.index(side)]), f"{mounted} and {ahead} along the car"),
    }  # fmt: skip
    if rate:
        found["yaw_rate"] = Axis(rate[up[-1]], float(vertical[_AXES.index(up[-1])]), mounted)
    return found


def _best(channel: Channel, motion: Motion) -> Fit:
    raw = smooth(on_grid(channel, motion.grid))
    return max((fit(raw, c) for c in motion.changes), key=lambda f: np.nan_to_num(abs(f.r)))
