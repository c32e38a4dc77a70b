"""Documents of the commands on drives."""

from __future__ import annotations

from aqualog.book.documents.fields import (
    CHECKS,
    DRIVE_CHECKS,
    EVENT,
    EVIDENCE,
    FAULTS,
    HEAD,
    JUDGEMENT,
    LACKING,
    TERMS,
    Document,
    by_name,
    count,
    flag,
    interval,
    mapping,
    maybe,
    number,
    obj,
    or_null,
    rows,
    several,
    text,
    with_ci,
)
from aqualog.core.notation import WHEELS

__all__ = ["ALIGN", "CACHE", "CALIBRATE", "DETECT", "DOCTOR", "INSPECT", "SIMULATE", "SLIP_SLOPE"]

_SIGNAL = (
    text("channel", "channel of the log"),
    text("unit", "unit of the signal inside aqualog"),
    number("rate_hz", "Hz", "samples per second outside gaps", null=True),
    *maybe(
        text("file", "file that holds it"),
        text("source_unit", "unit in the file", null=True),
        number("missing_fraction", "-", "share of the drive without a value", null=True),
        count("samples", "samples of the channel"),
        count("not_finite", "samples that are no numbers; left out"),
        count("out_of_range", "samples outside the signal's range; left out"),
        count("invalid_code", "samples with a code for \"no value\"; left out"),
        count("frozen", "samples in which the sensor repeats itself; left out"),
        count("joined", "samples with which a logger filled a gap by a straight line; left out"),
    ),
)  # fmt: skip

