"""Select the stretches of a drive that identify the balance of forces, as means over windows without delays."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from aqualog.align.mapping import MAP_HINT
from aqualog.checks.driven import no_drivetrain
from aqualog.core.errors import SignalError
from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray, Signals
from aqualog.core.vehicle import Vehicle
from aqualog.features.smoothing import earlier
from aqualog.features.stream import INPUTS, FeatureStream
from aqualog.physics.resistance import air_drag

__all__ = [
    "BESIDE_S", "BRAKE_PRESSURE", "LAG_MAX", "REASONS", "WINDOW_S", "Drive", "Windows", "lag_between",
    "prepare", "widened",
]  # fmt: skip

LAG_MAX = 0.6  # [s] buses and GNSS receivers stay below
FAST_S, SLOW_S = 0.2, 4.0  # [s] band in which a driver's pedal moves force and acceleration alike
CORRELATION_MIN = 0.5  # below it the two do not move together and the lag is left at zero
LEAST_S = 20.0  # [s]
LEAST_CHANGE = 1e-6  # SI, of any signal: no sensor of a car resolves less


def lag_between(x: FloatArray, y: FloatArray, dt: float) -> float:
    """Return the time by which x is late against y.

    Parameters
    ----------
    x, y : array (n,)
        Two signals that move alike, up to scale, offset and slow parts; NaN where missing.
    dt : float
        Sample time. [s]

    Returns
    -------
    lag : float
        Within ±0.6, positive where x comes later; 0 if their best correlation is below 0.5 or less than 20 s are
        usable. [s]

    The peak of the correlation of both signals between 0.25 and 5 Hz, by a parabola through its three highest points.
    """
    a, b = (_mean(z, FAST_S, dt) - _mean(z, SLOW_S, dt) for z in (x, y))
    most = round(LAG_MAX / dt)
    if np.count_nonzero(np.isfinite(a + b)) * dt < LEAST_S or most < 1:
        return 0.0
    shifts = np.arange(-most, most + 1)
    found = _correlations(a, b, most)
    best = int(np.argmax(found))
    if not found[best] > CORRELATION_MIN or best in (0, shifts.size - 1):
        return 0.0
    low, top, high = found[best - 1 : best + 2]
    curvature = low - 2.0 * top + high
    part = 0.5 * (low - high) / curvature if curvature < 0.0 else 0.0
    return float((shifts[best] + part) * dt)


def _mean(x: FloatArray, seconds: float, dt: float) -> FloatArray:
    """Return the centred mean without delay; NaN where one of its samples is NaN."""
    half = max(round(0.5 * seconds / dt), 0)
    width = 2 * half + 1
    out = np.full(x.size, np.nan)
    if x.size < width:
        return out
    good = np.isfinite(x)
    total = np.concatenate([[0.0], np.cumsum(np.where(good, x, 0.0))])
    count = np.concatenate([[0], np.cumsum(good)])
    full = count[width:] - count[:-width] == width
    out[half : x.size - half] = np.where(full, (total[width:] - total[:-width]) / width, np.nan)
    return out


def _correlations(a: FloatArray, b: FloatArray, most: int) -> FloatArray:
    """Of a[i + k] with b[i] where both are known, k = -most ... most; 0 where nothing is."""
    known = [np.isfinite(x) for x in (a, b)]
    # a zero in place of a gap adds nothing to a product: no pair needs to be picked out again for each k
    a, b = (np.where(k, x, 0.0) for k, x in zip(known, (a, b), strict=True))
    of_a, of_b = (k.astype(np.float64) for k in known)
    squares_a, squares_b, n = a * a, b * b, a.size
    found = np.zeros(2 * most + 1)
    for i, k in enumerate(range(-most, most + 1)):
        late, early = slice(max(k, 0), n + min(k, 0)), slice(max(-k, 0), n - max(k, 0))
        scale = math.sqrt(_product(squares_a[late], of_b[early]) * _product(of_a[late], squares_b[early]))
        found[i] = _product(a[late], b[early]) / scale if scale > 0.0 else 0.0
    return found


def _product(x: FloatArray, y: FloatArray) -> float:
    """Return the inner product without threads, which wait longer for each other than so short a sum takes."""
    return float(np.einsum("i,i", x, y))


WINDOW_S = 2.0  # [s] long against sensor lags (0.1 s), short against manoeuvres
BLOCK_S = 40.0  # [s] driving within which residuals (wind, surface) hang together
V_MIN = 6.0  # [m/s]
A_Y_MAX = 0.8  # [m/s^2] cornering costs force beyond
YAW_MAX = 0.05  # [rad/s]
BRAKE_PRESSURE = 0.5e5  # [Pa]
BESIDE_S = 0.6  # [s] before and after a brake or a gear shift
FORCE_MIN = 0.02  # [m/s^2] times mass: without a brake signal only a car that is driven is surely not braked

_WATER = ("on_water", "water_depth", "water_depth_left", "water_depth_right")
REASONS = ("signals missing", "slow or standing", "braking", "brakes not known", "cornering", "gear shift", "wet")


class Windows(NamedTuple):
    """Means over windows (n,) of one drive.

    `a_x` specific force [m/s²], `force` sum (T - I omega_dot) / arm [N], `drag` air drag of 1 m² [N], `v` [m/s],
    `t` [s], `block` index of the stretch that a window is resampled with.
    """

    a_x: FloatArray
    force: FloatArray
    drag: FloatArray
    v: FloatArray
    t: FloatArray
    block: FloatArray


class Drive(NamedTuple):
    """One drive as the estimators take it; arrays (n,) on the grid, delays taken out, NaN where missing."""

    name: str
    dt: float
    windows: Windows
    used: BoolArray
    dry: BoolArray
    driven_s: float
    left_out: Mapping[str, float]
    torque_lag_s: float
    v_lag_s: float
    a_x: FloatArray
    v: FloatArray
    force: FloatArray
    altitude: FloatArray | None
    columns: Mapping[str, FloatArray]
    features: Mapping[str, FloatArray]
    has_velocity: bool
    no_balance: str = ""  # why the torques need not be all of the drive


def prepare(signals: Signals, vehicle: Vehicle, name: str) -> Drive:
    """Turn the signals of one drive into windows.

    Parameters
    ----------
    signals : Signals
        At least `a_x`, the torques of the driven wheels, and `v_x` or wheel speeds. Where the vehicle does not say
        which wheels are driven, the torques of one axle do for all but the balance of forces (`Drive.no_balance`).
    vehicle : Vehicle
        Radii and inertias are used; mass only for the loads.
    name : str
        For messages.

    Raises
    ------
    SignalError
        If a signal is missing.

    Braked samples are left out: brake torques are hardly known. Slow, cornering and wet samples, gear shifts, and their
    neighbours within 0.6 s are left out, too. Torque and velocity are moved to the accelerometer's time first.
    """
    present = [s for s in signals.symbols if signals.frame[s].null_count() < signals.frame.height]
    columns = {s: signals.array(s) for s in present}
    no_balance = _check(columns, vehicle, name)
    dt = signals.dt
    features = FeatureStream(vehicle, dt, present).push({s: columns[s] for s in present if s in INPUTS})
    a_x = columns["a_x"]
    v = features["v_x_hat"]
    # a wheel without a torque signal rolls freely
    torque = np.sum([columns[f"torque_{w}"] / vehicle.arm(w) for w in WHEELS if f"torque_{w}" in columns], axis=0)
    v_lag = lag_between(np.gradient(v, dt), a_x, dt)
    torque_lag = lag_between(torque, a_x, dt)
    v = earlier(v, v_lag, dt)
    spinning = np.zeros_like(v)  # the part of the torque that spins the wheels (E5); else they follow the car
    for w in WHEELS:
        omega = columns[f"omega_{w}"] if f"omega_{w}" in columns else v / vehicle.r_e(w)
        spinning = spinning + vehicle.turning_inertia(w) * np.gradient(omega, dt) / vehicle.arm(w)
    force = earlier(torque, torque_lag, dt) - spinning
    reason = _reasons(a_x, v, force, columns, features, vehicle, dt)
    used = reason == 0
    windows = _windows(a_x, v, force, used, vehicle, dt)
    left_out = {r: float(np.count_nonzero(reason == i + 1)) * dt for i, r in enumerate(REASONS)}
    moving = np.nan_to_num(v) > V_MIN
    return Drive(
        name, dt, windows, used, _dry(columns, moving), float(np.count_nonzero(moving)) * dt,
        {r: s for r, s in left_out.items() if s > 0.0}, torque_lag, v_lag, a_x, v, force, columns.get("altitude"),
        columns, features, "v_x" in present, no_balance,
    )  # fmt: skip


def _check(columns: Mapping[str, FloatArray], vehicle: Vehicle, name: str) -> str:
    """Refuse a drive without its signals; return why the torques need not be all of the drive, empty where they are."""
    torques = [f"torque_{w}" for w in WHEELS if f"torque_{w}" in columns]
    is_part = not vehicle.knows_drivetrain and len(torques) < len(WHEELS)
    needed = ("a_x", *(torques if is_part else (f"torque_{w}" for w in vehicle.driving)))
    missing = [s for s in needed if s not in columns]
    if is_part and not torques:
        missing += ["torque of the driven wheels", "drivetrain in the vehicle file"]
    if "v_x" not in columns and not all(f"omega_{w}" in columns for w in WHEELS):
        missing.append("v_x or the four wheel speeds")
    if missing:
        raise SignalError(
            f"cannot calibrate without {', '.join(missing)}", where=name,
            expected="accelerometer, torques of the driven wheels, and velocity or wheel speeds",
            hint=MAP_HINT,
        )  # fmt: skip
    # what never changes is frozen or not connected, and would be fitted to the last digit
    speeds = [s for s in ("v_x", *(f"omega_{w}" for w in WHEELS)) if s in columns]
    dead = [s for s in (*needed, *speeds) if float(np.nanmax(columns[s]) - np.nanmin(columns[s])) < LEAST_CHANGE]
    if not vehicle.knows_drivetrain and not set(torques) <= set(dead):  # an axle that is not driven has no torque
        dead = [s for s in dead if s not in torques]
    if dead:
        raise SignalError(
            f"{', '.join(dead)} never change{'s' if len(dead) == 1 else ''}", where=name,
            expected="measured signals", hint="check the channel in the signal map",
        )  # fmt: skip
    return no_drivetrain(vehicle, columns).line() if is_part else ""


def _reasons(
    a_x: FloatArray, v: FloatArray, force: FloatArray, columns: Mapping[str, FloatArray],
    features: Mapping[str, FloatArray], vehicle: Vehicle, dt: float,
) -> FloatArray:  # fmt: skip
    """Return 0 where a sample is used, else 1 + index into `REASONS`."""
    reason = np.zeros(v.size)

    def mark(bits: BoolArray, name: str) -> None:
        reason[bits & (reason == 0)] = 1 + REASONS.index(name)

    width = max(round(BESIDE_S / dt), 1)
    with np.errstate(invalid="ignore"):
        mark(np.isnan(a_x + v + force), "signals missing")
        mark(v < V_MIN, "slow or standing")
        if "brake_pressure" in columns:
            mark(widened(columns["brake_pressure"] > BRAKE_PRESSURE, width), "braking")
        else:
            mark(widened(force < FORCE_MIN * vehicle.mass, width), "brakes not known")
        mark(np.abs(features["a_y_slow"]) > A_Y_MAX, "cornering")
        mark(np.abs(features["yaw_rate_slow"]) > YAW_MAX, "cornering")
        if "gear" in columns:
            gear = columns["gear"]
            mark(widened(np.concatenate([[False], np.diff(gear) != 0.0]) & np.isfinite(gear), width), "gear shift")
    mark(~_dry(columns, np.ones(v.size, dtype=np.bool_)), "wet")
    return reason


def _dry(columns: Mapping[str, FloatArray], moving: BoolArray) -> BoolArray:
    """Flag samples of a moving car that is not on measured or labelled water."""
    wet = np.zeros(moving.size, dtype=np.bool_)
    for label in _WATER:
        if label in columns:
            wet |= np.nan_to_num(columns[label]) > 0.0
    dry: BoolArray = moving & ~wet
    return dry


def widened(bits: BoolArray, width: int) -> BoolArray:
    """Extend true samples by `width` samples on both sides."""
    near: BoolArray = np.convolve(bits, np.ones(2 * width + 1))[width : width + bits.size] > 0.5
    return near


def _windows(
    a_x: FloatArray, v: FloatArray, force: FloatArray, used: BoolArray, vehicle: Vehicle, dt: float
) -> Windows:
    """Average over windows without a break; the drag's mean is that of v², not of v."""
    n = max(round(WINDOW_S / dt), 1)
    starts = []
    edges = np.flatnonzero(np.diff(np.concatenate([[False], used, [False]]).astype(np.int8)))
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        starts += list(range(int(a), int(b) - n + 1, n))
    rows = np.array(starts, dtype=np.intp)[:, None] + np.arange(n)[None, :] if starts else np.empty((0, n), np.intp)
    drag = air_drag(v, drag_area=1.0, air_density=vehicle.air_density)
    block = np.floor(np.arange(len(starts)) / max(round(BLOCK_S / WINDOW_S), 1)) if starts else np.empty(0)
    if block.size and math.isfinite(block[-1]) and np.count_nonzero(block == block[-1]) < 5 and block[-1] > 0:
        block[block == block[-1]] -= 1.0  # a remainder too short to stand alone
    t = np.arange(v.size) * dt
    mean = {name: x[rows].mean(axis=1) for name, x in (("a", a_x), ("f", force), ("d", drag), ("v", v), ("t", t))}
    return Windows(mean["a"], mean["f"], mean["d"], mean["v"], mean["t"], block)
