"""Torques that do not explain the acceleration, and axles that are not the driven ones."""

from dataclasses import replace

import numpy as np
import pytest

from aqualog.checks.look import look
from tests.checks.made import CAR, made, signals
from tests.checks.test_signs import lines_for

DRIVE = made(seconds=900.0, accelerating=0.8)
TORQUES = ("torque_rl", "torque_rr")


def said(car=CAR, drop=(), **factors):
    columns = {n: x * factors.get(n, 1.0) for n, x in DRIVE.items()}
    return [r for r in look(signals(columns, drop=drop), car) if r.kind in ("torque", "drivetrain")]


@pytest.mark.parametrize("gain", [0.93, 1.0, 1.06])
def test_a_gain_within_a_tenth_is_no_fault(gain):
    assert said(**dict.fromkeys(TORQUES, 1.0 / gain)) == []


@pytest.mark.parametrize("gain", [0.5, 0.8, 1.25])
def test_a_gain_that_is_off(gain):
    (remark,) = said(**dict.fromkeys(TORQUES, 1.0 / gain))
    low, high = remark.ci95
    assert low < remark.value < high
    assert remark.value == pytest.approx(gain, rel=0.06)
    assert f"torque_gain = {remark.value:.3g}" in remark.advice
    assert f"mass = {CAR.mass / remark.value:.0f}" in remark.advice


def test_water_that_the_driver_pushes_against_is_no_gain():
    """Torque for 1.5 m/s² that moves nothing, 20 s of each minute."""
    t = 0.05 * np.arange(DRIVE["v_x"].size)
    against = np.where(t % 60.0 < 20.0, 1.5 * CAR.mass * CAR.arm("rl") / 2.0, 0.0)
    wet = {**DRIVE, **{n: DRIVE[n] + against for n in TORQUES}}
    assert [r for r in look(signals(wet), CAR) if r.kind == "torque"] == []


def test_torque_on_wheels_that_spin_is_no_gain():
    """Torque for 3 m/s² on rear wheels that turn by a third faster than the car, 20 s of each minute."""
    t = 0.05 * np.arange(DRIVE["v_x"].size)
    spins = t % 60.0 < 20.0
    more = {
        n: DRIVE[n] + np.where(spins, 3.0 * CAR.mass * CAR.arm("rl") / 2.0, 0.0) * np.sin(2.0 * t) ** 2 for n in TORQUES
    }
    more |= {f"omega_r{s}": DRIVE[f"omega_r{s}"] * np.where(spins, 1.33, 1.0) for s in "lr"}
    assert [r for r in look(signals({**DRIVE, **more}), CAR) if r.kind == "torque"] == []


def test_a_gain_that_may_be_none_is_no_value_for_the_file(monkeypatch):
    monkeypatch.setattr("aqualog.checks.drive._slope", lambda *_: (0.25, 0.39))
    (remark,) = (r for r in said() if r.kind == "torque")
    assert remark.advice == "check which wheels the torques of the signal map belong to, and their time"


def test_a_gain_of_the_file_is_multiplied():
    (remark,) = said(replace(CAR, torque_gain=0.5), **dict.fromkeys(TORQUES, 1.25))
    assert f"torque_gain = {0.5 * remark.value:.3g}" in remark.advice


def test_without_a_mass_no_gain_is_judged():
    assert said(replace(CAR, given=frozenset({"drivetrain"})), **dict.fromkeys(TORQUES, 2.0)) == []


def test_turned_torques():
    (remark,) = [r for r in said(torque_rl=-1.0, torque_rr=-1.0) if r.kind == "torque"] or [None]
    assert remark is None or "sign" in remark.advice


KNOWN = replace(CAR, given=CAR.given | {"drivetrain"})
SIDES = tuple((f"omega_f{side}", f"omega_r{side}") for side in "lr")


def exchange(*pairs):
    return {**DRIVE, **{a: DRIVE[b] for pair in pairs for a, b in (pair, pair[::-1])}}


def exchanged(columns, car=KNOWN, drop=()):
    return [r for r in look(signals(columns, drop=drop), car) if r.kind in ("exchange", "drivetrain")]


def test_the_axle_that_slips_is_the_driven_one():
    assert said(KNOWN, drop=TORQUES) == []
    (remark,) = said(replace(KNOWN, drivetrain="fwd"), drop=TORQUES)
    assert "the rear wheels slip when the car accelerates" in remark.what
    assert 'drivetrain = "rwd"' in remark.advice
    assert set(remark.lines) == lines_for(*SIDES)
    assert said(replace(KNOWN, drivetrain="awd"), drop=TORQUES) == []


def test_a_driven_axle_that_no_vehicle_file_says_is_proposed_not_assumed():
    bare = replace(CAR, given=frozenset({"mass"}))
    rear = "torque_r moves, torque_f is not in the log"
    (remark,) = said(bare)
    assert (remark.kind, remark.signals) == ("drivetrain", ("drivetrain",))
    assert remark.what == f"no vehicle file says which axle is driven, but {rear}"
    assert remark.advice == 'in the vehicle file drivetrain = "rwd" or "awd"?'
    still = np.zeros(DRIVE["a_x"].size)
    columns = {**DRIVE, "torque_fl": still, "torque_fr": still}
    (remark,) = (r for r in look(signals(columns), bare) if r.kind == "drivetrain")
    assert remark.sentence.endswith('torque_r moves, torque_f does not: in the vehicle file drivetrain = "rwd"?')
    columns = {**DRIVE, "torque_fl": DRIVE["torque_rl"], "torque_fr": DRIVE["torque_rr"]}
    (remark,) = (r for r in look(signals(columns), bare) if r.kind == "drivetrain")
    assert remark.advice.endswith('drivetrain = "awd"?')
    assert said(bare, drop=TORQUES) == []  # wheels that slip say less than a torque


