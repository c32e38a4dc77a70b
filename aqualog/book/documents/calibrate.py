"""`aqualog calibrate --json`."""

from __future__ import annotations

from aqualog.book.documents.fields import (
    HEAD,
    Document,
    by_name,
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

_DRIVE = (
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

DOCUMENT = Document(
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
        )),
        rows("drives", "each drive by itself", _DRIVE),
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
    ),
    files=("calibration.json",),
)  # fmt: skip
