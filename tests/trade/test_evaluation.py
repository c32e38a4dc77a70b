"""A whole test: order, sets, control tyre, JSON of the contract, text and page."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aqualog.book.topics import DOCS
from aqualog.campaign.definition import Campaign, Run
from aqualog.core.errors import ConfigError
from aqualog.report.page import report_page
from aqualog.report.text import report_text
from aqualog.report.trade.document import trade_document
from aqualog.report.trade.figures import trade_figures
from aqualog.report.trade.sections import headline, trade_report
from aqualog.trade.braking import Stop
from aqualog.trade.curve import CurvePass
from aqualog.trade.entry import UNPLANNED, Entry
from aqualog.trade.evaluation import Options, check_control, entries_of, evaluated
from aqualog.trade.grip import Coefficients
from aqualog.trade.limits import Limits, defaults, described
from aqualog.trade.logs import Measured, Request, measure_signals
from aqualog.trade.onset import Onset
from aqualog.trade.speeds import DELAY_OPEN, NO_V_X
from aqualog.trade.straight import StraightRun, straight_runs
from tests.trade import made

KMH = 1.0 / 3.6


def run(v, *, a_x=1.3, above=False, reasons=()):
    speeds = {"v_05": (v - 5) * KMH, "v_10": (v - 2) * KMH, "v_15": math.nan if above else v * KMH, "v_50": math.nan}
    bound = v * KMH if above else math.nan
    return StraightRun(speeds, {}, "v_x", "", bound, tuple(reasons), ("no gear",), a_x, 0.01, 1.0, 6.0, "left", "f")


def entries(*sets, keys=("tyre",)):
    found = []
    for tyre, records in sets:
        for record in records:
            order = float(len(found))
            found.append(Entry(f"{int(order)}.mf4", 1, order, tuple((k, tyre) for k in keys), tyre, record))
    return tuple(found)


def straight(*sets, control="", limits=None):
    return evaluated(entries(*sets), Options("straight", limits or defaults(), ("tyre",), control))


def test_set_mean_and_index_with_a_drifting_control():
    # the control falls by 1 km/h from set to set; A runs between them and equals it, B is 8 km/h better
    c = [("C", [run(80.2), run(79.8)]), ("C", [run(79.2), run(78.8)]), ("C", [run(78.2), run(77.8)])]
    test = straight(c[0], ("A", [run(79.7), run(79.3)]), c[1], ("B", [run(86.7), run(86.3)]), c[2], control="C")
    rows = {dict(s.group)["tyre"]: s for s in test.sets}
    assert [b.estimate.value for b in test.controls[0].control.blocks] == pytest.approx([80.0, 79.0, 78.0])
    assert rows["A"].index.value == pytest.approx(100.0)
    assert rows["A"].index.sentence.startswith("not different from C")
    assert rows["B"].index.value == pytest.approx(100.0 * 86.5 / 78.5)
    assert "points above C" in rows["B"].index.sentence
    assert rows["C"].index is None
    assert rows["C"].summary.mean == pytest.approx(79.0)
    drift = test.controls[0].drift
    assert drift.change == pytest.approx(78.0 / 80.0 - 1.0)
    # spread of a control run: 0.2828 in each set, three degrees of freedom; each set of two
    assert test.controls[0].control.blocks[0].estimate.variance == pytest.approx(0.08 / 2)


def test_a_run_with_another_acceleration_does_not_count():
    test = straight(("A", [run(78.0), run(78.4), run(78.2, a_x=1.31), run(90.0, a_x=1.6)]))
    assert test.valid == 3
    assert "the acceleration before 15 % is 1.60 m/s², more than 10 %" in test.entries[3].reasons[0]
    assert test.sets[0].summary.mean == pytest.approx(78.2)
    wide = straight(
        ("A", [run(78.0), run(78.4), run(78.2), run(90.0, a_x=1.6)]), limits=Limits.of({"straight.a_x_share": 0.5})
    )
    assert wide.valid == 4


def test_a_run_that_does_not_show_how_late_v_x_is_takes_the_ratio_of_its_set():
    def late(v, by, wheel, notes=()):
        lag = math.nan if notes else 0.5
        return replace(run(v), speeds_other={"v_15": by * KMH}, other=wheel, late=lag, notes=notes)

    sure = [late(78.0, 78.78, "omega_rr"), late(78.4, 79.184, "omega_rr"), late(80.0, 84.0, "omega_rl")]
    unsure = late(75.5, 78.78, "omega_rr", (DELAY_OPEN,))  # 2.5 km/h too low
    test = straight(("A", [*sure, unsure]), ("B", [unsure]))
    assert [e.value for e in test.entries] == pytest.approx([78.0, 78.4, 80.0, 78.0, 75.5])
    assert (test.entries[3].found.reference, test.entries[3].found.other) == ("omega_rr", "v_x")
    assert "at its ratio to v_x in the set" in test.entries[3].found.notes[0]
    assert test.entries[4].found.notes == (DELAY_OPEN,)


def test_a_run_without_v_x_takes_the_ratio_of_its_set():
    def of(v, by, **more):
        return replace(run(v), speeds_other={"v_15": by * KMH}, other="omega_rr", **more)

    lacks = replace(run(78.78), reference="omega_rr", notes=(NO_V_X.format("omega_rr"),))
    above = replace(lacks, speeds={"v_15": math.nan}, v_bound=80.8 * KMH)
    sure, unsure = of(78.0, 78.78, late=0.1), of(78.0, 78.78, notes=(DELAY_OPEN,))
    test = straight(("A", [sure, lacks, above]), ("B", [lacks, lacks]), ("C", [unsure, lacks]))
    assert [e.value for e in test.entries[:5]] == pytest.approx([78.0, 78.0, 80.0, 78.78, 78.78])
    said = "no v_x in the log: the speed is that of the free wheel omega_rr, "
    assert test.entries[1].found.notes == (f"{said}at its ratio to v_x in the set",)
    assert test.entries[3].found.notes == (f"{said}with the vehicle file's radius",)
    assert [e.valid for e in test.entries] == [True] * 6 + [False]
    assert test.entries[6].reasons == (
        "no v_x in the log, and no other run of its set shows the radius of its free wheel omega_rr",
    )


def test_another_slip_has_its_name_in_page_text_and_reasons():
    limits = Limits.of({"straight.slip": 0.1})
    test = straight(("A", [run(78.0), run(78.4), run(78.2), run(78.0, a_x=0.8)]), limits=limits)
    report = trade_report(test)
    page = report_page(report, title="week")
    for shown in (report_text(report), page, json.dumps(trade_document(test, "week")["runs"])):
        assert "15 %" not in shown.partition("limits-section")[0].partition("Thresholds")[0]
        assert "the acceleration before 10 % is 0.80" in shown
    assert "Speed of 10 % slip [km/h]" in page
    assert "v_10 [km/h]" in report_text(report)
    assert trade_document(test, "week")["runs"][0]["slip"] == 0.1
    assert "v_15" not in page
    columns = made.straight(v_15=64.5, slope=0.5)
    (found,) = straight_runs(made.signals(columns), made.FWD, limits.straight)
    assert any(r.startswith("10 % came") for r in found.reasons)


def test_a_stop_that_abs_did_not_control_does_not_count():
    stops = [Stop(22.2, 5.6, 33.0, b, b, 20.0, 1e-3, 0.7e-3, 3.0, 5.4) for b in (0.70, 0.71, 0.72, 0.69, 0.30, 0.6)]
    test = evaluated(entries(("A", stops)), Options("braking", defaults(), ("tyre",)))
    assert [e.valid for e in test.entries] == [True, True, True, True, False, True]
    assert test.entries[4].reasons == ("the coefficient is 0.30, more than 20 % from the set's median of 0.69: did ABS "
                                       "control the brake?",)  # fmt: skip


@pytest.mark.parametrize(("told", "counts"), [(7.0, True), (6.0, True), (4.0, False)])
def test_water_of_another_depth_than_planned(told, counts):
    drive = made.signals(made.straight())  # 7 mm in the left track
    planned = Run((Path("a.mf4"),), Path("car.toml"), None, None, {"water_depth_left_mm": told, "water_depth_mm": 0.0})
    (run,) = measure_signals(drive, made.FWD, planned, Request("straight", defaults(), with_onset=False)).found
    assert run.valid == counts
    assert counts or run.reasons == ("7.0 mm of water in the log, 4.0 mm in the campaign",)


@pytest.mark.parametrize(("bar", "notes"), [(3.3, 1), (2.5, 0)])
def test_tyre_pressures_that_are_above_the_campaign_by_that_of_the_air(bar, notes):
    drive = made.signals(made.straight() | {"pressure_fl": np.full(1500, 1e5 * bar)})
    planned = Run((Path("a.mf4"),), Path("car.toml"), None, None, {"pressure_front_bar": 2.2})
    found = measure_signals(drive, made.FWD, planned, Request("straight", defaults(), with_onset=False))
    assert found.found[0].valid
    assert [n for n in found.notes if "1.1 bar above the campaign's: absolute?" in n] == list(found.notes)[
        -notes:
    ] * notes


@pytest.mark.parametrize("kind", ["straight", "curve", "braking"])
def test_lane_times_that_the_log_contradicts(kind):
    def of(*lane):
        planned = Run((Path("a.mf4"),), Path("car.toml"), None, lane, {})
        return measure_signals(
            made.signals(made.straight()), made.FWD, planned, Request(kind, defaults(), with_onset=False)
        ).found[0]

    assert not [x for x in (*of(3.2, 14.0).notes, *of(3.2, 14.0).reasons) if "the log has water" in x]
    said = "the campaign has water from 4.00 to 14.00 s, the log has water from 3.00 to 14.00 s"
    assert f"{said}: the campaign's counts" in of(4.0, 14.0).notes
    why = [x for x in of(0.5, 4.0).reasons if "the log has water from 3.00 to 14.00 s. Try: the lane times" in x]
    assert why


def test_runs_beyond_the_lane_count_as_above():
    test = straight(("A", [run(78.0), run(79.0), run(80.0), run(81.0, above=True)]), ("B", [run(90.0, above=True)] * 3))
    a, b = (s.summary for s in test.sets)
    assert a.censored == 1
    assert a.mean > 79.25  # more than the mean with 81 as a value would say
    assert math.isnan(b.mean)
    assert b.above == pytest.approx(90.0)


@pytest.mark.parametrize(
    "records", [[], [run(78.0)], [run(78.0, reasons=("no lane",))] * 2, [run(85.0, above=True)] * 2]
)
def test_odd_sets_make_a_document_a_text_and_a_page(records):
    test = straight(("C", [run(80.0), run(80.4)]), ("A", records), ("C", [run(80.1), run(80.2)]), control="C")
    document = trade_document(test, "made")
    json.dumps(document, allow_nan=False)
    report = trade_report(test)
    assert report_text(report).startswith("straight aquaplaning:")
    assert "<html" in report_page(report, title="made", plotly="none")


def test_no_valid_run_of_the_control():
    test = straight(("C", [run(80.0, reasons=("no lane",))]), ("A", [run(80.0), run(81.0), run(80.2)]), control="C")
    assert test.controls == ()
    assert test.sets[1].index is None
    assert "no valid run of the control C: no index" in test.notes


def test_a_set_that_holds_runs_of_the_control_is_not_compared_with_it():
    both = [replace(e, group=(("wear", "new"),)) for e in entries(("C", [run(80.0), run(80.4)]), ("A", [run(79.0)]))]
    worn = [replace(e, group=(("wear", "worn"),), order=9.0) for e in entries(("B", [run(70.0), run(70.2)]))]
    test = evaluated((*both, *worn), Options("straight", defaults(), ("wear",), "C"))
    new, other = test.sets
    assert (new.index, new.index_note) == (None, "2 of 3 runs are on C itself: no index. Try: sets by tyre")
    assert other.index.control == pytest.approx(80.2)


def test_one_control_set_is_held_constant():
    test = straight(("C", [run(80.0), run(80.4)]), ("A", [run(80.0), run(81.0), run(80.2)]), control="C")
    assert "its drift is not known" in test.notes[0]
    assert test.sets[1].index.value == pytest.approx(100.0 * 80.4 / 80.2)


def test_control_of_the_same_configuration_if_it_has_one():
    def entry(tyre, pressure, v, order):
        group = (("tyre", tyre), ("pressure_rear_bar", pressure))
        return Entry(f"{order}.mf4", 1, float(order), group, tyre, run(v))

    given = [("C", 2.0, 70.0), ("C", 2.0, 70.2), ("C", 2.5, 80.0), ("C", 2.5, 80.2), ("A", 2.0, 77.0), ("A", 2.0, 77.2),
             ("A", 3.0, 77.0), ("A", 3.0, 77.2)]  # fmt: skip
    test = evaluated(
        [entry(*g, i) for i, g in enumerate(given)], Options("straight", defaults(), ("tyre", "pressure_rear_bar"), "C")
    )
    own, strange = (s for s in test.sets if s.index is not None)
    assert own.index.control == pytest.approx(70.1)
    assert "another configuration" in strange.index_note
    assert len(test.controls) == 3  # those of 2.0 and 2.5 bar, and both for 3.0 bar
    test = evaluated(
        [entry(*g, i) for i, g in enumerate((*given[:2], *given[4:]))],
        Options("straight", defaults(), ("tyre", "pressure_rear_bar"), "C"),
    )
    assert len(test.controls) == 1  # one configuration stands once


def test_document_of_the_contract():
    test = straight(("C", [run(80.0), run(80.4)]), ("A", [run(88.0), run(88.4), run(70.0, reasons=("shift",))]),
                    ("C", [run(80.2), run(80.1)]), control="C")  # fmt: skip
    d = trade_document(test, "made")
    r = d["runs"][4]
    assert {k: r[k] for k in ("log", "v_15_kmh", "censored", "valid", "reason")} == {
        "log": "4.mf4", "v_15_kmh": 70.0, "censored": False, "valid": False, "reason": "shift",
    }  # fmt: skip
    assert d["runs"][0]["reason"] is None
    s = next(s for s in d["sets"] if s["tyre"] == "A")
    assert s["runs"] == 3
    assert s["valid"] == 2
    assert s["mean_kmh"] == pytest.approx(88.2)
    assert s["ci95"][0] < 88.2 < s["ci95"][1]
    assert s["cv"] == pytest.approx(0.28284 / 88.2, rel=1e-3)
    assert s["index"] == pytest.approx(100 * 88.2 / 80.175, rel=1e-3)
    assert s["index_ci95"][0] < s["index"] < s["index_ci95"][1]
    assert {x["key"] for x in d["limits"]} == {x.path for x in described() if x.table in ("straight", "set")}
    assert next(x for x in d["limits"] if x["key"] == "straight.slip")["default"] == 0.15


def test_onset_stands_beside_the_set():
    made = [replace(e, onset=Onset({"minor_spin_down": 70.0 * KMH}, {"slip_slope_drop": "torque_fl"}))
            for e in entries(("A", [run(80.0), run(80.4), replace(run(80.2), speeds={"v_15": 80.2 * KMH})]))]  # fmt: skip
    d = trade_document(evaluated(made, Options("straight", defaults(), ("tyre",))), "made")
    assert d["sets"][0]["v_minor_spin_down_kmh"] == pytest.approx(70.0)
    assert d["sets"][0]["v_slip_slope_drop_kmh"] is None
    assert d["sets"][0]["v_05_kmh"] == pytest.approx(75.2)
    assert d["runs"][0]["onset_missing"] == {"slip_slope_drop": "torque_fl"}


def test_braking_needs_six_stops_and_gives_the_wet_grip_index():
    def stop(bfc, t=20.0):
        return Stop(22.2, 5.6, 33.0, bfc, bfc, t, 1e-3, 0.7e-3, 3.0, 5.4)

    coefficients = Coefficients("made", 125.0, -0.4, 20.0, -8.0, 0.70)
    options = Options("braking", defaults(), ("tyre",), "C", coefficients=coefficients)
    test = evaluated(
        entries(("C", [stop(0.70)] * 3), ("A", [stop(0.77, 25.0), stop(0.77, 25.0)]), ("C", [stop(0.70)] * 3)), options
    )
    control, a = test.sets
    assert control.summary.notes == ("all values are equal: the interval has no width",)
    assert "2 valid runs of 2, at least 6 needed" in a.summary.notes
    assert a.index.value == pytest.approx(110.0)
    assert a.grip_index == pytest.approx((137.5 - 2.0) / 100.0)
    assert trade_document(test, "x")["sets"][1]["wet_grip_index"] == pytest.approx(1.355)
    wide = evaluated(entries(("A", [stop(x) for x in (0.6, 0.8, 0.7, 0.65, 0.75, 0.7)])), options)
    assert "coefficient of variation is 10.1 %, at most 4 %" in " ".join(wide.sets[0].summary.notes)
    cold = evaluated(entries(("C", [stop(0.7)] * 2), ("A", [stop(0.7, math.nan)] * 2)), options)
    assert "no temperature of each stop" in cold.sets[1].index_note


def test_curve_document_and_index():
    def passes(shift):
        return [
            CurvePass(v * KMH, (v * KMH) ** 2 / 100, 4 - 0.2 * (v - 60) + shift + k, 5 - 0.2 * (v - 60) + shift + k, 100.0)
            for v in (60, 65, 70, 75) for k in (-0.1, 0.0, 0.1)
        ]  # fmt: skip

    options = Options("curve", defaults(), ("tyre",), "C")
    test = evaluated(entries(("C", passes(0.0)), ("A", passes(0.5)), ("C", passes(0.2))), options)
    a = next(s for s in test.sets if not s.is_control)
    assert a.curve.result == pytest.approx(4.0)  # 5 ... 2, and 0.5
    assert a.index.control == pytest.approx(3.6)
    assert a.index.value == pytest.approx(100.0 * 4.0 / 3.6)
    d = trade_document(test, "made")
    assert d["common_kmh"] == pytest.approx([60.0, 75.0])
    assert set(d["sets"][1]) >= {"value", "ci95", "index", "index_ci95", "v_half_kmh", "v_zero_kmh", "v_greatest_kmh"}
    assert "4.00" in report_text(trade_report(test))
    json.dumps(d, allow_nan=False)
    fast = entries(("", [replace(p, v_entry=p.v_entry + 5.0) for p in passes(0)]))
    fast = [replace(e, group=UNPLANNED, order=e.order + 99.0) for e in fast]
    mixed = evaluated((*test.entries, *fast), options)  # a log that no run names leaves the planned sets as they are
    assert (mixed.between, mixed.sets[1].curve.result) == (test.between, a.curve.result)
    assert mixed.sets[2].curve.result == pytest.approx(3.5)


@pytest.mark.parametrize("kind", ["straight", "curve", "braking"])
def test_documents_are_as_their_schemas_say(kind):
    jsonschema = pytest.importorskip("jsonschema")
    stop = Stop(22.2, 5.6, 33.0, 0.7, math.nan, math.nan, 1e-3, math.nan, 3.0, 5.4)
    record = {"straight": run(80.0), "curve": CurvePass(20.0, 4.0, 2.0, 3.0, 100.0), "braking": stop}[kind]
    bad = {
        "straight": StraightRun(reasons=("no",)),
        "curve": CurvePass(reasons=("no",)),
        "braking": Stop(reasons=("no",)),
    }
    found = entries(("C", [record, record]), ("A", [record, bad[kind]]), ("B", [bad[kind]]), ("C", [record]))
    test = evaluated(found, Options(kind, defaults(), ("tyre",), "C"), {"gone.mf4": "no such file"})
    stored = json.loads((DOCS / "schemas" / f"test_{kind}.schema.json").read_text(encoding="utf-8"))
    document = json.loads(json.dumps(trade_document(test, "made"), allow_nan=False))
    assert [e.message for e in jsonschema.Draft202012Validator(stored).iter_errors(document)] == []
    assert "<html" in report_page(trade_report(test), title="made", plotly="none")


def test_names_that_a_page_could_run_are_text():
    name = "<b>A</b>&%{x}"
    test = straight(("C", [run(80.0), run(80.4)]), (name, [run(80.0), run(81.0)]), ("C", [run(80.1)]), control="C")
    figures = json.dumps(trade_figures(test), ensure_ascii=False)
    assert "<b>" not in figures
    assert "‹b›A" in figures
    assert "<b>A" not in report_page(trade_report(test), title="made", plotly="none")


def campaign(*tyres):
    runs = tuple(Run((Path(f"{i}.mf4"),), Path("car.toml"), None, None, {"tyre": t}) for i, t in enumerate(tyres))
    return Campaign("made", Path("campaign.toml"), None, runs)


def test_order_of_the_runs():
    c = campaign("A", "B", "A")
    at = [Measured((run(80.0),), (), t) for t in (300, 100, 200)]
    names = ["0", "1", "2"]
    assert [e.log for e in entries_of(c, names, dict(enumerate(at)), ("tyre",))] == ["1", "2", "0"]
    same = [m._replace(start_ns=5) for m in at]  # a clock that is not set: as in the campaign
    assert [e.log for e in entries_of(c, names, dict(enumerate(same)), ("tyre",))] == ["0", "1", "2"]
    two = [m._replace(start_ns=t) for m, t in zip(at, (300, 5, 5), strict=True)]
    assert [e.log for e in entries_of(c, names, dict(enumerate(two)), ("tyre",))] == ["0", "1", "2"]
    late = replace(run(80.0), lane=(40.0, 50.0))  # a log of a whole session: its runs follow each other
    session = [m._replace(start_ns=7_000_000_000, found=(f,)) for m, f in
               zip(at, (late, run(80.0), replace(late, lane=(20.0, 30.0))), strict=True)]  # fmt: skip
    one = replace(c, runs=tuple(replace(r, logs=c.runs[0].logs) for r in c.runs))
    assert [e.log for e in entries_of(one, names, dict(enumerate(session)), ("tyre",))] == ["1", "2", "0"]
    assert [e.log for e in entries_of(c, names, dict(enumerate(session)), ("tyre",))] == ["0", "1", "2"]
    broken = {0: at[0], 1: "cannot be read", 2: at[2]}
    assert [e.log for e in entries_of(c, names, broken, ("tyre",))] == ["2", "0"]


def test_a_control_that_nobody_drove():
    with pytest.raises(ConfigError, match="no run has the control tyre"):
        check_control(campaign("A", "B"), "SRTT")
    check_control(campaign("A", "B"), "")


def test_headline_without_a_run_of_this_kind():
    test = straight(("A", [StraightRun(reasons=("no watered lane in the log",))]))
    assert headline(test) == "straight aquaplaning: 0 of 1 run valid; the list below says why"
