"""Intervals and waves over time and place: found where they are, and not in slow noise."""

import re

import numpy as np
import pytest

from aqualog.diagnose.compete import compete
from aqualog.diagnose.elements import with_elements
from aqualog.diagnose.shapes import MECHANISMS, shapes
from aqualog.diagnose.unexplained import unknown_forms
from aqualog.diagnose.unknown_term import short_form
from tests.diagnose.test_unexplained import arena, slow


def trapezoid(t, begin, end, rise):
    return np.clip((t - begin) / rise + 0.5, 0.0, 1.0) * np.clip((end - t) / rise + 0.5, 0.0, 1.0)


def found(seed, force=None, **effects):
    a = with_elements(arena(seed, force, **effects))
    p = compete(a)
    return a, p, unknown_forms(a, p, seed=1)


def test_only_what_multiplies_a_fast_signal_may_drift_smoothly():
    t = np.arange(3000) * 0.1
    made = shapes({"t": t, "torque": np.sin(t)}, t >= 0.0, 0.1, [m.source for m in MECHANISMS])
    smooth = {s.mechanism.name for s in made if s.coordinates == ("t",) and not s.mechanism.is_road}
    assert smooth == {"torque", "accelerometer_gain", "slip_f", "slip_r"}


@pytest.mark.parametrize("rise", [0.1, 16.0])
def test_a_force_that_comes_and_goes(rise):
    _, _, forms = found(11, lambda c: 220.0 * trapezoid(c["t"], 95.3, 161.7, rise))
    assert [(r.mechanism, r.depends_on, r.unit) for r in forms] == [("force", ("t",), "N")]
    r = forms[0]
    truth = 220.0 * trapezoid(r.x[:, 0], 95.3, 161.7, rise)
    assert np.sqrt(np.mean((r.f - truth) ** 2)) < 40.0
    assert r.f.max() == pytest.approx(220.0, rel=0.2)
    assert np.abs(r.f[r.x[:, 0] < 80.0]).max() < 1e-9
    if rise < 1.0:
        begin, end = map(float, re.fullmatch(r"from (\d+) s to (\d+) s", r.manner).groups())
        assert (begin, end) == (pytest.approx(95.3, abs=2.0), pytest.approx(161.7, abs=2.0))
        assert f"Unexplained: a force on the car {r.manner} (probability" in r.sentence
        assert short_form(r) == f"a force on the car {r.manner}"
        assert re.search(r"; 2\d\d N against the motion at \d+\.?\d* s\)", r.sentence)
        assert "Without a second pass" in r.sentence


@pytest.mark.parametrize("power", [0, 2])
def test_a_drag_that_comes_and_goes_is_no_force_that_does(power):
    """In the same interval, of the same size at 22 m/s: with a roof box for a while, or a brake that binds."""
    _, _, (r,) = found(
        13, lambda c: 250.0 * (c["v_x"] / 22.0) ** power * trapezoid(c["t"], 60.0, 190.0, 0.1)
    )  # fmt: skip
    assert (r.mechanism, r.unit, r.depends_on) == (
        ("force_drag", "m^2", ("t",)) if power else ("force", "N", ("t",))
    )  # fmt: skip
    if power:
        assert np.nanmax(r.f) == pytest.approx(250.0 / (0.6 * 22.0**2), rel=0.1)
        assert short_form(r).startswith("a drag with the square of speed from ")
        said = float(re.search(r"; \+(0\.\d+) m² at \d+", r.sentence).group(1))
        assert said == pytest.approx(np.nanmax(r.f), abs=1e-3)  # not what its slopes have


def test_a_wave_of_the_road():
    _, _, forms = found(12, lambda c: 150.0 * np.sin(2.0 * np.pi * c["position"] / 310.0 + 0.7))
    assert [(r.mechanism, r.depends_on) for r in forms] == [("force", ("position",))]
    r = forms[0]
    truth = 150.0 * np.sin(2.0 * np.pi * r.x[:, 0] / 310.0 + 0.7)
    assert np.corrcoef(r.f, truth)[0, 1] > 0.95
    length = re.fullmatch(r"a force on the car in waves of (\d+) m", short_form(r)).group(1)
    assert float(length) == pytest.approx(310.0, abs=3.0)


