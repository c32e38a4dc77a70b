"""Verdicts from sets with evidence: a name needs 0.95 and its checks, else the answer is what the posterior holds."""

from dataclasses import replace

import pytest

from aqualog.diagnose.outcome import _apart
from aqualog.diagnose.records import SURE, Cause, Estimate
from aqualog.diagnose.verdict import DOUBTED, candidates, decided


def cause(name, where=None, *, large=True):
    return Cause(name, where, {"x": Estimate(1.0, 0.5, 1.5, "-")}, (), f"{name} {where}."), large


def verdict(options, failed=()):
    sets = candidates([(tuple(causes), evidence) for causes, evidence in options], lambda causes: causes)
    return decided(sets, lambda group: group[0], lambda best: failed)


def test_a_set_far_ahead_is_named_with_its_probability():
    found = verdict([([cause("drag")], 0.0), ([cause("slope")], -15.0), ([], -40.0)])
    assert found.verdict == "named"
    assert found.causes[0].probability >= SURE
    assert found.certain == {"drag"}


def test_close_sets_are_listed_until_they_hold_the_posterior():
    found = verdict([([cause("drag"), cause("gain")], 0.0), ([cause("slope"), cause("gain")], -1.0), ([], -40.0)])
    assert found.verdict == "cannot_tell"
    assert [c.effect for c in found.causes] == ["gain", "drag", "slope"]
    assert found.certain == {"gain"}
    assert [[c.effect for c in a.causes] for a in found.alternatives] == [["slope", "gain"]]
    assert found.alternatives[0].evidence_ratio == pytest.approx(2.71828, rel=1e-4)
    assert sum(q for _, q in found.rivals) == pytest.approx(1.0)


def test_the_most_probable_cause_comes_first():
    found = verdict([([cause("drag"), cause("slope")], 0.0), ([cause("slope")], -0.5), ([cause("gain")], -1.5)])
    assert [c.effect for c in found.causes] == ["slope", "drag", "gain"]


def test_one_effect_at_two_places_is_listed_at_both():
    found = verdict([([cause("drag", "f"), cause("drag", "r")], 0.0), ([cause("slope")], -1.0), ([], -40.0)])
    assert [c.key for c in found.causes] == ["drag@f", "drag@r", "slope"]


def test_a_set_that_stands_for_another_leaves_it_its_share():
    options = [("drag", 0.0), ("trailer of nothing", 0.0)]
    (only,) = candidates(options, lambda name: (cause(name),) if name == "drag" else None)
    assert (only.names, only.share) == ({"drag"}, 1.0)


def test_the_same_names_at_other_places_count_together():
    found = verdict([([cause("drag", "f")], 0.0), ([cause("drag", "r")], -0.5), ([cause("slope")], -15.0)])
    assert found.verdict == "named"
    assert found.notes == ("Equally possible: drag r.",)


def test_wheels_between_which_nothing_decides_share_the_probability():
    fr = [cause("drag", "fr")]  # once alone, once beside what is too small
    sets = [
        ([cause("drag", "fl")], 0.0),
        (fr, -1.4),
        ([*fr, cause("gain", large=False)], -1.4),
        ([cause("slope")], -15.0),
    ]
    made = candidates([(tuple(causes), evidence) for causes, evidence in sets], lambda causes: causes)
    found = decided(made, lambda group: replace(group[0], torn=tuple(group[1:])), lambda best: ())
    assert found.verdict == "cannot_tell"
    assert [(c.key, round(c.probability, 2)) for c in found.causes] == [("drag@fl", 0.65), ("drag@fr", 0.32)]
    assert [[c.key for c in a.causes] for a in found.alternatives] == [["drag@fr"]]
    assert (found.certain, found.notes) == (frozenset(), ())
    assert sum(q for _, q in found.rivals) == pytest.approx(1.0)


def test_only_other_wheels_are_apart():
    def at(where):
        return candidates([((cause("drag", where),), 0.0)], lambda causes: causes)[0]

    assert _apart(at("fl"), at("fr"))
    assert _apart(at("f"), at("rl"))
    assert not any(_apart(at(a), at(b)) for a, b in [("fl", "f"), ("fl", None), (None, "fl"), ("v_x", "a_x")])


def test_another_signal_is_another_cause():
    found = verdict([([cause("delay", "v_x")], 0.0), ([cause("delay", "a_x")], -1.0), ([cause("slope")], -15.0)])
    assert found.verdict == "cannot_tell"
    assert [(c.key, round(c.probability, 2)) for c in found.causes] == [("delay@v_x", 0.73), ("delay@a_x", 0.27)]
    assert (found.certain, found.notes) == (frozenset(), ())


def test_a_cause_of_one_drive_has_the_probability_that_this_drive_has_it():
    (a, large), b = cause("drag"), cause("slope")
    in_d1, in_d2 = (replace(a, drives=(d,)) for d in ("d1", "d2"))
    found = verdict([([(in_d1, large)], 0.0), ([(in_d2, large)], -0.5), ([b], -15.0)])
    assert found.verdict == "cannot_tell"
    assert found.causes[0].drives == ("d1",)
    assert found.causes[0].probability == pytest.approx(0.62, abs=0.01)
    assert found.notes == ("Equally possible: drag None.",)


def test_a_cause_that_fails_its_check_is_not_named():
    found = verdict([([cause("drag")], 0.0), ([], -40.0)], failed=("it has no gain.",))
    assert found.verdict == "cannot_tell"
    assert found.certain == frozenset()
    assert found.causes[0].probability == DOUBTED < SURE
    assert found.notes == ("Not named: it has no gain.",)


def test_what_is_too_small_is_no_effect():
    found = verdict([([cause("drag", large=False)], 0.0), ([], -40.0)])
    assert (found.verdict, found.causes) == ("no_effect", ())
    assert found.notes == ("Significant, but too small to be worth naming: drag None.",)
    assert verdict([]).verdict == "no_effect"


def test_the_likeliest_that_is_not_named_is_said_where_no_effect_is_likelier():
    found = verdict([([], 0.0), ([cause("drag")], -2.0), ([cause("slope")], -8.0)])
    assert (found.verdict, found.causes) == ("no_effect", ())
    assert found.notes == ("Not named, with a probability of 0.12: drag None.",)
    assert verdict([([], 0.0), ([cause("drag")], -4.0)]).notes == ()
