"""Detections that belong together, and the verdict: scripted events."""

import math
from dataclasses import replace

import numpy as np
import pytest

from aqualog.core.records import Event, Unavailable
from aqualog.detect.episodes import Way, episodes_of
from aqualog.detect.verdict import NEVER_TOGETHER, judge
from aqualog.report.drive.judged import headline


def event(detector, start, end, wheel=None, severity="partial", **evidence):
    return Event(detector, wheel, None, start, end, severity, 1.0, 0.5, evidence)


def way(a, b):
    return 28.0 * (b - a), b - a


def kinds(*events):
    return [(e.kind, e.start_s, e.end_s) for e in episodes_of(events, way)]


LANE = (
    event("minor_spin_down", 8.2, 16.7, "fr", slip_min=-0.2),
    event("joint_criteria", 8.3, 17.7, decided_by=["minor_spin_down"], delta_a_x_max=1.1, slip_min=-0.2),
    event("joint_cusum", 8.4, 17.6, decided_by=["minor_spin_down", "resistance"], delta_a_x_max=1.1),
    event("spin_down", 8.6, 8.9, "fr", slip_min=-0.2, slip_max=0.31),
    event("minor_spin_down", 9.0, 9.4, "fl", slip_min=-0.02),
)


def test_one_pass_is_one_episode_with_all_that_is_known_of_it():
    # a drop of the slip slope has an amount of slip without a sign
    (e,) = episodes_of([*LANE, event("slip_slope_drop", 9.1, 9.2, "fl", slip_max=0.5)], way)
    assert (e.kind, e.start_s, e.end_s, e.severity) == ("aquaplaning", 8.2, 17.7, "partial")
    assert (e.wheels, e.axle, e.side) == (("fr", "fl"), "f", None)
    assert e.decided_by == ("minor_spin_down", "resistance")
    assert (e.delta_a_x_max, e.slip_min, e.slip_max) == (1.1, -0.2, 0.31)
    assert e.v_x == pytest.approx(28.0)
    assert e.distance_m == pytest.approx(28.0 * 9.5)
    assert e.events == (0, 1, 2, 3, 4, 5)
    assert math.isnan(e.v_full)
    lost = (event("spin_down", 9.0 + i, 11.0, w, "full", v_x=29.0 + i) for i, w in enumerate(("fr", "fl")))
    (e,) = episodes_of([*LANE, *lost], way)
    assert e.v_full == 29.0
    assert ", full from 104 km/h on" in headline(judge([replace(LANE[1], severity="full"), event("spin_down", 9.0, 11.0, "fr", "full", v_x=29.0)],
                                                       [], ("joint_cusum",), judged_s=20.0, way=way))  # fmt: skip


@pytest.mark.parametrize(
    ("warned", "span"), [((), (36.0, 39.6)), ((20.0, 50.0), (18.0, 51.0)), ((2.0, 61.0), (1.0, 61.0))]
)
def test_resistance_alone_does_not_make_an_episode_longer_than_the_water(warned, span):
    """A trailer holds a car back for a minute; a joint warning of 0.6 s in it is no minute of aquaplaning."""
    events = [event("resistance", 1.0, 61.0), event("joint_cusum", 38.0, 38.6)]
    events += [event("margin", *warned)] if warned else []
    (e,) = judge(events, [], ("resistance", "joint_cusum", "margin"), judged_s=70.0, way=way).episodes
    assert (e.start_s, e.end_s) == pytest.approx(span)
    assert judge(events, [], ("joint_cusum",), judged_s=70.0, way=way).episodes[0].end_s == 61.0


def test_less_than_a_second_between_detections_joins_them():
    parts = [event("joint_criteria", 1.0, 3.0), event("joint_criteria", 3.9, 5.0), event("joint_criteria", 6.1, 7.0)]
    assert kinds(*parts) == [("aquaplaning", 1.0, 5.0), ("aquaplaning", 6.1, 7.0)]


