"""The scorer of sealed cases, on verdicts made by hand: it counts what is right, wrong, left open, and not counted."""

import json
import math

import pytest

from tests.blind import judge as command
from tests.blind.judging import figures as made
from tests.blind.judging.answers import read_answer, twins_of
from tests.blind.judging.cases import judge
from tests.blind.judging.run import Place, diagnose_all, places
from tests.blind.sealed import seal


def cause(effect, value=0.0, where=None, probability=None, parameter="x"):
    values = {parameter: {"value": value, "ci95": [value - 1.0, value + 1.0], "unit": "-"}}
    return {"effect": effect, "where": where, "parameters": values, "probability": probability}


def document(verdict, *causes, **more):
    return {"verdict": verdict, "causes": list(causes), "alternatives": [], "unexplained": [], **more}


def truth(kind="known", *hidden, z=10.0, **more):
    effects = [{"effect": e, "where": w, "parameters": {p: v}, "detectability": z} for e, w, p, v in hidden]
    return {
        "world": "hand", "seed": 1, "kind": kind, "drive_type": "mixed", "noise": "white", "unknown": None, "effects": effects, **more,
    }  # fmt: skip


MASS = ("payload_mass", None, "delta_mass", 100.0)


def judged(verdict, hidden, clean=None):
    return judge("c", read_answer(verdict), hidden, clean=None if clean is None else read_answer(clean))


def measured(cases):
    return {m.name.strip(): (m.count, m.value) for m in made.figures(cases)}


def test_right_name_true_twins_and_wrong_name():
    right = judged(document("named", cause("payload_mass", 100.0, parameter="delta_mass")), truth("known", MASS))
    twins = judged(document("cannot_tell", cause("torque_gain"), cause("payload_mass")), truth("known", MASS))
    loose = judged(document("cannot_tell", cause("tone_ring"), cause("payload_mass")), truth("known", MASS))
    wrong = judged(document("named", cause("torque_gain")), truth("known", MASS))
    silent = judged(document("no_effect"), truth("known", MASS))
    crashed = judged({"verdict": "failed", "error": "ended with -9"}, truth("known", MASS))
    every = [right, twins, loose, wrong, silent, crashed]
    assert [c.is_right_or_twins for c in every] == [True, True, False, False, False, False]
    assert [c.in_answer for c in every] == [True, True, True, False, False, False]
    got = measured(every)
    assert got["right name first, z >= 8"] == (6, pytest.approx(1 / 6))
    assert got["truth in the answer"] == (6, 0.5)
    assert got["confidently wrong, z >= 8"] == (6, pytest.approx(1 / 6))
    assert got["one name given, z >= 8"] == (6, pytest.approx(2 / 6))
    assert got["one name given, forecast isolable"] == (1, 0.0)  # the one that failed
    assert got["true value within the 95 % interval"] == (1, 1.0)
    assert got["cases that failed"] == (6, pytest.approx(1 / 6))


def test_relations_that_are_exact_are_twins_either_way():
    assert {"road_grade", "rolling_resistance"} <= twins_of("accelerometer_bias")
    assert "payload_mass" in twins_of("trailer")
    assert "trailer" in twins_of("payload_mass")


def test_nulls_and_weak_effects():
    quiet, loud = (
        judged(document("no_effect"), truth("null")),
        judged(document("named", cause("head_wind")), truth("null")),
    )
    limits = {"detection_limits": {"payload_mass": "120 kg"}}
    seen = judged(document("no_effect", **limits), truth("known", MASS, z=4.0))
    over = judged(document("no_effect", detection_limits={"payload_mass": "80 kg"}), truth("known", MASS, z=4.0))
    got = measured([quiet, loud, seen, over])
    assert got["false discovery, nothing hidden"] == (2, 0.5)
    assert got["noise white"] == (2, 0.5)
    assert got["confidently wrong at z 3 ... 5"] == (2, 0.0)
    assert got["no effect, and the limit holds the truth"] == (2, 0.5)


