"""The metrics on made-up rows: each has rows with which it is reached and rows with which it is not."""

from dataclasses import replace

import numpy as np
import pytest

from tests.blind.metrics import naming, worth
from tests.blind.metrics.intervals import clopper_pearson
from tests.blind.metrics.measure import right_first
from tests.blind.metrics.plan import PARTS, Job, Sizes, plan
from tests.blind.metrics.rows import Fact, Row, Said, Second, row_from, row_text
from tests.blind.metrics.run import run
from tests.blind.metrics.store import Store
from tests.blind.metrics.table import measures_text
from tests.blind.world.cases import Spec

MASS = Fact("payload_mass", None, {"delta_mass": 160.0}, z=20.0, p_right=0.999)
DRAG = Fact("aero_drag", None, {"delta_drag_area": 0.1}, z=12.0, p_right=0.99)
SAID = Said("payload_mass", None, {"delta_mass": (158.0, 150.0, 166.0)})
OTHER = Said("torque_gain", None, {"gain": (0.9, 0.88, 0.92)})


def row(i=0, group="named", verdict="named", truth=(MASS,), causes=(SAID,), **kw):
    return Row(
        f"{group}-{i}", group, kw.pop("programme", "mixed"), kw.pop("noise", "ou1"), i, truth, verdict, causes, **kw
    )


def reached(measures, name):
    return next(m.reached for m in measures if m.name == name)


def mixed(good, bad, count_bad, count=300):
    return [replace(bad if i < count_bad else good, key=str(i)) for i in range(count)]


def test_without_a_trial_a_share_may_be_anything():
    assert clopper_pearson(0, 0) == (0.0, 1.0)


def test_a_name_beside_the_right_one_is_a_wrong_name():
    both = row(verdict="compound", causes=(SAID, OTHER))
    assert both.wrong
    assert not right_first(both)
    assert not row().wrong
    open_ = row(verdict="cannot_tell", causes=(SAID, OTHER))
    assert not open_.wrong
    assert right_first(open_)


def test_the_place_belongs_to_the_name():
    truth = Fact("tyre_radius", "fl", {}, z=9.0, p_right=1.0)
    assert row(truth=(truth,), causes=(Said("tyre_radius", "fr"),)).wrong
    assert not row(truth=(truth,), causes=(Said("tyre_radius", "fl"),)).wrong


@pytest.mark.parametrize(("found", "ok"), [(45, True), (40, False), (50, False)])
def test_limits_are_met_with_the_power_that_they_state(found, ok):
    rows = mixed(row(group="limit"), row(group="limit", verdict="no_effect", causes=()), 50 - found, 50)
    assert reached(naming.limits(rows), "found at the stated limit") is ok


@pytest.mark.parametrize(("outside", "ok"), [(0, False), (6, True), (12, False)])
def test_coverage(outside, ok):
    off = row(causes=(Said("payload_mass", None, {"delta_mass": (130.0, 120.0, 140.0)}),))
    m = naming.coverage(mixed(row(), off, outside, 120))
    assert reached(m, "true value within the 95 % interval") is ok


def test_what_is_just_worth_naming_may_be_seen_more_often():
    just = replace(MASS, values={"delta_mass": 20.0})
    rows = mixed(
        row(group="limit", truth=(just,)), row(group="limit", truth=(just,), verdict="no_effect", causes=()), 4, 20
    )
    m = naming.limits(rows)
    assert reached(m, "found at the smallest size worth naming") is False
    assert reached(m, "found at the stated limit") is None
    assert reached(naming.limits(rows[4:] + rows[4:8]), "found at the smallest size worth naming") is True


def test_coverage_counts_only_right_names():
    assert naming.coverage([row(causes=(OTHER,))])[0].count == 0
    assert naming.coverage([row(verdict="cannot_tell")])[0].count == 0


@pytest.mark.parametrize(("shift", "ok"), [(0.0, True), (0.15, False)])
def test_forecasts(shift, ok):
    rng = np.random.default_rng(3)
    p = rng.uniform(0.5, 1.0, (40, 60))
    rows = [
        row(i, "pairs", pairs=tuple((float(x), bool(rng.random() < x - shift)) for x in case))
        for i, case in enumerate(p)
    ]
    m = naming.forecasts(rows)
    assert reached(m, "forecast against outcome, worst bin") is ok
    assert reached(m, "Brier skill over a constant") is ok


def test_confounds_must_list_all_members():
    members = ("payload_mass", "torque_gain")
    good = row(group="twins", verdict="cannot_tell", causes=(SAID, OTHER), separation=0.5, members=members)
    assert reached(naming.confounds([good] * 20), "cannot tell, all members listed") is True
    bare = replace(good, causes=(SAID,))
    assert reached(naming.confounds(mixed(good, bare, 1, 20)), "cannot tell, all members listed") is False
    assert (
        reached(naming.confounds(mixed(good, replace(good, verdict="named"), 1, 20)), "one name without reserve")
        is False
    )
    assert naming.confounds([replace(good, separation=5.0)])[0].count == 0


def test_members_of_alternatives_count_as_listed():
    r = row(
        group="twins",
        verdict="cannot_tell",
        causes=(SAID,),
        alternatives=(("torque_gain",),),
        separation=0.0,
        members=("payload_mass", "torque_gain"),
    )
    assert naming.confounds([r])[0].value == 1.0