@pytest.mark.parametrize(
    ("detectors", "kind"),
    [
        (("spin_down",), "single_detector"),
        (("resistance",), "single_detector"),
        (("spin_down", "minor_spin_down"), "single_detector"),  # both see the same wheel slow down
        (("spin_down", "resistance"), "suspected"),
        (("spin_up", "tie_rod"), "suspected"),
        (("slip_slope_drop",), "other_surface"),
        (("slip_slope_drop", "spin_up"), "other_surface"),
        (("slip_slope_drop", "resistance"), "suspected"),
        (("resistance", "joint_cusum"), "aquaplaning"),
    ],
)
def test_kind_is_by_what_decided(detectors, kind):
    (e,) = episodes_of([event(d, 1.0, 2.0, "rl") for d in detectors], way)
    assert e.kind == kind


def test_a_lost_slope_neither_joins_nor_lengthens():
    """Its estimate recovers seconds after the tyre has."""
    wet = [event("joint_criteria", a, a + 2.0) for a in (1.0, 5.0)]
    drop = event("slip_slope_drop", 2.0, 6.0, "rl")
    assert kinds(*wet, drop) == [("aquaplaning", 1.0, 3.0), ("aquaplaning", 5.0, 7.0)]
    assert episodes_of([*wet, drop], way)[0].events == (0, 2)
    assert kinds(drop, event("slip_slope_drop", 6.5, 8.0, "rr")) == [("other_surface", 2.0, 8.0)]


def test_a_wheel_that_returns_neither_joins_nor_lengthens():
    """A wheel that was stopped or spun needs seconds to find the road's speed again."""
    wet = [event("joint_cusum", a, a + 2.0) for a in (1.0, 6.0)]
    wheel = event("spin_up", 2.0, 7.0, "rl", slip_max=0.9)
    assert kinds(*wet, event("resistance", 6.1, 8.0), wheel) == [("aquaplaning", 1.0, 3.0), ("aquaplaning", 6.0, 8.0)]
    assert kinds(*wet, wheel) == [("aquaplaning", 1.0, 3.0)]  # an echo: no resistance of its own
    assert kinds(wet[0], wheel, event("spin_down", 7.5, 7.7, "rr")) == [("aquaplaning", 1.0, 3.0)]
    assert [k for k, *_ in kinds(wet[0], wheel, event("spin_down", 8.5, 8.7, "rr"))] == [
        "aquaplaning", "single_detector",
    ]  # fmt: skip


def test_the_first_wheel_in_the_water_is_the_beginning():
    wheel = event("spin_down", 0.4, 1.5, "fr")
    assert kinds(event("joint_cusum", 1.0, 3.0), wheel) == [("aquaplaning", 0.4, 3.0)]
    assert kinds(event("joint_cusum", 2.0, 3.0), wheel) == [("aquaplaning", 2.0, 3.0)]


def test_edges_are_those_of_the_cause():
    held = replace(event("joint_criteria", 2.0, 9.0), cause_s=(1.2, 7.5))
    later = replace(event("resistance", 8.0, 9.0), cause_s=(7.8, 8.4))
    assert kinds(held, later) == [("aquaplaning", 1.2, 8.4)]
    assert len(kinds(held, replace(later, cause_s=(8.6, 8.9)))) == 2


def test_lock_ups_of_one_braking_are_one_and_apart_from_water():
    locks = [
        event("spin_down", a, a + 0.3, w, "full", braking_at_start=True)
        for a, w in ((1.0, "fl"), (2.0, "fr"), (4.5, "fl"), (9.0, "fr"))
    ]
    assert kinds(*locks) == [("wheel_lock", 1.0, 4.8), ("wheel_lock", 9.0, 9.3)]
    free = event("spin_down", 2.1, 2.2, "rl", braking_at_start=False)
    assert [k for k, *_ in kinds(*locks, free)] == ["wheel_lock", "single_detector", "wheel_lock"]


def test_a_lock_up_on_water_belongs_to_the_water():
    lock = event("spin_down", 10.0, 10.5, "rl", "full", braking_at_start=True)
    (e,) = episodes_of([*LANE, lock], way)
    assert e.events == (0, 1, 2, 3, 4, 5)
    assert (e.severity, e.wheels) == ("partial", ("fr", "fl"))
    assert [k for k, *_ in kinds(*LANE, event("spin_down", 17.8, 18.0, "rl", braking_at_start=True))] == [
        "aquaplaning", "wheel_lock",
    ]  # fmt: skip


def verdict(events, unavailable=(), ran=("spin_down", "joint_criteria"), judged_s=20.0):
    return judge(events, unavailable, ran, judged_s=judged_s, way=way)


