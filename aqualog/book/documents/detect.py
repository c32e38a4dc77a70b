"""`aqualog detect --json`, and `events.json`."""

from __future__ import annotations

from aqualog.book.documents.fields import (
    HEAD,
    Document,
    by_name,
    count,
    flag,
    mapping,
    maybe,
    number,
    obj,
    or_null,
    rows,
    several,
    text,
)
from aqualog.book.documents.shared import EVENT, EVIDENCE, FAULTS, LACKING, TERMS

__all__ = ["DOCUMENT"]

_SIGNAL = (
    text("channel", "channel of the log"),
    text("unit", "unit of the signal inside aqualog"),
    number("rate_hz", "Hz", "rate of the channel", null=True),
    *maybe(
        text("file", "file that holds it"),
        text("source_unit", "unit in the file", null=True),
        number("missing_fraction", "-", "share of the drive without a value", null=True),
        count("samples", "samples of the channel"),
        count("not_finite", "samples that are no numbers; left out"),
        count("out_of_range", "samples outside the signal's range; left out"),
        count("invalid_code", "samples with a code for \"no value\"; left out"),
        count("frozen", "samples in which the sensor repeats itself; left out"),
    ),
)  # fmt: skip

_SLOPE = (
    text("place", "side, or axle of an all-wheel drive", ("left", "right", "axle")),
    text("wheel", "driven wheel; null for an axle", null=True),
    *or_null(
        number("slope", "-", "slip slope C_s / F_z at the end"),
        number("slope_sd", "-", "its standard deviation, by the filter"),
        number("reference", "-", "dry slope that it is compared with"),
    ),
    text("reference_from", "where the dry slope comes from; empty without one",
         ("history", "vehicle file", "this drive", "")),
    number("beta", "-", "slope ratio of the axles; null with one driven axle", null=True),
    number("offset", "-", "offset of the slip", null=True),
    count("changes", "changes that the filter found"),
    number("judged_s", "s", "time in which the slope was compared with the dry one", null=True),
    number("dropped_s", "s", "time of that below half of it", null=True),
    mapping("seconds", "time in each state of the filter", number("", "s", "", null=True)),
    mapping("inactive", "time in which the filter rests, by reason", number("", "s", "", null=True)),
)  # fmt: skip

DOCUMENT = Document(
    "detect",
    "aqualog detect --json",
    "What the detectors found in one drive: events, what could not be judged, and the quality of the log.",
    (
        *HEAD,
        text("log", "the files as they were named"),
        several("files", "files of the drive"),
        text("start_time", "absolute time of the first sample, UTC; null where the log has none", null=True),
        number("duration_s", "s", "length of the drive"),
        number("sample_rate_hz", "Hz", "rate of the common time grid"),
        text("vehicle", "name of the car"),
        by_name("signals", "every signal that the drive has", _SIGNAL),
        rows("events", "every event, by begin", (*EVENT, obj("evidence", "what was measured in the event; the fields "
             "depend on the detector", EVIDENCE))),
        rows("unavailable", "detectors that cannot run", LACKING),
        rows("limited", "detectors that ran without one of their conditions", LACKING),
        rows("slip_slope", "state of the slip-slope filter at the end, by place", _SLOPE),
        obj("quality", "what was wrong with the log", (
            count("dropped_samples", "samples that were left out"),
            count("time_jumps", "jumps of the time"),
            flag("truncated", "whether a file ends before its end"),
            flag("unfinalised", "whether the logger has not finished a file"),
            count("frozen_samples", "samples of sensors that stand still; left out"),
            *FAULTS,
            several("notes", "sentences on the log and on the judgement"),
        )),
        rows("model", "effects that the detectors allowed for, with `--model`; null without", TERMS, null=True),
    ),
    files=("events.json",),
)  # fmt: skip
