"""The whole diagnosis on short simulated drives, asked about few effects."""

import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from aqualog.core.errors import ConfigError, SignalError
from aqualog.core.notation import AXLES, WHEELS
from aqualog.core.provenance import Provenance
from aqualog.diagnose import arena, run, search
from aqualog.diagnose.hypotheses import hypotheses
from aqualog.diagnose.records import Remainder
from aqualog.diagnose.run import Options, diagnose
from aqualog.diagnose.tolerances import TOLERANCES
from aqualog.model.scenario import Steering
from aqualog.model.term import Model, Term
from tests.blind.world.cases import CARS, Hidden, Spec, clean_rows, make_case, world_of
from tests.diagnose.test_drive import CAR, NOISY, changed, plain, signals, term

FEW = ("payload_mass", "accelerometer_bias@a_x", "tyre_radius@fl", "signal_delay@v_x", "road_grade", "head_wind")
QUICK = Options(level=0.01, surrogates=9, views=False, consequences=False)


@pytest.fixture(autouse=True)
def few(monkeypatch):
    """Few effects and no search for functions, so that a diagnosis takes a second."""
    ask(monkeypatch, FEW)
    monkeypatch.setattr(arena, "shapes", lambda *_: ())


def ask(monkeypatch, names):
    def asked(drives, model):
        every, untested = hypotheses(drives, model)
        return tuple(h for h in every if h.allowed or h.key in names), untested

    monkeypatch.setattr(run, "hypotheses", asked)


def noisy(*terms, drop=(), **kw):
    return signals(*terms, sensors=NOISY, drop=("tie_rod_fl", "tie_rod_fr", *drop), **kw)


def told(*terms, model=None, options=QUICK, seed=3, log=None, progress=None):
    return diagnose([("a", log or noisy(*terms, seed=seed))], CAR, model=model, options=options, progress=progress)


@cache
def watched(*masses):
    """A diagnosis among the few effects, with its views, and what it said meanwhile: text and share."""
    seen = []
    loads = [term("payload_mass", delta_mass=m) for m in masses]
    d = told(*loads, options=replace(QUICK, views=True), progress=lambda *said: seen.append(said))
    return d, seen


def keys(d):
    return {c.key for c in d.causes}


def test_the_first_sentence_says_how_many_drives_it_stands_on(monkeypatch):
    logs = [(n, noisy(term("payload_mass", delta_mass=200.0), seed=k)) for k, n in enumerate("ab")]
    monkeypatch.setattr(arena, "MOST_BLOCKS", 1 + round(logs[0][1].duration_s / 0.1))
    d = diagnose(logs, CAR, options=QUICK)
    assert d.sentence.startswith("By 1 of 2 drives: The car ")
    assert any("left out: " in n for n in d.notes)


def test_the_gain_of_one_of_two_motors_is_named(monkeypatch):
    ask(monkeypatch, ("torque_gain", "torque_gain@f", "torque_gain@r", *FEW))
    car = replace(CAR, drivetrain="awd", torque_split_rear=0.55)
    log = noisy(term("torque_gain", "f", gain=1.2), vehicle=car)
    d = diagnose([("a", log)], car, options=QUICK)
    assert (d.verdict, keys(d)) == ("named", {"torque_gain@f"}), d.sentence
    assert d.causes[0].parameters["gain"].value == pytest.approx(1.2, abs=0.02)
    assert d.sentence.startswith("The wheels (front axle) get 1.")


def test_a_gear_shift_is_not_compared():
    log = noisy()
    t = np.arange(log.frame.height) * log.dt
    gap = pl.Series(np.interp(t, [30.0, 30.15, 30.4, 30.55], [0.0, 1.0, 1.0, 0.0]))
    less = [(pl.col(f"torque_{w}") - 0.15 * CAR.mass * CAR.r_e_r * gap).alias(f"torque_{w}") for w in WHEELS]
    shifted = changed(log, log.frame.with_columns(*less, pl.col("a_x") - 0.6 * gap))
    assert 2.0 < told(log=log).used_s - told(log=shifted).used_s < 3.5