def test_compound_set():
    hidden = truth("compound", MASS, ("aero_drag", None, "delta_drag_area", 0.1))
    exact = judged(document("compound", cause("aero_drag"), cause("payload_mass")), hidden)
    more = judged(document("compound", cause("aero_drag"), cause("payload_mass"), cause("tone_ring")), hidden)
    half = judged(document("named", cause("aero_drag")), hidden)
    got = measured([exact, more, half])
    assert got["exact set of two"] == (3, pytest.approx(1 / 3))
    assert got["a false member"] == (3, pytest.approx(1 / 3))
    assert got["members recalled"] == (6, pytest.approx(5 / 6))


def form(mechanism, *over, probability=0.9):
    return {"channel": "force_balance", "mechanism": mechanism, "depends_on": list(over), "probability": probability}


def test_unknown_form_needs_mechanism_and_coordinate():
    hidden = truth("unknown", unknown={"mechanism": "force", "depends_on": ["v_x"], "kind": "hump", "held_back": True})
    right = judged(document("unexplained", unexplained=[form("force on the car", "speed")]), hidden)
    second = judged(
        document("unexplained", unexplained=[form("force", "t", probability=0.2), form("force", "v_x")]), hidden
    )
    coordinate = judged(document("unexplained", unexplained=[form("force", "position")]), hidden)
    mechanism = judged(document("unexplained", unexplained=[form("slip of an axle", "v_x")]), hidden)
    channel = judged(document("unexplained", unexplained=[{"channel": "force_balance", "depends_on": ["v_x"]}]), hidden)
    named = judged(document("named", cause("aero_drag")), hidden)
    every = [right, second, coordinate, mechanism, channel, named]
    assert [c.form_is_right for c in every] == [True, True, False, False, True, False]
    got = measured(every)
    assert got["unexplained"] == (6, pytest.approx(5 / 6))
    assert got["with the right mechanism and coordinate"] == (6, 0.5)
    assert got["misnamed"] == (6, pytest.approx(1 / 6))
    assert got["hump, held back"] == (6, 0.5)


def test_function_of_a_right_form_is_compared_where_both_are_known():
    def case(said, true, over="v_x"):
        mechanism = said["mechanism"].partition("_")[0]
        unknown = {"mechanism": mechanism, "depends_on": [over], "kind": "f", "held_back": False, "points": true}
        return judged(document("unexplained", unexplained=[said]), truth("unknown", unknown=unknown))

    true = {"x": [10.0, 20.0, 30.0], "f": [0.0, 100.0, 0.0], "unit": "N"}
    said = {"unit": "N", "x": [[5.0], [15.0], [20.0], [25.0], [40.0]], "f": [900.0, 60.0, None, 40.0, 900.0]}
    off, other = case({**form("force", "v_x"), **said}, true), case({**form("force", "t"), **said}, true)
    assert (off.function_error, other.function_error) == (pytest.approx(0.2), pytest.approx(math.nan, nan_ok=True))
    rear = {**true, "unit": "-", "slip_r": [10.0, 110.0, 10.0]}
    axle = case({**form("slip_r", "v_x"), **said, "unit": "-"}, rear)
    assert axle.function_error == pytest.approx(math.hypot(0.0, 20.0) / math.hypot(60.0, 60.0))
    offset = {"x": [-1.0, 0.0, 1.0, 2.0], "f": [0.1, 0.0, 0.1, 0.4], "unit": "m/s^2"}
    gain = {**form("accelerometer_gain", "a_x"), "unit": "-", "x": [[-1.0], [1.0], [2.0]], "f": [-0.1, 0.1, 0.2]}
    assert case(gain, offset, "a_x").function_error == pytest.approx(0.0, abs=1e-12)
    got = measured([off, other, axle])
    assert got["function error of right forms, median"] == (2, pytest.approx(0.5 * (0.2 + axle.function_error)))
    assert got["function error of right forms at most 15 %"] == (2, 0.0)


