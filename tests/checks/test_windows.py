"""Windows are the same however a drive is cut."""

import numpy as np
import pytest

from aqualog.checks.windows import Gather, middle
from aqualog.core.vehicle import Vehicle

CAR = Vehicle()
N = 1037


@pytest.fixture(scope="module")
def columns():
    rng = np.random.default_rng(1)
    names = ("v_x", "a_x", "omega_fl", "omega_rr", "torque_rl", "torque_rr")
    found = {n: rng.standard_normal(N) for n in names}
    found["a_x"][100:180] = np.nan
    return found


def gathered(columns, size, dt=0.01):
    gather = Gather(columns, CAR, dt)
    for a in range(0, N, size):
        gather.push({n: x[a : a + size] for n, x in columns.items()})
    return gather.windows()


@pytest.mark.parametrize("size", [1, 7, 64, 1000])
def test_pieces_give_what_the_whole_gives(columns, size):
    whole, pieces = gathered(columns, N), gathered(columns, size)
    assert set(whole.columns) == {"v_x", "a_x", "v_fl", "v_rr", "torque_r"}
    for name, x in whole.columns.items():
        np.testing.assert_array_equal(x, pieces[name])


def test_a_window_is_the_mean_of_what_is_known(columns):
    found = gathered(columns, N)
    assert found.step_s == 0.5
    assert found["a_x"].size == N // 50
    np.testing.assert_allclose(found["v_fl"][3], CAR.r_e_f * columns["omega_fl"][150:200].mean())
    np.testing.assert_allclose(found["torque_r"][3], (columns["torque_rl"] + columns["torque_rr"])[150:200].mean())
    assert np.isnan(found["a_x"][2:3]).all()  # 100 to 150: nothing is known
    assert np.isnan(found["a_x"][3])  # 30 of 50 are missing
    assert np.isfinite(found["a_x"][[1, 4]]).all()


def test_the_middle_of_those_that_are_known():
    nan = np.nan
    rows = [
        np.array(x) for x in ([1.0, nan, nan, 4.0], [3.0, 2.0, nan, 1.0], [8.0, nan, nan, 2.0], [2.0, 6.0, nan, nan])
    ]
    np.testing.assert_array_equal(middle(rows), [2.5, 4.0, nan, 2.0])
