import numpy as np
import pytest

from aqualog.align.timebase import ClockRepair
from aqualog.core.records import TimeFaults

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
    assert not any(getattr(faults, n) for n in faults.KINDS)
    assert faults.first_s == {}


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


@pytest.mark.parametrize("elsewhere", [0, 5000 * S, 32 * S, 28 * S])
@pytest.mark.parametrize("length", [1, 10])
def test_strays_are_left_out_and_move_nothing(elsewhere, length):
    t = 10 * S + steady(4000)
    t[2000 : 2000 + length] = elsewhere + np.arange(length)
    fixed, order, faults = repair(t)
    assert (faults.strays, faults.resets, faults.pauses) == (length, 0, 0)
    assert order.tolist() == [k for k in range(4000) if not 2000 <= k < 2000 + length]
    assert (fixed == t[order]).all()


@pytest.mark.parametrize("at", [slice(0, 1), slice(0, 20), slice(990, 1000)])
def test_strays_at_an_end_are_left_out(at):
    t = steady(start=1_700_000_000 * S)
    t[at] = 10 * MS * np.arange(t[at].size) + (0 if at.start == 0 else 2 * t[0])
    fixed, order, faults = repair(t)
    assert faults.strays == t[at].size
    assert (faults.resets, faults.pauses) == (0, 0)
    assert order.tolist() == np.delete(np.arange(1000), at).tolist()
    assert (fixed == t[order]).all()


def test_a_drive_of_two_days_keeps_both():
    t = np.concatenate([steady(500), steady(500, start=30 * 3600 * S)])
    fixed, _, faults = repair(t)
    assert (faults.strays, faults.pauses) == (0, 1)
    assert (fixed == t).all()


def test_a_reset_with_few_samples_before_the_next_is_none():
    t = np.concatenate([steady(3000), steady(50), steady(3000)])
    fixed, order, faults = repair(t)
    assert (faults.resets, faults.strays) == (1, 0)
    assert order.size < t.size
    assert (np.diff(fixed) <= S).all()


@pytest.mark.parametrize("back", [50, 5, 99])
def test_a_clock_that_was_set_back_does_not_mix_two_times(back):
    t = steady(3000)
    t[1500:] -= back * 10 * MS + 3 * MS
    fixed, order, faults = repair(t)
    assert (faults.back_steps, faults.duplicates, faults.resets) == (1, back, 0)
    assert order.tolist() == [*range(1500 - back), *range(1500, 3000)]
    assert (fixed == t[order]).all()


def test_late_samples_are_no_clock_that_was_set_back():
    t = steady(3000)
    t[1000:1060] = np.roll(t[1000:1060], 30)  # a message of 30 samples comes after the one behind it
    fixed, order, faults = repair(t)
    assert (faults.back_steps, faults.duplicates) == (1, 0)
    assert (fixed == steady(3000)).all()
    assert (t[order] == fixed).all()


@pytest.mark.parametrize("seconds", [60, 3600, 604_800])
def test_seconds_of_the_minute_hour_and_week_go_on(seconds):
    t = steady(4000, start=(seconds - 20) * S)
    fixed, _, faults = repair(t % (seconds * S))
    assert (faults.wraps, faults.resets) == (1, 0)
    assert (np.diff(fixed) == 10 * MS).all()


def uneven(n=1000):
    return steady(n) + np.random.default_rng(1).integers(-2 * MS, 2 * MS, n)


def doubled(t, begin, end, copies=1):
    return np.concatenate([t[:end], *[t[begin:end]] * copies, t[end:]])


@pytest.mark.parametrize("copies", [1, 2])
@pytest.mark.parametrize("end", [700, 1000], ids=["in the middle", "at the end"])
def test_a_block_that_stands_twice_shifts_nothing(end, copies):
    t = uneven()
    fixed, order, faults = repair(doubled(t, 400, end, copies))
    assert (fixed == t).all()
    assert (order[400:end] == np.arange(400, end) + copies * (end - 400)).all()  # the last copy
    assert (faults.resets, faults.duplicates) == (0, copies * (end - 400))


def test_the_joint_of_a_doubled_block_may_be_of_two_halves():
    t = doubled(uneven(), 400, 700)
    t[699] += 3 * MS
    fixed, _, faults = repair(t)
    assert faults.resets == 0
    assert fixed[-1] == t[-1]


@pytest.mark.parametrize(
    ("t", "resets"),
    [
        (np.concatenate([uneven()[:500], uneven()[:800]]), 1),
        (np.concatenate([uneven()[:900], uneven()[:300], uneven()[:800]]), 2),
        (np.concatenate([steady()[:700], steady()[400:]]), 1),
        (np.concatenate([doubled(uneven(), 400, 700), uneven()[:800]]), 1),
    ],
    ids=["two drives", "three drives", "even stamps prove nothing", "another drive behind a doubled block"],
)
def test_a_drive_with_the_stamps_of_another_is_a_reset(t, resets):
    assert repair(t)[2].resets == resets


def test_faults_tell_where_the_first_of_them_is():
    t = steady(20_000, start=7 * S)
    t[5000] = t[4999]  # at 49.99 s
    t[6000] = t[5999]
    t[[7000, 7001]] = t[[7001, 7000]]  # behind 70.01 s
    t[9000:] += 5 * S  # behind 89.99 s
    t[12_000:12_010] -= 500 * S  # behind 119.99 s, and 5 s later
    t[15_000:] -= 60 * S  # a wrap of the minute behind 149.99 s, and 5 s later
    t[18_000:] -= 110 * S  # a reset 30 s later
    _, _, faults = repair(t)
    assert [getattr(faults, n) for n in faults.KINDS] == [2, 1, 1, 1, 1, 0, 10]
    expected = {
        "duplicates": 49.99, "back_steps": 70.01, "resets": 184.99, "wraps": 154.99, "pauses": 89.99, "strays": 124.99,
    }  # fmt: skip
    assert faults.first_s == pytest.approx(expected)


def test_first_faults_of_sources_together():
    a, b = TimeFaults(duplicates=2, first_s={"duplicates": 3.0}), TimeFaults(1, 1, first_s={"duplicates": 2.0})
    assert a + b == TimeFaults(3, 1, first_s={"duplicates": 2.0})
    assert a.worse(b) == TimeFaults(2, 1, first_s={"duplicates": 2.0})
    assert (a.place("duplicates"), a.place("wraps")) == (" (first at 3.00 s)", "")


@pytest.mark.parametrize("again", [False, True])
def test_the_first_pause_is_not_a_reset(again):
    t = np.concatenate([steady(3000), steady(3000)])
    clock = ClockRepair()
    clock.repair(np.concatenate([steady(3000), steady(3000)]) + (t >= 20 * S) * S * again)
    t[4000:] += 7 * S
    _, _, faults = clock.repair(t)
    assert (faults.resets, faults.pauses) == (1, 1)
    assert faults.first_s == pytest.approx({"resets": 29.99, "pauses": 40.98 + again})
