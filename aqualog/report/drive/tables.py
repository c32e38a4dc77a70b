"""A drive's result as rows of the page's tables. Nothing is escaped here; the template does that."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from aqualog.core.notation import SYMBOLS
from aqualog.core.records import DriveResult, Event, Origin, SlopeSummary, TimeFaults
from aqualog.report.theme import WHEEL_COLOURS
from aqualog.report.wording import detector_name, evidence_parts, number, place, pretty_unit, speed_kmh

__all__ = [
    "Cell", "detector_rows", "event_columns", "event_rows", "fault_columns", "fault_rows", "head_facts", "problems",
    "signal_rows", "slope_rows",
]  # fmt: skip

_FAULTS = {
    "duplicates": "same time twice", "back_steps": "steps back", "resets": "clock resets", "wraps": "wrapped counters",
    "pauses": "pauses", "drifts": "clocks that drift", "strays": "stray stamps",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Cell:
    """Text of a table cell, what to sort it by, and whether it is a number."""

    text: str
    key: float | str
    is_number: bool = False


def head_facts(result: DriveResult) -> list[tuple[str, str]]:
    """Label and value of what identifies the drive."""
    signals = result.signals
    facts = [
        ("Vehicle", result.vehicle_name),
        ("Duration", _duration(signals.duration_s)),
        ("Sample rate", f"{1e9 / signals.step_ns:g} Hz"),
        ("Signals", str(len(signals.symbols))),
    ]
    if signals.start_ns is not None:
        facts.append(("Start", _utc(signals.start_ns)))
    facts.append(("File" if len(signals.files) == 1 else "Files", ", ".join(signals.files) or "–"))
    return facts


def _duration(seconds: float) -> str:
    if seconds < 120.0:
        return f"{seconds:.2f} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    clock = f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {rest:02d} s"
    return f"{clock} ({seconds:.0f} s)"


def _utc(start_ns: int) -> str:
    try:
        return f"{datetime.fromtimestamp(start_ns // 10**9, UTC):%Y-%m-%d %H:%M:%S} UTC"
    except (ValueError, OverflowError, OSError):
        return f"{start_ns} ns since 1970"


def problems(result: DriveResult) -> list[str]:
    """Problems of the data that limit how far the page can be trusted."""
    quality = result.signals.quality
    found = ["The log is cut off: its end is missing."] if quality.truncated else []
    if quality.dropped_samples:
        lost = f", {quality.lost_in_files} of them lost in damaged files" if quality.lost_in_files else ""
        found.append(f"{quality.dropped_samples} samples were not used{lost}.")
    if quality.time_jumps:
        found.append(f"The time jumps {'once' if quality.time_jumps == 1 else f'{quality.time_jumps} times'}.")
    return list(dict.fromkeys([*found, *quality.notes, *result.notes]))


def event_rows(result: DriveResult) -> list[dict[str, Any]]:
    """Events in order of time, with the index that the page's script knows them by."""
    units = {t.detector: pretty_unit(t.unit) for t in result.tracks}
    return [_event_row(i, e, units.get(e.detector, "")) for i, e in enumerate(result.events)]


def _event_row(index: int, event: Event, unit: str) -> dict[str, Any]:
    speed = speed_kmh(event)
    duration = event.end_s - event.start_s
    return {
        "index": index,
        "severity": event.severity,
        "colour": WHEEL_COLOURS.get(event.wheel or "", ""),
        "where": place(event.wheel, event.side) or "vehicle",
        "detector": detector_name(event.detector),
        "cells": [
            Cell(number(event.start_s, 2), event.start_s, is_number=True),
            Cell(number(event.end_s, 2), event.end_s, is_number=True),
            Cell(number(duration, 2), duration, is_number=True),
        ],
        "peak": Cell(_against(event, unit), _ratio(event), is_number=True),
        "speed": Cell(number(speed, 0), speed if speed == speed else -1.0, is_number=True),
        "evidence": "; ".join(evidence_parts(event.evidence)) or "–",
    }


def _against(event: Event, unit: str) -> str:
    return f"{number(event.peak)} / {number(event.threshold)} {unit}".rstrip(" –")


def _ratio(event: Event) -> float:
    ratio = event.peak / event.threshold if event.threshold else event.peak
    return ratio if abs(ratio) < float("inf") else -1.0


def detector_rows(result: DriveResult) -> list[dict[str, str]]:
    """Each detector with its state and number of events."""
    counts: dict[str, int] = {}
    for event in result.events:
        counts[event.detector] = counts.get(event.detector, 0) + 1
    limited = {u.detector: u.missing for u in result.limited}
    rows = []
    for name in dict.fromkeys([*(t.detector for t in result.tracks), *limited]):
        wheels = dict.fromkeys(place(t.wheel, t.side) for t in result.tracks if t.detector == name)
        row = {"name": detector_name(name), "where": ", ".join(w for w in wheels if w) or "vehicle"}
        row |= {"events": str(counts.get(name, 0)), "state": "limited" if name in limited else "ran"}
        row["note"] = f"judged without {', '.join(limited[name])}" if name in limited else ""
        rows.append(row)
    for item in result.unavailable:
        row = {"name": detector_name(item.detector), "where": "–", "events": "–", "state": "unavailable"}
        rows.append({**row, "note": f"needs {', '.join(item.missing)}" if item.missing else ""})
    return rows


