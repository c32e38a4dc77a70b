"""Fields that several documents have."""

from __future__ import annotations

from aqualog.book.documents.fields import count, flag, mapping, maybe, number, or_null, several, text
from aqualog.core.notation import WHEELS
from aqualog.detect.registry import DETECTORS

__all__ = ["BIN", "EVENT", "FAULTS", "FAULT_COUNTS", "LACKING", "PLACE_KEYS", "TERMS", "WHEEL"]

WHEEL = text("wheel", "wheel; null where the event belongs to the car or a side", WHEELS, null=True)
SIDE = text("side", "side; null where it does not apply", ("left", "right", "axle"), null=True)

_EVIDENCE = (
    *or_null(
        number("v_x", "m/s", "speed at the begin"),
        number("v_x_min", "m/s", "least speed"),
        number("v_x_max", "m/s", "greatest speed"),
        number("slip_min", "-", "least slip of the wheel; of the joint detector over all wheels"),
        number("slip_max", "-", "greatest slip; of the slip-slope drop the greatest amount"),
        number("a_w_delta_min", "m/s^2", "least acceleration of the wheel against the car (2.3)"),
        number("a_w_delta_max", "m/s^2", "greatest acceleration of the wheel against the car"),
        number("variance_max", "(m/s^2)^2", "greatest variance of that difference"),
        number("mu", "-", "traction coefficient of the wheel at the begin"),
        number("mu_min", "-", "least traction coefficient"),
        number("delta_a_x_max", "m/s^2", "greatest resistance measure while not braking (2.9)"),
        number("force_residual_min", "N", "least residual of the tie-rod force"),
        number("force_residual_max", "N", "greatest residual of the tie-rod force"),
        number("torque_residual_min", "N*m", "least residual of the steering torque"),
        number("torque_residual_max", "N*m", "greatest residual of the steering torque"),
        number("slope_min", "-", "least slip slope"),
        number("slope_ref", "-", "dry slip slope that it is compared with"),
        number("term_spin_up", "-", "greatest term of the sum (2.11), 0 to 1: spin-up"),
        number("term_spin_down", "-", "the same: spin-down"),
        number("term_resistance", "-", "the same: resistance"),
        number("term_minor_spin_down", "-", "the same: variance of minor spin-downs"),
        number("term_slip_slope_drop", "-", "the same: lost slip slope"),
    ),
    flag("braking", "whether the wheel was braked at any time of the event"),
    flag("braking_at_start", "whether it was braked at the begin"),
    flag("from_steering_torque", "whether the steering torque stood in for tie rods"),
    flag("criterion_1", "whether criterion 1, spin-down, was met at any time"),
    flag("criterion_2", "the same: minor spin-down"),
    flag("criterion_3", "the same: spin-up"),
    flag("criterion_4", "the same: slip-slope drop"),
    flag("criterion_5", "the same: resistance alone"),
    flag("full", "whether a wheel went as far as full aquaplaning"),
    several("decided_by", "detectors that decided when the warning began"),
)

EVENT = (
    text("detector", "which detector", DETECTORS),
    WHEEL,
    SIDE,
    number("start_s", "s", "begin, from the log's first sample"),
    number("end_s", "s", "end"),
    text("severity", "full: a wheel has lost a quarter of its speed, or a spinning one transmits less than 0.02",
         ("partial", "full")),
    number("peak", "unit of the statistic", "greatest value of the detector's statistic", null=True),
    number("threshold", "unit of the statistic", "threshold of that statistic"),
)  # fmt: skip
EVIDENCE = maybe(*_EVIDENCE)
"""What an event of any detector may have as evidence."""

LACKING = (
    text("detector", "which detector", DETECTORS),
    several("missing", "signals that it lacks, or `vehicle.KEY`, or a rate"),
)

TERMS = (
    text("effect", "effect, see the page of effects"),
    text("where", "its place; null for the whole car", null=True),
    mapping("parameters", "values, SI", number("", "SI", "", null=True)),
    *maybe(several("knots", "points of a function", several("", "", number("", "SI", "", null=True)))),
)
"""Terms of a model."""

FAULT_COUNTS = (
    count("duplicates", "samples with the time stamp of another one"),
    count("back_steps", "time stamps that go back a little; sorted"),
    count("resets", "clocks that begin anew; what follows goes on 1 s later"),
    count("wraps", "counters that wrap; unwrapped"),
    count("pauses", "pauses of the logger; they stay gaps"),
    count("drifts", "clocks in one file that run apart"),
    count("strays", "samples with a time stamp from elsewhere; left out"),
)
FAULTS = (*FAULT_COUNTS, mapping("first_s", "place of the first fault of each kind, from the source's first sample",
                                 number("", "s", "", null=True)))  # fmt: skip

PLACE_KEYS = (
    "^(tyre|wear|manoeuvre|vehicle|tread_depth_mm|pressure_(front|rear)_bar|water_depth(_left)?_mm"
    "|load_(front|rear)_kg|lane_(start|end)_s)$",
    "^x_",
)
"""Grouping keys of a row: keys of the campaign's runs."""

BIN = (
    text("road", "wet or dry; both where they are taken together", ("wet", "dry", "both")),
    number("v_low_kmh", "km/h", "lower end of the bin of speed", null=True),
    number("v_high_kmh", "km/h", "upper end", null=True),
    number("v_mean_kmh", "km/h", "mean speed of the samples", null=True),
    count("runs", "runs in the row: the unit of the interval"),
    count("samples", "samples of 0.1 s"),
)
