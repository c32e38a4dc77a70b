"""The best sets on inner products; and the benches made by hand of the tests beside this."""

from types import SimpleNamespace

import numpy as np
import pytest

from aqualog.core.vehicle import Vehicle
from aqualog.diagnose.evidence import gram_of, make_evidence, tolerant
from aqualog.diagnose.hypotheses import Hypothesis
from aqualog.diagnose.noise import fit_noise
from aqualog.diagnose.subsets import PRIOR_WIDTH, best_sets, compatible, fit_set, gains_on_top
from aqualog.model.effects import EFFECTS

CHANNELS = ("axle_slip", "lateral")


def hypothesis(name, where=None):
    effect = EFFECTS[name]
    return Hypothesis(effect, where, (effect.parameters[0].name,))


ASKED = tuple(
    hypothesis(*x) for x in (
        ("road_grade",), ("aero_drag",), ("rolling_resistance",), ("payload_mass",), ("torque_gain",), ("wheel_inertia",),
        ("accelerometer_bias", "a_x"), ("tyre_radius", "fl"), ("tyre_radius", "f"), ("slip_stiffness", "r"), ("head_wind",),
        ("cornering_drag",),
    )
)  # fmt: skip
AT = {h.key: i for i, h in enumerate(ASKED)}


def keys(evidence, members):
    return {evidence.asked[m].key for m in members}


def bench_of(residual, signatures, asked=ASKED, mask=None):
    """One drive with this residual (C, n) and one signature (C, n) for each hypothesis."""
    mask = np.ones(residual.shape[1], dtype=bool) if mask is None else mask
    own = {"v_x": np.full(mask.size, 20.0)}
    drive = SimpleNamespace(mask=mask, channels=CHANNELS[: len(residual)], vehicle=Vehicle(), coordinates=own)
    values = {(i, h.free[0]): h.parameter(h.free[0]).neutral for i, h in enumerate(asked)}
    return make_evidence([drive], asked, [residual], [[s[None] for s in signatures]], values)


def waves(n, count, seed=0):
    """Signatures that are not alike: smooth waves in two channels."""
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((count, 2, n + 60))
    kernel = np.hanning(61) / np.hanning(61).sum()
    return np.array([[np.convolve(r, kernel, "valid") for r in s] for s in x]) * 8.0


def made(seed=0, n=1500, asked=ASKED, noise=1.0, **effects):
    """A evidence with white noise in which effects (key to value in sigma) are hidden; sigma of each is worth `scale`."""
    rng = np.random.default_rng(seed)
    s = waves(n, len(asked), seed=99) / np.array([h.parameter(h.free[0]).sigma for h in asked])[:, None, None]
    y = noise * rng.standard_normal((2, n))
    for key, size in effects.items():
        i = [h.key for h in asked].index(key)
        y = y + size * asked[i].parameter(asked[i].free[0]).sigma * s[i]
    return bench_of(y, s, asked)


def gram(evidence):
    noises = [fit_noise(r, d.mask, np.eye(len(r))) for r, d in zip(evidence.residuals, evidence.drives, strict=True)]
    return gram_of(evidence, noises, evidence.residuals)


def test_tolerant_is_the_dense_inverse_of_noise_and_deviations():
    rng = np.random.default_rng(1)
    b = made(road_grade=1.0)
    A = rng.standard_normal((b.count + 1, 40)) * 5.0 / np.append(b.prior, 1.0)[:, None]
    dense = np.linalg.inv(np.eye(40) + (A[:-1].T * b.tolerance**2) @ A[:-1])
    np.testing.assert_allclose(tolerant(b, A @ A.T), A @ dense @ A.T, rtol=1e-7, atol=1e-7)


def test_what_is_within_tolerance_gains_little():
    b = made(noise=0.05, road_grade=0.03)  # a third of the smallest
    plain, forgiving = gains_on_top(b, gram(b), ()), gains_on_top(b, tolerant(b, gram(b)), ())
    i = AT["road_grade"]
    assert plain[i] > 50.0
    assert forgiving[i] < 4.0


def test_inner_products_add_up_over_drives():
    a = made(seed=1)
    noises = [fit_noise(a.residuals[0], a.drives[0].mask, np.eye(2))]
    two = make_evidence(
        a.drives * 2, a.asked, a.residuals * 2, [[s[None] for s in a.signatures[0]]] * 2,
        {(i, h.free[0]): h.parameter(h.free[0]).neutral for i, h in enumerate(a.asked)},
    )  # fmt: skip
    one = gram_of(a, noises, a.residuals)
    np.testing.assert_allclose(gram_of(two, noises * 2, two.residuals), 2.0 * one, rtol=1e-9)


def test_a_single_effect_is_found_with_its_value():
    b = made(torque_gain=2.0)
    (best,) = best_sets(b, gram(b), 1, within=0.0, most=1)
    assert keys(b, best.members) == {"torque_gain"}
    sd = gram(b)[AT["torque_gain"], AT["torque_gain"]] ** -0.5
    assert abs(best.theta[0] - 0.1) < 4.0 * sd


