"""Documents of the commands on drives."""

from __future__ import annotations

from aqualog.book.documents import fields as f
from aqualog.core.notation import WHEELS

__all__ = ["ALIGN", "CACHE", "CALIBRATE", "DETECT", "DOCTOR", "INSPECT", "SIMULATE", "SLIP_SLOPE"]

_SIGNAL = (
    f.text("channel", "channel of the log"),
    f.text("unit", "unit of the signal inside aqualog"),
    f.number("rate_hz", "Hz", "samples per second outside gaps", null=True),
    *f.maybe(
        f.text("file", "file that holds it"),
        f.text("source_unit", "unit in the file", null=True),
        f.number("missing_fraction", "-", "share of the drive without a value", null=True),
        f.count("samples", "samples of the channel"),
        f.count("not_finite", "samples that are no numbers; left out"),
        f.count("out_of_range", "samples outside the signal's range; left out"),
        f.count("invalid_code", "samples with a code for \"no value\"; left out"),
        f.count("frozen", "samples in which the sensor repeats itself; left out"),
        f.count("joined", "samples with which a logger filled a gap by a straight line; left out"),
    ),
)  # fmt: skip

_FILTER_STATE = (
    f.text("place", "side, or axle of an all-wheel drive", ("left", "right", "axle")),
    f.text("wheel", "driven wheel; null for an axle", null=True),
    *f.or_null(
        f.number("slope", "-", "slip slope C_s / F_z at the end"),
        f.number("slope_sd", "-", "its standard deviation, by the filter"),
        f.number("reference", "-", "dry slope that it is compared with"),
    ),
    f.text("reference_from", "where the dry slope comes from; empty without one",
         ("history", "vehicle file", "this drive", "")),
    f.number("beta", "-", "slope ratio of the axles; null with one driven axle", null=True),
    f.number("offset", "-", "offset of the slip", null=True),
    f.count("changes", "changes that the filter found"),
    f.number("judged_s", "s", "time in which the slope was compared with the dry one", null=True),
    f.number("dropped_s", "s", "time of that below half of it", null=True),
    f.mapping("seconds", "time in each state of the filter", f.number("", "s", "", null=True)),
    f.mapping("inactive", "time in which the filter rests, by reason", f.number("", "s", "", null=True)),
)  # fmt: skip

DETECT = f.Document(
    "detect",
    "aqualog detect --json",
    "What the detectors found in one drive: verdict, episodes, events, what could not be judged, quality of the log.",
    (
        *f.HEAD,
        f.text("log", "the files as they were named"),
        f.several("files", "files of the drive"),
        f.text("start_time", "absolute time of the first sample, UTC; null where the log has none", null=True),
        f.number("duration_s", "s", "length of the drive"),
        f.number("sample_rate_hz", "Hz", "rate of the common time grid"),
        f.text("vehicle", "name of the car"),
        f.by_name("signals", "every signal that the drive has", _SIGNAL),
        *f.JUDGEMENT,
        f.obj("margin", "least distance to full aquaplaning; null where no water was probable", (
            f.number("least_kmh", "km/h", "median; negative beyond full aquaplaning"),
            f.interval("ci90", "km/h", "90 % interval"),
            f.number("at_s", "s", "when"),
            f.number("warned_s", "s", "when the detector `margin` first warned; null without a warning", null=True),
        ), null=True),
        f.rows("events", "every event, by begin", (
            *f.EVENT,
            f.obj("evidence", "what was measured in the event; the fields depend on the detector", f.EVIDENCE),
        )),
        f.rows("unavailable", "detectors that cannot run", f.LACKING),
        f.rows("limited", "detectors that ran without one of their conditions", f.LACKING),
        f.rows("slip_slope", "state of the slip-slope filter at the end, by place", _FILTER_STATE),
        f.obj("quality", "what was wrong with the log", (
            f.count("dropped_samples", "samples that were left out"),
            f.count("time_jumps", "jumps of the time"),
            f.flag("truncated", "whether a file is cut off or damaged: a part is missing"),
            f.flag("unfinalised", "whether the logger has not finished a file"),
            f.count("frozen_samples", "samples of sensors that stand still; left out"),
            *f.FAULTS,
            f.several("notes", "sentences on the log and on the judgement"),
        )),
        f.CHECKS,
        f.rows("model", "effects that the detectors allowed for, with `--model`; null without", f.TERMS, null=True),
    ),
    files=("events.json",),
)  # fmt: skip

