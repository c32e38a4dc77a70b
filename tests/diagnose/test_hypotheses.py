"""What a log is asked about, and what a unit of each would do: differences of simulations."""

from dataclasses import replace

import numpy as np
import pytest

from aqualog.core.notation import WHEELS
from aqualog.diagnose.channels import contrasts
from aqualog.diagnose.drive import prepare
from aqualog.diagnose.hypotheses import OF_TURNING, Hypothesis, hypotheses, residual, signatures, value_in, with_values
from aqualog.diagnose.noise import weighing
from aqualog.diagnose.tolerances import TOLERANCES
from aqualog.model.effects import EFFECTS
from aqualog.model.follow import STEP_S, setup_along
from aqualog.model.term import Model
from tests.diagnose.test_drive import CAR, NOISY, changed, plain, signals, term


def one(name, where=None, **fixed):
    return Hypothesis(EFFECTS[name], where, (EFFECTS[name].parameters[0].name,), fixed)


@pytest.fixture(scope="module")
def drive():
    return prepare(plain(), CAR, "a")


@pytest.fixture(scope="module")
def base(drive):
    return residual(drive, Model())


def test_every_effect_is_asked_about_or_its_absence_has_a_reason(drive):
    asked, untested = hypotheses([drive], Model())
    named = {h.effect.name for h in asked if not h.allowed}
    faster = {e.name for e in EFFECTS.values() if e.drive.at_full_rate}  # not of the search
    assert faster == {"tone_ring"}
    sought = {e.name for e in EFFECTS.values() if e.drive.begins_like}  # where they begin: test_moments
    assert sought == {"pressure_loss"}
    assert named | {u.partition("@")[0] for u in untested} | faster | sought == set(EFFECTS)
    assert not faster & (named | set(untested))
    assert not named & set(untested)
    assert "no water depth in the log" in untested["contact_loss"]
    assert {h.effect.name for h in asked if h.allowed} == {t.name for t in TOLERANCES}


def test_a_wheel_that_is_not_driven_has_no_motor(drive):
    high = {h.key: h.parameter(h.free[0]).high for h in hypotheses([drive], Model())[0]}
    free, driven = ("f", "r") if drive.vehicle.drivetrain == "rwd" else ("r", "f")
    own = [high[f"wheel_inertia@{free}{side}"] for side in ("", "l", "r") if f"wheel_inertia@{free}{side}" in high]
    assert {*own, high["wheel_inertia"]} == {EFFECTS["wheel_inertia"].drive.most_free}
    assert high[f"wheel_inertia@{driven}"] == EFFECTS["wheel_inertia"].parameters[0].high


def test_what_has_no_signal_is_not_asked_about():
    d = prepare(changed(plain(), plain().frame.drop([f"torque_{w}" for w in WHEELS])), CAR, "a")
    asked, untested = hypotheses([d], Model())
    keys = {h.key for h in asked}
    assert "signal_delay@torque" not in keys
    # a torque that stands in is made of the file's own mass and drag
    assert not {"payload_mass", "aero_drag", "torque_gain", "head_wind", "relaxation_length"} & keys
    assert untested["payload_mass"] == "no wheel torque in the log"
    assert "stand_in_torque@r" in keys
    rooms = {h.key: h.room for h in asked if h.effect.name == "signal_delay"}
    assert rooms["signal_delay@yaw_rate"] == OF_TURNING  # nor does a log say what helps the car into a curve
    assert rooms["signal_delay@v_x"] is None
    assert {"signal_delay@v_x", "road_grade"} <= keys
    for dropped, lacks in ((["a_x"], False), (["a_x", *(f"torque_{w}" for w in WHEELS)], True)):
        asked, untested = hypotheses([prepare(changed(plain(), plain().frame.drop(dropped)), CAR, "a")], Model())
        of_force = {"payload_mass", "road_grade"}
        assert of_force & {h.effect.name for h in asked} == (set() if lacks else of_force)
        assert of_force & set(untested) == (of_force if lacks else set())