def test_a_drive_of_24_s_shows_the_driven_axle():
    short = {n: x[:480] for n, x in DRIVE.items()} | {n: np.zeros(480) for n in ("torque_fl", "torque_fr")}
    (remark,) = (r for r in look(signals(short), replace(KNOWN, drivetrain="fwd")) if r.kind == "drivetrain")
    assert remark.what == "the vehicle file says fwd, but the front wheels are never driven"


def test_without_a_drivetrain_in_the_file_nothing_is_said_of_it():
    bare = replace(CAR, drivetrain="fwd", given=frozenset({"mass"}))
    assert exchanged(DRIVE, bare, TORQUES) == []


def test_front_and_rear_exchanged_where_torques_and_file_agree():
    (remark,) = exchanged(exchange(*SIDES))
    assert "the wheels of front and rear look exchanged" in remark.what
    assert set(remark.lines) == lines_for(*SIDES)


@pytest.mark.parametrize("pair", SIDES)
@pytest.mark.parametrize("drop", [(), TORQUES])
def test_front_and_rear_of_one_side_exchanged(pair, drop):
    (remark,) = exchanged(exchange(pair), drop=drop)
    assert remark.signals == pair
    assert remark.what.startswith(f"{pair[0]} and {pair[1]} look exchanged")
    assert set(remark.lines) == lines_for(pair)


@pytest.mark.parametrize("pair", SIDES)
def test_with_all_wheels_driven_either_side_may_be_exchanged(pair):
    (remark,) = exchanged(exchange(pair), replace(KNOWN, drivetrain="awd"), TORQUES)
    assert set(remark.lines) == lines_for(SIDES[0]) | lines_for(SIDES[1])


@pytest.mark.parametrize("pair", [("omega_fl", "omega_rr"), ("omega_fr", "omega_rl")])
def test_a_front_wheel_and_a_rear_one_of_the_other_side(pair):
    (remark,) = exchanged(exchange(pair))
    assert remark.signals == pair
    assert set(remark.lines) == lines_for(pair)


def test_of_two_exchanges_the_first_comes_first():
    both = {f"omega_{a}": f"omega_{b}" for a, b in (("fl", "rr"), ("fr", "rl"), ("rl", "fr"), ("rr", "fl"))}
    (remark,) = exchanged({**DRIVE, **{a: DRIVE[b] for a, b in both.items()}})
    assert set(remark.lines) == lines_for(("omega_fl", "omega_fr"), ("omega_rl", "omega_rr"))


def test_beyond_the_limits_of_the_vehicle_file_the_map_is_in_doubt():
    """No torque_gain of 0.01 and no mass of 165 t: a file with them would be refused."""
    (remark,) = [r for r in said(**dict.fromkeys(TORQUES, 100.0)) if r.kind == "torque"]
    assert remark.advice.startswith("check unit and scale of torque_r in the map: it is ")
    assert remark.advice.endswith(" times too large")
    assert "torque_gain =" not in remark.sentence
    assert "mass =" not in remark.sentence


@pytest.mark.parametrize(
    ("bar", "car", "is_named"),
    [(3.9, CAR, True), (2.6, CAR, False), (6.0, CAR, False), (3.9, replace(CAR, mass=3400.0), False),
     (3.9, replace(CAR, given=frozenset()), False)],
)  # fmt: skip
def test_tyre_pressures_that_look_absolute(bar, car, is_named):
    columns = made(seconds=30.0)
    pressures = {f"pressure_{w}": np.full(columns["v_x"].size, 1e5 * bar) for w in ("fl", "fr", "rl", "rr")}
    remarks = [r for r in look(signals({**columns, **pressures}), car) if "absolute" in r.what]
    assert len(remarks) == is_named
    assert not is_named or all("offset = -1013" in line for line in remarks[0].lines)


@pytest.mark.parametrize(("offset", "is_named"), [(0.0, False), (2.5e5, False), (3.5e5, True), (50e5, True)])
def test_a_brake_that_acts_on_a_car_that_does_not_slow_down(offset, is_named):
    columns = made(seconds=30.0)
    braking = np.gradient(columns["v_x"], 0.05) < -0.5
    remarks = look(signals({**columns, "brake_pressure": offset + 30e5 * braking}), CAR)
    assert [r.signals for r in remarks if "bar" in r.what] == [("brake_pressure",)] * is_named


@pytest.mark.parametrize(("scale", "decel", "is_named"), [(1.0, 4.0, False), (1e-5, 4.0, True), (1e-5, 1.5, False)])
def test_a_brake_pressure_in_bar(scale, decel, is_named):
    columns = made(seconds=30.0)
    t = 0.05 * np.arange(columns["v_x"].size)
    v = np.where(t < 20.0, 30.0, np.maximum(30.0 - decel * (t - 20.0), 8.0))
    columns = {**columns, "v_x": v, **{f"omega_{w}": v / CAR.r_e(w) for w in ("fl", "fr", "rl", "rr")}}
    remarks = look(signals({**columns, "brake_pressure": scale * 30e5 * ((t > 20.0) & (v > 8.0))}), CAR)
    assert any("is it in bar?" in r.advice for r in remarks) == is_named
