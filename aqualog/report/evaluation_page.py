"""The page of `evaluate`: one file that needs no network."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from aqualog import __version__
from aqualog.evaluate.match import Cell
from aqualog.evaluate.records import RunRecord
from aqualog.evaluate.run import Evaluation
from aqualog.evaluate.score import Rate, Score, confusion, grouped, score_all
from aqualog.report.evaluation_words import (
    better_sentences,
    coverage_sentences,
    headline,
    notes_of,
    rate_text,
    recall_text,
    seconds_text,
    short,
    title_of,
    tuning_sentences,
    verdicts,
)
from aqualog.report.figures.evaluation import alarm_matrix, latency_curves, recall_matrix, roc_curves
from aqualog.report.offline import TEMPLATES, content_policy, environment, json_island, plotly_js
from aqualog.report.wording import number
from aqualog.rivals.catalogue import RIVALS

__all__ = ["evaluation_figures", "render_evaluation_page", "write_evaluation_page"]


def write_evaluation_page(evaluation: Evaluation, path: Path, *, title: str, by: Sequence[str] = ()) -> None:
    """Write the page to exactly this path; arguments as `render_evaluation_page`."""
    path.write_bytes(render_evaluation_page(evaluation, title=title, by=by).encode("utf-8", "replace"))


def render_evaluation_page(evaluation: Evaluation, *, title: str, by: Sequence[str] = ()) -> str:
    """The page as HTML; the same text for the same result.

    Parameters
    ----------
    evaluation : Evaluation
    title : str
        Names the drives; may hold anything, it is escaped.
    by : sequence of str
        Keys of the configuration by which the table is repeated.
    """
    records = evaluation.records
    scores = score_all(records)
    plots = evaluation_figures(evaluation)
    cells = confusion(records)
    names = list(dict.fromkeys(n for row in cells.values() for n in row))
    tuning = evaluation.tuning
    scripts = {"plotly": plotly_js(), "page": _text("figures.js")}
    return environment(TEMPLATES).get_template("evaluation.html.j2").render(
        title=title,
        version=__version__,
        policy=content_policy(scripts.values()),
        # Markup only for the package's own files, plotly.js and what json_island has escaped
        css=Markup(_text("page.css") + _text("slope.css")),
        scripts={name: Markup(text) for name, text in scripts.items()},
        data=json_island(plots),
        plots=list(plots),
        headline=headline(evaluation),
        verdicts=verdicts(records),
        facts=_facts(evaluation),
        tables=[("All drives", _rows(scores))] + [(_title(by, key), _rows(score_all(some))) for key, some in
                                                  (grouped(records, by).items() if by else ())],
        rivals=better_sentences(records),
        coverage=coverage_sentences(records) if len(_situations(records)) > 1 else [],
        confusion_names=[n.replace("_", " ") for n in names],
        confusion=[(row, [_cell(columns.get(n)) for n in names]) for row, columns in cells.items()],
        tuning=tuning_sentences(tuning, score_all(tuning.before), scores) if tuning else [],
        failed=[f"{name}: {reason}" for name, reason in evaluation.failed.items()],
        notes=notes_of(records),
    )  # fmt: skip


def _text(name: str) -> str:
    return (TEMPLATES / name).read_text(encoding="utf-8")


def _situations(records: Sequence[RunRecord]) -> set[str]:
    return {r.groups.get("manoeuvre", "") for r in records}


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


def _facts(evaluation: Evaluation) -> list[tuple[str, str]]:
    records = evaluation.records
    facts = [
        ("drives", str(len(records))),
        ("driving", f"{number(sum(r.duration_s for r in records) / 3600.0)} h"),
        ("outside water", f"{number(sum(r.dry_s for r in records) / 3600.0)} h, "
                          f"{number(sum(r.dry_m for r in records) / 1e3)} km"),
    ]  # fmt: skip
    return [*facts, ("not readable", str(len(evaluation.failed)))] if evaluation.failed else facts


def _title(by: Sequence[str], key: Sequence[str]) -> str:
    return ", ".join(f"{k} {v}" for k, v in zip(by, key, strict=True))


def _rows(scores: Mapping[str, Score]) -> list[dict[str, Any]]:
    return [
        {
            "name": title_of(n),
            "is_rival": n in RIVALS,
            "cells": [
                str(s.runs),
                recall_text(s.full),
                recall_text(s.partial),
                recall_text(s.wheel_partial),
                f"{seconds_text(s.partial.latency(0.5))} / {seconds_text(s.partial.latency(0.95))}",
                number(100.0 * s.partial.before_share, 0) if not math.isnan(s.partial.before_share) else "–",
                str(s.false_alarms.count),
                rate_text(s.false_alarms),
                number(s.false_alarms.per_100km),
                str(s.on_water.count),
            ],
        }
        for n, s in scores.items()
        if s.runs
    ]


def _cell(c: Cell | None) -> str:
    if c is None:
        return "–"
    return f"{c.hit}/{c.episodes} · {short(Rate(c.events, c.seconds, 0.0).per_hour)}/h"
