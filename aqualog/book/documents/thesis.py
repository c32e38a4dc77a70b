"""`aqualog figures --json` and `aqualog reproduce --json`."""

from __future__ import annotations

from aqualog.book.documents.fields import (
    HEAD,
    Document,
    count,
    interval,
    mapping,
    number,
    obj,
    rows,
    several,
    text,
)

__all__ = ["FIGURES", "REPRODUCE"]

FIGURES = Document(
    "figures",
    "aqualog figures --json",
    "Figures of the thesis that were made, with what they say about its claims.",
    (
        *HEAD,
        rows("figures", "each figure", (
            text("figure", "number in the thesis"),
            text("title", "title"),
            rows("findings", "claims that it is evidence for", (
                text("claim", "claim, C1 to C118"),
                text("thesis", "what the thesis says"),
                text("criterion", "what must come out"),
                text("found", "what came out"),
                number("value", "unit", "the same as a number", null=True),
                interval("ci95", "unit", "95 % interval; null without one", null=True),
                text("unit", "unit; null without one", null=True),
                text("verdict", "verdict"),
                text("reason", "why it differs; empty if it does not"),
            )),
            obj("runs", "runs behind it; null where it needs none", (
                text("campaign", "campaign"),
                rows("used", "runs used", (text("run", "run"), text("shown_as", "what the figure calls it"))),
                rows("left_out", "runs left out", (text("reason", "why"), count("runs", "how many"))),
            ), null=True),
        )),
        rows("not_made", "figures that could not be made", (text("figure", "number"), text("reason", "why"))),
        several("files", "files that were written"),
    ),
)  # fmt: skip

REPRODUCE = Document(
    "reproduce",
    "aqualog reproduce --json",
    "Every claim of the thesis with its checks and its verdict.",
    (
        *HEAD,
        several("conditions", "how it was made, in words"),
        mapping("counts", "claims by verdict", count("", "")),
        rows("claims", "each claim", (
            text("claim", "C1 to C118"),
            text("where", "place in the thesis"),
            text("kind", "what kind of claim"),
            text("statement", "what the thesis says"),
            text("verdict", "verdict: as its checks together"),
            rows("checks", "each check", (
                text("part", "part of the claim"),
                text("statement", "that part"),
                text("criterion", "what must come out"),
                text("found", "what came out"),
                number("value", "unit", "the same as a number", null=True),
                interval("interval", "unit", "95 % interval, or the range that `found` names; or null", null=True),
                text("unit", "unit; empty without one"),
                text("verdict", "verdict of the check"),
                text("reason", "why it differs; empty if it does not"),
                text("source", "drives and seeds, or the figure"),
            )),
        )),
        rows("figures", "figures that were made", (
            text("figure", "number"), text("title", "title"), text("table", "file of its numbers"),
        )),
        mapping("figures_missing", "figures that could not be made, and why", text("", "")),
    ),
    files=("reproduction.json",),
)  # fmt: skip
