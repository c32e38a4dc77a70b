"""JSON files that aqualog writes beside the documents of the commands."""

from __future__ import annotations

from aqualog.book.documents.fields import HEAD, Document, count, flag, mapping, number, rows, text

__all__ = ["HISTORY", "MANIFEST"]

MANIFEST = Document(
    "manifest",
    "manifest.json",
    "The state of every run of a campaign in its store.",
    (
        *HEAD,
        text("code", "stamp of the equations; results of another stamp are measured again"),
        text("campaign", "name of the campaign"),
        mapping("states", "runs by state", count("", "")),
        rows("logs", "each run", (
            count("run", "index from 0"),
            text("log", "log, or logs with ; between them"),
            text("state", "state", ("done", "failed", "to do")),
            text("reason", "why it failed; empty if it did not"),
            text("key", "name of its files in the store"),
            flag("truncated", "whether a file of the log ends before its end"),
        )),
    ),
    files=("NAME.store/manifest.json",),
)  # fmt: skip

HISTORY = Document(
    "history",
    "history file",
    "Dry slip slopes of a car from earlier drives.",
    (
        HEAD[0],
        mapping("slip_slope_history", "by configuration, then by place (left, right, axle)", mapping(
            "", "", rows("", "", (
            number("max", "-", "greatest slope of the period"),
            number("mean", "-", "mean slope of the period"),
            number("seconds", "s", "length of the period"),
            text("drive", "name of the drive by its content; empty if unknown"),
        )))),
    ),
    files=("FILE of --history",),
)  # fmt: skip
