"""Figures of an evaluation: situations by detector, curves over thresholds, how late detections come."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from aqualog.evaluate.records import RunRecord
from aqualog.evaluate.run import Evaluation
from aqualog.evaluate.score import Score, is_rival, score_all, situation_scores
from aqualog.evaluate.sweep import RocPoint
from aqualog.report.evaluation_words import short
from aqualog.report.figures import GOOD_TO_BAD, PALETTE, axis, figure, heat, line
from aqualog.report.values import plot_text

__all__ = ["alarm_matrix", "evaluation_figures", "latency_curves", "recall_matrix", "roc_curves"]

_MANY = 10.0  # [1/h] false alarms from which on a cell is as red as can be


def evaluation_figures(evaluation: Evaluation) -> dict[str, Any]:
    """Return the figures of the page by name: `data` and `layout` of plotly."""
    plots = {
        "recall-matrix": recall_matrix(evaluation.records),
        "alarm-matrix": alarm_matrix(evaluation.records),
        "roc-full": roc_curves(evaluation.roc, "full"),
        "roc-partial": roc_curves(evaluation.roc, "partial"),
        "latency-full": latency_curves(evaluation.records, "full"),
        "latency-partial": latency_curves(evaluation.records, "partial"),
    }
    return {name: figure for name, figure in plots.items() if figure is not None}


def recall_matrix(records: Sequence[RunRecord]) -> dict[str, Any] | None:
    """Situations with aquaplaning by detector: recall of partial aquaplaning; None without any."""

    def value(s: Score) -> tuple[float, str]:
        r = s.partial if s.partial.episodes else s.full
        return (r.share, f"{100.0 * r.share:.0f}") if s.runs and r.episodes else (math.nan, "")

    return _matrix(records, value, "partial aquaplaning found within 2 s, by situation [%]")


def alarm_matrix(records: Sequence[RunRecord]) -> dict[str, Any] | None:
    """Situations by detector: false alarms per hour outside water; None without time there."""

    def value(s: Score) -> tuple[float, str]:
        if not s.runs or not s.false_alarms.seconds > 0.0:
            return math.nan, ""
        rate = s.false_alarms.per_hour
        return max(0.0, 1.0 - math.log1p(rate) / math.log1p(_MANY)), short(rate)

    return _matrix(records, value, "false alarms per hour outside water, by situation")


def roc_curves(points: Sequence[RocPoint], effect: str) -> dict[str, Any] | None:
    """Recall of an effect (`full`, `partial`) over false alarms per hour as thresholds move; None without points."""
    shown = [p for p in points if getattr(p, effect).episodes and p.false_alarms.seconds > 0.0]
    if not shown:
        return None
    floor = 0.5 * min(3600.0 / p.false_alarms.seconds for p in shown)
    names = list(dict.fromkeys(p.detector for p in shown))
    data = []
    for name in names:
        own = [p for p in shown if p.detector == name]
        about = [[f"{p.threshold:.3g}", f"{p.factor:.2g}", f"{p.false_alarms.per_hour:.3g}"] for p in own]
        x, y = [max(p.false_alarms.per_hour, floor) for p in own], [getattr(p, effect).share for p in own]
        data.append(_line(
            name, names, x, y, mode="lines+markers", customdata=about,
            hovertemplate="%{y:.3f} at %{customdata[2]} per h; threshold %{customdata[0]} (%{customdata[1]} times)"
            "<extra>%{fullData.name}</extra>",
        ))  # fmt: skip
    alarms = axis(f"false alarms per hour (zero is drawn at {floor:.2g})", type="log")
    return figure(data, f"{effect} aquaplaning over thresholds", alarms, axis("recall", [-0.02, 1.02]))


def latency_curves(records: Sequence[RunRecord], effect: str) -> dict[str, Any] | None:
    """Share of episodes found so long after their beginning, by detector; None without episodes."""
    scores = {n: s for n, s in score_all(records).items() if s.runs and getattr(s, effect).episodes}
    if not scores:
        return None
    longest = 2.0 if effect == "full" else 5.0
    data = []
    for name, s in scores.items():
        recall = getattr(s, effect)
        found = sorted(x for x in recall.latencies if x <= longest)
        x = [0.0, *found, longest]
        y = [0.0, *((i + 1) / recall.episodes for i in range(len(found))), len(found) / recall.episodes]
        data.append(_line(name, list(scores), x, y, style={"shape": "hv"}))
    late = axis("after the beginning [s]", [0.0, longest])
    return figure(data, f"{effect} aquaplaning: share of episodes found", late, axis("share", [-0.02, 1.02]))


def _matrix(records: Sequence[RunRecord], value: Any, title: str) -> dict[str, Any] | None:
    table: Mapping[str, Mapping[str, Score]] = situation_scores(records)
    names = [n for n in score_all(records) if any(s[n].runs for s in table.values())]
    cells = {row: [value(scores[n]) for n in names] for row, scores in table.items()}
    rows = [row for row, values in cells.items() if any(text for _, text in values)]
    if not rows:
        return None
    z = [[None if math.isnan(v) else round(v, 4) for v, _ in cells[row]] for row in rows]
    texts = [[t for _, t in cells[r]] for r in rows]
    found = heat(
        [n.replace("_", " ") for n in names], [plot_text(r, 40) for r in rows], z, texts,
        (0.0, 1.0), GOOD_TO_BAD, texttemplate="%{text}", showscale=False,
        hovertemplate="%{y}, %{x}: %{text}<extra></extra>",
    )  # fmt: skip
    return figure(
        [found], title, axis(side="bottom", tickangle=-35, type="category"),
        axis(autorange="reversed", type="category", automargin=True), height=190 + 24 * len(rows), margin={"b": 120},
    )  # fmt: skip


def _line(name: str, names: Sequence[str], x: Sequence[float], y: Sequence[float], **more: Any) -> dict[str, Any]:
    """A detector's line: its colour within its kind, dotted for a rival."""
    dotted = is_rival(name)
    kind = [n for n in names if is_rival(n) == dotted]
    colour = PALETTE[kind.index(name) % len(PALETTE)]
    style = {"dash": "dot" if dotted else "solid", **more.pop("style", {})}
    marker = {"color": colour, "size": 5}
    return line(name.replace("_", " "), x, y, colour, width=1.6, style=style, marker=marker, **more)