_LINE = (
    *f.with_ci("slope", "-", "slip slope C_s / F_z; null where it cannot be estimated"),
    *f.with_ci("inverse_slope", "-", "1 / slope, which the regression estimates"),
    *f.with_ci("offset", "-", "offset of the slip"),
    f.number("scatter", "-", "standard deviation of the slip about the line", null=True),
    f.number("attenuation", "-", "factor by which noise of the traction flattens slip over traction", null=True),
    f.flag("attenuation_corrected", "whether that was taken out"),
    f.count("samples", "samples of the regression"),
    f.count("blocks", "blocks that the interval leaves out in turn"),
    f.number("delay_s", "s", "by how much v_x is late; null where no delay is estimated", null=True),
    f.interval("delay_ci95", "s", "95 % interval; null ends where the delay was given"),
    f.number("delay_shared", "-", "correlation of delay and slope in the regression", null=True),
    f.text("reason", "why no slope can be estimated; null if one is", null=True),
)
_RECURSIVE = (
    f.text("place", "side or axle"),
    f.number("slope", "-", "estimate of the recursive filter at the end", null=True),
    f.number("slope_sd", "-", "its standard deviation", null=True),
    f.count("changes", "changes that the filter found"),
    f.number("learnt_s", "s", "time in which it learnt", null=True),
)
_STABILITY = (
    f.text("verdict", "whether the slope stayed the same", ("drifts", "varies", "stable", "cannot tell")),
    f.text("sentence", "the same in words"),
    *f.or_null(
        f.number("span_s", "s", "time between the first and the last part"),
        f.number("change", "-", "relative change over the drive"),
    ),
    f.interval("change_ci95", "-", "95 % interval"),
    *f.with_ci("change_per_hour", "1/h", "relative change per hour; null below half an hour"),
)

SLIP_SLOPE = f.Document(
    "slip_slope",
    "aqualog slip-slope --json",
    "Slip slope of each driven wheel over one drive, with intervals, and whether it stayed the same.",
    (
        *f.HEAD,
        f.text("log", "the files as they were named"),
        f.text("vehicle", "name of the car"),
        f.number("duration_s", "s", "length of the drive"),
        f.number("sample_rate_hz", "Hz", "rate of the common time grid"),
        f.text("method", "slip against free wheels or v_x, or recursive alone", ("axle", "velocity", "differential")),
        f.text("traction", "source of the traction", ("torque", "accelerometer")),
        f.number("mu_max", "-", "greatest traction coefficient used"),
        f.rows("slip_slope", "by place; empty with the method `differential`", (
            f.text("place", "side or axle"),
            f.text("wheel", "driven wheel; null for an axle", WHEELS, null=True),
            *_LINE,
            f.number("used_s", "s", "time used"),
            f.interval("mu_range", "-", "range of the traction coefficient in the regression"),
            f.number("lag_s", "s", "by how much the torque is late against the slip", null=True),
            f.obj("recursive", "the recursive filter on the same data", _RECURSIVE),
            f.mapping("left_out_s", "time left out, by reason", f.number("", "s", "", null=True)),
            f.obj("stability", "whether the slope stayed the same", _STABILITY),
            f.rows("segments", "the same regression over parts of the drive", (
                f.number("start_s", "s", "begin of the part"),
                f.number("end_s", "s", "end of the part"),
                f.number("used_s", "s", "time used"),
                *_LINE,
            )),
        )),
        f.rows("recursive", "the recursive filter, by place, where there is no regression", _RECURSIVE),
        f.several("notes", "sentences on the log and on the estimate"),
        f.CHECKS,
    ),
    files=("slip_slope.json",),
)  # fmt: skip

