"""A drive's result as the JSON document of the contract, and as channels and events of a log."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

import numpy as np
import polars as pl

from aqualog import __version__
from aqualog.core.notation import SYMBOLS
from aqualog.core.records import DriveResult, Event, Margin, Remark, Signals, Track
from aqualog.features.names import feature_of
from aqualog.io.log_event import LogEvent
from aqualog.io.write_log import LogGroup
from aqualog.report.drive.judged import KIND_NAMES, episode_sentence
from aqualog.report.values import KMH, fields_of, plain
from aqualog.report.wording import detector_name, evidence_parts

__all__ = [
    "SCHEMA_VERSION", "document", "drive_remark_rows", "remark_rows", "result_events", "result_groups",
    "run_remark_rows", "signal_groups", "track_name",
]  # fmt: skip

SCHEMA_VERSION = 1
_EVENT = ("detector", "wheel", "side", "start_s", "end_s", "severity", "peak", "threshold", "evidence")
_SLOPE = (
    "place", "wheel", "slope", "slope_sd", "reference", "reference_from", "beta", "offset", "judged_s", "dropped_s",
    "seconds", "inactive",
)  # fmt: skip
_BAD = ("not_finite", "out_of_range", "invalid_code", "frozen", "joined")
_UNITS = {"(m/s^2)^2": "m^2/s^4", "0 or 1": "bool"}


def document(result: DriveResult, *, log: str) -> dict[str, Any]:
    """The JSON document of `detect`. NaN and infinities become null; floats keep 9 significant digits."""
    signals = result.signals
    quality = signals.quality
    return {
        "schema_version": SCHEMA_VERSION,
        "tool_version": __version__,
        "log": log,
        "files": list(signals.files),
        "start_time": _start(signals.start_ns),
        "duration_s": plain(signals.duration_s),
        "sample_rate_hz": plain(1e9 / signals.step_ns),
        "vehicle": result.vehicle_name,
        "signals": {name: _signal(signals, name) for name in signals.symbols},
        **result.judgement.document(),
        "margin": _margin(result.margin),
        "events": [fields_of(e, *_EVENT) for e in result.events],
        "unavailable": [fields_of(u, "detector", "missing") for u in result.unavailable],
        "limited": [fields_of(u, "detector", "missing") for u in result.limited],
        "slip_slope": [
            {**fields_of(s, *_SLOPE[:8]), "changes": s.alarms, **fields_of(s, *_SLOPE[8:])} for s in result.slopes
        ],
        "quality": {
            **fields_of(quality, "dropped_samples", "time_jumps", "truncated", "unfinalised", "frozen_samples"),
            **fields_of(quality.faults, *quality.faults.KINDS, "first_s"),
            "notes": [*quality.notes, *result.notes],
        },
        "checks": remark_rows(result.checks),
    }


def _margin(margin: Margin | None) -> dict[str, Any] | None:
    if margin is None:
        return None
    return {
        "least_kmh": plain(KMH * margin.least), "ci90": [plain(KMH * x) for x in margin.ci90],
        "at_s": plain(margin.at_s), "warned_s": plain(margin.warned_s),
    }  # fmt: skip


def remark_rows(remarks: Sequence[Remark]) -> list[dict[str, Any]]:
    """What does not fit among the signals, for JSON."""
    fields = ("kind", "signals", "what", "advice", "lines", "value")
    return [fields_of(r, *fields, value_ci95="ci95") for r in remarks]


def drive_remark_rows(found: Sequence[tuple[str, Remark]]) -> list[dict[str, Any]]:
    """The same for several drives, by name."""
    return run_remark_rows([((name,), remark) for name, remark in found])


def run_remark_rows(found: Sequence[tuple[Sequence[str], Remark]]) -> list[dict[str, Any]]:
    """The same for the runs of a campaign: a remark once, `drive` the first log that has it, `logs` all of them."""
    return [{"drive": logs[0], "logs": list(logs), **remark_rows([remark])[0]} for logs, remark in found]


def _start(start_ns: int | None) -> str | None:
    if start_ns is None:
        return None
    second, rest = divmod(start_ns, 10**9)
    return f"{datetime.fromtimestamp(second, UTC):%Y-%m-%dT%H:%M:%S}.{rest:09d}Z"


def _signal(signals: Signals, name: str) -> dict[str, Any]:
    origin, unit = signals.origins.get(name), SYMBOLS[name].unit
    if origin is None:
        return {"channel": name, "unit": unit, "rate_hz": plain(1e9 / signals.step_ns)}
    return {
        **fields_of(origin, "channel", "file"),
        "unit": unit,
        "source_unit": origin.unit,
        **fields_of(origin, "rate_hz", "missing_fraction", "samples", *_BAD),
    }


def signal_groups(signals: Signals) -> list[LogGroup]:
    """The canonical signals as channels."""
    columns = {s: (SYMBOLS[s].unit, SYMBOLS[s].meaning, signals.array(s)) for s in signals.symbols}
    return [LogGroup("signals", columns)]


def result_groups(result: DriveResult, *, features: bool = False) -> list[LogGroup]:
    """Canonical signals, features, statistics and detection bits as channels of groups.

    Of the features the distance to full aquaplaning alone, on request all.
    """
    statistics = {
        track_name(t): (
            _UNITS.get(t.unit, t.unit),
            f"statistic of {t.detector}, threshold {t.threshold:g} {t.unit}",
            t.statistic,
        )
        for t in result.tracks
    }
    bits = {
        f"{track_name(t)}_bit": ("bool", f"detection bit of {t.detector}", t.active.astype(np.float64))
        for t in result.tracks
    }
    known = {n: feature_of(n) for n in result.features.columns if features or n.startswith("aquaplaning_margin")}
    looked_at = {
        n: (_UNITS.get(f.unit, f.unit), f.meaning, result.features[n].cast(pl.Float64).to_numpy())
        for n, f in known.items()
        if f is not None and n not in SYMBOLS
    }
    own = [*signal_groups(result.signals), LogGroup("features", looked_at)]
    groups = [*own, LogGroup("statistics", statistics), LogGroup("detections", bits)]
    return [g for g in groups if g.columns]


def result_events(result: DriveResult) -> list[LogEvent]:
    """Episodes, then events, as spans of a log in the order of the document.

    The property `kind` is that of the episode, or `event`.
    """
    episodes = [
        _span(KIND_NAMES[e.kind].capitalize(), episode_sentence(e), e.document()) for e in result.judgement.episodes
    ]
    return [*episodes, *map(_log_event, result.events)]


def _log_event(event: Event) -> LogEvent:
    place = event.wheel.upper() if event.wheel else event.side
    fields = fields_of(event, *_EVENT)
    evidence = fields.pop("evidence")
    name = " ".join(filter(None, (detector_name(event.detector), place)))
    return _span(
        name, "; ".join((event.severity, *evidence_parts(event.evidence))), {"kind": "event", **fields, **evidence}
    )


def _span(name: str, text: str, properties: Mapping[str, Any]) -> LogEvent:
    begin, end = (round(properties[n] * 1e9) for n in ("start_s", "end_s"))
    plain_words = {k: v if isinstance(v, str) else json.dumps(v) for k, v in properties.items() if v is not None}
    return LogEvent(name, begin, end, text, plain_words)


def track_name(track: Track) -> str:
    """`minor_spin_down_fr`, or `slip_slope_drop_left` for a side; never the name of a signal."""
    place = track.wheel or track.side
    name = f"{track.detector}_{place}" if place else track.detector
    return f"{track.detector}_cusum_{place}" if name in SYMBOLS else name
