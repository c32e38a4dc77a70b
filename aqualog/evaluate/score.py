"""Score detectors: recall, latency and false alarms with intervals, by configuration; where a rival is better."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from aqualog.core.intervals import poisson, wilson, worth
from aqualog.detect.registry import BY_NAME, RIVALS, all_of
from aqualog.evaluate.records import Cell, Hit, RunRecord

__all__ = [
    "JOINT", "TARGETS", "Better", "Coverage", "Rate", "Recall", "Score", "better_rivals", "confusion", "coverage",
    "detector_names", "grouped", "is_rival", "recall_of", "score", "score_all", "situation_scores",
]  # fmt: skip

JOINT = tuple(d.name for d in all_of("joint"))
HOUR_S = 3600.0
KM_100 = 1e5  # [m]


@dataclass(frozen=True, slots=True)
class Recall:
    """Episodes, those found within the limit, those with an earlier warning; latencies of all that were found. [s]

    `by_drive`: found and episodes of each drive. What one drive shows hangs together.
    """

    episodes: int
    found: int
    before: int
    latencies: tuple[float, ...]
    by_drive: tuple[tuple[int, int], ...] = field(default=(), compare=False, repr=False)

    @property
    def share(self) -> float:
        """Return the recall; NaN without episodes."""
        return self.found / self.episodes if self.episodes else math.nan

    @property
    def ci95(self) -> tuple[float, float]:
        """Return the Wilson interval [wilson1927] of the recall, of as many episodes as these are worth."""
        each = worth([k for k, _ in self.by_drive], [n for _, n in self.by_drive], of_shares=True)
        return wilson(each * self.found, each * self.episodes)

    @property
    def before_share(self) -> float:
        """Return the share of episodes with a warning before they began."""
        return self.before / self.episodes if self.episodes else math.nan

    def latency(self, share: float) -> float:
        """Return a quantile of the latency over all episodes: one without an event counts as infinitely late. [s]"""
        if not self.episodes:
            return math.nan
        # the smallest latency that at least this share of the episodes does not exceed
        rank = max(1, math.ceil(share * self.episodes - 1e-9))
        return sorted(self.latencies)[rank - 1] if rank <= len(self.latencies) else math.inf


@dataclass(frozen=True, slots=True)
class Rate:
    """Events counted over a time [s] and a way [m]; `by_drive`: events and time of each drive."""

    count: int
    seconds: float
    metres: float
    by_drive: tuple[tuple[int, float], ...] = field(default=(), compare=False, repr=False)

    @property
    def per_hour(self) -> float:
        """[1/h]"""
        return self.count * HOUR_S / self.seconds if self.seconds > 0.0 else math.nan

    @property
    def per_hour_ci95(self) -> tuple[float, float]:
        """Exact Poisson interval [garwood1936], of as many events as these are worth. [1/h]"""
        return _over(self._expected(), self.seconds / HOUR_S)

    @property
    def per_100km(self) -> float:
        """[1/100 km]"""
        return self.count * KM_100 / self.metres if self.metres > 0.0 else math.nan

    @property
    def per_100km_ci95(self) -> tuple[float, float]:
        """Return the same. [1/100 km]"""
        return _over(self._expected(), self.metres / KM_100)

    def _expected(self) -> tuple[float, float]:
        each = worth([k for k, _ in self.by_drive], [t for _, t in self.by_drive], of_shares=False)
        low, high = poisson(each * self.count)
        return low / each, high / each


@dataclass(frozen=True, slots=True)
class Score:
    """One detector over several drives; `on_water` are events on water that began outside aquaplaning."""

    detector: str
    runs: int
    unavailable: int
    full: Recall
    partial: Recall
    wheel_full: Recall
    wheel_partial: Recall
    own: Recall
    false_alarms: Rate
    on_water: Rate


def is_rival(name: str) -> bool:
    """Whether it is a method of the prior art, or a detector that is in the log."""
    return name in RIVALS or name not in BY_NAME


def detector_names(records: Iterable[RunRecord]) -> list[str]:
    """List detectors that ran, or could have, in order of first appearance."""
    return list(dict.fromkeys(n for r in records for n in (*r.detectors, *r.unavailable)))


def score(records: Sequence[RunRecord], detector: str) -> Score:
    """Add up the drives on which a detector ran."""
    ran = [(r, r.detectors[detector]) for r in records if detector in r.detectors]
    kinds = ("full", "partial", "wheel_full", "wheel_partial", "own")
    return Score(
        detector=detector,
        runs=len(ran),
        unavailable=sum(detector in r.unavailable for r in records),
        **{kind: recall_of(getattr(d, kind) for _, d in ran) for kind in kinds},
        false_alarms=Rate(
            sum(len(d.false_alarms) for _, d in ran),
            sum(r.dry_s for r, _ in ran),
            sum(r.dry_m for r, _ in ran),
            tuple((len(d.false_alarms), r.dry_s) for r, d in ran),
        ),
        on_water=Rate(sum(d.on_water for _, d in ran), sum(r.wet_s for r, _ in ran), 0.0),
    )


def score_all(records: Sequence[RunRecord]) -> dict[str, Score]:
    """Return scores of all detectors by name."""
    return {name: score(records, name) for name in detector_names(records)}


def grouped(records: Iterable[RunRecord], keys: Sequence[str]) -> dict[tuple[str, ...], list[RunRecord]]:
    """Group drives by configuration; a missing key becomes a dash. Sorted."""
    out: dict[tuple[str, ...], list[RunRecord]] = {}
    for r in records:
        out.setdefault(tuple(r.groups.get(k, "") or "-" for k in keys), []).append(r)
    return dict(sorted(out.items(), key=lambda item: [_sortable(x) for x in item[0]]))


def confusion(records: Sequence[RunRecord]) -> dict[str, dict[str, Cell]]:
    """Row (effect, water only, other label, none) -> detector -> cell; aquaplaning first, `none` last."""
    names = detector_names(records)
    table: dict[str, dict[str, Cell]] = {}
    for r in records:
        for name, d in r.detectors.items():
            for row, cell in d.cells.items():
                cells = table.setdefault(row, {})
                cells[name] = cells.get(name, Cell()) + cell
    first = ("full", "partial", "water only")
    order = [*first, *(row for row in table if row not in (*first, "none")), "none"]
    return {row: {n: table[row][n] for n in names if n in table[row]} for row in order if row in table}


def recall_of(drives: Iterable[Sequence[Hit]]) -> Recall:
    """Count hits of each drive."""
    each = list(drives)
    all_hits = [h for hits in each for h in hits]
    return Recall(
        len(all_hits),
        sum(h.found for h in all_hits),
        sum(h.before for h in all_hits),
        tuple(h.latency for h in all_hits if not np.isnan(h.latency)),
        tuple((sum(h.found for h in hits), len(hits)) for hits in each),
    )


def _over(interval: tuple[float, float], length: float) -> tuple[float, float]:
    return (interval[0] / length, interval[1] / length) if length > 0.0 else (math.nan, math.nan)


def _sortable(text: str) -> tuple[int, float, str]:
    try:
        return 0, float(text), text
    except ValueError:
        return 1, 0.0, text


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
    rivals = [n for n in detector_names(records) if is_rival(n)]
    for rival in rivals:
        counterpart = RIVALS[rival].counterpart if rival in RIVALS else None
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
