"""The laws of water are forgiven by what their sources leave open; what water does is refitted on every wet log."""

from functools import cache

import numpy as np

from aqualog.diagnose.arena import arena_of
from aqualog.diagnose.compete import compete
from aqualog.diagnose.drive import prepare
from aqualog.diagnose.hypotheses import hypotheses
from aqualog.diagnose.refit import DOUBT, KNOWN, metric
from aqualog.diagnose.search import _of_water, simulated
from aqualog.diagnose.subsets import supported
from aqualog.diagnose.tolerances import WATER_TOLERANCES
from aqualog.model.term import Model
from tests.diagnose.test_drive import CAR, NOISY, signals, term
from tests.diagnose.test_floating import wet


def test_the_laws_of_water_are_asked_about_on_water_alone():
    names = {t.name for t in WATER_TOLERANCES}
    on_water, _ = hypotheses([prepare(wet(), CAR, "a")], Model())
    assert {h.effect.name for h in on_water if h.allowed and h.of_water} == names
    dry, _ = hypotheses([prepare(signals(), CAR, "a")], Model())
    assert not any(h.of_water for h in dry)


@cache
def evidence():
    d = prepare(wet(sensors=NOISY), CAR, "a")
    return simulated([d], [h for h in hypotheses([d], Model())[0] if h.of_water], Model(), lambda _t, _s: None)


def test_names_and_values_allow_for_more_than_the_laws_of_water_may_be_off_by():
    b = evidence()
    arena = arena_of(b, ())
    weighings = arena.weighed([[p.residual] for p in arena.parts])
    known = metric(arena, weighings, share=KNOWN)
    np.testing.assert_array_equal(known.M, metric(arena, weighings).M)
    at = np.flatnonzero(b.tolerance > 0.0)
    A = weighings[0].rows(b.signatures[0][at] * (DOUBT * b.tolerance[at])[:, None, None])
    np.testing.assert_allclose(known.A, A)


def test_each_thing_that_water_does_is_refitted():
    b = evidence()
    keys = {b.asked[i].key for (i,) in _of_water(b)}
    assert {"water_drag", "contact_loss"} <= keys
    assert keys <= {"water_drag", "contact_loss", "track_clearing", "uneven_water@left", "uneven_water@right"}


def test_what_acts_everywhere_is_barred_where_only_the_water_shows_it():
    d = prepare(wet(term("aero_drag", delta_drag_area=0.3), sensors=NOISY), CAR, "a")
    asked = [h for h in hypotheses([d], Model())[0] if h.of_water or h.key in ("aero_drag", "payload_mass")]
    b = supported(simulated([d], asked, Model(), lambda _t, _s: None))
    barred = {h.key for h, x in zip(b.asked, b.barred, strict=True) if x}
    assert barred == {"payload_mass"}
    arena = arena_of(b, ())
    assert "payload_mass" not in {x.key for x in arena.blocks}
    assert "aero_drag" in {arena.blocks[m].key for m in compete(arena).best}


def test_a_dry_drive_bars_nothing():
    d = prepare(signals(sensors=NOISY), CAR, "a")
    b = simulated([d], [h for h in hypotheses([d], Model())[0] if h.key == "aero_drag"], Model(), lambda _t, _s: None)
    assert supported(b) is b
