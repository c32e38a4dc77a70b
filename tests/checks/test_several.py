"""A fault that many drives have is said once; offsets are taken off where that is asked for."""

import numpy as np
import pytest

from aqualog.checks.correct import without_offsets
from aqualog.checks.look import look
from aqualog.checks.several import look_at_all, sentences
from tests.checks.made import CAR, made, signals

DRIVES = {n: signals(made(seed=i), turned=("a_y",)) for i, n in enumerate(("one.csv", "two.csv", "three.csv"))}


def test_a_fault_of_all_drives_is_one_sentence():
    found = look_at_all({**DRIVES, "sound.csv": signals(made(seed=9))}, CAR)
    assert [name for name, _ in found] == list(DRIVES)
    (sentence,) = sentences(found)
    assert sentence.startswith("one.csv: a_y has the opposite sign of ")
    assert sentence.endswith("(and in 2 more)")
    assert look_at_all(DRIVES, CAR, but=("sign",)) == ()
    assert sentences(found[:1])[0].endswith("}")


def test_offsets_are_taken_off():
    before = signals(made(stops=3, a_x_offset=-1.5, yaw_rate_offset=0.03))
    after = without_offsets(before, CAR)
    for symbol, value in (("a_x", -1.5), ("yaw_rate", 0.03)):
        taken = before.array(symbol) - after.array(symbol)
        assert np.ptp(taken) < 1e-12
        assert taken[0] == pytest.approx(value, rel=0.15)
    np.testing.assert_array_equal(after.array("a_y"), before.array("a_y"))
    assert [n.split(" is taken off")[0].split(": ")[0] for n in after.quality.notes] == ["a_x", "yaw_rate"]
    assert look(after, CAR) == ()


@pytest.mark.parametrize(
    ("how", "why"), [({}, "does not stand"), ({"stops": 1, "a_x_offset": 0.3}, "the slope of a road")]
)
def test_without_an_offset_the_signals_stay(how, why):
    before = signals(made(**how))
    after = without_offsets(before, CAR)
    assert after.frame.equals(before.frame)
    (note,) = after.quality.notes
    assert why in note
