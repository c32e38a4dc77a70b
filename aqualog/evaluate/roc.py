"""Compute recall over false alarms: run the detectors again at each threshold, each by its own."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

from aqualog.detect.registry import BY_NAME, DETECTORS, RIVALS, all_of
from aqualog.detect.thresholds import DEFAULT, Thresholds
from aqualog.evaluate.drives import Drive
from aqualog.evaluate.judge import record_of, run_detectors
from aqualog.evaluate.records import RunRecord
from aqualog.evaluate.score import Rate, Recall, detector_names, score

__all__ = ["FACTORS", "JOINT", "RocPoint", "curve_points", "records_at", "threshold_at"]

FACTORS = tuple(2.0 ** (k / 2.0) for k in range(-4, 5))
"""Factors on each detector's own threshold: a quarter to four, in steps of a factor of 1.41."""

JOINT = tuple(d.name for d in all_of("joint"))


@dataclass(frozen=True, slots=True)
class RocPoint:
    """One detector at one threshold over all drives; `factor` times its threshold of departure."""

    detector: str
    factor: float
    threshold: float
    full: Recall
    partial: Recall
    false_alarms: Rate


def records_at(
    drive: Drive,
    factor: float,
    *,
    thresholds: Thresholds = DEFAULT,
    rivals: Mapping[str, float] | None = None,
    names: Collection[str] = DETECTORS,
) -> RunRecord:
    """Run every detector over a drive at its own threshold times a factor.

    Joint detectors read the single ones. They run apart, with the single detectors at their original thresholds.

    Parameters
    ----------
    drive : Drive
    factor : float
        Positive.
    thresholds : Thresholds
        At factor 1.
    rivals : mapping name -> float, optional
        As in `judge.judge`.
    names : collection of str
        Detectors of the thesis to run.
    """
    parts = []
    single = [d for d in names if d not in JOINT]
    joint = [d for d in names if d in JOINT]
    if single:
        found = run_detectors(drive, thresholds=_scaled(thresholds, single, factor))
        parts.append(record_of(drive, found, only=single))
    if joint:
        found = run_detectors(drive, thresholds=_scaled(thresholds, joint, factor))
        parts.append(record_of(drive, found, only=joint))
    if rivals is not None:
        own = {name: threshold_at(name, factor, thresholds, rivals) for name in RIVALS}
        parts.append(record_of(drive, run_detectors(drive, rivals=own, own=False)))
    return _one(parts)


def threshold_at(detector: str, factor: float, thresholds: Thresholds, rivals: Mapping[str, float] | None) -> float:
    """Threshold of a detector or a rival, in its own unit, times a factor."""
    if detector in RIVALS:
        return factor * (rivals or {}).get(detector, RIVALS[detector].threshold)
    return thresholds.scaled(detector, factor)[detector]


def curve_points(
    by_factor: Mapping[float, Sequence[RunRecord]],
    *,
    thresholds: Thresholds = DEFAULT,
    rivals: Mapping[str, float] | None = None,
) -> tuple[RocPoint, ...]:
    """Return points of all curves: factor -> the drives' records at it; by detector, then by factor."""
    points = []
    names = [n for n in detector_names([r for records in by_factor.values() for r in records]) if n in BY_NAME]
    for name in names:
        for factor, records in sorted(by_factor.items()):
            s = score(records, name)
            if s.runs:
                threshold = threshold_at(name, factor, thresholds, rivals)
                points.append(RocPoint(name, factor, threshold, s.full, s.partial, s.false_alarms))
    return tuple(points)


def _scaled(thresholds: Thresholds, names: Collection[str], factor: float) -> Thresholds:
    for name in names:
        thresholds = thresholds.scaled(name, factor)
    return thresholds


def _one(parts: Sequence[RunRecord]) -> RunRecord:
    """Join parts of one drive's record, each with detectors of its own."""
    return replace(
        parts[0],
        detectors={n: d for p in parts for n, d in p.detectors.items()},
        unavailable=tuple(dict.fromkeys(n for p in parts for n in p.unavailable)),
        notes=tuple(dict.fromkeys(n for p in parts for n in p.notes)),
    )
