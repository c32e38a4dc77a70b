"""A rim that swings on its belt, the unevenness of the road, dry friction of the steering: limits by hand."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import curve_fit

from aqualog.model.scenario import Kick, Steering
from aqualog.model.tyre import TYRES
from aqualog.physics.load import HOP, G
from aqualog.physics.steering import STEERING, held_angle
from tests.model.test_kernel import SEDAN, col, imbalance, lane, raw, scenario, truth

SWINGS = replace(TYRES["worn_summer"], torsion_frequency=38.0, torsion_damping=0.05)
ALL = {"tyre_front": SWINGS, "tyre_rear": SWINGS, "unevenness": 64e-6, "steering_friction": 150.0}
PER_FORCE = 1.0 / (STEERING.stiffness * STEERING.arm)
MOST = 150.0 * PER_FORCE


@pytest.mark.parametrize("little", [{"unevenness": 1e-26}, {"steering_friction": 1e-10}])
def test_nearly_nothing_of_a_term_is_the_drive_without_it(little):
    sc = scenario(speed=((0.0, 27.0),), steering=Steering(0.01, 3.0), lanes=(lane(2.0, 4.0),), duration_s=5.0)
    (without, _), (with_it, _) = raw(sc), raw(replace(sc, **little))
    for name in ("v_x", "yaw_rate", "omega", "F_z", "F_y", "steer_angle"):
        np.testing.assert_allclose(col(with_it, name), col(without, name), rtol=1e-7, atol=1e-9)


def test_no_term_creates_energy():
    wet = scenario(speed=((0.0, 22.0), (4.0, 27.0), (9.0, 33.0)), duration_s=10.0, lanes=(lane(3.0, 7.0),), **ALL)
    (coarse, friction), (fine, _) = imbalance(wet, 1e-3), imbalance(wet, 2.5e-4)
    assert friction > -1e-6
    assert fine < 1e-5
    assert fine < 0.2 * coarse


@pytest.mark.parametrize(("frequency", "v"), [(30.0, 15.0), (38.0, 25.0), (45.0, 25.0)])
def test_a_rim_swings_at_its_frequency_damped_by_side_walls_and_contact(frequency, v):
    """The contact resists the tread like a damper C_x r_e² / v, which takes its share of the swing."""
    tyre = replace(SWINGS, torsion_frequency=frequency)
    sc = scenario(speed=((0.0, v),), tyre_front=tyre, kicks=(Kick(v, 0.3, torque=300.0),), duration_s=1.3)
    rows, p = raw(sc, 2.5e-4)
    t = np.arange(rows.shape[0]) * 2.5e-4
    after = t > 1.0 + 0.3 / v

    def swing(t, a, b, w, decay, end, slow):
        return np.exp(-decay * t) * (a * np.cos(w * t) + b * np.sin(w * t)) + end + slow * np.exp(-20.0 * t)

    w = 2.0 * np.pi * frequency
    x, since = col(rows, "omega")[after], t[after] - t[after][0]
    found, _ = curve_fit(swing, since, x, p0=[0.3, 0.3, w, 0.1 * w, x[-1], 0.0])
    contact = col(rows, "slope")[0] * col(rows, "F_z")[0] * p.r_e[0] ** 2 / v
    assert found[2] == pytest.approx(w, rel=0.03)
    assert found[3] / w == pytest.approx(0.05 + 0.5 * p.torsion_stiffness[0] / (contact * w), rel=0.12)


def test_a_slow_torque_turns_rim_and_belt_as_one():
    sc = scenario(speed=((0.0, 20.0), (10.0, 30.0)), duration_s=8.0)
    (one, _), (two, p) = raw(sc), raw(replace(sc, tyre_rear=SWINGS))
    np.testing.assert_allclose(col(two, "omega", 2)[3000:], col(one, "omega", 2)[3000:], rtol=2e-5)
    at_belt = col(two, "F_x", 2) * p.r_e[2] + col(two, "resisting_torque", 2) + p.belt_inertia[2] * 1.0 / p.r_e[2]
    assert col(two, "twist", 2)[6000] == pytest.approx(at_belt[6000] / p.torsion_stiffness[2], rel=0.01)


@pytest.mark.parametrize("v", [12.0, 28.0])
def test_what_an_uneven_road_takes_and_how_it_loads(v):
    """White noise on the slope: pi² n_0² G_d k of each wheel, at any speed; the load's variance by the hop alone."""
    rows, _ = raw(scenario(speed=((0.0, v),), unevenness=256e-6, duration_s=200.0))
    assert col(rows, "F_z")[0] == pytest.approx(0.5 * SEDAN.mass * G * SEDAN.l_r / SEDAN.wheelbase)  # no transient
    climb = np.mean([col(rows, "climb", i)[2000:].mean() for i in range(4)])
    assert climb == pytest.approx(np.pi**2 * 0.01 * 256e-6 * HOP.stiffness, rel=0.12)
    rate = 2.0 * np.pi**2 * 0.01 * 256e-6 * v
    m, k, c = HOP
    loads = [col(rows, "F_z", i)[2000:].std() for i in range(4)]
    assert loads == pytest.approx([k * np.sqrt(rate * (m * k + c * c) / (2.0 * k * c))] * 4, rel=0.1)


def test_friction_holds_the_steering_after_a_jolt_and_the_yaw_with_it():
    jolt = Kick(28.0, 0.8, side="left", torque=1200.0, load=3000.0)
    sc = scenario(speed=((0.0, 28.0),), steering=Steering(0.0, 2.0), kicks=(jolt,), duration_s=5.0)
    (free, _), (rows, _) = raw(sc), raw(replace(sc, steering_friction=150.0))
    assert np.abs(col(free, "yaw_rate")[-500:]).max() < 1e-6 < np.abs(col(free, "yaw_rate")).max()
    held = col(rows, "held")[-500:]
    assert 0.3 * MOST < held.min() < held.max() < MOST
    gain = 28.0 / (SEDAN.wheelbase + 28.0**2 * (1 / 16 - 1 / 20) / G)
    assert col(rows, "yaw_rate")[-500:].mean() == pytest.approx(gain * held.mean(), rel=0.05)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_sliding_rack_follows_with_all_of_its_friction(sign):
    turn = Steering(sign * 0.03, 4.0, kind="hold")
    free = scenario(speed=((0.0, 15.0),), steering=turn, duration_s=2.5)
    rubs = replace(free, steering_friction=150.0)
    assert col(raw(rubs)[0], "held")[2000] == pytest.approx(-sign * MOST)
    more, without = (truth(sc)[1]["steering_torque"][2000] for sc in (rubs, free))
    assert more - without == pytest.approx(sign * STEERING.ratio * 150.0, rel=0.15)  # the angle is 2 % less, too


def test_friction_takes_energy_around_any_course():
    course = np.cumsum(np.random.default_rng(5).normal(0.0, 2e-4, 4000))
    course = np.concatenate([course, np.linspace(course[-1], 0.0, 400)])
    rack, taken, before = 0.0, 0.0, 0.0
    for free, step in zip(course, np.diff(course, prepend=0.0), strict=True):
        held = float(held_angle(np.array(rack), np.array(free), friction=150.0, per_force=PER_FORCE))
        rack, taken, before = free + held, taken - 0.5 * (before + held) * step, held
        assert taken >= 0.5 * held**2 - 1e-20  # all that it gives back is what the column had stored
    assert taken > 100.0 * MOST**2
