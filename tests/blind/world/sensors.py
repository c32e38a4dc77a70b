"""From what happened to what a logger saw: errors of the sensors, noise, and the table of signals."""

from __future__ import annotations

import numpy as np
import polars as pl

from aqualog.core.records import Origin, Quality, Signals

from .kernel import OUT
from .noise import gaps, levels, of_level, outliers, quantised
from .world import WHEELS, Errors, World

__all__ = ["LABELS", "MEASURED", "as_signals", "measure"]

DT = 0.01
OMEGAS, TORQUES = tuple(f"omega_{w}" for w in WHEELS), tuple(f"torque_{w}" for w in WHEELS)
MEASURED = ("v_x", "a_x", "a_y", "yaw_rate", "steer_angle", *OMEGAS, *TORQUES)
LABELS = ("water_depth_left", "water_depth_right", "on_water")


def measure(rows: np.ndarray, world: World, noise: str | None, seed: int) -> dict[str, np.ndarray]:
    """Measured signals (n,), NaN where a sample is missing; `noise` None: ideal sensors, but for the world's errors."""
    n = rows.shape[0]
    t = np.arange(n) * DT
    v_true = rows[:, OUT["v_x"]]
    rng = np.random.default_rng([seed, 31])
    level = levels(rng)
    common = _torque_share(noise, level, n, rng) if noise else np.zeros(n)
    columns = {}
    for name in MEASURED:
        x = _seen(rows, name, world.errors.get(name, Errors()), t, v_true, np.random.default_rng([seed, 33]))
        stem = name.split("_")[0] if name.startswith(("omega", "torque")) else name
        if noise:
            if stem == "torque":
                x = x * (1.0 + common)
            error = of_level(noise, level[stem], n, rng)
            if noise == "student" and stem in ("a_x", "omega", "v_x"):
                error = outliers(error, level[stem].rms, rng)
            x = quantised(name, x, error) if noise == "quantised" else x + error
        columns[name] = x
    if noise == "gaps":
        for name, missing in gaps(MEASURED, n, rng).items():
            columns[name] = np.where(missing, np.nan, columns[name])
    return columns


def _torque_share(noise, level, n, rng):
    """Relative error of all reported torques together."""
    share = of_level(noise, level["torque_share"], n, rng)
    return np.clip(share, -0.05, 0.05)


def _seen(rows, name, e, t, v_true, rng):
    x = rows[:, OUT[name]]
    if e.ring != 0.0:
        phase = rng.uniform(0.0, 2.0 * np.pi, 4)[OMEGAS.index(name)]
        x = x * (1.0 + e.ring * np.sin(rows[:, OUT[name.replace("omega", "angle")]] + phase))
    if e.ahead != 0.0:
        x = x - e.ahead * rows[:, OUT["yaw_rate"]] ** 2
    if e.speed_gain != 0.0:
        x = x * (1.0 + e.speed_gain * (v_true - 15.0))
    if e.delay != 0.0 or e.skew_ppm != 0.0:
        x = _shifted(x, t / (1.0 + e.skew_ppm * 1e-6) - e.delay)
    return e.gain * x + e.bias + e.drift * t


def _shifted(x, at):
    """Values at any times, a cubic through four samples (Catmull-Rom); held beyond the ends."""
    place = np.clip(at / DT, 0.0, x.size - 1.0)
    i = np.minimum(place.astype(np.intp), x.size - 2)
    u = place - i
    a, b, c, d = x[np.maximum(i - 1, 0)], x[i], x[i + 1], x[np.minimum(i + 2, x.size - 1)]
    return b + 0.5 * u * (c - a + u * (2.0 * a - 5.0 * b + 4.0 * c - d + u * (3.0 * (b - c) + d - a)))


def as_signals(
    columns: dict[str, np.ndarray], rows: np.ndarray, road, base: float, *, name: str, has_v_x: bool
) -> Signals:
    """The table of signals: measured columns, water labels of the undisturbed lane at the front axle."""
    n = rows.shape[0]
    s = rows[:, OUT["position"]]
    front = road.label[np.clip(np.rint(s / road.ds).astype(int), 0, road.label.shape[0] - 1)]
    rear = road.label[np.clip(np.rint((s - base) / road.ds).astype(int), 0, road.label.shape[0] - 1)]
    table = {"t": pl.Series(np.arange(n) * DT)}
    for symbol, x in columns.items():
        if symbol != "v_x" or has_v_x:
            table[symbol] = pl.Series(x).fill_nan(None)
    table["water_depth_left"], table["water_depth_right"] = pl.Series(front[:, 0].copy()), pl.Series(front[:, 1].copy())
    table["on_water"] = pl.Series((front.max(axis=1) > 0.0) | (rear.max(axis=1) > 0.0))
    frame = pl.DataFrame(table)
    origins = {
        c: Origin(c, c, name, "", 1.0 / DT, n, missing_fraction=frame[c].null_count() / n)
        for c in frame.columns if c != "t"
    }  # fmt: skip
    return Signals(frame, round(DT * 1e9), None, origins, Quality(), (name,))
