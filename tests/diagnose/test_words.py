"""Sentences say what the numbers say, in one unit."""

import math

import numpy as np
import pytest

from aqualog.diagnose.records import Estimate, Remainder
from aqualog.diagnose.shapes import MECHANISMS
from aqualog.diagnose.unknown_term import describe
from aqualog.diagnose.words import cause_sentence, change_words, number, verdict_sentence
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Term


def told(effect, where, **estimates):
    return cause_sentence(EFFECTS[effect], where, estimates)


@pytest.mark.parametrize(
    ("effect", "where", "name", "estimate", "ends"),
    [
        ("torque_gain", None, "gain", Estimate(1.0990, 1.0954, 1.1030, "-"), "95 % interval 1.095 to 1.103."),
        ("velocity_scale", None, "scale", Estimate(1.0041, 1.0036, 1.0046, "-"), "95 % interval 1.0036 to 1.0046."),
        ("payload_mass", None, "delta_mass", Estimate(200.0, 193.6, 207.9, "kg"), "95 % interval 194 to 208 kg."),
        ("payload_mass", None, "delta_mass", Estimate(-150.0, -157.0, -143.0, "kg"), "95 % interval 143 to 157 kg."),
        ("signal_delay", "v_x", "delay", Estimate(0.2, 0.196, 0.203, "s"), "95 % interval 0.196 to 0.203 s."),
        (
            "signal_delay",
            "a_x",
            "delay",
            Estimate(-0.106, -0.11, -0.1, "s"),
            "The signal (longitudinal) comes 0.106 s early; 95 % interval 0.100 to 0.110 s.",
        ),
    ],
)
def test_an_interval_has_the_digits_that_tell_its_ends_apart(effect, where, name, estimate, ends):
    assert told(effect, where, **{name: estimate}).endswith(ends)


def test_a_sentence_has_its_place_once():
    e = {"scale": Estimate(0.97, 0.969, 0.971, "-")}
    assert (
        told("velocity_scale", "v_x", **e)
        == "The reference velocity reads 0.9700 times the truth; 95 % interval 0.9690 to 0.9710."
    )
    assert told("payload_mass", "f", delta_mass=Estimate(50.0, 40.0, 60.0, "kg")).startswith(
        "The car weighed 50 kg more than the vehicle file says (front axle);"
    )


def test_more_than_noise_and_nothing_large_is_one_sentence():
    text = verdict_sentence("no_effect", (), level=0.01, seen=0.0022)
    assert "more than noise is left (p = 0.0022)" in text
    assert "agrees with the measurement" not in text


@pytest.mark.parametrize(
    ("count", "said"), [(4, "0.01."), (5, "0.01; 6 effects were not tested (5 of them: no wheel torque in the log).")]
)
def test_no_effect_says_what_was_not_tested(count, said):
    untested = dict.fromkeys(map(str, range(count)), "no wheel torque in the log") | {
        "water": "no water depth in the log"
    }
    text = verdict_sentence("no_effect", (), level=0.01, untested=untested)
    assert text == f"No effect: the model agrees with the measurement, at a false-alarm level of {said}"


@pytest.mark.parametrize(
    ("effect", "where", "value", "half", "text"),
    [
        ("tyre_radius", None, 0.0245, 0.0049,
         "The effective tyre radius (all wheels) is 2.45% larger than the vehicle file says; 95 % interval 2.0 to 2.9 %."),
        ("tyre_radius", "f", -0.01, 0.0002,
         "The effective tyre radius (front axle) is 1.00% smaller than the vehicle file says; "
         "95 % interval 0.98 to 1.02 %."),
        ("aero_drag", None, 0.2, 0.02,
         "The drag area is 0.20 m² larger than the vehicle file says; 95 % interval 0.18 to 0.22 m²."),
        ("head_wind", None, -3.0, 0.5, "A tail wind of 3.0 m/s blew; 95 % interval 2.5 to 3.5 m/s."),
        ("cornering_drag", None, 0.0257, 0.003,
         "At 4 m/s² of lateral acceleration, curves slow the car by 0.41 m/s² more than modelled; "
         "95 % interval 0.36 to 0.46 m/s²."),
        ("tyre_radius_growth", None, 2e-6, 4e-7,
         "The tyre radius (all wheels) grows by 0.26% up to 130 km/h; 95 % interval 0.21 to 0.31 %."),
        ("track_clearing", None, -2e-4, 1e-4,
         "The front wheels leave 0.20 mm less film than the tyre model says; 95 % interval 0.10 to 0.30 mm."),
        ("slip_stiffness_drift", "f", 2e-4, 5e-5,
         "The slip slope (front axle) changes by +1.2% a minute; 95 % interval 0.9 to 1.5 %."),
    ],
)  # fmt: skip
def test_a_sentence_says_from_what_and_in_which_direction(effect, where, value, half, text):
    own = EFFECTS[effect].parameters[0]
    assert told(effect, where, **{own.name: Estimate(value, value - half, value + half, own.unit)}) == text


@pytest.mark.parametrize(
    ("cosine", "last"), [(0.4, "here."), (0.6, "Of known effects, load sensitivity is nearest (similarity 0.60 of 1).")]
)
def test_a_place_has_the_digits_of_its_points(cosine, last):
    x = np.linspace(-2421.741, 965.862843, 60)[:, None]
    f = np.linspace(0.0, 0.468, 60)
    mechanism = next(m for m in MECHANISMS if m.name == "torque")
    r = Remainder("force_balance", ("torque",), 0.58, math.nan, x, f, f - 0.1, f + 0.1, (), "load_sensitivity", cosine, "",
                  "torque", "-", 0.75)  # fmt: skip
    text = describe(mechanism, r, [mechanism])
    assert "; +46.8% at 970 N·m)" in text
    assert "goes with its own size (" in text
    assert text.endswith(last)


def test_the_size_is_the_surest_one_and_not_that_of_an_end_where_nobody_drove():
    x, f = np.array([[-460.0], [200.0], [1360.0]]), np.array([40.0, 35.0, 1160.0])
    half = np.array([35.0, 10.0, 1100.0])
    mechanism = next(m for m in MECHANISMS if m.name == "force")
    r = Remainder("force_balance", ("torque",), 0.58, math.nan, x, f, f - half, f + half, (), None, 0.0, "", "force", "N",
                  0.75)  # fmt: skip
    assert "; 35 N against the motion at " in describe(mechanism, r)


@pytest.mark.parametrize(
    ("value", "text"), [(1163.0, "1160"), (-212.4, "-212"), (0.000123, "0.000123"), (3.2e8, "3.2e+08")]
)
def test_large_numbers_have_no_exponent(value, text):
    assert number(value) == text


def test_a_change_is_from_the_known_value_in_standard_deviations():
    at = {"effect": EFFECTS["tyre_radius"], "where": "f"}
    text = change_words(Term(**at, values={"delta": -0.0034}), {}, {"delta": 0.0017})
    assert text == "tyre radius (front axle) 0.34% smaller (2.0 standard deviations)"
    late = Term(EFFECTS["signal_delay"], {"delay": 0.074}, "v_x")
    text = change_words(late, {"delay": 0.1}, {})
    assert text == "signal delay (reference velocity) 0.026 s smaller"
    stiff = Term(EFFECTS["slip_stiffness"], {"gain": 1.11}, "f")
    text = change_words(stiff, {}, {"gain": 0.08})
    assert text == "slip stiffness (front axle) 11% larger (1.4 standard deviations)"
