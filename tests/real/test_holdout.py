"""The simulation predicts measured drives that its parameters have not seen."""

import numpy as np
import pytest

from tests.real.holdout import HELD_OUT, hold_out, plant_of_trips

pytestmark = pytest.mark.real


@pytest.fixture(scope="module")
def results(real_logs):
    plant = plant_of_trips()
    return [hold_out(real_logs / "bmw_i3", trip, plant) for trip in HELD_OUT]


def test_acceleration_of_unseen_trips(results):
    """Guards against change; the figures are in the book (validation)."""
    for r in results:
        assert r.windows >= 10
        assert r.a_rms < 0.6 * r.a_spread
        assert abs(r.a_mean) < 0.1


def test_speed_after_ten_and_thirty_seconds(results):
    assert np.median([r.v_10s for r in results]) < 1.5
    assert np.median([r.v_30s for r in results]) < 3.0


def test_a_wrong_mass_is_seen(real_logs, results):
    plant = plant_of_trips()
    heavy = hold_out(real_logs / "bmw_i3", "A05", plant._replace(mass=1.3 * plant.mass))
    right = next(r for r in results if r.trip == "A05")
    assert heavy.a_rms > 1.1 * right.a_rms