def slope_rows(result: DriveResult) -> list[list[Cell]]:
    """Result of the slip-slope estimator by side: estimate, reference, and seconds in each state."""
    return [_slope_row(s) for s in result.slopes]


def _slope_row(s: SlopeSummary) -> list[Cell]:
    def seconds(*states: str) -> Cell:
        total = sum(s.seconds.get(state, 0.0) for state in states)
        return Cell(number(total, 1), total, is_number=True)

    known = s.slope == s.slope
    at_end = f"{number(s.slope, 1)} ± {number(s.slope_sd, 1)}" if known else "–"
    why = sorted(((v, k) for k, v in s.inactive.items() if v >= 0.05), reverse=True)
    return [
        Cell(place(s.wheel, s.place), s.place),
        Cell(at_end, s.slope if known else -1.0, is_number=True),
        Cell(number(s.reference, 1), s.reference if s.reference == s.reference else -1.0, is_number=True),
        Cell(s.reference_from or "–", s.reference_from),
        Cell(number(s.judged_s, 1), s.judged_s, is_number=True),
        seconds("estimating"),
        seconds("slope_frozen"),
        seconds("blind"),
        seconds("traction_too_large", "spinning", "inactive"),
        Cell(str(s.alarms), s.alarms, is_number=True),
        Cell(", ".join(f"{name} {number(v, 1)} s" for v, name in why) or "–", ""),
    ]


def signal_rows(result: DriveResult) -> list[list[Cell]]:
    """Source and bad samples of each signal."""
    return [_signal_row(result, s) for s in result.signals.symbols]


def _signal_row(result: DriveResult, name: str) -> list[Cell]:
    symbol = SYMBOLS.get(name)
    own = [Cell(name, name), Cell(symbol.meaning if symbol else "", "")]
    origin = result.signals.origins.get(name)
    if origin is None:
        return [*own, *(Cell("–", "") for _ in range(6)), Cell("", "")]
    return [
        *own,
        Cell(origin.channel, origin.channel),
        Cell(origin.file, origin.file),
        Cell(origin.unit or "–", origin.unit),
        Cell(number(origin.rate_hz), origin.rate_hz, is_number=True),
        Cell(str(origin.samples), origin.samples, is_number=True),
        Cell(f"{100 * origin.missing_fraction:.2f}", origin.missing_fraction, is_number=True),
        Cell(_bad(origin), ""),
    ]


def _bad(origin: Origin) -> str:
    counts = {
        "not finite": origin.not_finite,
        "out of range": origin.out_of_range,
        "marked invalid": origin.invalid_code,
        "frozen": origin.frozen,
    }
    return ", ".join(f"{n} {what}" for what, n in counts.items() if n)


def fault_columns() -> list[str]:
    """Heads of the table of time faults."""
    return list(_FAULTS.values())


def fault_rows(result: DriveResult) -> list[tuple[str, list[int]]]:
    """Time faults of the whole drive and of each signal with faults."""
    rows = [("all sources", _counts(result.signals.quality.faults))]
    rows += [(name, _counts(o.faults)) for name, o in result.signals.origins.items() if any(_counts(o.faults))]
    return rows if any(any(counts) for _, counts in rows) else []


def _counts(faults: TimeFaults) -> list[int]:
    return [getattr(faults, name) for name in _FAULTS]


def event_columns(rows: Sequence[dict[str, Any]]) -> dict[str, list[Any]]:
    """Columns of rows as `tables.event_rows` makes them, but for the times, which the page has in any case.

    Returns
    -------
    dict
        `detectors`, `places` (with the colour of the wheel) and `severities`, into which `detector`, `place` and
        `severity` are indices; `peak` and `evidence` as text, `ratio` the sort key of the peak; `speed` in km/h, -1
        where it is unknown.
    """
    detectors = _Index()
    places = _Index()
    severities = _Index()
    columns = {
        "detector": [detectors.of(r["detector"]) for r in rows],
        "place": [places.of((r["where"], r["colour"])) for r in rows],
        "severity": [severities.of(r["severity"]) for r in rows],
        "peak": [r["peak"].text for r in rows],
        "ratio": [float(f"{r['peak'].key:.6g}") for r in rows],
        "speed": [round(r["speed"].key, 3) for r in rows],
        "evidence": [r["evidence"] for r in rows],
    }
    return {**columns, "detectors": list(detectors), "places": list(places), "severities": list(severities)}


class _Index(dict[Any, int]):
    """Values in the order in which they came."""

    def of(self, value: Any) -> int:
        return self.setdefault(value, len(self))
