"""Documents of the commands on campaigns, and the JSON files that aqualog writes beside them."""

from __future__ import annotations

from aqualog.book.documents.fields import (
    BIN,
    HEAD,
    PLACE_KEYS,
    Document,
    Field,
    anything,
    by_name,
    count,
    flag,
    interval,
    mapping,
    maybe,
    number,
    obj,
    open_ci,
    or_null,
    rows,
    several,
    text,
)
from aqualog.core.notation import WHEELS

__all__ = ["BATCH", "BIN_RESISTANCE", "BIN_SLIP_SLOPE", "HISTORY", "INIT", "INSPECT", "MANIFEST", "PLAN"]

_COUNT = count("", "")

INIT = Document(
    "campaign_init",
    "aqualog campaign init --json",
    "What was proposed for a folder of logs: drives, values read from names, and signals.",
    (
        *HEAD,
        text("campaign", "the campaign file"),
        several("written", "files that were written"),
        rows("drives", "each drive", (
            several("files", "files of the drive"),
            mapping("values", "cells of the table of runs that were read from names", text("", "")),
        )),
        mapping("rules", "the rule behind each column", text("", "")),
        by_name("signals", "signal map", (
            several("channel", "channel, or channels in order of preference"),
            text("unit", "unit in the map; null where the files have it", null=True),
            number("scale", "-", "factor in the map"),
            text("reason", "why this channel"),
        )),
        several("canonical", "signals that the logs carry under their canonical names"),
        mapping("blank", "drives without a value, by column", _COUNT),
        several("unmapped", "channels that are no signal"),
        mapping("left_out", "logs that were left out, and why", text("", "")),
        several("notes", "sentences on the logs and on the guesses"),
    ),
)  # fmt: skip

INSPECT = Document(
    "inspect_campaign",
    "aqualog inspect CAMPAIGN.toml --json",
    "The test matrix of a campaign: what was driven, how often, and what is missing.",
    (
        *HEAD,
        text("campaign", "the campaign file"),
        text("name", "name of the campaign"),
        count("runs", "runs"),
        obj("logs", "the logs", (
            count("files", "log files"),
            count("bytes", "size of all logs", "byte"),
            rows("missing", "logs that are not there", (
                text("log", "path"),
                text("place", "where the campaign names it"),
                count("runs", "runs that need it"),
                text("near", "a file with a similar name; null without one", null=True),
            )),
        )),
        by_name("vehicles", "cars, by vehicle file", (
            text("name", "name of the car"),
            text("drivetrain", "driven axle", ("rwd", "fwd", "awd")),
            number("mass", "kg", "mass"),
            several("given", "keys that the vehicle file sets"),
        )),
        mapping("constants", "keys that all runs share, with their value", text("", "")),
        mapping("factors", "keys that differ: runs by value", mapping("", "", _COUNT)),
        mapping("together", "keys that change only together with another one", text("", "")),
        mapping("others", "keys with more values than a matrix has use for", _COUNT),
        rows("configurations", "each combination of factors that was driven", (
            mapping("values", "its values; null where a run does not say", text("", "", null=True)),
            several("runs", "runs, by index from 0", _COUNT),
            mapping("manoeuvres", "runs by manoeuvre", _COUNT),
            anything("speeds_kmh", "speeds that were driven [km/h]"),
            text("interval", "whether the runs are enough for an interval: none below 3, wide below 5",
                 ("none", "wide", "usable")),
        )),
        rows("gaps", "combinations that were never driven although their neighbours were", (
            mapping("values", "the combination", text("", "")),
            count("beside", "neighbours that were driven"),
        )),
        obj("measured", "results in the store beside the campaign", (
            count("runs", "runs with results"),
            rows("failed", "runs without", (count("run", "index of the run"), text("reason", "why"))),
        )),
        several("notes", "sentences on the matrix"),
    ),
    files=("matrix.json",),
)  # fmt: skip

BATCH = Document(
    "batch",
    "aqualog batch --json",
    "What a batch did: how many logs, which failed, events by detector.",
    (
        *HEAD,
        text("campaign", "name of the campaign"),
        text("store", "folder or URL of the results"),
        count("runs", "runs of the campaign"),
        count("made", "logs measured now"),
        count("kept", "logs whose results were there"),
        rows("failed", "logs that failed", (text("log", "log"), text("reason", "why"))),
        mapping("verdicts", "runs with results by verdict", _COUNT),
        count("episodes", "episodes of aquaplaning in all runs"),
        mapping("events", "events by detector, of all runs with results", _COUNT),
    ),
    files=("campaign.json",),
)

_ESTIMATE = (
    number("value", "", "expected value"),
    number("low", "", "lower end of the 90 % interval"),
    number("high", "", "upper end"),
)

