"""The grammar of verdicts, on sets that are made up."""

from dataclasses import replace

import numpy as np
import pytest

from aqualog.diagnose.outcome import conclude
from aqualog.diagnose.refit import Refit
from aqualog.diagnose.search import Candidate
from aqualog.model.term import Model
from tests.diagnose.test_subsets import ASKED, AT, bench_of, waves

S = waves(600, len(ASKED), seed=99) / np.array([h.parameter(h.free[0]).sigma for h in ASKED])[:, None, None]
LEFT = np.random.default_rng(0).standard_normal((2, 600))
BENCH = bench_of(LEFT, S)
CLEAR = 1e-12


def candidate(ratio=1.0, inflation=1.0, **values):
    """A refitted set: key (`tyre_radius_fl` for `tyre_radius@fl`) to absolute value, each with an sd of a tenth."""
    index = [next(i for k, i in AT.items() if k.replace("@", "_") == name) for name in values]
    members = tuple(ASKED[i] for i in index)
    x = np.array(list(values.values()))
    names = tuple((k, h.free[0]) for k, h in enumerate(members))
    neutral = np.array([h.parameter(h.free[0]).neutral for h in members])
    cov = np.diag((0.1 * (x - neutral)) ** 2)
    return Candidate(Refit(members, names, x, cov, 0.0, Model(), (LEFT,), (S[index],), False), ratio, inflation)


def told(*candidates, p_value=CLEAR):
    return conclude(BENCH, candidates, Model(), p_value=p_value)


def names(outcome):
    return [c.key for c in outcome.causes]


def test_nothing_found_is_no_effect():
    assert told(p_value=0.5)[:3] == ("no_effect", (), ())


def test_a_test_beyond_doubt_without_a_set_is_unexplained():
    o = told(p_value=1e-9)
    assert o.verdict == "unexplained"
    assert o.chosen is None


def test_one_set_of_one_is_named_with_its_interval():
    o = told(candidate(payload_mass=200.0, inflation=4.0))
    assert o.verdict == "named"
    e = o.causes[0].parameters["delta_mass"]
    # inflation 4: the sd of 20 kg counts twice
    assert (e.value, e.low, e.high, e.unit) == (
        200.0,
        pytest.approx(200.0 - 1.96 * 40.0, abs=0.1),
        pytest.approx(278.4, abs=0.1),
        "kg",
    )
    assert (
        o.causes[0].sentence == "The car weighed 200 kg more than the vehicle file says; 95 % interval 122 to 278 kg."
    )


def test_an_interval_ends_at_the_physical_bound():
    e = told(candidate(road_grade=0.19)).causes[0].parameters["grade"]
    assert e.high == 0.2


def test_one_set_of_two_is_compound():
    o = told(candidate(payload_mass=200.0, tyre_radius_fl=0.01))
    assert o.verdict == "compound"
    assert names(o) == ["payload_mass", "tyre_radius@fl"]


def test_two_credible_sets_cannot_be_told_apart():
    o = told(candidate(payload_mass=200.0), candidate(3.0, torque_gain=0.9))
    assert o.verdict == "cannot_tell"
    assert names(o) == ["payload_mass", "torque_gain"]
    assert [a.evidence_ratio for a in o.alternatives] == [3.0]
    assert o.chosen.members[0].key == "payload_mass"


def test_what_all_sets_have_comes_first():
    o = told(candidate(payload_mass=200.0, tyre_radius_fl=0.01), candidate(2.0, torque_gain=0.9, tyre_radius_fl=0.01))
    assert o.verdict == "cannot_tell"
    assert names(o) == ["tyre_radius@fl", "payload_mass", "torque_gain"]


def test_a_set_that_is_far_less_likely_is_no_alternative():
    assert told(candidate(payload_mass=200.0), candidate(21.0, torque_gain=0.9)).verdict == "named"
    assert told(candidate(payload_mass=200.0), candidate(19.0, torque_gain=0.9)).verdict == "cannot_tell"


