"""`aqualog doctor --json`."""

from __future__ import annotations

from aqualog.book.documents.fields import (
    HEAD,
    Document,
    count,
    flag,
    mapping,
    number,
    obj,
    or_null,
    rows,
    several,
    text,
)

__all__ = ["DOCUMENT"]

DOCUMENT = Document(
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
            text("level", "unreadable: no data could be read; lost: samples are gone or not used; mended: a fault of "
                 "the time stamps was undone; doubt: worth checking", ("unreadable", "lost", "mended", "doubt")),
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
