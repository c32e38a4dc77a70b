"""Unknown forms: found in a drive through the competition, described as functions, taken into a model as terms."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import polars as pl
import pytest

from aqualog.core.vehicle import Vehicle
from aqualog.diagnose import noise, run, unexplained
from aqualog.diagnose.arena import arena_of
from aqualog.diagnose.channels import block_means
from aqualog.diagnose.compete import compete
from aqualog.diagnose.competition import Block, Fitted, fitted_in, joined, packed, scores
from aqualog.diagnose.drive import prepare
from aqualog.diagnose.evidence import make_evidence
from aqualog.diagnose.hypotheses import hypotheses
from aqualog.diagnose.noise import weighing, white_noise
from aqualog.diagnose.records import Remainder
from aqualog.diagnose.run import Options, diagnose
from aqualog.diagnose.shapes import MECHANISMS, Shape
from aqualog.diagnose.unexplained import LEAST, unknown_forms
from aqualog.diagnose.unknown_term import as_term, describe, form_of, short_form
from aqualog.model.scenario import Scenario
from aqualog.model.simulate import assemble
from aqualog.model.term import Model
from tests.blind.world.cases import Hidden, Spec, make_case
from tests.diagnose.test_drive import CAR, NOISY, changed, signals
from tests.diagnose.test_subsets import KNOWN_CAR, hypothesis

MASS, N, DT = 1600.0, 2400, 0.01
ASKED = tuple(hypothesis(n) for n in ("aero_drag", "payload_mass", "rolling_resistance"))


def slow(x, keep):
    """First-order low-pass of unit variance for white noise of unit variance."""
    y = np.empty_like(x)
    y[0] = x[0]
    for i in range(1, len(x)):
        y[i] = keep * y[i - 1] + np.sqrt(1.0 - keep * keep) * x[i]
    return y


def hump(v):
    return 250.0 * np.exp(-0.5 * ((v - 22.0) / 2.0) ** 2)


def arena(seed, force=None, **effects):
    """One channel of 240 s with a noise that remembers 1 s; `force` [N] over the coordinates, `effects` by value."""
    rng = np.random.default_rng(seed)
    v = 20.0 + 8.0 * np.clip(slow(rng.standard_normal(N), 0.995), -1.8, 1.8)
    torque = 200.0 + 150.0 * slow(rng.standard_normal(N), 0.98)
    own = {"t": np.arange(N) * 0.1, "v_x": v, "torque": torque, "position": np.cumsum(v) * 0.1}
    made = {
        "aero_drag": -0.6 * v**2 / MASS,
        "payload_mass": -torque / 0.3 / MASS**2,
        "rolling_resistance": -9.81 + 0 * v,
    }
    y = 0.03 * slow(rng.standard_normal(N), 0.9)
    y = y + sum(size * made[n] for n, size in effects.items())
    if force is not None:
        y = y - force(own) / MASS
    mask = np.ones(N, dtype=bool)
    mask[700:800] = False
    drive = SimpleNamespace(
        mask=mask, channels=("force_balance",), vehicle=KNOWN_CAR, coordinates=own, dt=DT, used_s=0.1 * mask.sum()
    )
    signatures = [[made[h.effect.name][None, None] for h in ASKED]]
    evidence = make_evidence([drive], ASKED, [y[None]], signatures, Model())
    return arena_of(evidence, [np.full((1, N), -1.0 / MASS)])


def test_evidence_is_that_of_the_dense_normal_distribution():
    rng = np.random.default_rng(1)
    x, y = rng.standard_normal((5, 40)), rng.standard_normal(40)
    inner = np.concatenate([x, y[None]]) @ np.concatenate([x, y[None]]).T
    P = np.array([[2.0, 0.5, 0.0], [0.5, 1.0, 0.2], [0.0, 0.2, 0.7]])
    block = Block("a", "shape", (0, 1, 2), P, -2.0, 0)

    def dense(columns, scale):
        S = np.eye(40) + scale**2 * columns.T @ P @ columns
        return -0.5 * np.linalg.slogdet(S)[1] - 0.5 * y @ np.linalg.solve(S, y) + 0.5 * y @ y

    each = np.array([dense(x[:3], s) for s in (1.0, 3.0)])
    gained, scale = (float(x[0]) for x in scores(inner, packed([block])[0]))
    assert gained == pytest.approx(float(np.log(np.mean(np.exp(each)))), rel=1e-9)
    state = joined(inner, [block], [0])
    assert (state.evidence, state.scales) == (pytest.approx(gained - 2.0), (scale,))
    S = np.eye(40) + scale**2 * x[:3].T @ P @ x[:3]
    np.testing.assert_allclose(
        state.inner[3:, 3:], np.array([x[3], x[4], y]) @ np.linalg.solve(S, np.array([x[3], x[4], y]).T)
    )


def test_gains_of_noise_are_those_of_white_noise_once_it_is_weighed(monkeypatch):
    """By the spectrum alone, after noise without colour: columns within the band would gain many times that."""
    monkeypatch.setattr(noise, "fit_noise", white_noise)
    gains, every = [], np.ones(N, dtype=bool)
    for seed in range(12):
        rng = np.random.default_rng([5, seed])
        lines = np.fft.rfft(rng.standard_normal(N))
        lines[80:160] *= 8.0
        y = (np.fft.irfft(lines, N) + slow(rng.standard_normal(N), 0.97))[None]
        w = weighing([y], every, np.eye(1))
        x = np.array([[np.cos(2.0 * np.pi * k * np.arange(N) / N)] for k in (100, 110, 120, 130, 140)])
        rows = w.rows(np.concatenate([x, y[None]]))
        gains += [float((r @ rows[-1]) ** 2 / (r @ r)) for r in rows[:-1]]
    assert 0.5 < np.mean(gains) < 1.7


def test_coordinates_are_free_of_the_channels_noise_and_positive_to_the_left():
    case = make_case(Spec("handling", "white", (), 3, duration_s=60.0, holdout=0))
    drive = prepare(case.drives[0][1], case.vehicle, "d")
    v, a_y = drive.coordinates["v_x"], drive.coordinates["a_y"]
    own = block_means(drive.columns["v_x"], drive.dt)
    np.testing.assert_array_equal(v, block_means(drive.speed, drive.dt))
    assert np.std(np.diff(v, 2)) < np.std(np.diff(own, 2))
    assert np.corrcoef(a_y, block_means(drive.columns["a_y"], drive.dt))[0, 1] > 0.9


def test_a_form_must_be_ahead_of_every_known_effect(monkeypatch):
    a = arena(1, lambda c: hump(c["v_x"]))
    p = compete(a)
    known = max(e for members, e in p.sets if all(a.blocks[m].kind != "shape" for m in members))
    monkeypatch.setattr(unexplained, "AHEAD", p.sets[0][1] - known + 0.1)
    assert unknown_forms(a, p, seed=1) == ()


def test_a_hump_in_speed_is_a_force_over_speed(monkeypatch):
    a = arena(1, lambda c: hump(c["v_x"]))
    p = compete(a)
    found = unknown_forms(a, p, seed=1)
    assert [(r.mechanism, r.depends_on, r.channel, r.unit) for r in found] == [
        ("force", ("v_x",), "force_balance", "N")
    ]
    r = found[0]
    ok = np.isfinite(r.f)
    truth = hump(r.x[:, 0])
    assert ok.mean() > 0.8
    assert np.sqrt(np.mean((r.f - truth)[ok] ** 2)) < 0.3 * np.sqrt(np.mean(truth[ok] ** 2))
    assert np.mean((r.low <= truth)[ok] & (truth <= r.high)[ok]) > 0.9
    assert r.probability == unexplained.MOST  # however likely it is among the forms that there are
    assert 0.1 < r.share < 1.0
    assert r.nearest in {h.key for h in ASKED}
    assert "goes with speed" in r.sentence
    assert unknown_forms(a, p, seed=1)[0].high.tolist() == r.high.tolist()
    # what it explains may be smaller where the function is surely large
    own = [m for m in p.best if a.blocks[m].kind == "shape"]
    size, *_ = unexplained._where(a, own, p.best, fitted_in(a.blocks, p.tolerant, p.best))
    for times, worth, count in ((1.5, 2.0, 1), (1.5, 100.0, 0), (2.5, 2.0, 0)):
        least = {unit: times * size * x for unit, x in LEAST.items()}
        monkeypatch.setattr(unexplained, "LEAST", least)
        monkeypatch.setattr(unexplained, "WORTH", worth)
        assert len(unknown_forms(a, p, seed=1)) == count
    # along what simulators do not err by, less is enough
    monkeypatch.setattr(unexplained, "ERRS", frozenset())
    for times, count in ((3.2, 1), (3.5, 0)):
        monkeypatch.setattr(unexplained, "LEAST", {unit: times * size * x for unit, x in LEAST.items()})
        monkeypatch.setattr(unexplained, "WORTH", 2.0)
        assert len(unknown_forms(a, p, seed=1)) == count
    monkeypatch.undo()
    # one that a known effect stands for is no unknown form
    for cosine, count in ((0.88, 1), (0.92, 0)):
        monkeypatch.setattr(unexplained, "_nearest", lambda *_, c=cosine: ("torque_gain", c))
        assert len(unknown_forms(a, p, seed=1)) == count


def test_names_that_a_form_outshines_are_those_that_no_likely_set_has(monkeypatch):
    a = arena(1, lambda c: hump(c["v_x"]), payload_mass=600.0)
    p = compete(a)
    assert p.marginal["payload_mass"] > 0.95
    doubted = {h.key for h in ASKED} - {"payload_mass"}
    assert unexplained.outshone(a, p) == dict.fromkeys(doubted, "a force on the car that goes with speed")
    # one that shows in no channel outshines nothing
    monkeypatch.setattr(unexplained, "_where", lambda *_: (9.0, 0.04, "force_balance"))
    assert unexplained.outshone(a, p) == {}
    monkeypatch.undo()
    b = arena(3, aero_drag=0.4)
    assert unexplained.outshone(b, compete(b)) == {}


def test_a_function_whose_band_holds_zero_everywhere_is_no_finding(monkeypatch):
    a = arena(1, lambda c: hump(c["v_x"]))
    found = compete(a)
    assert unknown_forms(a, found, seed=1)
    monkeypatch.setattr(unexplained, "_band", lambda at, *_: np.full(len(at), 1e4))
    assert not unknown_forms(a, found, seed=1)
    # nor is one that is surely nowhere larger than what cars and simulations differ by anyway
    allowed = next(m for m in MECHANISMS if m.name == "force").allowed
    for share, count in ((0.9, 0), (1.1, 1)):
        monkeypatch.setattr(unexplained, "_surely", lambda *_, x=share * allowed: x)
        assert len(unknown_forms(a, found, seed=1)) == count


def test_a_known_effect_is_no_unknown_form():
    a = arena(3, aero_drag=0.4)
    p = compete(a)
    assert unknown_forms(a, p, seed=1) == ()
    assert p.marginal["aero_drag"] > 0.95
    assert {a.blocks[m].key for m in p.best} == {"aero_drag"}


@pytest.mark.parametrize("seed", [4, 5, 6])
def test_nothing_where_there_is_nothing(seed):
    a = arena(seed)
    p = compete(a)
    assert p.best == ()
    assert unknown_forms(a, p, seed=1) == ()
    assert p.probability.sum() == pytest.approx(1.0)


def test_of_a_long_drive_its_best_stretch_competes(monkeypatch):
    monkeypatch.setattr("aqualog.diagnose.arena.MOST_BLOCKS", 1000)
    (part,) = arena(7).parts
    assert part.residual.shape == (1, 1000)
    assert part.mask.all()


def test_a_hump_of_another_simulator_is_unexplained(monkeypatch):
    """The whole way from signals to verdict, asked about few known effects."""
    few = ("aero_drag", "head_wind", "payload_mass", "torque_gain")

    def asked(drives, model):
        every, untested = hypotheses(drives, model)
        return tuple(h for h in every if h.allowed or h.effect.name in few), untested

    monkeypatch.setattr(run, "hypotheses", asked)
    hidden = (Hidden("speed_hump", None, {"force": 300.0, "centre": 20.0, "width": 2.5}),)
    case = make_case(Spec("mixed", "ou1", hidden, 3, duration_s=150.0, holdout=0))
    found = diagnose(case.drives, case.vehicle, options=Options(views=False, consequences=False))
    assert found.verdict == "unexplained"
    assert (found.remainders[0].mechanism, found.remainders[0].depends_on) == ("force", ("v_x",))
    (term,) = found.model.terms
    assert term.effect.name == "unexplained_force"
    # against the motion, as it was hidden, and at its speed
    assert np.interp(20.0, *np.array(term.knots).T) == pytest.approx(300.0, rel=0.35)
    assert "a force on the car that goes with speed" in found.sentence
    # one that is not clear enough to be reported takes the certainty of the name that stands in its place
    monkeypatch.setattr(unexplained, "AHEAD", 1e9)
    found = diagnose(case.drives, case.vehicle, options=Options(views=False, consequences=False))
    assert found.verdict == "cannot_tell"
    assert all(c.probability <= 0.9 for c in found.causes)
    assert any("A force on the car that goes with speed explains the log better than" in n for n in found.notes)


@pytest.mark.parametrize(
    ("mechanism", "over", "manner", "said"),
    [
        ("torque", "torque", "", "the torque at the wheels that goes with its own size"),
        ("force", "torque", "", "a force on the car that goes with torque"),
        ("force_drag", "t", "from 3 s to 9 s", "a drag with the square of speed from 3 s to 9 s"),
    ],
)
def test_a_shape_and_its_remainder_have_the_same_words(mechanism, over, manner, said):
    shape = Shape(next(m for m in MECHANISMS if m.name == mechanism), (over,), None, manner)
    assert form_of(shape) == said
    own = replace(remainder([0.0, 1.0], np.ones(2), mechanism=mechanism, depends_on=(over,)), manner=manner)
    assert short_form(own) == said


def remainder(x, f, half=10.0, mechanism="force", depends_on=("v_x",)):
    x = np.asarray(x, dtype=float)[:, None]
    return Remainder(
        "force_balance", depends_on, 0.3, 0.01, x, f, f - half, f + half, (), None, 0.0, "", mechanism, "N", 0.99
    )  # fmt: skip


def test_a_sentence_says_the_plateau_of_an_interval_and_not_its_slope():
    f = np.array([50.0, 120.0, 200.0, 200.0])
    r = remainder([10.0, 11.0, 12.0, 13.0], f, 0.1 * f, depends_on=("t",))
    assert "200 N against the motion at 12 s" in describe(next(m for m in MECHANISMS if m.name == "force"), r)


def test_a_force_over_speed_becomes_a_term():
    x = np.linspace(10.0, 35.0, 60)
    f = np.where(x > 30.0, np.nan, hump(x))
    term = as_term(remainder(x, f, half=100.0))
    car = Vehicle(name="car", given=frozenset({"drivetrain", "mass"}))
    plant = Model((term,)).apply(assemble(Scenario(car, duration_s=2.0))).plant
    v, ok = np.linspace(10.0, 29.5, 100), x <= 30.0
    np.testing.assert_allclose(np.interp(v, *plant.drag_over_v.T), np.interp(v, x[ok], f[ok]), atol=1e-9)
    np.testing.assert_array_equal(np.interp([2.0, 7.9, 32.5, 60.0], *plant.drag_over_v.T), 0.0)


def test_a_hole_in_the_support_is_nominal():
    x = np.linspace(10.0, 35.0, 60)
    f = np.where((x > 18.0) & (x < 28.0), np.nan, 200.0)
    knots = as_term(remainder(x, f)).knots
    assert np.interp([15.0, 23.0, 30.0], *np.array(knots).T) == pytest.approx([200.0, 0.0, 200.0])


def test_what_the_plant_has_no_table_for_becomes_no_term():
    x = np.linspace(0.0, 3000.0, 60)
    assert as_term(remainder(x, 0.0 * x, mechanism="slip_f")) is None
    assert as_term(remainder(x, 0.0 * x, depends_on=("t",))) is None
    assert as_term(remainder(np.linspace(5, 40, 60), np.full(60, 1e6))) is None


@pytest.mark.parametrize(("mechanism", "channel"), [("slip_f", "slip_fl"), ("force", "kinematic")])
def test_what_the_wheels_do_shows_in_their_slip(mechanism, channel):
    """A form of the wheels that explains the accelerometer alone is an error of the simulator."""
    rng = np.random.default_rng(8)
    f = rng.standard_normal((1, 2, 500)) * [[[0.3], [0.001]]]
    part = SimpleNamespace(
        residual=f[0] + 0.01 * rng.standard_normal((2, 500)), mask=np.ones(500, dtype=bool),
        channels=("kinematic", "slip_fl"),
    )  # fmt: skip
    shape = SimpleNamespace(
        mechanism=next(m for m in MECHANISMS if m.name == mechanism), manner="", coordinates=("torque",)
    )
    block = Block("a", "shape", (0,), np.eye(1), 0.0, 0)
    field = SimpleNamespace(
        parts=(part,), blocks=(block,), shapes=(shape,), drawn=lambda *_: f, mechanism=lambda _: shape.mechanism
    )
    size, share, where = unexplained._where(field, [0], [0], Fitted([0], np.ones(1), np.eye(1)))
    assert where == channel
    assert (size > 1.0, share > 0.9) == ((True, True) if channel == "kinematic" else (False, False))


@pytest.mark.parametrize(
    ("mechanism", "manner", "over", "noise", "share"),
    [
        ("accelerometer", "", "torque", 0.02, 0.0), ("accelerometer", "", "yaw_rate", 0.02, 0.95),
        ("accelerometer", "from 10 s to 20 s", "torque", 0.02, 0.95),
        # a force that is much of the channel is no error of a simulator
        ("force", "", "torque", 0.02, 0.95), ("force", "", "torque", 0.35, 0.0), ("force", "", "yaw_rate", 0.35, 0.11),
    ],
)  # fmt: skip
def test_an_offset_in_one_kind_of_driving_is_no_smooth_function(mechanism, manner, over, noise, share):
    """It explains much of a channel, and nothing of how the channel varies where it acts. An interval is an offset; of
    turning no simulator has offsets."""
    rng = np.random.default_rng(8)
    acts = np.arange(500) < 100
    f = 0.3 * np.where(acts, 1.0 + 0.1 * rng.standard_normal(500), 0.0)[None, None]
    part = SimpleNamespace(
        residual=0.3 * acts[None] + noise * rng.standard_normal((1, 500)), mask=np.ones(500, dtype=bool),
        channels=("kinematic",),
    )  # fmt: skip
    shape = SimpleNamespace(
        mechanism=next(m for m in MECHANISMS if m.name == mechanism), manner=manner, coordinates=(over,)
    )
    block = Block("a", "shape", (0,), np.eye(1), 0.0, 0)
    field = SimpleNamespace(
        parts=(part,), blocks=(block,), shapes=(shape,), drawn=lambda *_: f, mechanism=lambda _: shape.mechanism
    )
    _, found, _ = unexplained._where(field, [0], [0], Fitted([0], np.ones(1), np.eye(1)))
    assert found == pytest.approx(share, abs=0.04)


AXLES_SLIP = {"f": np.array([1.0, 1.0, 0.0, 0.0]), "r": np.array([0.0, 0.0, 1.0, 1.0])}
WHEEL_SLIP, DIFFERENCE = ("slip_fl", "slip_fr", "slip_rl", "slip_rr"), ("axle_slip", "side_slip_f", "side_slip_r")


def slipping(seed, hidden, drivetrain="awd", turned=None):
    """Slip of four wheels at a torque that wanders; `hidden` forms by axle. `turned`: without a velocity."""
    rng = np.random.default_rng(seed)
    own = {"torque": 200.0 + 150.0 * slow(rng.standard_normal(N), 0.98)}
    own["v_x"] = 20.0 + 8.0 * np.clip(slow(rng.standard_normal(N), 0.995), -1.8, 1.8)
    axles = AXLES_SLIP | {None: AXLES_SLIP["f"] + AXLES_SLIP["r"]}
    made = {k: a[:, None] * 2e-4 * own["torque"] for k, a in axles.items()}
    y = 0.02 * slow(rng.standard_normal(N), 0.5) + 0.006 * rng.standard_normal((4, N))
    y = y + sum(f(own) * made[k] for k, f in hidden.items())
    if turned is not None:
        y, made = turned @ y, {k: turned @ x for k, x in made.items()}
    drive = SimpleNamespace(
        mask=np.ones(N, dtype=bool), channels=WHEEL_SLIP if turned is None else DIFFERENCE,
        vehicle=replace(KNOWN_CAR, drivetrain=drivetrain), dt=DT, used_s=0.1 * N, coordinates=own,
    )  # fmt: skip
    asked = tuple(hypothesis("slip_stiffness", w) for w in made)
    # what a step of 0.1 of the slope changes, by the step
    return arena_of(make_evidence([drive], asked, [y], [[x[None] / 1.1 for x in made.values()]], Model()), [])


def saddle(c, width=40.0):
    return -0.8 * np.exp(-(((c["torque"] - 250.0) / width) ** 2))


@pytest.mark.parametrize("drivetrain", ["awd", "rwd"])
def test_a_slip_of_all_wheels_is_one_form(drivetrain):
    """With a form of each axle, each has half of what it says and pays in full. With one driven axle there is none."""
    a = slipping(9, {None: saddle}, drivetrain)
    assert ("slip_all" in {s.mechanism.name for s in a.shapes}) == (drivetrain == "awd")
    assert {a.name(i) for i, b in enumerate(a.blocks) if b.kind == "shape"} == {"slip()"}
    found = unknown_forms(a, compete(a), seed=1)
    assert {r.mechanism for r in found} == ({"slip_all"} if drivetrain == "awd" else {"slip_f", "slip_r"})
    assert {r.depends_on for r in found} == {("torque",)}
    assert ("all driven wheels" in found[0].sentence) == (drivetrain == "awd")


@pytest.mark.parametrize("seed", [2, 3, 4])
def test_a_slip_slope_is_stated_as_its_change(seed):
    """The slip is 1.8 times the file's, so its slope is 1/1.8 of the file's."""
    (r,) = unknown_forms(a := slipping(seed, {None: lambda c: saddle(c, 100.0)}), compete(a), seed=1)
    at = int(np.nanargmin(np.abs(r.x[:, 0] - 250.0)))
    assert r.f[at] == pytest.approx(1.0 / 1.8 - 1.0, abs=0.05)
    assert r.low[at] < 1.0 / 1.8 - 1.0 < r.high[at]


def test_two_forms_of_two_axles_are_two():
    a = slipping(9, {"f": saddle, "r": lambda c: 0.8 * np.exp(-0.5 * ((c["v_x"] - 24.0) / 1.5) ** 2)})
    found = unknown_forms(a, compete(a), seed=1)
    assert [(r.mechanism, r.depends_on) for r in found] == [("slip_f", ("torque",)), ("slip_r", ("v_x",))]
    assert min(r.probability for r in found) == unexplained.MOST
    # each is of its own axle: so is its share
    assert sum(r.share for r in found) < 1.5


def test_an_axle_is_not_stated_surely_where_only_their_difference_is_known():
    difference = np.array([[-0.5, -0.5, 0.5, 0.5], [1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0]])
    (r,) = unknown_forms(a := slipping(4, {"f": saddle}, turned=difference), p := compete(a), seed=1)
    assert p.marginal["slip()"] > 0.95
    assert r.probability < 0.7 < unexplained.MOST
    other = {"slip_f": "rear", "slip_r": "front"}[r.mechanism]
    assert f"cannot be distinguished from the slip slope of the {other} axle" in r.sentence
    assert re.search(r"; [+-]\d+\.?\d*% at ", r.sentence)


def test_a_change_is_certain_where_the_mean_is_not():
    at, supported = np.array([[1.0, 0.0], [1.0, 1.0]]), np.ones(2, dtype=bool)
    block = Block("a", "shape", (0, 1), np.eye(2), 0.0, 0)
    basis = SimpleNamespace(at_points=at, supported=supported)
    field = SimpleNamespace(blocks=(block,), sd=np.ones(2), shapes=(SimpleNamespace(basis=basis),))
    for constant, change, least in ((1.0, 1e-4, 0.2), (1.0, 1.0, 0.0)):
        fit = Fitted([0, 1], np.array([0.1, 0.5]), np.diag([constant, change]))
        assert unexplained._surely(field, fit, 0, 1) == pytest.approx(least, abs=0.05)


def shown(channels, y, functions, manners):
    """Where offsets show that have these functions (C, n)."""
    kind = next(m for m in MECHANISMS if m.name == "accelerometer")
    n = len(functions)
    part = SimpleNamespace(residual=y, mask=np.ones(y.shape[1], dtype=bool), channels=channels)
    field = SimpleNamespace(
        parts=(part,), blocks=tuple(Block(str(i), "shape", (i,), np.eye(1), 0.0, i) for i in range(n)),
        shapes=tuple(SimpleNamespace(mechanism=kind, manner=m, coordinates=("torque",)) for m in manners),
        drawn=lambda _i, b: functions[int(b.key)][None], mechanism=lambda _: kind,
    )  # fmt: skip
    return unexplained._where(field, range(n), range(n), Fitted(list(range(n)), np.ones(n), np.eye(n)))


def test_what_is_no_smooth_function_in_one_channel_may_show_in_another():
    rng, n = np.random.default_rng(8), 3000
    acts, noise = np.arange(n) < 600, rng.standard_normal((2, n))
    offset, wave = 0.3 * acts * (1.0 + 0.1 * rng.standard_normal(n)), 0.008 * np.sin(np.arange(n) / 30.0)
    y = np.stack([0.3 * acts, wave]) + [[0.02], [0.006]] * noise
    size, share, channel = shown(("force_balance", "kinematic"), y, [np.stack([offset, wave])], [""])
    assert (size > 1.0, channel) == (False, "kinematic")
    assert share > 0.3
    # beside an interval a smooth function need not vary: their sum is an offset that begins
    inside = [0.004 * np.sin(np.arange(n) / 17.0)[None], 0.2 * acts[None]]
    for order in (1, -1):
        found = shown(("force_balance",), inside[1] + 0.03 * noise[:1], inside[::order], ["", "for 60 s"][::order])
        assert found[0] > 1.0
        assert found[1] == pytest.approx(0.88, abs=0.03)
    few = 2.0 * (np.arange(n) < 12)[None]
    again = few * (1.0 + 0.1 * rng.standard_normal(n))
    assert shown(("force_balance",), few + 0.02 * noise[:1], [again], [""])[1] == 0.0


def test_between_axles_the_noise_of_the_velocity_cancels():
    """Beside the reference velocity's noise a slip of the rear wheels is nothing; beside the front wheels it is all."""
    rng = np.random.default_rng(8)
    own, other = np.zeros((2, 4, 500))
    own[2:], other[0] = 0.004 * rng.standard_normal(500), 0.1 * rng.standard_normal(500)
    residual = own + other + 0.1 * rng.standard_normal(500) + 0.001 * rng.standard_normal((4, 500))
    part = SimpleNamespace(
        residual=residual, mask=np.ones(500, dtype=bool), channels=("slip_fl", "slip_fr", "slip_rl", "slip_rr")
    )
    shape = SimpleNamespace(mechanism=next(m for m in MECHANISMS if m.name == "slip_r"), manner="", coordinates=())
    blocks = tuple(Block(n, "shape", (i,), np.eye(1), 0.0, 0) for i, n in enumerate("ab"))
    drawn = {"a": own[None], "b": other[None]}
    field = SimpleNamespace(
        parts=(part,),
        blocks=blocks,
        shapes=(shape,),
        drawn=lambda _i, b: drawn[b.key],
        mechanism=lambda _: shape.mechanism,
    )
    _, share, where = unexplained._where(field, [0], [0, 1], Fitted([0, 1], np.ones(2), np.eye(2)))
    assert where == "axle_slip"
    assert share > 0.9  # of what the other member leaves


def test_one_wheel_that_reads_low_for_a_while():
    log = signals(sensors=NOISY, drop=("tie_rod_fl", "tie_rod_fr"))
    t, omega = pl.col("t"), pl.col("omega_rl")
    low = changed(
        log,
        log.frame.with_columns(pl.when(t.is_between(40.0, 52.0)).then(0.98 * omega).otherwise(omega).alias("omega_rl")),
    )
    d = diagnose([("a", low)], CAR, options=Options(surrogates=9, views=False, consequences=False))
    assert (d.verdict, d.remainders[0].mechanism, d.remainders[0].depends_on) == ("unexplained", "radius_rl", ("t",))
    assert d.remainders[0].manner == "from 40 s to 52 s"
    assert np.nanmax(d.remainders[0].f) == pytest.approx(0.0204, rel=0.1)
