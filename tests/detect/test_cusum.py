"""When a change began and ended, from the sum that reports it late."""

import numpy as np
import pytest

from aqualog.core.records import Track
from aqualog.detect import cusum
from aqualog.detect.events import AFTER, SINCE, EventBook
from aqualog.detect.resistance import alarm_params

DT = 0.01


def edges(x, cuts=()):
    """Begin and end of the alarm and of its cause [s], for any cut into pieces."""
    params, state, ages = alarm_params(DT), cusum.initial_state(), cusum.new_ages()
    parts = []
    for piece in np.split(np.asarray(x, dtype=float), cuts):
        g, bits, state = cusum.scan(params, state, piece)
        since, after, ages = cusum.ages(DT, ages, g, bits)
        parts.append((bits, since, after))
    bits, since, after = (np.concatenate(p) for p in zip(*parts, strict=True))
    first, last = np.flatnonzero(bits)[[0, -1]]
    return (first * DT, (last + 1) * DT), (first * DT - since[first], (last + 1) * DT - after[last])


@pytest.mark.parametrize("level", [0.25, 0.5, 0.8])
@pytest.mark.parametrize("seed", range(3))
def test_the_cause_is_where_the_change_is(level, seed):
    t = np.arange(0.0, 20.0, DT)
    x = np.where((t >= 5.0) & (t < 12.0), level, 0.0) + 0.1 * np.random.default_rng(seed).standard_normal(t.size)
    alarm, cause = edges(x)
    assert cause == (pytest.approx(5.0, abs=0.15), pytest.approx(12.0, abs=0.15))
    assert alarm[1] > 13.5
    assert alarm[0] > cause[0] + 0.2


def test_it_ends_with_the_change_though_the_sum_is_zero_before_the_end_is_asked_for():
    """A gate is held open after its sum has come back."""
    x = np.concatenate([np.zeros(100), np.full(300, 0.5), np.zeros(1000)])
    x += 0.15 * np.random.default_rng(2).standard_normal(x.size)  # noise alone makes small sums after it
    g, bits, _ = cusum.scan(alarm_params(DT), cusum.initial_state(), x)
    _, after, _ = cusum.ages(DT, cusum.new_ages(), g, bits)
    assert 0.0 in g[600:]
    assert after[-1] == pytest.approx(10.0, abs=0.1)


@pytest.mark.parametrize("cuts", [(1,), (250, 251, 700)])
def test_any_cut_and_gaps_give_the_same(cuts):
    rng = np.random.default_rng(4)
    x = np.concatenate([np.zeros(300), np.full(400, 0.4), np.zeros(500)]) + 0.1 * rng.standard_normal(1200)
    x[350:360] = np.nan
    assert edges(x, cuts) == edges(x)


def test_a_cause_may_be_over_before_its_event_begins():
    """A wheel reports a puddle when the car has left it."""
    bits, zero = np.zeros(100, dtype=bool), np.zeros(100)
    bits[50:70] = True
    after = np.arange(100) * DT - 0.4  # the force ended at 0.4 s
    book = EventBook(10_000_000)
    track = Track("joint_cusum", None, None, "-", zero, 1.0, bits)
    (event,) = book.take(track, {AFTER: ("last", after)}, lambda _: "partial")
    assert (event.start_s, event.end_s) == (0.5, 0.7)
    assert event.cause_s == (pytest.approx(0.41), pytest.approx(0.41))
    assert AFTER not in event.evidence


def test_a_cause_that_the_end_of_a_drive_cuts_is_not_over():
    """A warning of one sample at the end, which an event that ends by itself would outlast by half a second."""
    bits, zero = np.zeros(100, dtype=bool), np.zeros(100)
    bits[99:] = True
    book = EventBook(10_000_000)
    book.take(
        Track("joint_criteria", None, None, "-", zero, 1.0, bits), {AFTER: ("last", zero + 0.5)}, lambda _: "partial"
    )
    (event,) = book.finish()
    assert event.cause_s == (0.99, 1.0)


def booked(bits, statistic, since, cuts=()):
    book, events = EventBook(10_000_000), []
    for part in np.split(np.arange(bits.size), cuts):
        track = Track("resistance", None, None, "-", statistic[part], 1.0, bits[part])
        events += book.take(track, {SINCE: ("first", since[part])}, lambda _: "partial")
    return [e.cause_s for e in (*events, *book.finish())]


@pytest.mark.parametrize("cuts", [(), (35,), (20, 40, 41, 55)])
@pytest.mark.parametrize(("since", "begin"), [(0.05, 0.45), (0.15, 0.40), (0.38, 0.40), (0.45, 0.05)])
def test_no_cause_begins_where_there_are_no_data(since, begin, cuts):
    statistic, bits = np.ones(100), np.zeros(100, dtype=bool)
    statistic[10:40] = np.nan
    bits[50:70] = True
    assert booked(bits, statistic, np.full(100, since), cuts) == [(pytest.approx(begin), 0.7)]


def test_no_cause_ends_where_there_are_no_data():
    """A warning that is held for half a second runs on into a gap."""
    statistic, bits = np.ones(100), np.zeros(100, dtype=bool)
    statistic[60:90] = np.nan
    bits[50:70] = True
    assert booked(bits, statistic, np.zeros(100)) == [(0.5, 0.6)]


def test_a_sum_of_zero_does_not_age_in_a_gap():
    x = np.concatenate([np.zeros(100), np.full(100, np.nan), np.full(100, 0.6)])
    g, bits, _ = cusum.scan(alarm_params(DT), cusum.initial_state(), x)
    since, _, _ = cusum.ages(DT, cusum.new_ages(), g, bits)
    first = int(np.argmax(bits))
    assert since[first] == pytest.approx((first - 199) * DT)
