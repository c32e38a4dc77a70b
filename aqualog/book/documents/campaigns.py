"""Documents of the commands on campaigns, and the JSON files that aqualog writes beside them."""

from __future__ import annotations

from aqualog.book.documents import fields as f
from aqualog.core.notation import WHEELS

__all__ = ["BATCH", "BIN_RESISTANCE", "BIN_SLIP_SLOPE", "HISTORY", "INIT", "INSPECT", "MANIFEST", "PLAN"]

_COUNT = f.count("", "")

INIT = f.Document(
    "campaign_init",
    "aqualog campaign init --json",
    "What was proposed for a folder of logs: drives, values read from names, and signals.",
    (
        *f.HEAD,
        f.text("campaign", "the campaign file"),
        f.several("written", "files that were written"),
        f.rows("drives", "each drive", (
            f.several("files", "files of the drive"),
            f.mapping("values", "cells of the table of runs that were read from names", f.text("", "")),
        )),
        f.mapping("rules", "the rule behind each column", f.text("", "")),
        f.by_name("signals", "signal map", (
            f.several("channel", "channel, or channels in order of preference"),
            f.text("unit", "unit in the map; null where the files have it", null=True),
            f.number("scale", "-", "factor in the map"),
            f.text("reason", "why this channel"),
        )),
        f.several("canonical", "signals that the logs carry under their canonical names"),
        f.mapping("blank", "drives without a value, by column", _COUNT),
        f.several("unmapped", "channels that are no signal"),
        f.mapping("left_out", "logs that were left out, and why", f.text("", "")),
        f.several("notes", "sentences on the logs and on the guesses"),
    ),
)  # fmt: skip

INSPECT = f.Document(
    "inspect_campaign",
    "aqualog inspect CAMPAIGN.toml --json",
    "The test matrix of a campaign: what was driven, how often, and what is missing.",
    (
        *f.HEAD,
        f.text("campaign", "the campaign file"),
        f.text("name", "name of the campaign"),
        f.count("runs", "runs"),
        f.obj("logs", "the logs", (
            f.count("files", "log files"),
            f.count("bytes", "size of all logs", "byte"),
            f.rows("missing", "logs that are not there", (
                f.text("log", "path"),
                f.text("place", "where the campaign names it"),
                f.count("runs", "runs that need it"),
                f.text("near", "a file with a similar name; null without one", null=True),
            )),
        )),
        f.by_name("vehicles", "cars, by vehicle file", (
            f.text("name", "name of the car"),
            f.text("drivetrain", "driven axle", ("rwd", "fwd", "awd")),
            f.number("mass", "kg", "mass"),
            f.several("given", "keys that the vehicle file sets"),
        )),
        f.mapping("constants", "keys that all runs share, with their value", f.text("", "")),
        f.mapping("factors", "keys that differ: runs by value", f.mapping("", "", _COUNT)),
        f.mapping("together", "keys that change only together with another one", f.text("", "")),
        f.mapping("others", "keys with more values than a matrix has use for", _COUNT),
        f.rows("configurations", "each combination of factors that was driven", (
            f.mapping("values", "its values; null where a run does not say", f.text("", "", null=True)),
            f.several("runs", "runs, by index from 0", _COUNT),
            f.mapping("manoeuvres", "runs by manoeuvre", _COUNT),
            f.anything("speeds_kmh", "speeds that were driven [km/h]"),
            f.text("interval", "whether the runs are enough for an interval: none below 3, wide below 5",
                 ("none", "wide", "usable")),
        )),
        f.rows("gaps", "combinations that were never driven although their neighbours were", (
            f.mapping("values", "the combination", f.text("", "")),
            f.count("beside", "neighbours that were driven"),
        )),
        f.obj("measured", "results in the store beside the campaign", (
            f.count("runs", "runs with results"),
            f.rows("failed", "runs without", (f.count("run", "index of the run"), f.text("reason", "why"))),
        )),
        f.several("notes", "sentences on the matrix"),
    ),
    files=("matrix.json",),
)  # fmt: skip

