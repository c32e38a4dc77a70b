"""What stands in for torque and steering, and brakes that nobody logged."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from aqualog.core.notation import WHEELS
from aqualog.diagnose.drive import calm, prepare
from aqualog.diagnose.inputs import brakes_in_torque, brakes_unlogged, needed_torque, roll_out
from aqualog.model.follow import follow
from aqualog.model.scenario import Steering
from aqualog.model.term import Model
from tests.diagnose.test_drive import CAR, changed, plain, signals

TORQUES = [f"torque_{w}" for w in WHEELS]
DT = 0.01


def test_rolling_out_is_rolling_resistance_and_drag():
    v = np.array([0.0, 40.0])
    rest = roll_out(v, CAR)
    assert rest[0] == pytest.approx(9.81 * CAR.rolling_resistance, rel=1e-3)
    assert rest[1] - rest[0] == pytest.approx(0.5 * CAR.air_density * CAR.drag_area * 1600.0 / CAR.mass, rel=1e-6)


def test_torque_that_is_needed_meets_resistance_and_acceleration():
    v = 20.0 + 1.5 * np.arange(0.0, 10.0, DT)
    force = sum(x / CAR.arm(w) for x, w in zip(needed_torque(v, CAR, DT), WHEELS, strict=True))
    np.testing.assert_allclose(force[200:-200], CAR.mass * (1.5 + roll_out(v, CAR))[200:-200], rtol=1e-3)
    assert not needed_torque(v[::-1], CAR, DT)[:, 200:-200].any()


@pytest.mark.parametrize("pressure", [None, 0.0], ids=["not logged", "a motor brakes"])
@pytest.mark.parametrize("has_a_x", [True, False])
def test_what_slows_the_car_is_left_out_of_a_log_without_torque(pressure, has_a_x):
    log = signals(
        speed=((0.0, 30.0), (40.0, 30.0), (44.0, 18.0), (90.0, 18.0)), drop=TORQUES if has_a_x else [*TORQUES, "a_x"]
    )  # fmt: skip
    d = prepare(changed(log, log.frame.with_columns(brake_pressure=pl.lit(pressure, pl.Float64))), CAR, "a")
    shown = calm(d)
    assert not shown.mask[405:435].any()
    assert shown.mask[50:380].all()
    assert shown.mask[480:880].all()
    # where brakes are logged, an accelerometer shows a road while a motor brakes, too
    assert d.mask[405:435].all() == (has_a_x and pressure is not None)
    assert any("only driving and rolling out are used" in n for n in d.notes)


def test_without_torque_the_torque_that_the_model_needs_stands_in():
    log = changed(plain(), plain().frame.drop(TORQUES))
    d = prepare(log, CAR, "a")
    assert d.untorqued
    assert "force_balance" not in d.channels
    assert d.used_s > 85.0
    np.testing.assert_array_equal(d.course.torque, needed_torque(log.array("v_x"), CAR, log.dt))


def test_climbing_at_speed_is_no_brake():
    """3 % at 40 m/s: the car slows down by 1.1 m/s^2 without torque, of which 0.8 is its drag and rolling."""
    car = replace(CAR, drag_area=0.75)
    still = np.zeros((4, 2500))
    off: np.ndarray = np.zeros(2500, dtype=bool)
    climbing, braking = (np.resize(40.0 - a * np.arange(500) * DT, 2500) for a in (1.1, 2.0))
    assert not brakes_unlogged(still, climbing, off, car, DT)
    assert brakes_unlogged(still, braking, off, car, DT)


def test_a_car_that_speeds_up_less_than_its_torque_says_is_not_braked():
    """A trailer does that, a load, another gain or a late speed: the torque of braking may be in the log all the same."""
    v, off = 10.0 + 2.0 * np.resize(np.arange(500) * DT, 2500), np.zeros(2500, dtype=bool)
    driven = np.full((4, 2500), 0.25 * 4.0 * CAR.mass * CAR.arm("fl"))
    assert not brakes_unlogged(driven, v, off, CAR, DT)


@pytest.mark.parametrize(
    ("gain", "drag", "motor", "held"),
    [(1.0, 330.0, 0.0, False), (1.0, 330.0, 1.0, True), (0.8, 330.0, 1.0, True), (1.0, 0.0, 0.75, False)],
)
def test_the_pressure_says_whether_the_torque_holds_the_brakes(gain, drag, motor, held):
    """An engine drags with 330 N·m, a motor slows the car up to a limit while friction does the rest; a gain may be a
    fifth off."""
    a = np.repeat([1.0, -0.3, -1.0, 1.5, -0.3, -3.0], 500)
    v = 15.0 + np.cumsum(a) * DT
    whole = CAR.mass * (a + roll_out(v, CAR)) * CAR.arm("fl")
    pressed = np.where(a < -0.5, -a, 0.0) * 3e5
    torque = np.where(pressed, np.minimum(np.maximum(whole, motor * whole.min()), -drag), whole)
    assert brakes_in_torque(pressed, np.tile(gain * torque / 4.0, (4, 1)), v, CAR, DT) == held


@pytest.mark.parametrize("v", [15.0, 35.0])
def test_the_car_turns_as_the_gyro_says(v):
    made = signals(speed=((0.0, v),), steering=Steering(0.6 * 3.0 * 2.7 / v**2, 6.0, 2.0))
    d = prepare(changed(made, made.frame.drop("steer_angle")), CAR, "a")
    yaw = follow(CAR, d.course, Model())["yaw_rate"][1000:-1000]
    own = d.columns["yaw_rate"][1000:-1000]
    assert np.ptp(own) > 0.05
    assert np.polyfit(own, yaw, 1)[0] == pytest.approx(1.0, abs=0.06)