def test_the_friction_of_a_differential_is_no_effect(monkeypatch):
    """In curves it brakes the outer wheel and drives the inner one, which a log of the axle's torque does not show."""
    ask(
        monkeypatch,
        [f"{e}@{w}" for e in ("brake_drag", "load_sensitivity", "slip_stiffness") for w in (*WHEELS, *AXLES)],
    )
    car = replace(CAR, drivetrain="fwd")
    preload = next(e for e in TOLERANCES if e.name == "preload")
    log = noisy(Term(preload, {"by": 25.0}, "f"), vehicle=car, steering=Steering(0.016, 14.0, 5.0), seed=3)
    d = diagnose([("a", log)], car, options=QUICK)
    assert (d.verdict, d.causes) == ("no_effect", ())
    assert d.significance.p_value > 0.5


def test_a_sensor_at_the_end_of_its_tolerance_is_in_the_sentence_of_no_effect(monkeypatch):
    ask(monkeypatch, ("accelerometer_gain@a_x", "head_wind"))
    d = told(term("accelerometer_gain", "a_x", gain=1.06))
    assert d.verdict == "no_effect"
    assert d.sentence.endswith(
        "at the end of what is tolerated: accelerometer gain (longitudinal) 4% larger. Check it."
    )
    assert "tolerated" not in told().sentence


def test_no_effect():
    d, _ = watched()
    assert d.verdict == "no_effect"
    assert d.sentence == "No effect: the model agrees with the measurement, at a false-alarm level of 0.01."
    assert (d.causes, d.gain, d.model) == ((), None, Model())
    # where a tyre may lose its air comes out of the drive itself, and rings are sought at the log's own rate
    assert {x.effect for x in d.limits} == {k.split("@")[0] for k in FEW} | {"pressure_loss", "tone_ring"}


def test_named_with_its_size_and_gain():
    d, _ = watched(250.0)
    assert d.verdict == "named"
    assert keys(d) == {"payload_mass"}
    assert d.causes[0].probability > 0.95
    e = d.causes[0].parameters["delta_mass"]
    assert e.low < 250.0 < e.high
    assert 49.0 < e.high - e.low < 53.0  # 5 % by which cars respond otherwise, and little noise
    assert "force_balance" in d.causes[0].explains
    assert d.significance.p_value < 1e-3
    assert d.gain.in_sample
    assert d.gain.log_score > 0.0
    force = next(c for c in d.gain.channels if c.channel == "force_balance")
    assert force.rmse_after < 0.5 * force.rmse_before
    speed = next(c for c in d.gain.channels if c.channel == "speed")
    assert speed.free_after < 0.5 * speed.free_before
    assert d.model.terms[0].values["delta_mass"] == pytest.approx(e.value)


def test_a_set_with_a_value_at_its_bound_counts_as_its_other_effects(monkeypatch):
    def at_bound(*args):
        r = own(*args)
        return r and replace(r, bounded=tuple(h.effect.name == "tyre_radius" for h, _ in r.names))

    own = search.refit
    monkeypatch.setattr(search, "refit", at_bound)
    d = told(term("payload_mass", delta_mass=300.0), term("tyre_radius", "fl", delta=-0.015))
    assert (d.verdict, keys(d)) == ("named", {"payload_mass"})
    assert any(n.startswith("Not named: tyre radius (front left wheel) would stand") for n in d.notes)
    assert "tyre_radius" not in {c.effect for c in told(term("tyre_radius", "fl", delta=-0.015)).causes}


def test_compound():
    d = told(term("payload_mass", delta_mass=300.0), term("tyre_radius", "fl", delta=-0.015))
    assert d.verdict == "compound"
    assert keys(d) == {"payload_mass", "tyre_radius@fl"}
    assert d.causes[[c.key for c in d.causes].index("tyre_radius@fl")].parameters["delta"].value == pytest.approx(
        -0.015, abs=0.001
    )


def test_cannot_tell(monkeypatch):
    # at one speed, wind and drag area are one force
    ask(monkeypatch, ("aero_drag", "head_wind", "tyre_radius@fl"))
    d = told(log=noisy(term("head_wind", speed=3.0), speed=((0.0, 25.0),)))
    assert d.verdict == "cannot_tell"
    assert keys(d) == {"aero_drag", "head_wind"}
    assert d.alternatives[0].evidence_ratio < 20.0
    twins = next(c for c in d.confusions if c.effect == "aero_drag" and c.rivals == ("head_wind",))
    assert twins.p_correct < 0.7


