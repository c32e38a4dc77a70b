"""Documents of the commands on campaigns: init, inspect, batch, plan."""

from __future__ import annotations

from aqualog.book.documents.fields import (
    HEAD,
    Document,
    anything,
    by_name,
    count,
    mapping,
    maybe,
    number,
    obj,
    rows,
    several,
    text,
)

__all__ = ["BATCH", "INIT", "INSPECT", "PLAN"]

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