BATCH = f.Document(
    "batch",
    "aqualog batch --json",
    "What a batch did: how many logs, which failed, events by detector.",
    (
        *f.HEAD,
        f.text("campaign", "name of the campaign"),
        f.text("store", "folder or URL of the results"),
        f.count("runs", "runs of the campaign"),
        f.count("made", "logs measured now"),
        f.count("kept", "logs whose results were there"),
        f.rows("failed", "logs that failed", (f.text("log", "log"), f.text("reason", "why"))),
        f.mapping("verdicts", "runs with results by verdict", _COUNT),
        f.count("episodes", "episodes of aquaplaning in all runs"),
        f.mapping("events", "events by detector, of all runs with results", _COUNT),
    ),
    files=("campaign.json",),
)

_ESTIMATE = (
    f.number("value", "", "expected value"),
    f.number("low", "", "lower end of the 90 % interval"),
    f.number("high", "", "upper end"),
)

PLAN = f.Document(
    "plan",
    "aqualog plan --json",
    "What a batch will cost: time, memory, room in the store, shards.",
    (
        *f.HEAD,
        f.obj("logs", "the logs", (
            f.count("to_measure", "logs without results"),
            f.count("kept", "logs with results in the store"),
            f.count("failed_before", "logs that failed before"),
            f.count("missing", "logs that are not there"),
        )),
        *f.maybe(
            f.count("bytes", "size of the logs to measure; from here on missing where no log is left", "byte"),
            f.mapping("formats", "logs to measure by format", _COUNT),
            f.count("processes", "processes of the batch"),
            f.count("at_a_time", "logs that fit into memory at a time"),
            f.obj("wall_s", "time from start to end [s]", _ESTIMATE),
            f.obj("cpu_s", "computing time [s]", _ESTIMATE),
            f.obj("parts_s", "what the time consists of [s]", (
                f.number("lead", "s", "start of the leading process"),
                f.number("start_of_a_process", "s", "start of each process"),
                f.number("hashing", "s", "hashes of the logs"),
                f.obj("logs", "measuring the logs [s]", _ESTIMATE),
                f.number("tables", "s", "tables of the store"),
            )),
            f.obj("memory", "memory", (
                f.count("process_bytes", "of one process", "byte"),
                f.count("all_bytes", "of all processes, at most", "byte"),
                f.count("there_bytes", "of the machine; null where the system does not report it", "byte", null=True),
            )),
            f.obj("store", "room", (
                f.text("folder", "folder or URL of the store"),
                f.obj("bytes", "what the results take [byte]", _ESTIMATE),
                f.count("free_bytes", "free room; null behind a URL", "byte", null=True),
            )),
            f.obj("within", "answer to `--within`; null if it was not asked", (
                f.number("seconds", "s", "time that was asked for"),
                f.count("shards", "shards that end in this time; null where no number is enough", null=True),
                f.number("longest_s", "s", "time of the longest shard", null=True),
            ), null=True),
            f.rows("sample", "the logs that were measured", (
                f.text("log", "log"),
                f.text("format", "format"),
                f.count("bytes", "size", "byte"),
                f.number("wall_s", "s", "time"),
                f.number("cpu_s", "s", "computing time"),
                f.count("store_bytes", "size of the results", "byte"),
                f.text("reason", "why it failed; null if it did not", null=True),
            )),
            f.several("notes", "sentences on the estimate"),
        ),
    ),
    files=("plan.json",),
)  # fmt: skip

