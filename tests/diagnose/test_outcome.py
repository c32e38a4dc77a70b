"""The grammar of verdicts, on sets that are made up."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from aqualog.diagnose import outcome
from aqualog.diagnose.arena import arena_of
from aqualog.diagnose.compete import compete
from aqualog.diagnose.hypotheses import value_in
from aqualog.diagnose.outcome import conclude
from aqualog.diagnose.records import Cause, Estimate
from aqualog.diagnose.refit import Refit
from aqualog.diagnose.search import Found, Option
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Model
from tests.blind.multibody.tyre import tmeasy
from tests.diagnose.test_subsets import ASKED, AT, bench_of, waves

S = waves(600, len(ASKED), seed=99) / np.array([h.parameter(h.free[0]).sigma for h in ASKED])[:, None, None]
LEFT = np.random.default_rng(0).standard_normal((2, 600))
ARENA = arena_of(bench_of(LEFT, S), ())
POSTERIOR = compete(ARENA)
SURE = 10.0  # [nats] ahead of nothing


@pytest.fixture(autouse=True)
def few(monkeypatch):
    """No simulation: a set keeps its values, and its loss in a metric of few tolerances is made up."""
    monkeypatch.setattr(outcome, "sharpened", lambda _f, o, _m: (o.refit, o.refit.loss))
    monkeypatch.setattr(outcome, "repeats", lambda *_: ())


def option(evidence=SURE, sharp=0.0, signatures=S, model=Model(), **values):  # noqa: B008 - frozen
    """A refitted set: key (`tyre_radius_fl` for `tyre_radius@fl`) to absolute value, each with an sd of a tenth."""
    index = [next(i for k, i in AT.items() if k.replace("@", "_") == name) for name in values]
    members = tuple(ASKED[i] for i in index)
    x = np.array(list(values.values()))
    off = x - [value_in(model, h, h.free[0]) for h in members]
    cov = np.diag((0.1 * off) ** 2)
    r = Refit(members, x, off, cov, sharp, Model(), (LEFT,), (signatures[index],), (False,) * len(index))
    blocks = tuple(next(b for b, block in enumerate(ARENA.blocks) if block.tag == i) for i in index)
    return Option(blocks, evidence, r)


def told(*options, model=Model()):  # noqa: B008 - frozen
    return conclude(
        Found(SimpleNamespace(), np.zeros((1, 1)), np.zeros((1, 1)), SimpleNamespace(), ARENA, POSTERIOR, (), (*options, Option((), 0.0))),
        model,
    )  # fmt: skip


def names(found):
    return [c.key for c in found.causes]


def test_nothing_found_is_no_effect():
    assert told()[:3] == ("no_effect", (), ())


def test_one_set_of_one_is_named_with_its_interval_and_probability():
    o = told(option(payload_mass=200.0))
    assert o.verdict == "named"
    e = o.causes[0].parameters["delta_mass"]
    assert (e.value, e.unit) == (200.0, "kg")
    # its sd of 20 kg, and 5 % by which a car may respond more or less than its simulation
    assert (e.low, e.high) == (pytest.approx(156.2, abs=0.1), pytest.approx(243.8, abs=0.1))
    assert o.causes[0].probability == 0.97  # of those that it holds for certain, not more are there
    assert (
        o.causes[0].sentence == "The car weighed 200 kg more than the vehicle file says; 95 % interval 156 to 244 kg."
    )


def test_beside_an_unknown_form_nothing_is_certain_and_nothing_stands_at_a_bound(monkeypatch):
    def cause(key, value):
        p = EFFECTS[key].parameters[0]
        return Cause(key, None, {p.name: Estimate(value, value, value, p.unit)}, (), key), True

    causes = (cause("payload_mass", 200.0), cause("wheel_inertia", EFFECTS["wheel_inertia"].parameters[0].low))
    monkeypatch.setattr(outcome, "_linear", lambda *_: causes)
    found = Found(SimpleNamespace(), S, S, SimpleNamespace(), ARENA, replace(POSTERIOR, marginal={
        "payload_mass": 1.0, "wheel_inertia": 1.0,
    }), (SimpleNamespace(),), ())  # fmt: skip
    o = conclude(found, Model())
    assert (o.verdict, names(o), o.certain) == ("unexplained", ["payload_mass"], frozenset())
    assert o.causes[0].probability == 0.75


def test_a_name_that_a_form_outshines_is_not_certain():
    def with_form(name):
        found = Found(SimpleNamespace(), np.zeros((1, 1)), np.zeros((1, 1)), SimpleNamespace(), ARENA, POSTERIOR, (),
                      (option(payload_mass=200.0), Option((), 0.0)), {name: "a force on the car that goes with yaw rate"})  # fmt: skip
        return conclude(found, Model())

    o = with_form("payload_mass")
    assert (o.verdict, names(o), o.certain) == ("cannot_tell", ["payload_mass"], frozenset())
    assert o.causes[0].probability <= 0.9
    assert any("A force on the car that goes with yaw rate explains the log better than" in n for n in o.notes)
    assert with_form("aero_drag").verdict == "named"


def test_an_interval_that_reaches_the_physical_bound_is_no_name():
    """Up to 20 % of slope, or more: something else acts there. A bound that means no effect is none of that kind."""
    rivals = told(option(road_grade=0.19), option(SURE - 0.7, payload_mass=200.0))
    assert rivals.causes[0].parameters["grade"].high == 0.2
    assert rivals.verdict == "cannot_tell"
    alone = told(option(road_grade=0.19))
    assert (alone.verdict, alone.causes[0].probability) == ("cannot_tell", 0.9)
    assert alone.notes == ("Not named: the interval of road grade reaches its physical bound.",)
    assert told(option(road_grade=0.16)).verdict == "named"
    wide = option(road_grade=0.16)
    wide = replace(wide, refit=replace(wide.refit, covariance=np.diag([0.054**2])))
    assert (told(wide).verdict, told(wide).causes) == ("no_effect", ())  # 5 to 20 %, or more
    (payload,) = told(option(payload_mass=200.0)).causes
    h = next(h for h in ASKED if h.key == "payload_mass")
    own = payload.parameters["delta_mass"]
    assert not outcome._reaches_bound(replace(payload, parameters={"delta_mass": replace(own, low=own.value / 2.0)}), h)


def test_a_trailer_of_no_mass_is_drag_alone(monkeypatch):
    own = {"mass": Estimate(0.0, 0.0, 60.0, "kg"), "delta_drag_area": Estimate(0.4, 0.3, 0.5, "m2")}
    monkeypatch.setattr(outcome, "_linear", lambda *_: ((Cause("trailer", None, own, (), "."), True),))
    found = told(option(aero_drag=0.4), Option((0,), SURE))
    assert (found.verdict, names(found)) == ("named", ["aero_drag"])
    loss = {"radius": Estimate(0.01, 0.0, 0.02, "-"), "start": Estimate(0.0, math.nan, math.nan, "s")}
    assert not outcome._is_absent(Cause("pressure_loss", "fl", loss, (), "."))  # it begins with the log


def test_one_set_of_two_is_compound():
    o = told(option(payload_mass=200.0, tyre_radius_fl=0.01))
    assert o.verdict == "compound"
    assert names(o) == ["payload_mass", "tyre_radius@fl"]


def test_two_sets_that_share_the_posterior_cannot_be_told_apart():
    o = told(option(payload_mass=200.0), option(SURE - math.log(3.0), torque_gain=0.9))
    assert o.verdict == "cannot_tell"
    assert names(o) == ["payload_mass", "torque_gain"]
    assert [a.evidence_ratio for a in o.alternatives] == [pytest.approx(3.0)]
    assert [c.probability for c in o.causes] == pytest.approx([0.75, 0.25], abs=0.01)
    assert o.best.option.refit.members[0].key == "payload_mass"
    assert [q for _, q in o.rivals] == pytest.approx([0.75, 0.25], abs=0.01)


def test_what_all_sets_have_comes_first():
    o = told(
        option(payload_mass=200.0, tyre_radius_fl=0.01), option(SURE - 0.7, torque_gain=0.9, tyre_radius_fl=0.01)
    )  # fmt: skip
    assert o.verdict == "cannot_tell"
    assert names(o) == ["tyre_radius@fl", "payload_mass", "torque_gain"]
    assert o.certain == {"tyre_radius"}


@pytest.mark.parametrize(("behind", "verdict"), [(4.0, "named"), (2.0, "cannot_tell")])
def test_a_name_needs_19_of_20(behind, verdict):
    assert told(option(payload_mass=200.0), option(SURE - behind, torque_gain=0.9)).verdict == verdict


def test_places_of_one_effect_are_one_cause():
    o = told(option(sharp=-5.0, tyre_radius_fl=0.01), option(SURE - 0.7, tyre_radius_f=0.01))
    assert o.verdict == "named"
    assert names(o) == ["tyre_radius@fl"]
    assert any(n.startswith("Equally possible: ") and "front axle" in n for n in o.notes)


@pytest.mark.parametrize(("worse", "place"), [(0.0, "tyre_radius@f"), (8.0, "tyre_radius@f"), (12.0, "tyre_radius@fl")])
def test_the_place_is_where_what_is_known_speaks_for_it(worse, place):
    """All tolerances together forgive the other place; with a part of them one explains far more."""
    axle = option(sharp=1000.0 + worse, tyre_radius_f=0.01)
    wheel = option(SURE - 0.2, sharp=1000.0 + 0.1 * (worse == 0.0), tyre_radius_fl=0.02)
    o = told(axle, wheel)
    assert o.verdict == "named"
    assert names(o) == [place]


def test_one_effect_at_two_places_has_to_be_likelier_with_all_tolerances_too():
    both = option(SURE - 1.0, sharp=-100.0, tyre_radius_fl=0.02, tyre_radius_f=0.01)
    assert names(told(option(tyre_radius_fl=0.02), both)) == ["tyre_radius@fl"]
    assert len(names(told(option(SURE - 2.0, tyre_radius_fl=0.02), both))) == 2


def test_what_would_stand_at_a_bound_is_said_and_not_named():
    o = told(replace(option(payload_mass=200.0), beyond=option(slip_stiffness_r=2.5).members))
    assert names(o) == ["payload_mass"]
    assert o.notes[-1].startswith("Not named: slip stiffness (rear axle) would stand at its physical bound.")


def test_what_is_too_small_is_said_and_not_named():
    o = told(option(payload_mass=10.0))
    assert (o.verdict, o.causes, o.best) == ("no_effect", (), None)
    assert "too small to be worth naming: The car weighed 10 kg more" in o.notes[0]


def test_a_small_member_beside_a_large_one_is_left_out():
    o = told(option(payload_mass=10.0, tyre_radius_fl=0.01))
    assert o.verdict == "named"
    assert names(o) == ["tyre_radius@fl"]
    assert len(o.notes) == 1


def test_a_value_is_judged_against_the_model_at_hand():
    from tests.diagnose.test_drive import term

    known = Model((term("payload_mass", delta_mass=195.0),))
    assert told(option(payload_mass=200.0, model=known), model=known).verdict == "no_effect"


def test_a_cause_explains_the_channels_that_it_takes_away():
    one_channel = S.copy()
    one_channel[AT["payload_mass"], 1] = 0.0
    assert told(option(signatures=one_channel, payload_mass=200.0)).causes[0].explains == ("axle_slip",)


def test_members_too_small_to_name_do_not_make_alternatives():
    o = told(
        option(payload_mass=200.0, road_grade=1e-4),
        option(SURE - 0.7, payload_mass=200.0, tyre_radius_fl=1e-5),
        option(SURE - 0.7, payload_mass=200.0, accelerometer_bias_a_x=1e-3),
    )
    assert o.verdict == "named"
    assert names(o) == ["payload_mass"]


def test_a_failed_check_forbids_a_name(monkeypatch):
    monkeypatch.setattr(outcome, "repeats", lambda *_: ("it has the other sign in the last third of the drive.",))
    o = told(option(payload_mass=200.0))
    assert o.verdict == "cannot_tell"
    assert o.notes[-1].startswith("Not named: it has")
    assert o.certain == frozenset()


def test_what_is_not_named_and_makes_the_channels_larger_is_noise(monkeypatch):
    against = S.copy()
    against[AT["payload_mass"]] = -LEFT / 300.0
    assert told(option(signatures=against, payload_mass=200.0)).verdict == "named"
    assert told(option(SURE - 8.0, payload_mass=200.0)).verdict == "cannot_tell"
    assert told(option(SURE - 8.0, signatures=against, payload_mass=200.0)).verdict == "no_effect"
    monkeypatch.setattr(outcome, "repeats", lambda *_: ("a value stands at its physical bound.",))
    o = told(option(signatures=against, payload_mass=200.0))
    assert (o.verdict, o.causes, o.notes[-1]) == ("no_effect", (), "Not named: a value stands at its physical bound.")
    rivals = option(signatures=against, payload_mass=200.0), option(SURE - 0.7, torque_gain=0.9)
    assert told(*rivals).verdict == "cannot_tell"


def test_only_what_is_worth_naming_is_asked_whether_it_repeats(monkeypatch):
    asked = []
    monkeypatch.setattr(outcome, "repeats", lambda *given: asked.append(set(given[-1])) or ())
    assert told(option(payload_mass=200.0, head_wind=1e-6)).verdict == "named"
    assert asked == [{("payload_mass", "")}]


def test_a_place_that_was_not_refitted_is_open_too(monkeypatch):
    from aqualog.diagnose.search import Option
    from aqualog.diagnose.verdict import Candidate

    def at(where, share, refit):
        cause = Cause("tyre_radius", where, {}, (), "")
        return Candidate(Option((), 0.0, refit), ((cause, True),), 0.0, share)

    monkeypatch.setattr(outcome, "sharpened", lambda *_: (None, 1.0))
    for share, places in ((0.2, ["fr"]), (0.1, [])):  # a fifth decides
        group = [at("fl", 0.6, True), at("fr", share, None), at("f", 0.5, None)]
        assert [s.large[0].where for s in outcome._at_place(None, group, None).torn] == places


def test_what_is_certain_is_not_called_open():
    from aqualog.diagnose.records import Cause
    from aqualog.diagnose.words import verdict_sentence

    causes = [Cause(n, None, {}, (), "") for n in ("payload_mass", "aero_drag", "head_wind")]
    said = verdict_sentence("cannot_tell", causes, level=0.01, certain=frozenset({"payload_mass"}))
    assert said == "Certain: payload mass. This log cannot distinguish the other causes: aero drag or head wind."
    said = verdict_sentence(
        "cannot_tell", [replace(causes[1], probability=0.4), causes[0]], level=0.01, certain=frozenset({"payload_mass"})
    )
    assert said == "Certain: payload mass. This log leaves open: aero drag (probability 0.40)."
    road, mean = (Cause("road_grade", None, {}, (), "", p) for p in (1.0, 0.5))
    said = verdict_sentence("cannot_tell", [mean, causes[1], road], level=0.01, certain=frozenset({"road_grade"}))
    assert said == "Certain: road grade. This log cannot distinguish the other causes: road grade (mean) or aero drag."
    both = verdict_sentence("cannot_tell", causes[1:], level=0.01)
    assert both == "The car differs from the model, but this log cannot distinguish aero drag and head wind."
    one = verdict_sentence("cannot_tell", [replace(causes[0], probability=0.9)], level=0.01)
    why = "this log does not make it certain: payload mass (probability 0.90)"
    assert one == f"The car may differ from the model, but {why}."
    one = verdict_sentence("cannot_tell", causes[:1], level=0.01, certain=frozenset({"payload_mass"}))
    assert one == "One effect is likely, but it is not named: payload mass. The notes say why."
    none = verdict_sentence("no_effect", (), level=0.01, unjudged=["of 58 s on water 0 s are judged: in the rest ..."])
    assert none.startswith("No effect where the drive is judged: ")
    assert none.endswith(". But of 58 s on water 0 s are judged: in the rest ....")


def test_a_slope_of_the_tyre_is_known_as_well_as_the_form_of_its_curve():
    def slip(slope):  # where the force is 0.3 of the friction
        s = np.linspace(0.0, 0.03, 3001)
        return np.interp(0.3e3, [tmeasy(x, 0.0, 1e3, 1.0, slope, 25.0)[0] for x in s.tolist()], s)

    shown = (slip(28.0) / slip(1.4 * 28.0) - 1.0) / 0.4
    for name in ("slip_stiffness", "slip_stiffness_drift", "load_sensitivity"):
        assert EFFECTS[name].drive.doubt == pytest.approx(0.5 * (1.0 - shown), abs=0.01)
    for key, doubt in (("slip_stiffness_r", 0.13), ("payload_mass", 0.05)):  # beside the 10 % of the fit
        e = next(iter(told(option(**{key: 1.5 if doubt > 0.1 else 200.0})).causes[0].parameters.values()))
        change = 0.5 if doubt > 0.1 else 200.0
        assert (e.high - e.value) / (1.96 * change) == pytest.approx(math.hypot(0.1, doubt), rel=1e-3)
