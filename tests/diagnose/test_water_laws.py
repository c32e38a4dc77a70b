"""The laws of water are forgiven by what their sources leave open; what water does is refitted on every wet log."""

from functools import cache

import numpy as np

from aqualog.diagnose.drive import prepare
from aqualog.diagnose.evidence import gram_of, noises_after, without_deviations
from aqualog.diagnose.hypotheses import hypotheses
from aqualog.diagnose.refit import DOUBT, KNOWN, metric
from aqualog.diagnose.search import _of_water, simulated
from aqualog.diagnose.subsets import gains_on_top, supported
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


def test_what_a_law_of_water_may_be_off_by_is_taken_from_what_is_left_and_no_more():
    b = evidence()
    at = next(c[0] for h, c in zip(b.asked, b.columns, strict=True) if h.effect.name == "wedge_peak")
    off = b.tolerance[at] * b.signatures[0][at]
    y = b.residuals[0]
    taken = {
        n: float(np.sum((y + n * off - without_deviations(b, 0, y + n * off, [at])) * off) / np.sum(off**2))
        for n in (0, 9)
    }
    assert abs(taken[0]) < 3.0
    assert 0.5 < taken[9] - taken[0] < 9.0
    assert without_deviations(b, 0, y, []) is y


def test_names_and_values_allow_for_more_than_the_laws_of_water_may_be_off_by():
    b = evidence()
    noises = noises_after(b, b.residuals, {})
    known = metric(b, noises, share=KNOWN)
    np.testing.assert_array_equal(known.M, metric(b, noises).M)
    of = b.tolerance[b.tolerance > 0.0]
    M = np.linalg.inv(known.A @ known.A.T + np.diag((DOUBT * of) ** -2.0))
    np.testing.assert_allclose(known.M, M)


def test_each_thing_that_water_does_is_refitted_but_what_is_known_already():
    b = evidence()
    gram = gram_of(b, noises_after(b, b.residuals, {}), b.residuals)
    fits = _of_water(b, gram, set())
    keys = {b.asked[f.members[0]].key for f in fits}
    assert keys <= {"water_drag", "contact_loss", "track_clearing", "uneven_water@left", "uneven_water@right"}
    assert {"water_drag", "contact_loss"} <= keys
    assert not _of_water(b, gram, {f.members for f in fits})


def test_what_acts_everywhere_is_barred_where_only_the_water_shows_it():
    d = prepare(wet(term("aero_drag", delta_drag_area=0.3), sensors=NOISY), CAR, "a")
    asked = [h for h in hypotheses([d], Model())[0] if h.of_water or h.key in ("aero_drag", "payload_mass")]
    b = supported(simulated([d], asked, Model(), lambda _t, _s: None))
    barred = {h.key for h, x in zip(b.asked, b.barred, strict=True) if x}
    assert barred == {"payload_mass"}
    gains = gains_on_top(b, gram_of(b, noises_after(b, b.residuals, {}), b.residuals), ())
    assert not gains[b.barred].any()
    on_the_road = next(i for i, h in enumerate(b.asked) if h.key == "aero_drag")
    assert gains[on_the_road] > 20.0


def test_a_dry_drive_bars_nothing():
    d = prepare(signals(sensors=NOISY), CAR, "a")
    b = simulated([d], [h for h in hypotheses([d], Model())[0] if h.key == "aero_drag"], Model(), lambda _t, _s: None)
    assert supported(b) is b
