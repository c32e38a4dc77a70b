"""Sentences say what the numbers say, in one unit."""

import pytest

from aqualog.diagnose.records import Estimate
from aqualog.diagnose.words import cause_sentence, verdict_sentence
from aqualog.model.effects import EFFECTS


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


def test_an_interval_has_the_unit_of_the_value():
    text = told("tyre_radius", "fl", delta=Estimate(-0.01, -0.0102, -0.0098, "-"))
    assert "-1.00%" in text
    assert text.endswith("95 % interval -1.02 to -0.98 %.")


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