PLAN = Document(
    "plan",
    "aqualog plan --json",
    "What a batch will cost: time, memory, room in the store, shards.",
    (
        *HEAD,
        obj("logs", "the logs", (
            count("to_measure", "logs without results"),
            count("kept", "logs with results in the store"),
            count("failed_before", "logs that failed before"),
            count("missing", "logs that are not there"),
        )),
        *maybe(
            count("bytes", "size of the logs to measure; from here on missing where no log is left", "byte"),
            mapping("formats", "logs to measure by format", _COUNT),
            count("processes", "processes of the batch"),
            count("at_a_time", "logs that fit into memory at a time"),
            obj("wall_s", "time from start to end [s]", _ESTIMATE),
            obj("cpu_s", "computing time [s]", _ESTIMATE),
            obj("parts_s", "what the time consists of [s]", (
                number("lead", "s", "start of the leading process"),
                number("start_of_a_process", "s", "start of each process"),
                number("hashing", "s", "hashes of the logs"),
                obj("logs", "measuring the logs [s]", _ESTIMATE),
                number("tables", "s", "tables of the store"),
            )),
            obj("memory", "memory", (
                count("process_bytes", "of one process", "byte"),
                count("all_bytes", "of all processes, at most", "byte"),
                count("there_bytes", "of the machine; null where the system does not report it", "byte", null=True),
            )),
            obj("store", "room", (
                text("folder", "folder or URL of the store"),
                obj("bytes", "what the results take [byte]", _ESTIMATE),
                count("free_bytes", "free room; null behind a URL", "byte", null=True),
            )),
            obj("within", "answer to `--within`; null if it was not asked", (
                number("seconds", "s", "time that was asked for"),
                count("shards", "shards that end in this time; null where no number is enough", null=True),
                number("longest_s", "s", "time of the longest shard", null=True),
            ), null=True),
            rows("sample", "the logs that were measured", (
                text("log", "log"),
                text("format", "format"),
                count("bytes", "size", "byte"),
                number("wall_s", "s", "time"),
                number("cpu_s", "s", "computing time"),
                count("store_bytes", "size of the results", "byte"),
                text("reason", "why it failed; null if it did not", null=True),
            )),
            several("notes", "sentences on the estimate"),
        ),
    ),
    files=("plan.json",),
)  # fmt: skip

_ABOUT = (
    *HEAD,
    text("campaign", "name of the campaign"),
    several("by", "grouping keys"),
    number("bin_width_kmh", "km/h", "width of the bins of speed"),
    flag("robust", "whether outlying runs were given less weight"),
    mapping("left_out_samples", "samples left out, by reason", count("", "")),
)
_PLACE = maybe(
    text("wheel", "wheel; the row has the grouping keys `--by` beside these fields", WHEELS),
    text("side", "side, where the row is of one", ("left", "right")),
)


_WHEELS = maybe(
    text("wheel", "wheel, or `free`: the wheels that are not driven, together", (*WHEELS, "free")),
    text("side", "side, where the row is of one", ("left", "right")),
)


def _ci(name: str, unit: str) -> Field:
    return interval(name, unit, "95 % interval; null without one", null=True)


_SLOPE = (
    *_PLACE,
    *BIN,
    *open_ci("slope", "-", "slope of F_x / F_z over slip within `mu_range`"),
    *open_ci("intercept", "-", "slip without traction"),
    number("r2", "-", "share of the variance that the line explains", null=True),
    interval("mu_range", "-", "5 to 95 % of the traction driven; null without samples", null=True),
    number("attenuation", "-", "factor by which noise of the traction flattens slip over traction", null=True),
    number("scatter", "-", "scatter of the slopes of the runs", null=True),
    number("dof", "-", "degrees of freedom (Satterthwaite [satterthwaite1946])", null=True),
    flag("reliable", "3 runs or more, an interval within a factor of 3, and a line that explains more than a constant"),
    text("reason", "why there is no slope or no interval; null if there is", null=True),
    *open_ci("slope_dry", "-", "the same off the water, all speeds together"),
    count("runs_dry", "runs behind it"),
    interval("mu_range_dry", "-", "range of the traction behind it", null=True),
    *or_null(
        number("friction_dry", "-", "friction of the brush on dry road"),
        number("friction_wet", "-", "friction of the brush on wet road"),
        number("contact_ratio", "-", "share of the contact length whose brush has this slope"),
    ),
    _ci("contact_ratio_ci95", "-"),
    *or_null(
        number("expected_contact_ratio", "-", "what the model gives"),
        number("expected_slope", "-", "what the model gives over `mu_range`"),
        number("expected_slope_dry", "-", "what the model gives on dry road"),
    ),
    text("expected_reason", "why the model gives none; null if it does", null=True),
)