@pytest.mark.parametrize(
    ("name", "unit", "length", "period"), [("position", "m", 180.0, 1130.0), ("t", "s", 9.0, 61.0)]
)
def test_a_patch_that_comes_again(name, unit, length, period):
    _, _, forms = found(12, lambda c: 250.0 * (np.mod(c[name] - 0.4 * period, period) < length))
    assert [(r.mechanism, r.depends_on) for r in forms] == [("force", (name,))]
    said = re.fullmatch(rf"a force on the car for (\S+) {unit} in every (\S+) {unit}", short_form(forms[0])).groups()
    assert tuple(map(float, said)) == (pytest.approx(length, rel=0.15), pytest.approx(period, rel=0.02))
    assert forms[0].f.max() == pytest.approx(250.0, rel=0.2)
    assert "second pass" not in forms[0].sentence


def test_an_instant_that_comes_again_is_the_driver():
    _, _, forms = found(12, lambda c: 600.0 * (np.mod(c["t"] - 5.0, 13.0) < 0.6))
    assert not forms


def test_two_forces_of_different_size():
    truth = lambda t: 240.0 * trapezoid(t, 40.0, 72.0, 0.1) - 330.0 * trapezoid(t, 150.0, 166.0, 0.1)  # noqa: E731
    _, _, forms = found(11, lambda c: truth(c["t"]))
    assert [(r.mechanism, r.depends_on) for r in forms] == [("force", ("t",))]
    assert " and from " in forms[0].manner
    assert np.sqrt(np.mean((forms[0].f - truth(forms[0].x[:, 0])) ** 2)) < 50.0


def test_what_comes_and_goes_often_is_no_outlier_however_large():
    windows = ((20.0, 28.0), (90.0, 109.0), (133.0, 138.0), (170.0, 196.0))
    truth = lambda t: 2500.0 * sum(trapezoid(t, *w, 0.1) for w in windows)  # noqa: E731
    _, _, forms = found(11, lambda c: truth(c["t"]))
    assert [(r.mechanism, r.depends_on) for r in forms] == [("force", ("t",))]
    begins = [float(x) for x in re.findall(r"from (\d+) s", forms[0].manner)]
    assert all(min(abs(b - low) for b in begins) <= 1.0 for low, _ in windows)
    assert np.sqrt(np.mean((forms[0].f - truth(forms[0].x[:, 0])) ** 2)) < 250.0


@pytest.mark.parametrize("seed", [13, 14, 15, 16])
def test_slow_noise_is_no_form(seed):
    """Of the size of the forms above, with a memory of 20 s."""
    gust = slow(np.random.default_rng([seed, 99]).standard_normal(2400), 0.995)
    _, _, forms = found(seed, lambda c: 150.0 * gust)
    assert forms == ()


def test_a_kerb_is_no_form():
    _, p, forms = found(19, lambda c: 2500.0 * (np.abs(c["t"] - 180.0) < 0.6))
    assert p.best == ()
    assert forms == ()


@pytest.mark.parametrize(("lasts", "count"), [(3.0, 0), (5.0, 1)])
def test_gusts_are_no_form(lasts, count):
    _, _, forms = found(19, lambda c: 500.0 * sum(trapezoid(c["t"], b, b + lasts, 0.1) for b in (42.0, 103.0, 197.0)))
    assert [(r.mechanism, r.depends_on) for r in forms] == [("force", ("t",))] * count


def test_a_known_effect_beside_an_interval():
    _, p, forms = found(17, lambda c: 200.0 * trapezoid(c["t"], 60.0, 120.0, 0.1), aero_drag=0.3)
    assert [r.depends_on for r in forms] == [("t",)]
    assert p.marginal["aero_drag"] > 0.95


def test_the_blocks_pay_for_all_that_were_tried():
    a = with_elements(arena(18))
    own = [b for b in a.blocks if " of " in b.key]
    kinds = ("wave of t", "wave of position", "interval of t", "intervals of t", "patches of t", "patches of position")
    usual = {"force": 150.0, "force_drag": 0.15}
    assert {b.key for b in own} == {f"{m}({k})" for m in usual for k in kinds if m == "force" or "s of" not in k}
    smooth = max(b.log_prior for b in a.blocks if b.kind == "shape" and b not in own)
    assert max(b.log_prior for b in own) < smooth - 3.0
    for b in own:
        assert set(a.sd[list(b.columns)].tolist()) == {usual[b.key.partition("(")[0]]}


def test_deviations_beside_which_forms_are_sought_are_those_of_a_car(monkeypatch):
    """A fault of many times the tolerances is no sum of them."""
    a = arena(11, lambda c: 2500.0 * trapezoid(c["t"], 90.0, 109.0, 0.1))
    made = []
    monkeypatch.setattr(type(a), "made", lambda self, part, values: made.append(values) or 0.0 * values[:, :1, None])
    with_elements(a)
    size = np.abs(made[0][0]) / np.sqrt(np.maximum(np.diag(a.tolerance), 1e-30))
    assert 1.0 < size.max() < 8.0
