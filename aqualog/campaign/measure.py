"""One drive into its stored result: events, and samples thinned to ten a second."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl

from aqualog import __version__
from aqualog.align.windows import LongDrive
from aqualog.campaign.full_rate import FullRate
from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, DriveResult, Event, FileFaults, FloatArray, Remark, Signals, Track
from aqualog.core.vehicle import Vehicle
from aqualog.detect.braking import HOLD, BrakeWatch
from aqualog.detect.detector import any_wheel
from aqualog.detect.long import detect_long, present_in
from aqualog.detect.slip_slope import activation
from aqualog.detect.slip_slope.direct import SMOOTHING
from aqualog.detect.slip_slope.direct_inputs import (
    LIMITS,
    accelerometer_traction,
    reference_of,
    smoothed,
    torque_traction,
)
from aqualog.detect.stream import ROWS, Settings, detect_drive
from aqualog.evaluate.labels import joined, spans_of
from aqualog.physics.differential import differential_slip
from aqualog.physics.slip import wheel_slip

__all__ = ["REASONS", "STEP_S", "Measurement", "Thinning", "measure", "measure_long"]

SCHEMA_VERSION = 1
REASONS = activation.REASONS
"""Reason why regressions skip a sample, by its code; 0 is usable."""


@dataclass(frozen=True, slots=True)
class Measurement:
    """The stored result of one drive.

    `samples` has a row per step: `t` [s], the middle of the step from the log's first sample; `v_x` [m/s]; `a_x`
    [m/s²] kinematic; `a_over_v` [1/s]; `delta_a_x` [m/s²] (2.9), mean over the step, without corrections; `reason`
    (index into `REASONS`); `on_water` where the log has it; per wheel `slip_*` [-] (3.13, `about["slip_against"]` names
    the reference), `slip_min_*`, `slip_max_*` [-] extremes of rim against car with radii learnt, `mu_*` [-], `spin_*`,
    `minor_*` (detector active); `v_full` with `v_full_low`, `v_full_high` [m/s], the speed of full aquaplaning that the
    margin expects, and its 90 % interval, where water is probable. Unknown values are null. `about` is JSON: findings
    and faults.
    `full`: samples at the log's own rate around its episodes, see `FullRate`; None without any.
    """

    samples: pl.DataFrame
    about: Mapping[str, Any]
    full: pl.DataFrame | None = None


def measure(signals: Signals, vehicle: Vehicle, *, settings: Settings | None = None) -> Measurement:
    """Detect, and thin the signals that regressions over many drives need. `vehicle` has the run's load.

    Slip and traction are centred means over 0.3 s, without delay against each other, as in `slip_slope.direct`;
    neighbouring samples of 0.1 s share two thirds of theirs.

    Thesis: section 2.3 with Eq. (3.13), (2.4), (2.9).
    """
    result = detect_drive(signals, vehicle, settings=settings)
    present = [s for s in signals.symbols if signals.frame[s].null_count() < signals.frame.height]
    thinning, full = Thinning(vehicle, signals.dt), FullRate(signals.dt)
    seen = _seen(result)
    thinning.push({s: signals.array(s) for s in present}, *seen)
    full.push(*seen)
    return _measured(result, vehicle, thinning, full)


def measure_long(
    drive: LongDrive, vehicle: Vehicle, *, settings: Settings | None = None, faults: Sequence[FileFaults] = (),
    rows: int = ROWS,
) -> Measurement:  # fmt: skip
    """The same of a drive that is longer than memory, in windows of so many rows: with the same samples, to the bit.

    `faults`: data that the readers lost in the first pass. Only the thinned samples are held whole: 3 MB of an hour.
    """
    present = present_in(drive, rows)
    dt = drive.plan.grid.dt_ns * 1e-9
    thinning, full = Thinning(vehicle, dt), FullRate(dt)

    def keep(window: DriveResult) -> None:
        seen = _seen(window)
        thinning.push({s: window.signals.array(s) for s in present}, *seen)
        full.push(*seen)

    result = detect_long(drive, vehicle, settings=settings, faults=faults, rows=rows, keep=keep, present=present)
    return _measured(result, vehicle, thinning, full)


def _seen(result: DriveResult) -> tuple[dict[str, FloatArray], tuple[Track, ...]]:
    f = {n: np.asarray(result.features[n].to_numpy(), dtype=np.float64) for n in result.features.columns}
    return f, result.tracks


def _measured(result: DriveResult, vehicle: Vehicle, thinning: Thinning, full: FullRate) -> Measurement:
    samples = thinning.finish()
    signals, quality = result.signals, result.signals.quality
    moving = samples["v_x"].drop_nulls()
    about = {
        "schema_version": SCHEMA_VERSION,
        "tool_version": __version__,
        "files": list(signals.files),
        "start_ns": signals.start_ns,
        "duration_s": round(signals.rows * (signals.step_ns * 1e-9), 6),
        "sample_rate_hz": round(1e9 / signals.step_ns, 6),
        "vehicle": vehicle.name,
        "signals": list(signals.symbols),
        "slip_against": thinning.against,
        "traction": thinning.traction,
        "v_min": _plain(moving.min()),
        "v_max": _plain(moving.max()),
        "wet_s": _wet(samples),
        "distance_m": _plain(float(np.sum(moving.to_numpy(), dtype=np.float64)) * thinning.step_s),
        **result.judgement.document(),
        "events": [_event(e) for e in result.events],
        "unavailable": {u.detector: list(u.missing) for u in result.unavailable},
        "limited": {u.detector: list(u.missing) for u in result.limited},
        "quality": {
            "dropped_samples": quality.dropped_samples,
            "time_jumps": quality.time_jumps,
            "truncated": quality.truncated,
            "unfinalised": quality.unfinalised,
            "lost_in_files": quality.lost_in_files,
            **{n: getattr(quality.faults, n) for n in type(quality.faults).KINDS},
        },
        "notes": [*quality.notes, *result.notes],
        "checks": [_remark(r) for r in result.checks],
    }
    return Measurement(samples, about, full.finish(result.judgement))


def _wet(samples: pl.DataFrame) -> list[list[float]] | None:
    """Stretches on water by the log's `on_water` [s]; None without such a signal."""
    if "on_water" not in samples.columns:
        return None
    wet = samples["on_water"].fill_null(0.0).to_numpy() > 0.5
    t = samples["t"].to_numpy()
    half = 0.5 * (t[1] - t[0]) if t.size > 1 else 0.0
    return [[_plain(x) for x in s] for s in joined(spans_of(t - half, wet), 0.5)]