@pytest.mark.parametrize(
    ("events", "ran", "judged_s", "expected"),
    [
        (LANE, ("spin_down", "joint_criteria"), 20.0, "aquaplaning"),
        ((), ("spin_down", "joint_criteria"), 20.0, "none"),
        (LANE[3:], ("spin_down", "joint_criteria"), 20.0, "none"),
        (LANE[3:], ("spin_down",), 0.0, "cannot_be_judged"),
        ((), ("spin_down", "joint_criteria"), 0.0, "cannot_be_judged"),
    ],
)
def test_only_joint_detectors_that_saw_something_decide(events, ran, judged_s, expected):
    assert verdict(events, ran=ran, judged_s=judged_s).verdict == expected


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({}, "aquaplaning"), ({"slip_min": -0.4}, "cannot_be_judged"), ({"v_x": 12.0}, "cannot_be_judged"),
        ({"a_w_delta_min": -900.0}, "cannot_be_judged"), ({"braking_at_start": True}, "cannot_be_judged"),
    ],
)  # fmt: skip
def test_a_free_wheel_that_stops_needs_no_torque(changed, expected):
    seen = {"slip_min": -0.9, "v_x": 28.0, "a_w_delta_min": -90.0, "braking_at_start": False, **changed}
    events = [event("spin_down", 5.0, 7.0, "fl", "full", **seen), event("spin_down", 5.2, 6.0, "rl", slip_min=-0.1)]
    for free, ran, verdict in (
        (("fl", "fr"), ("spin_down",), expected), (("rl", "rr"), ("spin_down",), "cannot_be_judged"),
        (("fl", "fr"), ("spin_down", "joint_criteria"), "none"),
    ):  # fmt: skip
        judged = judge(events, [], ran, judged_s=20.0, way=way, rolling=free)
        assert judged.verdict == verdict
        if verdict == "aquaplaning":
            assert judged.episodes[0].decided_by == ("spin_down",)
            assert judged.episodes[0].severity == "full"


def test_what_is_missing_is_that_of_the_joint_detectors():
    lacks = [
        Unavailable("tie_rod", ("tie_rod_fl",)), Unavailable("joint_criteria", ("torque_rl", "vehicle.mass")),
        Unavailable("joint_cusum", ("torque_rl", "vehicle.mass")),
    ]  # fmt: skip
    assert verdict((), lacks, ran=("spin_down",)).missing == ("torque_rl", "vehicle.mass")
    assert verdict((), judged_s=0.9).missing == (NEVER_TOGETHER,)
    assert verdict((), judged_s=1.1).verdict == "none"
    assert verdict((), lacks[:1]).missing == ()


def test_none_needs_front_wheels_that_were_watched():
    joint = ("resistance", "joint_criteria")
    slow = Unavailable("spin_down", ("wheel speeds at a higher rate",))
    assert verdict((), ran=joint).verdict == "none"  # spin-downs were not asked for
    assert (verdict((), [slow], ran=joint).verdict, verdict((), [slow], ran=joint).missing) == (
        "cannot_be_judged", ("wheel speeds at a higher rate",),
    )  # fmt: skip
    assert verdict(LANE, [slow], ran=joint).verdict == "aquaplaning"


@pytest.mark.parametrize("cuts", [(), (1,), (7, 8, 500, 501, 777)])
def test_way_is_the_same_for_any_cut_and_knows_its_gaps(cuts):
    v = 20.0 + np.sin(np.arange(1000) / 50.0)
    v[300:400] = np.nan
    whole, cut = Way(0.01), Way(0.01)
    whole.push(v)
    for part in np.split(v, cuts):
        cut.push(part)
    assert cut.between(2.5, 6.5) == whole.between(2.5, 6.5)
    metres, seconds = whole.between(2.5, 6.5)
    assert seconds == pytest.approx(3.0)
    assert metres == pytest.approx(np.nansum(v[250:650]) * 0.01, abs=1e-6)
    assert whole.between(3.2, 3.8) == pytest.approx((0.0, 0.0))


def test_without_a_speed_the_mean_is_unknown():
    (e,) = episodes_of([event("resistance", 1.0, 2.0)], lambda a, b: (0.0, 0.0))
    assert math.isnan(e.v_x)
    assert math.isnan(e.distance_m)
