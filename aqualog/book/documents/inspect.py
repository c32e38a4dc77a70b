"""`aqualog inspect LOG --json`."""

from __future__ import annotations

from aqualog.book.documents.fields import (
    HEAD,
    Document,
    by_name,
    count,
    number,
    obj,
    or_null,
    rows,
    several,
    text,
)
from aqualog.book.documents.shared import FAULTS

__all__ = ["DOCUMENT"]

DOCUMENT = Document(
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
                number("rate_hz", "Hz", "rate, from the median step"),
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
        by_name("proposed", "proposed channel of each signal", (
            text("channel", "channel"),
            text("unit", "unit to put into the map; null where the file has it", null=True),
            number("scale", "-", "factor to put into the map"),
            text("reason", "why this channel"),
        )),
        several("notes", "sentences on the files"),
    ),
    files=("inspect.json",),
)  # fmt: skip