_PROPOSED = (
    f.text("channel", "channel"),
    f.text("unit", "unit to put into the map; null where the file has it", null=True),
    f.number("scale", "-", "factor to put into the map"),
    f.text("reason", "why this channel"),
    f.several("doubt", "other units that it may have, where the file gives none and the data do not decide"),
)

INIT = f.Document(
    "init",
    "aqualog init LOG --json",
    "A start for one drive: guessed signals, files that were written, what is to be filled in, and what is next.",
    (
        *f.HEAD,
        f.text("folder", "folder of the files"),
        f.several("written", "files that were written"),
        f.by_name("signals", "channel of each signal, as the map has it", _PROPOSED),
        f.several("unmapped", "channels that look like no signal, `name [unit]`"),
        f.rows("questions", "what was asked on the terminal", (
            f.text("key", "file and key that the answer is for"),
            f.text("text", "the question"),
            f.text("answer", "the answer; null if it is not known", null=True),
        )),
        f.several("set", "keys of the vehicle file that wait for a value"),
        f.several("next", "the commands that come next"),
        f.several("notes", "sentences on the files, and on what is missing"),
    ),
)  # fmt: skip

INSPECT = f.Document(
    "inspect",
    "aqualog inspect LOG --json",
    "What a log holds: every channel with its rate, range, gaps and faults, and the proposed signal map.",
    (
        *f.HEAD,
        f.rows("files", "the files", (f.text("file", "path"), f.text("format", "format that the content shows"))),
        f.rows("channels", "every channel with numbers", (
            f.text("file", "file that holds it"),
            f.text("path", "group, bus, message or topic, and the name"),
            f.text("name", "name alone"),
            f.text("unit", "unit as the file gives it"),
            f.count("samples", "samples"),
            *f.or_null(
                f.number("rate_hz", "Hz", "samples per second outside gaps"),
                f.number("start_s", "s", "first sample, from the first of all channels"),
                f.number("end_s", "s", "last sample"),
                f.number("low", "unit of the channel", "least value"),
                f.number("high", "unit of the channel", "greatest value"),
                f.number("mean", "unit of the channel", "mean value"),
            ),
            f.count("not_finite", "samples that are no numbers"),
            f.count("gaps", "gaps of more than five sample times"),
            f.number("longest_gap_s", "s", "longest gap", null=True),
            f.obj("faults", "faults of the time stamps", f.FAULTS),
            f.text("remark", "what is remarkable; empty without a remark"),
        )),
        f.by_name("proposed", "proposed channel of each signal", _PROPOSED),
        f.several("unmapped", "channels that look like no signal, `name [unit]`"),
        f.several("notes", "sentences on the files"),
    ),
    files=("inspect.json",),
)  # fmt: skip

DOCTOR = f.Document(
    "doctor",
    "aqualog doctor --json",
    "What is wrong with a log, what was lost of it, and what to do.",
    (
        *f.HEAD,
        f.flag("healthy", "whether no data was lost"),
        f.rows("files", "the files", (
            f.text("file", "path"),
            f.text("format", "format that the content shows; empty if the file cannot be read"),
            f.count("size", "size of the file", "byte"),
            f.count("channels", "channels read"),
            f.count("samples", "samples read"),
            *f.or_null(f.number("start_s", "s", "first sample"), f.number("end_s", "s", "last sample")),
        )),
        f.rows("findings", "what was found, the worst first", (
            f.text("level", "unreadable: no data could be read; lost: samples are gone; left_out: they are there, "
                 "but not used; mended: a fault of the time stamps was undone; doubt: worth checking",
                 ("unreadable", "lost", "left_out", "mended", "doubt")),
            f.text("kind", "short name of the fault"),
            f.text("file", "file; empty for the whole drive"),
            f.text("channel", "channel; empty for the whole file"),
            f.text("what", "the fault in words"),
            f.text("advice", "what to try; empty without advice"),
            f.count("count", "samples concerned; 0 where it does not apply"),
            f.count("of", "of so many samples"),
            f.number("first_s", "s", "place of the first one, from the channel's first sample", null=True),
        )),
        f.obj("detectors", "what the drive is good for", (
            f.several("ready", "detectors that can run"),
            f.mapping("missing", "signals that a detector lacks", f.several("", "")),
        )),
    ),
    files=("doctor.json",),
)  # fmt: skip