@pytest.mark.parametrize(("drivetrain", "axles"), [("rwd", set()), ("awd", {"torque_gain@f", "torque_gain@r"})])
def test_each_of_two_motors_has_a_gain(drivetrain, axles):
    car = replace(CAR, drivetrain=drivetrain, torque_split_rear=0.6 if drivetrain == "awd" else 1.0)
    asked, _ = hypotheses([prepare(plain(), car, "a")], Model())
    assert {h.key for h in asked if h.effect.name == "torque_gain"} == {"torque_gain", *axles}


def test_slip_and_radius_are_not_asked_about_without_wheel_speeds():
    d = prepare(changed(plain(), plain().frame.drop([f"omega_{w}" for w in WHEELS])), CAR, "a")
    asked, untested = hypotheses([d], Model())
    assert not {"slip_stiffness", "tyre_radius", "pressure_loss"} & {h.effect.name for h in asked}
    assert untested["slip_stiffness_drift"] == "no wheel speeds in the log"
    assert {"payload_mass", "rolling_resistance", "signal_delay"} <= {h.effect.name for h in asked}


def without_rods():
    return prepare(changed(plain(), plain().frame.drop([f"tie_rod_{w}" for w in ("fl", "fr")])), CAR, "a")


@pytest.mark.parametrize("h", [one("slip_stiffness", "fl"), one("aero_drag"), one("signal_delay", "torque")])
def test_longer_steps_change_a_signature_by_a_hundredth_at_most(h, monkeypatch):
    drive = without_rods()
    base = residual(drive, Model())
    rough = signatures(drive, Model(), [h], base=base)[0]
    monkeypatch.setattr("aqualog.diagnose.hypotheses.ROUGH_S", STEP_S)
    fine = signatures(drive, Model(), [h], base=base)[0]
    noisy = base + 0.01 * np.random.default_rng(1).standard_normal(base.shape)
    w = weighing([noisy], drive.mask, contrasts(drive.channels))
    assert not np.array_equal(rough, fine)
    assert np.linalg.norm(w.rows(rough - fine)) < 0.01 * np.linalg.norm(w.rows(fine))


def test_what_acts_within_milliseconds_is_simulated_in_short_steps(monkeypatch):
    drive = without_rods()
    base = residual(drive, Model())
    h = one("relaxation_length")
    usual = signatures(drive, Model(), [h], base=base, each=True)[0]
    monkeypatch.setattr("aqualog.diagnose.hypotheses.ROUGH_S", STEP_S)
    assert np.array_equal(usual, signatures(drive, Model(), [h], base=base, each=True)[0])


@pytest.mark.parametrize(
    ("h", "size"),
    [
        (one("payload_mass"), 50.0), (one("road_grade"), 0.01), (one("tyre_radius", "fl"), 0.003),
        (one("slip_stiffness", "r"), 0.1), (one("accelerometer_bias", "a_x"), 0.1), (one("aero_drag"), 0.05),
    ],
    ids=lambda x: x.key if isinstance(x, Hypothesis) else "",
)  # fmt: skip
def test_a_signature_is_what_the_effect_takes_away(drive, base, h, size):
    (s,) = signatures(drive, Model(), [h], base=base, each=True)
    name = h.free[0]
    with_it = residual(drive, with_values(Model(), [(h, {name: h.parameter(name).neutral + size})]))
    taken = base - with_it
    assert np.linalg.norm(taken - size * s[0]) < 0.1 * np.linalg.norm(taken)


@pytest.mark.parametrize("where", ["f", None])
def test_an_axle_is_the_sum_of_its_wheels(drive, base, where):
    parts = [one("tyre_radius", w) for w in WHEELS]
    asked = [*parts, one("tyre_radius", where)]
    summed = signatures(drive, Model(), asked, base=base)[-1]
    own = signatures(drive, Model(), asked[-1:], base=base, each=True)[0]
    i = [drive.channels.index(f"slip_{w}") for w in WHEELS]
    np.testing.assert_allclose(summed[0, i], own[0, i], atol=0.02 * np.abs(own[0, i]).max())


