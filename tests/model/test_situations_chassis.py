"""Nuisances of driver, motor and road do what their names say, and no joint detector takes them for water."""

from dataclasses import replace

import numpy as np
import pytest

from aqualog.core.notation import WHEELS
from aqualog.detect.stream import detect_drive
from aqualog.model.log import as_signals
from aqualog.model.scenario import Scenario, Steering
from aqualog.model.sensors import IDEAL
from aqualog.model.simulate import simulate
from aqualog.model.situations import SCORING_POOL, TUNING_POOL, draw
from aqualog.model.situations_chassis import CHASSIS
from tests.thesis.passes import SEDAN


def driven(name, seed=1, pool=TUNING_POOL):
    d = draw(name, seed, pool)
    truth = simulate(d.scenario, d.model).truth
    return d, truth.t, truth.columns


def sum_of(c, stem):
    return sum(c[f"{stem}_{w}"] for w in WHEELS)


@pytest.mark.parametrize(
    "pool", [TUNING_POOL, pytest.param(SCORING_POOL, marks=pytest.mark.nightly)], ids=["tuning", "scoring"]
)
@pytest.mark.parametrize("name", CHASSIS)
def test_no_joint_alarm(name, pool):
    for seed in (1, 2):
        d = draw(name, seed, pool)
        result = detect_drive(as_signals(simulate(d.scenario, d.model), vehicle=d.believed), d.believed, samples=False)
        assert not [e for e in result.events if e.detector.startswith("joint")], d.note
        assert result.judgement.verdict == "none"


def test_a_spare_wheel_turns_faster_all_the_time():
    d, _, c = driven("spare_wheel")
    wheel = next(t.place for t in d.model.terms if t.effect.name == "tyre_radius")
    other = {"fl": "fr", "fr": "fl", "rl": "rr", "rr": "rl"}[wheel]
    ratio = c[f"omega_{wheel}"] / c[f"omega_{other}"]
    assert 1.02 < ratio.min() <= ratio.max() < 1.07
    assert c["v_x"].max() < 90.0 / 3.6


def test_regeneration_brakes_the_driven_axle_alone():
    d, t, c = driven("regeneration", pool=SCORING_POOL)
    falling = c["a_x"] < -0.8
    assert 5.0 < falling.sum() * (t[1] - t[0]) < 60.0
    assert c["brake_pressure"][falling].max() < 2e3  # the friction brakes have no part
    free = [w for w in WHEELS if w not in d.scenario.vehicle.driven]
    for w in free:
        assert c[f"torque_{w}"][falling].min() > -5.0


def test_one_pedal_drives_and_brakes():
    _, _, c = driven("one_pedal")
    torque = sum_of(c, "torque")
    crossed = np.count_nonzero(np.diff((torque < -200.0).astype(int)) == 1)
    assert crossed >= 3
    assert torque.max() > 300.0


def test_tip_in_is_faster_than_a_foot_and_shuffles():
    _, t, c = driven("tip_in")
    torque = sum_of(c, "torque")
    step = round(0.25 / (t[1] - t[0]))
    rise = torque[step:] - torque[:-step]
    assert rise.max() > 0.8 * torque.max()
    assert rise.min() < -0.5 * torque.max()


def test_a_lane_change_goes_there_and_back():
    d, t, c = driven("lane_change")
    s = d.scenario.steering
    y = np.cumsum(c["v_x"] * np.sin(np.cumsum(c["yaw_rate"]) * (t[1] - t[0]))) * (t[1] - t[0])
    at = [np.searchsorted(t, s.start_s + x * s.period_s) for x in (0.0, 1.5, 3.3)]
    moved = [float(y[i] - y[at[0]]) for i in at]
    assert 1.5 < abs(moved[1]) < 8.0
    assert abs(moved[2]) < 0.35 * abs(moved[1])
    assert 2.5 < np.abs(c["a_y"]).max() < 7.0


def test_humps_unload_and_rumble_strips_shake_one_side():
    _, _, c = driven("humps")
    load = c["true_load_fl"]
    assert load.max() > 1.15 * np.median(load)
    assert load.min() < 0.9 * np.median(load)
    d, _, c = driven("rumble_strips")
    side = d.scenario.kicks[0].side
    shaken, calm = ("fl", "fr") if side == "left" else ("fr", "fl")
    assert np.ptp(c[f"true_load_{shaken}"]) > 2.0 * np.ptp(c[f"true_load_{calm}"])


def test_vectoring_moves_torque_across_one_axle():
    plain = Scenario(SEDAN, duration_s=6.0, speed=((0.0, 20.0),), sensors=IDEAL, wind=((0.0, 0.0),))
    moved = replace(plain, vectoring=((2.0, 0.0), (2.1, 200.0), (6.0, 200.0)))
    a, b = (simulate(s).truth.columns for s in (plain, moved))
    at = 4000
    assert b["torque_rr"][at] - b["torque_rl"][at] == pytest.approx(400.0, abs=5.0)
    assert b["torque_fl"][at] == pytest.approx(a["torque_fl"][at], abs=1.0)
    assert sum_of(b, "torque")[at] == pytest.approx(sum_of(a, "torque")[at], abs=5.0)
    assert b["yaw_rate"][2300] > 0.002  # more to the right wheel turns the car left
    same = simulate(replace(plain, vectoring=((0.0, 0.0),))).truth.columns
    for name in a:
        np.testing.assert_array_equal(a[name], same[name], err_msg=name)


def test_steering_of_a_lane_change():
    s = Scenario(
        SEDAN, duration_s=12.0, speed=((0.0, 20.0),), sensors=IDEAL, steering=Steering(0.02, 2.0, 1.0, "lane_change")
    )
    angle = simulate(s).truth.columns["steer_angle"]
    assert angle[1500] == pytest.approx(0.02, abs=2e-3)
    assert angle[2500] == pytest.approx(-0.02, abs=2e-3)
    assert abs(angle[4000]) < 1e-6
    assert angle[5500] == pytest.approx(-0.02, abs=2e-3)
    assert abs(angle[9000]) < 1e-6
