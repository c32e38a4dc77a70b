"""Documents of the tyre tests."""

from __future__ import annotations

from aqualog.book.documents import fields as f
from aqualog.trade.curve_set import RESULTS
from aqualog.trade.onset import SIGNS

__all__ = ["BRAKING", "CURVE", "STRAIGHT"]

_RUN = (
    f.text("log", "log, as the campaign names it"),
    f.count("number", "which run of the log it is, from 1"),
    f.count("order", "its place in the order in which all were driven, from 1"),
    f.text(
        "tyre", "tyre; null where the campaign names none. The row has the keys `--by` beside these fields", null=True
    ),
    f.flag("valid", "whether it counts"),
    f.text("reason", "why it does not count; null if it does", null=True),
    f.several("notes", "what could not be checked"),
)
_LANE = f.interval("lane_s", "s", "begin and end of the lane; null without one", null=True)
_INDEX = (
    *f.open_ci("index", "-", "index against the control at the same place in the order; interval by [fieller1954]"),
    f.number("control_value", "", "the control's value there", null=True),
    f.text("verdict", "the index in words; null without one", null=True),
    f.several("notes", "what is to be said of the set"),
)
_SET = (
    f.text("tyre", "tyre; null where sets are not by tyre. The row has the keys `--by` beside these fields", null=True),
    f.flag("control", "whether it is the control tyre"),
    f.count("runs", "runs of the set"),
    f.count("valid", "runs that count"),
)


def _summary(stem: str, unit: str, what: str) -> tuple[f.Field, ...]:
    return (
        f.count("censored", "runs that did not reach their value and count as above it"),
        f.number(f"mean{stem}", unit, f"mean {what}; null where the runs do not determine it", null=True),
        f.interval("ci95", unit, "95 % interval of the mean; null without one", null=True),
        f.number(f"sd{stem}", unit, "standard deviation of one run", null=True),
        f.number("cv", "-", "coefficient of variation", null=True),
        f.number(f"above{stem}", unit, "lowest bound where no run reached its value; else null", null=True),
        f.flag("enough", "whether valid runs and CV are as the thresholds ask"),
    )


def _document(
    kind: str, summary: str, run: tuple[f.Field, ...], row: tuple[f.Field, ...], more: tuple[f.Field, ...] = ()
) -> f.Document:
    return f.Document(
        f"test_{kind}",
        f"aqualog test {kind} --json",
        summary,
        (
            *f.HEAD,
            f.text("test", "the test", (kind,)),
            f.text("name", "name of the campaign"),
            f.several("by", "keys of a set"),
            f.rows("runs", "each run, pass or stop, in the order of driving", (*_RUN, *run), keys=f.PLACE_KEYS),
            f.rows("sets", "each set", (*_SET, *row, *_INDEX), keys=f.PLACE_KEYS),
            f.rows("controls", "the control tyre", (
                f.text("tyre", "its name"),
                f.mapping("configuration", "what its runs share with the sets compared with it", f.anything("", "")),
                f.rows("sets", "its sets of runs in a row", (
                    f.number("order", "-", "mean place of its runs in the order of all, from 1"),
                    f.count("runs", "runs that count"),
                    f.number("value", "", "mean", null=True),
                )),
                f.number("drift", "-", "change from the first to the last set, relative; null with one set", null=True),
                f.interval("drift_ci95", "-", "its 95 % interval; null without one", null=True),
            )),
            *more,
            f.rows("limits", "thresholds in use", (
                f.text("key", "key in a file for `--limits`, with its table"),
                f.number("value", "", "value in use"),
                f.number("default", "", "default"),
                f.text("unit", "unit"),
                f.text("meaning", "meaning"),
                f.text("source", "where the value comes from"),
            )),
            f.rows("failed", "logs that could not be read", (f.text("log", "log"), f.text("reason", "why"))),
            f.several("notes", "sentences on the test"),
        ),
        files=(f"{kind}.json",),
    )  # fmt: skip


def _kmh(name: str, meaning: str) -> f.Field:
    return f.number(f"{name}_kmh", "km/h", meaning, null=True)


