"""What a car differs by from drive to drive: allowed for in full where the vehicle file tells it, nothing without."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from aqualog.core.vehicle import Provenance
from aqualog.diagnose.arena import arena_of, known_only
from aqualog.diagnose.drive import prepare
from aqualog.diagnose.file_values import as_value, day_to_day
from aqualog.diagnose.hypotheses import Hypothesis
from aqualog.diagnose.refit import KNOWN, metric, refit
from aqualog.diagnose.search import simulated
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Model
from tests.diagnose.test_drive import CAR, NOISY, signals, term


def one(name, where=None):
    return Hypothesis(EFFECTS[name], where, (EFFECTS[name].parameters[0].name,))


ASKED = (one("payload_mass"), one("payload_mass", "r"), one("signal_delay", "v_x"))


def seen(car, asked, value, hidden):
    """Gain of the first effect, hidden with this value, in the test, its value and its standard deviation."""
    d = prepare(signals(hidden, sensors=NOISY), car, "a")
    evidence = simulated([d], asked, Model(), lambda _t, _s: None)
    arena = known_only(arena_of(evidence, ()))
    without = [r - value * s[0] for r, s in zip(evidence.residuals, evidence.signatures, strict=True)]
    weighings = arena.weighed([[r] for r in without])
    gram = arena.tolerant(arena.inner(weighings))
    measure = metric(arena, weighings, share=KNOWN, beside=(0,))
    r = refit(evidence, (0,), np.array([0.8 * value]), measure, Model())
    gain = 0.5 * float(gram[0, -1] ** 2 / gram[0, 0])
    return evidence, gain, float(r.values[0]), float(np.sqrt(r.covariance[0, 0]))


def loaded(car, asked):
    """The same of a payload of 120 kg."""
    return seen(car, asked, 120.0, term("payload_mass", delta_mass=120.0))


@cache
def of_mass(sd, source="measured", own=0.0):
    """The same with a spread between drives, and where the file's own mass comes from."""
    said = {**CAR.provenance, "mass": Provenance(source, own)}
    return loaded(replace(CAR, spread={"mass": sd} if sd else {}, provenance=said), ASKED)


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


def test_a_mass_of_a_data_sheet_is_as_unsure_as_one_that_differs_from_drive_to_drive():
    for known, sheet in zip(of_mass(60.0)[1:], of_mass(0.0, "data_sheet", 60.0)[1:], strict=True):
        assert sheet == pytest.approx(known, rel=1e-9)
    evidence, gain, _, sd = of_mass(60.0, "data_sheet", 80.0)
    assert evidence.spread[0] == pytest.approx(100.0)  # independent of each other
    assert (gain < 3.0, 100.0 < sd < 110.0) == (True, True)


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
        ("wheel_inertia", None, "delta_inertia", 1400 / 30 / 4 * CAR.r_e_f**2),
        ("head_wind", None, "speed", 2.0),  # a tenth of 20 m/s: drag goes with the square
        ("rolling_resistance", "f", "delta_r_w", 2e-3 * CAR.wheelbase / CAR.l_r),
        ("brake_drag", "fl", "torque", 2e-3 * 1400 * 9.81 * CAR.r_e_f),
        ("tyre_radius", None, "delta", 0.0),
    ],
)
def test_one_difference_of_days_as_a_value_of_all_that_looks_like_it(name, where, parameter, sd):
    assert as_value(one(name, where), parameter, SEEN, 20.0) == pytest.approx(sd, rel=1e-3)
    assert as_value(one(name, where), parameter, CAR, 20.0) == 0.0


def test_the_errors_of_the_files_own_values_count_in_all_that_looks_like_them():
    said = {**CAR.provenance, "mass": Provenance("data_sheet", 42.0), "torque_gain": Provenance("guess", 0.04)}
    said |= {"wheels.inertia_f": Provenance("guess", 0.3), "wheels.r_e_r": Provenance("guess", 0.003)}
    car = replace(CAR, mass=1400.0, torque_gain=1.0, r_e_r=0.3, spread={"torque_gain": 0.03}, provenance=said)
    ratio = np.hypot(0.03, 0.05)
    assert as_value(one("trailer"), "mass", car, 20.0) == pytest.approx(1400.0 * ratio)
    assert as_value(one("payload_mass", "r"), "delta_mass", car, 20.0) == pytest.approx(1400.0 * ratio)
    like_load = 1400.0 * ratio / 2 * car.r_e_f**2
    assert as_value(one("wheel_inertia", "f"), "delta_inertia", car, 20.0) == pytest.approx(np.hypot(like_load, 0.3))
    assert as_value(one("tyre_radius", "r"), "delta", car, 20.0) == pytest.approx(0.01)
    assert as_value(one("tyre_radius", "rl"), "delta", car, 20.0) == 0.0


def test_a_radius_is_as_unsure_as_the_file_and_once():
    car = replace(CAR, provenance={**CAR.provenance, "wheels.r_e_r": Provenance("guess", 0.003 * CAR.r_e_r)})
    asked = tuple(one("tyre_radius", w) for w in ("r", "rl", "rr"))
    _, gain, value, sd = seen(car, asked, 0.004, term("tyre_radius", "r", delta=0.004))
    assert value == pytest.approx(0.004, abs=3e-4)
    assert sd == pytest.approx(0.003, rel=0.1)
    assert gain < 1.5  # a deviation of 1.3 standard deviations is nothing out of the ordinary


@pytest.mark.parametrize("where", [None, "r"])
def test_a_load_is_as_unsure_as_the_gain_that_looks_like_it(where):
    """And no more: the gain's spread is in its interval once."""
    car = replace(CAR, spread={"torque_gain": 0.03})
    _, _, _, sd = loaded(car, (one("payload_mass", where), one("torque_gain")))
    assert 0.03 * CAR.mass < sd < 0.035 * CAR.mass
