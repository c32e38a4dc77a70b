"""Lateral force of the front axle from accelerometer and yaw rate."""

import numpy as np
import pytest

from aqualog.core.vehicle import Vehicle
from aqualog.model.scenario import Scenario, Steering
from aqualog.model.sensors import IDEAL
from aqualog.model.simulate import assemble, drive_truth
from aqualog.physics.lateral import front_axle_lateral_force, outward, split_by_load, yaw_inertia

CAR = Vehicle(name="car", mass=1700.0, l_f=1.3, l_r=1.5)


def test_steady_cornering_gives_the_static_share():
    F = front_axle_lateral_force(np.array([2.0]), np.zeros(1), mass=1700.0, l_f=1.3, l_r=1.5, inertia=3000.0)
    assert F[0] == pytest.approx(1700.0 * 2.0 * 1.5 / 2.8)


def test_yaw_acceleration_alone_is_a_couple():
    F = front_axle_lateral_force(np.zeros(1), np.ones(1), mass=1700.0, l_f=1.3, l_r=1.5, inertia=2800.0)
    assert F[0] == pytest.approx(1000.0)


def test_a_front_force_leaves_the_rear_axle_alone():
    """With I = m l_f l_r the centre of percussion of the front axle is the rear one."""
    inertia = yaw_inertia(mass=1700.0, l_f=1.3, l_r=1.5)
    F = front_axle_lateral_force(
        np.array([100.0 / 1700.0]), np.array([130.0 / inertia]), mass=1700.0, l_f=1.3, l_r=1.5, inertia=inertia
    )
    assert F[0] == pytest.approx(100.0)


def test_split_adds_up_and_follows_the_load():
    left, right = split_by_load(np.array([900.0, 900.0]), np.array([2000.0, 0.0]), np.array([4000.0, 0.0]))
    np.testing.assert_allclose(left, [300.0, 450.0])
    np.testing.assert_allclose(left + right, 900.0)
    assert outward(left, right)[1][0] == -600.0


def test_against_the_simulated_tyres():
    scenario = Scenario(CAR, duration_s=20.0, speed=((0.0, 25.0),), steering=Steering(0.01, 4.0), sensors=IDEAL)
    truth = drive_truth(assemble(scenario))
    c = truth.columns
    F = front_axle_lateral_force(
        c["a_y"], np.gradient(c["yaw_rate"], truth.t), mass=1700.0, l_f=1.3, l_r=1.5,
        inertia=yaw_inertia(mass=1700.0, l_f=1.3, l_r=1.5),
    )  # fmt: skip
    true = c["true_force_y_fl"] + c["true_force_y_fr"]
    late = truth.t > 3.0
    assert np.std((F - true)[late]) < 0.06 * np.std(true[late])
