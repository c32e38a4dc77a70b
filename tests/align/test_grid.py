import numpy as np
import pytest

from aqualog.align.clean import Span
from aqualog.align.grid import Grid, between_samples, bin_mean, common_clock, gap_limit_ns, hold, linear, placed
from aqualog.align.mapping import SignalMap
from aqualog.core.errors import SignalError

MS = 1_000_000
EPOCH = 1_760_000_000_000_000_000


def grid(n, dt=10 * MS, start=EPOCH):
    return start + np.arange(n, dtype=np.int64) * dt


def test_linear_is_exact_on_a_line_at_epoch_times():
    t = grid(11, 100 * MS)
    y, bridged = linear(t, np.arange(11.0), grid(101), gap_ns=500 * MS)
    assert y == pytest.approx(np.arange(101) / 10.0, abs=1e-12)
    assert not bridged.any()


def test_how_far_the_grid_lies_between_the_samples():
    def of(late, period=10 * MS):
        first = EPOCH + round(late * period)
        return between_samples(Span(first, first + 999 * period, 1000, period, period), Grid(EPOCH, 1000, 10 * MS))

    assert of(0.0) == 0.0
    assert of(0.25) == pytest.approx(0.25 * 0.75)
    assert of(0.0, 10 * MS + 30_000) == pytest.approx(1.0 / 6.0, abs=1e-3)  # three samples behind in the end
    assert of(0.3, 2 * MS) == 0.0  # means


def test_no_extrapolation():
    y, _ = linear(grid(5, start=EPOCH + 20 * MS), np.ones(5), grid(10), gap_ns=500 * MS)
    assert np.flatnonzero(y == 1.0).tolist() == [2, 3, 4, 5, 6]
    assert np.isnan(y[[0, 1, 7, 8, 9]]).all()
    for t in (grid(0), grid(5, start=EPOCH + 1000 * MS)):
        assert np.isnan(linear(t, np.ones(t.size), grid(5), gap_ns=MS)[0]).all()


def test_long_gaps_stay_open_and_short_ones_are_bridged():
    t = np.delete(grid(100), np.r_[20:22, 50:70])
    y, bridged = linear(t, np.arange(100.0)[np.r_[0:20, 22:50, 70:100]], grid(100), gap_ns=50 * MS)
    assert (y[20:22] == [20.0, 21.0]).all()
    assert np.isnan(y[50:70]).all()
    assert bridged[np.r_[20:22, 50:70]].all()
    assert not bridged[:20].any()


def test_hold_takes_the_last_value_and_no_longer_than_allowed():
    t = EPOCH + np.array([0, 30 * MS], dtype=np.int64)
    y = hold(t, np.array([1.0, 2.0]), grid(20), gap_ns=100 * MS)
    assert (y[:3] == 1.0).all()
    assert (y[3:14] == 2.0).all()
    assert np.isnan(y[14:]).all()


def test_bin_mean_is_the_mean_of_the_bin():
    rng = np.random.default_rng(0)
    t = grid(1000, MS)
    x = rng.normal(size=1000)
    g = grid(99, 10 * MS, EPOCH + 10 * MS)
    y, _ = bin_mean(t, x, g, dt_ns=10 * MS, gap_ns=50 * MS)
    expected = [x[(t >= a - 5 * MS) & (t < a + 5 * MS)].mean() for a in g]
    assert y == pytest.approx(expected, abs=1e-12)


def test_bin_mean_suppresses_aliases():
    t = grid(10000, MS)
    x = np.sin(2 * np.pi * 100.0 * np.arange(10000) * 1e-3)  # falls onto the 100 Hz grid as a constant
    y, _ = bin_mean(t, x, grid(990, 10 * MS, EPOCH + 12 * MS), dt_ns=10 * MS, gap_ns=50 * MS)
    assert np.nanmax(np.abs(y)) < 1e-9


def test_gap_limits():
    assert gap_limit_ns(10 * MS, is_state=False) == 50 * MS
    assert gap_limit_ns(100 * MS, is_state=False) == 500 * MS
    assert gap_limit_ns(10 * MS, is_state=True) == 2000 * MS


@pytest.mark.parametrize("seed", range(12))
def test_points_are_placed_by_the_step_as_by_a_search(seed):
    rng = np.random.default_rng(seed)
    dt, m = int(rng.integers(1, 50)), int(rng.integers(1, 60))
    points = (EPOCH if seed % 3 == 0 else -500) + np.arange(m, dtype=np.int64) * dt
    if seed % 2:
        t = np.unique(points[0] + rng.integers(-100, m * dt + 100, size=int(rng.integers(1, 80))))
    elif seed % 4:  # beside the points
        t = points + int(rng.integers(0, dt))
    else:  # a raster with holes
        t = np.sort(rng.choice(points, size=int(rng.integers(1, m + 1)), replace=False))
    for one, other in zip(placed(t, points), placed(t, points, dt), strict=True):
        np.testing.assert_array_equal(one, other)
    x = rng.normal(size=t.size)
    last = np.searchsorted(t, points, side="right") - 1
    held = np.where(last >= 0, x[last], np.nan)
    np.testing.assert_array_equal(hold(t, x, points, gap_ns=1 << 40), held)
    is_inside = (t[0] <= points) & (points <= t[-1])
    y = np.where(is_inside, np.interp(points - points[0], t - points[0], x), np.nan)
    np.testing.assert_allclose(linear(t, x, points, gap_ns=1 << 40)[0], y, rtol=1e-12, atol=1e-12)


def test_clocks_that_share_nothing_are_answered_with_the_files_that_have_a_speed():
    clocks = [("can.mf4", False), ("wheels.csv", True), ("gyro.csv", True)]
    with pytest.raises(SignalError) as error:
        common_clock(clocks, SignalMap(), with_speed={"can.mf4", "wheels.csv"}, dbc=["my car.dbc"])
    assert "`aqualog align wheels.csv can.mf4 --dbc 'my car.dbc' --write-map map.toml`" in error.value.hint
    with pytest.raises(SignalError) as error:  # without a speed on both sides another quantity may do
        common_clock(clocks, SignalMap(), with_speed={"can.mf4"})
    assert "`aqualog align gyro.csv wheels.csv can.mf4 --write-map" in error.value.hint
