"""Checks without drives: what they find, and that each can fail."""

import dataclasses

import numpy as np
import pytest

from aqualog.thesis.checks import contact, differential, estimator, excitation, joint, resistance, wheels
from aqualog.thesis.claims import DIFFERENCE, NEEDS_DATA, NOT_REPRODUCED, REPRODUCED, combined
from aqualog.thesis.evidence.seeds import Maker, Plan

PLAN = Plan(range(1, 100))
MODULES = (contact, differential, estimator, excitation)
MAKERS = {m.claims: m.checks for module in MODULES for m in module.CHECKS}
ELSE = {
    # contact lengths are the simulator's, offset's sign, clamp, phase; perception
    "C9": DIFFERENCE, "C10": DIFFERENCE, "C86": DIFFERENCE, "C89": DIFFERENCE, "C103": DIFFERENCE,
    "C117": NEEDS_DATA,
}  # fmt: skip


@pytest.mark.parametrize("ids", MAKERS, ids=lambda ids: "+".join(ids))
def test_claims(ids):
    checks = MAKERS[ids](PLAN)
    assert {c.claim for c in checks} == set(ids)
    for claim in ids:
        of = [c for c in checks if c.claim == claim]
        assert combined(c.verdict for c in of) == ELSE.get(claim, REPRODUCED), "; ".join(c.found for c in of)


def verdicts_of(make, claim, plan=PLAN):
    return {c.verdict for c in Maker((claim,), make).checks(plan) if c.claim == claim}


def verdict_of(make, claim, plan=PLAN):
    return combined(verdicts_of(make, claim, plan))


def broken(function, factor=1.001):
    def changed(*args, **kw):
        out = function(*args, **kw)
        return tuple(factor * x for x in out) if isinstance(out, tuple) else factor * out

    return changed


@pytest.mark.parametrize(
    ("module", "name", "make", "claim"),
    [
        (contact, "friction_ratio", contact._friction, "C7"),
        (contact, "slip_stiffness_ratio", contact._stiffness, "C8"),
        (contact, "slip_stiffness_ratio", contact._wedge, "C10"),
        (differential, "brush_stiffness", differential._slips, "C79"),
        (differential, "wheel_slip", differential._slips, "C80"),
        (differential.differential, "speed_ratio", differential._slips, "C84"),
        (differential.differential, "predicted_differential_slip", differential._slips, "C86"),
        (differential.differential, "jacobian", differential._output_equation, "C88"),
        (differential, "simulate_half_car", differential._half_car, "C98"),
        (estimator.cusum, "scan", estimator._change_detection, "C89"),
        (excitation, "axle_forces", excitation._sums, "C97"),
        (excitation, "f_step", excitation._waveforms, "C103"),
        (resistance, "nominal_acceleration", resistance._balance, "C35"),
        (wheels.ewvar, "scan", wheels._moving_variance, "C30"),
    ],
    ids=lambda x: x if isinstance(x, str) and x.startswith("C") else "",
)
def test_a_wrong_equation_is_found(monkeypatch, module, name, make, claim):
    """A check that cannot fail is none: a thousandth on the package's function turns the verdict."""
    function = getattr(module, name)
    if name == "simulate_half_car":

        def changed(car, run):
            r = function(car, run)
            return dataclasses.replace(r, F_x_f=1.001 * r.F_x_f)

    elif name == "scan":

        def changed(*args):
            first, *rest = function(*args)
            return (1.001 * first, *(1.001 * x if isinstance(x, np.ndarray) and x.dtype == float else x for x in rest))

    else:
        factor = 3.0 if claim == "C10" else 1.001
        changed = broken(function, factor)
    few = Plan(range(1, 4))
    assert NOT_REPRODUCED not in verdicts_of(make, claim, few)
    monkeypatch.setattr(module, name, changed)
    assert NOT_REPRODUCED in verdicts_of(make, claim, few)


def test_waveforms_that_lag_are_found(monkeypatch):
    triangle = excitation.WAVEFORMS["triangle"]
    monkeypatch.setitem(excitation.WAVEFORMS, "triangle", lambda t, *, period: triangle(t - 1e-6, period=period))
    assert verdict_of(excitation._waveforms, "C100") == NOT_REPRODUCED
    assert verdict_of(excitation._waveforms, "C101") == REPRODUCED


def test_the_sum_of_joint_detector_2_by_hand(monkeypatch):
    assert verdict_of(joint._sum, "C71") == DIFFERENCE
    terms = joint.joint_cusum.terms
    monkeypatch.setattr(joint.joint_cusum, "terms", lambda *a: {k: v for k, v in terms(*a).items() if k != "spin_up"})
    assert verdict_of(joint._sum, "C71") == NOT_REPRODUCED


def test_a_contact_without_noise_needs_little_utilisation(monkeypatch):
    """C1 rests on the noise: with a hundredth of it friction is known far too early for the claim."""
    monkeypatch.setattr(contact, "_NOISE", 5e-6)
    assert verdict_of(contact._utilisation, "C1") != REPRODUCED


def test_the_gates_matter(monkeypatch):
    """C91: with gates that never close the check does not pass."""
    monkeypatch.setattr(estimator.activation, "inactive_reason", lambda *, v_x, **_: np.zeros(v_x.size))
    assert verdict_of(estimator._activation, "C91") != REPRODUCED
