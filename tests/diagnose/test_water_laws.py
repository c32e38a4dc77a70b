"""Lanes of water may differ from each other; what water does is sought near its most likely size and refitted."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from aqualog.core.notation import WHEELS
from aqualog.core.vehicle import WaterNumber
from aqualog.diagnose import search
from aqualog.diagnose.arena import arena_of, known_only
from aqualog.diagnose.compete import compete
from aqualog.diagnose.drive import BEYOND_GRIP, prepare, rolling_under, stretches
from aqualog.diagnose.evidence import around_water, of_water
from aqualog.diagnose.hypotheses import hypotheses, signatures
from aqualog.diagnose.isolate import supported
from aqualog.diagnose.refit import KNOWN, metric, refit
from aqualog.diagnose.search import FORM, STRUCTURE, Found, Option, _levelled, _refitted, sharpened, simulated
from aqualog.diagnose.tolerances import LANE_TOLERANCES
from aqualog.model.follow import follow
from aqualog.model.scenario import Lane
from aqualog.model.term import Model
from tests.diagnose.test_drive import CAR, NOISY, signals, term
from tests.diagnose.test_floating import LANES, wet

SHALLOW = tuple(
    Lane(t, t + 6.0, in_metres=False, depth_left=d, depth_right=1.1 * d)
    for t, d in ((4.0, 1e-3), (14.0, 1.4e-3), (24.0, 1.2e-3), (36.0, 0.7e-3), (60.0, 0.9e-3), (72.0, 1.3e-3))
)


def quiet(_text, _share):
    pass


def asked_of(d):
    return [h for h in hypotheses([d], Model())[0] if h.of_water]


@cache
def evidence():
    return on_water()


def on_water(*terms, lanes=LANES):
    d = prepare(wet(*terms, sensors=NOISY, lanes=lanes), CAR, "a")
    return simulated([d], asked_of(d), Model(), quiet)


def column(b, key):
    return next(c[0] for h, c in zip(b.asked, b.columns, strict=True) if h.key == key)


def test_each_lane_may_differ_on_water_alone():
    d = prepare(wet(), CAR, "a")
    assert stretches(d).max() == len(LANES)
    own = [(h.effect, h.lane) for h in asked_of(d) if h.allowed]
    assert own == [(e, k) for k in range(len(LANES)) for e in LANE_TOLERANCES.values()]
    dry, _ = hypotheses([prepare(signals(), CAR, "a")], Model())
    assert not any(h.of_water for h in dry)


def test_the_tolerance_of_a_lane_is_what_its_effect_does_there():
    b = evidence()
    number = stretches(b.drives[0])
    whole = b.signatures[0][column(b, "contact_loss@f")]
    for k in range(len(LANES)):
        at = next(
            c[0] for h, c in zip(b.asked, b.columns, strict=True)
            if h.lane == k and h.effect is LANE_TOLERANCES["contact_loss", "f"]
        )  # fmt: skip
        np.testing.assert_array_equal(b.signatures[0][at], whole * (number == k + 1))


def test_a_lane_needs_no_other_hypothesis():
    b = evidence()
    own = [h for h in b.asked if h.lane == 1]
    alone = signatures(b.drives[0], Model(), own, base=b.residuals[0])
    for h, s in zip(own, alone, strict=True):
        k = next(i for i, o in enumerate(b.asked) if o is h)
        np.testing.assert_allclose(s, b.signatures[0][list(b.columns[k])], atol=1e-12)


def test_lanes_differ_in_full_however_well_a_file_is_known():
    b = evidence()
    arena = arena_of(b, ())
    weighings = arena.weighed([[p.residual] for p in arena.parts])
    known = metric(arena, weighings, share=KNOWN)
    at = np.flatnonzero(b.tolerance > 0.0)
    lane = np.array([h.lane is not None for h, c in zip(b.asked, b.columns, strict=True) for _ in c])
    share = np.where(lane, 1.0, KNOWN)[at]
    A = weighings[0].rows(b.signatures[0][at] * (share * b.tolerance[at])[:, None, None])
    # single precision, of the largest entry
    np.testing.assert_allclose(known.A, A, rtol=0.0, atol=3e-7 * np.abs(A).max())


@pytest.mark.parametrize("gain", [0.4, 1.6])
def test_a_lost_contact_is_sought_near_its_size(gain):
    """A straight line from the file's contact misses it; one from about its own size does so by less than half."""
    far = on_water(term("contact_loss", gain=gain), lanes=SHALLOW)
    near, likeliest = around_water(far, Model())
    mask = far.drives[0].mask

    def value(b):
        slips = [i for i, n in enumerate(b.drives[0].channels) if n.startswith("slip")]
        x = b.residuals[0][slips][:, mask].ravel()
        s = b.signatures[0][column(b, "contact_loss")][slips][:, mask].ravel()
        return 1.0 + float(s @ x) / float(s @ s)

    assert likeliest.effect.name == "contact_loss"
    assert abs(value(far) - gain) > 0.15
    assert abs(value(near) - gain) < 0.5 * abs(value(far) - gain)


def test_axles_differ_by_as_much_wherever_signatures_stand():
    b = on_water(term("water_drag", gain=2.2), lanes=SHALLOW)
    near, _ = around_water(b, Model())
    assert not np.array_equal(near.residuals[0], b.residuals[0])
    for key in ("water_drag@f", "water_drag"):  # in the balance of forces drag is a straight line
        s, t = (x.signatures[0][column(b, key)][0, b.drives[0].mask] for x in (b, near))
        assert float(s @ t) / float(s @ s) == pytest.approx(1.0, abs=0.05)


