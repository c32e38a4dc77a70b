"""An evaluation for a reader: the JSON document, and the sections of text and page."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

from aqualog import __version__
from aqualog.evaluate import score
from aqualog.evaluate.gates import GateResult
from aqualog.evaluate.records import Cell as Counts
from aqualog.evaluate.records import RunRecord
from aqualog.evaluate.run import Evaluation, Tuning
from aqualog.evaluate.sweep import RocPoint
from aqualog.report import evaluation_words as words
from aqualog.report.evaluation_figures import evaluation_figures
from aqualog.report.inputs import of_runs
from aqualog.report.sections import Cell, Figures, Headline, Lines, Para, Report, Section, Table
from aqualog.report.values import counted, fields_of, number, plain

__all__ = ["evaluation_document", "evaluation_report"]

_LEGEND = (
    "Full: detected within 0.5 s of the beginning; partial: within 2 s.\n"
    "Latency 50 / 95 %: over all partial episodes, `never` where more episodes are missed.\n"
    "Before: of full / of partial the detector was already on, on the same water.\n"
    "On water: events with contact above 0.7, counted neither as right nor as wrong."
)
_SCORES = (
    "Detector", "Drives", ("Full within 0.5 s", "full"), ("Partial within 2 s", "partial"),
    ("Partial, its wheels", "its wheels"), ("Latency 50 / 95 % [s]", "50 / 95 % s"),
    ("Already on before: full / partial [%]", "before %"),
    "False alarms", ("Per hour (95 %)", "per h (95 %)"), "Per 100 km", ("On water, contact above 0.7", "on water"),
)  # fmt: skip
_ROC = ("Detector", "Times", "Threshold", "Full", "Partial", "False alarms", ("Per hour (95 %)", "per h (95 %)"))
_MATRICES = ("recall-matrix", "alarm-matrix")
_CONFUSION = "Stretches with an event, also one that goes on from the stretch before; new events per hour"
_NOTHING = ("", "-", "–", "- / -", "–/h")
_FOOTER = (
    "Intervals: Wilson [wilson1927] for shares, exact Poisson [garwood1936] for rates, 95 %. Where those of a drive go "
    "together they count as fewer [korn1998]; with one drive each counts as one. A false alarm is an event that begins "
    "outside water and the second after it."
)


# --- sections --------------------------------------------------------------------------------------------------------


def evaluation_report(evaluation: Evaluation, *, by: Sequence[str] = (), gates: Sequence[GateResult] = ()) -> Report:
    """Verdicts, tables of detectors and configurations, confusion, situations, thresholds, rivals.

    Parameters
    ----------
    evaluation : Evaluation
    by : sequence of str
        Keys of the configuration by which the table is repeated.
    gates : sequence of GateResult
        Limits that were to be kept.
    """
    records, tuning = evaluation.records, evaluation.tuning
    scores, situations = score.score_all(records), score.situation_scores(records)
    plots, answers = evaluation_figures(evaluation), words.verdicts(records)
    groups = [
        (", ".join(f"{k} {v}" for k, v in zip(by, key, strict=True)), some)
        for key, some in (score.grouped(records, by).items() if by else ())
    ]
    tuned = words.tuning_sentences(tuning, score.score_all(tuning.before), scores) if tuning else []
    driven = sum(r.duration_s for r in records)
    sections = [
        Section("", [
            Para(f"{counted(len(records), 'drive')}, {driven / score.HOUR_S:.3g} h", "text"),
            Lines(answers or [words.headline(evaluation)]),
        ], where="text"),
        Section("", [Headline(words.headline(evaluation), answers)], "verdict", look="verdict open", where="page"),
        Section("Inputs", [Lines([x for x in [of_runs({r.name: r.checks for r in records})] if x])], "inputs",
                look="problems"),
        Section("Gates", [Table(("Gate", "Found", "Kept"), [
            (g.gate.text, g.found, "yes" if g.is_kept else "no") for g in gates
        ], "gates")]),
        Section("Not evaluated", [Lines(list(evaluation.failed.items()), most=1000)], "failed", look="problems",
                where="page"),
        Section("Situations", [Figures(_MATRICES)], "matrix-section"),
        Section("All drives", [
            replace(_with_values(Table(_SCORES, _score_rows(scores), "scores")), where="page"),
            Table(_SCORES, _score_rows(scores), where="text"), Para(_LEGEND, where="text"),
        ]),
        *(
            Section(f"{name} ({counted(len(some), 'drive')})", [Table(_SCORES, _score_rows(score.score_all(some)))],
                    where="text")
            for name, some in groups
        ),
        Section("By configuration", [_configurations(groups)], "group-section", where="page",
                fold=counted(len(groups), "configuration")),
        Section("Confusion", [_confusion(records), Para(f"{_CONFUSION}.", where="text")], "confusion-section",
                _CONFUSION, fold="each detector by what was there"),
        Section("Over thresholds and time", [Figures([n for n in plots if n not in _MATRICES])], "plot-section",
                fold="curves"),
        *_situation_sections(records, situations),
        Section("Over thresholds", [Table(_ROC, [
            (words.title_of(p.detector), f"{p.factor:.3g}", f"{p.threshold:.4g}", words.recall_text(p.full),
             words.recall_text(p.partial), str(p.false_alarms.count), words.rate_text(p.false_alarms))
            for p in evaluation.roc
        ])], where="text"),
        Section("Rivals", [Lines(words.better_sentences(records), most=1000)], "rivals"),
        Section("Thresholds proposed", [Lines(tuned, most=1000)], "tuning"),
        Section("Notes", [Lines(words.notes_of(records), most=1000)], "notes", where="page"),
    ]  # fmt: skip
    return Report("evaluation", "detections against labels", sections, _facts(evaluation), plots, _FOOTER)


def _facts(evaluation: Evaluation) -> list[tuple[str, str]]:
    records = evaluation.records
    hours, dry, km = (sum(getattr(r, n) for r in records) for n in ("duration_s", "dry_s", "dry_m"))
    facts = [
        ("drives", str(len(records))),
        ("driving", f"{number(hours / score.HOUR_S)} h"),
        ("outside water", f"{number(dry / score.HOUR_S)} h, {number(km / 1e3)} km"),
    ]
    return [*facts, ("not readable", str(len(evaluation.failed)))] if evaluation.failed else facts


def _score_rows(scores: Mapping[str, score.Score]) -> list[tuple[str | Cell, ...]]:
    return [
        (
            Cell(words.title_of(n), note="rival" if score.is_rival(n) else ""),
            str(s.runs),
            words.recall_text(s.full),
            words.recall_text(s.partial),
            words.recall_text(s.wheel_partial),
            f"{words.seconds_text(s.partial.latency(0.5))} / {words.seconds_text(s.partial.latency(0.95))}",
            " / ".join(number(100.0 * r.before_share, 0) for r in (s.full, s.partial) if r.episodes) or "–",
            str(s.false_alarms.count),
            words.rate_text(s.false_alarms),
            number(s.false_alarms.per_100km),
            str(s.on_water.count),
        )
        for n, s in scores.items()
        if s.runs
    ]


def _configurations(groups: Sequence[tuple[str, Sequence[RunRecord]]]) -> Table:
    """The scores of all configurations in one table, without columns in which nothing was measured."""
    rows = [(name, *row) for name, some in groups for row in _score_rows(score.score_all(some))]
    return _with_values(Table(("Configuration", *_SCORES), rows, "configurations", (0, 1), is_sortable=True))


def _with_values(table: Table) -> Table:
    """A table without the columns that hold no value."""
    texts = [[c if isinstance(c, str) else c.text for c in row] for row in table.rows]
    kept = [i for i in range(len(table.header)) if any(row[i] not in _NOTHING for row in texts)]
    return replace(
        table, header=[table.header[i] for i in kept], rows=[[row[i] for i in kept] for row in table.rows],
        words=[k for k, i in enumerate(kept) if i in table.words],
    )  # fmt: skip


def _confusion(records: Sequence[RunRecord]) -> Table:
    def share_text(c: Counts | None) -> str:
        return "–" if c is None else f"{c.hit}/{c.episodes} · {words.short(_per_hour(c))}/h"

    cells = score.confusion(records)
    names = list(dict.fromkeys(n for row in cells.values() for n in row))
    rows = [(words.title_of(n), *(share_text(columns.get(n)) for columns in cells.values())) for n in names]
    return Table(("Detector", *cells), rows, "confusion")


def _per_hour(c: Counts) -> float:
    return score.Rate(c.events, c.seconds, 0.0).per_hour


def _situation_sections(
    records: Sequence[RunRecord], situations: Mapping[str, Mapping[str, score.Score]]
) -> list[Section]:
    """Tables of the situations for a terminal, where a page has figures, and the coverage."""
    if len(situations) < 2:
        return []
    names = [n for n in next(iter(situations.values())) if any(s[n].runs for s in situations.values())]

    def recall(s: score.Score) -> str:
        return f"{100 * s.partial.share:.0f} % of {s.partial.episodes}" if s.runs and s.partial.episodes else "–"

    def alarms(s: score.Score) -> str:
        return words.short(s.false_alarms.per_hour) if s.runs and s.false_alarms.seconds > 0.0 else "–"

    def table(text: Callable[[score.Score], str], rows: Sequence[str]) -> Table:
        header = ("Situation", *map(words.title_of, names))
        return Table(header, [(row, *(text(situations[row][n]) for n in names)) for row in rows])

    wet = [row for row, scores in situations.items() if any(s.partial.episodes for s in scores.values())]
    return [
        Section("Recall of partial aquaplaning by situation", [table(recall, wet)], where="text"),
        Section("False alarms per hour by situation", [table(alarms, list(situations))], where="text"),
        Section("Situations that meet the targets", [Lines(words.coverage_sentences(records), "coverage")]),
    ]


# --- JSON ------------------------------------------------------------------------------------------------------------


def evaluation_document(
    evaluation: Evaluation, *, by: Sequence[str] = (), gates: Sequence[GateResult] = ()
) -> dict[str, Any]:
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
        `runs`: per drive `name`, `groups`, `seconds`, `false_alarms_s` {detector: times}, `unavailable`;
        `gates`: each `gate`, `value`, `kept`, `found` in words.
    """
    records, tuning = evaluation.records, evaluation.tuning
    return {
        "schema_version": 1,
        "tool_version": __version__,
        "drives": {
            "evaluated": len(records),
            "seconds": plain(sum((r.duration_s for r in records), 0.0)),
            "failed": dict(evaluation.failed),
        },
        "thresholds": {n: plain(x) for n, x in evaluation.thresholds.items()},
        "rivals": None if evaluation.rivals is None else dict(evaluation.rivals),
        "detectors": _scores(score.score_all(records)),
        "by": [
            {"groups": dict(zip(by, key, strict=True)), "detectors": _scores(score.score_all(some))}
            for key, some in (score.grouped(records, by).items() if by else ())
        ],
        "confusion": {
            row: {
                n: {"episodes": c.episodes, "with_event": c.hit, "events_per_hour": plain(_per_hour(c))}
                for n, c in cells.items()
            }
            for row, cells in score.confusion(records).items()
        },
        "situations": {row: _scores(scores) for row, scores in score.situation_scores(records).items()},
        "coverage": [asdict(c) for c in score.coverage(score.situation_scores(records)).values()],
        "roc": [_point(p) for p in evaluation.roc],
        "better_rivals": [
            {**fields_of(b, "rival", "against"), "situation": b.situation or None,
             **fields_of(b, "measure", "rival_value", "own_value", beyond_chance="is_sure", at_a_price="at_a_price")}
            for b in score.better_rivals(records)
        ],
        "sentences": [*words.verdicts(records), *words.better_sentences(records)],
        "tuning": None if tuning is None else _tuning(tuning),
        "runs": [
            {"name": r.name, "groups": dict(r.groups), "seconds": plain(r.duration_s),
             "false_alarms_s": {n: list(d.false_alarms) for n, d in r.detectors.items() if d.false_alarms},
             "unavailable": list(r.unavailable)} for r in records
        ],
        "gates": [{"gate": g.gate.text, "value": plain(g.value), "kept": g.is_kept, "found": g.found} for g in gates],
        "notes": words.notes_of(records),
    }  # fmt: skip