def test_risk_falls_as_less_is_named():
    rows = [row(i, p_value=10.0 ** -(1 + i % 10), causes=(OTHER,) if i % 10 < 2 else (SAID,)) for i in range(100)]
    curve = naming.risk_coverage(rows)
    assert curve[0][1:] == (1.0, 0.2)
    assert curve[-1][1:] == (0.1, 0.0)


def test_manoeuvres():
    yes = Second("hard_acceleration", True, "named", (SAID,), advantage=3.0)
    no = replace(yes, verdict="cannot_tell")
    good = row(group="manoeuvre", verdict="cannot_tell", second=yes)
    assert reached(worth.manoeuvres([good] * 20), "resolved by the recommended run") is True
    assert (
        reached(worth.manoeuvres(mixed(good, replace(good, second=no), 2, 20)), "resolved by the recommended run")
        is False
    )
    wrong = replace(good, second=replace(yes, causes=(OTHER,)))
    assert reached(worth.manoeuvres([wrong] * 20), "resolved by the recommended run") is False
    none = replace(good, second=Second("none", False, ""))
    assert reached(worth.manoeuvres([none] * 10), "says that no run can") is True
    assert (
        reached(
            worth.manoeuvres([replace(none, second=Second("coast_down", False, "cannot_tell"))] * 10),
            "says that no run can",
        )
        is False
    )


def test_compounds():
    pair = (MASS, DRAG)
    drag = Said("aero_drag", None)
    good = row(group="compound", verdict="compound", truth=pair, causes=(SAID, drag), separation=0.6)
    m = worth.compounds(mixed(good, replace(good, verdict="named", causes=(SAID,)), 15, 100))
    assert [x.reached for x in m] == [True, True, True]
    m = worth.compounds(mixed(good, replace(good, causes=(SAID, drag, OTHER)), 16, 100))
    assert [x.reached for x in m] == [False, False, True]
    assert worth.compounds([replace(good, separation=0.2)])[0].count == 0


def test_gains():
    good = row(gain=98.0, oracle=100.0)
    m = worth.gains([good] * 60)
    assert [x.reached for x in m[:2]] == [True, True]
    m = worth.gains(mixed(good, replace(good, gain=10.0), 8, 60))
    assert [x.reached for x in m[:2]] == [True, False]
    missed = replace(good, verdict="", causes=(), gain=float("nan"), error="x")
    assert worth.gains(mixed(good, missed, 40, 60))[0].reached is False
    calm = [row(i, "null", "no_effect", (), (), worse=0.0) for i in range(60)]
    assert worth.gains(calm)[2].reached is True
    assert worth.gains([*calm, replace(calm[0], worse=0.02)])[2].reached is False


def test_detectors():
    one = {
        "alarms_before": 9.0,
        "alarms_after": 1.0,
        "alarms_oracle": 1.0,
        "km": 5.0,
        "passes": 10.0,
        "found_before": 8.0,
        "found_after": 8.0,
        "found_oracle": 8.0,
    }
    rows = [row(group="detector", detector=one)] * 10
    assert [m.reached for m in worth.detectors(rows)] == [True, True]
    assert worth.detectors([replace(r, detector=one | {"alarms_after": 2.0}) for r in rows])[0].reached is False
    assert worth.detectors([replace(r, detector=one | {"found_after": 7.0}) for r in rows])[1].reached is False


def test_rows_survive_the_way_to_disk():
    r = row(
        second=Second("none", False, "", (SAID,)),
        pairs=((0.7, True),),
        alternatives=(("torque_gain",),),
        limits={"aero_drag": 0.1},
    )
    assert repr(row_from(row_text(r))) == repr(r)  # NaN is not equal to itself


def test_a_run_that_was_killed_goes_on(tmp_path):
    jobs = [Job(f"a-{i}", "null", Spec("mixed", "white", (), i)) for i in range(4)]
    done = []

    def work(job):
        done.append(job.key)
        return row(job.spec.seed, "null", "no_effect", (), ()).__class__(
            job.key, "null", "mixed", "white", job.spec.seed, verdict="no_effect"
        )

    run(jobs[:2], Store(tmp_path), work, processes=1, say=lambda _: None)
    with (tmp_path / "rows.jsonl").open("a") as file:
        file.write('{"key": "a-2", "gro')  # killed while it wrote
    rows = run(jobs, Store(tmp_path), work, processes=1, say=lambda _: None)
    assert done == ["a-0", "a-1", "a-2", "a-3"]
    assert len(rows) == 4
    assert len(Store(tmp_path).rows) == 4


def test_the_plan():
    jobs = plan(PARTS, Sizes(), 1000)
    assert len({j.key for j in jobs}) == len(jobs)
    assert sum(j.group == "null" for j in jobs) >= 400
    named = [j for j in jobs if j.group == "named"]
    effects = {j.spec.hidden[0].effect for j in named}
    assert len(effects) >= 15
    assert all(sum(j.spec.hidden[0].effect == e for j in named) >= 20 for e in effects)
    assert len({j.spec.seed for j in jobs}) == len(jobs)
    assert all(1 <= j.spec.seed < 200 for j in plan(PARTS, Sizes(), 1))


def test_the_table_says_what_is_missed():
    half = [row(group="limit", verdict="no_effect" if i % 2 else "named") for i in range(60)]
    text = measures_text(naming.limits(half))
    assert "NO" in text
    assert "0.500" in text
