"""The answer of a drive in one line, and its events as text for a terminal."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from aqualog.core.records import DriveResult, Event, SlopeSummary
from aqualog.report.text import table
from aqualog.report.wording import detector_name, lacking, number, place, speed_kmh

__all__ = ["Verdict", "by_importance", "event_table", "verdict"]

MOST_NAMED = 4


@dataclass(frozen=True, slots=True)
class Verdict:
    """`level` is `full`, `partial`, `none`, or `open` where nothing could be judged.

    `details` name the events, or summarise many of them; `not_judged` lists detectors that could not judge.
    """

    level: str
    headline: str
    details: tuple[str, ...]
    not_judged: tuple[str, ...]


def by_importance(events: Sequence[Event]) -> list[Event]:
    """Full before partial, events without braking first, joint detectors before single ones, then by time."""
    return sorted(
        events,
        key=lambda e: (
            bool(e.evidence.get("braking_at_start")),
            e.severity != "full",
            not e.detector.startswith("joint"),
            e.start_s,
            e.detector,
            e.wheel or "",
        ),
    )


def verdict(result: DriveResult) -> Verdict:
    """Events, and detectors that could not judge."""
    events = by_importance(result.events)
    braking = sum(bool(e.evidence.get("braking_at_start")) for e in events)
    full = sum(e.severity == "full" for e in events if not e.evidence.get("braking_at_start"))
    return Verdict(
        level=_level(result, full),
        headline=_headline(len(events), full, braking) if events or result.tracks else "Nothing could be judged",
        details=_details(result, events),
        not_judged=tuple(f"{detector_name(u.detector)} (needs {', '.join(u.missing)})" for u in result.unavailable),
    )


def _level(result: DriveResult, full: int) -> str:
    if result.events:
        return "full" if full else "partial"
    return "none" if result.tracks else "open"


def _details(result: DriveResult, events: Sequence[Event]) -> tuple[str, ...]:
    if not events:
        judged = dict.fromkeys(detector_name(t.detector) for t in result.tracks)
        return (f"Judged: {', '.join(judged)}",) if judged else ()
    return tuple(_sentence(e) for e in events) if len(events) <= MOST_NAMED else _summary(events)


def _headline(count: int, full: int, braking: int) -> str:
    if count == 0:
        return "No event"
    text = f"{count} event{'s' if count > 1 else ''}"
    notes = [f"{full} full"] if full else []
    notes += [f"{braking} while braking"] if braking else []
    return f"{text} ({', '.join(notes)})" if notes else text


def _sentence(event: Event) -> str:
    words = [detector_name(event.detector), place(event.wheel, event.side)]
    words.append(f"{event.start_s:.1f}–{event.end_s:.1f} s")
    speed = speed_kmh(event)
    words += [f"at {number(speed, 0)} km/h"] if math.isfinite(speed) else []
    words += ["(full)"] if event.severity == "full" else []
    words += ["(while braking)"] if event.evidence.get("braking_at_start") else []
    return " ".join(w for w in words if w)


def _summary(events: Sequence[Event]) -> tuple[str, ...]:
    """One phrase per detector: wheels, how often, how often full, from when to when."""
    return tuple(_phrase(d, [e for e in events if e.detector == d]) for d in dict.fromkeys(e.detector for e in events))


def _phrase(detector: str, events: Sequence[Event]) -> str:
    places = {place(e.wheel, e.side) for e in events} - {""}
    # front left, front right, rear left, rear right also sort so by name
    where = f" {', '.join(sorted(places))}" if places else ""
    full = sum(e.severity == "full" for e in events)
    count = f" {len(events)}×" if len(events) > 1 else ""
    notes = f" ({full} full)" if full else ""
    begin, end = min(e.start_s for e in events), max(e.end_s for e in events)
    return f"{detector_name(detector)}{where}{count}, {begin:.1f}–{end:.1f} s{notes}"


def event_table(result: DriveResult) -> str:
    """Events, detectors that could not judge with their missing signals, and slip slopes."""
    signals = result.signals
    rate = 1e9 / signals.step_ns
    lines = [f"{result.vehicle_name}: {signals.duration_s:.1f} s at {rate:g} Hz, {len(signals.symbols)} signals"]
    if result.events:
        header = ("detector", "where", "from s", "to s", "severity", "peak", "limit", "v km/h", "evidence")
        lines.append(table(header, [_row(e) for e in result.events]))
    else:
        lines.append("no event")
    judged = [u for u in result.unavailable if u.missing]
    if judged:
        lines.append("\nnot judged:")
        lines += [f"  {u.detector}: missing {lacking(u.missing)}" for u in judged]
    if result.limited:
        lines.append("\njudged in part:")
        lines += [f"  {u.detector}: without {', '.join(u.missing)}" for u in result.limited]
    told = [s for s in (_slope(s) for s in result.slopes) if s]
    if told:
        lines.append("\nslip slope C_s/F_z at the end:")
        lines += [f"  {s}" for s in told]
    return "\n".join(lines) + "\n"


def _slope(summary: SlopeSummary) -> str:
    """Slip slope of one side with the shares of its states; empty without an estimate."""
    total = sum(summary.seconds.values())
    if not math.isfinite(summary.slope) or total <= 0.0:
        return ""
    dry = (
        f", dry {summary.reference:.1f} ({summary.reference_from})"
        if math.isfinite(summary.reference)
        else ", no dry value yet"
    )
    states = {"estimated": "estimating", "traction too even": "slope_frozen", "blind": "blind"}
    shares = [f"{label} {summary.seconds[key] / total:.0%}" for label, key in states.items()]
    name = summary.wheel or summary.place
    return f"{name}: {summary.slope:.1f} ± {summary.slope_sd:.1f}{dry}; {', '.join(shares)} of the time"


def _row(event: Event) -> tuple[str, ...]:
    v_x = event.evidence.get("v_x")
    return (
        event.detector,
        event.wheel or event.side or "-",
        f"{event.start_s:.2f}",
        f"{event.end_s:.2f}",
        event.severity,
        f"{event.peak:.3g}",
        f"{event.threshold:.3g}",
        f"{3.6 * v_x:.0f}" if v_x is not None else "-",
        _evidence(event),
    )


def _evidence(event: Event) -> str:
    evidence = event.evidence
    parts = []
    slip = evidence.get("slip_max") if event.detector == "spin_up" else evidence.get("slip_min")
    if slip is not None:
        parts.append(f"slip {100 * slip:.1f} %")
    if event.detector == "spin_up" and "mu_min" in evidence:
        parts.append(f"mu {evidence['mu_min']:.3f}")
    if "slope_min" in evidence:
        parts.append(f"slope down to {evidence['slope_min']:.1f}, dry {evidence.get('slope_ref', math.nan):.1f}")
    if "delta_a_x_max" in evidence:
        parts.append(f"resistance up to {evidence['delta_a_x_max']:.2f} m/s²")
    for key in ("force_residual", "torque_residual"):
        if f"{key}_min" in evidence:
            worst = max(evidence[f"{key}_min"], evidence[f"{key}_max"], key=abs)
            parts.append(f"{worst:+.0f} N off the model" if key[0] == "f" else f"{worst:+.1f} N·m off the model")
    if evidence.get("from_steering_torque"):
        parts.append("from the steering torque")
    met = [n for n in (1, 2, 3, 4, 5) if evidence.get(f"criterion_{n}")]
    if met:
        parts.append("criteria " + "+".join(str(n) for n in met))
    if evidence.get("decided_by"):
        parts.append("decided by " + " + ".join(d.replace("_", " ") for d in evidence["decided_by"]))
    if evidence.get("braking_at_start"):
        parts.append("while braking")
    return ", ".join(parts)
