"""A new effect is one row: everything that asks about effects finds it there."""

import pytest

from aqualog.book.reference.model import effects_page
from aqualog.diagnose.drive import prepare
from aqualog.diagnose.hypotheses import hypotheses
from aqualog.diagnose.manoeuvres import checks
from aqualog.diagnose.records import Estimate
from aqualog.diagnose.words import cause_sentence, name_of
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Check, DayToDay, DriveSearch, Effect, Model, Parameter, Term
from aqualog.report.diagnosis.words import effect_title
from tests.diagnose.test_drive import CAR, plain

OPEN_WINDOW = Effect(
    "open_window", "drag area c_w A [m²]", "Open windows added {area:.2f} m² of drag area.", "0.02-0.05 (K)",
    (Parameter("area", "m^2", 0.0, 0.02, 0.0, 0.3, 0.01, "of all windows", DayToDay("drag", lambda sd, *_: sd)),),
    lambda setup, v, _: setup._replace(plant=setup.plant._replace(drag_area=setup.plant.drag_area + v["area"])),
    twins=("aero_drag",),
    drive=DriveSearch(("wheel torque",), tolerance=0.004, check=Check("look", "Look", 1.0, (None,), "area", 0.001)),
)  # fmt: skip


@pytest.fixture(autouse=True)
def row(monkeypatch):
    monkeypatch.setitem(EFFECTS, "open_window", OPEN_WINDOW)


def test_a_new_row_is_searched_for_with_its_own_facts():
    asked, _ = hypotheses([prepare(plain(), CAR, "a")], Model())
    h = next(h for h in asked if h.key == "open_window")
    assert (h.free, h.tolerance("area"), h.worth_naming("area")) == (("area",), 0.004, 0.01)
    assert h.parameter("area").day_to_day.kind == "drag"
    assert [c.name for c in checks(frozenset({"open_window", "payload_mass"}))] == ["look", "weighing"]


def test_a_new_row_is_named_in_words_and_report():
    text = cause_sentence(OPEN_WINDOW, None, {"area": Estimate(0.05, 0.04, 0.06, "m^2")})
    assert text == "Open windows added 0.05 m² of drag area; 95 % interval 0.040 to 0.060 m²."
    assert name_of("open_window", None) == effect_title("open_window") == "open window"


def test_a_new_row_is_in_the_reference_and_can_stand_in_a_model():
    assert "open_window" in effects_page()
    assert Model((Term(EFFECTS["open_window"], {"area": 0.05}),)).terms[0].effect is OPEN_WINDOW