@pytest.mark.parametrize("pair", [("aero_drag", "slip_stiffness@r"), ("road_grade", "head_wind")])
def test_a_pair_is_found_among_all(pair):
    b = made(seed=2, **dict.fromkeys(pair, 1.0))
    (best,) = best_sets(b, gram(b), 2, within=0.0, most=1)
    assert keys(b, best.members) == set(pair)
    assert best.gain > best_sets(b, gram(b), 1, within=0.0, most=1)[0].gain


def test_a_pair_is_found_that_no_single_effect_leads_to():
    # a third effect looks like the sum of the two and gains most alone
    s = waves(1500, 12, seed=5) / np.array([h.parameter(h.free[0]).sigma for h in ASKED])[:, None, None]
    sigma = [h.parameter(h.free[0]).sigma for h in ASKED]
    both = sigma[0] * s[0] + sigma[1] * s[1]
    s[2] = (both + 0.5 * waves(1500, 1, seed=6)[0]) / sigma[2]
    b = bench_of(both + np.random.default_rng(3).standard_normal(both.shape), s)
    assert keys(b, best_sets(b, gram(b), 1, within=0.0, most=1)[0].members) == {"rolling_resistance"}
    assert keys(b, best_sets(b, gram(b), 2, within=0.0, most=1)[0].members) == {"road_grade", "aero_drag"}


def test_three_are_found():
    three = {"road_grade": 1.0, "payload_mass": 1.0, "cornering_drag": -1.0}
    b = made(seed=4, **three)
    (best,) = best_sets(b, gram(b), 3, within=0.0, most=1)
    assert keys(b, best.members) == set(three)


def test_a_value_outside_its_bounds_is_no_fit():
    b = made(road_grade=30.0)  # 0.6 rad; 0.2 is physical
    assert fit_set(b, gram(b), (AT["road_grade"],)) is None
    assert all("road_grade" not in keys(b, f.members) for f in best_sets(b, gram(b), 2, within=1e9, most=50))


def test_members_that_are_exactly_the_same_cannot_be_fitted_together():
    s = waves(1500, 12)
    s[1] = 3.0 * s[0]
    b = bench_of(np.random.default_rng(0).standard_normal((2, 1500)), s)
    assert fit_set(b, gram(b), (0, 1)) is None


def test_members_that_are_the_same_cannot_be_fitted_together():
    s = waves(1500, 12)
    s[1] = 3.0 * s[0] + 0.005 * s[5]
    b = bench_of(np.random.default_rng(0).standard_normal((2, 1500)), s)
    assert fit_set(b, gram(b), (0, 1)) is None
    assert gains_on_top(b, gram(b), (0,))[1] == 0.0


def test_the_prior_draws_by_its_width():
    b = made(seed=6, torque_gain=1.0)
    i = AT["torque_gain"]
    G = gram(b)
    fit = fit_set(b, G, (i,))
    free = G[i, -1] / G[i, i]
    assert fit.theta[0] == pytest.approx(free * G[i, i] / (G[i, i] + (PRIOR_WIDTH * b.prior[i]) ** -2.0))


def test_nothing_is_named_twice():
    b = made()
    assert not compatible(b, (AT["tyre_radius@fl"], AT["tyre_radius@f"]))
    assert compatible(b, (AT["tyre_radius@fl"], AT["slip_stiffness@r"]))


def test_twins_that_a_drive_cannot_part_are_not_both_in_a_set():
    rng = np.random.default_rng(3)
    a, other = waves(1500, 2, seed=5)
    asked = tuple(hypothesis(n) for n in ("payload_mass", "torque_gain", "cornering_drag"))
    for near, together in ((0.05, False), (0.6, True)):
        s = np.array([a, a + near * other, a + near * other])
        b = bench_of(
            a + rng.standard_normal(a.shape),
            s / np.array([x.effect.parameters[0].sigma for x in asked])[:, None, None],
            asked,
        )
        assert (fit_set(b, gram(b), (0, 1)) is not None) == together
        assert fit_set(b, gram(b), (0, 2)) is not None  # no twin of it


def test_a_car_carries_one_load():
    b = made(asked=(hypothesis("payload_mass", "f"), hypothesis("payload_mass", "r"), hypothesis("tyre_radius", "f")))
    assert not compatible(b, (0, 1))
    assert compatible(b, (0, 2))


def test_sets_come_best_first_and_not_too_many():
    b = made(seed=7, road_grade=1.0)
    fits = best_sets(b, gram(b), 1, within=1e9, most=5)
    assert len(fits) == 5
    assert [f.gain for f in fits] == sorted((f.gain for f in fits), reverse=True)
    near = best_sets(b, gram(b), 1, within=1.0, most=50)
    assert all(f.gain >= fits[0].gain - 1.0 for f in near)


def test_a_delay_of_every_signal_is_another_start_of_the_clock():
    asked = tuple(hypothesis("signal_delay", w) for w in ("v_x", "a_x", "torque"))
    evidence = made(asked=asked)
    assert compatible(evidence, (0, 1))
    assert not compatible(evidence, (0, 1, 2))