def test_where_the_most_likely_water_lets_a_wheel_float_nothing_is_judged():
    d, floats = evidence().drives[0], Model((term("contact_loss", gain=5.0),))
    less = rolling_under(d, floats)
    shown = follow(CAR, d.course, floats)
    slip = np.abs(np.array([shown[f"omega_{w}"] * CAR.r_e(w) for w in WHEELS]) / shown["v_x"] - 1.0).max(axis=0)
    beyond = slip.reshape(-1, 10).max(axis=1) > 1.2 * BEYOND_GRIP
    assert (d.mask & beyond).any()
    assert not (less.mask & beyond).any()
    assert not (less.mask & ~d.mask).any()
    assert rolling_under(d, Model()).mask.sum() == d.mask.sum()


def test_a_drive_without_water_stays_as_it_is():
    d = prepare(signals(sensors=NOISY), CAR, "a")
    b = simulated([d], [h for h in hypotheses([d], Model())[0] if h.key == "aero_drag"], Model(), quiet)
    assert around_water(b, Model()) == (b, None)
    assert supported(b) is b


@pytest.mark.parametrize(("gains", "is_found"), [((0.6, 0.5), False), ((3.0, 1.0), True)])
def test_no_name_for_what_laws_of_water_differ_by(gains, is_found):
    """Sources differ by a factor of two in the lost contact and in the drag; no file says which law a tyre has."""
    hidden = (term("contact_loss", gain=gains[0]), term("water_drag", gain=gains[1]))
    arena = known_only(arena_of(around_water(on_water(*hidden, lanes=SHALLOW), Model())[0], ()))
    found = {arena.blocks[m].key.split("@")[0] for m in compete(arena).best}
    assert ("contact_loss" in found) is is_found
    assert is_found or not found


def test_a_law_that_is_fitted_to_the_car_is_driven_and_leaves_less_room():
    known = replace(CAR, water={"v_anchor": WaterNumber(36.0, 1.2, "calibrated")})
    d = prepare(wet(), known, "a")
    own, usual = ({h.key: h for h in asked_of(x)}["contact_loss@f"] for x in (d, prepare(wet(), CAR, "a")))
    assert own.tolerance("gain") == pytest.approx(4.0 * 1.2 / 36.0)  # with the fourth power of the speed
    assert (usual.tolerance("gain"), usual.worth_naming("gain")) == (0.4, 0.8)
    driven = [follow(car, d.course, Model())["omega_fl"] for car in (known, CAR)]
    assert np.ptp(driven, axis=0).max() > 0.05


def test_one_effect_of_water_more_has_only_its_own_evidence():
    b = evidence()
    arena = arena_of(b, ())
    by_key = {x.key: i for i, x in enumerate(arena.blocks)}
    best, other = (by_key["contact_loss"],), (by_key["water_drag"],)
    both, axles = (tuple(sorted(x)) for x in (best + other, (by_key["contact_loss@f"], by_key["contact_loss@r"])))
    options = {m: Option(m, e) for m, e in (((), -5.0), (best, 20.0), (other, 12.0), (both, 16.0), (axles, 16.0))}
    levelled = {o.members: o.evidence for o in _levelled(b, arena, options, best, set())}
    more = pytest.approx(16.0 - STRUCTURE * 20.0)  # a second effect explains more than a simulator's errors
    assert levelled == {(): -5.0, best: 20.0, other: pytest.approx(12.0 + FORM * 20.0), both: more, axles: more}
    options = {m: Option(m, -5.0) for m in (best, both)}
    assert {o.evidence for o in _levelled(b, arena, options, best, set())} == {-5.0}  # no gain, no share of it


def test_the_files_own_water_is_judged_by_the_simulator():
    """Signatures that stand elsewhere say too much or too little of it."""
    b = evidence()
    elsewhere = b.residuals[0] + 1.2 * b.signatures[0][column(b, "contact_loss")]
    for residuals, differs in (((elsewhere,), True), (b.residuals, False)):
        own = replace(b, residuals=residuals)
        arena = known_only(arena_of(own, ()))
        options = {o.members: o.evidence for o in _refitted(own, arena, compete(arena), Model())}
        assert abs(options[()]) > 1.0 if differs else abs(options[()]) < 1e-6


def test_a_sharper_refit_that_fits_worse_is_left(monkeypatch):
    b = evidence()
    arena = arena_of(b, ())
    posterior = compete(arena)
    i = next(i for i, x in enumerate(arena.blocks) if x.key == "contact_loss")
    measure = metric(arena, posterior.weighings)
    own = refit(b, [arena.blocks[i].tag], np.zeros(1), measure, Model())
    worse = replace(own, values=own.values + 0.5, off=own.off + 0.5, residuals=tuple(3.0 * r for r in own.residuals))
    monkeypatch.setattr(search, "refit", lambda *_: worse)
    found = Found(None, None, None, None, arena, posterior)
    assert sharpened(found, Option((i,), 0.0, own), Model())[0] is own


def test_each_thing_that_water_does_is_refitted():
    b = evidence()
    keys = {b.asked[i].key for i in of_water(b)}
    assert {"water_drag", "contact_loss"} <= keys
    assert keys <= {"water_drag", "contact_loss", "track_clearing", "uneven_water@left", "uneven_water@right"}


def test_what_acts_everywhere_is_barred_where_only_the_water_shows_it():
    d = prepare(wet(term("aero_drag", delta_drag_area=0.3), sensors=NOISY), CAR, "a")
    asked = [h for h in hypotheses([d], Model())[0] if h.of_water or h.key in ("aero_drag", "payload_mass")]
    b = supported(simulated([d], asked, Model(), quiet))
    assert {h.key for h, x in zip(b.asked, b.barred, strict=True) if x} == {"payload_mass"}
    arena = arena_of(b, ())
    assert {arena.blocks[m].key for m in compete(arena).best} == {"aero_drag"}
