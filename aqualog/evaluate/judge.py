"""Run all detectors over one drive, and match their events to the episodes of its labels."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aqualog.core.records import DriveResult, Event, FloatArray, Remark
from aqualog.detect.registry import DETECTORS
from aqualog.detect.stream import RivalResult, Settings, detect_drive, run_rivals
from aqualog.detect.thresholds import DEFAULT, Thresholds
from aqualog.evaluate.drives import Drive
from aqualog.evaluate.labels import Labels, Span, joined, overlaps, without
from aqualog.evaluate.records import Cell, DetectorRun, Hit, RunRecord

__all__ = [
    "LIMITS_S", "ODD_LABELS", "Found", "beginning_in", "cells_of", "hits", "judge", "outlasting", "record_of",
    "rows_of", "run_detectors",
]  # fmt: skip

LIMITS_S = {"full": 0.5, "partial": 2.0}
"""Longest time from the beginning of an episode to its detection. [s]"""

OUTLASTS_S = 10.0  # [s] an alarm that is still on so long after the water is a false one too
ODD_LABELS = "effects without a meaning here:"  # how such a note begins


@dataclass(frozen=True, slots=True)
class Found:
    """Results of detectors on a drive: events, the wheels of each detector, those that could not run; velocity (n,)."""

    events: tuple[Event, ...]
    wheels: Mapping[str, tuple[str, ...]]
    unavailable: tuple[str, ...]
    v_x: FloatArray
    notes: tuple[str, ...] = ()
    checks: tuple[Remark, ...] = ()


def judge(
    drive: Drive, *, thresholds: Thresholds = DEFAULT, rivals: Mapping[str, float] | None = None,
    is_checked: bool = True,
) -> RunRecord:  # fmt: skip
    """Run the detectors over a drive and score them.

    Parameters
    ----------
    drive : Drive
        Detectors see its signals without the truth.
    rivals : mapping name -> float, optional
        Thresholds of rivals (those not named: default); None: without rivals.
    is_checked : bool
        Whether to look if the inputs fit each other.
    """
    return record_of(drive, run_detectors(drive, thresholds=thresholds, rivals=rivals, is_checked=is_checked))


def run_detectors(
    drive: Drive, *, thresholds: Thresholds = DEFAULT, rivals: Mapping[str, float] | None = None, own: bool = True,
    is_checked: bool = True,
) -> Found:  # fmt: skip
    """Return events of the thesis' detectors and of rivals in the log (both: `own`), and of `rivals`; see `judge`."""
    v_x = drive.signals.array("v_x")
    results: list[DriveResult | RivalResult] = []
    ran: list[str] = []
    checks: tuple[Remark, ...] = ()
    if own:
        settings = Settings(thresholds, joint_cusum=drive.joint)
        result = detect_drive(drive.signals, drive.vehicle, settings=settings, is_checked=is_checked)
        results.append(result)
        checks = result.checks
        ran += [d for d in DETECTORS if d not in {u.detector for u in result.unavailable}]
        if "v_x_hat" in result.features.columns:
            v_x = result.features["v_x_hat"].to_numpy()
    if rivals is not None:
        of_rivals = run_rivals(drive.signals, drive.vehicle, thresholds=rivals)
        results.append(of_rivals)
        ran += dict.fromkeys(t.detector for t in of_rivals.tracks)
    heard = drive.heard if own else {}
    ran += [name for name, h in heard.items() if not h.missing]
    tracks = [t for r in results for t in r.tracks]
    missing = [u for r in results for u in r.unavailable]
    wheels = {d: tuple(dict.fromkeys(t.wheel for t in tracks if t.detector == d and t.wheel)) for d in ran}
    logged = [Event(n, None, None, a, b, "partial", h.high, 0.0, {}) for n, h in heard.items() for a, b in h.spans]
    absent = {n: h.missing for n, h in heard.items() if h.missing}
    return Found(
        (*(e for r in results for e in r.events), *logged), wheels, (*(u.detector for u in missing), *absent), v_x,
        (
            *(f"{u.detector} lacks {', '.join(u.missing)}" for u in missing),
            *(f"rival {n}: {why}" for n, why in absent.items()),
            *(h.note for h in heard.values() if h.note),
            *(r.sentence for r in checks),
        ),
        checks,
    )  # fmt: skip


def record_of(drive: Drive, found: Found, only: Collection[str] | None = None) -> RunRecord:
    """Score the events; `only` of some detectors."""
    labels, quality = drive.labels, drive.signals.quality
    t = drive.signals.array("t")
    dt = drive.signals.dt
    duration = t.size * dt
    rows = rows_of(labels, duration)
    dry = without([(0.0, duration)], labels.water_widened)
    wet = without(labels.water, labels.afloat) if "partial" in labels.knows else []
    v_x = np.nan_to_num(np.abs(found.v_x))
    names = [d for d in found.wheels if only is None or d in only]
    unknown = ", ".join(labels.unknown)
    odd = [f"{ODD_LABELS} {unknown} enter the confusion table only; full, partial and water are scored"]
    return RunRecord(
        name=drive.name,
        groups=drive.groups,
        duration_s=duration,
        dry_s=sum(b - a for a, b in dry),
        dry_m=sum(float(v_x[round(a / dt) : round(b / dt)].sum()) * dt for a, b in dry),
        wet_s=sum(b - a for a, b in wet),
        detectors={d: _detector_run(d, found, labels, rows, dry, wet) for d in names},
        unavailable=tuple(d for d in found.unavailable if only is None or d in only),
        notes=(*found.notes, *(odd if unknown else ())),
        is_lossy=quality.truncated or quality.lost_in_files > 0,
        heard={n: (h.low, h.high) for n, h in drive.heard.items() if not h.missing},
        checks=found.checks,
    )


