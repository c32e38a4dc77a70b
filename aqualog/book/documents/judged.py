"""Documents of `aqualog evaluate`, `diagnose`, `figures` and `reproduce`."""

from __future__ import annotations

from aqualog.book.documents.fields import (
    HEAD,
    TERMS,
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
    with_ci,
)

__all__ = ["DIAGNOSE", "EVALUATE", "FIGURES", "REPRODUCE"]

_PARAMETER = (
    number("value", "unit of the parameter", "estimate", null=True),
    interval("ci95", "unit of the parameter", "95 % interval"),
    text("unit", "unit"),
)
_CAUSE = (
    text("effect", "name of the effect, see the page of effects"),
    text("where", "its place; null for the whole car", null=True),
    text("key", "`effect` or `effect@where`"),
    by_name("parameters", "each parameter", _PARAMETER),
    several("explains", "channels that it explains"),
    text("sentence", "the cause in words"),
)
_RATES = (
    text("detector", "detector"),
    count("false_alarms_before", "false alarms on simulated dry drives, without the causes", null=True),
    count("false_alarms_after", "the same with them", null=True),
    *or_null(
        number("distance_km", "km", "length of these drives"),
        number("per_100km_before", "1/(100 km)", "rate without the causes"),
        number("per_100km_after", "1/(100 km)", "rate with them"),
        number("latency_before_s", "s", "time to the warning on simulated wet drives, without the causes"),
        number("latency_after_s", "s", "the same with them"),
    ),
    count("found_before", "wet passes found without the causes", null=True),
    count("found_after", "the same with them", null=True),
    count("passes", "wet passes", null=True),
)
_ERRORS = (
    text("unit", "unit of the channel"),
    *or_null(
        number("rmse_before", "unit of the channel", "error one step ahead, of the base"),
        number("rmse_after", "unit of the channel", "the same with the causes"),
        number("rmse_change", "-", "relative change, negative where the error falls"),
        number("free_before", "unit of the channel", "error after half a minute of free running, of the base"),
        number("free_after", "unit of the channel", "the same with the causes"),
        number("free_change", "-", "relative change"),
    ),
)

DIAGNOSE = Document(
    "diagnose",
    "aqualog diagnose --json",
    "What the simulation gets wrong: the cause, its size, how sure, and what it gains.",
    (
        *HEAD,
        text("vehicle", "name of the car"),
        several("logs", "the logs as they were named"),
        several("drives", "the drives that were used"),
        number("duration_s", "s", "their length", null=True),
        number("used_s", "s", "time used", null=True),
        text("verdict", "all six are results", ("no_effect", "named", "compound", "cannot_tell", "unexplained",
             "not_testable")),
        text("sentence", "the verdict in words"),
        rows("causes", "the causes; with `cannot_tell` the set that the log cannot separate", _CAUSE),
        several("alternatives", "keys of other sets of causes that explain it about as well", several("", "")),
        rows("alternative_sets", "the same with their estimates", (
            rows("causes", "the causes of the set", _CAUSE),
            number("evidence_ratio", "-", "evidence of the verdict's set over this one", null=True),
        )),
        rows("agreement", "of several drives: whether each by itself agrees", (
            text("key", "cause"),
            text("parameter", "parameter"),
            number("p_value", "-", "probability of such differences by chance", null=True),
            flag("holds", "whether the drives agree"),
            rows("drives", "each drive", (
                text("drive", "drive"),
                *_PARAMETER,
                number("from_others", "unit of the parameter", "estimate from the other drives", null=True),
                number("log_score_gain", "nats", "gain on this drive with the estimate from the others", null=True),
            )),
        )),
        rows("unexplained", "what no effect of the library explains", (
            text("channel", "residual"),
            several("depends_on", "signals that it is a function of"),
            number("share", "-", "share of the residual's variance", null=True),
            number("p_value", "-", "probability by chance", null=True),
            several("x", "values of these signals, a row per point", several("", "", number("", "", "", null=True))),
            several("f", "the function there", number("", "unit of the channel", "", null=True)),
            several("low", "lower end of its band", number("", "unit of the channel", "", null=True)),
            several("high", "upper end of its band", number("", "unit of the channel", "", null=True)),
            several("proxies", "signals that go along with them"),
            text("nearest", "the effect that looks most like it; null without one", null=True),
            number("cosine", "-", "how much it looks like it, 0 to 1", null=True),
            text("sentence", "the same in words"),
        )),
        obj("gain", "what the causes gain in the model; null without causes", (
            by_name("channel", "errors by residual", _ERRORS),
            number("heldout_log_score_gain", "nats", "gain on held-out drives; null without them", null=True),
            interval("ci95", "nats", "95 % interval"),
            number("in_sample_log_score_gain", "nats", "gain on the diagnosed drives; null with held-out ones",
                   null=True),
            interval("in_sample_ci95", "nats", "95 % interval"),
            text("unit", "unit of the gains"),
            several("heldout", "the held-out drives"),
            flag("in_sample", "whether the gain is on the diagnosed drives themselves"),
            rows("consequences", "what it means for the detectors", _RATES),
            several("notes", "sentences on the gain"),
        ), null=True),
        number("false_alarm_level", "-", "level of the test for any effect at all; null if it was not made", null=True),
        obj("significance", "that test; null if it was not made", (
            *or_null(
                number("statistic", "-", "statistic"),
                number("threshold", "-", "its threshold"),
                number("p_value", "-", "probability by chance"),
                number("level", "-", "level of the test"),
                number("achieved_level", "-", "level that so many surrogates can resolve"),
            ),
            count("surrogates", "surrogates of the noise", null=True),
        ), null=True),
        mapping("detection_limits", "smallest size that would have been found, by cause, in words",
                text("", "", null=True)),
        rows("limits", "the same as numbers", (
            text("key", "cause"),
            text("effect", "effect"),
            text("where", "place", null=True),
            number("size", "unit", "smallest size found with a probability of 0.9", null=True),
            text("unit", "unit"),
            number("smallest_worth_naming", "unit", "smallest size that is worth naming", null=True),
            number("ratio", "-", "one over the other", null=True),
        )),
        rows("isolability", "causes that this log cannot distinguish", (
            text("effect", "cause"),
            several("rivals", "causes that look like it"),
            number("separation", "-", "distance of their signatures", null=True),
            number("p_correct", "-", "probability of the right name", null=True),
            text("relation", "how their sizes go together; empty without a relation"),
            several("sizes", "sizes at which they are compared", number("", "", "", null=True)),
        )),
        obj("isolability_pairs", "probability of the right name for each pair", (
            several("effects", "causes, in the order of rows and columns"),
            several("p_correct", "rows of the table; null on the diagonal",
                    several("", "", number("", "-", "", null=True))),
        )),
        obj("next_manoeuvre", "what to drive next; null where no drive would help", (
            text("name", "manoeuvre"),
            several("separates", "pairs of causes that it separates", several("", "")),
            text("sentence", "the same in words"),
            *or_null(
                number("separation_now", "-", "distance of the signatures in this log"),
                number("separation_then", "-", "distance with the manoeuvre"),
                number("p_correct_now", "-", "probability of the right name in this log"),
                number("p_correct_then", "-", "probability with the manoeuvre"),
                number("minutes", "min", "time that it takes"),
            ),
        ), null=True),
        text("extended_model", "model file that was written; null without `-o`", null=True),
        rows("model", "terms of the extended model", TERMS),
        several("channels", "residuals that were judged"),
        mapping("channel_units", "their units", text("", "")),
        mapping("untested", "effects that were not tested, and why", text("", "")),
        obj("criteria", "probabilities behind the words", (
            number("interval", "-", "level of all intervals"),
            number("power", "-", "probability at the detection limits"),
            number("told_apart", "-", "probability of the right name from which two causes count as distinguished"),
        )),
        several("notes", "sentences on the logs and on the diagnosis"),
    ),
    files=("diagnosis.json",),
)  # fmt: skip

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
        *with_ci("per_100km", "1/(100 km)", "rate over the way"),
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

