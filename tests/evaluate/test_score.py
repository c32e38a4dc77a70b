"""Episodes, events and what they add up to; all counted by hand."""

import math

import pytest

from aqualog.core.intervals import wilson
from aqualog.evaluate.judge import beginning_in, cells_of, hits, outlasting, rows_of
from aqualog.evaluate.labels import Label, Labels
from aqualog.evaluate.records import Cell, DetectorRun, RunRecord
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
    assert s.false_alarms.per_hour_ci95 == pytest.approx((0.2422 / 5, 7.2247 / 5), abs=2e-5)
    assert s.full.ci95 == wilson(1, 2)
    assert {k: [r.name for r in v] for k, v in grouped(records, ["tyre"]).items()} == {
        ("new",): ["b", "c"], ("worn",): ["a"],
    }  # fmt: skip
    assert confusion(records) == {"none": {"spin_down": Cell(2, 1, 2, 20.0)}}


def test_missed_episodes_are_infinitely_late():
    got = recall_of(
        h for events in ([(12.0, 13.0)], [], []) for h in hits([(12.0, 13.0)], events, limit=0.5, water=WATER)
    )
    assert (got.episodes, got.found, len(got.latencies)) == (3, 1, 1)
    assert got.latency(0.3) == 0.0
    assert got.latency(0.5) == math.inf
    assert math.isnan(recall_of([]).share)


def test_configurations_are_sorted_as_numbers():
    records = [record(str(i), tyre, 1.0, ()) for i, tyre in enumerate(("10", "9", "", "1.5"))]
    assert [k[0] for k in grouped(records, ["tyre"])] == ["1.5", "9", "10", "-"]