_FIT = f.maybe(
    f.text("refused", "why no offset can be estimated; the other fields are then missing"),
    f.number("offset_s", "s", "by how much the source is late, at `mid_ns`"),
    f.interval("offset_ci95", "s", "95 % interval; it covers noise, not the run time of a sensor"),
    f.number("slip_offset_s", "s",
             "offset if the difference may hold tyre slip too; null unless the quantity is a speed", null=True),
    f.interval("slip_offset_ci95", "s", "95 % interval"),
    f.number("taken_s", "s", "of the two offsets the one that a map gets"),
    f.text("taken_because", "why it is that one; empty where there is one only"),
    f.number("drift_ppm", "ppm", "growth of the offset"),
    f.interval("drift_ppm_ci95", "ppm", "95 % interval"),
    f.flag("drift_significant", "whether the 99 % interval of the drift excludes 0; only then it is used"),
    f.number("scale", "-", "value = scale * reference + bias"),
    f.interval("scale_ci95", "-", "95 % interval"),
    f.number("bias", "unit of the quantity", "see scale"),
    f.interval("bias_ci95", "unit of the quantity", "95 % interval"),
    *f.or_null(f.number("ratio", "-", "scale if there is no bias, as between two speeds")),
    f.interval("ratio_ci95", "-", "95 % interval"),
    f.number("peak", "-", "correlation of the rates of change at the best lag"),
    f.number("peak_limit", "-", "what the correlation had to reach to be more than chance"),
    f.number("runner_up", "-", "best correlation outside the main peak"),
    f.number("overlap_s", "s", "time in which both sources were usable"),
    f.count("n", "samples of the source in that time"),
    f.number("rms", "unit of the quantity", "residual of the smoothed levels"),
    f.count("mid_ns", "time stamp of the source for which the offset holds", "ns"),
)  # fmt: skip

ALIGN = f.Document(
    "align",
    "aqualog align --json",
    "Clock offset, drift and scale of each source against the first one.",
    (
        *f.HEAD,
        f.text("quantity", "what was compared", ("speed", "yaw_rate")),
        f.obj("reference", "the first source", (
            f.text("file", "file"), f.text("channel", "channel, or how the quantity was made"),
        )),
        f.rows("sources", "each other source", (
            f.text("file", "file"), f.text("channel", "channel, or how the quantity was made"), *_FIT,
        )),
        f.rows("left_out", "each file without the quantity", (f.text("file", "file"), f.text("reason", "why"))),
    ),
    files=("alignment.json",),
)  # fmt: skip

_CALIBRATED = (
    f.text("name", "drive"),
    *f.or_null(
        f.number("mass", "kg", "mass over torque gain of this drive alone"),
        f.number("mass_sd", "kg", "its standard deviation"),
    ),
    f.obj("against_others", "mass less that of the other drives", (
        f.number("value", "kg", "difference", null=True), f.interval("ci95", "kg", "95 % interval"),
        f.text("unit", "kg"),
    )),
    *f.or_null(
        f.number("accelerometer_offset", "m/s^2", "offset of the accelerometer"),
        f.number("accelerometer_offset_sd", "m/s^2", "its standard deviation"),
        f.number("accelerometer_drift", "m/s^3", "drift of the accelerometer"),
        f.number("torque_lag_s", "s", "by how much the torque is late"),
        f.number("velocity_lag_s", "s", "by how much v_x is late"),
    ),
    f.number("used_s", "s", "time used"),
    f.number("driven_s", "s", "time of that in which the wheels were driven"),
    f.mapping("left_out_s", "time left out, by reason", f.number("", "s", "")),
    *f.or_null(
        f.number("rmse_before", "m/s^2", "error of the balance of forces with the vehicle file"),
        f.number("rmse_after", "m/s^2", "the same with the estimates"),
    ),
)  # fmt: skip

