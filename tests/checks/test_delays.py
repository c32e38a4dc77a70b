"""A signal of the car's motion that comes late is named, with by how much."""

import numpy as np
import pytest

from aqualog.checks.look import look
from tests.checks.made import CAR, DT, made, signals

WHEELS = ("omega_fl", "omega_fr", "omega_rl", "omega_rr")
TORQUES = ("torque_rl", "torque_rr")


def found(columns, drop=TORQUES):
    return {d.signals: d for d in look(signals(columns, drop=drop), CAR) if d.kind == "delay"}


def delayed(columns, names, seconds):
    k = round(abs(seconds) / DT)
    late = {n: np.concatenate([np.full(k, columns[n][0]), columns[n][: columns[n].size - k]]) for n in names}
    return {**columns, **late}


@pytest.mark.parametrize("seconds", [0.3, 0.5, 1.2])
@pytest.mark.parametrize("names", [("v_x",), ("a_x",), WHEELS])
def test_the_late_one_of_three(names, seconds):
    (doubt,) = found(delayed(made(seed=1), names, seconds)).values()
    assert doubt.signals == names
    assert doubt.value == pytest.approx(seconds, abs=0.1)
    assert "after" in doubt.what


def test_one_that_comes_before_the_others():
    columns = made(seed=4)
    (doubt,) = found(delayed(columns, ("v_x", *WHEELS), 0.6)).values()
    assert doubt.signals == ("a_x",)
    assert doubt.value == pytest.approx(-0.6, abs=0.1)
    assert "a_x comes 0.6 s before v_x and the wheel speeds" in doubt.what


def test_a_torque_is_compared_where_the_car_is_driven_not_braked():
    columns = made(seed=1, accelerating=0.4)
    (doubt,) = found(delayed(columns, TORQUES, 0.4), drop=()).values()
    assert doubt.signals == ("torque_r",)
    assert doubt.value == pytest.approx(0.4, abs=0.1)
    assert not found(columns, drop=())


def test_of_two_alone_either_may_be_wrong():
    (doubt,) = found(delayed(made(seed=3), ("a_x",), 0.5), drop=WHEELS + TORQUES).values()
    assert set(doubt.signals) == {"a_x", "v_x"}


@pytest.mark.parametrize("seed", range(4))
def test_nothing_where_all_fit_or_little_moves(seed):
    assert not found(made(seed=seed))
    assert not found(delayed(made(seed=seed), ("v_x",), 0.1))
    assert not found(delayed(made(seed=seed, accelerating=0.05), ("a_x",), 0.5))
    assert not found(delayed(made(seconds=30.0, seed=seed), ("a_x",), 0.5))
    half = made(seed=seed)
    later = delayed(half, ("a_x",), 0.6)
    n = half["a_x"].size // 2
    assert not found({**half, "a_x": np.concatenate([half["a_x"][:n], later["a_x"][n:]])})  # a clock that jumped
