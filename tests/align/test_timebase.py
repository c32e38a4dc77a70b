from dataclasses import replace

import numpy as np
import pytest

from aqualog.align.timebase import ClockRepair, with_spread_stamps, without_copies
from aqualog.core.records import Channel, ChannelInfo, TimeFaults

MS = 1_000_000
S = 1_000_000_000


def steady(n=1000, dt=10 * MS, start=0):
    return start + np.arange(n, dtype=np.int64) * dt


def uneven(n=1000):
    return steady(n) + np.random.default_rng(1).integers(-2 * MS, 2 * MS, n)


def put(t, at, values):
    t = t.copy()
    t[at] = values
    return t


def joined(*parts):
    return np.concatenate(parts)


def doubled(t, begin, end, copies=1):
    return joined(t[:end], *[t[begin:end]] * copies, t[end:])


def repair(t, clock=None):
    t = np.asarray(t, dtype=np.int64)
    before = t.copy()
    fixed, order, faults = (clock or ClockRepair()).repair(t)
    assert (t == before).all()
    assert (np.diff(fixed) > 0).all()
    assert fixed.size == order.size
    return fixed, order, {n: getattr(faults, n) for n in faults.KINDS if getattr(faults, n)}, faults


def set_back(samples):
    return put(steady(3000), slice(1500, 3000), steady(3000)[1500:] - samples * 10 * MS - 3 * MS)


KEPT = {
    "clean": (steady(), {}, range(1000)),
    "the later of two samples": (put(steady(10), 5, 40 * MS), {"duplicates": 1}, [0, 1, 2, 3, 5, 6, 7, 8, 9]),
    "a small back-step": (put(steady(10), [4, 5], [50 * MS, 40 * MS]), {"back_steps": 1}, [0, 1, 2, 3, 5, 4, *range(6, 10)]),
    "a pause": (put(steady(), slice(500, 1000), steady(500, start=10 * S)), {"pauses": 1}, range(1000)),
    "two days": (joined(steady(500), steady(500, start=30 * 3600 * S)), {"pauses": 1}, range(1000)),
    "a late message of 30 samples": (
        put(steady(3000), slice(1000, 1060), np.roll(steady(3000)[1000:1060], 30)), {"back_steps": 1},
        [*range(1000), *range(1030, 1060), *range(1000, 1030), *range(1060, 3000)],
    ),
    **{
        f"a clock set back by {n}": (
            set_back(n), {"back_steps": 1, "duplicates": n}, [*range(1500 - n), *range(1500, 3000)],
        ) for n in (5, 50, 99)
    },
    **{
        f"{n} strays at {where / S:g} s": (
            put(10 * S + steady(4000), slice(2000, 2000 + n), where + np.arange(n)), {"strays": n},
            np.delete(np.arange(4000), slice(2000, 2000 + n)),
        ) for n in (1, 10) for where in (0, 5000 * S, 32 * S, 28 * S)
    },
    **{
        f"strays at an end: {at.start} to {at.stop}": (
            put(steady(start=1_700_000_000 * S), at, 10 * MS * np.arange(at.stop - at.start) + (at.start > 0) * 34 * 10**8 * S),
            {"strays": at.stop - at.start}, np.delete(np.arange(1000), at),
        ) for at in (slice(0, 1), slice(0, 20), slice(990, 1000))
    },
    **{
        f"a block that stands {1 + n} times, to {end}": (
            doubled(uneven(), 400, end, n), {"duplicates": n * (end - 400), "back_steps": n},
            [*range(400), *(np.arange(400, 1000) + n * (end - 400))],
        ) for n in (1, 2) for end in (700, 1000)
    },
}  # fmt: skip


@pytest.mark.parametrize("case", KEPT.values(), ids=KEPT)
def test_what_keeps_its_stamps(case):
    t, expected, kept = case
    fixed, order, found, faults = repair(t)
    assert found == expected
    assert order.tolist() == list(kept)
    assert (fixed == t[order]).all()
    assert (faults.first_s == {}) is (expected == {})


WRAPPED = {
    f"2^{bits} ticks of {tick} ns": (1 << bits) * tick for bits, tick in ((16, MS), (32, 1000), (32, 100), (24, 10_000))
}
WRAPPED |= {f"{seconds} s": seconds * S for seconds in (60, 3600, 604_800)}


@pytest.mark.parametrize("span", WRAPPED.values(), ids=WRAPPED)
def test_counters_and_clocks_that_begin_anew_go_on(span):
    fixed, _, found, _ = repair(steady(4000, start=span - 20 * S) % span)
    assert found == {"wraps": 1}
    assert (np.diff(fixed) == 10 * MS).all()


def test_reset_goes_on_after_a_second():
    fixed, _, found, _ = repair(joined(steady(3000), steady(500)))
    assert found == {"resets": 1}
    assert fixed[3000] - fixed[2999] == S
    assert (np.diff(fixed[3000:]) == 10 * MS).all()


