"""`aqualog align --json`."""

from __future__ import annotations

from aqualog.book.documents.fields import HEAD, Document, count, flag, interval, maybe, number, obj, or_null, rows, text

__all__ = ["DOCUMENT"]

_FIT = maybe(
    text("refused", "why no offset can be estimated; the other fields are then missing"),
    number("offset_s", "s", "by how much the source is late, at `mid_ns`"),
    interval("offset_ci95", "s", "95 % interval; it covers noise, not the run time of a sensor"),
    *or_null(number("slip_offset_s", "s", "offset if the difference may hold tyre slip too; null unless the quantity "
                    "is a speed")),
    interval("slip_offset_ci95", "s", "95 % interval"),
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

DOCUMENT = Document(
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
    ),
    files=("alignment.json",),
)  # fmt: skip
