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
from aqualog.campaign.thin import STEP_S, Thinning
from aqualog.core.records import DriveResult, Event, FileFaults, FloatArray, Signals, Track
from aqualog.core.vehicle import Vehicle
from aqualog.detect.long import detect_long, present_in
from aqualog.detect.slip_slope import activation
from aqualog.detect.stream import ROWS, Settings, detect_drive

__all__ = ["REASONS", "STEP_S", "Measurement", "measure", "measure_long"]

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
    `minor_*` (detector active). Unknown values are null. `about` is JSON: findings and faults.
    """

    samples: pl.DataFrame
    about: Mapping[str, Any]


def measure(signals: Signals, vehicle: Vehicle, *, settings: Settings | None = None) -> Measurement:
    """Detect, and thin the signals that regressions over many drives need.

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
    present = [s for s in signals.symbols if signals.frame[s].null_count() < signals.frame.height]
    thinning = Thinning(vehicle, signals.dt)
    thinning.push({s: signals.array(s) for s in present}, *_seen(result))
    return _measurement(result, vehicle, thinning)


def measure_long(
    drive: LongDrive,
    vehicle: Vehicle,
    *,
    settings: Settings | None = None,
    faults: Sequence[FileFaults] = (),
    rows: int = ROWS,
) -> Measurement:
    """The same of a drive that is longer than memory, window by window: with the same samples, to the bit.

    Parameters
    ----------
    drive : LongDrive
    vehicle, settings
        As of `measure`.
    faults : sequence of FileFaults
        Data that the readers lost in the first pass.
    rows : int
        Of a window.

    Only the thinned samples are held as a whole: 3 MB of an hour.
    """
    present = present_in(drive, rows)
    thinning = Thinning(vehicle, drive.plan.grid.dt_ns * 1e-9)

    def keep(window: DriveResult) -> None:
        thinning.push({s: window.signals.array(s) for s in present}, *_seen(window))

    result = detect_long(drive, vehicle, settings=settings, faults=faults, rows=rows, keep=keep, present=present)
    return _measurement(result, vehicle, thinning)


def _seen(result: DriveResult) -> tuple[dict[str, FloatArray], tuple[Track, ...]]:
    f = {n: np.asarray(result.features[n].to_numpy(), dtype=np.float64) for n in result.features.columns}
    return f, result.tracks


def _measurement(result: DriveResult, vehicle: Vehicle, thinning: Thinning) -> Measurement:
    samples = thinning.finish()
    return Measurement(samples, _about(result, vehicle, thinning, samples))


def _about(result: DriveResult, vehicle: Vehicle, thinning: Thinning, samples: pl.DataFrame) -> dict[str, Any]:
    signals, quality = result.signals, result.signals.quality
    moving = samples["v_x"].drop_nulls()
    return {
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
        "distance_m": _plain(float(np.sum(moving.to_numpy(), dtype=np.float64)) * thinning.step_s),
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
