"""Documents of the tyre tests."""

from __future__ import annotations

from aqualog.book.documents.fields import (
    HEAD,
    PLACE_KEYS,
    Document,
    Field,
    anything,
    count,
    flag,
    interval,
    mapping,
    number,
    obj,
    open_ci,
    or_null,
    rows,
    several,
    text,
)
from aqualog.trade.curve_set import RESULTS
from aqualog.trade.onset import SIGNS

__all__ = ["BRAKING", "CURVE", "STRAIGHT"]

_RUN = (
    text("log", "log, as the campaign names it"),
    count("number", "which run of the log it is, from 1"),
    count("order", "its place in the order in which all were driven, from 1"),
    text(
        "tyre", "tyre; null where the campaign names none. The row has the keys `--by` beside these fields", null=True
    ),
    flag("valid", "whether it counts"),
    text("reason", "why it does not count; null if it does", null=True),
    several("notes", "what could not be checked"),
)
_LANE = interval("lane_s", "s", "begin and end of the lane; null without one", null=True)
_INDEX = (
    *open_ci("index", "-", "index against the control at the same place in the order; interval by [fieller1954]"),
    number("control_value", "", "the control's value there", null=True),
    text("verdict", "the index in words; null without one", null=True),
    several("notes", "what is to be said of the set"),
)
_SET = (
    text("tyre", "tyre; null where sets are not by tyre. The row has the keys `--by` beside these fields", null=True),
    flag("control", "whether it is the control tyre"),
    count("runs", "runs of the set"),
    count("valid", "runs that count"),
)


def _summary(stem: str, unit: str, what: str) -> tuple[Field, ...]:
    return (
        count("censored", "runs that did not reach their value and count as above it"),
        number(f"mean{stem}", unit, f"mean {what}; null where the runs do not determine it", null=True),
        interval("ci95", unit, "95 % interval of the mean; null without one", null=True),
        number(f"sd{stem}", unit, "standard deviation of one run", null=True),
        number("cv", "-", "coefficient of variation", null=True),
        number(f"above{stem}", unit, "lowest bound where no run reached its value; else null", null=True),
        flag("enough", "whether valid runs and CV are as the thresholds ask"),
    )


def _document(
    kind: str, summary: str, run: tuple[Field, ...], row: tuple[Field, ...], more: tuple[Field, ...] = ()
) -> Document:
    return Document(
        f"test_{kind}",
        f"aqualog test {kind} --json",
        summary,
        (
            *HEAD,
            text("test", "the test", (kind,)),
            text("name", "name of the campaign"),
            several("by", "keys of a set"),
            rows("runs", "each run, pass or stop, in the order of driving", (*_RUN, *run), keys=PLACE_KEYS),
            rows("sets", "each set", (*_SET, *row, *_INDEX), keys=PLACE_KEYS),
            rows("controls", "the control tyre", (
                text("tyre", "its name"),
                mapping("configuration", "what its runs share with the sets compared with it", anything("", "")),
                rows("sets", "its sets of runs in a row", (
                    number("order", "-", "mean place of its runs in the order of all, from 1"),
                    count("runs", "runs that count"),
                    number("value", "", "mean", null=True),
                )),
                number("drift", "-", "change from the first to the last set, relative; null with one set", null=True),
                interval("drift_ci95", "-", "its 95 % interval; null without one", null=True),
            )),
            *more,
            rows("limits", "thresholds in use", (
                text("key", "key in a file for `--limits`, with its table"),
                number("value", "", "value in use"),
                number("default", "", "default"),
                text("unit", "unit"),
                text("meaning", "meaning"),
                text("source", "where the value comes from"),
            )),
            rows("failed", "logs that could not be read", (text("log", "log"), text("reason", "why"))),
            several("notes", "sentences on the test"),
        ),
        files=(f"{kind}.json",),
    )  # fmt: skip


def _kmh(name: str, meaning: str) -> Field:
    return number(f"{name}_kmh", "km/h", meaning, null=True)


