"""`aqualog evaluate --json`."""

from __future__ import annotations

from aqualog.book.documents.fields import (
    HEAD,
    Document,
    by_name,
    count,
    flag,
    interval,
    mapping,
    number,
    obj,
    or_null,
    rows,
    several,
    text,
)

__all__ = ["DOCUMENT"]

_RECALL = (
    count("episodes", "episodes of that effect"),
    count("found", "episodes found in time: full within 0.5 s, partial within 2 s"),
    number("recall", "-", "share", null=True),
    interval("ci95", "-", "95 % interval (Wilson [wilson1927])"),
    *or_null(
        number("warned_before", "-", "share in which the warning was there before"),
        number("latency_median_s", "s", "median time to the warning; null: never"),
        number("latency_95_s", "s", "time within which 95 % are found; null: never"),
    ),
)
_SCORE = (
    count("drives", "drives in which the detector could run"),
    count("unavailable", "drives in which it could not"),
    obj("full", "full aquaplaning", _RECALL),
    obj("partial", "partial aquaplaning", _RECALL),
    obj("wheel_full", "full aquaplaning of the wheels that it judges", _RECALL),
    obj("wheel_partial", "partial aquaplaning of these wheels", _RECALL),
    obj("own", "labels of its own name", _RECALL),
    obj("false_alarms", "events outside water", (
        count("count", "events"),
        number("hours", "h", "time outside water"),
        number("per_hour", "1/h", "rate", null=True),
        interval("per_hour_ci95", "1/h", "95 % interval (exact Poisson)"),
        number("per_100km", "1/(100 km)", "rate over the way", null=True),
        interval("per_100km_ci95", "1/(100 km)", "95 % interval"),
    )),
    obj("on_water", "events on water with a contact above 0.7", (
        count("count", "events"), number("per_hour", "1/h", "rate", null=True),
    )),
)  # fmt: skip
_POINT = (
    text("detector", "detector"),
    number("factor", "-", "factor on the threshold"),
    number("threshold", "unit of the statistic", "threshold"),
    number("full", "-", "recall of full aquaplaning", null=True),
    number("partial", "-", "recall of partial aquaplaning", null=True),
    number("per_hour", "1/h", "false alarms per hour", null=True),
    count("count", "false alarms"),
    number("hours", "h", "time outside water"),
)

DOCUMENT = Document(
    "evaluate",
    "aqualog evaluate --json",
    "Detections beside what was there: recall, latency, false alarms, confusion.",
    (
        *HEAD,
        obj("drives", "the drives", (
            count("evaluated", "drives"),
            number("seconds", "s", "their length"),
            mapping("failed", "drives that cannot be evaluated, and why", text("", "")),
        )),
        mapping("thresholds", "threshold of each detector", number("", "unit of the statistic", "")),
        mapping("rivals", "threshold of each rival; null without `--rivals`", number("", "unit of the statistic", ""),
                null=True),
        by_name("detectors", "score of each detector", _SCORE),
        rows("by", "the same per configuration, with `--by`", (
            mapping("groups", "value of each key; null where a run does not say", text("", "", null=True)),
            by_name("detectors", "score of each detector", _SCORE),
        )),
        mapping("confusion", "what was there, by detector", by_name("", "", (
            count("episodes", "episodes"),
            count("with_event", "episodes with an event of the detector"),
            number("events_per_hour", "1/h", "events per hour", null=True),
        ))),
        mapping("situations", "score by manoeuvre and detector", by_name("", "", _SCORE)),
        rows("coverage", "in how many situations a detector does what is asked for (C78)", (
            text("detector", "detector"),
            count("found", "situations with aquaplaning in which it is found at the recall asked for"),
            count("of_aquaplaning", "situations with aquaplaning"),
            count("quiet", "other situations in which it is silent"),
            count("of_dry", "other situations"),
        )),
        rows("roc", "scores at other thresholds, with `--roc` or `--tune`", _POINT),
        rows("better_rivals", "measures in which a rival is better", (
            text("rival", "rival"),
            text("against", "detector of the thesis"),
            text("situation", "situation; null for all together", null=True),
            text("measure", "measure"),
            number("rival_value", "", "its value of the rival", null=True),
            number("own_value", "", "its value of the detector", null=True),
            flag("beyond_chance", "whether the intervals exclude chance"),
            flag("at_a_price", "whether the rival is worse in another measure"),
        )),
        several("sentences", "the same in words"),
        obj("tuning", "result of `--tune`; null without it", (
            text("rule", "rule of the choice"),
            number("limit_per_hour", "1/h", "most false alarms per hour"),
            several("tuned_on", "drives that the thresholds were chosen on"),
            several("reported_on", "drives that the scores are of"),
            several("unused", "drives that belong to neither"),
            rows("choices", "the chosen thresholds", (*_POINT, text("reason", "why this one"))),
            by_name("before", "scores with the thresholds as they were", _SCORE),
        ), null=True),
        rows("runs", "each drive", (
            text("name", "drive"),
            mapping("groups", "its configuration", text("", "")),
            number("seconds", "s", "length"),
            mapping("false_alarms_s", "begins of false alarms, by detector [s]", several("", "", number("", "s", ""))),
            several("unavailable", "detectors that could not run"),
        )),
        several("notes", "sentences on the evaluation"),
    ),
    files=("evaluation.json",),
)  # fmt: skip
