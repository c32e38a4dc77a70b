"""The best sets of a competition; and the benches made by hand of the tests beside this."""

from types import SimpleNamespace

import numpy as np
import pytest

from aqualog.core.vehicle import KEYS, Vehicle
from aqualog.diagnose import search
from aqualog.diagnose.arena import arena_of
from aqualog.diagnose.compete import compete
from aqualog.diagnose.competition import fitted_in
from aqualog.diagnose.evidence import gains_of, make_evidence, tolerant
from aqualog.diagnose.hypotheses import Hypothesis
from aqualog.diagnose.isolate import compatible
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Model

CHANNELS = ("axle_slip", "lateral")
KNOWN_CAR = Vehicle(given=frozenset(KEYS))  # its file sets every key


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
    drive = SimpleNamespace(
        mask=mask, channels=CHANNELS[: len(residual)], vehicle=KNOWN_CAR, coordinates=own, dt=0.1, name="d",
        used_s=0.1 * mask.sum(),
    )  # fmt: skip
    return make_evidence([drive], asked, [residual], [[s[None] for s in signatures]], Model())


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


def held(evidence):
    """The arena of an evidence, and the posterior."""
    arena = arena_of(evidence, ())
    return arena, compete(arena)


def best(evidence):
    arena, posterior = held(evidence)
    return {arena.blocks[m].key for m in posterior.best}


def plain(evidence):
    """Inner products without tolerances, in the effects' units."""
    arena, posterior = held(evidence)
    scale = np.append(arena.sd, 1.0)
    return posterior.gram / np.outer(scale, scale)


def test_tolerant_is_the_dense_inverse_of_noise_and_deviations():
    rng = np.random.default_rng(1)
    b = made(road_grade=1.0)
    A = rng.standard_normal((b.count + 1, 40)) * 5.0 / np.append(b.prior, 1.0)[:, None]
    dense = np.linalg.inv(np.eye(40) + (A[:-1].T * b.tolerance**2) @ A[:-1])
    np.testing.assert_allclose(tolerant(b, A @ A.T), A @ dense @ A.T, rtol=1e-7, atol=1e-7)


def test_what_is_within_tolerance_gains_little():
    b = made(noise=0.05, road_grade=0.03)  # a third of the smallest
    own, forgiving = gains_of(b, plain(b)), gains_of(b, tolerant(b, plain(b)))
    i = AT["road_grade"]
    assert own[i] > 50.0
    assert forgiving[i] < 4.0


def test_variants_of_one_effect_share_its_tolerance():
    slow, begun = (EFFECTS[n] for n in ("tyre_warmup", "pressure_loss"))
    asked = (*(Hypothesis(slow, None, ("extra",), {"time_constant": t}) for t in (150.0, 600.0)),
             *(Hypothesis(begun, "fl", ("radius",), {"start": t}) for t in (0.0, 9.0)))  # fmt: skip
    b = bench_of(np.zeros((2, 300)), waves(300, len(asked)), asked)
    np.testing.assert_allclose(b.forgiven[:2], slow.drive.tolerance / np.sqrt(2.0))
    np.testing.assert_allclose(b.forgiven[2:], asked[-1].tolerance("radius"))


def test_a_single_effect_is_found_with_its_value():
    b = made(torque_gain=2.0)
    arena, posterior = held(b)
    assert {arena.blocks[m].key for m in posterior.best} == {"torque_gain"}
    fit = fitted_in(arena.blocks, posterior.tolerant, posterior.best)
    sd = float(np.sqrt(fit.covariance[0, 0])) * arena.sd[fit.columns[0]]
    assert abs(fit.mean[0] * arena.sd[fit.columns[0]] - 0.1) < 4.0 * sd
    assert sd < 0.01


@pytest.mark.parametrize("pair", [("aero_drag", "tyre_radius@fl"), ("road_grade", "head_wind")])
def test_a_pair_is_found_among_all(pair):
    assert best(made(seed=2, **dict.fromkeys(pair, 1.0))) == set(pair)


def test_a_pair_is_found_that_no_single_effect_leads_to():
    # a third effect looks like the sum of the two and gains most alone
    s = waves(1500, 12, seed=5) / np.array([h.parameter(h.free[0]).sigma for h in ASKED])[:, None, None]
    sigma = [h.parameter(h.free[0]).sigma for h in ASKED]
    both = sigma[0] * s[0] + sigma[1] * s[1]
    s[2] = (both + 0.5 * waves(1500, 1, seed=6)[0]) / sigma[2]
    assert best(bench_of(both + np.random.default_rng(3).standard_normal(both.shape), s)) == {"road_grade", "aero_drag"}