def _remark(r: Remark) -> dict[str, Any]:
    low, high = (_plain(x) for x in r.ci95)
    return {
        "kind": r.kind, "signals": list(r.signals), "what": r.what, "advice": r.advice, "lines": list(r.lines),
        "value": _plain(r.value), "value_ci95": [low, high],
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
    """A value for JSON; numbers with nine digits, null for NaN and infinities."""
    if isinstance(x, float | np.floating):
        return float(f"{float(x):.9g}") if math.isfinite(x) else None
    if isinstance(x, np.integer):
        return int(x)
    return [_plain(v) for v in x] if isinstance(x, list | tuple) else x


STEP_S = 0.1  # of the samples kept; slower signals keep their own step
V_LEAST = 3.0  # [m/s] below, a wheel's deviation from the car is not a slip worth keeping

_SPINS = ("spin_down", "spin_up")
_MINOR = ("minor_spin_down",)
# signals of a drive that the samples use
_SIGNALS = ("v_x", "a_x", "on_water", "water_depth_left", "water_depth_right", *(f"torque_{w}" for w in WHEELS))
_FEATURES = (
    "v_x_hat", "a_kin", "a_kin_slow", "a_y_slow", "yaw_rate_slow", "brake_pressure", "delta_a_x",
    "full_speed_expected", "aquaplaning_margin_low", "aquaplaning_margin_high",
    *(f"{n}_{w}" for n in ("v_line", "v_w_delta") for w in WHEELS),
)  # fmt: skip

_Arrays = dict[str, FloatArray]
_Bits = dict[str, BoolArray]


class Thinning:
    """Samples of one drive; the columns are those of `Measurement`.

    Parameters
    ----------
    vehicle : Vehicle
        With the run's load.
    dt : float
        Sample time of the drive. [s]

    A sample is complete once the data of its means are there: half of a mean and a step of a gradient after it.
    `against` names the reference of slip and `traction` the source of traction; both are fixed from the first samples
    on.
    """

    def __init__(self, vehicle: Vehicle, dt: float) -> None:
        self.against = self.traction = "none"
        self._vehicle = vehicle
        self._dt = dt
        self._width = max(1, 2 * round(0.5 * (SMOOTHING / dt - 1.0)) + 1)
        self._step = max(1, round(STEP_S / dt))
        # rows needed before a sample: half a mean and a gradient, and how long a brake counts after its release;
        # a whole mean at least, since a shorter piece gives no value
        self._back = self._width + max(1, round(HOLD / dt)) + 1
        self._start = 0  # row of the drive at which the held data begin
        self._done = 0  # samples put out
        self._columns: _Arrays = {}
        self._features: _Arrays = {}
        self._bits: _Bits = {}
        self._made: dict[str, list[pl.Series]] = {}

    @property
    def step_s(self) -> float:
        """From sample to sample. [s]"""
        return self._step * self._dt

    def push(
        self, columns: Mapping[str, FloatArray], features: Mapping[str, FloatArray], tracks: Sequence[Track]
    ) -> None:
        """Take the next piece: signals (n,) that the drive has, the same ones in each piece, features (n,), tracks."""
        self._columns = _joined(self._columns, {s: columns[s] for s in _SIGNALS if s in columns})
        self._features = _joined(self._features, {f: features[f] for f in _FEATURES if f in features})
        self._bits = _joined(self._bits, _spins(tracks, features["v_x_hat"].size))
        end = self._start + self._features["v_x_hat"].size
        # the middle of the last one has the neighbours of its mean and of the next mean, for the gradient
        ready = (end - self._width // 2 - 2 - self._step // 2) // self._step + 1
        self._put_out(min(ready, end // self._step))

    def finish(self) -> pl.DataFrame:
        """All samples of the drive."""
        self._put_out((self._start + self._features["v_x_hat"].size) // self._step, is_last=True)
        # column by column, so that only one of them is there twice
        return pl.DataFrame([pl.concat(self._made.pop(name), rechunk=True) for name in list(self._made)])

    def _put_out(self, ready: int, *, is_last: bool = False) -> None:
        if ready <= self._done and (not is_last or self._made):
            return
        for column in self._columns_of(np.arange(self._done, max(ready, self._done))):
            self._made.setdefault(column.name, []).append(column)
        self._done = max(ready, self._done)
        start = max(self._done * self._step - self._back, 0) // self._step * self._step
        gone, self._start = max(start - self._start, 0), max(start, self._start)
        self._columns = {s: x[gone:].copy() for s, x in self._columns.items()}
        self._features = {s: x[gone:].copy() for s, x in self._features.items()}
        self._bits = {s: x[gone:].copy() for s, x in self._bits.items()}

    def _columns_of(self, samples: Any) -> list[pl.Series]:
        """Samples (m,) by their number in the drive."""
        vehicle, dt, step, width = self._vehicle, self._dt, self._step, self._width
        columns, f = self._columns, self._features
        n, rows = f["v_x_hat"].size, samples.size
        middle = samples * step + step // 2 - self._start
        first = self._done * step - self._start
        span = slice(first, first + rows * step)
        smooth = {k: smoothed(x, width) for k, x in f.items() if k.startswith("v_line_")}
        mu, self.traction = _traction(f | smooth, columns, vehicle, dt, width)
        slip, self.against, a_over_v = _slips(f | smooth, columns, vehicle, dt, width)
        braking = BrakeWatch(vehicle, dt).push(f, columns)
        reason = activation.inactive_reason(
            v_x=f["v_x_hat"], a_x=f["a_kin_slow"], a_y=f["a_y_slow"], yaw_rate=f["yaw_rate_slow"],
            a_w_delta=np.zeros(n), is_braking=any_wheel(braking), limits=LIMITS,
        )  # fmt: skip
        out: dict[str, FloatArray | BoolArray] = {
            "t": np.round((samples * step + step // 2) * dt, 6),
            "v_x": smoothed(f["v_x_hat"], width)[middle],
            "a_x": smoothed(f["a_kin"], width)[middle],
            "a_over_v": a_over_v[middle],
            "delta_a_x": _means(f["delta_a_x"][span], step) if "delta_a_x" in f else np.full(rows, np.nan),
        }
        if "full_speed_expected" in f:
            out["v_full"] = f["full_speed_expected"][middle]
            for end in ("low", "high"):
                out[f"v_full_{end}"] = (f["v_x_hat"] + f[f"aquaplaning_margin_{end}"])[middle]
        for name in ("on_water", "water_depth_left", "water_depth_right"):
            if name in columns:
                out[name] = _means(columns[name][span], step)
        for w in WHEELS:
            away = np.full(n, np.nan)
            if f"v_w_delta_{w}" in f:
                fast = f["v_x_hat"] > V_LEAST
                away[fast] = f[f"v_w_delta_{w}"][fast] / f["v_x_hat"][fast]
            out[f"slip_{w}"] = slip[w][middle]
            parts = away[span].reshape(-1, step)
            out[f"slip_min_{w}"], out[f"slip_max_{w}"] = np.fmin.reduce(parts, axis=1), np.fmax.reduce(parts, axis=1)
            out[f"mu_{w}"] = mu[w][middle]
            out[f"spin_{w}"] = _any(self._bits[f"spin_{w}"][span], step)
            out[f"minor_{w}"] = _any(self._bits[f"minor_{w}"][span], step)
        return [*(_series(k, x) for k, x in out.items()), pl.Series("reason", reason[middle].astype(np.uint8))]


def _joined(held: dict[str, Any], new: dict[str, Any]) -> dict[str, Any]:
    return {k: np.concatenate([held[k], x]) for k, x in new.items()} if held else new


def _spins(tracks: Sequence[Track], n: int) -> _Bits:
    """Detection bits of each wheel (n,)."""
    none = np.zeros(n, dtype=bool)
    return {
        f"{name}_{w}": np.any([none, *(t.active for t in tracks if t.detector in of and t.wheel == w)], axis=0)
        for w in WHEELS
        for name, of in (("spin", _SPINS), ("minor", _MINOR))
    }


def _series(name: str, x: FloatArray | BoolArray) -> pl.Series:
    """Single precision is finer than any sensor; time is not a sensor."""
    if x.dtype == np.bool_:
        return pl.Series(name, x)
    return pl.Series(name, x, dtype=pl.Float64 if name == "t" else pl.Float32, nan_to_null=True)


def _traction(
    f: Mapping[str, FloatArray], columns: Mapping[str, FloatArray], vehicle: Vehicle, dt: float, width: int
) -> tuple[dict[str, FloatArray], str]:
    """Traction of each wheel, and its source: torque, accelerometer, or none."""
    n = f["v_x_hat"].size
    out = {w: np.full(n, np.nan) for w in WHEELS}
    if all(f"torque_{w}" in columns and f"v_line_{w}" in f for w in vehicle.driving):
        out |= {k.removeprefix("mu_"): x for k, x in torque_traction(f, columns, vehicle, dt, width).items()}
        return out, "torque"
    if vehicle.knows_drivetrain and vehicle.drivetrain != "awd" and "a_x" in columns:
        found = accelerometer_traction(f, columns["a_x"], vehicle)
        out |= {k.removeprefix("mu_"): smoothed(x, width) for k, x in found.items()}
        return out, "accelerometer"
    return out, "none"


def _slips(
    f: Mapping[str, FloatArray], columns: Mapping[str, FloatArray], vehicle: Vehicle, dt: float, width: int
) -> tuple[dict[str, FloatArray], str, FloatArray]:
    """Slip of each wheel, its reference, and the slip added by one second of delay of that reference."""
    n = f["v_x_hat"].size
    out = {w: np.full(n, np.nan) for w in WHEELS}
    wheels = [w for w in WHEELS if f"v_line_{w}" in f]
    if not wheels:
        return out, "none", np.full(n, np.nan)
    if "v_x" in columns:
        v = smoothed(columns["v_x"], width)
        for w in wheels:
            out[w] = wheel_slip(f[f"v_line_{w}"] / vehicle.r_e(w), v, vehicle.r_e(w))
        if vehicle.knows_drivetrain and all(w in wheels for w in vehicle.driven):
            return out, "v_x", reference_of(v, f, vehicle, dt, None).a_over_v
        return out, "v_x", np.full(n, np.nan)
    if not vehicle.knows_drivetrain or vehicle.drivetrain == "awd":
        return out, "none", np.full(n, np.nan)
    for w in (w for w in vehicle.driven if w in wheels):
        free = ("r" if w[0] == "f" else "f") + w[1]
        if free in wheels:
            out[w] = differential_slip(f[f"v_line_{w}"], f[f"v_line_{free}"])
    return out, "free wheel", np.zeros(n)


def _means(x: FloatArray, step: int) -> FloatArray:
    """Mean over each step; NaN where one of its samples is."""
    return np.asarray(x.reshape(-1, step).mean(axis=1))


def _any(bits: BoolArray, step: int) -> BoolArray:
    return np.asarray(bits.reshape(-1, step).any(axis=1))
