"""Where an effect begins in a drive: found from the response of another one, without a simulation of each moment."""

from dataclasses import replace

import numpy as np
import pytest

from aqualog.diagnose.arena import Part, arena_of, by_drives, competing
from aqualog.diagnose.drive import prepare
from aqualog.diagnose.elements import begun, intervals, moments, trapezoid
from aqualog.diagnose.hypotheses import hypotheses, residual, signatures
from aqualog.diagnose.search import simulated
from aqualog.model.term import Model
from tests.diagnose.test_drive import CAR, NOISY, plain, signals, term


@pytest.mark.parametrize(("where", "start", "duration"), [("fr", 31.0, 22.0), ("rl", 52.0, 3.0)])
def test_a_tyre_that_loses_its_air(where, start, duration):
    log = signals(term("pressure_loss", where, radius=0.006, start=start, duration=duration), sensors=NOISY)
    d = prepare(log, CAR, "a")
    asked, _ = hypotheses([d], Model())
    like = [h for h in asked if h.effect.name == "tyre_radius"]
    base = residual(d, Model())
    found = {h.where: h for h in moments(d, base, like, signatures(d, Model(), like, base=base))}
    assert set(found) == {"fl", "fr", "rl", "rr"}
    h = found[where]
    middle = h.fixed["start"] + 0.5 * h.fixed["duration"]
    assert middle == pytest.approx(start + 0.5 * duration, abs=2.0)
    assert h.fixed["duration"] == pytest.approx(duration, abs=6.0)
    assert h.free == ("radius",)


def test_each_drive_has_its_own_moments():
    one = prepare(plain(), CAR, "a")
    few = [h for h in hypotheses([one], Model())[0] if h.effect.name in ("tyre_radius", "aero_drag")]
    evidence = simulated([one], few, Model(), lambda _t, _s: None)
    assert [h.key for h in evidence.asked[len(few) :]] == [f"pressure_loss@{w}" for w in ("fl", "fr", "rl", "rr")]
    assert len(evidence.signatures[0]) == len(evidence.asked)
    # the price of four wheels and ten moments
    prior = {b.key: b.log_prior for b in arena_of(evidence, ()).blocks}
    assert prior["pressure_loss@fl"] == pytest.approx(np.log(0.03 / 40.0))
    both = [one, prepare(plain(), CAR, "b")]
    of_both = [h for h in hypotheses(both, Model())[0] if h.effect.name in ("tyre_radius", "payload_mass")]
    evidence = simulated(both, of_both, Model(), lambda _t, _s: None)
    begun = [(i, h) for i, h in enumerate(evidence.asked) if h.key == "pressure_loss@fl"]
    assert [h.drive for _, h in begun] == ["a", "b"]
    for i, h in begun:  # what one drive has shows in it alone
        sizes = [np.abs(s[list(evidence.columns[i])]).max() for s in evidence.signatures]
        assert [x > 0.0 for x in sizes] == [h.drive == "a", h.drive == "b"]
    load = next(h for h in of_both if h.key == "payload_mass")
    # besides, a torque that differs from drive to drive looks like a load
    exact = replace(CAR, spread={"torque_gain": 1e-9})
    both = [replace(d, vehicle=exact) for d in both]
    evidence = simulated(both, of_both, Model(), lambda _t, _s: None)
    alone = simulated([one], [load], Model(), lambda _t, _s: None).forgiven[0]
    loads = [c for h, (c, *_) in zip(evidence.asked, evidence.columns, strict=True) if h.key == "payload_mass"]
    # what is forgiven of one of them is what is forgiven of a single drive
    assert np.hypot(*evidence.forgiven[loads[:2]]) == pytest.approx(alone)
    own = [b for b in arena_of(evidence, ()).blocks if b.key == "payload_mass"]
    assert len(own) == 3  # in both, in each
    assert sum(np.exp(b.log_prior) for b in arena_of(evidence, ()).blocks if "payload" in b.key) == pytest.approx(0.03)


def test_drives_that_do_not_compete_are_said():
    drives = [prepare(plain(), CAR, name) for name in "abc"]
    stretch = slice(0, drives[0].mask.size)
    parts = [
        Part(i, stretch, np.zeros((1, 1)), drives[i].mask, ("kinematic",), np.zeros((1, 1, 1)), {}) for i in (0, 2)
    ]
    (note,) = competing(parts, drives)
    assert note.endswith("up to 20 min together, decide between the causes; left out: b.")
    assert competing([*parts, replace(parts[0], drive=1)], drives) == ()
    assert by_drives(parts, 3) == "By 2 of 3 drives: "
    assert by_drives(parts, 2) == ""


def test_a_ramp_and_two_intervals_are_where_they_are():
    n = 2000
    weight = np.full(n, 2.0)
    ramp = np.clip((np.arange(n) + 0.5 - 700.0) / 300.0 + 0.5, 0.0, 1.0)
    assert begun(weight, weight * (ramp - 3.0)) == (pytest.approx(700, abs=3), pytest.approx(300, abs=6))
    late = np.arange(300) > 284  # not long before the end
    assert begun(weight[:300], weight[:300] * late) == (pytest.approx(285, abs=4), pytest.approx(0, abs=8))
    two = 1.0 * trapezoid(n, 301, 450, 0) - 2.0 * trapezoid(n, 1500, 1700, 80)
    found = sorted(intervals(weight, weight * (two + 0.3)))
    assert len(found) == 2
    assert np.abs(np.array(found) - [(301, 450, 0), (1500, 1700, 80)]).max() <= 5