STRAIGHT = _document(
    "straight",
    "Straight aquaplaning: the speed of 15 % slip of every run, mean and index of every set.",
    (
        _kmh("v_15", "speed of the slip beside it; of a censored run the speed that it is above"),
        f.number("slip", "-", "slip of that speed: `straight.slip` in use, by default 15 %"),
        f.flag("censored", "whether 15 % were not reached before the lane's end"),
        *(_kmh(f"v_{n}", f"speed of {int(n)} % slip; null where it was not reached") for n in ("05", "10", "50")),
        *(_kmh(f"v_{n}", f"speed at the first {what} on the lane; null without one") for n, what in SIGNS.items()),
        f.mapping("onset_missing", "what the log lacks for these signs, by detector; null if they were not looked for",
                f.text("", ""), null=True),
        f.text("reference", "signal behind the speeds: v_x, or the free wheel on the dry side", null=True),
        f.text("other_reference", "the other one; null without one", null=True),
        _kmh("v_15_other", "the same speed by the other reference"),
        *f.or_null(
            f.number("a_x", "m/s^2", "mean acceleration before the crossing, by the speed"),
            f.number("yaw_rate", "rad/s", "largest yaw rate on the lane before the crossing"),
            f.number("radius_ratio", "-", "ratio of the wheels' radii, from the dry second"),
            f.number("v_x_late_s", "s", "by how much v_x was late, which is taken off; null if nothing was"),
            f.text("wet_side", "side in water", ("left", "right")),
            f.text("axle", "driven axle", ("f", "r")),
            f.number("crossing_s", "s", "when 15 % were reached"),
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
    f.or_null(
        f.number("v_entry_kmh", "km/h", "speed at the trough"),
        f.number("a_y_dry", "m/s^2", "lateral acceleration, mean of the dry second before"),
        f.number("a_y_least", "m/s^2", "least in the trough, of means over 0.1 s"),
        f.number("a_y_mean", "m/s^2", "mean in the trough"),
        f.number("radius_m", "m", "radius of the path before the trough"),
        f.number("steer_change", "-", "largest change of the steering angle in the trough, relative"),
        _LANE,
    ),
    (
        f.number("value", "", "the number that is compared, see `result`", null=True),
        f.interval("ci95", "", "95 % interval, bootstrap over passes with Student's t; null without one", null=True),
        *(
            end for n, what in (
                ("v_greatest", "speed of the greatest mean lateral acceleration; open beyond those driven"),
                ("v_half", "speed at which the least lateral acceleration is half of the dry one"),
                ("v_zero", "speed at which the least lateral acceleration is 0"),
            )
            for end in f.open_ci(f"{n}_kmh", "km/h", f"{what}; null where the passes do not reach it")
        ),
        f.obj("curve", "curves over the entry speed", tuple(
            f.several(n, what, f.number("", unit, "", null=True)) for n, unit, what in (
                ("v_kmh", "km/h", "mean entry speed of each step"),
                ("a_y_least", "m/s^2", "concave fit of the least lateral acceleration"),
                ("a_y_mean", "m/s^2", "concave fit of the mean lateral acceleration"),
                ("a_y_dry", "m/s^2", "mean of the dry lateral acceleration"),
            )
        )),
    ),
    (
        f.obj("result", "what is compared", (
            f.text("name", "name", tuple(RESULTS)), f.text("unit", "unit"), f.text("meaning", "meaning"),
        )),
        f.interval("common_kmh", "km/h", "speeds that all sets have driven; null without any", null=True),
    ),
)  # fmt: skip

BRAKING = _document(
    "braking",
    "Wet braking: the braking force coefficient of every stop, mean and index of every set.",
    f.or_null(
        f.number("bfc", "-", "braking force coefficient"),
        f.number("bfc_20", "-", "the same at the reference temperature"),
        f.number("distance_m", "m", "way between both speeds"),
        f.number("v_from_kmh", "km/h", "speed at the begin"),
        f.number("v_to_kmh", "km/h", "speed at the end"),
        f.number("temperature_c", "degC", "temperature"),
        f.number("water_depth_mm", "mm", "water depth"),
        f.number("texture_mm", "mm", "macrotexture depth"),
        f.number("start_s", "s", "begin"),
        f.number("end_s", "s", "end"),
    ),
    (
        *_summary("", "-", "braking force coefficient"),
        f.number("wet_grip_index", "-", "wet grip index by the user's coefficients; null without them", null=True),
        f.number("temperature_c", "degC", "mean temperature of the stops behind it", null=True),
    ),
)
