"""The all-wheel-drive estimator with series sensors: a few seeds of the study, and an hour of slow drifts (C115)."""

from dataclasses import replace

import numpy as np
import pytest

from aqualog.detect.stream import DriveStream
from aqualog.model.effects import EFFECTS
from aqualog.model.scenario import Scenario
from aqualog.model.simulate import simulate
from aqualog.model.term import Model, Term
from tests.thesis.slip_slope_noise import CAR, EXCITATION, believed_car, on_grid, outcome

SEEDS = range(300, 308)
DRIFT = 0.003 / 600.0  # [1/s] 0.3 % in ten minutes


def test_dry_road_raises_nothing_and_snow_is_found():
    dry = [outcome(s, "dry", 0.5, excited=True) for s in SEEDS]
    assert sum(o.false_events for o in dry) == 0
    assert np.median([o.slope_before for o in dry]) == pytest.approx(30.0, rel=0.05)
    snow = [outcome(s, "snow", 0.5, excited=True) for s in SEEDS]
    assert sum(o.false_events for o in snow) == 0
    assert np.isfinite([o.delay for o in snow]).all()
    assert np.median([o.delay for o in snow]) < 4.0


def test_the_split_of_the_loads_is_blind_without_excitation():
    blind = [outcome(s, "snow", 0.6, excited=False) for s in SEEDS]
    assert np.isnan([o.delay for o in blind]).all()
    assert min(o.blind for o in blind) > 0.9


def test_the_tuning_holds_at_50_and_500_hz():
    """The same drives, sampled and measured at another rate: other noise, other delays of the sensors."""
    base = [outcome(s, "snow", 0.5, excited=True) for s in SEEDS[:3]]
    for rate in (50, 500):
        other = [outcome(s, "snow", 0.5, excited=True, rate=rate) for s in SEEDS[:3]]
        for a, b in zip(base, other, strict=True):
            assert b.delay == pytest.approx(a.delay, abs=0.1)
            assert b.slope_before == pytest.approx(a.slope_before, rel=0.02)
            assert b.slope_after == pytest.approx(a.slope_after, rel=0.02)


def hour(*, excited, split, seed, drift=DRIFT):
    """One dry hour; the front radii grow and the rear slopes rise at the rate of the drift."""
    rng = np.random.default_rng(seed)
    speed = [(float(t), float(rng.uniform(22.0, 34.0))) for t in range(0, 3601, 30)]
    scenario = Scenario(
        vehicle=replace(CAR, torque_split_rear=split), duration_s=3600.0, seed=seed, speed=tuple(speed),
        excitation=EXCITATION if excited else None,
    )  # fmt: skip
    model = Model((Term(EFFECTS["slip_stiffness_drift"], {"rate": drift}, "r"),))
    columns = on_grid(simulate(scenario, model))
    columns.pop("v_x", None)
    t = np.arange(columns["omega_fl"].size) / 100
    for wheel in ("fl", "fr"):
        columns[f"omega_{wheel}"] = columns[f"omega_{wheel}"] / (1.0 + drift * t)
    stream = DriveStream(believed_car(seed, split), 10_000_000, list(columns))
    piece = stream.push(columns)
    events = [e for e in (*piece.events, *stream.finish()) if e.detector == "slip_slope_drop"]
    return events, stream.slopes, piece.features


@pytest.mark.nightly
@pytest.mark.parametrize(("excited", "split"), [(True, 0.6), (False, 0.4)])
def test_an_hour_of_drifting_radii_and_slope_ratio_raises_no_alarm(excited, split):
    """C115: "robustness against slow changes in vehicle parameters and high sensitivity to sudden road condition"."""
    events, summaries, features = hour(excited=excited, split=split, seed=61)
    assert events == []
    for summary in summaries:
        assert summary.alarms == 0
        assert summary.seconds["estimating"] > 300.0
        slope = np.asarray(features[f"slip_slope_{summary.place}"])
        assert np.nanmin(slope) > 24.0
        assert np.nanmax(slope) < 36.0
