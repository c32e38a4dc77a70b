"""What a car differs by from drive to drive: allowed for in full where the vehicle file tells it, nothing without."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from aqualog.diagnose.day_to_day import as_value, day_to_day
from aqualog.diagnose.drive import prepare
from aqualog.diagnose.evidence import gram_of, noises_after, tolerant, without_deviations
from aqualog.diagnose.hypotheses import Hypothesis
from aqualog.diagnose.refit import KNOWN, metric, refit
from aqualog.diagnose.search import simulated
from aqualog.diagnose.subsets import fit_set, gains_on_top
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Model
from tests.diagnose.test_drive import CAR, NOISY, signals, term


def one(name, where=None):
    return Hypothesis(EFFECTS[name], where, (EFFECTS[name].parameters[0].name,))


ASKED = (one("payload_mass"), one("payload_mass", "r"), one("signal_delay", "v_x"))


@cache
def of_mass(sd):
    """Gain of the payload in the test, its value and its standard deviation."""
    d = prepare(
        signals(term("payload_mass", delta_mass=120.0), sensors=NOISY),
        replace(CAR, spread={"mass": sd} if sd else {}),
        "a",
    )
    evidence = simulated([d], ASKED, Model(), lambda _t, _s: None)
    noises = noises_after(evidence, evidence.residuals, {0: 120.0})
    gram = tolerant(evidence, gram_of(evidence, noises, evidence.residuals))
    r = refit(evidence, fit_set(evidence, gram, (0,)), metric(evidence, noises, share=KNOWN, beside=(0,)), Model())
    return evidence, gains_on_top(evidence, gram, ())[0], float(r.values[0]), float(np.sqrt(r.covariance[0, 0]))


def test_a_mass_that_differs_from_drive_to_drive_is_in_test_and_interval():
    plain, large, value, sd = of_mass(0.0)
    known, small, same, wide = of_mass(60.0)
    np.testing.assert_array_equal(plain.spread, 0.0)
    np.testing.assert_array_equal(known.forgiven, [60.0, *plain.tolerance[1:]])
    assert sd < 10.0 < 60.0 < wide < 70.0
    assert same == pytest.approx(value, abs=2.0)  # less sure, not another one
    assert value == pytest.approx(120.0, abs=10.0)
    assert large > 20.0  # seen where the file's mass is this drive's
    assert small < 6.0  # two standard deviations are nothing out of the ordinary


def test_a_spread_below_the_tolerance_changes_nothing():
    evidence, gain, _, _ = of_mass(1.0)
    plain, same, _, _ = of_mass(0.0)
    assert (evidence.forgiven[0], gain) == (plain.tolerance[0], same)


def test_keys_of_the_file_in_units_of_the_effects():
    car = replace(CAR, torque_gain=0.8, spread={"torque_gain": 0.02, "drag_area": 0.05, "rolling_resistance": 1e-3})
    assert day_to_day(one("torque_gain"), "gain", car) == pytest.approx(0.025)
    assert day_to_day(one("aero_drag"), "delta_drag_area", car) == 0.05
    assert day_to_day(one("rolling_resistance"), "delta_r_w", car) == 1e-3
    assert day_to_day(one("rolling_resistance", "f"), "delta_r_w", car) == 0.0
    assert day_to_day(one("payload_mass"), "delta_mass", car) == 0.0
    assert day_to_day(one("head_wind"), "speed", car) == 0.0


SPREAD = {"torque_gain": 0.03, "drag_area": 0.09, "rolling_resistance": 2e-3}
SEEN = replace(CAR, mass=1400.0, torque_gain=0.9, drag_area=0.45, spread=SPREAD)


@pytest.mark.parametrize(
    ("name", "where", "parameter", "sd"),
    [
        ("torque_gain", None, "gain", 1 / 30),
        ("payload_mass", None, "delta_mass", 1400 / 30),  # the mass was given, so its gain has the spread
        ("payload_mass", "f", "delta_mass", 1400 / 30),
        ("payload_mass", "r", "delta_mass", 1400 / 30),
        ("trailer", None, "mass", 1400 / 30),
        ("trailer", None, "delta_drag_area", 0.09),
        ("wheel_inertia", None, "delta_inertia", 1400 / 30 / 4 * CAR.r_l_f**2),
        ("head_wind", None, "speed", 2.0),  # a tenth of 20 m/s: drag goes with the square
        ("rolling_resistance", "f", "delta_r_w", 2e-3 * CAR.wheelbase / CAR.l_r),
        ("brake_drag", "fl", "torque", 2e-3 * 1400 * 9.81 * CAR.r_l_f),
        ("tyre_radius", None, "delta", 0.0),
    ],
)
def test_one_difference_of_days_as_a_value_of_all_that_looks_like_it(name, where, parameter, sd):
    assert as_value(one(name, where), parameter, SEEN, 20.0) == pytest.approx(sd, rel=1e-3)
    assert as_value(one(name, where), parameter, CAR, 20.0) == 0.0


@pytest.mark.parametrize("where", [None, "r"])
def test_a_load_is_as_unsure_as_the_gain_that_looks_like_it(where):
    """And no more: the gain's spread is in its interval once."""
    d = prepare(
        signals(term("payload_mass", delta_mass=120.0), sensors=NOISY), replace(CAR, spread={"torque_gain": 0.03}), "a"
    )
    evidence = simulated([d], (one("payload_mass", where), one("torque_gain")), Model(), lambda _t, _s: None)
    noises = noises_after(evidence, evidence.residuals, {0: 120.0})
    gram = tolerant(evidence, gram_of(evidence, noises, evidence.residuals))
    r = refit(evidence, fit_set(evidence, gram, (0,)), metric(evidence, noises, share=KNOWN, beside=(0,)), Model())
    assert 0.03 * CAR.mass < np.sqrt(r.covariance[0, 0]) < 0.035 * CAR.mass


def spread_of(evidence):
    return np.flatnonzero(evidence.spread > 0.0).tolist()


def test_what_drives_differ_by_is_nothing_to_look_for():
    evidence, *_ = of_mass(60.0)
    left = without_deviations(evidence, 0, evidence.residuals[0], spread_of(evidence))
    mask, force = evidence.drives[0].mask, evidence.drives[0].channels.index("force_balance")
    before, after = (float(np.mean(x[force, mask] ** 2)) for x in (evidence.residuals[0], left))
    gone = evidence.residuals[0] - left
    assert after < 0.7 * before
    assert 60.0 < float(np.sum(gone * evidence.signatures[0][0]) / np.sum(evidence.signatures[0][0] ** 2)) < 125.0
    plain, *_ = of_mass(0.0)
    assert without_deviations(plain, 0, plain.residuals[0], spread_of(plain)) is plain.residuals[0]
