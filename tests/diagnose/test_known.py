"""What is known of a car before a diagnosis: faults in its file, and how sure the file's own values are."""

import re
from dataclasses import replace

import polars as pl
import pytest

from aqualog.core.notation import WHEELS
from aqualog.core.vehicle import Known, Provenance
from aqualog.diagnose.run import diagnose
from tests.diagnose.test_drive import CAR, changed, term
from tests.diagnose.test_run import FEW, QUICK, ask, few, noisy  # noqa: F401 - `few` is a fixture

LATE = replace(CAR, known={"signal_delay@v_x": Known({"delay": 0.10}, 0.01)})


def told(car, *terms, model=None):
    return diagnose([("a", noisy(*terms))], car, model=model, options=QUICK)


def delay(seconds):
    return term("signal_delay", "v_x", delay=seconds)


@pytest.mark.parametrize("seconds", [0.10, 0.11])
def test_a_known_fault_is_no_cause_but_noted_and_in_the_model(seconds):
    d = told(LATE, delay(seconds))
    assert d.verdict == "no_effect"
    assert "Known: signal delay (reference velocity): delay 0.1 s." in d.notes
    assert [(t.effect.name, t.where, t.values) for t in d.model.terms] == [("signal_delay", "v_x", {"delay": 0.10})]


@pytest.mark.parametrize("seconds", [0.25, 0.0])
def test_a_known_fault_that_grew_or_is_gone_is_a_cause_with_its_new_value(seconds):
    d = told(LATE, delay(seconds))
    assert [c.key for c in d.causes] == ["signal_delay@v_x"]
    assert d.causes[0].parameters["delay"].value == pytest.approx(seconds, abs=0.015)
    assert len(d.model.terms) == 1


def test_a_given_model_knows_better():
    d = told(LATE, delay(0.25), model=type(told(LATE).model)((delay(0.25),)))
    assert (d.verdict, [t.values["delay"] for t in d.model.terms]) == ("no_effect", [0.25])
    assert not [n for n in d.notes if n.startswith("Known")]


UNSURE = {**CAR.provenance, **{k: Provenance("guess") for k in ("torque_gain", "wheels.r_e_f", "wheels.r_e_r")}}


@pytest.mark.parametrize("gain", [0.9, 1.1])
def test_a_guess_that_is_far_off_gets_no_name(monkeypatch, gain):
    ask(
        monkeypatch, (*FEW, "torque_gain", "trailer", *(f"tyre_radius@{w}" for w in ("f", "r", "fl", "fr", "rl", "rr")))
    )
    off = {"torque_gain": gain, "r_e_f": CAR.r_e_f * 1.01, "r_e_r": CAR.r_e_r * 1.01}
    log = noisy()  # a reader multiplies its torques with the file's gain
    log = changed(log, log.frame.with_columns(pl.col(f"torque_{w}") * gain for w in WHEELS))
    d = diagnose([("a", log)], replace(CAR, **off, provenance=UNSURE), options=QUICK)
    assert (d.verdict, d.causes) == ("no_effect", ())
    assert sum("The verdict holds with those that fit best: " in n for n in d.notes) == 1
    assert " This holds with values that the vehicle file allows: " in d.sentence
    assert re.search(r"torque gain [\d.]+% (larger|smaller) \([\d.]+ standard deviations\)", d.sentence)