def test_a_slope_and_an_offset_without_torque(monkeypatch):
    # without torque a slope and an offset of the accelerometer look the same; -9 % and +1.2 m/s^2 together would explain
    # a few millimetres of slip
    ask(monkeypatch, ("accelerometer_bias@a_x", "road_grade", "tyre_radius@fl"))
    log = noisy(term("accelerometer_bias", "a_x", bias=0.4), drop=[f"torque_{w}" for w in ("fl", "fr", "rl", "rr")])
    d = told(log=log)
    assert d.verdict == "cannot_tell"
    assert [c.key for c in d.causes] == ["accelerometer_bias@a_x", "road_grade"]
    assert d.causes[0].parameters["bias"].value == pytest.approx(0.4, abs=0.02)
    assert d.alternatives[0].evidence_ratio < 20.0
    twins = next(c for c in d.confusions if c.effect == "road_grade" and c.rivals == ("accelerometer_bias@a_x",))
    assert twins.p_correct < 0.7


def function_of_speed():
    x = np.linspace(15.0, 30.0, 10)
    f = 100.0 * np.sin(x)
    return Remainder(
        "force_balance", ("v_x",), 0.9, 0.01, x[:, None], f, f - 50.0, f + 50.0, (), None, 0.0, "It goes with the speed.",
        "force", "N", 0.99,
    )  # fmt: skip


def test_an_unknown_form_is_the_verdict_and_in_the_model(monkeypatch):
    monkeypatch.setattr(search, "unknown_forms", lambda *_, **__: (function_of_speed(),))
    d = told()
    assert d.verdict == "unexplained"
    assert d.causes == ()
    assert "(a force on the car that goes with speed)" in d.sentence
    assert d.remainders[0].channel == "force_balance"
    assert [t.effect.name for t in d.model.terms] == ["unexplained_force"]


def test_effects_that_are_certain_stand_beside_an_unknown_form(monkeypatch):
    monkeypatch.setattr(search, "unknown_forms", lambda *_, **__: (function_of_speed(),))
    d = told(term("payload_mass", delta_mass=250.0))
    assert d.verdict == "unexplained"
    assert keys(d) == {"payload_mass"}
    assert {t.effect.name for t in d.model.terms} == {"payload_mass", "unexplained_force"}


def test_too_little_driving_is_not_testable(monkeypatch):
    monkeypatch.setattr(run, "not_calibrated", lambda *_: "Mass is a guess.")
    d = told(log=noisy(speed=((0.0, 15.0), (12.0, 15.0), (22.0, 1.0)), duration_s=40.0))
    assert d.verdict == "not_testable"
    assert d.sentence.endswith("s of usable driving, 20 s are needed.")
    nameless = changed(plain(), plain().frame.drop(["v_x", *(f"omega_{w}" for w in ("fl", "fr", "rl", "rr"))]))
    assert "the log has no v_x or wheel speeds" in diagnose([("a", nameless)], CAR).sentence
    assert d.caution == "Mass is a guess."


def test_a_frozen_or_wrong_accelerometer_is_not_testable():
    frozen, wrong = (changed(plain(), plain().frame.with_columns(a_x=x)) for x in (pl.lit(0.1), -pl.col("a_x")))
    d = told(log=frozen)
    assert (d.verdict, d.used_s) == ("not_testable", 0.0)
    d = told(log=wrong)
    assert d.verdict == "not_testable"
    assert "is not the acceleration of the car" in d.sentence


def test_a_drive_of_seconds_is_an_error_alone_and_a_note_among_others():
    short = changed(plain(), plain().frame.head(500))
    with pytest.raises(SignalError, match="5 s of drive"):
        told(log=short)
    d = diagnose([("a", noisy()), ("b", short)], CAR, options=QUICK)
    assert d.drives == ("a",)
    assert any("5 s of drive" in n for n in d.notes)


