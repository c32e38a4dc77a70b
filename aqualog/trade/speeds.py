"""The car's speed on the lane by two references: satellite or optical, and the free wheel on the dry side."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from aqualog.core.records import BoolArray, FloatArray, Signals
from aqualog.core.vehicle import Vehicle

__all__ = ["Speeds", "references"]

_SHARE = 0.9  # of the lane on which a reference must have a value
_V_LEAST = 3.0  # [m/s] below, no radius is learnt
APART = 1.0 / 3.6  # [m/s] references that differ by more are remarked


class Speeds(NamedTuple):
    """Speed by the reference and by the other one (n,) [m/s], NaN where unknown; their names, the first empty where
    there is no speed. `notes`: what is to be said of them, or why a speed is missing.
    """

    own: FloatArray
    other: FloatArray
    names: tuple[str, str]
    notes: tuple[str, ...] = ()


def references(
    signals: Signals, vehicle: Vehicle, axle: str, dry: str, on_lane: BoolArray, before: BoolArray
) -> Speeds:
    """Return the speeds of a run whose driven axle is `axle` and whose driven wheel on the dry side is `dry`.

    `v_x` is the reference if the log has it on nine tenths of the lane, else the free wheel. The radius of that is the
    vehicle file's; where the file has none, it is learnt from `v_x` before the lane.
    """
    v_x = signals.array("v_x")
    none = np.full_like(v_x, np.nan)
    has_v_x = float(np.isfinite(v_x[on_lane]).mean()) >= _SHARE
    free, radius, note = _free(signals, vehicle, axle, dry, v_x, before)
    has_free = bool(free) and math.isfinite(radius) and (
        float(np.isfinite(signals.array(free)[on_lane]).mean()) >= _SHARE
    )  # fmt: skip
    y = 0.5 * vehicle.track * (1.0 if dry.endswith("l") else -1.0)
    by_wheel = signals.array(free) * radius + np.nan_to_num(signals.array("yaw_rate")) * y if has_free else none
    if has_v_x:
        if not has_free:
            return Speeds(v_x, none, ("v_x", ""), (note or "no free wheel on the dry side checks v_x",))
        apart = float(np.nanmedian(np.abs(v_x - by_wheel)[on_lane]))
        more = (f"v_x and {free} differ by {3.6 * apart:.1f} km/h on the lane",) if apart > APART else ()
        return Speeds(v_x, by_wheel, ("v_x", free), (*((note,) if note else ()), *more))
    if has_free:
        own = f"no v_x on the lane: the speed is that of the free wheel {free}"
        return Speeds(by_wheel, none, (free, ""), (own, *((note,) if note else ())))
    what = "there is no speed on the lane: no v_x, and "
    if not free:
        return Speeds(none, none, ("", ""), (f"{what}all wheels are driven",))
    lack = note or f"{free} is not in the log"
    return Speeds(none, none, ("", ""), (what + lack,))


def _free(
    signals: Signals, vehicle: Vehicle, axle: str, dry: str, v_x: FloatArray, before: BoolArray
) -> tuple[str, float, str]:
    """Return the free wheel on the dry side (empty: all are driven), its radius [m], and a note on that."""
    if vehicle.drivetrain == "awd":
        return "", math.nan, "all wheels are driven: no free wheel checks v_x"
    other = "r" if axle == "f" else "f"
    name = f"omega_{other}{dry[1]}"
    origin = signals.origins.get(name)
    # a speed in km/h became rad/s with the very radius, so it is right with any
    is_known = f"wheels.r_e_{other}" in vehicle.given or (origin is not None and "/h" in origin.unit)
    if is_known:
        return name, vehicle.r_e(name[-2:]), ""
    omega = signals.array(name)
    usable = before & (omega > 1.0) & (v_x > _V_LEAST)
    lack = f"the vehicle file has no wheels.r_e_{other}"
    if usable.sum() < 2:
        return name, math.nan, lack
    radius = float(v_x[usable].sum() / omega[usable].sum())
    return name, radius, f"{lack}: the radius of {name} is learnt from v_x before the lane"