def _detector_run(
    detector: str, found: Found, labels: Labels, rows: dict[str, list[Span]], dry: Sequence[Span], wet: Sequence[Span]
) -> DetectorRun:
    events = [e for e in found.events if e.detector == detector]
    spans = [(e.start_s, e.end_s) for e in events]
    of_car = joined(spans, 0.0)
    water = labels.water_widened
    own = labels.of(detector)
    of_wheels = {
        effect: tuple(
            h
            for w in found.wheels[detector]
            if labels.names_wheels(effect)
            for h in hits(
                labels.of(effect, w), [(e.start_s, e.end_s) for e in events if e.wheel == w],
                limit=limit, water=water,
            )
        )
        for effect, limit in LIMITS_S.items()
    }  # fmt: skip
    return DetectorRun(
        full=hits(labels.of("full"), spans, limit=LIMITS_S["full"], water=water),
        partial=hits(labels.of("partial"), spans, limit=LIMITS_S["partial"], water=water),
        wheel_full=of_wheels["full"],
        wheel_partial=of_wheels["partial"],
        own=hits(own, spans, limit=LIMITS_S["partial"], water=water),
        false_alarms=tuple(
            round(t, 6) for t in sorted([*(a for a, _ in beginning_in(of_car, dry)), *outlasting(of_car, water)])
        ),
        on_water=len(beginning_in(of_car, wet)),
        cells=cells_of(rows, of_car),
    )


def hits(episodes: Sequence[Span], events: Sequence[Span], *, limit: float, water: Sequence[Span]) -> tuple[Hit, ...]:
    """Match events to episodes.

    Parameters
    ----------
    episodes, events : sequence of (start, end)
        Of one effect, of one detector. [s]
    limit : float
        An event that overlaps the first `limit` seconds finds the episode. [s]
    water : sequence of (start, end)
        An event that was on before the episode counts only if it began on the same stretch of water: else a stuck
        alarm would find all episodes.

    Returns
    -------
    tuple of Hit
        One per episode.
    """
    return tuple(_hit(span, sorted(events), limit, water) for span in episodes)


def _hit(episode: Span, events: Sequence[Span], limit: float, water: Sequence[Span]) -> Hit:
    start, end = episode
    for begin, stop in events:
        if stop <= start or begin > max(end, start + limit):
            continue
        if begin >= start:
            return Hit(begin - start <= limit + 1e-9, begin - start, before=False)
        if any(_is_in(begin, [stretch]) and _is_in(start, [stretch]) for stretch in water):
            return Hit(found=True, latency=0.0, before=True)
    return Hit(found=False, latency=float("nan"), before=False)


def outlasting(events: Sequence[Span], water: Sequence[Span]) -> list[float]:
    """Return times at which events from water had lasted `OUTLASTS_S` beyond the end of their stretch. [s]"""
    return [b + OUTLASTS_S for begin, stop in events for a, b in water if a <= begin < b and stop > b + OUTLASTS_S]


def beginning_in(events: Sequence[Span], spans: Sequence[Span]) -> list[Span]:
    """Return events that begin within any of the stretches."""
    return [e for e in events if _is_in(e[0], spans)]


def _is_in(t: float, spans: Sequence[Span]) -> bool:
    # half a sample of slack: stamps of truth and detector are not the same floats
    return any(a - 1e-6 <= t < b for a, b in spans)


def rows_of(labels: Labels, duration_s: float) -> dict[str, list[Span]]:
    """Return rows of the confusion table: `full`, `partial` (without full), `water only`, other labels, `none`.

    Parameters
    ----------
    duration_s : float
        Of the drive. [s]
    """
    full, afloat, water = labels.of("full"), labels.afloat, labels.water
    others = {e: labels.of(e) for e in labels.others}
    taken = joined([*labels.water_widened, *(s for spans in others.values() for s in spans)], 0.0)
    rows = {
        "full": full,
        "partial": without(labels.of("partial"), full),
        "water only": without(water, afloat),
        **others,
        "none": without([(0.0, duration_s)], taken),
    }
    return {name: spans for name, spans in rows.items() if spans}


def cells_of(rows: dict[str, list[Span]], events: Sequence[Span]) -> dict[str, Cell]:
    """Return a detector's column of the confusion table. `events` are those of the car: disjoint stretches."""
    return {
        name: Cell(
            len(spans),
            sum(overlaps(s, events) for s in spans),
            len(beginning_in(events, spans)),
            sum(b - a for a, b in spans),
        )
        for name, spans in rows.items()
    }
