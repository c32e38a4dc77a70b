import numpy as np
import pytest

from aqualog.core.notation import WHEELS
from aqualog.detect.braking import UNLOGGED, BrakeWatch, began_free, hold_on, is_braking
from tests.drives import CAR


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


@pytest.mark.parametrize(("torque", "known", "expected"), [
    ({"fl": -400.0}, WHEELS, ["fl"]),  # stability control
    ({"fl": -400.0, "fr": -40.0, "rl": -150.0, "rr": -30.0}, WHEELS, [*WHEELS]),  # a driver with antilock brakes
    ({"rl": -400.0}, ("rl", "rr"), [*WHEELS]),  # torques of the driven axle do not know the brakes
])  # fmt: skip
def test_a_pressure_brakes_the_wheels_that_torques_say(torque, known, expected):
    f = {"a_kin_slow": np.full(3, -1.0), "brake_pressure": np.full(3, 1e6)}
    columns = {f"torque_{w}": np.full(3, torque.get(w, 0.0)) for w in known}
    braking = BrakeWatch(CAR, 0.01).push(f, columns)
    assert [w for w in WHEELS if braking[w].all()] == expected
    assert not any(braking[w].any() for w in WHEELS if w not in expected)


@pytest.mark.parametrize(("bar", "offset", "logged", "expected"), [
    (1.0, 0.0, 0.0, True), (1.0, 2.0, 0.0, True), (0.3, 2.0, 0.0, False), (1.0, 0.0, 1.0, False), (1.0, 0.0, 0.4, True),
])  # fmt: skip
def test_a_light_braking_that_no_torque_knows(bar, offset, logged, expected):
    """2 s of driving, 4 s of overrun, then the brake: the released pressure is learnt, and what the torque holds of it."""
    t = np.arange(1200) * 0.01
    push, pressed = np.where(t < 2.0, 0.5, -0.7), np.where(t > 6.0, bar + 0.2 * np.sin(t), 0.0)
    slows = 0.15 * pressed
    columns = {f"torque_r{s}": 0.5 * CAR.mass * CAR.r_e_r * (push - logged * slows) for s in "lr"}
    f = {"a_kin_slow": push - slows, "brake_pressure": 1e5 * (pressed + offset), "delta_a_x": (1.0 - logged) * slows}
    whole, watch = BrakeWatch(CAR, 0.01).push(f, columns)[UNLOGGED], BrakeWatch(CAR, 0.01)
    pieces = [[{n: x[a : a + 7] for n, x in d.items()} for d in (f, columns)] for a in range(0, 1200, 7)]
    assert (np.concatenate([watch.push(*piece)[UNLOGGED] for piece in pieces]) == whole).all()
    assert not whole[:600].any()
    assert whole[900:].all() if expected else not whole[900:].any()