STRAIGHT = _document(
    "straight",
    "Straight aquaplaning: the speed of 15 % slip of every run, mean and index of every set.",
    (
        _kmh("v_15", "speed of 15 % slip; of a censored run the speed that it is above"),
        flag("censored", "whether 15 % were not reached before the lane's end"),
        *(_kmh(f"v_{n}", f"speed of {int(n)} % slip; null where it was not reached") for n in ("05", "10", "50")),
        *(_kmh(f"v_{n}", f"speed at the first {what} on the lane; null without one") for n, what in SIGNS.items()),
        mapping("onset_missing", "what the log lacks for these signs, by detector; null if they were not looked for",
                text("", ""), null=True),
        text("reference", "signal behind the speeds: v_x, or the free wheel on the dry side", null=True),
        text("other_reference", "the other one; null without one", null=True),
        _kmh("v_15_other", "speed of 15 % slip by the other reference"),
        *or_null(
            number("a_x", "m/s^2", "mean acceleration before the crossing"),
            number("yaw_rate", "rad/s", "largest yaw rate on the lane before the crossing"),
            number("radius_ratio", "-", "ratio of the wheels' radii, from the dry second"),
            text("wet_side", "side in water", ("left", "right")),
            text("axle", "driven axle", ("f", "r")),
            number("crossing_s", "s", "when 15 % were reached"),
        ),
        _LANE,
    ),
    (
        *_summary("_kmh", "km/h", "speed of 15 % slip"),
        _kmh("v_05", "mean speed of 5 % slip"),
        *(_kmh(f"v_{n}", f"mean speed at the first {what}, over runs that have one") for n, what in SIGNS.items()),
    ),
)  # fmt: skip

CURVE = _document(
    "curve",
    "Curved aquaplaning: lateral acceleration of every pass, curves over the entry speed and one number of every set.",
    or_null(
        number("v_entry_kmh", "km/h", "speed at the trough"),
        number("a_y_dry", "m/s^2", "lateral acceleration, mean of the dry second before"),
        number("a_y_least", "m/s^2", "least in the trough, of means over 0.1 s"),
        number("a_y_mean", "m/s^2", "mean in the trough"),
        number("radius_m", "m", "radius of the path before the trough"),
        number("steer_change", "-", "largest change of the steering angle in the trough, relative"),
        _LANE,
    ),
    (
        number("value", "", "the number that is compared, see `result`", null=True),
        interval("ci95", "", "95 % interval, bootstrap over passes; null without one", null=True),
        *(
            f for n, what in (
                ("v_greatest", "speed of the greatest mean lateral acceleration"),
                ("v_half", "speed at which the least lateral acceleration is half of the dry one"),
                ("v_zero", "speed at which the least lateral acceleration is 0"),
            )
            for f in open_ci(f"{n}_kmh", "km/h", f"{what}; null where the passes do not reach it")
        ),
        obj("curve", "curves over the entry speed", tuple(
            several(n, what, number("", unit, "", null=True)) for n, unit, what in (
                ("v_kmh", "km/h", "mean entry speed of each step"),
                ("a_y_least", "m/s^2", "concave fit of the least lateral acceleration"),
                ("a_y_mean", "m/s^2", "concave fit of the mean lateral acceleration"),
                ("a_y_dry", "m/s^2", "mean of the dry lateral acceleration"),
            )
        )),
    ),
    (
        obj("result", "what is compared", (
            text("name", "name", tuple(RESULTS)), text("unit", "unit"), text("meaning", "meaning"),
        )),
        interval("common_kmh", "km/h", "speeds that all sets have driven; null without any", null=True),
    ),
)  # fmt: skip

BRAKING = _document(
    "braking",
    "Wet braking: the braking force coefficient of every stop, mean and index of every set.",
    or_null(
        number("bfc", "-", "braking force coefficient"),
        number("bfc_20", "-", "the same at the reference temperature"),
        number("distance_m", "m", "way between both speeds"),
        number("v_from_kmh", "km/h", "speed at the begin"),
        number("v_to_kmh", "km/h", "speed at the end"),
        number("temperature_c", "degC", "temperature"),
        number("water_depth_mm", "mm", "water depth"),
        number("texture_mm", "mm", "macrotexture depth"),
        number("start_s", "s", "begin"),
        number("end_s", "s", "end"),
    ),
    (
        *_summary("", "-", "braking force coefficient"),
        number("wet_grip_index", "-", "wet grip index by the user's coefficients; null without them", null=True),
        number("temperature_c", "degC", "mean temperature of the stops behind it", null=True),
    ),
)
