"""Count situations by detector, and find where a rival is better than the thesis' own method."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from aqualog.detect.registry import RIVALS
from aqualog.evaluate.records import RunRecord
from aqualog.evaluate.score import Score, detector_names, grouped, score
from aqualog.evaluate.sweep import JOINT

__all__ = ["TARGETS", "Better", "Coverage", "better_rivals", "coverage", "situation_scores"]

TARGETS = {"full": 0.99, "partial": 0.9, "per_hour": 0.01}
"""Requirements of a joint detector: recall of full and partial aquaplaning, false alarms per hour."""


@dataclass(frozen=True, slots=True)
class Better:
    """One thing in which a rival beats a detector of the thesis, on the drives on which both ran.

    `situation` is empty for all drives together; `measure` is `full`, `partial` (recall) or `false alarms` (per hour);
    `is_sure` if the 95 % intervals are apart; `at_a_price`: the rival is worse in another measure, there or
    over all drives.
    """

    rival: str
    against: str
    situation: str
    measure: str
    rival_value: float
    own_value: float
    is_sure: bool
    at_a_price: bool


@dataclass(frozen=True, slots=True)
class Coverage:
    """Number of situations in which a detector meets the requirements (C78): it finds aquaplaning at the required
    recall, and stays quiet elsewhere.
    """

    detector: str
    found: int
    of_aquaplaning: int
    quiet: int
    of_dry: int


def situation_scores(records: Sequence[RunRecord]) -> dict[str, dict[str, Score]]:
    """Situation (the runs' `manoeuvre`) -> detector -> score; those with aquaplaning first."""
    names = detector_names(records)
    table = {key[0]: {n: score(rs, n) for n in names} for key, rs in grouped(records, ["manoeuvre"]).items()}
    has = {row: any(s.partial.episodes + s.full.episodes for s in scores.values()) for row, scores in table.items()}
    return dict(sorted(table.items(), key=lambda item: (not has[item[0]], item[0])))


def coverage(table: Mapping[str, Mapping[str, Score]]) -> dict[str, Coverage]:
    """Count situations from `situation_scores`, each detector over those in which it ran."""
    out = {}
    for name in dict.fromkeys(n for scores in table.values() for n in scores):
        ran = [scores[name] for scores in table.values() if name in scores and scores[name].runs]
        wet = [s for s in ran if s.partial.episodes]
        dry = [s for s in ran if s.false_alarms.seconds > 0.0]
        out[name] = Coverage(
            name,
            sum(s.partial.share >= TARGETS["partial"] for s in wet),
            len(wet),
            sum(s.false_alarms.count == 0 for s in dry),
            len(dry),
        )
    return out


def better_rivals(records: Sequence[RunRecord]) -> list[Better]:
    """Return where rivals beat their counterpart or a joint detector: over all drives, and in single situations."""
    found: list[Better] = []
    rivals = [n for n in detector_names(records) if n in RIVALS]
    for rival in rivals:
        counterpart = RIVALS[rival].counterpart
        for own in (*((counterpart.name,) if counterpart else ()), *JOINT):
            both = [r for r in records if rival in r.detectors and own in r.detectors]
            if not both:
                continue
            found += _compared(both, rival, own, "")
            is_worse = _is_worse(score(both, rival), score(both, own))
            groups = grouped(both, ["manoeuvre"])
            for key, some in groups.items() if len(groups) > 1 else ():
                found += [b for b in _compared(some, rival, own, key[0], is_worse=is_worse) if b.is_sure]
    return found


def _compared(
    records: Sequence[RunRecord], rival: str, own: str, situation: str, *, is_worse: bool = False
) -> Iterator[Better]:
    a, b = score(records, rival), score(records, own)
    is_worse = is_worse or _is_worse(a, b)
    for name, x, y in (("full", a.full, b.full), ("partial", a.partial, b.partial)):
        if x.episodes and x.share > y.share:
            yield Better(rival, own, situation, name, x.share, y.share, x.ci95[0] > y.ci95[1], is_worse)
    mine, theirs = a.false_alarms, b.false_alarms
    if mine.count < theirs.count:
        # NaN, which is no time at all, is never below
        sure = mine.per_hour_ci95[1] < theirs.per_hour_ci95[0]
        yield Better(rival, own, situation, "false alarms", mine.per_hour, theirs.per_hour, sure, is_worse)


def _is_worse(a: Score, b: Score) -> bool:
    """Return whether the first is worse in any measure."""
    pairs = ((a.full, b.full), (a.partial, b.partial))
    return a.false_alarms.count > b.false_alarms.count or any(x.share < y.share for x, y in pairs if x.episodes)
