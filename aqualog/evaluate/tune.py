"""Propose thresholds from curves: few false alarms first, then recall."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from aqualog.detect.registry import RIVALS
from aqualog.detect.thresholds import Thresholds
from aqualog.evaluate.roc import RocPoint

__all__ = ["LIMIT_PER_HOUR", "Choice", "applied", "choose"]

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
    by_detector: dict[str, list[RocPoint]] = {}
    for p in points:
        by_detector.setdefault(p.detector, []).append(p)
    return {name: _choice(own, limit) for name, own in by_detector.items()}


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
    return (_zero(p.partial.share), _zero(p.full.share), -p.false_alarms.count, -abs(math.log(p.factor)))


def _zero(share: float) -> float:
    return 0.0 if math.isnan(share) else share
