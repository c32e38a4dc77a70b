"""Curves, proposals, and what is kept apart; detectors are real, drives are short."""

from collections import Counter
from dataclasses import replace

import pytest

from aqualog.config.thresholds import load_thresholds, thresholds_text
from aqualog.core.errors import ConfigError, LogError
from aqualog.detect.thresholds import DEFAULT
from aqualog.evaluate import judge as judge_module
from aqualog.evaluate import run
from aqualog.evaluate.drives import Drive, labels_in
from aqualog.evaluate.judge import judge
from aqualog.evaluate.records import DetectorRun, Hit, RunRecord
from aqualog.evaluate.score import Rate, Recall, better_rivals, coverage, situation_scores
from aqualog.evaluate.sweep import RocPoint, choose, records_at, split_runs
from aqualog.model.log import as_signals
from aqualog.model.simulate import simulate
from tests.evaluate.made import FWD, RWD, scenario


def point(factor, found, alarms, detector="spin_down", hours=100.0):
    recall = Recall(10, found, 0, ())
    return RocPoint(detector, factor, 0.6 * factor, Recall(0, 0, 0, ()), recall, Rate(alarms, hours * 3600.0, 1e6))


def test_few_false_alarms_come_first_then_recall():
    points = [point(0.5, 10, 2), point(0.7, 9, 1), point(1.0, 8, 1), point(2.0, 5, 0)]
    assert choose(points)["spin_down"].point.factor == 0.7
    assert choose(points, limit=0.005)["spin_down"].point.factor == 2.0
    assert choose(points, limit=1.0)["spin_down"].point.factor == 0.5


def test_a_detector_is_not_switched_off_by_tuning():
    choice = choose([point(1.0, 9, 7), point(2.0, 5, 5), point(4.0, 6, 5)])["spin_down"]
    assert choice.point.factor == 1.0
    assert "no threshold keeps" in choice.reason
    choice = choose([point(1.0, 9, 7), point(4.0, 0, 0)])["spin_down"]
    assert choice.point.factor == 1.0
    assert "find nothing" in choice.reason


def test_among_equals_the_nearest_stays():
    assert (
        choose([point(0.25, 9, 0), point(0.71, 9, 0), point(1.0, 9, 0), point(4.0, 9, 0)])["spin_down"].point.factor
        == 1.0
    )


def groups(*pairs):
    return [{"vehicle": v, "tyre": t} for v, t in pairs]


def values(all_groups, indices, key):
    return {all_groups[i][key] for i in indices}


@pytest.mark.parametrize(
    ("given", "unused"),
    [(groups(("a", "x"), ("a", "y"), ("b", "z"), ("b", "z")), 0),
     (groups(*((v, t) for v in "abcd" for t in "xyz")), 6)],
)  # fmt: skip
def test_no_vehicle_and_no_tyre_is_in_both_parts(given, unused):
    s = split_runs(given)
    assert s.tuning
    assert s.reporting
    for key in ("vehicle", "tyre"):
        assert not values(given, s.tuning, key) & values(given, s.reporting, key)
    assert sorted((*s.tuning, *s.reporting, *s.unused)) == list(range(len(given)))
    assert len(s.unused) == unused
    assert "no vehicle and no tyre" in s.rule


def test_split_falls_back_and_says_so():
    one_car = groups(("a", "x"), ("a", "y"), ("a", "x"))
    s = split_runs(one_car)
    assert not values(one_car, s.tuning, "tyre") & values(one_car, s.reporting, "tyre")
    assert "the vehicle is the same" in s.rule
    same = split_runs(groups(*[("a", "x")] * 5))
    assert (same.tuning, same.reporting) == ((0, 2, 4), (1, 3))
    assert "every other drive" in same.rule