def test_a_drive_that_is_given_twice_counts_once():
    log = noisy()
    again = changed(log, log.frame.with_columns(pl.col("v_x", "a_x").round(3)).head(log.frame.height - 3))
    d = diagnose([("a.mf4", log), ("a.csv", again), ("b.mf4", noisy(seed=4))], CAR, options=QUICK)
    assert d.drives == ("a.mf4", "b.mf4")
    assert any("a.csv: the same drive as a.mf4" in n for n in d.notes)


def test_what_the_model_knows_is_not_found_again():
    mass = term("payload_mass", delta_mass=250.0)
    d = told(mass, model=Model((mass,)))
    assert d.verdict == "no_effect"
    assert d.model.terms == (mass,)


def same(a, b):
    return (a.verdict, a.sentence, a.causes, a.significance, a.limits, a.confusions) == (
        b.verdict, b.sentence, b.causes, b.significance, b.limits, b.confusions,
    )  # fmt: skip


@pytest.mark.nightly
def test_two_runs_are_equal_and_another_seed_says_the_same():
    hidden = term("payload_mass", delta_mass=250.0)
    a, b = told(hidden), told(hidden)
    assert same(a, b)
    quiet, other = (told(options=replace(QUICK, seed=s)) for s in (1, 2))
    assert other.verdict == quiet.verdict == "no_effect"


def test_progress_is_told_and_rises():
    _, seen = watched()
    shares = [s for _, s in seen]
    assert len({t for t, _ in seen}) >= 3
    assert np.all(np.diff(shares) > -1e-9)
    assert 0.0 <= shares[0] <= shares[-1] <= 1.0
    assert any("nothing beyond noise" in t for t, _ in seen)


def test_a_first_answer_is_shown_while_the_rest_is_done():
    _, seen = watched(250.0)
    for words, share in (("at first sight", 0.5), ("so far", 0.7)):
        first = next(i for i, (t, _) in enumerate(seen) if words in t)
        assert re.search(rf"{words} payload mass \((0\.\d\d|1\.00)\)", seen[first][0])
        assert seen[first][1] < share


def test_views_hold_the_residual_before_and_after():
    d, _ = watched(250.0)
    view = next(v for v in d.views if v.channel == "force_balance")
    assert np.nanstd(view.after) < 0.8 * np.nanstd(view.before)
    assert {"t", "v_x", "torque"} <= set(view.coordinates)


def test_gain_is_on_unseen_drives_where_there_are_any():
    hidden = term("payload_mass", delta_mass=250.0)
    d = diagnose([("a", noisy(hidden))], CAR, holdout=[("b", noisy(hidden, seed=4))], options=QUICK)
    assert d.gain.heldout == ("b",)
    assert not d.gain.in_sample
    assert d.gain.log_score > 0.0
    force = next(c for c in d.gain.channels if c.channel == "force_balance")
    assert force.rmse_after < 0.5 * force.rmse_before
    assert {t.effect.name for t in d.deviations}.isdisjoint({t.effect.name for t in d.model.terms} | {"head_wind"})


def test_the_gain_is_over_the_better_of_both_models_without_the_effect(monkeypatch):
    """The likeliest values of one drive may be absurd in another."""
    ask(monkeypatch, ("payload_mass", "torque_gain"))
    hidden, gains = term("payload_mass", delta_mass=250.0), []
    for alone in (Model(()), Model((term("torque_gain", gain=0.3),))):
        monkeypatch.setattr(run, "_at_likeliest", lambda f, e, bare, more, m=alone: (m, more, list(e.residuals)))
        d = diagnose([("a", noisy(hidden))], CAR, holdout=[("b", noisy(hidden, seed=4))], options=QUICK)
        gains.append(d.gain.log_score)
    assert gains[1] == pytest.approx(gains[0])


@pytest.mark.parametrize(
    ("hidden", "elsewhere", "verdict"),
    [
        (term("torque_gain", gain=0.85), (), "cannot_tell"),
        (term("torque_gain", gain=0.85), (term("torque_gain", gain=0.918),), "cannot_tell"),
        (term("head_wind", speed=12.0), (), "named"),
    ],
    ids=["car", "car, smaller", "drive"],
)
def test_what_a_car_has_must_predict_held_out_drives(hidden, elsewhere, verdict, monkeypatch):
    """A wind may blow on one drive alone."""
    ask(monkeypatch, ("torque_gain", "head_wind"))
    d = diagnose([("a", noisy(hidden))], CAR, holdout=[("b", noisy(*elsewhere, seed=4))], options=QUICK)
    assert (d.gain.log_score > 0.0) == bool(elsewhere)
    assert d.gain.log_score < 0.1 * d.gain.promised
    assert d.verdict == verdict
    assert any("held-out drives are not predicted better" in n for n in d.notes) == (verdict == "cannot_tell")


