"""The run that tells causes apart: which one, that it does when it is driven, and that the answer may be none."""

from dataclasses import replace

import numpy as np
import pytest

from aqualog.core.records import Signals
from aqualog.core.vehicle import Vehicle
from aqualog.diagnose import next_manoeuvre as module
from aqualog.diagnose.channels import contrasts
from aqualog.diagnose.drive import prepare
from aqualog.diagnose.evidence import gram_of, noises_after, tolerant
from aqualog.diagnose.hypotheses import hypotheses
from aqualog.diagnose.manoeuvres import KMH, RUNS, programme, turned
from aqualog.diagnose.next_manoeuvre import next_manoeuvre, resolving
from aqualog.diagnose.noise import fit_noise
from aqualog.diagnose.refit import metric, refit
from aqualog.diagnose.search import Candidate, simulated
from aqualog.diagnose.subsets import fit_set
from aqualog.model.effects import EFFECTS
from aqualog.model.follow import PERFECT
from aqualog.model.log import as_signals
from aqualog.model.scenario import Lane, Scenario
from aqualog.model.sensors import Channel
from aqualog.model.simulate import simulate
from aqualog.model.term import Model, Term

# radii that a file does not give are hardly known, and then no run tells them from the velocity's scale
CAR = Vehicle(name="test car", given=frozenset({"drivetrain", "mass", "wheels.r_e_f", "wheels.r_e_r"}))
NOISE = {"a_x": 0.05, "a_y": 0.05, "v_x": 0.02, "yaw_rate": 2e-3, "omega": 0.01, "torque": 2.0}
SENSORS = replace(PERFECT, channels={
    n: Channel(noise=x)
    for name, x in NOISE.items()
    for n in ([f"{name}_{w}" for w in ("fl", "fr", "rl", "rr")] if name in ("omega", "torque") else [name])
})  # fmt: skip
CRUISE = tuple((10.0 * i, 27.0 + (0.5 if i % 2 else -0.5)) for i in range(13))


def model(effect, where=None, **values):
    return Model((Term(EFFECTS[effect], values, where),))


def driven(scenario, truth):
    signals = as_signals(simulate(scenario, truth, dt=2e-3), truth=False)
    frame = signals.frame.drop([c for c in signals.frame.columns if c.startswith(("tie_rod", "steering"))])
    return prepare(Signals(frame, signals.dt_ns, signals.start_ns, {}, signals.quality, signals.files), CAR, "drive")


def log(truth, seed=3, wind=()):
    scenario = Scenario(CAR, duration_s=120.0, rate_hz=50.0, speed=CRUISE, seed=seed, wind=wind, sensors=SENSORS)
    return driven(scenario, truth)


def gusts(rms=2.0, over=5.0):
    """Coloured wind (t, v) that makes slow noise, mean zero."""
    rng, x, out = np.random.default_rng(8), 0.0, []
    keep = np.exp(-1.0 / over)
    for _ in range(121):
        x = keep * x + np.sqrt(1.0 - keep * keep) * rms * rng.standard_normal()
        out.append(x)
    return tuple((float(t), v) for t, v in enumerate((np.array(out) - np.mean(out)).tolist()))


def case(drives, sets):
    """Evidence, refitted sets and noises of drives, asked about these sets only."""
    names = {h.split("@")[0] for s in sets for h in s}
    asked, _ = hypotheses(drives, Model())
    asked = tuple(h for h in asked if h.allowed or h.effect.name in names)
    evidence = simulated(drives, asked, Model(), lambda _text, _share: None)
    at = {h.key: i for i, h in enumerate(asked)}
    noises = noises_after(evidence, evidence.residuals, {})
    for _ in range(3):
        gram = tolerant(evidence, gram_of(evidence, noises, evidence.residuals))
        measure = metric(evidence, noises)
        found = [refit(evidence, fit_set(evidence, gram, [at[k] for k in s]), measure, Model()) for s in sets]
        # noise is what the best set leaves: an effect that is still there would pass for slow noise
        noises = [fit_noise(r, d.mask, contrasts(d.channels)) for r, d in zip(found[0].residuals, drives, strict=True)]
    return evidence, [Candidate(r, 1.0, 1.0) for r in found], noises


