"""A turned signal is named; where the log cannot tell which one is turned, that is said."""

import pytest

from aqualog.checks.look import look
from tests.checks.made import CAR, made, signals

TURNING = ("a_y", "yaw_rate", "steer_angle")
WHEELS = tuple(f"omega_{w}" for w in ("fl", "fr", "rl", "rr"))
DRIVE = made()


def said(columns=DRIVE, **how):
    return [(r.signals, r.lines) for r in look(signals(columns, **how), CAR) if r.kind == "sign"]


def line(symbol):
    return f'{symbol} = {{ channel = "{symbol}", scale = -1.0 }}'


@pytest.mark.parametrize(
    "turned",
    [(), ("a_x",), ("a_y",), ("yaw_rate",), ("steer_angle",), ("a_y", "yaw_rate"), TURNING, ("a_x", "a_y", "steer_angle")],
)  # fmt: skip
def test_with_wheels_the_turned_signals_are_named(turned):
    assert said(turned=turned) == [((s,), (line(s),)) for s in sorted(turned)]


@pytest.mark.parametrize("turned", ["a_y", "yaw_rate"])
def test_without_wheels_the_odd_one_of_three_is_turned(turned):
    assert said(drop=WHEELS, turned=(turned,)) == [((turned,), (line(turned),))]


def test_a_turned_imu_and_turned_steering_look_alike():
    ((names, lines),) = said(drop=WHEELS, turned=("steer_angle",))
    assert names == tuple(sorted(TURNING))
    assert set(lines) == {line(s) for s in TURNING}
    (remark,) = look(signals(DRIVE, drop=WHEELS, turned=("steer_angle",)), CAR)
    assert "does not show which" in remark.what
    assert " or " in remark.advice


@pytest.mark.parametrize(("one", "other"), [("a_y", "yaw_rate"), ("steer_angle", "yaw_rate")])
def test_of_two_signals_none_is_named(one, other):
    (third,) = set(TURNING) - {one, other}
    ((names, _),) = said(drop=(*WHEELS, third), turned=(one,))
    assert names == tuple(sorted((one, other)))


def test_swapped_wheels():
    swapped = {**DRIVE, "omega_fl": DRIVE["omega_fr"], "omega_fr": DRIVE["omega_fl"]}
    (remark,) = look(signals(swapped), CAR)
    assert remark.signals == ("omega_fl", "omega_fr")
    assert "swap the channels of omega_fl and omega_fr" in remark.advice


def test_front_wheels_alone_do_not_outvote_three_signals_that_agree():
    swapped = {**DRIVE, "omega_fl": DRIVE["omega_fr"], "omega_fr": DRIVE["omega_fl"]}
    (remark,) = look(signals(swapped, drop=("omega_rl", "omega_rr")), CAR)
    assert "does not show which" in remark.what
    assert "swap the channels of omega_fl and omega_fr" in remark.advice
    assert set(remark.lines) == {line(s) for s in TURNING}


@pytest.mark.parametrize(
    "how",
    [
        {"turning": 0.0005, "accelerating": 0.02},  # straight on, at one speed
        {"seconds": 25.0},
        {"bank": 0.9}, {"bank": 2.0, "one_way": True, "turning": 0.03},
        {"stops": 3}, {"v": 6.0, "seconds": 60.0},
    ],
)  # fmt: skip
@pytest.mark.parametrize("seed", range(3))
def test_sound_drives_have_no_remark(how, seed):
    assert look(signals(made(seed=seed, **how)), CAR) == ()


def test_too_little_driving_is_not_judged():
    assert said(made(seconds=600.0, turning=0.002, accelerating=0.02), turned=("a_x", "yaw_rate")) == []


def test_a_driver_who_steers_against_a_slide_has_no_turned_steering():
    """Braking on snow: the axles slip, and the steering follows the yaw rate with the opposite sign."""
    slides = {n: x * (1.08 if n in ("omega_fl", "omega_fr") else 1.0) for n, x in DRIVE.items()}
    assert said({**slides, "steer_angle": -0.1 * DRIVE["yaw_rate"]}) == []