_FILTER_STATE = (
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

DETECT = Document(
    "detect",
    "aqualog detect --json",
    "What the detectors found in one drive: verdict, episodes, events, what could not be judged, quality of the log.",
    (
        *HEAD,
        text("log", "the files as they were named"),
        several("files", "files of the drive"),
        text("start_time", "absolute time of the first sample, UTC; null where the log has none", null=True),
        number("duration_s", "s", "length of the drive"),
        number("sample_rate_hz", "Hz", "rate of the common time grid"),
        text("vehicle", "name of the car"),
        by_name("signals", "every signal that the drive has", _SIGNAL),
        *JUDGEMENT,
        obj("margin", "least distance to full aquaplaning; null where no water was probable", (
            number("least_kmh", "km/h", "median; negative beyond full aquaplaning"),
            interval("ci90", "km/h", "90 % interval"),
            number("at_s", "s", "when"),
            number("warned_s", "s", "when the detector `margin` first warned; null without a warning", null=True),
        ), null=True),
        rows("events", "every event, by begin", (*EVENT, obj("evidence", "what was measured in the event; the fields "
             "depend on the detector", EVIDENCE))),
        rows("unavailable", "detectors that cannot run", LACKING),
        rows("limited", "detectors that ran without one of their conditions", LACKING),
        rows("slip_slope", "state of the slip-slope filter at the end, by place", _FILTER_STATE),
        obj("quality", "what was wrong with the log", (
            count("dropped_samples", "samples that were left out"),
            count("time_jumps", "jumps of the time"),
            flag("truncated", "whether a file ends before its end"),
            flag("unfinalised", "whether the logger has not finished a file"),
            count("frozen_samples", "samples of sensors that stand still; left out"),
            *FAULTS,
            several("notes", "sentences on the log and on the judgement"),
        )),
        CHECKS,
        rows("model", "effects that the detectors allowed for, with `--model`; null without", TERMS, null=True),
    ),
    files=("events.json",),
)  # fmt: skip

_LINE = (
    *with_ci("slope", "-", "slip slope C_s / F_z; null where it cannot be estimated"),
    *with_ci("inverse_slope", "-", "1 / slope, which the regression estimates"),
    *with_ci("offset", "-", "offset of the slip"),
    number("scatter", "-", "standard deviation of the slip about the line", null=True),
    number("attenuation", "-", "factor by which noise of the traction flattens slip over traction", null=True),
    flag("attenuation_corrected", "whether that was taken out"),
    count("samples", "samples of the regression"),
    count("blocks", "blocks that the interval leaves out in turn"),
    number("delay_s", "s", "by how much v_x is late; null where no delay is estimated", null=True),
    interval("delay_ci95", "s", "95 % interval; null ends where the delay was given"),
    number("delay_shared", "-", "correlation of delay and slope in the regression", null=True),
    text("reason", "why no slope can be estimated; null if one is", null=True),
)
_RECURSIVE = (
    text("place", "side or axle"),
    number("slope", "-", "estimate of the recursive filter at the end", null=True),
    number("slope_sd", "-", "its standard deviation", null=True),
    count("changes", "changes that the filter found"),
    number("learnt_s", "s", "time in which it learnt", null=True),
)
_STABILITY = (
    text("verdict", "whether the slope stayed the same", ("drifts", "varies", "stable", "cannot tell")),
    text("sentence", "the same in words"),
    *or_null(
        number("span_s", "s", "time between the first and the last part"),
        number("change", "-", "relative change over the drive"),
    ),
    interval("change_ci95", "-", "95 % interval"),
    *with_ci("change_per_hour", "1/h", "relative change per hour; null below half an hour"),
)

SLIP_SLOPE = Document(
    "slip_slope",
    "aqualog slip-slope --json",
    "Slip slope of each driven wheel over one drive, with intervals, and whether it stayed the same.",
    (
        *HEAD,
        text("log", "the files as they were named"),
        text("vehicle", "name of the car"),
        number("duration_s", "s", "length of the drive"),
        number("sample_rate_hz", "Hz", "rate of the common time grid"),
        text("method", "slip against free wheels or v_x, or recursive alone", ("axle", "velocity", "differential")),
        text("traction", "source of the traction", ("torque", "accelerometer")),
        number("mu_max", "-", "greatest traction coefficient used"),
        rows("slip_slope", "by place; empty with the method `differential`", (
            text("place", "side or axle"),
            text("wheel", "driven wheel; null for an axle", WHEELS, null=True),
            *_LINE,
            number("used_s", "s", "time used"),
            interval("mu_range", "-", "range of the traction coefficient in the regression"),
            number("lag_s", "s", "by how much the torque is late against the slip", null=True),
            obj("recursive", "the recursive filter on the same data", _RECURSIVE),
            mapping("left_out_s", "time left out, by reason", number("", "s", "", null=True)),
            obj("stability", "whether the slope stayed the same", _STABILITY),
            rows("segments", "the same regression over parts of the drive", (
                number("start_s", "s", "begin of the part"),
                number("end_s", "s", "end of the part"),
                number("used_s", "s", "time used"),
                *_LINE,
            )),
        )),
        rows("recursive", "the recursive filter, by place, where there is no regression", _RECURSIVE),
        several("notes", "sentences on the log and on the estimate"),
        CHECKS,
    ),
    files=("slip_slope.json",),
)  # fmt: skip

_PROPOSED = (
    text("channel", "channel"),
    text("unit", "unit to put into the map; null where the file has it", null=True),
    number("scale", "-", "factor to put into the map"),
    text("reason", "why this channel"),
    several("doubt", "other units that it may have, where the file gives none and the data do not decide"),
)

INIT = Document(
    "init",
    "aqualog init LOG --json",
    "A start for one drive: guessed signals, files that were written, what is to be filled in, and what is next.",
    (
        *HEAD,
        text("folder", "folder of the files"),
        several("written", "files that were written"),
        by_name("signals", "channel of each signal, as the map has it", _PROPOSED),
        several("unmapped", "channels that look like no signal, `name [unit]`"),
        rows("questions", "what was asked on the terminal", (
            text("key", "file and key that the answer is for"),
            text("text", "the question"),
            text("answer", "the answer; null if it is not known", null=True),
        )),
        several("set", "keys of the vehicle file that wait for a value"),
        several("next", "the commands that come next"),
        several("notes", "sentences on the files, and on what is missing"),
    ),
)  # fmt: skip

INSPECT = Document(
    "inspect",
    "aqualog inspect LOG --json",
    "What a log holds: every channel with its rate, range, gaps and faults, and the proposed signal map.",
    (
        *HEAD,
        rows("files", "the files", (text("file", "path"), text("format", "format that the content shows"))),
        rows("channels", "every channel with numbers", (
            text("file", "file that holds it"),
            text("path", "group, bus, message or topic, and the name"),
            text("name", "name alone"),
            text("unit", "unit as the file gives it"),
            count("samples", "samples"),
            *or_null(
                number("rate_hz", "Hz", "samples per second outside gaps"),
                number("start_s", "s", "first sample, from the first of all channels"),
                number("end_s", "s", "last sample"),
                number("low", "unit of the channel", "least value"),
                number("high", "unit of the channel", "greatest value"),
                number("mean", "unit of the channel", "mean value"),
            ),
            count("not_finite", "samples that are no numbers"),
            count("gaps", "gaps of more than five sample times"),
            number("longest_gap_s", "s", "longest gap", null=True),
            obj("faults", "faults of the time stamps", FAULTS),
            text("remark", "what is remarkable; empty without a remark"),
        )),
        by_name("proposed", "proposed channel of each signal", _PROPOSED),
        several("unmapped", "channels that look like no signal, `name [unit]`"),
        several("notes", "sentences on the files"),
    ),
    files=("inspect.json",),
)  # fmt: skip

DOCTOR = Document(
    "doctor",
    "aqualog doctor --json",
    "What is wrong with a log, what was lost of it, and what to do.",
    (
        *HEAD,
        flag("healthy", "whether no data was lost"),
        rows("files", "the files", (
            text("file", "path"),
            text("format", "format that the content shows; empty if the file cannot be read"),
            count("size", "size of the file", "byte"),
            count("channels", "channels read"),
            count("samples", "samples read"),
            *or_null(number("start_s", "s", "first sample"), number("end_s", "s", "last sample")),
        )),
        rows("findings", "what was found, the worst first", (
            text("level", "unreadable: no data could be read; lost: samples are gone; left_out: they are there, "
                 "but not used; mended: a fault of the time stamps was undone; doubt: worth checking",
                 ("unreadable", "lost", "left_out", "mended", "doubt")),
            text("kind", "short name of the fault"),
            text("file", "file; empty for the whole drive"),
            text("channel", "channel; empty for the whole file"),
            text("what", "the fault in words"),
            text("advice", "what to try; empty without advice"),
            count("count", "samples concerned; 0 where it does not apply"),
            count("of", "of so many samples"),
            number("first_s", "s", "place of the first one, from the channel's first sample", null=True),
        )),
        obj("detectors", "what the drive is good for", (
            several("ready", "detectors that can run"),
            mapping("missing", "signals that a detector lacks", several("", "")),
        )),
    ),
    files=("doctor.json",),
)  # fmt: skip

_FIT = maybe(
    text("refused", "why no offset can be estimated; the other fields are then missing"),
    number("offset_s", "s", "by how much the source is late, at `mid_ns`"),
    interval("offset_ci95", "s", "95 % interval; it covers noise, not the run time of a sensor"),
    *or_null(number("slip_offset_s", "s", "offset if the difference may hold tyre slip too; null unless the quantity "
                    "is a speed")),
    interval("slip_offset_ci95", "s", "95 % interval"),
    number("taken_s", "s", "of the two offsets the one that a map gets"),
    text("taken_because", "why it is that one; empty where there is one only"),
    number("drift_ppm", "ppm", "growth of the offset"),
    interval("drift_ppm_ci95", "ppm", "95 % interval"),
    flag("drift_significant", "whether the 99 % interval of the drift excludes 0; only then it is used"),
    number("scale", "-", "value = scale * reference + bias"),
    interval("scale_ci95", "-", "95 % interval"),
    number("bias", "unit of the quantity", "see scale"),
    interval("bias_ci95", "unit of the quantity", "95 % interval"),
    *or_null(number("ratio", "-", "scale if there is no bias, as between two speeds")),
    interval("ratio_ci95", "-", "95 % interval"),
    number("peak", "-", "correlation of the rates of change at the best lag"),
    number("peak_limit", "-", "what the correlation had to reach to be more than chance"),
    number("runner_up", "-", "best correlation outside the main peak"),
    number("overlap_s", "s", "time in which both sources were usable"),
    count("n", "samples of the source in that time"),
    number("rms", "unit of the quantity", "residual of the smoothed levels"),
    count("mid_ns", "time stamp of the source for which the offset holds", "ns"),
)  # fmt: skip

ALIGN = Document(
    "align",
    "aqualog align --json",
    "Clock offset, drift and scale of each source against the first one.",
    (
        *HEAD,
        text("quantity", "what was compared", ("speed", "yaw_rate")),
        obj("reference", "the first source", (
            text("file", "file"), text("channel", "channel, or how the quantity was made"),
        )),
        rows("sources", "each other source", (
            text("file", "file"), text("channel", "channel, or how the quantity was made"), *_FIT,
        )),
        rows("left_out", "each file without the quantity", (text("file", "file"), text("reason", "why"))),
    ),
    files=("alignment.json",),
)  # fmt: skip

_CALIBRATED = (
    text("name", "drive"),
    *or_null(
        number("mass", "kg", "mass over torque gain of this drive alone"),
        number("mass_sd", "kg", "its standard deviation"),
    ),
    obj("against_others", "mass less that of the other drives", (
        number("value", "kg", "difference", null=True), interval("ci95", "kg", "95 % interval"), text("unit", "kg"),
    )),
    *or_null(
        number("accelerometer_offset", "m/s^2", "offset of the accelerometer"),
        number("accelerometer_offset_sd", "m/s^2", "its standard deviation"),
        number("accelerometer_drift", "m/s^3", "drift of the accelerometer"),
        number("torque_lag_s", "s", "by how much the torque is late"),
        number("velocity_lag_s", "s", "by how much v_x is late"),
    ),
    number("used_s", "s", "time used"),
    number("driven_s", "s", "time of that in which the wheels were driven"),
    mapping("left_out_s", "time left out, by reason", number("", "s", "")),
    *or_null(
        number("rmse_before", "m/s^2", "error of the balance of forces with the vehicle file"),
        number("rmse_after", "m/s^2", "the same with the estimates"),
    ),
)  # fmt: skip

CALIBRATE = Document(
    "calibrate",
    "aqualog calibrate --json",
    "What the drives say about the car: each parameter with its interval, and what cannot be determined.",
    (
        *HEAD,
        text("vehicle", "name of the car"),
        several("logs", "the logs as they were named"),
        mapping("fixed", "keys that were given with `--fix`", number("", "unit of the key", "")),
        rows("parameters", "every parameter", (
            text("name", "key of the vehicle file, or a derived quantity"),
            number("value", "unit of the parameter", "estimate", null=True),
            interval("ci95", "unit of the parameter", "95 % interval"),
            text("unit", "unit"),
            flag("identified", "whether the drives determine it"),
            text("why_not", "why not; empty if they do"),
            text("remark", "what to know of it"),
            number("file_value", "unit of the parameter", "value of the vehicle file", null=True),
            flag("kept", "whether that value stays although the interval excludes it; `--accept` takes the estimate"),
        )),
        rows("drives", "each drive by itself", _CALIBRATED),
        by_name("transfers", "polynomials of tie rods and steering torque", (
            mapping("coefficients", "c0, c_y, c_x with the powers from the first on",
                    several("", "", number("", "", "", null=True))),
            mapping("ci95", "95 % interval of each", several("", "", interval("", "", ""))),
            number("sigma", "N, N*m", "what the polynomial leaves on dry road"),
            number("explained", "-", "share of the variance that it explains"),
            number("seconds", "s", "time used"),
        )),
        several("cannot_tell", "what these drives cannot determine, and what would"),
        several("notes", "sentences on the logs and on the estimates"),
        rows("passes", "with `--wet`, each pass over water", (
            text("name", "drive, and which of its stretches of water"),
            *or_null(
                number("v", "m/s", "mean speed"),
                number("v_lost", "m/s", "speed at which a front wheel was lost; null if none was"),
                number("water_depth", "m", "water before the front wheels, mean"),
            ),
            count("windows", "half seconds of a front wheel that count"),
            text("why", "why it does not count; empty if it does"),
        )),
        DRIVE_CHECKS,
    ),
    files=("calibration.json",),
)  # fmt: skip

SIMULATE = Document(
    "simulate",
    "aqualog simulate SCENARIO --json",
    "What was simulated, and how fast.",
    (
        *HEAD,
        text("log", "the log that was written"),
        number("duration_s", "s", "length of the drive"),
        number("sample_rate_hz", "Hz", "rate of the fastest signals"),
        count("seed", "seed of the random numbers"),
        several("signals", "signals in the log, the truth among them"),
        number("real_time_factor", "-", "simulated time over computing time"),
    ),
    files=("simulation.json",),
)

CACHE = Document(
    "cache",
    "aqualog cache --json",
    "The cache of aligned signals: where it is, and what it holds.",
    (
        *HEAD,
        text("folder", "folder of the cache"),
        flag("is_default", "whether commands keep signals without `--cache`, because AQUALOG_CACHE is set"),
        count("limit_bytes", "most that is kept", "byte"),
        rows("drives", "drives in the cache, those longest unused first", (
            several("files", "files of the drive"),
            count("bytes", "size of the entry", "byte"),
            text("last_used", "time of the last use, UTC"),
            flag("usable", "whether this version of aqualog can take it"),
        )),
        count("bytes", "size of all entries", "byte"),
        count("usable", "entries that this version can take"),
        count("removed", "entries that `--clean` removed"),
    ),
    files=("cache.json",),
)  # fmt: skip
