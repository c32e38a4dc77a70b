"""Checks on drawn drives, with few seeds: what must come out, and that a detector without its rule does not pass."""

from types import SimpleNamespace

import numpy as np
import pytest

from aqualog.evaluate.labels import Label, Labels
from aqualog.thesis.checks import joint, resistance, slip_slope, wheels
from aqualog.thesis.claims import DIFFERENCE, NOT_REPRODUCED, REPRODUCED
from aqualog.thesis.evidence.drives import NUISANCE, WATER, Score, bits_of, detected, score, taken, threshold_for
from aqualog.thesis.evidence.seeds import Plan

FEW = Plan(range(1, 3))


@pytest.fixture
def few(monkeypatch):
    """The rules' checks with two drives on water and one other of each situation."""
    monkeypatch.setattr(joint, "_PER_WATER", 2)
    monkeypatch.setattr(joint, "_PER_OTHER", 1)
    return FEW


def test_detectors_see_no_truth():
    d = taken("puddle", 1)
    assert not [c for c in d.signals.frame.columns if c.startswith("true_")]
    assert set(d.truth) == {f"{what}_{w}" for what in ("slip", "contact") for w in ("fl", "fr", "rl", "rr")}
    assert d.truth["slip_fl"].size == d.t.size == d.signals.frame.height
    assert taken("puddle", 1) is d


def test_two_kinds_of_situations():
    assert len(WATER) == 9
    assert len(NUISANCE) >= 25
    assert not set(WATER) & set(NUISANCE)


