"""An evaluation as the JSON document."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from aqualog import __version__
from aqualog.evaluate.compare import better_rivals, coverage, situation_scores
from aqualog.evaluate.records import RunRecord
from aqualog.evaluate.roc import RocPoint
from aqualog.evaluate.run import Evaluation
from aqualog.evaluate.score import Rate, Recall, Score, confusion, grouped, score_all
from aqualog.report.evaluation_words import better_sentences, notes_of, verdicts

__all__ = ["SCHEMA_VERSION", "evaluation_document"]

SCHEMA_VERSION = 1


def evaluation_document(evaluation: Evaluation, *, by: Sequence[str] = ()) -> dict[str, Any]:
    """The JSON document of `evaluate`. NaN and infinities become null.

    Returns
    -------
    dict
        `drives`: evaluated, `seconds`, `failed` {drive: reason};
        `thresholds` and `rivals` {detector: value} that were used;
        `detectors`: per detector `drives`, `unavailable`, recalls `full`, `partial`, `wheel_full`, `wheel_partial` (on
        the wheels that it judges), `own` (labels of its name) - each `episodes`, `found`, `recall`, `ci95`,
        `warned_before`, `latency_median_s`, `latency_95_s` (null: never) -, `false_alarms` (`count`, `hours`,
        `per_hour`, `per_hour_ci95`, `per_100km`, `per_100km_ci95`) outside water, `on_water` (events on water, contact
        above 0.7);
        `by`: the same per configuration, `groups` {key: value};
        `confusion` {row: {detector: `episodes`, `with_event`, `events_per_hour`}};
        `situations` {manoeuvre: {detector: as in `detectors`}} and `coverage` (C78);
        `roc`: points `detector`, `factor`, `threshold`, `full`, `partial`, `per_hour`, `count`, `hours`;
        `better_rivals`: measures in which a rival is better; `sentences`: the same in words;
        `tuning`: null, or `rule`, `tuned_on`, `reported_on`, `unused`, `choices`, `before` (detectors with the
        thresholds as they were);
        `runs`: per drive `name`, `groups`, `seconds`, `false_alarms_s` {detector: times}, `unavailable`.
    """
    records, tuning = evaluation.records, evaluation.tuning
    return {
        "schema_version": SCHEMA_VERSION,
        "tool_version": __version__,
        "drives": {
            "evaluated": len(records),
            "seconds": _number(sum(r.duration_s for r in records)),
            "failed": dict(evaluation.failed),
        },
        "thresholds": {
            n: _number(getattr(evaluation.thresholds, n)) for n in evaluation.thresholds.__dataclass_fields__
        },
        "rivals": None if evaluation.rivals is None else dict(evaluation.rivals),
        "detectors": _scores(score_all(records)),
        "by": [
            {"groups": dict(zip(by, key, strict=True)), "detectors": _scores(score_all(some))}
            for key, some in (grouped(records, by).items() if by else ())
        ],
        "confusion": {
            row: {
                n: {
                    "episodes": c.episodes,
                    "with_event": c.hit,
                    "events_per_hour": _number(Rate(c.events, c.seconds, 0.0).per_hour),
                }
                for n, c in cells.items()
            }
            for row, cells in confusion(records).items()
        },
        "situations": {row: _scores(scores) for row, scores in situation_scores(records).items()},
        "coverage": [asdict(c) for c in coverage(situation_scores(records)).values()],
        "roc": [_point(p) for p in evaluation.roc],
        "better_rivals": [
            {"rival": b.rival, "against": b.against, "situation": b.situation or None, "measure": b.measure,
             "rival_value": _number(b.rival_value), "own_value": _number(b.own_value), "beyond_chance": b.is_sure,
             "at_a_price": b.at_a_price}
            for b in better_rivals(records)
        ],
        "sentences": [*verdicts(records), *better_sentences(records)],
        "tuning": None if tuning is None else {
            "rule": tuning.rule,
            "limit_per_hour": tuning.limit_per_hour,
            "tuned_on": list(tuning.tuned_on),
            "reported_on": list(tuning.reported_on),
            "unused": list(tuning.unused),
            "choices": [{**_point(c.point), "reason": c.reason} for c in tuning.choices.values()],
            "before": _scores(score_all(tuning.before)),
        },
        "runs": [_run(r) for r in records],
        "notes": notes_of(records),
    }  # fmt: skip


def _number(x: float) -> float | None:
    return float(f"{x:.9g}") if math.isfinite(x) else None


def _pair(ci: tuple[float, float]) -> list[float | None]:
    return [_number(ci[0]), _number(ci[1])]


def _recall(r: Recall) -> dict[str, Any]:
    return {
        "episodes": r.episodes,
        "found": r.found,
        "recall": _number(r.share),
        "ci95": _pair(r.ci95),
        "warned_before": _number(r.before_share),
        "latency_median_s": _number(r.latency(0.5)),
        "latency_95_s": _number(r.latency(0.95)),
    }


def _rate(r: Rate) -> dict[str, Any]:
    return {
        "count": r.count,
        "hours": _number(r.seconds / 3600.0),
        "per_hour": _number(r.per_hour),
        "per_hour_ci95": _pair(r.per_hour_ci95),
        "per_100km": _number(r.per_100km),
        "per_100km_ci95": _pair(r.per_100km_ci95),
    }


def _scores(scores: Mapping[str, Score]) -> dict[str, Any]:
    return {
        n: {
            "drives": s.runs,
            "unavailable": s.unavailable,
            **{k: _recall(getattr(s, k)) for k in ("full", "partial", "wheel_full", "wheel_partial", "own")},
            "false_alarms": _rate(s.false_alarms),
            "on_water": {"count": s.on_water.count, "per_hour": _number(s.on_water.per_hour)},
        }
        for n, s in scores.items()
    }


def _point(p: RocPoint) -> dict[str, Any]:
    return {
        "detector": p.detector,
        "factor": _number(p.factor),
        "threshold": _number(p.threshold),
        "full": _number(p.full.share),
        "partial": _number(p.partial.share),
        "per_hour": _number(p.false_alarms.per_hour),
        "count": p.false_alarms.count,
        "hours": _number(p.false_alarms.seconds / 3600.0),
    }


def _run(r: RunRecord) -> dict[str, Any]:
    return {
        "name": r.name,
        "groups": dict(r.groups),
        "seconds": _number(r.duration_s),
        "false_alarms_s": {n: list(d.false_alarms) for n, d in r.detectors.items() if d.false_alarms},
        "unavailable": list(r.unavailable),
    }