RADIUS = [["tyre_radius"], ["velocity_scale@v_x"]]
WIND = [["head_wind"], ["aero_drag"]]


@pytest.fixture(scope="module")
def radius():
    truth = model("tyre_radius", delta=0.008)
    drive = log(truth)
    return truth, drive, case([drive], RADIUS)


@pytest.fixture(scope="module")
def wind():
    drive = log(model("head_wind", speed=4.0), wind=gusts())
    return drive, case([drive], WIND)


@pytest.mark.xfail(
    strict=True,
    reason="the trial forecasts little from hard acceleration since the curve of a tyre is allowed for so widely",
)
def test_radius_and_velocity_are_told_apart_by_accelerating_and_then_they_are(radius):
    truth, drive, (evidence, credible, noises) = radius
    answer = next_manoeuvre(evidence, credible, noises, Model())
    assert answer.name == "hard_acceleration"
    assert answer.separates == (("tyre_radius", "velocity_scale@v_x"),)
    assert answer.separation_now < answer.separation_then
    assert answer.separation_then > answer.separation_now + resolving()
    assert "tyre radius" in answer.sentence
    assert answer == next_manoeuvre(evidence, credible, noises, Model())
    run = next(r for r in RUNS if r.name == answer.name)
    second = driven(replace(programme(run, drive), sensors=SENSORS, seed=4), truth)
    _, (right, wrong), _ = case([drive, second], RADIUS)
    assert wrong.refit.loss - right.refit.loss > 2.0 * np.log(20.0)


@pytest.mark.nightly
def test_wind_and_drag_need_the_way_back(wind, monkeypatch):
    _, (evidence, credible, noises) = wind
    answer = next_manoeuvre(evidence, credible, noises, Model())
    assert answer.name == "opposite_direction"
    monkeypatch.setattr(
        module, "fitting", lambda _e, *, wet: tuple(r for r in RUNS if r.water is None and not r.opposite)
    )
    alone = next_manoeuvre(evidence, credible, noises, Model())
    assert alone.name == "none"
    assert alone.separates == ()
    assert "head wind from aero drag" in alone.sentence


@pytest.mark.nightly
def test_rolling_resistance_and_dragging_brakes_stay_one():
    evidence, credible, noises = case(
        [log(model("rolling_resistance", delta_r_w=0.004))], [["rolling_resistance"], ["brake_drag"]]
    )
    answer = next_manoeuvre(evidence, credible, noises, Model())
    assert answer.name == "none"
    assert answer.separation_then < resolving()


def test_nothing_to_decide_is_no_manoeuvre(radius):
    _, _, (evidence, credible, noises) = radius
    assert next_manoeuvre(evidence, credible[:1], noises, Model()) is None
    assert next_manoeuvre(evidence, [credible[0], credible[0]], noises, Model()) is None


def test_runs_are_safe(wind):
    drive, _ = wind
    wet = replace(drive, course=replace(drive.course, lanes=(Lane(5.0, 10.0, depth_left=1e-3, depth_right=1e-3),)))
    for run in RUNS:
        scenario = programme(run, wet)
        t, v = np.array(scenario.speed).T
        assert v.max() <= (130.0 if not scenario.lanes else 90.0) * KMH + 1e-9
        assert np.abs(np.diff(v) / np.diff(t)).max() <= 3.5 + 1e-9, run.name
        truth = simulate(scenario, dt=2e-3).truth.columns
        assert np.abs(truth["a_x"]).max() < 4.0, run.name
        assert np.abs(truth["a_y"]).max() < 4.0, run.name


def test_the_way_back_turns_wind_and_slope_and_nothing_else():
    there = Model(
        (
            *model("head_wind", speed=4.0).terms,
            *model("road_grade", grade=0.01).terms,
            *model("payload_mass", delta_mass=50.0).terms,
        )
    )
    back = turned(there)
    assert [dict(t.values) for t in back.terms] == [{"speed": -4.0}, {"grade": -0.01}, {"delta_mass": 50.0}]
    assert turned(back) == there