@pytest.mark.parametrize(
    ("t", "resets"),
    [
        (joined(uneven()[:500], uneven()[:800]), 1),
        (joined(uneven()[:900], uneven()[:300], uneven()[:800]), 2),
        (joined(steady()[:700], steady()[400:]), 1),
        (joined(doubled(uneven(), 400, 700), uneven()[:800]), 1),
    ],
    ids=["two drives", "three drives", "even stamps prove nothing", "another drive behind a doubled block"],
)
def test_a_drive_with_the_stamps_of_another_is_a_reset(t, resets):
    assert repair(t)[2]["resets"] == resets


def test_a_reset_with_few_samples_before_the_next_is_none():
    t = joined(steady(3000), steady(50), steady(3000))
    fixed, order, found, _ = repair(t)
    assert (found["resets"], found.get("strays")) == (1, None)
    assert order.size < t.size
    assert (np.diff(fixed) <= S).all()


def test_the_joint_of_a_doubled_block_may_be_of_two_halves():
    t = doubled(uneven(), 400, 700)
    t[699] += 3 * MS
    fixed, _, found, _ = repair(t)
    assert "resets" not in found
    assert fixed[-1] == t[-1]


@pytest.mark.parametrize("begin", [1000, 0])
def test_rows_written_twice_count_once(begin):
    """On an even grid stamps prove nothing, but the values of moving signals do."""
    t = steady(3000)
    rows = np.concatenate([np.arange(1500), np.arange(begin, 1500), np.arange(1500, 3000)])
    infos = [ChannelInfo(n, n, "", rows.size, "a.csv") for n in ("noise", "constant")]
    values = [np.random.default_rng(1).normal(size=3000), np.zeros(3000)]
    values[0][1200] = np.nan
    written = {i.name: Channel(i, t[rows], x[rows], absolute=False) for i, x in zip(infos, values, strict=True)}
    kept, notes = without_copies(written)
    for info, x in zip(infos, values, strict=True):
        assert np.array_equal(kept[info.name].t_ns, t)
        assert np.array_equal(kept[info.name].values, x, equal_nan=True)
    assert notes == (
        f"a.csv: {1500 - begin} rows from {begin * 0.01:.2f} to 14.99 s stand twice, with the same stamps and values: counted once",
    )
    assert without_copies({0: written["constant"]})[1] == ()
    written["noise"].values[1600] += 1e-6  # another drive on the same clock, or another pass
    assert without_copies(written)[1] == ()


@pytest.mark.parametrize("rounding", [np.floor, np.round])
@pytest.mark.parametrize("step", [50 * MS, 100 * MS, S])
def test_rounded_stamps_are_spread_evenly(rounding, step):
    """A log with a pause: the first stamp shows whether its stamps were rounded or cut off."""
    t = steady(6000) + np.where(np.arange(6000) > 3003, 5_330 * MS, 0)
    x = np.random.default_rng(1).normal(size=6000)
    info = ChannelInfo("x", "x", "", 6000, "a.csv")
    spread, notes = with_spread_stamps({"x": Channel(info, (rounding(t / step) * step).astype(np.int64), x, False)})
    assert np.abs(spread["x"].t_ns - t).max() < 0.5 * MS
    assert f"rounded to {step / S:g} s" in notes[0]
    state = Channel(info, (rounding(t / step) * step).astype(np.int64), (t > t[3000]).astype(float), False)
    both = with_spread_stamps({"x": replace(state, values=x), "state": state})[0]
    assert np.array_equal(both["state"].t_ns, both["x"].t_ns)  # what rests keeps step with what moves
    held = np.repeat(x[::100], 100)  # what repeats its values is no sample of its own
    assert with_spread_stamps({"x": Channel(info, t // step * step, held, False)})[1] == ()
    assert with_spread_stamps({"x": Channel(info, t, x, False)})[1] == ()


def test_channels_of_one_file_shift_together_and_share_a_repair():
    clock = ClockRepair()
    shared = joined(steady(3000), steady(500))
    first = clock.repair(shared)
    slow, _, _, _ = repair(joined(steady(300, 100 * MS), steady(50, 100 * MS)), clock)
    assert first[0][3000] == slow[300]
    assert clock.repair(shared) is first
    assert clock.repair(shared.copy()) is first


@pytest.mark.parametrize("n", [0, 1])
def test_tiny_vectors(n):
    fixed, order, _ = ClockRepair().repair(np.zeros(n, dtype=np.int64))
    assert fixed.size == order.size == n


def test_faults_tell_where_the_first_of_them_is():
    t = steady(20_000, start=7 * S)
    t[5000] = t[4999]  # at 49.99 s
    t[6000] = t[5999]
    t[[7000, 7001]] = t[[7001, 7000]]  # behind 70.01 s
    t[9000:] += 5 * S  # behind 89.99 s
    t[12_000:12_010] -= 500 * S  # behind 119.99 s, and 5 s later
    t[15_000:] -= 60 * S  # a wrap of the minute behind 149.99 s, and 5 s later
    t[18_000:] -= 110 * S  # a reset 30 s later
    faults = repair(t)[3]
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
    t = joined(steady(3000), steady(3000))
    clock = ClockRepair()
    clock.repair(joined(steady(3000), steady(3000)) + (t >= 20 * S) * S * again)
    t[4000:] += 7 * S
    _, _, found, faults = repair(t, clock)
    assert found == {"resets": 1, "pauses": 1}
    assert faults.first_s == pytest.approx({"resets": 29.99, "pauses": 40.98 + again})
