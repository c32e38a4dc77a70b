"""The sentences of a validation, from records by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest

from aqualog.report.text import report_text
from aqualog.report.validation import validation_document, validation_report
from aqualog.validate.boundary import Tolerance
from aqualog.validate.records import Judged, Limit, Plan, Plot, Rated, Spread, Trace, Validity, Worst

PLOT = Plot("a_x", "t", Tolerance(0.1, 0.0, 0.15, 0.05))
WORST = Worst("d.mf4", "a_x", -0.12, 4.1, 6.3)
ZERO = np.zeros(100)
TRACE = Trace(
    "d.mf4", 0.1, 10.0, {"a_x": ZERO}, {"a_x": ZERO}, {"t": 0.1 * np.arange(100), "v_x": ZERO + 20.0},
    np.ones(100, bool), np.zeros(100, bool),
)  # fmt: skip
FOUND = Validity(
    (TRACE,), Plan(), 0.97, 10.0, 10.0, (Judged(PLOT, 100, 97, 10.0, WORST),), WORST,
    (
        Limit("dry", math.nan, 10.0, 36.0, 0.99, 200.0),
        Limit("on water", 92.0 / 3.6, 50.0 / 3.6, 120.0 / 3.6, 0.4, 30.0),
    ),
    (Rated("a_x", 10.0, 0.83, 0.9, 1.0, 0.7, 0.65, 0.02), Rated("slip_fr", 10.0, 0.6, 0.7, 0.9, 0.4, 0.3, 0.0)), {},
)  # fmt: skip


def document(found=FOUND, method="boundary", why=None):
    return validation_document(found, method=method, vehicle="the i30", logs=["d.mf4"], notes=[], why=why)


def test_the_sentence_of_the_boundaries():
    assert document()["sentence"] == (
        "By the method of ISO 19364, on another test: the simulation of the i30 is not valid above 92 km/h on water. It is "
        "within the boundaries 97 % of the time (95 % asked for). Farthest beyond: a_x by 0.12 m/s² at 4.1-6.3 s. The "
        "tolerances are built in: 1 drive of the 3 that the method asks for, no basis for a release."
    )


def test_the_sentence_of_the_rating():
    assert document(method="18571")["sentence"] == (
        "By the method of ISO/TS 18571, on another test: the simulation of the i30 is rated 0.71 over 2 signals, lowest "
        "slip_fr with 0.60. By the boundaries of ISO 19364 it is not valid above 92 km/h on water. The tolerances are "
        "built in: 1 drive of the 3 that the method asks for, no basis for a release."
    )
    assert "is not rated, because no signal moved enough" in document(replace(FOUND, rated=()), "18571")["sentence"]


def test_of_several_drives_the_worst_is_named():
    two = replace(FOUND, traces=(TRACE, replace(TRACE, name="e.mf4")))
    assert "at 4.1-6.3 s of d.mf4." in document(two)["sentence"]


@pytest.mark.parametrize(
    ("limit", "told"),
    [
        (Limit("on water", 50.0 / 3.6, 50.0 / 3.6, 120.0 / 3.6, 0.4, 30.0), "not valid on water (50 to 120 km/h)"),
        (Limit("dry", 100.0 / 3.6, 50.0 / 3.6, 120.0 / 3.6, 0.4, 30.0), "not valid above 100 km/h on dry road"),
        (Limit("dry", math.nan, 50.0 / 3.6, 120.0 / 3.6, 1.0, 30.0), "valid at all speeds driven"),
    ],
)
def test_limits_in_words(limit, told):
    assert f": the simulation of the i30 is {told}. It is" in document(replace(FOUND, limits=(limit,)))["sentence"]


def test_what_the_repetitions_give_stands_beside_the_result():
    found = replace(FOUND, spread={"a_x": Spread(0.15, 3, 4.303, 0.031, 0.015)})
    made = document(found)
    own = ("repeated_drives", "t_factor", "scatter", "noise")
    assert [made["plots"][0][k] for k in own] == [3, 4.303, 0.031, 0.015]
    assert [document()["plots"][0][k] for k in own] == [None] * 4
    text = report_text(validation_report(found, made))
    assert "0.15 m/s² = t √(s_b² + s_n²): t 4.30, scatter between 3 drives s_b 0.031, noise s_n 0.015" in text
    assert "Fewer repetitions make wider boundaries" in text
    assert "epetition" not in report_text(validation_report(FOUND, document()))


def test_no_effect_is_no_reason_why_not():
    why = {
        "verdict": "no_effect",
        "sentence": "No effect: the model agrees.",
        "caution": "",
        "next_manoeuvre": None,
        "causes": [],
    }
    for limits, is_valid in ((FOUND.limits, False), ((), True)):
        found = replace(FOUND, limits=limits)
        text = report_text(validation_report(found, document(found, why=why)))
        assert ("the model agrees" in text) == is_valid
        assert ("finds no cause" in text) != is_valid


def test_a_rating_is_never_a_cause():
    why = {
        "verdict": "named", "sentence": "The car weighed 262 kg more.", "caution": "", "next_manoeuvre": None,
        "causes": [{"effect": "payload_mass", "where": None, "key": "payload_mass", "sentence": "The car weighed 262 kg more.",
                    "probability": 0.99}],
    }  # fmt: skip
    d = document(why=why)
    text = report_text(validation_report(FOUND, d))
    head, _, rest = text.partition("why: the verdict of diagnose")
    assert "97 %" in head
    first = rest.split("where it is valid")[0]
    assert first.count("The car weighed 262 kg more.") == 1
    assert "rating" not in first.lower()
    assert "A rating stands beside the boundaries." in rest
    assert "none of a standard's" in rest
    assert d["diagnosis"]["causes"][0]["key"] == "payload_mass"
    order = [text.index(x) for x in ("boundaries by the method", "ratings by the method")]
    assert order == sorted(order)
    other = report_text(validation_report(FOUND, document(method="18571")))
    assert other.index("ratings by the method") < other.index("boundaries by the method")
