"""What stands in for torque and steering, and brakes that nobody logged."""

from dataclasses import replace

import numpy as np
import pytest

from aqualog.core.notation import WHEELS
from aqualog.diagnose.drive import prepare
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


def test_a_brake_is_left_out_of_a_log_without_torque():
    speed = ((0.0, 30.0), (40.0, 30.0), (44.0, 18.0), (90.0, 18.0))
    d = prepare(signals(speed=speed, drop=[*TORQUES, "brake_pressure"]), CAR, "a")
    assert not d.mask[405:435].any()
    assert d.mask[50:380].all()
    assert d.mask[480:880].all()
    assert any("only driving and rolling out are used" in n for n in d.notes)


def test_a_drive_without_brakes_is_used_without_torque_too():
    d = prepare(changed(plain(), plain().frame.drop(TORQUES)), CAR, "a")
    assert d.used_s > 85.0


def test_climbing_at_speed_is_no_brake():
    """3 % at 40 m/s: the car slows down by 1.1 m/s^2 without torque, of which 0.8 is its drag and rolling."""
    car = replace(CAR, drag_area=0.75)
    still = np.zeros((4, 2500))
    off: np.ndarray = np.zeros(2500, dtype=bool)
    climbing, braking = (np.resize(40.0 - a * np.arange(500) * DT, 2500) for a in (1.1, 2.0))
    assert not brakes_unlogged(still, climbing, off, car, DT)
    assert brakes_unlogged(still, braking, off, car, DT)


@pytest.mark.parametrize(("drag", "brakes", "held"), [(330.0, 0.0, False), (330.0, 1.0, True), (0.0, 0.8, True)])
def test_the_deceleration_says_whether_the_torque_holds_the_brakes(drag, brakes, held):
    """An engine drags with 330 N·m, which is a third of a gentle braking; a gain may be a fifth off."""
    v = np.r_[np.full(1000, 30.0), 30.0 - 1.8 * np.arange(1000) * DT]
    pressed = np.r_[np.zeros(1000), np.full(1000, 4e5)]
    whole = CAR.mass * (1.8 - roll_out(v, CAR)) * CAR.arm("fl")
    torque = np.tile(-np.maximum(drag, brakes * whole) / 4.0, (4, 1))
    assert brakes_in_torque(pressed, torque, v, CAR, DT) == held


@pytest.mark.parametrize("v", [15.0, 35.0])
def test_the_car_turns_as_the_gyro_says(v):
    made = signals(speed=((0.0, v),), steering=Steering(0.6 * 3.0 * 2.7 / v**2, 6.0, 2.0))
    d = prepare(changed(made, made.frame.drop("steer_angle")), CAR, "a")
    yaw = follow(CAR, d.course, Model())["yaw_rate"][1000:-1000]
    own = d.columns["yaw_rate"][1000:-1000]
    assert np.ptp(own) > 0.05
    assert np.polyfit(own, yaw, 1)[0] == pytest.approx(1.0, abs=0.06)
