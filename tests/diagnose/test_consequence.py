"""What the user gains: false alarms and latency of the detectors, without and with the model."""

import pytest

from aqualog.core.vehicle import KEYS, Vehicle
from aqualog.diagnose import consequence
from aqualog.diagnose.consequence import DETECTORS, DRY, PASSES, consequences
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Model, Term

CAR = Vehicle(name="car", drivetrain="awd", torque_split_rear=0.6, given=frozenset({"drivetrain", *KEYS}))
SPEED = ((0.0, 8.0), (8.0, 8.0), (16.0, 32.0), (24.0, 32.0), (34.0, 12.0), (36.0, 12.0), (43.0, 32.0), (48.0, 32.0))


def model(effect, where=None, **values):
    return Model((Term(EFFECTS[effect], values, where),))


PAYLOAD = model("payload_mass", "r", delta_mass=350.0)


def by_name(found):
    return {c.detector: c for c in found}


@pytest.fixture(scope="module")
def nothing_hidden():
    """What the detectors do on the same drives of the car that the vehicle file describes."""
    return by_name(consequences(CAR, Model(), seed=2))


def test_a_model_without_terms_changes_nothing(nothing_hidden):
    assert tuple(nothing_hidden) == DETECTORS
    for c in nothing_hidden.values():
        assert c.false_alarms_before == c.false_alarms_after <= 1
        assert c.latency_before_s == c.latency_after_s
        assert c.found_before == c.found_after
        assert 4 <= c.passes <= len(PASSES)
        assert 10.0 < c.distance_km < 40.0


@pytest.mark.parametrize(
    ("m", "at_least"),
    [
        (PAYLOAD, 6),
        (model("signal_delay", "torque", delay=0.3), 8),
        pytest.param(model("torque_gain", gain=0.85), 6, marks=pytest.mark.nightly),
        pytest.param(model("accelerometer_drift", drift=-0.005), 4, marks=pytest.mark.nightly),
        pytest.param(model("tyre_radius", delta=0.08), 4, marks=pytest.mark.nightly),
        pytest.param(model("aero_drag", delta_drag_area=0.4), 3, marks=pytest.mark.nightly),
    ],
)
def test_false_alarms_of_a_hidden_effect_are_gone_with_the_model(nothing_hidden, m, at_least):
    found = by_name(consequences(CAR, m, seed=2))
    c = found["resistance"]
    assert c.false_alarms_before >= at_least
    for c in found.values():
        assert c.false_alarms_after <= nothing_hidden[c.detector].false_alarms_after
        assert c.found_after >= c.found_before


def test_a_late_accelerometer_costs_latency(monkeypatch):
    monkeypatch.setattr(consequence, "DRY", ())
    c = by_name(consequences(CAR, model("signal_delay", "a_x", delay=0.3), seed=2))["joint_criteria"]
    assert c.latency_after_s < c.latency_before_s - 0.05


def test_the_same_seed_gives_the_same(monkeypatch):
    monkeypatch.setattr(consequence, "DRY", DRY[:2])
    monkeypatch.setattr(consequence, "PASSES", PASSES[:1])
    one, same, other = (by_name(consequences(CAR, PAYLOAD, seed=s)) for s in (2, 2, 3))
    assert one == same != other
