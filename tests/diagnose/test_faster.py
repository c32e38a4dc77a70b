"""Tone rings and seams beside the verdict of the search."""

from dataclasses import replace

import numpy as np
import pytest

from aqualog.diagnose import arena, faster, run
from aqualog.diagnose.faster import Faster, joined, pooled, remarks, to_causes, why_untested, with_rings, without_known
from aqualog.diagnose.full_rate import PerTurn
from aqualog.diagnose.records import Cause
from aqualog.diagnose.seams import Seam
from aqualog.diagnose.unknown_term import short_form
from aqualog.diagnose.verdict import Outcome
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Model, Term
from tests.diagnose.test_drive import CAR, term
from tests.diagnose.test_run import ask, noisy, told

FEW = ("payload_mass", "tyre_radius@fl")
MASS = Cause("payload_mass", None, {}, (), "The car is heavier.", 0.99)


def ring(wheel="fl", amplitude=4e-3, half=2e-4, p=1e-9, kind="ring"):
    return PerTurn(wheel, 1, kind, amplitude, amplitude - half, amplitude + half, p)


def seen(*found):
    return Faster(to_causes(found))


@pytest.fixture
def few(monkeypatch):
    ask(monkeypatch, FEW)
    monkeypatch.setattr(arena, "shapes", lambda *_: ())


def test_an_uneven_ring_is_named(few):
    d = told(log=noisy(term("tone_ring", "fl", amplitude=0.005), seed=3))
    assert d.verdict == "named"
    (cause,) = d.causes
    assert cause.key == "tone_ring@fl"
    assert cause.probability > 0.95
    e = cause.parameters["amplitude"]
    assert e.low <= 0.005 <= e.high
    assert d.sentence == cause.sentence
    assert [(t.effect.name, t.place, t.values["amplitude"]) for t in d.model.terms] == [("tone_ring", "fl", e.value)]
    assert d.gain is None  # no residual of the search shows it
    assert "tone_ring" not in d.untested
    again = told(log=noisy(term("tone_ring", "fl", amplitude=0.005), seed=3), model=d.model)
    assert (again.verdict, again.model) == ("no_effect", d.model)


def test_without_wheel_speeds_or_with_slow_ones_it_is_untested(few, monkeypatch):
    assert why_untested(()) == "no wheel speeds in the log"
    slow = [replace(ring(kind="untested"), reason="the wheel speeds come at 2 Hz")]
    monkeypatch.setattr(faster, "per_turn", lambda *_: slow)
    assert told().untested["tone_ring"] == "the wheel speeds come at 2 Hz"


def test_seams_are_notes(few, monkeypatch):
    one = Seam(81.3, -0.25, ("v_x",), 1e-6)
    monkeypatch.setattr(faster, "seams", lambda *_, **__: (one,))
    d = told()
    assert d.verdict == "no_effect"
    assert one.sentence in d.notes


@pytest.mark.parametrize(
    ("before", "own", "after"),
    [
        ("no_effect", (), "named"),
        ("named", (MASS,), "compound"),
        ("compound", (MASS, MASS), "compound"),
        ("cannot_tell", (MASS,), "cannot_tell"),
        ("unexplained", (), "unexplained"),
    ],
)
def test_a_ring_beside_each_verdict(before, own, after):
    out = joined(Outcome(before, own), seen(ring()))
    assert out.verdict == after
    assert [c.key for c in out.causes] == [*(c.key for c in own), "tone_ring@fl"]
    assert "tone_ring" in out.certain
    assert joined(Outcome(before, own), Faster()) == Outcome(before, own)


