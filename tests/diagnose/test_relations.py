"""Relations of three effects: which sets they make equal, and that a log that cannot part them says so."""

import pytest

from aqualog.diagnose import run
from aqualog.diagnose.isolate import imitations
from tests.diagnose.test_run import ask, few, keys, noisy, term, told  # noqa: F401 - `few` is a fixture
from tests.diagnose.test_subsets import ASKED, AT, hypothesis

BIAS, SLOPE, ROLLING = (AT[k] for k in ("accelerometer_bias@a_x", "road_grade", "rolling_resistance"))
MASS = AT["payload_mass"]


def as_sets(found):
    return {frozenset(x) for x in found}


def test_one_of_three_is_what_the_other_two_are():
    assert as_sets(imitations(ASKED, [BIAS])) == {frozenset((SLOPE, ROLLING))}
    assert as_sets(imitations(ASKED, [SLOPE, MASS])) == {frozenset((BIAS, ROLLING, MASS))}


def test_two_of_three_are_any_other_two():
    assert as_sets(imitations(ASKED, [BIAS, SLOPE])) == {frozenset((BIAS, ROLLING)), frozenset((SLOPE, ROLLING))}


def test_a_set_beside_the_relation_has_no_like():
    assert imitations(ASKED, [MASS]) == []


def test_what_is_not_asked_about_is_in_no_set():
    assert imitations([ASKED[BIAS], ASKED[SLOPE]], [0]) == []


def test_a_dragging_brake_is_a_rolling_resistance_in_the_relation():
    brake = hypothesis("brake_drag")
    asked = [ASKED[BIAS], ASKED[SLOPE], ASKED[ROLLING], brake]
    assert as_sets(imitations(asked, [0])) == {frozenset((1, 2)), frozenset((1, 3))}
    assert as_sets(imitations(asked, [1, 3])) == {frozenset((0, 1)), frozenset((0, 3))}


@pytest.mark.parametrize(
    "hidden",
    [
        term("accelerometer_bias", "a_x", bias=0.05),
        pytest.param(term("road_grade", grade=0.005), marks=pytest.mark.nightly),
    ],
)
def test_a_log_that_cannot_part_three_lists_them(monkeypatch, hidden):
    three = ("accelerometer_bias@a_x", "road_grade", "rolling_resistance")
    # radii are not known to the millimetre: else the slip that rolling costs would part them
    radii = [f"tyre_radius@{w}" for w in ("fl", "fr", "rl", "rr")]
    monkeypatch.setattr(run, "next_manoeuvre", lambda *_: None)
    ask(monkeypatch, (*three, "rolling_resistance@f", "rolling_resistance@r", *radii))
    d = told(log=noisy(hidden))
    assert d.verdict == "cannot_tell"
    assert keys(d) == set(three)
    assert {len(a.causes) for a in d.alternatives} == {2}