EVALUATE = Document(
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
        rows("gates", "limits of `--gate`", (
            text("gate", "the gate as it was given"),
            number("value", "unit of the measure", "what came out; null where it was not measured, or is infinite",
                   null=True),
            flag("kept", "whether the gate was kept"),
            text("found", "the same in words"),
        )),
        several("notes", "sentences on the evaluation"),
    ),
    files=("evaluation.json",),
)  # fmt: skip

FIGURES = Document(
    "figures",
    "aqualog figures --json",
    "Figures of the thesis that were made, with what they say about its claims.",
    (
        *HEAD,
        rows("figures", "each figure", (
            text("figure", "number in the thesis"),
            text("title", "title"),
            rows("findings", "claims that it is evidence for", (
                text("claim", "claim, C1 to C118"),
                text("thesis", "what the thesis says"),
                text("criterion", "what must come out"),
                text("found", "what came out"),
                number("value", "unit", "the same as a number", null=True),
                interval("ci95", "unit", "95 % interval; null without one", null=True),
                text("unit", "unit; null without one", null=True),
                text("verdict", "verdict"),
                text("reason", "why it differs; empty if it does not"),
            )),
            obj("runs", "runs behind it; null where it needs none", (
                text("campaign", "campaign"),
                rows("used", "runs used", (text("run", "run"), text("shown_as", "what the figure calls it"))),
                rows("left_out", "runs left out", (text("reason", "why"), count("runs", "how many"))),
            ), null=True),
        )),
        rows("not_made", "figures that could not be made", (text("figure", "number"), text("reason", "why"))),
        several("files", "files that were written"),
    ),
)  # fmt: skip

REPRODUCE = Document(
    "reproduce",
    "aqualog reproduce --json",
    "Every claim of the thesis with its checks and its verdict.",
    (
        *HEAD,
        several("conditions", "how it was made, in words"),
        mapping("counts", "claims by verdict", count("", "")),
        rows("claims", "each claim", (
            text("claim", "C1 to C118"),
            text("where", "place in the thesis"),
            text("kind", "what kind of claim"),
            text("statement", "what the thesis says"),
            text("verdict", "verdict: as its checks together"),
            rows("checks", "each check", (
                text("part", "part of the claim"),
                text("statement", "that part"),
                text("criterion", "what must come out"),
                text("found", "what came out"),
                number("value", "unit", "the same as a number", null=True),
                interval("interval", "unit", "95 % interval, or the range that `found` names; or null", null=True),
                text("unit", "unit; empty without one"),
                text("verdict", "verdict of the check"),
                text("reason", "why it differs; empty if it does not"),
                text("source", "drives and seeds, or the figure"),
            )),
        )),
        rows("figures", "figures that were made", (
            text("figure", "number"), text("title", "title"), text("table", "file of its numbers"),
        )),
        mapping("figures_missing", "figures that could not be made, and why", text("", "")),
    ),
    files=("reproduction.json",),
)  # fmt: skip
