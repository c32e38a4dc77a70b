"""The drives behind single figures of chapter 2: what the text tells happens in them."""

from dataclasses import replace

import numpy as np
import pytest

from aqualog.core.errors import ConfigError
from aqualog.model.programme import SCENES, scene
from aqualog.model.simulate import simulate
from aqualog.physics.steering import STEERING


@pytest.fixture(scope="module")
def drives():
    """Without what hides the water's part in the rods."""
    return {n: simulate(replace(scene(n), unevenness=0.0, steering_friction=0.0)).truth for n in SCENES}


def during(truth, name, start, end):
    return truth.columns[name][(truth.t >= start) & (truth.t < end)]


def series(truth, wheel, below, start, end, gap_s=0.05):
    """How many times the slip falls below a value."""
    low = during(truth, f"true_slip_{wheel}", start, end) < below
    begins = np.flatnonzero(np.diff(low.astype(int), prepend=0) == 1)
    return int(np.count_nonzero(np.diff(begins, prepend=-(10**9)) > gap_s * 1000))


def excess(truth, number, wheel, start, end):
    """Tie-rod force over that of a model that knows lateral force and torque and nothing of water, dry median 0."""
    car = scene(number).vehicle
    c = truth.columns
    drive = c[f"torque_{wheel}"] / car.arm(wheel) - car.rolling_resistance * c[f"true_load_{wheel}"]
    outward = (1.0 if wheel == "fl" else -1.0) * c[f"true_force_y_{wheel}"]
    over = c[f"tie_rod_{wheel}"] + 0.35 * outward + STEERING.hub_offset / STEERING.arm * drive
    over = over - np.median(over[5000:9000])
    return over[(truth.t >= start) & (truth.t < end)]


def test_no_other_scene():
    with pytest.raises(ConfigError, match="no scene"):
        scene("2.10")


def test_2_8_front_right_stops_and_rear_right_spins(drives):
    t = drives["2.8"]
    assert during(t, "true_slip_fr", 23.0, 27.0).min() < -0.9
    assert during(t, "true_slip_rr", 23.0, 27.2).max() > 0.15


def test_2_9_minor_spin_downs_of_the_free_wheel_only(drives):
    t = drives["2.9"]
    assert series(t, "fr", -0.015, 23.0, 28.0) >= 5
    assert series(t, "fr", -0.015, 23.0, 24.0) >= 1  # from the entry on
    assert during(t, "true_slip_fr", 23.0, 28.0).min() > -0.15
    dry, wet = (np.median(during(t, "true_slip_rr", *s)) for s in ((10.0, 22.0), (23.5, 28.0)))
    assert dry < wet < 0.01
    assert np.ptp(t.columns["v_x"]) < 0.7


def test_2_25_below_full_speed_the_rear_slip_rises(drives):
    t = drives["2.25"]
    assert not during(t, "on_water", 0.0, 24.0).any()
    assert series(t, "fr", -0.02, 24.0, 30.0) >= 4
    assert during(t, "true_slip_fr", 26.0, 26.5).min() < -0.1  # the one large spin-down
    assert during(t, "true_slip_fr", 24.0, 30.0).min() > -0.3
    dry, wet = (np.median(during(t, "true_slip_rr", *s)) for s in ((10.0, 23.0), (24.5, 30.0)))
    assert wet > 2.0 * dry


def test_2_21_only_the_right_rod_rises(drives):
    t = drives["2.21"]
    assert series(t, "fr", -0.05, 10.0, 15.0) >= 4
    assert during(t, "true_slip_fl", 10.0, 15.0).min() > -0.02
    down = during(t, "true_slip_fr", 10.0, 15.0) < -0.05
    assert np.median(excess(t, "2.21", "fr", 10.0, 15.0)[down]) > 150.0
    assert np.abs(excess(t, "2.21", "fl", 10.0, 15.0)).max() < 60.0
    v = t.columns["v_x"]
    assert v[-1] < v[0]


def test_2_22_spin_downs_and_spin_ups_raise_the_rods(drives):
    t = drives["2.22"]
    slip = {s: during(t, "true_slip_fl", *s) for s in ((17.6, 18.4), (18.7, 19.8), (21.0, 22.0), (23.0, 24.5))}
    assert slip[17.6, 18.4].min() < -0.05
    assert 0.03 < slip[18.7, 19.8].max() < slip[23.0, 24.5].max()
    assert slip[21.0, 22.0].min() < -0.05
    assert slip[23.0, 24.5].max() > 0.15
    for span, x in slip.items():
        far = np.abs(x) > 0.5 * np.abs(x).max()
        assert np.median(excess(t, "2.22", "fl", *span)[far]) > 150.0, span


def test_2_23_loss_of_both_front_wheels_takes_the_lateral_acceleration(drives):
    t = drives["2.23"]
    assert 1.6 < np.abs(during(t, "a_y", 10.0, 22.0)).max() < 2.1
    right, left = (during(t, f"true_slip_{w}", 22.9, 23.5).min() for w in ("fr", "fl"))
    assert right < -0.05
    assert right < left < -0.02  # less water there
    assert series(t, "fl", -0.05, 26.0, 27.1) >= 2
    assert during(t, "true_slip_fr", 25.0, 27.05).min() > -0.03
    assert during(t, "true_slip_fr", 27.1, 28.0).min() < -0.05
    assert np.abs(excess(t, "2.23", "fl", 8.0, 22.0)).max() < 60.0
    for wheel in ("fl", "fr"):
        assert excess(t, "2.23", wheel, 27.3, 29.0).max() > 350.0
    assert np.abs(during(t, "a_y", 27.3, 29.0)).max() < 0.7 * np.abs(during(t, "a_y", 10.0, 22.0)).max()
