"""The run that tells causes apart: its expected information, and that it does when it is driven."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from aqualog.core.records import Signals
from aqualog.core.vehicle import KEYS, Vehicle
from aqualog.diagnose.arena import make_arena
from aqualog.diagnose.channels import contrasts
from aqualog.diagnose.competition import COARSE
from aqualog.diagnose.drive import led_by, prepare
from aqualog.diagnose.hypotheses import hypotheses, residual
from aqualog.diagnose.manoeuvres import KMH, RUNS, programme, turned
from aqualog.diagnose.next_manoeuvre import Rival, _recommended, _signatures, next_manoeuvre
from aqualog.diagnose.noise import fit_noise, weighing
from aqualog.diagnose.refit import metric, refit
from aqualog.diagnose.search import simulated
from aqualog.model.effects import EFFECTS
from aqualog.model.follow import PERFECT
from aqualog.model.log import as_signals
from aqualog.model.scenario import Lane, Scenario
from aqualog.model.sensors import Channel
from aqualog.model.simulate import simulate
from aqualog.model.term import Model, Term

# what a file does not give is hardly known, and then no run tells it from an effect
CAR = Vehicle(name="test car", given=frozenset(KEYS))
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
    arena = make_arena(evidence, Model())
    left, led = evidence.residuals, evidence
    for _ in range(3):
        # noise is what the best set leaves: an effect that is still there would pass for slow noise
        scales = [weighing([left[p.drive][:, p.at]], p.mask, contrasts(drives[0].channels)) for p in arena.parts]
        measure = metric(arena, scales, coarse=COARSE)
        chosen = [[at[k] for k in s] for s in sets]
        start = [np.zeros(sum(len(asked[m].free) for m in c)) for c in chosen]
        found = [refit(led, c, x, measure, Model()) for c, x in zip(chosen, start, strict=True)]
        # as the search does: else a gain would get what a load changes of the target speed
        left, led = found[0].residuals, replace(evidence, drives=tuple(led_by(d, found[0].model) for d in drives))
    noises = [fit_noise(r, d.mask, contrasts(d.channels)) for r, d in zip(left, drives, strict=True)]
    loss = np.array([r.loss for r in found])
    p = np.exp(-0.5 * (loss - loss.min()))
    return evidence, [Rival(r, x) for r, x in zip(found, (p / p.sum()).tolist(), strict=True)], noises


WIND = [["head_wind"], ["aero_drag"]]
PAYLOAD = [["payload_mass"], ["torque_gain"]]
BRAKE = [["brake_drag"], ["rolling_resistance"]]


@pytest.fixture(scope="module")
def wind():
    truth = model("head_wind", speed=4.0)
    drive = log(truth, wind=gusts())
    return truth, drive, case([drive], WIND)


def settled(truth, drive, sets, answer):
    """Probability of the right set, the first one, from the log together with the recommended run."""
    run = next(r for r in RUNS if r.name == answer.name)
    times = {0.0: 1, 1.0: 2, 2.0: 3}[answer.minutes - run.minutes]
    again = [driven(replace(programme(run, drive), sensors=SENSORS, seed=4 + i), truth) for i in range(times)]
    _, rivals, _ = case([drive, *again], sets)
    return rivals[0].probability


def test_wind_and_drag_need_the_way_back(wind):
    _, _, (evidence, rivals, noises) = wind
    answer = next_manoeuvre(evidence, rivals, noises, Model())
    assert answer.name == "opposite_direction"
    assert answer.separates == (("head_wind", "aero_drag"),)
    assert answer.after > 0.95 > answer.before
    assert "the probability of naming the right cause rises from" in answer.sentence
    assert answer == next_manoeuvre(evidence, rivals, noises, Model())


@pytest.mark.nightly
def test_load_and_torque_gain_are_decided_on_the_scales(monkeypatch):
    """Without scales, the best run is no promise; driven, it settles this load."""
    truth = model("payload_mass", delta_mass=60.0)
    drive = log(truth, wind=gusts())
    evidence, rivals, noises = case([drive], PAYLOAD)
    answer = next_manoeuvre(evidence, rivals, noises, Model())
    assert answer.name == "weighing"
    assert answer.after > 0.95 > answer.before
    assert answer.separates == (("payload_mass", "torque_gain"),)
    monkeypatch.setattr("aqualog.diagnose.next_manoeuvre.checks", lambda _: ())
    run = next_manoeuvre(evidence, rivals, noises, Model())
    assert answer.before < run.after < 0.95
    probability = settled(truth, drive, PAYLOAD, run)
    assert probability > 0.95 > rivals[0].probability


def test_a_dragging_brake_is_told_from_rolling_resistance_by_a_jacked_wheel():
    evidence, rivals, noises = case([log(model("brake_drag", torque=8.0))], BRAKE)
    answer = next_manoeuvre(evidence, rivals, noises, Model())
    assert answer.name == "jacked_wheel"
    assert answer.after > 0.95 > answer.before


def test_on_the_way_back_the_wind_has_the_other_sign_and_drag_has_not(wind):
    _, drive, (evidence, _, _) = wind
    there, back = (next(r for r in RUNS if r.opposite is x and r.water is None) for x in (False, True))
    asked = [h for h in evidence.asked if h.key in ("head_wind", "aero_drag")]
    base = residual(drive, Model())
    ways = [_signatures(drive, Model(), asked, base, r, each=False) for r in (there, back)]
    signs = {h.key: float(np.sum(a * b) / np.sum(a * a)) for h, a, b in zip(asked, *ways, strict=True)}
    assert signs == {"head_wind": pytest.approx(-1.0), "aero_drag": pytest.approx(1.0)}


def test_nothing_to_decide_is_no_manoeuvre(wind):
    _, _, (evidence, rivals, noises) = wind
    assert next_manoeuvre(evidence, rivals[:1], noises, Model()) is None
    assert next_manoeuvre(evidence, [rivals[0], rivals[0]], noises, Model()) is None


def test_the_same_fault_of_two_signals_is_worth_a_run():
    evidence, rivals, noises = case(
        [log(model("signal_delay", "a_x", delay=0.2))], [["signal_delay@a_x"], ["signal_delay@v_x"]]
    )
    answer = next_manoeuvre(evidence, rivals, noises, Model())
    assert answer.before == pytest.approx(max(c.probability for c in rivals), abs=1e-6)
    assert answer.after >= answer.before


def test_one_fault_at_two_wheels_is_two_causes():
    evidence, rivals, noises = case(
        [log(model("tyre_radius", "fl", delta=0.002))], [["tyre_radius@fl"], ["tyre_radius@fr"]]
    )
    answer = next_manoeuvre(evidence, rivals, noises, Model())
    assert answer.before == pytest.approx(max(c.probability for c in rivals), abs=1e-6)


def test_runs_are_safe(wind):
    _, drive, _ = wind
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


@pytest.mark.parametrize(("after", "best"), [(0.603, ""), (0.7, " The best is speed steps, three times: ")])
def test_a_run_that_decides_nothing_is_not_recommended(after, best):
    radius = SimpleNamespace(key="tyre_radius@fl", effect=EFFECTS["tyre_radius"], where="fl")
    rivals = [SimpleNamespace(refit=SimpleNamespace(members=own)) for own in ([radius], [])]
    what = SimpleNamespace(name="speed_steps", how="Drive steps")
    gives = SimpleNamespace(right=after, pairs={(0, 1): after})
    option = SimpleNamespace(what=what, times=3, sensor=None, gives=gives, minutes=9.0)
    said = _recommended(SimpleNamespace(rivals=rivals), option, 0.6, enough=False).sentence
    start = "No run, check or further sensor distinguishes: tyre radius (front left wheel) from no effect."
    assert said.startswith(start + best)
    assert bool(best) == (len(said) > len(start))
    # a run may rule out what is unlikely anyway
    helps = _recommended(SimpleNamespace(rivals=rivals), option, 0.6, enough=True).sentence
    assert ("rises from 60 % to 70 %" if best else "named with 60 %, as before") in helps
