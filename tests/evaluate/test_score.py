"""Episodes, events and what they add up to; all counted by hand."""

import math

import numpy as np
import pytest

from aqualog.core.intervals import Z95, poisson, student_quantile, wilson, worth
from aqualog.core.moments import Design
from aqualog.core.regression import estimate
from aqualog.evaluate.judge import beginning_in, cells_of, hits, outlasting, rows_of
from aqualog.evaluate.labels import Label, Labels
from aqualog.evaluate.records import Cell, DetectorRun, Hit, RunRecord
from aqualog.evaluate.score import Rate, confusion, grouped, recall_of, score

WATER = [(10.0, 20.0)]


def only(episodes, events, limit=2.0):
    got = hits(episodes, events, limit=limit, water=WATER)
    assert len(got) == 1
    return got[0]


def test_event_within_the_limit_finds():
    h = only([(12.0, 15.0)], [(13.5, 14.0)])
    assert (h.found, h.latency, h.before) == (True, 1.5, False)


def test_event_after_the_limit_is_late():
    h = only([(12.0, 18.0)], [(14.5, 15.0)])
    assert (h.found, h.latency) == (False, 2.5)


def test_short_episode_may_be_found_after_its_end():
    assert only([(12.0, 12.2)], [(12.4, 13.0)], limit=0.5).found
    missed = only([(12.0, 12.2)], [(12.6, 13.0)], limit=0.5)
    assert not missed.found
    assert math.isnan(missed.latency)


def test_event_that_is_on_counts_only_if_it_began_on_water():
    h = only([(12.0, 15.0)], [(11.0, 13.0)])
    assert (h.found, h.latency, h.before) == (True, 0.0, True)
    stuck = only([(12.0, 15.0)], [(5.0, 30.0)])
    assert not stuck.found
    both = only([(12.0, 15.0)], [(5.0, 30.0), (13.0, 14.0)])
    assert (both.found, both.latency, both.before) == (True, 1.0, False)


def test_event_that_ended_before_does_not_count():
    assert not only([(12.0, 15.0)], [(11.0, 12.0)]).found
    h = only([(12.0, 15.0)], [(12.0, 12.1)])
    assert (h.found, h.latency, h.before) == (True, 0.0, False)


def test_an_alarm_that_never_ends_finds_no_later_lane_and_is_a_false_one():
    two = [(10.0, 13.0), (60.0, 62.0)]
    first, second = hits([(10.0, 12.0), (60.0, 61.0)], [(11.0, 100.0)], limit=2.0, water=two)
    assert first.found
    assert not second.found
    assert outlasting([(11.0, 100.0), (12.0, 22.9), (5.0, 100.0)], two) == [23.0]


def test_beginning_in():
    assert beginning_in([(9.9, 12.0), (10.0, 11.0), (20.0, 21.0)], WATER) == [(10.0, 11.0)]


def test_rows_of_the_confusion_table():
    items = (Label(10.0, 20.0, "water"), Label(12.0, 16.0, "partial", "fl"), Label(13.0, 14.0, "full", "fl"))
    labels = Labels((*items, Label(30.0, 40.0, "snow")), frozenset(("water", "partial", "full")), "file")
    rows = rows_of(labels, 50.0)
    assert rows["full"] == [(13.0, 14.0)]
    assert rows["partial"] == [(12.0, 13.0), (14.0, 16.0)]
    assert rows["water only"] == [(10.0, 12.0), (16.0, 20.0)]
    assert rows["snow"] == [(30.0, 40.0)]
    assert rows["none"] == [(0.0, 10.0), (21.0, 30.0), (40.0, 50.0)]
    cells = cells_of(rows, [(5.0, 6.0), (12.5, 13.5), (35.0, 45.0)])
    assert cells["none"] == Cell(3, 2, 1, 29.0)  # the one from snow reaches into it, and did not begin there
    assert cells["full"] == Cell(1, 1, 0, 1.0)
    assert cells["partial"] == Cell(2, 1, 1, 3.0)
    assert cells["water only"] == Cell(2, 0, 0, 6.0)
    assert cells["snow"] == Cell(1, 1, 1, 10.0)


def record(name, tyre, dry_h, alarms, full=(), unavailable=(), **more):
    run = DetectorRun(full=tuple(full), false_alarms=alarms, cells={"none": Cell(1, bool(alarms), len(alarms), 10.0)})
    detectors = {} if "spin_down" in unavailable else {"spin_down": run}
    return RunRecord(name, {"tyre": tyre}, dry_h * 3600, dry_h * 3600, dry_h * 1e5, 0.0, detectors, unavailable, **more)


