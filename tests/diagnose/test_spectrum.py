"""Inner products under noise: twice a log-likelihood, of which fast movements count less."""

import numpy as np

from aqualog.diagnose.noise import weighing
from tests.diagnose.test_noise import coloured

N = 3000


def shown(f_hz, seed=1):
    """What a wave of 0.1 in the first channel is worth in noise. f in Hz at 10 samples a second."""
    x = np.random.default_rng(seed).standard_normal((2, N))
    w = weighing([x], np.ones(N, dtype=bool), np.eye(2))
    wave = np.zeros((1, 2, N))
    wave[0, 0] = 0.1 * np.sin(2.0 * np.pi * f_hz * np.arange(N) / 10.0)
    row = w.rows(wave)[0]
    return float(row @ row)


def test_slow_waves_count_in_full_and_fast_ones_hardly():
    full = 0.5 * 0.1**2 * N  # in white noise of unit size
    np.testing.assert_allclose(shown(0.3) / full, 1.0, atol=0.15)
    np.testing.assert_allclose(shown(1.5) / full, 0.5, atol=0.1)
    assert shown(4.0) / full < 0.03


def test_noise_of_twice_the_size_is_more_surprising_by_as_much_as_it_has_degrees_of_freedom():
    """The likelihood of a residual under its own noise must not depend on the unit it is measured in."""
    x = coloured(2)[:, :N]
    w = weighing([x], np.ones(N, dtype=bool), np.eye(3))
    double = weighing([2.0 * x], np.ones(N, dtype=bool), np.eye(3))
    count = 2.0 * w.surprise(x) - 2.0 * w.sharpness  # of what counts
    np.testing.assert_allclose((double.surprise(2.0 * x) - w.surprise(x)) / (count * np.log(2.0)), 1.0, atol=0.03)
