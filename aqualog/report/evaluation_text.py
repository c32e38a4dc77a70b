"""An evaluation as text for a terminal."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from aqualog.evaluate.compare import situation_scores
from aqualog.evaluate.match import Cell
from aqualog.evaluate.records import RunRecord
from aqualog.evaluate.run import Evaluation
from aqualog.evaluate.score import Rate, Score, confusion, grouped, score_all
from aqualog.report.evaluation_words import (
    better_sentences,
    coverage_sentences,
    rate_text,
    recall_text,
    seconds_text,
    short,
    tuning_sentences,
    verdicts,
)
from aqualog.report.text import table

__all__ = ["evaluation_text"]

_LEGEND = (
    "Full: detected within 0.5 s of the beginning; partial: within 2 s.\n"
    "Median s, 95 % s: latency over all partial episodes, `never` where more episodes are missed.\n"
    "Before: the detector was already on, on the same water.\n"
    "On water: events with contact above 0.7, counted neither as right nor as wrong."
)
_HEADER = (
    "detector", "drives", "full", "partial", "median s", "95 % s", "before", "false alarms", "per h (95 %)",
    "per 100 km", "on water",
)  # fmt: skip


def evaluation_text(evaluation: Evaluation, *, by: Sequence[str] = ()) -> str:
    """Tables of detectors, configurations, confusion and situations, with summary sentences."""
    records = evaluation.records
    hours = sum(r.duration_s for r in records) / 3600.0
    lines = [f"{len(records)} drives, {hours:.3g} h", "", table(_HEADER, _rows(score_all(records))), _LEGEND]
    lines += ["", *verdicts(records)]
    for key, some in grouped(records, by).items() if by else ():
        title = ", ".join(f"{k} {v}" for k, v in zip(by, key, strict=True))
        lines += ["", f"{title} ({len(some)} drives)", table(_HEADER, _rows(score_all(some)))]
    lines += ["", "share of episodes with an event / events per hour", _confusion(records)]
    situations = situation_scores(records)
    if len(situations) > 1:
        lines += ["", "recall of partial aquaplaning by situation", _situations(situations, is_recall=True)]
        lines += ["", "false alarms per hour by situation", _situations(situations, is_recall=False)]
        lines += ["", *coverage_sentences(records)]
    if evaluation.roc:
        header = ("detector", "times", "threshold", "full", "partial", "false alarms", "per h (95 %)")
        rows = [
            (p.detector, f"{p.factor:.3g}", f"{p.threshold:.4g}", recall_text(p.full), recall_text(p.partial),
             str(p.false_alarms.count), rate_text(p.false_alarms))
            for p in evaluation.roc
        ]  # fmt: skip
        lines += ["", "over thresholds", table(header, rows)]
    words = better_sentences(records)
    if words:
        lines += ["", "rivals", *words]
    if evaluation.tuning is not None:
        before = score_all(evaluation.tuning.before)
        lines += ["", "tuning", *tuning_sentences(evaluation.tuning, before, score_all(records))]
    return "\n".join(lines) + "\n"


def _rows(scores: Mapping[str, Score]) -> list[tuple[str, ...]]:
    return [
        (
            n,
            str(s.runs),
            recall_text(s.full),
            recall_text(s.partial),
            seconds_text(s.partial.latency(0.5)),
            seconds_text(s.partial.latency(0.95)),
            "-" if math.isnan(s.partial.before_share) else f"{100 * s.partial.before_share:.0f} %",
            str(s.false_alarms.count),
            rate_text(s.false_alarms),
            "-" if math.isnan(s.false_alarms.per_100km) else f"{s.false_alarms.per_100km:.3g}",
            str(s.on_water.count),
        )
        for n, s in scores.items()
        if s.runs
    ]


def _confusion(records: Sequence[RunRecord]) -> str:
    cells = confusion(records)
    names = list(dict.fromkeys(n for row in cells.values() for n in row))
    rows = [(row, *(_counted(columns[n]) if n in columns else "-" for n in names)) for row, columns in cells.items()]
    return table(("", *names), rows)


def _counted(c: Cell) -> str:
    return f"{c.hit}/{c.episodes} {short(Rate(c.events, c.seconds, 0.0).per_hour)}"


def _situations(situations: Mapping[str, Mapping[str, Score]], *, is_recall: bool) -> str:
    names = [n for n in next(iter(situations.values())) if any(s[n].runs for s in situations.values())]
    rows = []
    for row, scores in situations.items():
        first = max(s.partial.episodes for s in scores.values())
        if is_recall and not first:
            continue
        cells = [_cell(scores[n], is_recall=is_recall) for n in names]
        rows.append((row, *cells))
    return table(("", *names), rows)


def _cell(s: Score, *, is_recall: bool) -> str:
    if not s.runs or (is_recall and not s.partial.episodes):
        return "-"
    if is_recall:
        return f"{100 * s.partial.share:.0f} % of {s.partial.episodes}"
    return short(s.false_alarms.per_hour) if s.false_alarms.seconds > 0.0 else "-"
