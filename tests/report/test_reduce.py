"""Reduced signals draw the same picture: spikes, gaps and single bits stay."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aqualog.core.records import Event
from aqualog.report import reduce

N = 360_000


def noise(n=N, seed=1):
    return np.random.default_rng(seed).normal(0.0, 0.1, n)


def event(start, end):
    return Event("spin_down", "fl", "left", start, end, "partial", 1.0, 0.6, {})


@pytest.mark.parametrize("at", [0, 1, 77_777, 180_000, N - 2, N - 1])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_spike_of_one_sample_stays(at, sign):
    y = noise()
    y[at] = sign * 5.0
    kept = reduce.reduce_indices(y)
    assert at in kept
    assert kept.size <= reduce.POINTS + 2


def test_both_spikes_of_one_stretch_stay():
    y = noise()
    y[1000], y[1003] = 5.0, -5.0
    assert {1000, 1003} <= set(reduce.reduce_indices(y).tolist())


def test_gaps_stay_gaps_and_spikes_beside_them_stay():
    y = noise()
    y[50_000:60_000] = np.nan
    y[100_000:100_010] = np.inf
    y[49_999], y[60_000] = 4.0, -4.0
    kept = reduce.reduce_indices(y)
    inside = (kept >= 50_000) & (kept < 60_000)
    assert inside.sum() == 1
    assert ((kept >= 100_000) & (kept < 100_010)).sum() == 1
    assert {49_999, 60_000} <= set(kept.tolist())
    # the line reaches to the gap on both sides, so its length on the page is right
    assert np.isfinite(y[[49_999, 60_000]]).all()


def test_countless_gaps_do_not_blow_up_the_page():
    y = noise()
    y[::2] = np.nan
    y[200_001] = 9.0
    y[300_000:310_000] = np.nan
    kept = reduce.reduce_indices(y)
    assert kept.size < 3 * reduce.POINTS
    assert 200_001 in kept
    assert np.isnan(y[kept[(kept >= 300_000) & (kept < 310_000)]]).any()


@pytest.mark.parametrize("y", [np.empty(0), np.full(N, np.nan), np.zeros(N), np.array([1.0])])
def test_odd_signals(y):
    kept = reduce.reduce_indices(y)
    assert kept.size <= reduce.POINTS + 2
    assert np.all(np.diff(kept) > 0)


@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 2**32 - 1), st.integers(200, 3000), st.floats(0.0, 0.5), st.integers(20, 200).map(lambda k: 2 * k)
)
def test_extremes_and_order_for_any_signal(seed, n, share, points):
    rng = np.random.default_rng(seed)
    y = rng.normal(size=n)
    y[rng.random(n) < share] = np.nan
    kept = reduce.reduce_indices(y, points)
    assert np.all(np.diff(kept) > 0)
    assert kept.size == 0 or (kept[0] >= 0 and kept[-1] < n)
    if np.isfinite(y).any():
        assert np.nanmax(y[kept]) == np.nanmax(y)
        assert np.nanmin(y[kept]) == np.nanmin(y)


def test_bits_become_spans_and_none_is_lost():
    bits = np.zeros(N, dtype=bool)
    bits[[0, 5, 6, N - 1]] = True
    assert reduce.spans_of(bits).tolist() == [[0, 1], [5, 7], [N - 1, N]]
    bits[::3] = True
    few = reduce.spans_of(bits, at_most=100)
    assert len(few) <= 100
    covered = np.zeros(N, dtype=bool)
    for a, b in few:
        covered[a:b] = True
    assert covered[bits].all()


def test_lone_bits_stay_apart_when_others_are_joined():
    bits = np.zeros(N, dtype=bool)
    bits[1000:9000:2] = True
    bits[200_000] = True
    assert [200_000, 200_001] in reduce.spans_of(bits, at_most=10).tolist()


def test_merge_spans():
    spans = np.array([[10, 20], [0, 5], [18, 30], [30, 31], [12, 13]])
    assert reduce.merge_spans(spans).tolist() == [[0, 5], [10, 31]]
    assert reduce.merge_spans(spans, 5).tolist() == [[0, 31]]
    assert reduce.merge_spans(np.empty((0, 2), dtype=np.int64)).shape == (0, 2)


def test_short_drive_is_kept_whole():
    plan = reduce.make_plan([event(1.0, 2.0)], reduce.ALL_SAMPLES, 0.01)
    assert plan.is_complete
    assert not reduce.make_plan([], reduce.ALL_SAMPLES + 1, 0.01).is_complete
    assert reduce.make_plan([], 0, 0.01).windows.shape == (0, 2)


def test_windows_hold_the_events_with_margin():
    plan = reduce.make_plan([event(100.0, 101.0), event(0.5, 1.0)], N, 0.01)
    assert plan.windows.tolist() == [[0, 401], [9700, 10401]]


def test_windows_are_bounded():
    many = reduce.make_plan([event(20.0 * k, 20.0 * k + 1.0) for k in range(170)], N, 0.01)
    assert many.events_in_full == reduce.MAX_WINDOWS
    assert len(many.windows) == reduce.MAX_WINDOWS
    fast = reduce.make_plan([event(20.0 * k, 20.0 * k + 1.0) for k in range(170)], 3_600_000, 0.001)
    assert 0 < fast.events_in_full < reduce.MAX_WINDOWS
    assert (fast.windows[:, 1] - fast.windows[:, 0]).sum() <= reduce.DRIVE.detail_samples


def test_events_inside_the_windows_of_others_need_no_room():
    events = [event(20.0 * k, 20.0 * k + 1.0) for k in range(reduce.MAX_WINDOWS)] + [event(0.2, 0.4)] * 100
    assert reduce.make_plan(events, N, 0.01).events_in_full == reduce.MAX_WINDOWS + 100


def test_both_ends_of_a_long_event():
    plan = reduce.make_plan([event(100.0, 1000.0)], N, 0.01)
    assert plan.windows.tolist() == [[9700, 10301], [99700, 100301]]
