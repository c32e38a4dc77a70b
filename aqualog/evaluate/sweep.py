"""Recall over false alarms: each detector again at each threshold, and the threshold that is proposed from it."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

from aqualog.detect.registry import BY_NAME, DETECTORS, RIVALS
from aqualog.detect.thresholds import DEFAULT, Thresholds
from aqualog.evaluate.drives import Drive
from aqualog.evaluate.judge import record_of, run_detectors
from aqualog.evaluate.records import RunRecord
from aqualog.evaluate.score import JOINT, Rate, Recall, detector_names, score

__all__ = [
    "FACTORS", "JOINT", "LIMIT_PER_HOUR", "Choice", "RocPoint", "Split", "applied", "choose", "curve_points",
    "records_at", "split_runs", "threshold_at",
]  # fmt: skip

FACTORS = tuple(2.0 ** (k / 2.0) for k in range(-4, 5))
"""Factors on each detector's own threshold: a quarter to four, in steps of a factor of 1.41."""


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
    drive: Drive, factor: float, *, thresholds: Thresholds = DEFAULT, rivals: Mapping[str, float] | None = None,
    names: Collection[str] = DETECTORS,
) -> RunRecord:  # fmt: skip
    """Run every detector over a drive at its own threshold times a factor.

    Joint detectors read the single ones. They run apart, with the single detectors at their original thresholds.

    Parameters
    ----------
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
    for some in ([d for d in names if d not in JOINT], [d for d in names if d in JOINT]):
        if some:
            scaled = thresholds.with_values({d: thresholds.scaled(d, factor)[d] for d in some})
            parts.append(record_of(drive, run_detectors(drive, thresholds=scaled), only=some))
    if rivals is not None:
        own = {name: threshold_at(name, factor, thresholds, rivals) for name in RIVALS}
        parts.append(record_of(drive, run_detectors(drive, rivals=own, own=False)))
    return replace(
        parts[0],
        detectors={n: d for p in parts for n, d in p.detectors.items()},
        unavailable=tuple(dict.fromkeys(n for p in parts for n in p.unavailable)),
        notes=tuple(dict.fromkeys(n for p in parts for n in p.notes)),
    )


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


LIMIT_PER_HOUR = 0.01
"""False alarms that a threshold may cause: one in a hundred hours."""


@dataclass(frozen=True, slots=True)
class Choice:
    """The point proposed for a detector, and why."""

    point: RocPoint
    reason: str


def choose(points: Sequence[RocPoint], *, limit: float = LIMIT_PER_HOUR) -> dict[str, Choice]:
    """Propose a threshold for each detector.

    Parameters
    ----------
    points : sequence of RocPoint
        On the drives to tune on.
    limit : float
        False alarms per hour outside water. [1/h]

    Returns
    -------
    dict detector -> Choice
        Among the thresholds whose false alarms stay within the limit, the one of highest recall of partial
        aquaplaning. Ties: recall of full aquaplaning, fewer false alarms, nearer to the original. If no threshold
        stays within the limit, or those that do find nothing, the original remains: tuning never disables a detector.
    """
    names = dict.fromkeys(p.detector for p in points)
    return {name: _choice([p for p in points if p.detector == name], limit) for name in names}


def applied(choices: Mapping[str, Choice], thresholds: Thresholds, rivals: Mapping[str, float]) -> tuple[
    Thresholds, dict[str, float]
]:  # fmt: skip
    """Return thresholds, and those of the rivals, with the proposals in them."""
    values = {name: c.point.threshold for name, c in choices.items()}
    own = thresholds.with_values({n: x for n, x in values.items() if n not in RIVALS})
    return own, {**rivals, **{n: x for n, x in values.items() if n in RIVALS}}


def _choice(points: Sequence[RocPoint], limit: float) -> Choice:
    as_it_is = min(points, key=lambda p: abs(math.log(p.factor)))
    if not any(p.full.episodes + p.partial.episodes for p in points):
        return Choice(as_it_is, "was not judged on water; stays as it is")
    within = [p for p in points if not p.false_alarms.per_hour > limit]
    if not within:
        return Choice(as_it_is, f"no threshold keeps to {limit:g} false alarms per hour; stays as it is")
    best = max(within, key=_merit)
    if _merit(best)[:2] == (0.0, 0.0):
        return Choice(as_it_is, f"thresholds within {limit:g} false alarms per hour find nothing; stays as it is")
    return Choice(best, f"highest recall among those without more than {limit:g} false alarms per hour seen")


def _merit(p: RocPoint) -> tuple[float, float, float, float]:
    partial, full = (0.0 if math.isnan(r.share) else r.share for r in (p.partial, p.full))
    return partial, full, -p.false_alarms.count, -abs(math.log(p.factor))


@dataclass(frozen=True, slots=True)
class Split:
    """Indices of the drives: to tune on, to report on, and those that would mix both; `rule` in words."""

    tuning: tuple[int, ...]
    reporting: tuple[int, ...]
    unused: tuple[int, ...]
    rule: str


def split_runs(groups: Sequence[Mapping[str, str]]) -> Split:
    """Halve the drives so that the two halves share as little as possible.

    Parameters
    ----------
    groups : sequence of mapping
        Configuration of each drive; its `vehicle` and `tyre` are used.

    Returns
    -------
    Split
        By the first rule that leaves drives on both sides. (1) Families of drives that share a vehicle or a tyre stay
        together. (2) Half of the vehicles with half of the tyres against the other halves; drives that mix them are
        unused. (3) By tyre. (4) By vehicle. (5) Every other drive. Values in their sorted order, every other one to
        either side; the same drives are always divided alike.
    """
    every = range(len(groups))
    tyres = [g.get("tyre", "") for g in groups]
    vehicles = [g.get("vehicle", "") for g in groups]
    families = _families(vehicles, tyres)
    if len(set(families)) > 1:
        return _of(_halves(families), every, "no vehicle and no tyre is in both parts")
    v, y = _halves(vehicles), _halves(tyres)
    both: list[bool | None] = [a if a == b else None for a, b in zip(v, y, strict=True)]
    if True in both and False in both:
        return _of(both, every, "no vehicle and no tyre is in both parts; drives that mix them are left out")
    if len(set(tyres)) > 1:
        return _of(y, every, "no tyre is in both parts, the vehicle is the same")
    if len(set(vehicles)) > 1:
        return _of(v, every, "no vehicle is in both parts, the tyre is the same")
    return _of([bool(i % 2) for i in every], every, "every other drive: vehicle and tyre are the same in both parts")


def _of(is_reporting: Sequence[bool | None], every: Sequence[int], rule: str) -> Split:
    return Split(
        tuple(i for i in every if is_reporting[i] is False),
        tuple(i for i in every if is_reporting[i] is True),
        tuple(i for i in every if is_reporting[i] is None),
        rule,
    )


def _halves(values: Sequence[str]) -> list[bool]:
    """Return whether the value of each drive belongs to the second half: every other one in sorted order."""
    rank = {value: i for i, value in enumerate(sorted(set(values)))}
    return [bool(rank[value] % 2) for value in values]


def _families(first: Sequence[str], second: Sequence[str]) -> list[str]:
    """Return a name for each drive that is the same for drives connected by a shared value of either kind."""
    name = [min(pair) for pair in zip((f"a{x}" for x in first), (f"b{x}" for x in second), strict=True)]
    while True:
        before = list(name)
        for values in (first, second):
            least: dict[str, str] = {}
            for value, n in zip(values, name, strict=True):
                least[value] = min(n, least.get(value, n))
            name = [least[value] for value in values]
        if name == before:
            return name