def test_scores_add_up():
    found, late = (
        hits([(12.0, 13.0)], [(12.1, 13.0)], limit=0.5, water=WATER),
        hits([(12.0, 19.0)], [(14.0, 15.0)], limit=0.5, water=WATER),
    )
    records = [
        record("a", "worn", 2.0, (1.0, 2.0), found),
        record("b", "new", 3.0, (), late),
        record("c", "new", 5.0, (), unavailable=("spin_down",)),
    ]
    s = score(records, "spin_down")
    assert (s.runs, s.unavailable) == (2, 1)
    assert (s.full.episodes, s.full.found) == (2, 1)
    assert s.full.latency(0.5) == pytest.approx(0.1)
    assert s.full.latency(0.95) == pytest.approx(2.0)
    assert s.false_alarms == Rate(2, 5 * 3600.0, 5e5)
    assert s.false_alarms.per_hour == pytest.approx(0.4)
    assert s.false_alarms.per_100km == pytest.approx(0.4)
    assert Rate(2, 5 * 3600.0, 5e5).per_hour_ci95 == pytest.approx((0.2422 / 5, 7.2247 / 5), abs=2e-5)
    assert s.false_alarms.per_hour_ci95[1] > 1.5 * 7.2247 / 5  # both on one of two drives
    assert s.full.ci95 == wilson(1, 2)
    assert {k: [r.name for r in v] for k, v in grouped(records, ["tyre"]).items()} == {
        ("new",): ["b", "c"], ("worn",): ["a"],
    }  # fmt: skip
    assert confusion(records) == {"none": {"spin_down": Cell(2, 1, 2, 20.0)}}


def test_missed_episodes_are_infinitely_late():
    got = recall_of(hits([(12.0, 13.0)], events, limit=0.5, water=WATER) for events in ([(12.0, 13.0)], [], []))
    assert (got.episodes, got.found, len(got.latencies)) == (3, 1, 1)
    assert got.latency(0.3) == 0.0
    assert got.latency(0.5) == math.inf
    assert math.isnan(recall_of([]).share)


def test_episodes_and_alarms_of_one_drive_count_as_fewer():
    hit, miss = Hit(found=True, latency=0.1, before=False), Hit(found=False, latency=math.nan, before=False)
    # ten drives that find all of their four episodes, or none: ten cases, not forty
    clumped = recall_of([[hit] * 4] * 7 + [[miss] * 4] * 3)
    assert clumped.ci95 == pytest.approx(wilson(7, 10), abs=0.05)
    spread = recall_of([[hit, hit, hit, miss]] * 10)
    assert spread.ci95 == wilson(30, 40)
    assert recall_of([[hit, hit, miss]]).ci95 == wilson(2, 3)  # one drive does not show it
    hour = 3600.0
    once = Rate(12, 12 * hour, 0.0, ((1, hour),) * 12)
    assert once.per_hour_ci95 == pytest.approx(np.array(poisson(12)) / 12.0)
    of_one = Rate(12, 12 * hour, 0.0, ((12, hour), *((0, hour),) * 11))
    assert of_one.per_hour_ci95[0] < 0.1
    assert of_one.per_hour_ci95[1] > 4.0
    assert Rate(0, 2 * hour, 0.0, ((0, hour),) * 2).per_hour_ci95 == pytest.approx((0.0, 3.6889 / 2), abs=1e-4)


def test_clumped_events_are_held_as_often_as_said():
    rng = np.random.default_rng(1)
    held, draws = 0, 150
    for _ in range(draws):
        counts = rng.poisson(rng.gamma(1.0, 3.0, 8))
        each = worth(counts, np.ones(8), of_shares=False)
        low, high = poisson(each * counts.sum())
        held += low / each <= 24.0 <= high / each
    assert held >= 0.87 * draws  # 0.92; 0.68 as if each event came alone
    # as the regression over runs has it, with runs of unequal length
    counts, sizes = np.array([3.0, 9.0, 1.0, 20.0]), np.array([1.0, 2.0, 1.5, 4.0])
    order = np.arange(4)
    e = estimate(Design(np.sqrt(sizes)[None], counts / np.sqrt(sizes), order, 0 * order, (False,), (False,)))
    effect = float(e.by_run[0].part @ e.by_run[0].part) * sizes.sum() ** 2 / counts.sum()
    dof = float(e.dof[0]) * (effect / (effect - 1.0)) ** 2
    wanted = (Z95 / student_quantile(0.975, dof)) ** 2 / effect
    assert worth(counts, sizes, of_shares=False) == pytest.approx(wanted, rel=1e-4)


def test_configurations_are_sorted_as_numbers():
    records = [record(str(i), tyre, 1.0, ()) for i, tyre in enumerate(("10", "9", "", "1.5"))]
    assert [k[0] for k in grouped(records, ["tyre"])] == ["1.5", "9", "10", "-"]