def test_a_wheel_that_varies_unlike_the_others_is_an_unknown_form():
    """All four alike are sound tyres; a ring to be named is no form, nor is its harmonic."""
    small = [replace(ring(w, 3e-4, 5e-5), order=2) for w in ("fl", "fr", "rl")]
    odd = replace(ring("rr", 1.5e-3), order=2)
    (form,) = faster.odd_wheels([*small, odd])
    assert (form.channel, form.mechanism, form.depends_on) == ("slip_rr", "slip", ("angle",))
    assert np.abs(form.f).max() == pytest.approx(1.5e-3)
    assert form.f[0] == pytest.approx(form.f[-1])
    assert np.count_nonzero(np.diff(np.sign(form.f))) == 4  # twice per turn
    assert "wheel RR, varying twice per turn by 0.15%, 5 times" in form.sentence
    assert short_form(form) == form.manner
    assert joined(Outcome("no_effect", ()), Faster(forms=(form,))).verdict == "unexplained"
    assert joined(Outcome("cannot_tell", (MASS,)), Faster(forms=(form,))).verdict == "cannot_tell"
    for others in ([replace(x, amplitude=8e-4) for x in small], [*small, ring("rr")], []):
        assert faster.odd_wheels([*others, odd]) == ()
    assert faster.odd_wheels([*small, replace(odd, kind="nothing")]) == ()
    small_ring = [*(ring(w, 3e-4) for w in ("fl", "fr")), ring("rl", 1.8e-3)]
    assert faster.odd_wheels(small_ring) == ()  # a known effect makes it
    assert "too little" in " ".join(remarks(small_ring))


def test_what_sound_wheels_show_is_no_name():
    """Measured sound wheels run out by up to 0.2 %; where the interval reaches down to that, it is not certain."""
    wide = to_causes([ring(amplitude=2.15e-3, half=6e-4)])[0]
    assert 0.5 < wide.probability < 0.9
    assert to_causes([ring(amplitude=1.9e-3)]) == ()
    assert to_causes([ring(amplitude=4e-3)])[0].probability > 0.99
    assert to_causes([ring(amplitude=4e-3, p=9e-3)])[0].probability < 0.5  # so much comes by chance


def test_limits_are_named_with_a_power_of_nine_in_ten():
    """At the limit, the amplitude that is found is smaller by 1.28 of its deviations in one of ten drives."""
    by_place = {
        x.where: x.size for x in faster.limits([ring(w, half=6e-4) for w in ("fl", "fr")] + [ring("rl", p=0.5)])
    }
    assert set(by_place) == {"fl", "fr", "rl", "f", "left"}
    assert 2e-3 < by_place["rl"] < by_place["f"] < by_place["fl"] == by_place["fr"]
    sd = ((6e-4 / 1.96) ** 2 + (0.05 * by_place["fl"]) ** 2) ** 0.5
    (cause,) = to_causes([ring(amplitude=by_place["fl"] - 1.28 * sd, half=6e-4)])
    assert cause.probability == pytest.approx(0.95, abs=0.01)
    assert [x.size > 0.0 for x in faster.limits([ring(kind="untested"), ring("fr", kind="speed")])] == [False]


def test_drives_together():
    (one,) = pooled([[ring(amplitude=4e-3)], [ring(amplitude=4.2e-3, p=1e-3)]])
    assert one.amplitude == pytest.approx(4.1e-3)
    assert one.p_value == pytest.approx(2e-9)
    assert one.high - one.low == pytest.approx(4e-4 / 2**0.5)
    assert pooled([[ring()], [ring(kind="untested")]]) == (ring(),)
    assert pooled([[ring()], [ring(kind="speed")]])[0].kind == "speed"
    assert pooled([[ring(p=8e-3)], [ring(kind="nothing", p=0.5)]])[0].kind == "nothing"


def test_known_rings():
    known = Model((Term(EFFECTS["tone_ring"], {"amplitude": 4e-3}, "f"),))
    assert faster._known(known) == {"fl": 4e-3, "fr": 4e-3}
    assert without_known([ring()], {"fl": 4e-3}) == ()
    assert without_known([ring()], {"fl": 1e-3}) == (ring(),)
    changed = with_rings(known, seen(ring("fl", 8e-3), ring("fr", 8e-3)))
    assert [(t.place, t.values["amplitude"]) for t in changed.terms] == [("f", pytest.approx(8e-3))]


def test_the_search_leaves_out_what_is_faster(few):
    drives, _ = run._prepared([("a", noisy())], CAR)
    asked, untested = run.hypotheses(drives, Model())
    assert "tone_ring" not in {h.effect.name for h in asked} | set(untested)
