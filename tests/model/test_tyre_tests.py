"""Programmes of the tyre tests: what is driven, and that the library finds what they were made for."""

import math

import numpy as np
import pytest

from aqualog.config.scenario import load_scenario
from aqualog.model.log import signals_of
from aqualog.model.programme import PROGRAMMES
from aqualog.model.simulate import simulate
from aqualog.model.tyre_tests import CONTROL, HATCH, RADIUS, braking_test, curve_test, straight_test
from aqualog.trade.braking import stops
from aqualog.trade.curve import curve_passes
from aqualog.trade.straight import straight_runs
from tests.conftest import ROOT
from tests.trade.study import true_v_15

KMH = 1.0 / 3.6


@pytest.mark.parametrize("name", ["straight-test", "curve-test", "braking-test"])
def test_the_control_stands_first_and_last_and_names_are_unique(name):
    runs = PROGRAMMES[name]()
    assert len({r.name for r in runs}) == len({r.scenario.seed for r in runs}) == len(runs)
    assert {r.manoeuvre for r in runs} == {name}
    tyres = [r.scenario.tyre_front.name for r in runs]
    assert tyres[0] == tyres[-1] == CONTROL
    assert len(set(tyres)) >= 3


def test_straight_runs_have_one_wet_side_and_both_drivetrains():
    runs = straight_test()
    assert {r.scenario.vehicle.drivetrain for r in runs} == {"fwd", "rwd"}
    for r in runs:
        (lane,) = r.scenario.lanes
        assert (lane.depth_left, lane.depth_right) == (0.0, 7e-3)
    for r in (runs[0], runs[-1]):
        made = simulate(r.scenario)
        car = r.scenario.vehicle
        (found,) = straight_runs(signals_of(made, car, "x.mf4"), car)
        assert found.valid, found.reasons
        assert found.wet_side == "right"
        assert found.v / KMH == pytest.approx(true_v_15(made, car.drivetrain[0]), abs=0.7)  # v_x is late


def test_passes_hold_the_circle():
    runs = curve_test()
    assert sorted({round(r.scenario.speed[0][1] / KMH) for r in runs}) == [60, 65, 70, 75, 80, 85, 90]
    made = simulate(runs[0].scenario)
    steer = made.truth.columns["steer_angle"][made.truth.t > 2.5]
    assert np.ptp(steer) < 1e-9
    (found,) = curve_passes(signals_of(made, HATCH, "x.mf4"), radius=RADIUS)
    assert found.valid, found.reasons
    assert found.radius == pytest.approx(RADIUS, rel=0.06)
    assert found.a_y_least < 0.8 * found.a_y_dry


def test_stops_are_stops():
    made = simulate(braking_test()[0].scenario)
    (found,) = stops(signals_of(made, HATCH, "x.mf4"), v_from=80 * KMH, v_to=20 * KMH)
    assert found.valid, found.reasons
    assert 0.5 < found.bfc < 0.9


def test_steering_that_is_held_in_a_scenario_file(tmp_path):
    (tmp_path / "s.toml").write_text(
        f'vehicle = "{(ROOT / "sample_logs" / "vehicle.toml").as_posix()}"\nspeed_kmh = 40.0\nduration_s = 4.0\n'
        '[steering]\nkind = "hold"\namplitude_deg = 2.0\nperiod_s = 2.0\nstart_s = 0.5\n'
    )
    scenario = load_scenario(tmp_path / "s.toml")
    assert scenario.steering.kind == "hold"
    made = simulate(scenario).truth
    steer = made.columns["steer_angle"]
    assert steer[made.t < 0.5] == pytest.approx(0.0)
    assert np.interp(1.0, made.t, steer) == pytest.approx(math.radians(1.0), rel=0.01)  # half of the rise
    assert steer[made.t > 1.6] == pytest.approx(math.radians(2.0))