def test_no_name_where_the_drive_itself_is_predicted_worse(monkeypatch):
    worse = Model((term("torque_gain", gain=0.3),))
    monkeypatch.setattr(run, "_at_likeliest", lambda f, e, bare, more: (bare, worse, list(e.residuals)))
    d = told(term("payload_mass", delta_mass=250.0))
    assert (d.verdict, d.gain.in_sample) == ("cannot_tell", True)
    assert d.causes[0].probability == 0.9
    assert any("the diagnosed drives are not predicted better" in n for n in d.notes)


def test_a_force_with_a_name_is_no_slope_of_the_road(monkeypatch):
    ask(monkeypatch, [f"brake_drag@{at}" for at in ("fl", "fr", "f")])
    hilly = Spec(
        "hilly", "gusts", (Hidden("brake_drag", "f", {"torque": 60.0}),), 8, "compact_fwd", duration_s=150.0, holdout=0
    )
    d = diagnose(make_case(hilly).drives, CARS["compact_fwd"], options=QUICK)
    assert keys(d) == {"brake_drag@f", "road_grade"}
    mean, (_, road) = d.causes[1].parameters["grade_mean"], clean_rows(hilly, world_of(hilly))
    assert mean.low < road.grid[:, 1].mean() < mean.high


def test_a_road_that_falls_on_the_whole_has_its_mean(monkeypatch):
    """Its constant slope is a cause as well, and part of the same road."""
    ask(monkeypatch, ("road_grade",))
    hilly = Spec(
        "hilly", "gusts", (Hidden("road_grade", None, {"grade": -0.03}),), 8, "compact_fwd", duration_s=150.0, holdout=0
    )
    d = diagnose(make_case(hilly).drives, CARS["compact_fwd"], options=QUICK)
    _, road = clean_rows(hilly, world_of(hilly))
    e = d.causes[0].parameters["grade_mean"]
    assert keys(d) == {"road_grade"}
    assert road.grid[:, 1].mean() < -0.02
    assert d.sentence.endswith(f" On the whole it falls by {-e.value:.1%}.")
    assert e.low < road.grid[:, 1].mean() < e.high
    assert {t.effect.name for t in d.model.terms} == {"unexplained_grade", "road_grade"}  # hills and mean


def test_the_torque_is_judged_without_an_accelerometer(monkeypatch):
    ask(monkeypatch, ("payload_mass", "aero_drag", "tyre_radius@fl"))
    assert told(log=noisy(drop=["a_x"])).verdict == "no_effect"
    d = told(log=noisy(term("payload_mass", delta_mass=250.0), drop=["a_x"]))
    assert (d.verdict, keys(d)) == ("named", {"payload_mass"})
    assert d.causes[0].parameters["delta_mass"].value == pytest.approx(250.0, abs=40.0)


def test_drives_need_names_of_their_own():
    with pytest.raises(ConfigError, match="two drives have the same name"):
        diagnose([("a", noisy()), ("a", noisy())], CAR)


def test_the_road_of_one_of_two_drives(monkeypatch):
    ask(monkeypatch, ("payload_mass", "road_grade"))
    flat = Spec("mixed", "gusts", (), 8, "compact_fwd", duration_s=150.0, holdout=0)
    (_, a), (_, b) = (make_case(s).drives[0] for s in (flat, replace(flat, programme="hilly")))
    d = diagnose([("a", a), ("b", b)], CARS["compact_fwd"], options=QUICK)
    assert [(c.key, c.drives) for c in d.causes] == [("road_grade", ("b",))]
    assert d.sentence.endswith("In b.")
    assert not d.model.terms  # another drive is elsewhere
    assert any(n.startswith("The extended model has what all drives share") for n in d.notes)


