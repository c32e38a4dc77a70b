"""`aqualog bin-slipslope --json` and `aqualog bin-resistance --json`."""

from __future__ import annotations

from aqualog.book.documents.fields import (
    HEAD,
    Document,
    Field,
    count,
    flag,
    interval,
    mapping,
    maybe,
    number,
    or_null,
    rows,
    several,
    text,
)
from aqualog.book.documents.shared import BIN, PLACE_KEYS
from aqualog.core.notation import WHEELS

__all__ = ["RESISTANCE", "SLIP_SLOPE"]

_ABOUT = (
    *HEAD,
    text("campaign", "name of the campaign"),
    several("by", "grouping keys"),
    number("bin_width_kmh", "km/h", "width of the bins of speed"),
    flag("robust", "whether outlying runs were given less weight"),
    mapping("left_out_samples", "samples left out, by reason", count("", "")),
)
_PLACE = maybe(
    text("wheel", "wheel; the row has the grouping keys `--by` beside these fields", WHEELS),
    text("side", "side, where the row is of one", ("left", "right")),
)


_WHEELS = maybe(
    text("wheel", "wheel, or `free`: the wheels that are not driven, together", (*WHEELS, "free")),
    text("side", "side, where the row is of one", ("left", "right")),
)


def _ci(name: str, unit: str) -> Field:
    return interval(name, unit, "95 % interval; null without one", null=True)


_SLOPE = (
    *_PLACE,
    *BIN,
    number("slope", "-", "slope of F_x / F_z over slip within `mu_range`", null=True),
    _ci("slope_ci95", "-"),
    number("intercept", "-", "slip without traction", null=True),
    _ci("intercept_ci95", "-"),
    number("r2", "-", "share of the variance that the line explains", null=True),
    interval("mu_range", "-", "5 to 95 % of the traction driven; null without samples", null=True),
    number("attenuation", "-", "factor by which noise of the traction flattens slip over traction", null=True),
    number("scatter", "-", "scatter of the slopes of the runs", null=True),
    number("dof", "-", "degrees of freedom (Satterthwaite [satterthwaite1946])", null=True),
    flag("reliable", "3 runs or more, an interval within a factor of 3, and a line that explains more than a constant"),
    text("reason", "why there is no slope or no interval; null if there is", null=True),
    number("slope_dry", "-", "the same off the water, all speeds together", null=True),
    _ci("slope_dry_ci95", "-"),
    count("runs_dry", "runs behind it"),
    interval("mu_range_dry", "-", "range of the traction behind it", null=True),
    *or_null(
        number("friction_dry", "-", "friction of the brush on dry road"),
        number("friction_wet", "-", "friction of the brush on wet road"),
        number("contact_ratio", "-", "share of the contact length whose brush has this slope"),
    ),
    _ci("contact_ratio_ci95", "-"),
    *or_null(
        number("expected_contact_ratio", "-", "what the model gives"),
        number("expected_slope", "-", "what the model gives over `mu_range`"),
        number("expected_slope_dry", "-", "what the model gives on dry road"),
    ),
    text("expected_reason", "why the model gives none; null if it does", null=True),
)

SLIP_SLOPE = Document(
    "bin_slipslope",
    "aqualog bin-slipslope --json",
    "Slip slope over speed per configuration and wheel, and the speed of full aquaplaning.",
    (
        *_ABOUT,
        mapping("definitions", "what the names mean", text("", "")),
        rows("rows", "slip slope by configuration, wheel and bin of speed; `-o FILE` writes these rows as "
             "a table, a pair `x_ci95` as `x_low` and `x_high`", _SLOPE, keys=PLACE_KEYS),
        rows("dry", "the same off the water", _SLOPE, keys=PLACE_KEYS),
        rows("delays", "by how much v_x is late, by car", (
            text("vehicle", "car"),
            number("delay_s", "s", "delay", null=True),
            _ci("delay_s_ci95", "s"),
            count("runs", "runs behind it"),
            count("samples", "samples behind it"),
            text("reason", "why there is no value; null if there is one", null=True),
        )),
        rows("full_aquaplaning", "speed of full aquaplaning, in up to three ways", (
            *_WHEELS,
            text("way", "how it was found: from slopes, minor spin-downs or full spin-downs"),
            text("event", "which event the speed belongs to"),
            text("defines", "what that event is, in words"),
            number("v_full_kmh", "km/h", "speed", null=True),
            _ci("v_full_ci95_kmh", "km/h"),
            number("exponent", "-", "exponent of the contact's fall over speed", null=True),
            text("rests_on", "what the speed rests on; null if it does not", null=True),
            text("reason", "why there is no value; null if there is one", null=True),
        ), keys=PLACE_KEYS),
        rows("spin_ups", "traction coefficient of spinning wheels", (
            *_PLACE, *BIN,
            number("mu", "-", "traction coefficient when the wheel begins to spin", null=True), _ci("mu_ci95", "-"),
            number("mu_residual", "-", "least traction coefficient while it spins", null=True),
            _ci("mu_residual_ci95", "-"),
            flag("reliable", "3 runs or more"),
            text("reason", "why there is no value; null if there is one", null=True),
        ), keys=PLACE_KEYS),
        rows("minor_spin_downs", "minor spin-downs by wheel and bin of speed", (
            *_PLACE,
            number("v_low_kmh", "km/h", "lower end of the bin"),
            number("v_high_kmh", "km/h", "upper end of the bin"),
            count("passes", "passes over the water at this speed"),
            number("seconds", "s", "time on the water at this speed", null=True),
            count("events", "minor spin-downs"),
            number("per_s", "1/s", "minor spin-downs per second", null=True), _ci("per_s_ci95", "1/s"),
            number("per_100_m", "1/(100 m)", "minor spin-downs per 100 m", null=True),
            number("share", "-", "share of the passes with one", null=True), _ci("share_ci95", "-"),
            count("passes_with_full_spin_down", "passes in which the wheel stopped"),
            number("deepest_slip_median", "-", "median of the deepest slip of the events", null=True),
        ), keys=PLACE_KEYS),
    ),
)  # fmt: skip

RESISTANCE = Document(
    "bin_resistance",
    "aqualog bin-resistance --json",
    "Mean resistance measure over speed per configuration.",
    (
        *_ABOUT,
        flag("less_own_dry_level", "whether each run's level before the lane was taken off (not with `--as-measured`)"),
        rows("rows", "resistance by configuration and bin of speed; `-o FILE` writes these rows as a table", (
            *_PLACE, *BIN,
            number("delta_a_x", "m/s^2", "mean resistance measure (2.9)", null=True), _ci("delta_a_x_ci95", "m/s^2"),
            number("scatter", "m/s^2", "scatter of the runs", null=True),
            number("dof", "-", "degrees of freedom (Satterthwaite [satterthwaite1946])", null=True),
            flag("reliable", "3 runs or more and an interval"),
            text("reason", "why there is no value; null if there is one", null=True),
        ), keys=PLACE_KEYS),
    ),
)  # fmt: skip
