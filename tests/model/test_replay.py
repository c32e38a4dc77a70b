"""Torque in, speed out."""

import numpy as np
import pytest

from aqualog.core.errors import ConfigError
from aqualog.core.notation import WHEELS
from aqualog.model.follow import replay
from aqualog.model.plant import build_plant
from aqualog.model.scenario import Scenario
from aqualog.model.sensors import IDEAL
from aqualog.model.simulate import assemble, drive_truth
from aqualog.model.tyre import TYRES
from aqualog.physics.load import G
from tests.thesis.passes import SEDAN

PLANT = build_plant(SEDAN, TYRES["worn_summer"], TYRES["worn_summer"])


def test_the_torque_of_a_drive_gives_back_its_speed():
    truth = drive_truth(assemble(Scenario(SEDAN, speed=((0.0, 20.0), (8.0, 30.0)), duration_s=10.0, sensors=IDEAL)))
    torque = sum(truth.columns[f"torque_{w}"] for w in WHEELS)
    pick = slice(None, None, 10)
    r = replay(PLANT, truth.t[pick], torque[pick], split_rear=1.0, v_0=20.0)
    np.testing.assert_allclose(r.v_x, truth.columns["v_x"][pick], atol=0.03)
    np.testing.assert_allclose(r.omega[2], truth.columns["omega_rl"][pick], rtol=2e-3)


def test_coasting_slows_down_by_drag_and_rolling_resistance():
    t = np.arange(0.0, 5.0, 0.1)
    r = replay(PLANT, t, np.zeros(t.size), split_rear=1.0, v_0=30.0)
    a = -(0.5 * SEDAN.drag_area * SEDAN.air_density * 30.0**2 / SEDAN.mass + SEDAN.rolling_resistance * G)
    inertia = sum(SEDAN.inertia(w) / (SEDAN.r_e(w) * SEDAN.r_l(w)) for w in WHEELS)
    assert np.diff(r.v_x)[5] / 0.1 == pytest.approx(a * SEDAN.mass / (SEDAN.mass + inertia), rel=0.02)


def test_grade_slows_and_is_not_felt_by_the_accelerometer():
    t = np.arange(0.0, 5.0, 0.1)
    flat = replay(PLANT, t, np.full(t.size, 200.0), split_rear=1.0, v_0=20.0)
    hill = replay(PLANT, t, np.full(t.size, 200.0), split_rear=1.0, v_0=20.0, grade=np.full(t.size, 0.05))
    assert (flat.v_x - hill.v_x)[-1] == pytest.approx(G * np.sin(0.05) * 4.9, rel=0.05)
    assert np.abs(hill.a_x - flat.a_x)[5:].max() < 0.06


def test_twice_the_gain_is_twice_the_torque():
    t = np.arange(0.0, 4.0, 0.1)
    a = replay(PLANT._replace(torque_gain=2.0), t, np.full(t.size, 150.0), split_rear=1.0, v_0=20.0)
    b = replay(PLANT, t, np.full(t.size, 300.0), split_rear=1.0, v_0=20.0)
    np.testing.assert_allclose(a.v_x, b.v_x, rtol=1e-6)


def test_bad_inputs_are_refused():
    t = np.arange(0.0, 1.0, 0.1)
    with pytest.raises(ConfigError, match="even time base"):
        replay(PLANT, t**1.1, np.zeros(t.size), split_rear=1.0, v_0=20.0)
    with pytest.raises(ConfigError, match="finite"):
        replay(PLANT, t, np.full(t.size, np.nan), split_rear=1.0, v_0=20.0)
