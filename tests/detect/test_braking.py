import numpy as np
import pytest

from aqualog.detect.braking import began_free, hold_on, is_braking


def bits(text):
    return np.array([c == "1" for c in text])


@pytest.mark.parametrize(
    ("active", "braking", "expected"),
    [
        ("0111100", "0001100", "0111100"),  # braked after it began: stays
        ("0111100", "0111100", "0000000"),  # began under braking: never counts
        ("0111100", "0110000", "0000000"),  # not even when the brake is released
        ("0110110", "0100000", "0000110"),  # the next one is judged by itself
    ],
)
def test_detections_that_began_without_braking(active, braking, expected):
    whole, _ = began_free(bits(active), bits(braking), (False, False))
    assert (whole == bits(expected)).all()
    state, parts = (False, False), []
    for a, b in zip(bits(active), bits(braking), strict=True):
        part, state = began_free(np.array([a]), np.array([b]), state)
        parts.append(part[0])
    assert (np.array(parts) == whole).all()


def test_brake_pressure_decides_where_there_is_one():
    a_kin, torque = np.array([-3.0, -3.0, 0.0]), np.array([-0.2, -0.2, 0.0])
    assert is_braking(a_kin, None, torque).tolist() == [True, True, False]
    assert is_braking(a_kin, np.array([0.0, np.nan, 2e6]), torque).tolist() == [False, True, True]
    assert is_braking(np.array([-0.5]), None, np.array([-0.06])).tolist() == [False]  # lifting off


def test_hold():
    assert hold_on(bits("0100000"), 0, seconds=0.02, dt=0.01)[0].tolist() == bits("0110000").tolist()
