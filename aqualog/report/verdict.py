"""The answer in one line."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from aqualog.core.records import DriveResult, Event
from aqualog.report.wording import detector_name, number, place, speed_kmh

__all__ = ["Verdict", "by_importance", "verdict"]

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
