"""Passes over water in logs, as windows of one wheel: how much it slips at a speed and depth."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from aqualog.core.records import BoolArray, FloatArray, Signals
from aqualog.core.vehicle import Vehicle
from aqualog.model.even_wheel import front_slip_slope
from aqualog.model.tyre import Tyre
from aqualog.physics.load import G
from aqualog.trade.lane import Span, spans_of, tracks_of

__all__ = ["SPUN", "Told", "WetPass", "Window", "passes_of"]

DRY_S = 1.0  # [s] before the water from which the wheel's ratio to the velocity is taken
GAP_S = 0.2  # [s] about entry and exit that count for neither
WINDOW_S = 0.5
SETTLES_S = 1.0  # [s] after the first sample on water in which driver, torque and wheel find their balance (K)
LOST, SPUN = -0.5, 0.06  # [-] slip of a wheel that stops, and of a driven one that spins up: it has lost the road
LOST_S = 0.05  # [s] for which it lasts
STRAIGHT = 0.08  # [rad/s] yaw rate beyond which a window does not count
BRAKED = 1e5  # [Pa] brake pressure beyond which it does not
LEAST_V = 8.0  # [m/s]


@dataclass(frozen=True, slots=True)
class Told:
    """What the user says of the passes: `depth` of the water [m] where logs lack it, or NaN; `tread` [m]; `p` [Pa]."""

    depth: float
    tread: float
    p: float


class Window(NamedTuple):
    """Half a second of a front wheel on water.

    `v` [m/s], `h_w` [m], wheel load `F_z` [N]; `demand`: drive force over load, NaN for a free wheel; `slip` by the
    rim's speed, median [-]; `is_lost`: the wheel stops or spins up; `a`: acceleration of the car. [m/s²]
    """

    v: float
    h_w: float
    F_z: float
    demand: float
    slip: float
    is_lost: bool
    a: float = 0.0


@dataclass(frozen=True, slots=True)
class WetPass:
    """One stretch of water in one drive; without windows `why` says what is missing."""

    name: str
    windows: tuple[Window, ...]
    why: str = ""


def passes_of(signals: Signals, vehicle: Vehicle, name: str, told: Told) -> list[WetPass]:
    """Passes of a drive over water, as windows of its front wheels, which meet the water undisturbed.

    Parameters
    ----------
    signals : Signals
        With wheel speeds, `v_x`, and `on_water` or a water depth; torques too where the front axle is driven.
    vehicle : Vehicle
    name : str
        Of the drive, for messages.
    told : Told

    Returns
    -------
    list of WetPass
        Empty without a watered stretch. The wheel's ratio to the velocity is that of the dry second before.
    """
    spans = spans_of(signals)
    found = []
    for i, span in enumerate(spans):
        own = _windows(signals, vehicle, span, told)
        label = name if len(spans) == 1 else f"{name}, water {i + 1}"
        found.append(WetPass(label, (), own) if isinstance(own, str) else WetPass(label, tuple(own)))
    return found


def _windows(signals: Signals, vehicle: Vehicle, span: Span, told: Told) -> list[Window] | str:
    """Windows of both front wheels, or why no window counts."""
    t, v = signals.array("t"), signals.array("v_x")
    dry = (t >= span[0] - DRY_S - GAP_S) & (t < span[0] - GAP_S)
    if not np.isfinite(v).any():
        return "no velocity (v_x)"
    if np.count_nonzero(dry & np.isfinite(v)) * signals.dt < 0.5 * DRY_S:
        return f"no dry second before the water at {span[0]:.1f} s"
    depths = _depths(signals, span, told)
    if depths is None:
        return f"no water depth at {span[0]:.1f} s"
    straight = ~(np.abs(signals.array("yaw_rate")) > STRAIGHT) & ~(signals.array("brake_pressure") > BRAKED)
    inside = (t >= span[0] + GAP_S) & (t <= span[1] - GAP_S)
    found: list[Window] = []
    driven = vehicle.driven[0] == "fl"
    missing = "no speed of a front wheel"
    for wheel, h_w in zip(("fl", "fr"), depths, strict=True):
        omega, torque = signals.array(f"omega_{wheel}"), signals.array(f"torque_{wheel}")
        if not np.isfinite(omega[inside]).any() or not h_w > 0.0:
            continue
        if driven and not np.isfinite(torque[inside]).any():
            missing = f"no torque of the driven wheel {wheel}"
            continue
        found += _of_wheel(_Course(t, v, omega, torque if driven else np.full_like(t, np.nan)), dry, inside & straight,
                           vehicle, h_w, told.p)  # fmt: skip
    return found or f"{missing}, or too short, at {span[0]:.1f} s"


def _depths(signals: Signals, span: Span, told: Told) -> tuple[float, float] | None:
    """Water before the left and the right front wheel: in the tracks, or on the lane. [m]"""
    tracks = tracks_of(signals, span)
    if tracks is not None:
        return tracks
    t, h = signals.array("t"), signals.array("water_depth")
    own = h[(t >= span[0]) & (t <= span[1])]
    depth = float(np.nanmedian(own)) if np.isfinite(own).any() else told.depth
    return (depth, depth) if math.isfinite(depth) else None


class _Course(NamedTuple):
    t: FloatArray
    v: FloatArray
    omega: FloatArray
    torque: FloatArray


def _of_wheel(c: _Course, dry: BoolArray, usable: BoolArray, vehicle: Vehicle, h_w: float, p: float) -> list[Window]:
    """Windows of one wheel up to the one in which it is lost."""
    ratio = float(np.nanmedian(c.omega[dry] / c.v[dry])) if dry.any() else math.nan
    if not ratio > 0.0:
        return []
    F_z = 0.5 * vehicle.mass * G * vehicle.l_r / vehicle.wheelbase
    # slip by the rim's speed; a wheel that stands counts as turning at a twentieth
    rim = np.maximum(c.omega / ratio, 0.05 * np.maximum(c.v, 1.0))
    is_driven = bool(np.isfinite(c.torque[dry]).any())
    demand_dry = float(np.nanmedian(c.torque[dry])) / vehicle.arm("fl") / F_z if is_driven else 0.0
    dry_slip = (demand_dry - vehicle.rolling_resistance) / front_slip_slope(Tyre(), vehicle, p)
    slip = 1.0 - c.v / rim + dry_slip
    dt = float(c.t[1] - c.t[0])
    windows: list[Window] = []
    at = np.flatnonzero(usable & np.isfinite(slip))
    if not at.size:
        return []
    for start in np.arange(c.t[at[0]], c.t[at[-1]] - 0.5 * WINDOW_S, WINDOW_S):
        own = at[(c.t[at] >= start) & (c.t[at] < start + WINDOW_S)]
        if own.size * dt < 0.8 * WINDOW_S:
            continue
        away = (slip[own] < LOST) | (slip[own] > SPUN)
        lost = bool(np.count_nonzero(away) * dt >= LOST_S)
        speed = float(c.v[own[away][0]]) if lost else float(np.median(c.v[own]))
        if speed < LEAST_V or (not lost and start < c.t[at[0]] + SETTLES_S):
            continue
        known = bool(np.isfinite(c.torque[own]).any())
        demand = float(np.nanmedian(c.torque[own])) / vehicle.arm("fl") / F_z if known else math.nan
        a = float(np.polyfit(c.t[own], c.v[own], 1)[0])
        windows.append(Window(speed, h_w, F_z, demand, float(np.median(slip[own])), lost, a))
        if lost:
            break
    return windows