def test_values_are_put_into_the_model_and_found_there():
    h, other = one("payload_mass", "r"), one("tyre_radius", "fl")
    m = with_values(
        Model((term("payload_mass", "r", delta_mass=100.0),)), [(h, {"delta_mass": 150.0}), (other, {"delta": 0.01})]
    )
    assert (value_in(m, h, "delta_mass"), value_in(m, other, "delta")) == (150.0, 0.01)
    assert value_in(m, one("payload_mass"), "delta_mass") == 0.0
    assert len(m.terms) == 2


def test_the_step_goes_where_there_is_room():
    for effect in EFFECTS.values():
        h = Hypothesis(effect, None, (effect.parameters[0].name,))
        p = h.parameter(h.free[0])
        assert p.low <= p.neutral + p.step <= p.high, effect.name


def test_tolerances_are_neutral_at_zero_and_change_something_else(drive):
    base = setup_along(CAR, drive.course, Model())
    for effect in TOLERANCES:
        zero = effect.apply(base, {"by": 0.0}, None)
        some = effect.apply(base, {"by": effect.parameters[0].sigma}, None)

        def flat(setup):
            return [np.asarray(x, dtype=float) for x in setup.plant if not isinstance(x, str)]

        assert all(np.array_equal(a, b) for a, b in zip(flat(zero), flat(base), strict=True)), effect.name
        moved = any(not np.array_equal(a, b) for a, b in zip(flat(some), flat(base), strict=True))
        assert moved or some.sensors.channels != base.sensors.channels, effect.name


def test_events_are_not_tolerated_and_all_else_is():
    assert one("trailer").tolerance("mass") == 0.0
    assert one("payload_mass").tolerance("delta_mass") == pytest.approx(20.0 / 3.0)
    assert one("slip_stiffness", "fl").tolerance("gain") == 0.05
    assert one("slip_stiffness", "fl").worth_naming("gain") == 0.1
    assert one("payload_mass").worth_naming("delta_mass") == 20.0
    assert one("accelerometer_bias", "a_y").tolerance("bias") > one("accelerometer_bias", "a_x").tolerance("bias")


@pytest.mark.parametrize(
    ("name", "where"), [("brake_drag", None), ("brake_drag", "f"), ("rolling_resistance", None), ("payload_mass", "r")]
)
def test_a_deviation_is_allowed_for_once(name, where):
    h = one(name, where)
    assert h.tolerance(h.free[0]) == 0.0


@pytest.mark.parametrize("edge", ["low", "high"])
def test_a_shift_at_the_edge_of_its_bounds_has_a_signature(drive, edge):
    h = one("signal_delay", "a_x")
    at = getattr(h.parameter("delay"), edge)
    (s,) = signatures(drive, with_values(Model(), [(h, {"delay": at})]), [h], base=residual(drive, Model()))
    assert np.isfinite(s).all()
    assert np.abs(s).max() > 0.0


def test_signals_that_all_come_late_are_the_same_drive():
    """Ten samples a second, without wheel speeds: what draws the led car is late with them."""
    log = signals(sensors=NOISY, rate_hz=10.0, drop=[f"omega_{w}" for w in WHEELS])
    d = prepare(log, CAR, "a")
    late = [one("signal_delay", w) for w in ("v_x", "a_x", "torque")]
    each = [s[0][:, 30:-30] for s in signatures(d, Model(), late, base=residual(d, Model()))]
    kinematic = d.channels.index("kinematic")
    assert sum(each)[kinematic].std() < 0.03 * each[0][kinematic].std()
    assert each[2][kinematic].std() < 0.06 * each[0][kinematic].std()