def _tuning(t: Tuning) -> dict[str, Any]:
    return {
        **fields_of(t, "rule", "limit_per_hour", "tuned_on", "reported_on", "unused", digits=None),
        "choices": [{**_point(c.point), "reason": c.reason} for c in t.choices.values()],
        "before": _scores(score.score_all(t.before)),
    }


def _recall(r: score.Recall) -> dict[str, Any]:
    return {
        **fields_of(r, "episodes", "found", recall="share", ci95="ci95", warned_before="before_share"),
        "latency_median_s": plain(r.latency(0.5)),
        "latency_95_s": plain(r.latency(0.95)),
    }


def _scores(scores: Mapping[str, score.Score]) -> dict[str, Any]:
    return {
        n: {
            **fields_of(s, drives="runs", unavailable="unavailable"),
            **{k: _recall(getattr(s, k)) for k in ("full", "partial", "wheel_full", "wheel_partial", "own")},
            "false_alarms": {
                "count": s.false_alarms.count, "hours": plain(s.false_alarms.seconds / score.HOUR_S),
                **fields_of(s.false_alarms, "per_hour", "per_hour_ci95", "per_100km", "per_100km_ci95"),
            },
            "on_water": fields_of(s.on_water, "count", "per_hour"),
        }
        for n, s in scores.items()
    }  # fmt: skip


def _point(p: RocPoint) -> dict[str, Any]:
    return {
        **fields_of(p, "detector", "factor", "threshold"),
        "full": plain(p.full.share),
        "partial": plain(p.partial.share),
        **fields_of(p.false_alarms, "per_hour", "count"),
        "hours": plain(p.false_alarms.seconds / score.HOUR_S),
    }
