"""Named columns for the regressions: what each effect does to a residual, by hand, from logged signals and vehicle file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from aqualog.core.vehicle import Vehicle

__all__ = ["TWINS", "Residuals", "form_columns", "named_columns", "stacked"]

G = 9.81
WHEELS = ("fl", "fr", "rl", "rr")

TWINS: dict[str, frozenset[str]] = {
    # effects whose columns are the same up to a factor or nearly: a rival that picks one is taken to have meant the other
    name: frozenset(group)
    for group in (
        {"rolling_resistance", "brake_drag"}, {"velocity_scale", "tyre_radius"},
        {"payload_mass", "wheel_inertia", "trailer"}, {"signal_delay", "clock_skew"},
    )
    for name in group
}  # fmt: skip
HATS = 6  # of a form over one coordinate
FORMS = {
    "force": ("force_balance",), "accelerometer": ("force_balance", "kinematic"),
    "slip@f": ("slip_fl", "slip_fr"), "slip@r": ("slip_rl", "slip_rr"), "lateral": ("lateral",),
}  # fmt: skip


class Residuals(NamedTuple):
    """Residual channels (C, n) of one drive, `mask` (n,) of samples that count, `coordinates` (n,) each, step [s]."""

    channels: tuple[str, ...]
    residual: np.ndarray
    mask: np.ndarray
    coordinates: Mapping[str, np.ndarray]
    dt: float


def named_columns(r: Residuals, vehicle: Vehicle) -> dict[str, np.ndarray]:
    """What one unit of each effect's first parameter does to the residual: name -> (C, n).

    Channels: accelerometer against torque, accelerometer against wheels, speed of each wheel against the reference.
    """
    v, a, torque, t = (r.coordinates[n] for n in ("v_x", "a_x", "torque", "t"))
    m, radius = vehicle.mass, vehicle.r_e_r
    q = vehicle.air_density * v / m
    late = np.gradient(a, r.dt)
    share = {w: _share(vehicle, w) for w in WHEELS}
    force, kinematic = "force_balance", "kinematic"
    columns: dict[str, dict[str, np.ndarray]] = {
        "payload_mass": {force: -(a + G * vehicle.rolling_resistance) / m},
        "torque_gain": {force: torque / (radius * m)},
        "aero_drag": {force: -0.5 * q * v},
        "head_wind": {force: -q * vehicle.drag_area},
        "rolling_resistance": {force: np.full_like(v, -G)},
        "road_grade": {kinematic: np.full_like(v, G)},
        "tyre_warmup": {force: -G * vehicle.rolling_resistance * np.exp(-t / 600.0)},
        "cornering_drag": {force: -(r.coordinates.get("a_y", np.zeros_like(v)) ** 2)},
        "accelerometer_bias@a_x": {force: np.ones_like(v), kinematic: np.ones_like(v)},
        "accelerometer_gain@a_x": {force: a, kinematic: a},
        "accelerometer_drift@a_x": {force: t, kinematic: t},
        "signal_delay@a_x": {force: -late, kinematic: -late},
        "signal_delay@torque": {force: np.gradient(torque, r.dt) / (radius * m)},
        "signal_delay@v_x": {f"slip_{w}": a for w in WHEELS},
        "velocity_scale@v_x": {f"slip_{w}": -v for w in WHEELS},
        "tyre_radius": {f"slip_{w}": -v for w in WHEELS} | {kinematic: a, force: -torque / (radius * m)},
        "slip_stiffness": {f"slip_{w}": -v * share[w] * torque for w in WHEELS},
        "slip_stiffness_drift": {f"slip_{w}": -v * share[w] * torque * t for w in WHEELS},
    }
    for w in WHEELS:
        one = f"slip_{w}"
        columns[f"tyre_radius@{w}"] = {one: -v, kinematic: 0.25 * a}
        columns[f"tyre_radius_growth@{w}"] = {one: -(v**3)}
        columns[f"slip_stiffness@{w}"] = {one: -v * share[w] * torque}
    depth = r.coordinates.get("water_depth")
    if depth is not None and np.nanmax(depth) > 0.0:
        columns["water_drag"] = {force: -depth * v * v}
    out = {}
    for name, parts in columns.items():
        full = np.array([parts.get(c, np.zeros_like(v)) for c in r.channels])
        if np.nanmax(np.abs(full[:, r.mask]), initial=0.0) > 0.0:
            out[name] = full
    return out


def form_columns(r: Residuals) -> dict[str, np.ndarray]:
    """Hats over each coordinate in each mechanism, to let a rival describe what no effect has: `name|coordinate|k` -> (C, n)."""
    out = {}
    for name, channels in FORMS.items():
        at = np.array([[float(c in channels)] for c in r.channels])
        if not at.any():
            continue
        size = r.coordinates["v_x"] if name.startswith("slip") else 1.0  # a slip shows as a speed
        for coordinate, x in r.coordinates.items():
            good = r.mask & np.isfinite(x)
            knots = np.unique(np.quantile(x[good], np.linspace(0.0, 1.0, HATS))) if good.any() else np.zeros(0)
            for k in range(len(knots) if len(knots) > 2 else 0):
                hat = np.interp(np.nan_to_num(x), knots, np.eye(len(knots))[k])
                out[f"{name}|{coordinate}|{k}"] = at * (size * hat)
    return out


def _share(vehicle: Vehicle, wheel: str) -> float:
    """Slip of a wheel per newton metre of the car's torque, by its share of the torque."""
    if wheel not in vehicle.driven:
        return 0.0
    rear = {"rwd": 1.0, "fwd": 0.0}.get(vehicle.drivetrain, vehicle.torque_split_rear)
    own = 0.5 * (rear if wheel[0] == "r" else 1.0 - rear)
    slope = vehicle.slip_slope_r if wheel[0] == "r" else vehicle.slip_slope_f
    arm = vehicle.l_f if wheel[0] == "r" else vehicle.l_r
    load = 0.5 * vehicle.mass * G * arm / vehicle.wheelbase
    return own / (vehicle.arm(wheel) * load * slope)


def scales(r: Residuals) -> np.ndarray:
    """Spread of each channel (C, 1), by which a regression weighs it."""
    x = r.residual[:, r.mask]
    return np.maximum(np.nanstd(x, axis=1, keepdims=True), 1e-12)


def stacked(r: Residuals, columns: Mapping[str, np.ndarray], scale: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All channels of one moment after those of the last, each over its spread: rows (N, p) and target (N,).

    So that blocks of rows are stretches of time."""
    good = r.mask & np.isfinite(r.residual).all(axis=0)
    for x in columns.values():
        good = good & np.isfinite(x).all(axis=0)
    rows = np.column_stack([(x / scale)[:, good].T.ravel() for x in columns.values()])
    return rows, (r.residual / scale)[:, good].T.ravel()
