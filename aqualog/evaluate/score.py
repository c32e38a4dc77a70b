"""Score detectors: recall, latency and false alarms with their intervals, by configuration."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from aqualog.core.intervals import poisson, wilson
from aqualog.evaluate.judge import Hit
from aqualog.evaluate.records import Cell, RunRecord

__all__ = [
    "Rate", "Recall", "Score", "confusion", "detector_names", "grouped", "recall_of", "score", "score_all",
]  # fmt: skip

HOUR_S = 3600.0
KM_100 = 1e5  # [m]


@dataclass(frozen=True, slots=True)
class Recall:
    """Episodes, those found within the limit, those with an earlier warning; latencies of all that were found. [s]"""

    episodes: int
    found: int
    before: int
    latencies: tuple[float, ...]

    @property
    def share(self) -> float:
        """Return the recall; NaN without episodes."""
        return self.found / self.episodes if self.episodes else math.nan

    @property
    def ci95(self) -> tuple[float, float]:
        """Return the Wilson interval [wilson1927] of the recall."""
        return wilson(self.found, self.episodes)

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
    """Events counted over a time [s] and a way [m]."""

    count: int
    seconds: float
    metres: float

    @property
    def per_hour(self) -> float:
        """[1/h]"""
        return self.count * HOUR_S / self.seconds if self.seconds > 0.0 else math.nan

    @property
    def per_hour_ci95(self) -> tuple[float, float]:
        """Exact Poisson interval [garwood1936]. [1/h]"""
        return _over(poisson(self.count), self.seconds / HOUR_S)

    @property
    def per_100km(self) -> float:
        """[1/100 km]"""
        return self.count * KM_100 / self.metres if self.metres > 0.0 else math.nan

    @property
    def per_100km_ci95(self) -> tuple[float, float]:
        """Return the exact Poisson interval. [1/100 km]"""
        return _over(poisson(self.count), self.metres / KM_100)


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
        **{kind: recall_of(h for _, d in ran for h in getattr(d, kind)) for kind in kinds},
        false_alarms=Rate(
            sum(len(d.false_alarms) for _, d in ran), sum(r.dry_s for r, _ in ran), sum(r.dry_m for r, _ in ran)
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


def recall_of(hits: Iterable[Hit]) -> Recall:
    """Count hits."""
    all_hits = list(hits)
    return Recall(
        len(all_hits),
        sum(h.found for h in all_hits),
        sum(h.before for h in all_hits),
        tuple(h.latency for h in all_hits if not np.isnan(h.latency)),
    )


def _over(interval: tuple[float, float], length: float) -> tuple[float, float]:
    return (interval[0] / length, interval[1] / length) if length > 0.0 else (math.nan, math.nan)


def _sortable(text: str) -> tuple[int, float, str]:
    try:
        return 0, float(text), text
    except ValueError:
        return 1, 0.0, text