def test_form_that_the_library_has_under_a_name_may_be_named():
    unknown = {"mechanism": "kinematic", "depends_on": ["position"], "kind": "rolling_road", "held_back": False}
    hidden = truth("unknown", unknown={**unknown, "accepts": ["road_grade", "unexplained_grade"]})
    grade = judged(document("named", cause("road_grade", probability=0.9)), hidden)
    other = judged(document("named", cause("head_wind", probability=0.9)), hidden)
    both = judged(document("compound", cause("road_grade"), cause("head_wind")), hidden)
    assert [c.form_is_right for c in (grade, other, both)] == [True, False, False]
    assert [c.wrong for c in (grade, other, both)] == [False, True, True]
    assert (grade.chances, other.chances) == (((0.9, True),), ((0.9, False),))
    got = measured([grade, other, both])
    assert got["misnamed"] == (3, pytest.approx(2 / 3))
    assert got["unexplained"] == (3, pytest.approx(1 / 3))


def test_exact_twin_is_right_and_one_of_three_is_not():
    roll = ("rolling_resistance", None, "delta_r_w", 0.004)
    twin = judged(document("named", cause("brake_drag", probability=0.9)), truth("known", roll))
    grade = judged(document("named", cause("accelerometer_bias", where="a_x")), truth("known", roll))
    assert (twin.first_is_right, twin.is_right_or_twins, twin.wrong) == (True, True, False)
    assert twin.chances == ((0.9, True),)
    assert (grade.first_is_right, grade.wrong) == (False, True)


def test_effect_below_the_stated_limit_is_no_miss():
    below = judged(document("no_effect", detection_limits={"payload_mass": "120 kg"}), truth("known", MASS))
    above = judged(document("no_effect", detection_limits={"payload_mass": "80 kg"}), truth("known", MASS))
    unsaid = judged(document("no_effect"), truth("known", MASS))
    assert [c.limit_is_right for c in (below, above, unsaid)] == [True, False, False]
    loss = truth("known", ("pressure_loss", "rl", "duration", 60.0))
    loss["effects"][0]["parameters"]["radius"] = 0.003  # which the limit is for
    assert judged(document("no_effect", detection_limits={"pressure_loss@rl": "0.006"}), loss).limit_is_right
    got = measured([below, above, unsaid])
    assert got["right name first, z >= 8"] == (2, 0.0)
    assert got["no effect, below the stated limit (no miss)"] == (3, pytest.approx(1 / 3))
    assert len(made.misses_text([below, above, unsaid]).splitlines()) == 2


def test_miss_shows_truth_and_answer_with_its_probability():
    wrong = judged(document("named", cause("head_wind", probability=0.97)), truth("known", MASS))
    line = made.misses_text([wrong])
    assert "payload_mass z 10.0" in line
    assert "named: head_wind 0.97" in line


def test_what_the_clean_drive_says_is_not_counted():
    late = cause("signal_delay", 0.03, "torque", parameter="delay")
    clean = document("named", late)
    null = judged(document("named", late), truth("null"), clean)
    assert null.row.verdict == "no_effect"
    load = cause("payload_mass", 100.0, parameter="delta_mass")
    beside = judged(document("compound", late, load), truth("known", MASS), clean)
    assert (beside.row.verdict, beside.row.names, beside.first_is_right) == ("named", ("payload_mass",), True)
    # the same effect again: found only if its value moved, and its true value is the sum
    more = truth("known", ("signal_delay", "torque", "delay", 0.1))
    assert not judged(document("named", late), more, clean).in_answer
    moved = judged(document("named", cause("signal_delay", 0.12, "torque", parameter="delay")), more, clean)
    assert moved.first_is_right
    assert moved.row.truth[0].values["delay"] == pytest.approx(0.13)
    got = measured([moved])
    assert got["true value within the 95 % interval"][0] == 0
    assert got["the same in measured drives"] == (1, 1.0)
    # a lag of one signal is, turned, that of the other
    other = judged(document("named", cause("signal_delay", -0.5, "a_x", parameter="delay")), truth("null"), clean)
    assert other.row.verdict == "no_effect"
    far = judged(document("named", cause("signal_delay", 9.0, "a_x", parameter="delay")), truth("null"), clean)
    assert far.row.verdict == "named"
    # the word of the verdict went to the car's own fault, the form beside it is new
    hidden = truth("unknown", unknown={"mechanism": "force", "depends_on": ["v_x"], "kind": "hump", "held_back": False})
    beside = judged(document("named", late, unexplained=[form("force", "v_x")]), hidden, clean)
    assert (beside.row.verdict, beside.form_is_right) == ("unexplained", True)
    shape = document("unexplained", unexplained=[form("force", "v_x")])
    assert judged(shape, truth("null"), shape).row.verdict == "no_effect"


