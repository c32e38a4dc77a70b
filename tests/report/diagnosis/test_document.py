"""The JSON document of a diagnosis: the contract's keys, no NaN, and sentences that rest on its figures."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest

from aqualog.diagnose.records import Estimate
from aqualog.diagnose.words import verdict_sentence
from aqualog.report.diagnosis.document import diagnosis_document
from aqualog.report.diagnosis.sections import diagnosis_report
from aqualog.report.diagnosis.words import effect_title, sentences
from aqualog.report.page import report_page
from aqualog.report.text import report_text
from aqualog.report.values import interval_text, measured, ordinary, percent, short
from tests.report.diagnosis_case import BASE, HOSTILE, IMAGE, MASS, NAN, RADIUS, cases, numbers_in, remainder

VERDICTS = list(cases())


def text_of(document):
    return report_text(diagnosis_report(document))


SCALES = {"%": 100.0, "km/h": 3.6, "ms": 1e3, "mm": 1e3, "": 1.0}
NUMBER = re.compile(r"(?<![\w.])[-−+]?\d+(?:\.\d+)?(?:·10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+|e[-+]?\d+)?")
GRAMMAR = {"per 100 km": "per km"}  # numbers that are words of a unit


def document_of(verdict="named", **changes):
    return diagnosis_document(
        replace(cases()[verdict], **changes), logs=["b24.mf4", HOSTILE], tool_version="1.2.3",
        extended_model=None, notes=["b24.mf4: 3 samples dropped"], vehicle="car",
    )  # fmt: skip


def round_trip(document):
    return json.loads(json.dumps(document, allow_nan=False))


def figures_in(text, document):
    """(text, value, half a unit of its last digit, what follows) of each number, without names of drives."""
    for name in [*document["drives"], *((document["gain"] or {}).get("heldout") or [])]:
        text = text.replace(name, "")
    for phrase, plain in GRAMMAR.items():
        text = text.replace(phrase, plain)
    for m in NUMBER.finditer(text):
        plain = ordinary(m.group(0)).replace("+", "")
        mantissa, _, power = plain.partition("e")
        digits = mantissa.lstrip("-")
        decimals = len(digits.partition(".")[2])
        # 1200 may be told of 1234: its noughts before the point are not all told
        noughts = 0 if "." in digits or digits == "0" else len(digits) - len(digits.rstrip("0"))
        scale = 10.0 ** int(power or 0)
        yield m.group(0), float(mantissa) * scale, 0.5000001 * 10.0 ** (noughts - decimals) * scale, text[m.end() :]


def unfounded(document):
    """Numbers of sentences that no figure of the document bears out; how to drive is an instruction and no finding."""
    known = numbers_in(document)
    said = [s for lines in sentences(document).values() for s in lines]
    if document["next_manoeuvre"] is not None:
        said.remove(document["next_manoeuvre"]["sentence"])
    said += [" … ".join(interval_text(p)) for c in document["causes"] for p in c["parameters"].values()]
    return [
        (text, s)
        for s in said
        if s not in document["notes"] and s not in sentences(document)["untested"]
        for text, value, half, rest in figures_in(s, document)
        if not any(
            abs(abs(k * f) - abs(value)) <= half
            for k in known
            for unit, f in SCALES.items()
            if not unit or rest.lstrip().startswith(unit)
        )
    ]


@pytest.mark.parametrize("verdict", VERDICTS)
def test_keys_of_the_contract(verdict):
    d = round_trip(document_of(verdict))
    keys = {"verdict", "causes", "alternatives", "unexplained", "gain", "false_alarm_level", "detection_limits",
            "next_manoeuvre", "extended_model", "schema_version", "tool_version"}  # fmt: skip
    assert keys <= set(d)
    assert d["verdict"] == verdict
    for c in d["causes"]:
        assert {"effect", "where", "parameters", "explains", "sentence"} <= set(c)
    for u in d["unexplained"]:
        assert {"channel", "depends_on", "share"} <= set(u)


def test_values_of_the_contract():
    d = document_of()
    assert d["causes"][0]["parameters"] == {"delta_mass": {"value": 262.0, "ci95": [240.0, 285.0], "unit": "kg"}}
    assert d["alternatives"] == [["tyre_radius@fl", "tyre_radius_growth@r"]]
    assert d["false_alarm_level"] == 0.01
    assert d["significance"]["achieved_level"] == 0.0101
    assert d["detection_limits"]["payload_mass"] == "14 kg"
    assert d["detection_limits"]["accelerometer_bias@a_x"] == "0.006 m/s^2"
    assert d["detection_limits"]["torque_gain"] == "0.012"
    assert d["detection_limits"]["road_grade"] is None
    assert d["gain"]["channel"]["force_balance"]["rmse_before"] == 0.1182
    assert d["gain"]["heldout_log_score_gain"] == 812.4
    assert d["gain"]["ci95"] == [700.2, 930.1]
    assert d["model"] == [{"effect": "payload_mass", "where": None, "parameters": {"delta_mass": 262.0}}]
    m = document_of("cannot_tell")["next_manoeuvre"]
    assert m["separates"] == [["payload_mass", "torque_gain"]]
    assert m["p_correct_now"] == pytest.approx(0.5 * (1 + math.erf(math.sqrt(0.81) / 2 / math.sqrt(2))))
    assert m["p_correct_then"] == pytest.approx(1.0, abs=1e-4)


def test_a_gain_within_the_sample_is_not_given_out_as_held_out():
    g = document_of("unexplained")["gain"]
    assert g["heldout_log_score_gain"] is None
    assert g["ci95"] == [None, None]
    assert g["in_sample_log_score_gain"] == 1.4
    told = sentences(document_of("unexplained"))["score"][0]
    assert "no held-out data" in told
    assert "no measurable gain" in told


def test_derived_figures():
    g = document_of()["gain"]
    assert g["channel"]["force_balance"]["rmse_change"] == pytest.approx(0.0451 / 0.1182 - 1.0)
    c = g["consequences"][0]
    assert c["per_100km_before"] == pytest.approx(12 / 84.2 * 100)
    limits = {x["key"]: x for x in document_of()["limits"]}
    assert limits["payload_mass"]["smallest_worth_naming"] == 20.0
    assert limits["payload_mass"]["ratio"] == pytest.approx(0.71)


@pytest.mark.parametrize("verdict", VERDICTS)
def test_each_number_of_a_sentence_is_in_the_document(verdict):
    assert unfounded(round_trip(document_of(verdict))) == []


def test_a_number_from_nowhere_is_found_out():
    wrong = replace(MASS, sentence="The car weighed 263 kg more than the vehicle file says.")
    found = unfounded(document_of(causes=(wrong,)))
    assert [text for text, _ in found] == ["263"]
    assert unfounded(document_of(sentence="The error falls by 61.5 %."))


@pytest.mark.parametrize("verdict", VERDICTS)
def test_terminal_text(verdict):
    d = document_of(verdict)
    text = text_of(round_trip(d))
    assert text.startswith(d["sentence"] + "\n")
    assert len(text.splitlines()) < 45
    assert "nan" not in text.lower().replace("nano", "")
    assert text == text_of(d)
    assert all(ord(c) < 128 or c in "²³·±" for c in text)


def test_terminal_text_tells_what_counts():
    text = text_of(document_of("cannot_tell"))
    for part in ("240 ... 285", "payload mass from torque gain: the right name in 67 %", "Drive a staircase of speeds",
                 "0.118 -> 0.0451 m/s²", "812 natural units (95 %: 700 ... 930)", "achieved 0.0101 in 99 simulations with noise only"):  # fmt: skip
        assert part in text
    assert "14.3 times less likely" in text_of(document_of("named"))


def test_nothing_but_a_sentence_of_what_is_not_testable():
    assert text_of(document_of("not_testable")) == "These drives cannot be tested: there is no wheel torque.\n"


def test_without_calibration():
    s = replace(BASE.significance, achieved=NAN, surrogates=0)
    assert "was not measured" in sentences(document_of(significance=s))["test"][1]
    s = replace(BASE.significance, achieved=0.013, surrogates=0)
    assert "achieved 0.013, without simulated noise" in sentences(document_of(significance=s))["test"][1]


def test_an_open_interval_is_told_as_such():
    cause = replace(MASS, parameters={"delta_mass": Estimate(262.0, NAN, math.inf, "kg")})
    d = document_of(causes=(cause,))
    assert d["causes"][0]["parameters"]["delta_mass"]["ci95"] == [None, None]
    assert "not available" in text_of(d)


def test_confused_sets_are_told_once_and_exact_relations_apart():
    said = sentences(document_of())
    assert said["confused"] == [
        "payload mass from torque gain with wheel inertia: the right name in 53 %",
        "payload mass from torque gain: the right name in 67 %",
        "aero drag from head wind: the right name in 59 %",
    ]
    assert said["causes_confused"] == said["confused"][:2]
    assert len(said["relations"]) == 1
    assert said["causes_relations"] == []


def test_the_clock_of_a_bus_is_named_by_no_single_wheel():
    assert effect_title("clock_skew@torque_fl") == "clock skew, wheel torque"
    assert effect_title("road_grade + tyre_radius@fl") == "road grade with tyre radius, FL"


def test_effects_that_look_alike_are_one_line_for_all():
    d = document_of()
    keys = ["brake_drag@fl", "brake_drag@fr", "torque_gain", "torque_offset@f"]

    def like(effect, *rivals):
        return {"effect": effect, "rivals": list(rivals), "separation": 0.0, "p_correct": 0.5, "sizes": [],
                "relation": f"{effect} like {rivals}."}  # fmt: skip

    pairs = [like(a, b) for a in keys for b in keys if a != b]
    sets = [like(k, "wheel_inertia", "road_grade") for k in ("aero_drag", "head_wind")]
    said = sentences(d | {"isolability": [*pairs, *sets]})
    assert said["relations"] == [
        "Brake drag, FL; brake drag, FR; torque gain; torque offset, front look exactly alike.",
        "Aero drag; head wind each look exactly like wheel inertia with road grade.",
    ]
    assert len(said["relation_sizes"]) == len(pairs) + len(sets)


def test_the_headline_is_never_empty():
    assert sentences(document_of(sentence=""))["headline"] == ["One cause."]


@pytest.mark.parametrize(
    ("value", "low", "high", "told"),
    [
        (262.04, 240.1, 284.9, ("262", "240 … 285")),
        (-0.004312, -0.00462, -0.00398, ("−0.00431", "−0.00462 … −0.00398")),
        (2.04e-6, 1.7e-6, 2.4e-6, ("2.04·10⁻⁶", "1.70·10⁻⁶ … 2.40·10⁻⁶")),
        (1520.0, 1100.0, 1990.0, ("1520", "1100 … 1990")),
        (0.05, 0.05, 0.05, ("0.05", "0.05 … 0.05")),
        (0.0, -0.02, 0.02, ("0.000", "−0.020 … 0.020")),
    ],
)
def test_values_have_two_digits_of_their_interval(value, low, high, told):
    assert interval_text({"value": value, "ci95": [low, high]}) == told


def test_numbers():
    assert [short(x) for x in (0.0, 0.1182, 12.31, 812.4, 1234.5, 2.5e-5, 3.1e7, -0.5, 0.00099999)] == [
        "0", "0.118", "12.3", "812", "1234", "2.5·10⁻⁵".replace("2.5", "2.50"), "3.10·10⁷", "−0.5", "1.00·10⁻³"
    ]  # fmt: skip
    assert [percent(x) for x in (0.0, 0.019, 0.62, 0.95, 0.969, 0.99999, 1.0, None)] == [
        "0 %", "1.9 %", "62 %", "95 %", "96.9 %", "100 %", "100 %", "–"
    ]  # fmt: skip
    assert measured(1234.0, "ppm") == "1200 ppm"
    assert measured(4.12e-7, "s^2/m^2") == "4.1·10⁻⁷ s²/m²"
    assert effect_title("tyre_radius@fl") == "tyre radius, FL"
    assert effect_title("signal_delay@v_x") == "signal delay, v_x"


def test_no_number_is_told_of_nothing():
    g = replace(BASE.gain, channels=(), log_score=NAN, consequences=())
    d = round_trip(document_of(gain=g, limits=(), confusions=()))
    assert sentences(d)["score"] == []
    assert np.isfinite(numbers_in(d)).all()


def test_a_channel_that_gets_worse_is_told_wherever_it_stands():
    c = replace(BASE.gain.channels[-1], rmse_before=1.0, rmse_after=1.05, free_before=NAN, free_after=NAN)
    g = replace(BASE.gain, channels=(*BASE.gain.channels[:-1], c))
    told = sentences(document_of(gain=g))["score"]
    assert told[-1].startswith("Larger error with the extended model: ")
    assert "tie rod FL +5 % for the next sample" in told[-1]


@pytest.mark.parametrize(
    ("score", "low", "high", "said"),
    [
        (9.0, 5.0, 12.0, "rises by 9 natural units"),
        (9.0, -5.0, 12.0, "no measurable gain"),
        (-9.0, -12.0, -5.0, "falls by 9 natural units"),
    ],
)
def test_a_score_is_told_by_its_interval(score, low, high, said):
    g = replace(BASE.gain, log_score=score, low=low, high=high)
    told = sentences(document_of(gain=g))["score"][0]
    assert said in told
    assert ("rises" in told) == (low > 0.0)


def test_hostile_names_stay_text():
    d = round_trip(document_of())
    assert d["drives"][1] == HOSTILE
    assert d["gain"]["heldout"][1] == IMAGE


def test_sets_that_are_told_apart_are_in_the_matrix_alone():
    d = document_of()
    assert [c["rivals"] for c in d["isolability"] if c["p_correct"] >= 0.95] == []
    names, p = d["isolability_pairs"]["effects"], d["isolability_pairs"]["p_correct"]
    i, j, k = (names.index(n) for n in ("payload_mass", "torque_gain", "head_wind"))
    assert (p[i][j], p[j][i], p[i][k], p[k][i], p[j][k], p[i][i]) == (0.674, 0.7, 1.0, 1.0, None, None)


def test_powers_of_ten_stay_numbers_in_plain_text():
    from aqualog.report.values import ordinary

    assert ordinary("p = 1.00·10⁻¹² at 3 m/s²") == "p = 1.00e-12 at 3 m/s²"


def test_a_gain_depends_on_what_it_multiplies():
    gain = replace(remainder(), mechanism="accelerometer_gain", unit="-")
    (r,) = round_trip(document_of("unexplained", remainders=(gain,)))["unexplained"]
    assert r["depends_on"] == ["v_x", "a_x"]
    assert {len(x) for x in r["x"]} == {1}
    (r,) = round_trip(document_of("unexplained", remainders=(replace(gain, mechanism="force"),)))["unexplained"]
    assert r["depends_on"] == ["v_x"]


def test_the_contracts_keys_are_there():
    probable = replace(MASS, probability=0.973)
    d = round_trip(document_of("unexplained", causes=(probable,)))
    assert {"verdict", "causes", "alternatives", "unexplained", "gain", "false_alarm_level", "detection_limits",
            "next_manoeuvre", "extended_model"} <= set(d)  # fmt: skip
    assert {"effect", "where", "parameters", "explains", "sentence", "probability"} <= set(d["causes"][0])
    assert set(d["causes"][0]["parameters"]["delta_mass"]) == {"value", "ci95", "unit"}
    for r in d["unexplained"]:
        assert {"channel", "depends_on", "share", "mechanism", "probability", "similar_to"} <= set(r)
    assert {"channel", "heldout_log_score_gain", "ci95", "heldout"} <= set(d["gain"])
    m = document_of("cannot_tell")["next_manoeuvre"]
    assert {"name", "separates", "sentence"} <= set(m)


def test_the_first_sentence_bears_the_probability():
    probable = replace(MASS, probability=0.973)
    one = sentences(document_of(causes=(probable,)))["headline"][0]
    assert one == "The car weighed 262 kg more than the vehicle file says; probability 97 %."
    both = (probable, replace(RADIUS, probability=0.4))
    two = sentences(document_of("cannot_tell", causes=both))["headline"][0]
    assert two.endswith("; probability of payload mass 97 %, of tyre radius, FL 40 %.")
    even = sentences(document_of("compound", causes=(probable, replace(RADIUS, probability=0.973))))["headline"][0]
    assert even.endswith("; probability 97 % each.")
    form = replace(remainder(), probability=0.9999)
    unknown = sentences(document_of("unexplained", remainders=(form,)))["headline"][0]
    assert unknown.endswith("; probability over 99 %.")
    assert "probability" not in sentences(document_of("no_effect"))["headline"][0]


def test_causes_and_alternatives_bear_their_probabilities():
    other = replace(BASE.alternatives[0], causes=(replace(RADIUS, probability=0.021),))
    d = document_of(causes=(replace(MASS, probability=0.973),), alternatives=(other,))
    text = text_of(d)
    assert "97 %" in text.split("payload mass", 1)[1]
    assert sentences(d)["alternatives"][0].endswith("probability 2 %")
    both = replace(other, causes=(replace(RADIUS, probability=0.021), replace(MASS, probability=0.58)))
    two = sentences(document_of(alternatives=(both,)))["alternatives"][0]
    assert two.endswith("probability at most 2 %")  # no set is more probable than its least probable cause


def test_a_file_that_is_not_calibrated_comes_first():
    said = "This vehicle file was not calibrated: mass is a guess."
    d = document_of(caution=said)
    assert d["notes"][0] == said
    text = text_of(d)
    assert 0 <= text.index(said) < text.index(MASS.sentence.rstrip("."))
    assert said not in sentences(d)["notes"]  # once on a page is enough


def test_what_would_settle_it_stands_beneath_the_verdict():
    titles = [s.title for s in diagnosis_report(document_of("cannot_tell")).sections if s.title]
    assert titles[0] == "What would settle it"
    assert "What would settle it" not in [s.title for s in diagnosis_report(document_of("named")).sections]


@pytest.mark.parametrize(
    ("causes", "certain", "title"),
    [((MASS, RADIUS), {"payload_mass"}, "Some causes are certain, others are open"),
     ((MASS, RADIUS), set(), "Causes that this log cannot distinguish"),
     ((MASS,), set(), "A cause that is not certain")],
)  # fmt: skip
def test_the_small_head_says_what_the_sentence_says(causes, certain, title):
    said = verdict_sentence("cannot_tell", causes, level=0.05, certain=frozenset(certain))
    head = report_page(diagnosis_report(document_of("cannot_tell", causes=causes, sentence=said)), title="d")
    assert title in head
    assert (title == "Causes that this log cannot distinguish") == ("Causes that this log cannot" in head)


def test_untested_effects_are_grouped_by_reason():
    why = "no wheel torque in the log"
    d = document_of(untested={"payload_mass": why, "torque_gain": why, "water_drag": "no water depth in the log"})
    assert sentences(d)["untested"] == [
        "No wheel torque in the log: payload mass, torque gain.", "No water depth in the log: water drag.",
    ]  # fmt: skip