_ABOUT = (
    *f.HEAD,
    f.text("campaign", "name of the campaign"),
    f.several("by", "grouping keys"),
    f.number("bin_width_kmh", "km/h", "width of the bins of speed"),
    f.flag("robust", "whether outlying runs were given less weight"),
    f.mapping("left_out_samples", "samples left out, by reason", f.count("", "")),
)
_PLACE = f.maybe(
    f.text("wheel", "wheel; the row has the grouping keys `--by` beside these fields", WHEELS),
    f.text("side", "side, where the row is of one", ("left", "right")),
)


_WHEELS = f.maybe(
    f.text("wheel", "wheel, or `free`: the wheels that are not driven, together", (*WHEELS, "free")),
    f.text("side", "side, where the row is of one", ("left", "right")),
)


def _ci(name: str, unit: str) -> f.Field:
    return f.interval(name, unit, "95 % interval; null without one", null=True)


_SLOPE = (
    *_PLACE,
    *f.BIN,
    *f.open_ci("slope", "-", "slope of F_x / F_z over slip within `mu_range`"),
    *f.open_ci("intercept", "-", "slip without traction"),
    f.number("r2", "-", "share of the variance that the line explains", null=True),
    f.interval("mu_range", "-", "5 to 95 % of the traction driven; null without samples", null=True),
    f.number("attenuation", "-", "factor by which noise of the traction flattens slip over traction", null=True),
    f.number("scatter", "-", "scatter of the slopes of the runs", null=True),
    f.number("dof", "-", "degrees of freedom (Satterthwaite [satterthwaite1946])", null=True),
    f.flag(
        "reliable", "3 runs or more, an interval within a factor of 3, and a line that explains more than a constant"
    ),
    f.text("reason", "why there is no slope or no interval; null if there is", null=True),
    *f.open_ci("slope_dry", "-", "the same off the water, all speeds together"),
    f.count("runs_dry", "runs behind it"),
    f.interval("mu_range_dry", "-", "range of the traction behind it", null=True),
    *f.or_null(
        f.number("friction_dry", "-", "friction of the brush on dry road"),
        f.number("friction_wet", "-", "friction of the brush on wet road"),
        f.number("contact_ratio", "-", "share of the contact length whose brush has this slope"),
    ),
    _ci("contact_ratio_ci95", "-"),
    *f.or_null(
        f.number("expected_contact_ratio", "-", "what the model gives"),
        f.number("expected_slope", "-", "what the model gives over `mu_range`"),
        f.number("expected_slope_dry", "-", "what the model gives on dry road"),
    ),
    f.text("expected_reason", "why the model gives none; null if it does", null=True),
)

