"""What speaks against a name, and probabilities."""

from types import SimpleNamespace

import numpy as np
import pytest

from aqualog.diagnose.judge import repeats
from aqualog.diagnose.noise import fit_noise
from aqualog.diagnose.probability import tempered
from aqualog.model.term import Model
from tests.diagnose.test_unexplained import arena


@pytest.mark.parametrize(("last", "speaks"), [(1.0, False), (-1.5, True)])
def test_a_value_with_another_sign_in_a_third_is_no_name(last, speaks):
    a = arena(3)
    n = 2400
    third = np.where(np.arange(n) < 1600, 1.0, last)
    drive, own = a.evidence.drives[0], a.evidence.signatures[0][:1]
    before = a.evidence.residuals[0] + 0.4 * third * own[0]
    h = a.evidence.asked[0]
    refit = SimpleNamespace(
        members=(h,),
        names=((0, h.free[0]),),
        values=np.array([0.4]),
        residuals=(before - 0.4 * own[0],),
        signatures=(own,),
    )
    noises = [fit_noise(a.evidence.residuals[0], drive.mask, np.eye(1))]
    assert bool(repeats(refit, a, noises, Model(), {h.key})) is speaks
    assert any("other sign" in why for why in repeats(refit, a, noises, Model(), {h.key})) is speaks
    # too small to be named: its sign is no matter
    assert not any("other sign" in why for why in repeats(refit, a, noises, Model(), {"another"}))


def test_a_value_at_its_bound_is_no_name():
    a = arena(3)
    drive, own = a.evidence.drives[0], a.evidence.signatures[0][:1]
    h = a.evidence.asked[0]
    high = h.parameter(h.free[0]).high
    refit = SimpleNamespace(
        members=(h,),
        names=((0, h.free[0]),),
        values=np.array([high]),
        residuals=(a.evidence.residuals[0],),
        signatures=(own,),
    )
    noises = [fit_noise(a.evidence.residuals[0], drive.mask, np.eye(1))]
    assert "a value stands at its physical bound." in repeats(refit, a, noises, Model(), {h.key})
    assert "a value stands at its physical bound." not in repeats(refit, a, noises, Model(), set())


def test_probabilities_rise_with_the_share_of_the_posterior():
    p = [tempered(x) for x in (0.0, 0.1, 0.5, 0.9, 1.0)]
    assert p == sorted(p)
    assert 0.0 <= p[0] < p[-1] < 1.0
