"""The verdict with probabilities, and what speaks against a name."""

from types import SimpleNamespace

import numpy as np
import pytest

from aqualog.diagnose.compete import compete
from aqualog.diagnose.judge import judged, repeats
from aqualog.diagnose.noise import fit_noise
from aqualog.diagnose.outcome import Outcome
from aqualog.diagnose.probability import tempered
from aqualog.diagnose.records import Cause, Estimate
from aqualog.model.term import Model
from tests.diagnose.test_unexplained import arena, remainder

NAMED = Cause("aero_drag", None, {"delta": Estimate(0.3, 0.2, 0.4, "m^2")}, ("force_balance",), "More drag.")


def verdict(a, *, forms=(), failed=(), outcome=None):
    outcome = outcome or Outcome("named", (NAMED,), (), None, ())
    return judged(outcome, forms, a, compete(a), Model(), failed)


def test_a_sure_cause_keeps_its_name_and_bears_its_probability():
    out = verdict(arena(3, aero_drag=0.4))
    assert out.verdict == "named"
    assert out.causes[0].probability > 0.95


def test_a_cause_that_the_posterior_shares_with_others_is_not_named():
    out = verdict(arena(3, payload_mass=600.0))
    assert out.verdict == "cannot_tell"
    assert out.causes[0].effect == "aero_drag"
    assert out.causes[0].probability < 0.5
    assert "payload_mass" in {c.effect for c in out.causes}
    assert out.alternatives


def test_a_failed_check_forbids_a_name():
    out = verdict(arena(3, aero_drag=0.4), failed=("it has the other sign in the last third of the drive.",))
    assert out.verdict == "cannot_tell"
    assert out.small[-1].startswith("Not named: it has")


def test_an_unknown_form_comes_before_a_name():
    x = np.linspace(10.0, 30.0, 20)
    out = verdict(arena(3, aero_drag=0.4), forms=(remainder(x, 0.0 * x),))
    assert out.verdict == "unexplained"
    # beside it what the same set has for certain, with the value of the competition
    assert [c.effect for c in out.causes] == ["aero_drag"]
    e = next(iter(out.causes[0].parameters.values()))
    assert e.low < 0.4 < e.high


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
    assert bool(repeats(refit, a, noises, Model())) is speaks


def test_probabilities_rise_with_the_share_of_the_posterior():
    p = [tempered(x) for x in (0.0, 0.1, 0.5, 0.9, 1.0)]
    assert p == sorted(p)
    assert 0.0 <= p[0] < p[-1] < 1.0