class Watched:
    """A source that counts how often it is loaded."""

    def __init__(self, source, counts, broken=False):
        self.source, self.counts, self.broken = source, counts, broken
        self.name, self.groups = source.name, source.groups

    def load(self):
        self.counts[self.name] += 1
        if self.broken:
            raise LogError("is torn", where=self.name)
        return self.source.load()


def made(name, car, tyre, kmh, depth, seed):
    signals = as_signals(simulate(replace(scenario(car, tyre, kmh, depth), seed=seed)))
    return Drive(name, signals, car, labels_in(signals), {"vehicle": car.name, "tyre": tyre, "manoeuvre": name})


@pytest.fixture(scope="module")
def sources():
    return [
        made("rwd deep", RWD, "worn_summer", 118.0, 1.8, 1),
        made("rwd dry", RWD, "worn_summer", 90.0, 0.0, 2),
        made("fwd deep", FWD, "very_worn_summer", 118.0, 1.8, 3),
        made("fwd dry", FWD, "very_worn_summer", 90.0, 0.0, 4),
    ]


def test_thresholds_are_never_reported_on_the_drives_they_were_chosen_on(sources, monkeypatch):
    swept, judged = set(), set()
    monkeypatch.setattr(run, "records_at", lambda d, f, **k: swept.add(d.name) or records_at(d, f, **k))
    monkeypatch.setattr(run, "judge", lambda d, **k: judged.add(d.name) or judge(d, **k))
    result = run.tune(sources, factors=(0.5, 1.0))
    reported = {r.name for r in result.records}
    assert swept == set(result.tuning.tuned_on)
    assert judged == reported == set(result.tuning.reported_on)
    assert not swept & reported
    assert len(swept) == len(reported) == 2
    assert {r.name for r in result.tuning.before} == reported
    cars = {s.name: s.groups["vehicle"] for s in sources}
    assert not {cars[n] for n in swept} & {cars[n] for n in reported}
    for name, choice in result.tuning.choices.items():
        assert getattr(result.thresholds, name) == choice.point.threshold
        assert choice.point.false_alarms.seconds < sum(r.duration_s for r in result.records) + 1.0


def test_tuning_needs_two_drives(sources):
    with pytest.raises(ConfigError, match="cannot be divided"):
        run.tune(sources[:1])


def test_a_broken_drive_leaves_the_others(sources):
    counts = Counter()
    some = [Watched(s, counts, broken=s.name == "rwd deep") for s in sources]
    result = run.evaluate(some)
    assert [r.name for r in result.records] == ["rwd dry", "fwd deep", "fwd dry"]
    assert "is torn" in result.failed["rwd deep"]
    tuned = run.tune(some, factors=(1.0, 2.0))
    assert counts["rwd deep"] <= 2
    assert "rwd deep" not in (*tuned.tuning.tuned_on, *tuned.tuning.reported_on)


def test_a_larger_threshold_raises_no_more_alarms(sources):
    sources = sources[:2]
    result = run.evaluate(sources, with_roc=True, factors=(0.25, 1.0, 4.0), rivals={})
    by_name = {}
    for p in result.roc:
        by_name.setdefault(p.detector, []).append(p)
    assert {"spin_down", "joint_criteria", "wheel_thresholds"} <= set(by_name)
    for points in by_name.values():
        assert [p.factor for p in points] == [0.25, 1.0, 4.0]
        assert points[0].threshold < points[-1].threshold
    base = {r.name: r for r in result.records}
    again = {s.name: judge(s.load(), rivals={}) for s in sources}
    assert repr(base) == repr(again)


def test_detectors_do_not_see_the_truth(sources):
    drive = sources[0].load()
    hidden = replace(
        drive.signals,
        frame=drive.signals.frame.select(
            [c for c in drive.signals.frame.columns if not c.startswith(("true_", "on_water", "water_"))]
        ),
    )
    assert repr(judge(replace(drive, signals=hidden), rivals={})) == repr(judge(drive, rivals={}))


def run_record(name, situation, detectors):
    return RunRecord(name, {"manoeuvre": situation}, 3600.0, 3600.0, 1e5, 0.0, detectors)


