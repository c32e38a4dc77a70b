"""The boundaries of ISO 19364, against points worked out by hand."""

import numpy as np
import pytest

from aqualog.validate.boundary import Tolerance, beyond, boundary

T = Tolerance(x_offset=3.0, y_offset=4.0)


def a(*values):
    return np.array(values, dtype=float)


def test_on_a_level_line_the_boundary_is_eps_y_away():
    found = boundary(a(0, 1, 2), a(5, 5, 5), T)
    assert found.top_x == pytest.approx([0, 1, 2])
    assert found.top_y == pytest.approx([9, 9, 9])
    assert found.bottom_y == pytest.approx([1, 1, 1])


def test_a_slope_of_one():
    # dx = dy = 1: D = sqrt(4² + 3²) = 5; top = (x - 9/5, y + 16/5)
    found = boundary(a(0, 1), a(0, 1), T)
    assert found.top_x == pytest.approx([-1.8, -0.8])
    assert found.top_y == pytest.approx([3.2, 4.2])
    assert found.bottom_x == pytest.approx([1.8, 2.8])
    assert found.bottom_y == pytest.approx([-3.2, -2.2])


def test_a_steep_line_is_eps_x_away():
    # dx = 0, dy = 2: D = 6; top = (x - 2·9/6, y)
    found = boundary(a(1, 1), a(0, 2), T)
    assert found.top_x == pytest.approx([-2, -2])
    assert found.top_y == pytest.approx([0, 2])


def test_gains_go_with_the_size_of_the_value():
    own = Tolerance(0.1, 0.5, 0.2, 0.25)
    found = boundary(a(-4, -2), a(-8, -8), own)
    assert found.top_y == pytest.approx([-8 + 2.2] * 2)  # 0.2 + 0.25·8
    assert own.along_x(a(-4)) == pytest.approx([2.1])


def test_a_point_that_stays_takes_the_way_before():
    found = boundary(a(0, 1, 1, 2), a(0, 0, 0, 0), T)
    assert found.top_y == pytest.approx([4, 4, 4, 4])
    assert np.isnan(boundary(a(1), a(1), T).top_y).all()


def test_beyond_is_zero_within_and_signed_outside():
    x, y = np.arange(0.0, 11.0), np.zeros(11)
    assert beyond(x, y, T, a(5, 5, 5, 5), a(3.9, 4.5, -7, np.nan)) == pytest.approx([0, 0.5, -3, np.nan], nan_ok=True)


def test_the_strip_of_a_slope_is_that_of_the_formula():
    # over a line of slope 1 the boundary is sqrt(4² + 3²) = 5 above, measured along y
    x = np.linspace(0.0, 40.0, 41)
    assert beyond(x, x, T, a(20, 20, 20), a(24.98, 26, 14)) == pytest.approx([0, 1, -1], abs=0.01)


def test_the_boundary_of_a_curve_is_where_points_begin_to_lie_beyond():
    x = np.linspace(0.0, 6.0, 301)
    y, own = np.sin(x), Tolerance(0.1, 0.0, 0.2, 0.0)
    edge = boundary(x, y, own)
    middle = slice(20, -20)
    just_in = beyond(x, y, own, edge.top_x[middle], edge.top_y[middle] - 2e-3)
    just_out = beyond(x, y, own, edge.top_x[middle], edge.top_y[middle] + 2e-3)
    assert (just_in == 0.0).all()
    assert (just_out > 0.0).all()


def test_a_jump_may_come_a_little_later():
    t = np.arange(0.0, 4.0, 0.1)
    simulated, late = (t >= 2.0).astype(float), (t >= 2.2).astype(float)
    assert (beyond(t, simulated, Tolerance(0.3, 0.0, 0.05, 0.0), t, late) == 0.0).all()
    assert (beyond(t, simulated, Tolerance(0.05, 0.0, 0.05, 0.0), t, late) != 0.0).sum() == 2


def test_a_gap_of_the_curve_is_not_bridged():
    x, y = a(0, 1, 2, 10, 11, 12), a(0, 0, np.nan, 0, 0, 0)
    found = beyond(x, y, Tolerance(0.5, 0.0, 1.0, 0.0), a(0.5, 5, 11), a(0, 0, 0))
    assert found == pytest.approx([0, np.nan, 0], nan_ok=True)