BIN_SLIP_SLOPE = Document(
    "bin_slipslope",
    "aqualog bin-slipslope --json",
    "Slip slope over speed per configuration and wheel, and the speed of full aquaplaning.",
    (
        *_ABOUT,
        mapping("definitions", "what the names mean", text("", "")),
        rows("rows", "slip slope by configuration, wheel and bin of speed; `-o FILE` writes these rows as "
             "a table, a pair `x_ci95` as `x_low` and `x_high`", _SLOPE, keys=PLACE_KEYS),
        rows("dry", "the same off the water", _SLOPE, keys=PLACE_KEYS),
        rows("delays", "by how much v_x is late, by car", (
            text("vehicle", "car"),
            *open_ci("delay_s", "s", "delay"),
            count("runs", "runs behind it"),
            count("samples", "samples behind it"),
            text("reason", "why there is no value; null if there is one", null=True),
        )),
        rows("full_aquaplaning", "speed of full aquaplaning, in up to four ways", (
            *_WHEELS,
            text("way", "how it was found: from slopes, minor spin-downs, full spin-downs or the margin"),
            text("event", "which event the speed belongs to"),
            text("defines", "what that event is, in words"),
            number("v_full_kmh", "km/h", "speed", null=True),
            _ci("v_full_ci95_kmh", "km/h"),
            number("exponent", "-", "exponent of the contact's fall over speed", null=True),
            text("rests_on", "what the speed rests on; null if it does not", null=True),
            text("reason", "why there is no value; null if there is one", null=True),
        ), keys=PLACE_KEYS),
        rows("spin_ups", "traction coefficient of spinning wheels", (
            *_PLACE, *BIN,
            *open_ci("mu", "-", "traction coefficient when the wheel begins to spin"),
            *open_ci("mu_residual", "-", "least traction coefficient while it spins"),
            flag("reliable", "3 runs or more"),
            text("reason", "why there is no value; null if there is one", null=True),
        ), keys=PLACE_KEYS),
        rows("minor_spin_downs", "minor spin-downs by wheel and bin of speed", (
            *_PLACE,
            number("v_low_kmh", "km/h", "lower end of the bin"),
            number("v_high_kmh", "km/h", "upper end of the bin"),
            count("passes", "passes over the water at this speed"),
            number("seconds", "s", "time on the water at this speed", null=True),
            count("events", "minor spin-downs"),
            *open_ci("per_s", "1/s", "minor spin-downs per second"),
            number("per_100_m", "1/(100 m)", "minor spin-downs per 100 m", null=True),
            *open_ci("share", "-", "share of the passes with one"),
            count("passes_with_full_spin_down", "passes in which the wheel stopped"),
            number("deepest_slip_median", "-", "median of the deepest slip of the events", null=True),
        ), keys=PLACE_KEYS),
    ),
)  # fmt: skip

BIN_RESISTANCE = Document(
    "bin_resistance",
    "aqualog bin-resistance --json",
    "Mean resistance measure over speed per configuration.",
    (
        *_ABOUT,
        flag("less_own_dry_level", "whether each run's level before the lane was taken off (not with `--as-measured`)"),
        rows("rows", "resistance by configuration and bin of speed; `-o FILE` writes these rows as a table", (
            *_PLACE, *BIN,
            *open_ci("delta_a_x", "m/s^2", "mean resistance measure (2.9)"),
            number("scatter", "m/s^2", "scatter of the runs", null=True),
            number("dof", "-", "degrees of freedom (Satterthwaite [satterthwaite1946])", null=True),
            flag("reliable", "3 runs or more and an interval"),
            text("reason", "why there is no value; null if there is one", null=True),
        ), keys=PLACE_KEYS),
    ),
)  # fmt: skip

MANIFEST = Document(
    "manifest",
    "manifest.json",
    "The state of every run of a campaign in its store.",
    (
        *HEAD,
        text("code", "stamp of the equations; results of another stamp are measured again"),
        text("campaign", "name of the campaign"),
        mapping("states", "runs by state", count("", "")),
        rows("logs", "each run", (
            count("run", "index from 0"),
            text("log", "log, or logs with ; between them"),
            text("state", "state", ("done", "failed", "to do")),
            text("reason", "why it failed; empty if it did not"),
            text("key", "name of its files in the store"),
            flag("truncated", "whether a file of the log ends before its end"),
        )),
    ),
    files=("NAME.store/manifest.json",),
)  # fmt: skip

HISTORY = Document(
    "history",
    "history file",
    "Dry slip slopes of a car from earlier drives.",
    (
        HEAD[0],
        mapping("slip_slope_history", "by configuration, then by place (left, right, axle)", mapping(
            "", "", rows("", "", (
            number("max", "-", "greatest slope of the period"),
            number("mean", "-", "mean slope of the period"),
            number("seconds", "s", "length of the period"),
            text("drive", "name of the drive by its content; empty if unknown"),
        )))),
    ),
    files=("FILE of --history",),
)  # fmt: skip