def test_three_are_found():
    three = {"road_grade": 1.0, "payload_mass": 1.0, "tyre_radius@fl": -1.0}
    assert best(made(seed=4, **three)) == set(three)


def test_a_value_outside_its_bounds_is_no_answer():
    assert "road_grade" not in best(made(road_grade=30.0))  # 0.6 rad; 0.2 is physical


def test_members_that_are_the_same_do_not_stand_together():
    s = waves(1500, 12) / np.array([h.parameter(h.free[0]).sigma for h in ASKED])[:, None, None]
    s[1] = 3.0 * s[0] + 0.005 * s[5]
    arena, posterior = held(bench_of(s[0] * 0.1 + np.random.default_rng(0).standard_normal((2, 1500)), s))
    both = [{0, 1} <= {arena.blocks[m].tag for m in members} for members, _ in posterior.sets]
    assert posterior.probability[both].sum() < 0.05


def test_nothing_is_named_twice():
    b = made()
    assert not compatible(b, (AT["tyre_radius@fl"], AT["tyre_radius@f"]))
    assert compatible(b, (AT["tyre_radius@fl"], AT["slip_stiffness@r"]))


@pytest.mark.parametrize(("near", "together"), [(0.05, False), (0.6, True)])
def test_twins_that_a_drive_cannot_part_are_not_both_in_a_set(near, together):
    a, other = waves(1500, 2, seed=5)
    asked = tuple(hypothesis(n) for n in ("payload_mass", "torque_gain", "cornering_drag"))
    s = np.array([a, a + near * other, a + near * other])
    s = s / np.array([x.effect.parameters[0].sigma for x in asked])[:, None, None]
    arena, posterior = held(bench_of(a + np.random.default_rng(3).standard_normal(a.shape), s, asked))
    sets = [{arena.blocks[m].key for m in members} for members, _ in posterior.sets]
    assert any({"payload_mass", "torque_gain"} <= x for x in sets) == together
    assert any({"payload_mass", "cornering_drag"} <= x for x in sets)  # no twin of it


def test_a_car_carries_one_load():
    b = made(asked=(hypothesis("payload_mass", "f"), hypothesis("payload_mass", "r"), hypothesis("tyre_radius", "f")))
    assert not compatible(b, (0, 1))
    assert compatible(b, (0, 2))


def test_a_delay_of_all_signals_but_one_is_that_ones():
    asked = tuple(hypothesis("signal_delay", w) for w in ("v_x", "a_x", "omega", "torque", "a_y", "yaw_rate"))
    evidence = made(asked=asked)
    assert compatible(evidence, (0, 1))
    assert not compatible(evidence, (0, 1, 2))
    assert not compatible(evidence, (0, 1, 2, 3))
    assert compatible(evidence, (0, 1, 4))
    assert not compatible(evidence, (4, 5))


def chosen(asked, sets):
    """The sets, by keys, that are refitted for a posterior with these sets and evidences; the first one is the best."""
    arena = arena_of(bench_of(np.zeros((2, 300)), waves(300, len(asked)), asked), ())
    at = {b.key: i for i, b in enumerate(arena.blocks)}
    members = [(tuple(sorted(at[k] for k in keys.split())), e) for keys, e in sets]
    posterior = SimpleNamespace(sets=members, best=members[0][0], probability=np.eye(len(sets))[0])
    return {
        " ".join(sorted(arena.blocks[i].key for i in m)) for m in search._chosen(arena.evidence, arena, posterior)[0]
    }


@pytest.mark.parametrize(("behind", "is_refitted"), [(40.0, True), (60.0, False)])
def test_a_rival_of_a_large_effect_may_be_a_twentieth_behind(behind, is_refitted):
    sets = [("slip_stiffness@r torque_gain", 1000.0), ("cornering_drag slip_stiffness@r", 1000.0 - behind)]
    assert (sets[1][0] in chosen(ASKED, sets)) == is_refitted


def test_the_twin_of_a_signal_is_that_of_the_same_signal():
    asked = tuple(hypothesis(*x) for x in (("accelerometer_position", "a_y"), ("signal_delay", "a_x"),
                                           ("signal_delay", "a_y"), ("road_grade",)))  # fmt: skip
    assert chosen(asked, [("accelerometer_position@a_y road_grade", 9.0)]) == {
        "accelerometer_position@a_y road_grade", "road_grade signal_delay@a_y",
    }  # fmt: skip
