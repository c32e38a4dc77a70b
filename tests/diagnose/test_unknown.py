"""Functions in a residual that no known effect explains: found where they are, of what they depend on, else nothing."""

from dataclasses import dataclass

import numpy as np
import pytest

from aqualog.core.vehicle import Vehicle
from aqualog.diagnose.records import Remainder
from aqualog.diagnose.unknown import find_remainders
from aqualog.diagnose.unknown_basis import bases
from aqualog.diagnose.unknown_fit import noise_level, noise_like, null_scores
from aqualog.diagnose.unknown_proxy import Candidate, choose
from aqualog.diagnose.unknown_term import as_term, describe
from aqualog.model.scenario import Scenario
from aqualog.model.simulate import assemble
from aqualog.model.term import Model

DT, SECONDS = 0.1, 240.0
CHANNELS = ("force_balance", "kinematic", "slip_fl")


def recursive(x, keep):
    """First-order low-pass of unit variance for white noise of unit variance."""
    y = np.empty_like(x)
    y[0] = x[0]
    for i in range(1, x.size):
        y[i] = keep * y[i - 1] + np.sqrt(1.0 - keep * keep) * x[i]
    return y


@dataclass(frozen=True)
class Fake:
    """A residual whose noise is autoregressive of first order, and is whitened as that."""

    residual: np.ndarray
    mask: np.ndarray
    coordinates: dict
    keep: float
    dt: float = DT
    channels: tuple = CHANNELS

    def whitened(self, x):
        past = np.concatenate([x[:, :1], x[:, :-1]], axis=1)
        return ((x - self.keep * past) / np.sqrt(1.0 - self.keep**2) * self.mask).ravel()


def drive(seed, *, laps=False):
    rng = np.random.default_rng([seed, 1])
    n = int(SECONDS / DT)
    t = np.arange(n) * DT
    v = 20.0 + 8.0 * np.clip(recursive(rng.standard_normal(n), 0.995), -1.8, 1.8)
    torque = 200.0 + 150.0 * recursive(rng.standard_normal(n), 0.98)
    position = np.cumsum(v) * DT
    lap = np.mod(position, 800.0) if laps else position
    return {"t": t, "v_x": v, "torque": torque, "position": lap, "temperature": 20.0 + t / SECONDS}


def fake(seed, effect=None, *, coordinates=None, keep=0.6):
    coordinates = drive(seed) if coordinates is None else coordinates
    n = coordinates["t"].size
    rng = np.random.default_rng([seed, 2])
    residual = np.array([recursive(rng.standard_normal(n), keep) for _ in CHANNELS])
    mask = np.ones(n, dtype=bool)
    mask[700:800] = False
    if effect is not None:
        residual[0] += effect(coordinates)
    residual[:, ~mask] = np.nan
    return Fake(residual, mask, coordinates, keep)


def hump(v):
    return -1.5 * np.exp(-0.5 * ((v - 22.0) / 3.0) ** 2)


def search(stack, **kw):
    return find_remainders(stack, **{"signatures": {}, "level": 0.01, "seed": 3, **kw})


def test_a_hump_in_speed_is_found_as_that():
    stack = fake(1, lambda c: hump(c["v_x"]))
    known = np.zeros_like(stack.residual)
    known[0] = hump(stack.coordinates["v_x"]) * 3.0
    other = np.zeros_like(stack.residual)
    other[0] = stack.coordinates["torque"] * 1e-3
    found = search(stack, signatures={"aero_drag": known, "payload_mass": other})
    assert [(r.channel, r.depends_on) for r in found] == [("force_balance", ("v_x",))]
    r = found[0]
    truth = hump(r.x[:, 0])
    ok = np.isfinite(r.f)
    assert ok.mean() > 0.8
    assert np.sqrt(np.mean((r.f - truth)[ok] ** 2)) < 0.15 * np.sqrt(np.mean(truth[ok] ** 2))
    assert np.all((r.low <= truth)[ok] & (truth <= r.high)[ok])
    assert r.p_value == pytest.approx(0.01)
    assert 0.1 < r.share < 0.6
    assert r.nearest == "aero_drag"
    assert r.cosine > 0.9
    assert "depends on speed" in r.sentence
    assert "place on the road" not in r.sentence


def test_same_seed_same_answer():
    a, b = (search(fake(2, lambda c: hump(c["v_x"])))[0] for _ in range(2))
    np.testing.assert_array_equal(a.f, b.f)
    np.testing.assert_array_equal(a.high, b.high)
    assert a.sentence == b.sentence


