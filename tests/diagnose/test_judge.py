"""What speaks against a name, and probabilities."""

from types import SimpleNamespace

import numpy as np
import pytest

from aqualog.diagnose.hypotheses import Hypothesis
from aqualog.diagnose.noise import fit_noise
from aqualog.diagnose.records import tempered
from aqualog.diagnose.refit import Refit, repeats, silent
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Model
from tests.diagnose.test_unexplained import arena, slow


def speaking(a, value, before, names, *, at_bound=False):
    """What speaks against names of a set of one effect, fitted with this value to a residual."""
    own, h = a.evidence.signatures[0][:1], a.evidence.asked[0]
    left = (before - value * own[0],)
    x = np.array([value])
    refit = Refit((h,), x, x, np.eye(1), 0.0, Model(), left, (own,), (at_bound,))
    noises = [fit_noise(a.evidence.residuals[0], a.evidence.drives[0].mask, np.eye(1))]
    return repeats(refit, a, noises, {(n, "") for n in names})


@pytest.mark.parametrize(("last", "speaks"), [(1.0, False), (-1.5, True)])
def test_a_value_with_another_sign_in_a_third_is_no_name(last, speaks):
    a = arena(3)
    third = np.where(np.arange(2400) < 1600, 1.0, last)
    before = a.evidence.residuals[0] + 0.4 * third * a.evidence.signatures[0][0]
    found = speaking(a, 0.4, before, {a.evidence.asked[0].key})
    assert bool(found) is any("other sign" in why for why in found) is speaks
    # too small to be named: its sign is no matter
    assert not any("other sign" in why for why in speaking(a, 0.4, before, {"another"}))


def test_a_value_at_its_bound_is_no_name():
    a = arena(3)
    before = a.evidence.residuals[0] + 0.4 * a.evidence.signatures[0][0]
    key = a.evidence.asked[0].key
    assert speaking(a, 0.4, before, {key}, at_bound=True) == ("a value stands at its physical bound.",)
    assert speaking(a, 0.4, before, {"another"}, at_bound=True) == speaking(a, 0.4, before, {key}) == ()


@pytest.mark.parametrize(("values", "speaks"), [((0.4, 0.3), False), ((4.0, -3.8), True)])
def test_effects_that_cancel_are_no_names(values, speaks):
    a, rng = arena(3), np.random.default_rng(6)
    signature = a.evidence.signatures[0][:1]
    alike = np.concatenate([signature, signature + 0.1 * signature.std() * rng.standard_normal(signature.shape)])
    off, h = np.array(values), a.evidence.asked[:2]
    left = a.evidence.residuals[0]
    refit = Refit(tuple(h), off, off, np.eye(2), 0.0, Model(), (left,), (alike,), (False, False))
    found = repeats(refit, a, [fit_noise(left, a.evidence.drives[0].mask, np.eye(1))], {(x.key, "") for x in h})
    assert any("cancel" in why for why in found) == speaks


@pytest.mark.parametrize(
    ("effect", "where", "shows", "out"),
    [
        ("slip_stiffness", "r", (1.0, 1.0), False),
        ("slip_stiffness", "r", (1.0, 0.0), True),  # a fast movement that the simulator has otherwise
        ("accelerometer_gain", "a_x", (1.0, 0.0), False),
        ("accelerometer_gain", "a_x", (0.0, 0.0), True),
    ],
)
def test_an_effect_shows_where_it_acts(effect, where, shows, out):
    h, rng = Hypothesis(EFFECTS[effect], where, ("gain",)), np.random.default_rng(5)
    signature, mask = slow(rng.standard_normal((2400, 2)), 0.9).T[None], np.ones(2400, dtype=bool)
    noise = 0.5 * rng.standard_normal((2, 2400))
    drive = SimpleNamespace(channels=("kinematic", "slip_rl"))
    a = SimpleNamespace(
        evidence=SimpleNamespace(drives=[drive], signatures=[np.zeros((0, *signature.shape[1:]))]),
        parts=[SimpleNamespace(drive=0, at=slice(None), mask=mask)],
    )
    # where it does not show, the other channel of a wrong set is worse with it
    left = noise + (np.array(shows) - 1.0)[:, None] * 0.3 * signature[0]
    off = np.array([0.3])
    refit = Refit((h,), 1.0 + off, off, np.eye(1), 0.0, Model(), (left,), (signature,), (False,))
    exact = SimpleNamespace(deviations=lambda _: np.zeros(0))
    found = silent(refit, a, [fit_noise(noise, mask, np.eye(2))], exact)
    name = effect if where == "r" else f"{effect}@{where}"  # what one signal does not show, another one may
    assert found == (frozenset({name}) if out else frozenset())


def test_what_the_file_has_wrong_does_not_hide_an_effect():
    """A slip slope of the file that is off would make the slip worse with the right torque gain than without it."""
    h, rng = Hypothesis(EFFECTS["torque_gain"], None, ("gain",)), np.random.default_rng(5)
    slip, mask = slow(rng.standard_normal((2400, 1)), 0.9).T, np.ones(2400, dtype=bool)
    signature, allowed = np.concatenate([slip, 0.3 * slip])[None], np.concatenate([0.0 * slip, slip])[None]
    noise, off = 0.5 * rng.standard_normal((2, 2400)), np.array([0.3])
    part = SimpleNamespace(drive=0, at=slice(None), mask=mask)
    a = SimpleNamespace(
        evidence=SimpleNamespace(drives=[SimpleNamespace(channels=("kinematic", "slip_rl"))], signatures=[allowed]),
        parts=[part],
    )
    refit = Refit((h,), 1.0 + off, off, np.eye(1), 0.0, Model(), (noise - 0.6 * allowed[0],), (signature,), (False,))
    for theta, out in ((-0.6, set()), (0.0, {"torque_gain"})):
        exact = SimpleNamespace(deviations=lambda _, by=theta: np.array([by]))
        assert silent(refit, a, [fit_noise(noise, mask, np.eye(2))], exact) == out


def test_probabilities_rise_with_the_share_of_the_posterior():
    p = [tempered(x) for x in (0.0, 0.1, 0.5, 0.9, 1.0)]
    assert p == sorted(p)
    assert 0.0 <= p[0] < p[-1] < 1.0