def detector(found, missed, alarms):
    hit = [Hit(True, 0.1, False)] * found + [Hit(False, float("nan"), False)] * missed
    return DetectorRun(partial=tuple(hit), false_alarms=tuple(range(alarms)))


def test_where_a_rival_is_better_it_is_said():
    records = [
        run_record("a", "lane", {"spin_down": detector(10, 90, 0), "wheel_thresholds": detector(90, 10, 0)}),
        run_record("b", "snow", {"spin_down": detector(0, 0, 0), "wheel_thresholds": detector(0, 0, 20)}),
    ]
    found = better_rivals(records)
    assert [(b.rival, b.against, b.situation, b.measure, b.is_sure, b.at_a_price) for b in found] == [
        ("wheel_thresholds", "spin_down", "", "partial", True, True),
        ("wheel_thresholds", "spin_down", "lane", "partial", True, True),
    ]
    cover = coverage(situation_scores(records))
    assert (cover["wheel_thresholds"].found, cover["wheel_thresholds"].of_aquaplaning) == (1, 1)
    assert (cover["wheel_thresholds"].quiet, cover["wheel_thresholds"].of_dry) == (1, 2)
    assert (cover["spin_down"].found, cover["spin_down"].quiet) == (0, 2)
    assert (
        better_rivals(
            [run_record("a", "lane", {"spin_down": detector(9, 1, 0), "wheel_thresholds": detector(8, 2, 1)})]
        )
        == []
    )


def test_thresholds_file_goes_there_and_back(tmp_path):
    path = tmp_path / "t.toml"
    thresholds = DEFAULT.with_values({"spin_down": 0.4242, "slip_slope_drop": 0.61})
    path.write_text(thresholds_text(thresholds, {"wheel_thresholds": 1.5}, comments=["a\nb"]), encoding="utf-8")
    assert load_thresholds(path) == (thresholds, {"wheel_thresholds": 1.5})


def test_faults_of_a_thresholds_file_come_together(tmp_path):
    path = tmp_path / "t.toml"
    path.write_text(
        '[thresholds]\nspin_dwn = 1.0\nspin_up = -1.0\nslip_slope_drop = 1.5\nresistance = "x"\n[rivals]\nslope_rl = 1\n'
        "[other]\nx = 1\n",
        encoding="utf-8",
    )
    with pytest.raises(ConfigError) as caught:
        load_thresholds(path)
    text = str(caught.value)
    for part in ("spin_down", "spin_up", "slip_slope_drop", "resistance", "slope_rls", "other", "line 2", "line 7"):
        assert part in text


def test_thresholds_reach_the_detectors(sources):
    drive = sources[0].load()
    assert judge(drive).detectors["minor_spin_down"].full[0].found
    deaf = judge(drive, thresholds=DEFAULT.with_values({"minor_spin_down": 1e6})).detectors["minor_spin_down"]
    assert not deaf.full[0].found
    rivals = judge(drive, rivals={"wheel_thresholds": 1e4}).detectors["wheel_thresholds"]
    assert not rivals.full[0].found


def test_each_detector_is_swept_by_its_own_threshold(sources, monkeypatch):
    asked = []
    detect = judge_module.detect_drive
    monkeypatch.setattr(
        judge_module,
        "detect_drive",
        lambda s, v, settings, **how: asked.append(settings.thresholds) or detect(s, v, settings=settings, **how),
    )
    records_at(sources[0].load(), 2.0)
    single, joint = asked
    assert (single.spin_down, single.joint_criteria) == (2.0 * DEFAULT.spin_down, DEFAULT.joint_criteria)
    assert (joint.spin_down, joint.joint_criteria) == (DEFAULT.spin_down, 2.0 * DEFAULT.joint_criteria)
    assert joint.joint_cusum == 2.0 * DEFAULT.joint_cusum
