import numpy as np
import pytest

from aqualog.align.timebase import ClockRepair

MS = 1_000_000
S = 1_000_000_000


def steady(n=1000, dt=10 * MS, start=0):
    return start + np.arange(n, dtype=np.int64) * dt


def repair(t):
    t = np.asarray(t, dtype=np.int64)
    before = t.copy()
    fixed, order, faults = ClockRepair().repair(t)
    assert (t == before).all()
    assert (np.diff(fixed) > 0).all()
    assert fixed.size == order.size
    return fixed, order, faults


def test_clean_stamps_stay():
    t = steady()
    fixed, order, faults = repair(t)
    assert (fixed == t).all()
    assert (order == np.arange(t.size)).all()
    assert not any(getattr(faults, n) for n in faults.__slots__)


def test_duplicates_keep_the_later_sample():
    t = steady(10)
    t[5] = t[4]
    fixed, order, faults = repair(t)
    assert faults.duplicates == 1
    assert fixed.size == 9
    assert 5 in order
    assert 4 not in order


def test_small_back_steps_are_sorted():
    t = steady(10)
    t[[4, 5]] = t[[5, 4]]
    fixed, order, faults = repair(t)
    assert faults.back_steps == 1
    assert (fixed == steady(10)).all()
    assert list(order[4:6]) == [5, 4]


def test_reset_goes_on_after_a_second():
    t = np.concatenate([steady(3000), steady(500)])
    fixed, _, faults = repair(t)
    assert faults.resets == 1
    assert fixed[3000] - fixed[2999] == S
    assert (np.diff(fixed[3000:]) == 10 * MS).all()


@pytest.mark.parametrize(("bits", "tick"), [(16, MS), (32, 1_000), (32, 100), (24, 10_000)])
def test_counter_wraps_are_unwrapped(bits, tick):
    span = (1 << bits) * tick
    true = steady(3000, 10 * MS, span - 20 * S)
    fixed, _, faults = repair(true % span)
    assert faults.wraps == 1
    assert faults.resets == 0
    assert (np.diff(fixed) == 10 * MS).all()


def test_pause_is_counted_and_left():
    t = steady(1000)
    t[500:] += 5 * S
    fixed, _, faults = repair(t)
    assert faults.pauses == 1
    assert (fixed == t).all()


def test_channels_of_one_file_shift_together():
    clock = ClockRepair()
    fast = np.concatenate([steady(3000), steady(500)])
    slow = np.concatenate([steady(300, 100 * MS), steady(50, 100 * MS)])
    a, _, _ = clock.repair(fast)
    b, _, _ = clock.repair(slow)
    assert a[3000] == b[300]


def test_a_shared_vector_is_repaired_once_and_another_one_anew():
    clock = ClockRepair()
    shared = np.concatenate([steady(3000), steady(500)])
    first = clock.repair(shared)
    assert clock.repair(shared) is first
    again = clock.repair(shared.copy())
    assert again is not first
    assert (again[0] == first[0]).all()


@pytest.mark.parametrize("n", [0, 1])
def test_tiny_vectors(n):
    fixed, order, _ = ClockRepair().repair(np.zeros(n, dtype=np.int64))
    assert fixed.size == order.size == n
