"""One drive into what a campaign keeps of it: events, and samples thinned to ten a second."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl

from aqualog import __version__
from aqualog.detect.slip_slope import activation
from aqualog.detect.slip_slope.direct import SMOOTHING
from aqualog.detect.slip_slope.direct_inputs import (
    LIMITS,
    accelerometer_traction,
    braking_of_wheels,
    reference_of,
    smoothed,
    torque_traction,
)
from aqualog.detect.stream import Settings, detect_drive
from aqualog.notation import WHEELS
from aqualog.physics.differential import differential_slip
from aqualog.physics.slip import wheel_slip
from aqualog.types import BoolArray, DriveResult, Event, FloatArray, Signals
from aqualog.vehicle import Vehicle

__all__ = ["REASONS", "STEP_S", "Measurement", "measure"]

SCHEMA_VERSION = 1
STEP_S = 0.1  # of the samples kept; slower signals keep their own step
V_LEAST = 3.0  # [m/s] below, a wheel's deviation from the car is not a slip worth keeping
REASONS = activation.REASONS
"""Why a sample is of no use for regressions, by its code; 0 is usable."""


@dataclass(frozen=True, slots=True)
class Measurement:
    """What is kept of one drive.

    `samples` has a row per step: `t` [s], the middle of the step from the log's first sample; `v_x` [m/s]; `a_x`
    [m/s^2] kinematic; `a_over_v` [1/s]; `delta_a_x` [m/s^2] (2.9), mean over the step, nothing taken off; `reason`
    (index into `REASONS`); `on_water` where the log has it; per wheel `slip_*` [-] (3.13, `about["slip_against"]` says
    against what), `slip_min_*`, `slip_max_*` [-] extremes of rim against car with radii learnt, `mu_*` [-],
    `spin_*`, `minor_*` (detector active). Unknown is null. `about` is JSON: what was found and what was wrong.
    """

    samples: pl.DataFrame
    about: Mapping[str, Any]


def measure(signals: Signals, vehicle: Vehicle, *, settings: Settings | None = None) -> Measurement:
    """Detect, and thin out what regressions over many drives need.

    Parameters
    ----------
    signals : Signals
    vehicle : Vehicle
        With the run's load.
    settings : Settings, optional

    Slip and traction are centred means over 0.3 s, without delay against each other, as in `slip_slope.direct`;
    neighbouring samples of 0.1 s share two thirds of theirs.

    Thesis: section 2.3 with Eq. (3.13), (2.4), (2.9).
    """
    result = detect_drive(signals, vehicle, settings=settings)
    dt = signals.dt
    present = [s for s in signals.symbols if signals.frame[s].null_count() < signals.frame.height]
    columns = {s: signals.array(s) for s in present}
    f = {n: np.asarray(result.features[n].to_numpy(), dtype=np.float64) for n in result.features.columns}
    width = max(1, 2 * round(0.5 * (SMOOTHING / dt - 1.0)) + 1)
    step = max(1, round(STEP_S / dt))
    braking = braking_of_wheels(f, columns, vehicle, dt)
    n = signals.frame.height
    rows = n // step
    middle = np.arange(rows) * step + step // 2
    smooth = {k: smoothed(x, width) for k, x in f.items() if k.startswith("v_line_")}
    mu, traction = _traction(f | smooth, columns, vehicle, dt, width)
    slip, against, a_over_v = _slips(f | smooth, columns, vehicle, dt, width)
    reason = activation.inactive_reason(
        v_x=f["v_x_hat"], a_x=f["a_kin_slow"], a_y=f["a_y_slow"], yaw_rate=f["yaw_rate_slow"],
        a_w_delta=np.zeros(n), is_braking=np.any(list(braking.values()), axis=0), limits=LIMITS,
    )  # fmt: skip
    out: dict[str, FloatArray | BoolArray] = {
        "t": np.round(middle * dt, 6),
        "v_x": smoothed(f["v_x_hat"], width)[middle],
        "a_x": smoothed(f["a_kin"], width)[middle],
        "a_over_v": a_over_v[middle],
        "delta_a_x": _means(f["delta_a_x"], step, rows) if "delta_a_x" in f else np.full(rows, np.nan),
    }
    if "on_water" in columns:
        out["on_water"] = _means(columns["on_water"], step, rows)
    for side in ("left", "right"):
        if f"water_depth_{side}" in columns:
            out[f"water_depth_{side}"] = _means(columns[f"water_depth_{side}"], step, rows)
    active = {d: _bits(result, d) for d in ("spin_down", "spin_up", "minor_spin_down")}
    for w in WHEELS:
        away = np.full(n, np.nan)
        if f"v_w_delta_{w}" in f:
            fast = f["v_x_hat"] > V_LEAST
            away[fast] = f[f"v_w_delta_{w}"][fast] / f["v_x_hat"][fast]
        out[f"slip_{w}"] = slip[w][middle]
        out[f"slip_min_{w}"], out[f"slip_max_{w}"] = _extremes(away, step, rows)
        out[f"mu_{w}"] = mu[w][middle]
        spins = [x[w] for d, x in active.items() if d != "minor_spin_down" and w in x]
        out[f"spin_{w}"] = _any(np.any([np.zeros(n, dtype=bool), *spins], axis=0), step, rows)
        out[f"minor_{w}"] = _any(active["minor_spin_down"].get(w, np.zeros(n, dtype=bool)), step, rows)
    frame = pl.DataFrame(
        [_series(k, x) for k, x in out.items()] + [pl.Series("reason", reason[middle].astype(np.uint8))]
    )
    return Measurement(frame, _about(result, vehicle, against, traction, frame, step * dt))


def _series(name: str, x: FloatArray | BoolArray) -> pl.Series:
    """Single precision is finer than any sensor; time is not a sensor."""
    if x.dtype == np.bool_:
        return pl.Series(name, x)
    return pl.Series(name, x, dtype=pl.Float64 if name == "t" else pl.Float32, nan_to_null=True)


def _traction(
    f: Mapping[str, FloatArray], columns: Mapping[str, FloatArray], vehicle: Vehicle, dt: float, width: int
) -> tuple[dict[str, FloatArray], str]:
    """Traction of each wheel, and from what: torque, accelerometer, or none."""
    n = f["v_x_hat"].size
    out = {w: np.full(n, np.nan) for w in WHEELS}
    if all(f"torque_{w}" in columns and f"v_line_{w}" in f for w in vehicle.driven):
        out |= {k.removeprefix("mu_"): x for k, x in torque_traction(f, columns, vehicle, dt, width).items()}
        return out, "torque"
    if vehicle.drivetrain != "awd" and "a_x" in columns:
        found = accelerometer_traction(f, columns["a_x"], vehicle)
        out |= {k.removeprefix("mu_"): smoothed(x, width) for k, x in found.items()}
        return out, "accelerometer"
    return out, "none"


def _slips(
    f: Mapping[str, FloatArray], columns: Mapping[str, FloatArray], vehicle: Vehicle, dt: float, width: int
) -> tuple[dict[str, FloatArray], str, FloatArray]:
    """Slip of each wheel, what it is against, and what a second of delay of that reference would add to it."""
    n = f["v_x_hat"].size
    out = {w: np.full(n, np.nan) for w in WHEELS}
    wheels = [w for w in WHEELS if f"v_line_{w}" in f]
    if not wheels:
        return out, "none", np.full(n, np.nan)
    if "v_x" in columns:
        v = smoothed(columns["v_x"], width)
        for w in wheels:
            out[w] = wheel_slip(f[f"v_line_{w}"] / vehicle.r_e(w), v, vehicle.r_e(w))
        if all(w in wheels for w in vehicle.driven):
            return out, "v_x", reference_of(v, f, vehicle, dt, None).a_over_v
        return out, "v_x", np.full(n, np.nan)
    if vehicle.drivetrain == "awd":
        return out, "none", np.full(n, np.nan)
    for w in (w for w in vehicle.driven if w in wheels):
        free = ("r" if w[0] == "f" else "f") + w[1]
        if free in wheels:
            out[w] = differential_slip(f[f"v_line_{w}"], f[f"v_line_{free}"])
    return out, "free wheel", np.zeros(n)


def _bits(result: DriveResult, detector: str) -> dict[str, BoolArray]:
    return {t.wheel: t.active for t in result.tracks if t.detector == detector and t.wheel}


def _steps(x: FloatArray | BoolArray, step: int, rows: int) -> Any:
    return x[: rows * step].reshape(rows, step)


def _means(x: FloatArray, step: int, rows: int) -> FloatArray:
    """Mean over each step; NaN where one of its samples is."""
    mean: FloatArray = _steps(x, step, rows).mean(axis=1)
    return mean


def _extremes(x: FloatArray, step: int, rows: int) -> tuple[FloatArray, FloatArray]:
    parts = _steps(x, step, rows)
    return np.fmin.reduce(parts, axis=1), np.fmax.reduce(parts, axis=1)


def _any(bits: BoolArray, step: int, rows: int) -> BoolArray:
    found: BoolArray = _steps(bits, step, rows).any(axis=1)
    return found


def _about(
    result: DriveResult, vehicle: Vehicle, against: str, traction: str, samples: pl.DataFrame, step_s: float
) -> dict[str, Any]:
    signals, quality = result.signals, result.signals.quality
    moving = samples["v_x"].drop_nulls()
    return {
        "schema_version": SCHEMA_VERSION,
        "tool_version": __version__,
        "files": list(signals.files),
        "start_ns": signals.start_ns,
        "duration_s": round(signals.frame.height * signals.dt, 6),
        "sample_rate_hz": round(1e9 / signals.dt_ns, 6),
        "vehicle": vehicle.name,
        "signals": list(signals.symbols),
        "slip_against": against,
        "traction": traction,
        "v_min": _plain(moving.min()),
        "v_max": _plain(moving.max()),
        "distance_m": _plain(float(np.sum(moving.to_numpy(), dtype=np.float64)) * step_s),
        "events": [_event(e) for e in result.events],
        "unavailable": {u.detector: list(u.missing) for u in result.unavailable},
        "limited": {u.detector: list(u.missing) for u in result.limited},
        "quality": {
            "dropped_samples": quality.dropped_samples,
            "time_jumps": quality.time_jumps,
            "truncated": quality.truncated,
            "lost_in_files": quality.lost_in_files,
            **{n: getattr(quality.faults, n) for n in type(quality.faults).__slots__},
        },
        "notes": [*quality.notes, *result.notes],
    }  # fmt: skip


def _event(e: Event) -> dict[str, Any]:
    return {
        "detector": e.detector,
        "wheel": e.wheel,
        "side": e.side,
        "severity": e.severity,
        **{n: _plain(getattr(e, n)) for n in ("start_s", "end_s", "peak", "threshold")},
        "evidence": {k: _plain(v) for k, v in e.evidence.items()},
    }


def _plain(x: Any) -> Any:
    """A value as JSON knows it; numbers with nine digits, null for what is none."""
    if isinstance(x, float | np.floating):
        return float(f"{float(x):.9g}") if math.isfinite(x) else None
    if isinstance(x, np.integer):
        return int(x)
    return [_plain(v) for v in x] if isinstance(x, list | tuple) else x
