"""The road's profile: found where there are hills, silent where sensors wander or something else is wrong."""

from dataclasses import replace

import numpy as np
import pytest

from aqualog.diagnose import run
from aqualog.diagnose.drive import prepare
from aqualog.diagnose.grade import find_profile, with_profile
from aqualog.diagnose.hypotheses import Hypothesis, residual
from aqualog.diagnose.outcome import with_causes
from aqualog.diagnose.records import Cause, Estimate
from aqualog.diagnose.verdict import Outcome
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Model
from tests.blind.world.cases import CARS, Hidden, Spec, clean_rows, make_case, world_of

HILLY = Spec("hilly", "gusts", (), 8, "compact_fwd", holdout=0)


def looked(spec, model=Model()):  # noqa: B008 - frozen
    drive = prepare(make_case(spec).drives[0][1], CARS[spec.vehicle], "d")
    return drive, residual(drive, model)


@pytest.fixture(scope="module")
def hilly():
    drive, r = looked(HILLY)
    return drive, r, find_profile(drive, r)


def test_profile_is_that_of_the_road(hilly):
    _, _, found = hilly
    _, road = clean_rows(HILLY, world_of(HILLY))
    truth = np.interp(found.s, np.arange(len(road.grid)) * road.ds, road.grid[:, 1])
    off = found.theta - truth
    assert np.corrcoef(found.theta, truth)[0, 1] > 0.98
    assert np.std(off) < 0.003
    assert found.rms.low < np.std(truth) < found.rms.high
    assert found.mean.low < truth.mean() < found.mean.high
    assert found.lap_m is None


def test_cause_names_the_grade(hilly):
    _, _, found = hilly
    cause = found.cause
    assert (cause.effect, cause.explains) == ("road_grade", ("kinematic",))
    assert cause.parameters["grade_rms"].unit == "rad"
    assert f"{found.rms.value:.1%} rms" in cause.sentence


def test_with_it_in_the_model_the_residual_falls(hilly):
    drive, before, found = hilly
    after = residual(drive, with_profile(Model(), found))
    kinematic, force = (drive.channels.index(c) for c in ("kinematic", "force_balance"))
    assert after[kinematic, drive.mask].std() < 0.7 * before[kinematic, drive.mask].std()
    assert after[force, drive.mask].std() < 1.1 * before[force, drive.mask].std()
    assert find_profile(drive, after) is None


def test_wind_and_drag_are_no_part_of_it(hilly):
    drive, r, found = hilly
    v, with_wind = drive.coordinates["v_x"], r.copy()
    # a tail wind of 8 m/s and less drag: the torque moves the car more, and the accelerometer feels it
    with_wind[drive.channels.index("force_balance")] += 0.005 * v + 3e-5 * v**2
    np.testing.assert_allclose(find_profile(drive, with_wind).theta, found.theta, atol=5e-4)


def test_two_profiles_are_one_term(hilly):
    _, _, found = hilly
    model = with_profile(with_profile(Model(), found), replace(found, theta=-found.theta))
    assert len(model.terms) == 1
    assert all(abs(value) < 1e-12 for _, value in model.terms[0].knots)


@pytest.mark.parametrize("noise", ["ou5", "pink", "gusts"])
def test_flat_road_with_slow_noise_is_silent(noise):
    drive, r = looked(Spec("mixed", noise, (), 3, holdout=0))
    assert find_profile(drive, r) is None


@pytest.mark.parametrize(
    "hidden",
    [
        Hidden("payload_mass", None, {"delta_mass": 250.0}), Hidden("accelerometer_gain", "a_x", {"gain": 1.06}),
        Hidden("drag_patch", None, {"force": 400.0, "start": 500.0, "length": 600.0, "period": 0.0}),
    ],
)  # fmt: skip
def test_other_causes_are_no_road(hidden):
    drive, r = looked(Spec("mixed", "ou1", (hidden,), 5, holdout=0))
    assert find_profile(drive, r) is None


def test_without_torque_a_wandering_accelerometer_is_no_road(hilly):
    drive, before, _ = hilly
    kinematic = drive.channels.index("kinematic")
    alone = replace(drive, channels=("kinematic",), untorqued=True)
    rng = np.random.default_rng(4)
    wander = np.convolve(rng.standard_normal(before.shape[1] + 200), np.hanning(201), "valid")
    assert find_profile(alone, 0.1 * (wander / wander.std())[None, : before.shape[1]]) is None
    found = find_profile(alone, before[kinematic][None])
    assert found is None or "cannot be distinguished" in found.cause.sentence


def test_a_road_too_small_to_be_named_is_a_note(hilly):
    _, _, found = hilly
    small = replace(found, rms=Estimate(0.0099, 0.009, 0.011, "rad"))
    silent = run._with_road(Outcome("no_effect", ()), small)
    assert (silent.verdict, silent.causes) == ("no_effect", ())
    assert "below 1% rms, from which a road is named" in silent.notes[0]
    assert run._with_road(Outcome("no_effect", ()), found).verdict == "named"


def test_probability_grows_with_the_correlation_of_both_channels(hilly):
    _, _, found = hilly
    assert found.probability > 0.99
    assert replace(found, p_value=0.05).probability < 0.6
    assert replace(found, p_value=float("nan")).probability < 0.95


def test_profile_and_mean_are_one_road(hilly):
    _, _, found = hilly
    grade = Estimate(0.012, 0.008, 0.016, "rad")
    mean = Cause("road_grade", None, {"grade": grade}, ("kinematic",), "The road climbs by 1.2%.")
    late = Cause("signal_delay", "a_x", {}, ("kinematic",), "The signal comes late.")
    alone = run._with_road(Outcome("named", (mean,)), found)
    both = run._with_road(Outcome("compound", (late, mean)), found)
    open_ = run._with_road(Outcome("cannot_tell", (mean, late)), found)
    assert (alone.verdict, [c.key for c in alone.causes]) == ("named", ["road_grade"])
    assert (both.verdict, [c.key for c in both.causes]) == ("compound", ["signal_delay@a_x", "road_grade"])
    assert alone.causes[0].parameters == {"grade_rms": found.rms, "grade_mean": found.mean}
    bias = Cause("accelerometer_bias", "a_x", {}, (), "")
    assert run._with_road(Outcome("named", (bias,)), found).causes[1].parameters == {"grade_rms": found.rms}
    assert len(open_.causes) == 3  # then it is not known whether it is the road's mean or another effect
    constant = Hypothesis(EFFECTS["road_grade"], None, ("grade",))
    assert with_causes(Model(), [found.cause], [constant]) == Model()  # beside an unknown form: no constant slope