BIN_SLIP_SLOPE = f.Document(
    "bin_slipslope",
    "aqualog bin-slipslope --json",
    "Slip slope over speed per configuration and wheel, and the speed of full aquaplaning.",
    (
        *_ABOUT,
        f.mapping("definitions", "what the names mean", f.text("", "")),
        f.rows("rows", "slip slope by configuration, wheel and bin of speed; `-o FILE` writes these rows as "
             "a table, a pair `x_ci95` as `x_low` and `x_high`", _SLOPE, keys=f.PLACE_KEYS),
        f.rows("dry", "the same off the water", _SLOPE, keys=f.PLACE_KEYS),
        f.rows("delays", "by how much v_x is late, by car", (
            f.text("vehicle", "car"),
            *f.open_ci("delay_s", "s", "delay"),
            f.count("runs", "runs behind it"),
            f.count("samples", "samples behind it"),
            f.text("reason", "why there is no value; null if there is one", null=True),
        )),
        f.rows("full_aquaplaning", "speed of full aquaplaning, in up to four ways", (
            *_WHEELS,
            f.text("way", "how it was found: from slopes, minor spin-downs, full spin-downs or the margin"),
            f.text("event", "which event the speed belongs to"),
            f.text("defines", "what that event is, in words"),
            f.number("v_full_kmh", "km/h", "speed", null=True),
            _ci("v_full_ci95_kmh", "km/h"),
            f.number("exponent", "-", "exponent of the contact's fall over speed", null=True),
            f.text("rests_on", "what the speed rests on; null if it does not", null=True),
            f.text("reason", "why there is no value; null if there is one", null=True),
        ), keys=f.PLACE_KEYS),
        f.rows("spin_ups", "traction coefficient of spinning wheels", (
            *_PLACE, *f.BIN,
            *f.open_ci("mu", "-", "traction coefficient when the wheel begins to spin"),
            *f.open_ci("mu_residual", "-", "least traction coefficient while it spins"),
            f.flag("reliable", "3 runs or more"),
            f.text("reason", "why there is no value; null if there is one", null=True),
        ), keys=f.PLACE_KEYS),
        f.rows("minor_spin_downs", "minor spin-downs by wheel and bin of speed", (
            *_PLACE,
            f.number("v_low_kmh", "km/h", "lower end of the bin"),
            f.number("v_high_kmh", "km/h", "upper end of the bin"),
            f.count("passes", "passes over the water at this speed"),
            f.number("seconds", "s", "time on the water at this speed", null=True),
            f.count("events", "minor spin-downs"),
            *f.open_ci("per_s", "1/s", "minor spin-downs per second"),
            f.number("per_100_m", "1/(100 m)", "minor spin-downs per 100 m", null=True),
            *f.open_ci("share", "-", "share of the passes with one"),
            f.count("passes_with_full_spin_down", "passes in which the wheel stopped"),
            f.number("deepest_slip_median", "-", "median of the deepest slip of the events", null=True),
        ), keys=f.PLACE_KEYS),
    ),
)  # fmt: skip

BIN_RESISTANCE = f.Document(
    "bin_resistance",
    "aqualog bin-resistance --json",
    "Mean resistance measure over speed per configuration.",
    (
        *_ABOUT,
        f.flag("less_own_dry_level",
               "whether each run's level before the lane was taken off (not with `--as-measured`)"),
        f.rows("rows", "resistance by configuration and bin of speed; `-o FILE` writes these rows as a table", (
            *_PLACE, *f.BIN,
            *f.open_ci("delta_a_x", "m/s^2", "mean resistance measure (2.9)"),
            f.number("scatter", "m/s^2", "scatter of the runs", null=True),
            f.number("dof", "-", "degrees of freedom (Satterthwaite [satterthwaite1946])", null=True),
            f.flag("reliable", "3 runs or more and an interval"),
            f.text("reason", "why there is no value; null if there is one", null=True),
        ), keys=f.PLACE_KEYS),
    ),
)  # fmt: skip

MANIFEST = f.Document(
    "manifest",
    "manifest.json",
    "The state of every run of a campaign in its store.",
    (
        *f.HEAD,
        f.text("code", "stamp of the equations; results of another stamp are measured again"),
        f.text("campaign", "name of the campaign"),
        f.mapping("states", "runs by state", f.count("", "")),
        f.rows("logs", "each run", (
            f.count("run", "index from 0"),
            f.text("log", "log, or logs with ; between them"),
            f.text("state", "state", ("done", "failed", "to do")),
            f.text("reason", "why it failed; empty if it did not"),
            f.text("key", "name of its files in the store"),
            f.flag("truncated", "whether a file of the log is cut off or damaged: a part is missing"),
        )),
    ),
    files=("NAME.store/manifest.json",),
)  # fmt: skip

HISTORY = f.Document(
    "history",
    "history file",
    "Dry slip slopes of a car from earlier drives.",
    (
        f.HEAD[0],
        f.mapping("slip_slope_history", "by configuration, then by place (left, right, axle)", f.mapping(
            "", "", f.rows("", "", (
            f.number("max", "-", "greatest slope of the period"),
            f.number("mean", "-", "mean slope of the period"),
            f.number("seconds", "s", "length of the period"),
            f.text("drive", "name of the drive by its content; empty if unknown"),
        )))),
    ),
    files=("FILE of --history",),
)  # fmt: skip