def test_half_of_the_slip_slope_is_named_though_a_straight_line_leaves_nothing_of_it(monkeypatch):
    ask(monkeypatch, [f"{e}@{at}" for e in ("slip_stiffness", "slip_stiffness_drift") for at in ("rl", "rr", "r")])
    for known, hidden in ((1.0, 0.4), (1.5, 0.8)):  # a known slope moves the line's start
        d = told(term("slip_stiffness", "r", gain=hidden), model=Model((term("slip_stiffness", "r", gain=known),)))
        found = {c.key: c.parameters["gain"].value for c in d.causes}
        assert found == {"slip_stiffness@r": pytest.approx(hidden, abs=0.05)}


def test_half_of_the_slip_slope_is_more_than_a_file_of_8_percent_leaves_open(monkeypatch):
    """Six deviations of the file; slopes at the found value would bring the file to half of that."""
    ask(monkeypatch, [f"slip_stiffness@{at}" for at in ("rl", "rr", "r")])
    source = {**CAR.provenance, "tyre.slip_slope_r": Provenance("calibrated", 0.08 * CAR.slip_slope_r)}
    for gain, verdict in ((0.55, "named"), (0.64, "cannot_tell")):
        log = noisy(term("slip_stiffness", "r", gain=gain))
        d = diagnose([("a", log)], replace(CAR, provenance=source), options=QUICK)
        assert (d.verdict, keys(d)) == (verdict, {"slip_stiffness@r"})


def test_a_brake_and_soft_tyres_are_two_effects(monkeypatch):
    """The slip of a wheel that is braked is its force over the slip stiffness that is found, not the file's."""
    names = ("brake_drag", "slip_stiffness", "tyre_radius")
    ask(monkeypatch, [f"{e}@{at}" for e in names for at in (*WHEELS, *AXLES)])
    d = told(term("brake_drag", "fr", torque=250.0), term("slip_stiffness", "f", gain=0.5))
    assert keys(d) == {"brake_drag@fr", "slip_stiffness@f"}
    assert d.causes[0].parameters["torque"].value == pytest.approx(250.0, abs=5.0)


def test_a_late_velocity_is_named_without_one_of_the_wheels(monkeypatch):
    ask(monkeypatch, ("signal_delay@v_x", "signal_delay@a_x", "signal_delay@torque", "clock_skew"))
    d = told(log=noisy(term("signal_delay", "v_x", delay=0.1), drop=["omega_rr"]))
    assert keys(d) == {"signal_delay@v_x"}
    assert d.causes[0].parameters["delay"].value == pytest.approx(0.1, abs=0.01)
    assert any("not all four wheel speeds" in n for n in d.notes)


def test_a_radius_is_named_without_a_reference_velocity():
    d = told(log=noisy(term("tyre_radius", "fl", delta=0.012), drop=["v_x"]))
    assert keys(d) == {"tyre_radius@fl"}
    assert d.causes[0].parameters["delta"].value == pytest.approx(0.012, abs=0.002)


def test_a_late_yaw_rate_shows_in_the_lateral_motion(monkeypatch):
    ask(monkeypatch, tuple(f"signal_delay@{w}" for w in ("v_x", "a_x", "a_y", "yaw_rate")))
    d = told(log=noisy(term("signal_delay", "yaw_rate", delay=0.08), steering=Steering(0.01, 6.0)))
    assert keys(d) == {"signal_delay@yaw_rate"}
    assert d.causes[0].parameters["delay"].value == pytest.approx(0.08, abs=0.01)
    assert "steering" in d.untested["signal_delay@steer_angle"]


@pytest.mark.nightly
def test_the_sample_drives_are_named_with_a_file_that_says_nothing_of_its_sources(monkeypatch):
    import aqualog as aq

    monkeypatch.undo()
    samples = Path(__file__).parents[2] / "sample_logs"
    # both: a load changes the target speed of the simulation, which once looked like a late speed in one of them
    logs = [samples / f"loaded_{day}.parquet" for day in ("monday", "friday")]
    found = aq.diagnose(logs, samples / "vehicle.toml", views=False)
    told = json.loads(found.to_json())
    (cause,) = told["causes"]
    low, high = cause["parameters"]["delta_mass"]["ci95"]
    assert (told["verdict"], cause["effect"], cause["where"]) == ("named", "payload_mass", None)
    assert low < 290.0 < high