CALIBRATE = f.Document(
    "calibrate",
    "aqualog calibrate --json",
    "What the drives say about the car: each parameter with its interval, and what cannot be determined.",
    (
        *f.HEAD,
        f.text("vehicle", "name of the car"),
        f.several("logs", "the logs as they were named"),
        f.mapping("fixed", "keys that were given with `--fix`", f.number("", "unit of the key", "")),
        f.rows("parameters", "every parameter", (
            f.text("name", "key of the vehicle file, or a derived quantity"),
            f.number("value", "unit of the parameter", "estimate", null=True),
            f.interval("ci95", "unit of the parameter", "95 % interval"),
            f.text("unit", "unit"),
            f.flag("identified", "whether the drives determine it"),
            f.text("why_not", "why not; empty if they do"),
            f.text("remark", "what to know of it"),
            f.number("file_value", "unit of the parameter", "value of the vehicle file", null=True),
            f.flag("kept", "whether that value stays although the interval excludes it; `--accept` takes the estimate"),
        )),
        f.rows("drives", "each drive by itself", _CALIBRATED),
        f.by_name("transfers", "polynomials of tie rods and steering torque", (
            f.mapping("coefficients", "c0, c_y, c_x with the powers from the first on",
                    f.several("", "", f.number("", "", "", null=True))),
            f.mapping("ci95", "95 % interval of each", f.several("", "", f.interval("", "", ""))),
            f.number("sigma", "N, N*m", "what the polynomial leaves on dry road"),
            f.number("explained", "-", "share of the variance that it explains"),
            f.number("seconds", "s", "time used"),
        )),
        f.several("cannot_tell", "what these drives cannot determine, and what would"),
        f.several("notes", "sentences on the logs and on the estimates"),
        f.rows("passes", "with `--wet`, each pass over water", (
            f.text("name", "drive, and which of its stretches of water"),
            *f.or_null(
                f.number("v", "m/s", "mean speed"),
                f.number("v_lost", "m/s", "speed at which a front wheel was lost; null if none was"),
                f.number("water_depth", "m", "water before the front wheels, mean"),
            ),
            f.count("windows", "half seconds of a front wheel that count"),
            f.text("why", "why it does not count; empty if it does"),
        )),
        f.DRIVE_CHECKS,
    ),
    files=("calibration.json",),
)  # fmt: skip

SIMULATE = f.Document(
    "simulate",
    "aqualog simulate SCENARIO --json",
    "What was simulated, and how fast.",
    (
        *f.HEAD,
        f.text("log", "the log that was written"),
        f.number("duration_s", "s", "length of the drive"),
        f.number("sample_rate_hz", "Hz", "rate of the fastest signals"),
        f.count("seed", "seed of the random numbers"),
        f.several("signals", "signals in the log, the truth among them"),
        f.number("real_time_factor", "-", "simulated time over computing time"),
    ),
    files=("simulation.json",),
)

CACHE = f.Document(
    "cache",
    "aqualog cache --json",
    "The cache of aligned signals: where it is, and what it holds.",
    (
        *f.HEAD,
        f.text("folder", "folder of the cache"),
        f.flag("is_default", "whether commands keep signals without `--cache`, because AQUALOG_CACHE is set"),
        f.count("limit_bytes", "most that is kept", "byte"),
        f.rows("drives", "drives in the cache, those longest unused first", (
            f.several("files", "files of the drive"),
            f.count("bytes", "size of the entry", "byte"),
            f.text("last_used", "time of the last use, UTC"),
            f.flag("usable", "whether this version of aqualog can take it"),
        )),
        f.count("bytes", "size of all entries", "byte"),
        f.count("usable", "entries that this version can take"),
        f.count("removed", "entries that `--clean` removed"),
    ),
    files=("cache.json",),
)  # fmt: skip
