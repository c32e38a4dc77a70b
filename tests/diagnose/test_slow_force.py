"""A force that changes over minutes: only what accelerometer and wheels show alike, and only beyond usual wander."""

from types import SimpleNamespace

import numpy as np
import pytest

from aqualog.diagnose import unexplained as module
from aqualog.diagnose.unexplained import slow_force
from aqualog.model.term import Model

MASS = 1600.0
T = np.arange(3000) * 0.1
WAVE = 0.08 * np.sin(2.0 * np.pi * T / 150.0)  # [m/s^2]


@pytest.fixture
def drive(monkeypatch):
    monkeypatch.setattr(module, "unit_force", lambda drive, _model, left: np.full(left.shape, -1.0 / MASS))
    rng = np.random.default_rng(4)
    return SimpleNamespace(
        course=SimpleNamespace(lanes=()), channels=("force_balance", "kinematic"), dt=0.01, mask=rng.random(T.size) > 0.2, vehicle=SimpleNamespace(mass=MASS),
        coordinates={"v_x": rng.uniform(10.0, 30.0, T.size), "torque": rng.uniform(-200.0, 600.0, T.size)},
    )  # fmt: skip


def noise(size=0.04):
    return size * np.random.default_rng(5).standard_normal((2, T.size))


@pytest.mark.parametrize(("offset", "level"), [(0.0, -0.03), (0.1, 0.0)])
def test_a_slow_force_is_found_with_its_size(drive, offset, level):
    found = slow_force(drive, noise() + np.array([WAVE + level + offset, 0.0 * T + offset]), Model())
    true = -MASS * (np.interp(found.x[:, 0], T, WAVE) + level)  # against the motion
    assert (found.mechanism, found.depends_on, found.unit) == ("force", ("t",), "N")
    assert found.f == pytest.approx(true, abs=25.0)
    assert np.mean((found.low <= true) & (true <= found.high)) > 0.9
    assert found.share > 0.5
    assert "goes with time" in found.sentence


@pytest.mark.parametrize(
    "slow",
    [
        pytest.param([WAVE, WAVE], id="accelerometer"),
        pytest.param([0.0 * T, WAVE], id="slope"),
        pytest.param([2.0 * WAVE, 2.0 * WAVE + 0.16 * np.sin(2.0 * np.pi * T / 110.0)], id="accelerometer and slope"),
        pytest.param([0.15 * WAVE, 0.0 * T], id="usual wander"),
        pytest.param([0.08 * np.sign(np.sin(2.0 * np.pi * T / 20.0)), 0.0 * T], id="not slow"),
    ],
)
def test_what_no_force_does_or_any_drive_does_is_no_finding(drive, slow):
    assert slow_force(drive, noise() + slow, Model()) is None


def test_where_the_drive_cannot_be_used_nothing_is_drawn(drive):
    drive.mask[1000:1400] = False
    found = slow_force(drive, noise() + np.array([WAVE, 0.0 * T]), Model())
    assert np.isnan(found.f).tolist() == [100.0 < x < 140.0 for x in found.x[:, 0].tolist()]
    drive.course = SimpleNamespace(lanes=(1,))
    assert slow_force(drive, noise() + np.array([WAVE, 0.0 * T]), Model()) is None


def test_what_goes_with_the_speed_is_left_to_the_competition(drive):
    drive.coordinates["v_x"] = 20.0 + 100.0 * WAVE
    assert slow_force(drive, noise() + np.array([WAVE, 0.0 * T]), Model()) is None


def test_of_hours_only_noise_is_left(drive):
    """Evidence far below that of noise, and windows that are all alike, are no error."""
    n = 200_000
    drive.mask, drive.coordinates = np.ones(n, dtype=bool), {}
    assert slow_force(drive, np.outer([1.0, 0.0], 0.02 * np.sign(np.sin(np.arange(n) / 100.0))), Model()) is None
    assert slow_force(drive, np.zeros((2, n)), Model()) is None


def test_without_accelerometer_a_slope_would_be_a_force(drive):
    drive.channels = ("force_balance", "axle_slip")
    assert slow_force(drive, noise() + np.array([WAVE, 0.0 * T]), Model()) is None