def test_probabilities_are_judged():
    cases = [judged(document("named", cause("payload_mass", probability=0.9)), truth("known", MASS)) for _ in range(9)]
    cases += [judged(document("named", cause("torque_gain", probability=0.9)), truth("known", MASS))]
    got = measured(cases)
    assert got["probability, expected calibration error"] == (10, pytest.approx(0.0))
    assert got["probability, Brier skill over the base rate"][1] == pytest.approx(0.0)
    assert "0.90 ... 0.95" in made.reliability_text(cases)
    assert math.isnan(measured([judged(document("no_effect"), truth("null"))])["probability, worst bin"][1])


def verdict_in(folder, verdict):
    folder.mkdir(parents=True)
    (folder / "verdict.json").write_text(json.dumps(verdict))


def test_command_scores_a_run_and_leaves_out_what_has_no_verdict(tmp_path, capsys):
    cases, run = tmp_path / "cases", tmp_path / "run"
    seal(cases / "base", truth("null", is_baseline=True))
    seal(cases / "c1", truth("known", MASS, clean="base"))
    seal(cases / "c2", truth("null", clean="base"))
    verdict_in(run / "cases" / "base", document("no_effect"))
    verdict_in(run / "cases" / "c1", document("named", cause("payload_mass")))
    command.main([str(run), str(cases), "--only-score", "--json", str(tmp_path / "out.json")])
    assert "1 cases of 2, 1 measured drives as they are" in capsys.readouterr().out
    (row,) = (c for c in json.loads((tmp_path / "out.json").read_text())["cases"] if c["kind"] == "known")
    assert row["first_is_right"]
    assert (run / "cases" / "ledger.jsonl").is_file()


def test_crash_is_recorded_and_the_others_go_on(tmp_path, capsys):
    cases, run = tmp_path / "cases", tmp_path / "run"
    for name in ("a", "b"):
        seal(cases / name, truth("null"))
    every = places(run, [cases])
    verdict_in(every[1].out, document("no_effect"))
    finished = (every[1].out / "verdict.json").stat().st_mtime_ns
    diagnose_all(every, jobs=2, timeout_s=60.0)
    said = json.loads((every[0].out / "verdict.json").read_text())
    assert said["verdict"] == "failed"
    assert "no drive" in said["error"]
    assert json.loads((every[0].out / "cost.json").read_text())["cpu_seconds"] > 0.0
    assert (every[1].out / "verdict.json").stat().st_mtime_ns == finished  # not made again
    command.main([str(run), str(cases), "--only-score"])
    assert "cases that failed" in capsys.readouterr().out


def test_folders_without_cases_and_of_one_name_are_refused(tmp_path):
    (tmp_path / "x").mkdir()
    with pytest.raises(SystemExit, match="no case"):
        places(tmp_path / "run", [tmp_path / "x"])
    with pytest.raises(SystemExit, match="one name"):
        places(tmp_path / "run", [tmp_path / "x", tmp_path / "y" / "x"])
    assert Place(tmp_path / "x", tmp_path / "run").is_done is False