def test_places_of_one_effect_are_one_cause():
    o = told(candidate(tyre_radius_fl=0.01), candidate(2.0, tyre_radius_f=0.01))
    assert o.verdict == "named"
    assert names(o) == ["tyre_radius@fl"]
    assert any(n.startswith("Equally possible: ") and "front axle" in n for n in o.small)


@pytest.mark.parametrize(("worse", "place"), [(0.0, "tyre_radius@f"), (12.0, "tyre_radius@fl")])
def test_the_place_is_where_what_is_known_speaks_for_it(worse, place):
    """All tolerances together forgive the other place; with a part of them one explains far more."""
    axle = replace(candidate(tyre_radius_f=0.01), sharp=1000.0 + worse)
    wheel = replace(candidate(1.2, tyre_radius_fl=0.02), sharp=1000.0 + 0.1 * (worse == 0.0))
    o = told(axle, wheel)
    assert o.verdict == "named"
    assert names(o) == [place]
    assert any("Equally possible" in n for n in o.small) == (worse == 0.0)


def test_what_is_too_small_is_said_and_not_named():
    o = told(candidate(payload_mass=10.0))
    assert (o.verdict, o.causes, o.chosen) == ("no_effect", (), None)
    assert len(o.small) == 1
    assert "too small to be worth naming: The car weighed 10 kg more" in o.small[0]


def test_a_small_member_beside_a_large_one_is_left_out():
    o = told(candidate(payload_mass=10.0, tyre_radius_fl=0.01))
    assert o.verdict == "named"
    assert names(o) == ["tyre_radius@fl"]
    assert len(o.small) == 1


def test_a_value_is_judged_against_the_model_at_hand():
    from tests.diagnose.test_drive import term

    known = Model((term("payload_mass", delta_mass=195.0),))
    assert conclude(BENCH, [candidate(payload_mass=200.0)], known, p_value=CLEAR).verdict == "no_effect"


def test_a_cause_explains_the_channels_that_it_takes_away():
    one_channel = S.copy()
    one_channel[AT["payload_mass"], 1] = 0.0
    c = candidate(payload_mass=200.0)
    r = c.refit
    only = Refit(
        r.members,
        r.names,
        r.values,
        r.covariance,
        0.0,
        r.model,
        r.residuals,
        (one_channel[[AT["payload_mass"]]],),
        False,
    )
    assert told(Candidate(only, 1.0, 1.0)).causes[0].explains == ("axle_slip",)


def test_members_too_small_to_name_do_not_make_alternatives():
    o = told(
        candidate(payload_mass=200.0, road_grade=1e-4),
        candidate(2.0, payload_mass=200.0, tyre_radius_fl=1e-5),
        candidate(2.1, payload_mass=200.0, accelerometer_bias_a_x=1e-3),
    )
    assert o.verdict == "named"
    assert names(o) == ["payload_mass"]


def test_what_is_certain_is_not_called_open():
    from aqualog.diagnose.records import Cause
    from aqualog.diagnose.words import verdict_sentence

    causes = [Cause(n, None, {}, (), "") for n in ("payload_mass", "aero_drag", "head_wind")]
    said = verdict_sentence("cannot_tell", causes, level=0.01, certain=frozenset({"payload_mass"}))
    assert said == "Certain: payload mass. This log cannot distinguish the other causes: aero drag or head wind."
    both = verdict_sentence("cannot_tell", causes[1:], level=0.01)
    assert both == "The car differs from the model, but this log cannot distinguish aero drag and head wind."


def test_what_days_differ_by_is_not_multiplied_with_the_noise():
    c = candidate(payload_mass=200.0, inflation=4.0)  # 20 kg of noise, twice
    days = replace(c.refit, covariance=c.refit.covariance + 30.0**2, apart=np.array([30.0]))
    assert replace(c, refit=days).sd[0] == pytest.approx(np.hypot(40.0, 30.0))