def test_speed_is_only_a_proxy_of_the_place():
    """On a lap driven at the same speeds at the same places, roughly, the place is what it is."""
    c = drive(4, laps=True)
    s, n = c["position"], c["t"].size
    rng = np.random.default_rng(4)
    c["v_x"] = 20.0 + 5.0 * np.sin(2.0 * np.pi * s / 800.0) + 1.5 * recursive(rng.standard_normal(n), 0.99)
    found = search(fake(4, lambda c: 1.5 * np.sin(2.0 * np.pi * c["position"] / 800.0), coordinates=c), most=1)
    assert found[0].depends_on == ("position",)
    assert "v_x" in found[0].proxies
    assert "Speed is only a proxy" in found[0].sentence
    assert "second pass" not in found[0].sentence


def test_place_is_a_proxy_of_the_speed():
    c = drive(5, laps=True)
    found = search(fake(5, lambda c: hump(c["v_x"]), coordinates=c), most=1)
    assert found[0].depends_on == ("v_x",)


def test_one_pass_cannot_tell_place_from_time():
    """Whatever helps: of places and moments on one pass the place is named, and the caution stands there."""
    rng = np.random.default_rng(6)
    n, q = 1200, 12
    t = np.arange(n) / n
    columns = np.stack([np.cos(np.pi * k * t) for k in range(1, q + 1)], axis=1)
    also = columns @ np.linalg.qr(rng.standard_normal((q, q)))[0]
    stiff = 1e-6 * np.eye(q)
    rows = rng.standard_normal(n) + columns @ rng.standard_normal(q)
    moments, places = Candidate(("t",), columns, stiff, along=True), Candidate(("position",), also, stiff, along=True)
    choice = choose([moments, places], np.ones((n, 1)), rows, np.arange(n) // 20)
    assert choice.names == ("position",)
    assert choice.equals == ("t",)
    x, one = np.linspace(0.0, 10.0, 5)[:, None], np.ones(5)
    text = describe("kinematic", choice, x, one, 0.5 * one, 2.0 * one, 0.3, "road_grade", 0.4)
    assert "Without a second pass" in text
    assert "road_grade is the nearest known effect (similarity 0.40 of 1)" in text


@pytest.mark.parametrize("passed", [True, False])
def test_part_of_a_pair_is_no_answer_unless_it_was_found_itself(passed):
    """What only stands beside a pair for comparison cannot take its place."""
    n, q = 1200, 4
    rng = np.random.default_rng(8)
    waves = np.stack([np.cos(np.pi * k * np.arange(n) / n) for k in range(1, 2 * q + 1)], axis=1)
    speed, pair = waves[:, :q], waves
    rows = rng.standard_normal(n) + speed @ np.full(q, 0.3) + 0.12 * waves[:, q]
    stiff = 1e-6 * np.eye(2 * q)
    singles = [Candidate(("v_x",), speed, stiff[:q, :q], along=False, passed=passed)]
    singles.append(Candidate(("a_x",), waves[:, q:], stiff[:q, :q], along=False, passed=False))
    both = Candidate(("v_x", "a_x"), pair, stiff, along=False)
    choice = choose([both, *singles], np.ones((n, 1)), rows, np.arange(n) // 20)
    assert choice.names == (("v_x",) if passed else ("v_x", "a_x"))


@pytest.mark.parametrize(("drives", "most"), [(4, 1), pytest.param(16, 3, marks=pytest.mark.nightly)])
def test_nothing_where_there_is_nothing(drives, most):
    """Of drives of noise at a level of 5 %: more would be about one chance in a hundred."""
    assert sum(bool(search(fake(100 + i, keep=0.9), level=0.05, seed=i)) for i in range(drives)) <= most


def test_a_function_where_the_drive_was_not_is_not_told():
    c = drive(7)
    c["v_x"] = np.where(c["v_x"] < 21.0, c["v_x"] - 5.0, c["v_x"] + 5.0)
    r = search(fake(7, lambda c: 1.5 * np.sign(c["v_x"] - 21.0), coordinates=c))[0]
    x = r.x[:, 0]
    assert r.depends_on == ("v_x",)
    assert np.isnan(r.f[(x > 17.5) & (x < 24.5)]).all()
    assert np.isfinite(r.f[x < 15.0]).any()


def test_short_drives_are_not_looked_at():
    stack = fake(8, lambda c: hump(c["v_x"]))
    mask = stack.mask & (np.arange(stack.mask.size) < 500)
    assert search(Fake(stack.residual, mask, stack.coordinates, stack.keep)) == ()


def test_bases_have_mean_zero_and_take_pairs():
    c = drive(9)
    c["water_depth"] = np.repeat([0.0, 1e-3, 2e-3], c["t"].size // 3)
    mask = np.ones(c["t"].size, dtype=bool)
    found = {b.names: b for b in bases(c, mask, DT)}
    assert {("v_x",), ("water_depth",), ("v_x", "water_depth"), ("v_x", "torque"), ("t",)} <= set(found)
    for b in found.values():
        np.testing.assert_allclose(b.columns.mean(axis=0), 0.0, atol=1e-12)
        assert np.linalg.eigvalsh(b.penalty).min() > -1e-6 * np.linalg.eigvalsh(b.penalty).max()
    assert found["t",].along
    assert found["position",].along
    assert found["temperature",].along
    assert not found["v_x",].along


def test_noise_like_keeps_power_and_cross_power():
    rng = np.random.default_rng(1)
    rows = np.array([[1.0, 0.0], [0.8, 0.6]]) @ rng.standard_normal((2, 3000))
    rows[:, 1000:1100] = 0.0
    drawn = noise_like(rows, 40, rng)
    np.testing.assert_array_equal(drawn[:, :, 1000:1100], 0.0)
    used = np.delete(drawn, np.s_[1000:1100], axis=2)
    np.testing.assert_allclose((used**2).mean(axis=(0, 2)), 1.0, atol=0.1)
    assert np.mean(used[:, 0] * used[:, 1]) == pytest.approx(0.8, abs=0.08)


def test_level_beside_a_function_does_not_see_the_function():
    """Neither the function in the residual, nor what its fit takes from the noise, changes the level."""
    n = 2400
    rng = np.random.default_rng(2)
    smooth = np.stack([np.cos(np.pi * k * (np.arange(n) + 0.5) / n) for k in range(1, 31, 2)], axis=1)
    part = np.linalg.qr(smooth)[0]
    noise = rng.standard_normal((n, 300))
    with_function = noise + 50.0 * part[:, 3:4]
    level = noise_level(part, noise, (1, n))
    np.testing.assert_allclose(noise_level(part, with_function, (1, n)), level, rtol=1e-9)
    assert level.mean() == pytest.approx(1.0, abs=0.03)
    assert noise_level(part, 2.0 * noise, (1, n)).mean() == pytest.approx(4.0 * level.mean())


def test_scores_of_surrogates_are_those_of_a_fair_draw():
    ratios = np.exp(np.random.default_rng(3).standard_normal((500, 100)))
    scores = null_scores(ratios)
    rank = (scores[:, 1:] >= scores[:, :1]).mean(axis=1)
    assert (rank < 0.05).mean() == pytest.approx(0.05, abs=0.03)


def remainder(x, f, half=0.01, channel="force_balance", depends_on=("v_x",)):
    x = np.asarray(x, dtype=float)[:, None]
    return Remainder(channel, depends_on, 0.3, 0.01, x, f, f - half, f + half, (), None, 0.0, "")


def test_a_force_over_speed_becomes_a_term():
    x = np.linspace(10.0, 35.0, 60)
    f = np.where(x > 30.0, np.nan, hump(x))
    term = as_term(remainder(x, f, half=0.1), mass=1600.0)
    car = Vehicle(name="car", given=frozenset({"drivetrain", "mass"}))
    plant = Model((term,)).apply(assemble(Scenario(car, duration_s=2.0))).plant
    v, ok = np.linspace(10.0, 29.5, 100), x <= 30.0
    np.testing.assert_allclose(
        np.interp(v, *plant.drag_over_v.T), -1600.0 * np.interp(v, x[ok], f[ok]), atol=0.15 * 160.0 + 1e-6
    )
    np.testing.assert_array_equal(np.interp([2.0, 7.9, 32.5, 60.0], *plant.drag_over_v.T), 0.0)
    assert len(term.knots) < 20
    half = as_term(remainder(x, f, half=0.1), mass=1600.0, response=-2.0 / 1600.0)
    assert dict(half.knots)[x[ok][-1]] == pytest.approx(0.5 * dict(term.knots)[x[ok][-1]])


def test_a_hole_in_the_support_is_nominal():
    x = np.linspace(10.0, 35.0, 60)
    f = np.where((x > 18.0) & (x < 28.0), np.nan, -0.2)
    knots = as_term(remainder(x, f), mass=1000.0).knots
    assert np.interp([15.0, 23.0, 30.0], *np.array(knots).T) == pytest.approx([200.0, 0.0, 200.0])


def test_a_road_becomes_a_term_and_others_do_not():
    x = np.linspace(0.0, 3000.0, 60)
    road = as_term(remainder(x, 0.3 * np.sin(x / 300.0), channel="kinematic", depends_on=("position",)), mass=1600.0)
    assert road.effect.name == "unexplained_grade"
    assert np.interp(471.0, *np.array(road.knots).T) == pytest.approx(0.3 / 9.81, rel=0.02)
    assert as_term(remainder(x, 0.0 * x, channel="slip_fl"), mass=1600.0) is None
    assert as_term(remainder(x, 0.0 * x, depends_on=("t",)), mass=1600.0) is None
    assert as_term(remainder(np.linspace(5, 40, 60), np.full(60, 50.0)), mass=1600.0) is None