def test_a_score_counts_episodes_found_and_false_alarms():
    wet, dry = taken("lane_deep", 1), taken("dry_cruise", 1)
    assert wet.labels.of("full")
    never, always = (np.full(wet.t.size, x) for x in (False, True))
    blinking = np.arange(dry.t.size) % 1000 < 100
    assert score([(wet, never)], [(dry, blinking)]).recall == 0.0
    seen = score([(wet, never)], [(dry, blinking)])
    assert seen.false == -(-dry.t.size // 1000)
    assert seen.dry_s == pytest.approx(dry.t.size * dry.signals.dt)
    # an alarm that is on all the time has not found anything
    assert score([(wet, always)], []).found == 0
    in_water = np.zeros(wet.t.size, dtype=bool)
    for a, b in wet.labels.water:
        in_water |= (wet.t >= a) & (wet.t < b)
    assert score([(wet, in_water)], []).recall == 1.0
    assert isinstance(wet.labels, Labels)
    assert isinstance(wet.labels.items[0], Label)


def test_the_largest_threshold_with_a_recall():
    recalls = {1.0: 3, 2.0: 5, 3.0: 4, 4.0: 1}
    best, found = threshold_for(0.8, list(recalls), lambda x: Score(recalls[x], 5, 0, 1.0))
    assert (best, found.found) == (3.0, 4)
    best, found = threshold_for(1.1, list(recalls), lambda x: Score(recalls[x], 5, 0, 1.0))
    assert (best, found.found) == (2.0, 5)


def test_variants_hold_the_detectors_own_bits():
    d = taken("lane_deep", 1)
    bits, result = bits_of(d), detected(d)
    slope = np.any([t.active for t in result.tracks if t.detector == "slip_slope_drop"], axis=0)
    assert (bits["slope"] == slope).all()
    for name in ("joint_criteria", "gate", "ungated", "criterion_1", "spin_down"):
        assert bits[name].any()
    # what is asked less is met more often
    for less, more in (("joint_criteria", "ungated"), ("criterion_1", "spin_down")):
        assert bits[more].sum() >= bits[less].sum()


@pytest.mark.nightly
def test_sign_of_the_speed_difference(monkeypatch):
    monkeypatch.setattr(wheels, "_PER_WATER", 4)
    more = Plan(range(1, 5))
    found = wheels._sign_of_speed(more)
    assert found.verdict in (REPRODUCED, DIFFERENCE)
    assert found.value < 0.1
    # a detector that is its bare sum is no better than the bare sum
    from aqualog.detect import cusum, spin

    bare = lambda p, s, a, dv, v, ok: (*cusum.scan(p.cusum, cusum.initial_state(), p.sign * a)[:2], s)  # noqa: E731
    monkeypatch.setattr(spin, "scan", bare)
    assert wheels._sign_of_speed(more).verdict == NOT_REPRODUCED


@pytest.mark.nightly
def test_the_gate(few, monkeypatch):
    found = joint._gate(few)
    assert found.verdict == REPRODUCED
    assert found.value < 0.5
    without = joint.variants
    monkeypatch.setattr(joint, "variants", lambda n, s: {**without(n, s), "joint_criteria": without(n, s)["ungated"]})
    assert joint._gate(few).verdict == NOT_REPRODUCED


@pytest.mark.nightly
def test_braking_forces(few, monkeypatch):
    assert joint._spin_down(few).verdict in (REPRODUCED, DIFFERENCE)
    without = joint.variants
    monkeypatch.setattr(joint, "variants", lambda n, s: {**without(n, s), "criterion_1": without(n, s)["spin_down"]})
    assert joint._spin_down(few).verdict == NOT_REPRODUCED


@pytest.mark.nightly
def test_resistance_is_its_own_indicator(few):
    assert joint._resistance(few).verdict in (REPRODUCED, DIFFERENCE)


def test_detections_by_rule_and_by_truth():
    """C66 and C68: none begins against its rule, and four of five are true."""

    def verdict(lawful, true):
        return joint._by_rule("C66.drives", "minor spin-down", lawful, true).verdict

    assert verdict([True] * 10, [True] * 8 + [False] * 2) == REPRODUCED
    assert verdict([True] * 9 + [False], [True] * 10) == DIFFERENCE
    assert verdict([True] * 10, [True] * 7 + [False] * 3) == NOT_REPRODUCED
    assert verdict([], []) == NOT_REPRODUCED


def test_minor_spin_downs_begin_by_their_rule(monkeypatch):
    monkeypatch.setattr(joint, "_all", lambda plan: [taken("lane_deep", 1), taken("puddle", 1)])
    assert joint._minor(FEW).value > 0.8
    # a detector that begins far below its limits begins against the rule
    strict = joint.MinorParams.make(0.01, 1e9)
    monkeypatch.setattr(joint, "MinorParams", SimpleNamespace(make=lambda dt: strict))
    assert joint._minor(FEW).found.startswith("0 of ")


def test_sign_and_balance_of_the_resistance(monkeypatch):
    assert resistance._sign(Plan(range(1, 7))).verdict == REPRODUCED
    assert resistance._balance(FEW).verdict == DIFFERENCE
    measure = resistance._measure
    monkeypatch.setattr(resistance, "_measure", lambda *a: -measure(*a))
    assert resistance._sign(Plan(range(1, 7))).verdict == NOT_REPRODUCED


def test_mass_and_rolling_resistance_matter_most():
    effect = resistance._parameters()
    # a car that is heavier than its file says seems to be held back, the more the harder it accelerates
    assert 0.0 < effect["mass"]["80 km/h"] < 0.2 * effect["mass"]["80 km/h, 1 m/s^2"]
    assert effect["rolling_resistance"]["80 km/h"] == pytest.approx(0.3 * 0.0105 * 9.80665, rel=0.02)
    drag = effect["drag_area"]
    assert drag["120 km/h"] == pytest.approx(2.25 * drag["80 km/h"], rel=1e-6)


def test_high_pressure_and_winter_tyres():
    assert slip_slope._pressure_and_tread(FEW).verdict == REPRODUCED


def test_slopes_of_other_roads(monkeypatch):
    few = Plan((1,))
    found = {c.part: c.verdict for c in slip_slope._unchanged(few)}
    assert found["detection"] == REPRODUCED
    everywhere = {"slope": np.ones(1, dtype=bool), "joint_criteria": np.ones(1, dtype=bool)}
    monkeypatch.setattr(slip_slope, "variants", lambda n, s: everywhere)
    assert {c.part: c.verdict for c in slip_slope._unchanged(few)}["detection"] == NOT_REPRODUCED
    assert slip_slope._not_unique(few).verdict == NOT_REPRODUCED
