"""Document of `aqualog validate`."""

from __future__ import annotations

from aqualog.book.documents.fields import HEAD, Document, count, flag, interval, number, obj, rows, several, text
from aqualog.validate.records import ABSCISSAE, SIGNALS

__all__ = ["VALIDATE"]

_WORST = (
    text("drive", "the drive"),
    text("signal", "the signal", tuple(SIGNALS)),
    number("by", "unit of the signal", "farthest beyond, positive above the top boundary"),
    number("start_s", "s", "begin of the stretch"),
    number("end_s", "s", "its end"),
    text("unit", "unit of the signal"),
)
_PLOT = (
    text("y", "what is compared", tuple(SIGNALS)),
    text("x", "what it goes over", tuple(ABSCISSAE)),
    text("unit", "unit of y"),
    text("x_unit", "unit of x"),
    count("points", "blocks of 0.1 s over time, else bins"),
    count("within", "of these within the boundaries"),
    number("within_share", "-", "their share", null=True),
    number("judged_s", "s", "time judged"),
    number("x_offset", "unit of x", "eps_x = x_offset + x_gain |x|"),
    number("x_gain", "-", "the same"),
    number("y_offset", "unit of y", "eps_y = y_offset + y_gain |y|"),
    number("y_gain", "-", "the same"),
    text("tolerance_from", "where eps_y comes from", ("repetitions", "file", "built in")),
    obj("worst", "the worst stretch; null without one", _WORST, null=True),
)
_RATING = (
    text("signal", "the signal", tuple(SIGNALS)),
    number("corridor", "-", "Z, 0 to 1"),
    number("phase", "-", "E_P, 0 to 1"),
    number("magnitude", "-", "E_M, 0 to 1"),
    number("slope", "-", "E_S, 0 to 1"),
    number("delay_s", "s", "by how much the simulation is late"),
    number("rating", "-", "R = 0.4 Z + 0.2 E_P + 0.2 E_M + 0.2 E_S"),
    number("judged_s", "s", "time rated"),
)

VALIDATE = Document(
    "validate",
    "aqualog validate --json",
    "Whether the simulation of a car is valid on measured drives, and why not.",
    (
        *HEAD,
        text("vehicle", "name of the car"),
        several("logs", "the logs as they were named"),
        rows("drives", "the drives", (
            text("name", "its name"),
            number("duration_s", "s", "its length"),
            number("judged_s", "s", "time judged"),
        )),
        text("method", "which the sentence goes by", ("boundary", "18571")),
        text("sentence", "the answer in words"),
        number("within_share", "-", "share of the judged time with all signals within", null=True),
        number("rating", "-", "mean rating of the signals that move", null=True),
        number("duration_s", "s", "length of all drives"),
        number("judged_s", "s", "time judged"),
        number("agreed_share", "-", "share within that a valid range of speed needs"),
        obj("worst", "the worst stretch of all signals; null without one", _WORST, null=True),
        rows("limits", "dry and on water", (
            text("condition", "the road", ("dry", "on water")),
            flag("valid", "whether it is valid at all speeds driven"),
            number("not_above_kmh", "km/h", "speed above which it is not; null where it is", null=True),
            interval("driven_kmh", "km/h", "speeds driven"),
            number("within_share", "-", "share within: above that speed, or in all where it is valid"),
            number("judged_s", "s", "time judged in this condition"),
        )),
        rows("plots", "each signal over time and in cross plots", _PLOT),
        rows("ratings", "each signal that moves", _RATING),
        obj("diagnosis", "the verdict of `aqualog diagnose` on the same drives; null with --no-why", (
            text("verdict", "as there"),
            text("sentence", "as there"),
            text("caution", "as there; null without one", null=True),
            rows("causes", "as there", (
                text("effect", "name of the effect"),
                text("where", "its place; null for the whole car", null=True),
                text("key", "`effect` or `effect@where`"),
                text("sentence", "the cause in words"),
                number("probability", "-", "probability that the effect is there", null=True),
            )),
            text("next", "what would settle it; null where nothing is open", null=True),
        ), null=True),
        several("notes", "what a reader should know"),
    ),
)  # fmt: skip
