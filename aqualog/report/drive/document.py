"""A drive's result as the JSON document of the contract, and as channels of a log."""

from __future__ import annotations

import math
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

import numpy as np

from aqualog import __version__
from aqualog.core.notation import SYMBOLS
from aqualog.core.records import DriveResult, Event, Signals, SlopeSummary, Track, Unavailable
from aqualog.io.write_log import LogGroup

__all__ = ["SCHEMA_VERSION", "document", "result_groups", "signal_groups", "track_name"]

SCHEMA_VERSION = 1


def document(result: DriveResult, *, log: str) -> dict[str, Any]:
    """The JSON document of `detect`. NaN and infinities become null; floats keep 9 significant digits."""
    signals = result.signals
    quality = signals.quality
    return {
        "schema_version": SCHEMA_VERSION,
        "tool_version": __version__,
        "log": log,
        "files": list(signals.files),
        "start_time": _start(signals),
        "duration_s": _number(signals.duration_s),
        "sample_rate_hz": _number(1e9 / signals.step_ns),
        "vehicle": result.vehicle_name,
        "signals": {name: _signal(signals, name) for name in signals.symbols},
        "events": [_event(e) for e in result.events],
        "unavailable": [_lacking(u) for u in result.unavailable],
        "limited": [_lacking(u) for u in result.limited],
        "slip_slope": [_slope(s) for s in result.slopes],
        "quality": {
            "dropped_samples": quality.dropped_samples,
            "time_jumps": quality.time_jumps,
            "truncated": quality.truncated,
            "unfinalised": quality.unfinalised,
            "frozen_samples": quality.frozen_samples,
            **{n: getattr(quality.faults, n) for n in type(quality.faults).KINDS},
            "first_s": {n: _number(s) for n, s in quality.faults.first_s.items()},
            "notes": [*quality.notes, *result.notes],
        },
    }


def _start(signals: Signals) -> str | None:
    if signals.start_ns is None:
        return None
    second, rest = divmod(signals.start_ns, 10**9)
    return f"{datetime.fromtimestamp(second, UTC):%Y-%m-%dT%H:%M:%S}.{rest:09d}Z"


def _number(x: float) -> float | None:
    return float(f"{x:.9g}") if math.isfinite(x) else None


def _value(x: Any) -> Any:
    return _number(x) if isinstance(x, float) else x


def _signal(signals: Signals, name: str) -> dict[str, Any]:
    origin = signals.origins.get(name)
    if origin is None:
        return {"channel": name, "unit": SYMBOLS[name].unit, "rate_hz": _number(1e9 / signals.step_ns)}
    return {
        "channel": origin.channel,
        "file": origin.file,
        "unit": SYMBOLS[name].unit,
        "source_unit": origin.unit,
        "rate_hz": _number(origin.rate_hz),
        "missing_fraction": _number(origin.missing_fraction),
        "samples": origin.samples,
        "not_finite": origin.not_finite,
        "out_of_range": origin.out_of_range,
        "invalid_code": origin.invalid_code,
        "frozen": origin.frozen,
    }


def _event(event: Event) -> dict[str, Any]:
    return {
        "detector": event.detector,
        "wheel": event.wheel,
        "side": event.side,
        "start_s": _number(event.start_s),
        "end_s": _number(event.end_s),
        "severity": event.severity,
        "peak": _number(event.peak),
        "threshold": _number(event.threshold),
        "evidence": _evidence(event.evidence),
    }


def _evidence(evidence: Mapping[str, Any]) -> dict[str, Any]:
    return {name: _value(value) for name, value in evidence.items()}


def _lacking(item: Unavailable) -> dict[str, Any]:
    return {"detector": item.detector, "missing": list(item.missing)}


def _slope(summary: SlopeSummary) -> dict[str, Any]:
    return {
        "place": summary.place,
        "wheel": summary.wheel,
        "slope": _number(summary.slope),
        "slope_sd": _number(summary.slope_sd),
        "reference": _number(summary.reference),
        "reference_from": summary.reference_from,
        "beta": None if summary.beta is None else _number(summary.beta),
        "offset": _number(summary.offset),
        "changes": summary.alarms,
        "judged_s": _number(summary.judged_s),
        "dropped_s": _number(summary.dropped_s),
        "seconds": {name: _number(s) for name, s in summary.seconds.items()},
        "inactive": {name: _number(s) for name, s in summary.inactive.items()},
    }


def signal_groups(signals: Signals) -> list[LogGroup]:
    """The canonical signals as channels."""
    columns = {s: (SYMBOLS[s].unit, SYMBOLS[s].meaning, signals.array(s)) for s in signals.symbols}
    return [LogGroup("signals", columns)]


def result_groups(result: DriveResult) -> list[LogGroup]:
    """Canonical signals, statistics and detection bits as channels of three groups."""
    statistics = {
        track_name(t): (_unit(t), f"statistic of {t.detector}, threshold {t.threshold:g} {t.unit}", t.statistic)
        for t in result.tracks
    }
    bits = {
        f"{track_name(t)}_bit": ("bool", f"detection bit of {t.detector}", t.active.astype(np.float64))
        for t in result.tracks
    }
    groups = [*signal_groups(result.signals), LogGroup("statistics", statistics), LogGroup("detections", bits)]
    return [g for g in groups if g.columns]


def track_name(track: Track) -> str:
    """`minor_spin_down_fr`, or `slip_slope_drop_left` for a side; never the name of a signal."""
    place = track.wheel or track.side
    name = f"{track.detector}_{place}" if place else track.detector
    return f"{track.detector}_cusum_{place}" if name in SYMBOLS else name


def _unit(track: Track) -> str:
    return {"(m/s^2)^2": "m^2/s^4"}.get(track.unit, track.unit)
