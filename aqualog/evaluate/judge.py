"""Run all detectors over one drive, and score their events against its labels."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aqualog.core.records import Event, FloatArray, Track
from aqualog.detect.registry import DETECTORS
from aqualog.detect.rivals.run import run_rivals
from aqualog.detect.stream import Settings, detect_drive
from aqualog.detect.thresholds import DEFAULT, Thresholds
from aqualog.evaluate.drives import Drive
from aqualog.evaluate.labels import Labels, Span, joined, without
from aqualog.evaluate.match import LIMITS_S, beginning_in, cells_of, hits, outlasting, rows_of
from aqualog.evaluate.records import DetectorRun, RunRecord

__all__ = ["ODD_LABELS", "Found", "judge", "record_of", "run_detectors"]

ODD_LABELS = "effects without a meaning here:"  # how such a note begins


@dataclass(frozen=True, slots=True)
class Found:
    """Results of detectors on a drive: events, the wheels of each detector, those that could not run; velocity (n,)."""

    events: tuple[Event, ...]
    wheels: Mapping[str, tuple[str, ...]]
    unavailable: tuple[str, ...]
    v_x: FloatArray
    notes: tuple[str, ...] = ()


def judge(drive: Drive, *, thresholds: Thresholds = DEFAULT, rivals: Mapping[str, float] | None = None) -> RunRecord:
    """Run the detectors over a drive and score them.

    Parameters
    ----------
    drive : Drive
        Detectors see its signals without the truth.
    thresholds : Thresholds
    rivals : mapping name -> float, optional
        Thresholds of rivals (those not named: default); None: without rivals.
    """
    return record_of(drive, run_detectors(drive, thresholds=thresholds, rivals=rivals))


def run_detectors(
    drive: Drive, *, thresholds: Thresholds = DEFAULT, rivals: Mapping[str, float] | None = None, own: bool = True
) -> Found:
    """Return events of the thesis' detectors (`own`) and of the rivals; arguments as `judge`."""
    events: list[Event] = []
    tracks: list[Track] = []
    unavailable: list[str] = []
    notes: list[str] = []
    v_x = drive.signals.array("v_x")
    if own:
        result = detect_drive(drive.signals, drive.vehicle, settings=Settings(thresholds, joint_cusum=drive.joint))
        events += result.events
        tracks += result.tracks
        unavailable += [u.detector for u in result.unavailable]
        notes += [f"{u.detector} lacks {', '.join(u.missing)}" for u in result.unavailable]
        if "v_x_hat" in result.features.columns:
            v_x = result.features["v_x_hat"].to_numpy()
    ran = [d for d in DETECTORS if d not in unavailable] if own else []
    if rivals is not None:
        of_rivals = run_rivals(drive.signals, drive.vehicle, thresholds=rivals)
        events += of_rivals.events
        tracks += of_rivals.tracks
        unavailable += [u.detector for u in of_rivals.unavailable]
        notes += [f"{u.detector} lacks {', '.join(u.missing)}" for u in of_rivals.unavailable]
        ran += list(dict.fromkeys(t.detector for t in of_rivals.tracks))
    wheels = {d: tuple(dict.fromkeys(t.wheel for t in tracks if t.detector == d and t.wheel)) for d in ran}
    return Found(tuple(events), wheels, tuple(unavailable), v_x, tuple(notes))


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
    return RunRecord(
        name=drive.name,
        groups=drive.groups,
        duration_s=duration,
        dry_s=sum(b - a for a, b in dry),
        dry_m=sum(float(v_x[round(a / dt) : round(b / dt)].sum()) * dt for a, b in dry),
        wet_s=sum(b - a for a, b in wet),
        detectors={d: _detector_run(d, found, labels, rows, dry, wet) for d in names},
        unavailable=tuple(d for d in found.unavailable if only is None or d in only),
        notes=(*found.notes, *_odd_labels(drive)),
        is_lossy=quality.truncated or quality.lost_in_files > 0,
    )


def _detector_run(
    detector: str,
    found: Found,
    labels: Labels,
    rows: dict[str, list[Span]],
    dry: Sequence[Span],
    wet: Sequence[Span],
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


def _odd_labels(drive: Drive) -> list[str]:
    unknown = ", ".join(drive.labels.unknown)
    if not unknown:
        return []
    return [f"{ODD_LABELS} {unknown} enter the confusion table only; full, partial and water are scored"]
