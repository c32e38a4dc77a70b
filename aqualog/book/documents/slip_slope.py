"""`aqualog slip-slope --json`, and `slip_slope.json`."""

from __future__ import annotations

from aqualog.book.documents.fields import (
    HEAD,
    Document,
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
from aqualog.core.notation import WHEELS

__all__ = ["DOCUMENT"]

_LINE = (
    number("slope", "-", "slip slope C_s / F_z; null where it cannot be estimated", null=True),
    interval("slope_ci95", "-", "95 % interval"),
    number("inverse_slope", "-", "1 / slope, which the regression estimates", null=True),
    interval("inverse_slope_ci95", "-", "95 % interval"),
    number("offset", "-", "offset of the slip", null=True),
    interval("offset_ci95", "-", "95 % interval"),
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
    number("change_per_hour", "1/h", "relative change per hour; null below half an hour", null=True),
    interval("change_per_hour_ci95", "1/h", "95 % interval"),
)

DOCUMENT = Document(
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
    ),
    files=("slip_slope.json",),
)  # fmt: skip
