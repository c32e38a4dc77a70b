"""Coloured noise: white once it is whitened, silent where nothing was measured, and drawn anew with its colours."""

import numpy as np
import pytest

from aqualog.diagnose.noise import MEMORY, bridged, fit_noise, for_mask, whitened

N = 6000


def driven(e, keep):
    """First-order low-pass of unit variance for white noise of unit variance."""
    x = e.copy()
    for i in range(1, x.size):
        x[i] = keep * x[i - 1] + np.sqrt(1.0 - keep * keep) * e[i]
    return x


def first_order(rng, keep, n=N):
    return driven(rng.standard_normal(n), keep)


def coloured(seed, n=N):
    """Three channels: a drift of 5 s in white noise, and two first-order ones that share half of what drives them."""
    rng = np.random.default_rng(seed)
    drift = first_order(rng, np.exp(-0.1 / 5.0), n) + 0.5 * rng.standard_normal(n)
    a, b = rng.standard_normal((2, n))
    return np.array([drift, 30.0 * driven(a, 0.8), 2.0 * driven(0.7 * a + 0.7 * b, 0.3)])


def unit(x, noise):
    return whitened(x[None], noise)[0].reshape(x.shape)


def lagged(z, lag):
    return float((z[lag:] * z[: z.size - lag]).mean() / (z * z).mean())


@pytest.mark.parametrize("seed", [1, 2])
def test_whitened_noise_is_white_of_unit_variance_and_unrelated_across_channels(seed):
    x = coloured(seed)
    z = unit(x, fit_noise(x, np.ones(N, dtype=bool), np.eye(3)))
    for row in z:
        assert row.var() == pytest.approx(1.0, abs=0.05)
        # 4 standard deviations of a correlation of N samples
        assert max(abs(lagged(row, k)) for k in (1, 2, 3, 5, 10, 30, 100)) < 4.0 / np.sqrt(N)
    assert np.abs(np.corrcoef(z) - np.eye(3)).max() < 4.0 / np.sqrt(N)


def test_raw_noise_is_not_white():
    assert lagged(coloured(1)[0], 10) > 0.4


def test_masked_samples_are_zero_and_do_not_touch_the_others():
    x = coloured(3)
    mask = np.ones(N, dtype=bool)
    mask[2000:2400] = False
    wild = x.copy()
    wild[:, ~mask] = 1e6
    noise = fit_noise(wild, mask, np.eye(3))
    z = unit(bridged(wild, mask), noise)
    assert np.all(z[:, 2000:2400] == 0.0)
    assert np.array_equal(noise.taps, fit_noise(x, mask, np.eye(3)).taps)
    assert (noise.weights**2).sum() == pytest.approx(3 * 5600, rel=0.03)


def test_outliers_weigh_little():
    x = coloured(4)
    clean = fit_noise(x, np.ones(N, dtype=bool), np.eye(3))
    hit = x.copy()
    hit[0, 500::500] += 50.0 * x[0].std()
    noise = fit_noise(hit, np.ones(N, dtype=bool), np.eye(3))
    assert noise.weights[0, 1000] < 0.3
    assert clean.weights[0].mean() > 0.98
    assert clean.weights.max() < 1.2


def test_a_rough_stretch_has_a_size_of_its_own():
    """Noise of one size for the whole drive would let an effect of the rough stretch look significant."""
    x = coloured(6)
    x[1, 2000:4000] *= 3.0
    z = unit(x, fit_noise(x, np.ones(N, dtype=bool), np.eye(3)))
    for at in (slice(0, 1800), slice(2200, 3800), slice(4200, N)):
        np.testing.assert_allclose(z[:, at].std(axis=1), 1.0, atol=0.1)


def test_an_offset_is_not_taken_for_noise():
    x = coloured(5)
    noise = fit_noise(x + np.array([[5.0], [0.0], [0.0]]), np.ones(N, dtype=bool), np.eye(3))
    assert np.allclose(noise.taps, fit_noise(x, np.ones(N, dtype=bool), np.eye(3)).taps, atol=1e-6)


def test_the_scale_of_a_channel_does_not_matter():
    x = 1e3 * coloured(6)
    mask = np.ones(N, dtype=bool)
    by = np.array([[1e3], [50.0], [7.0]])
    a, b = unit(x, fit_noise(x, mask, np.eye(3))), unit(by * x, fit_noise(by * x, mask, np.eye(3)))
    np.testing.assert_allclose(a, b, atol=1e-5)


def test_perfect_sensors_are_not_believed():
    x = 1e-9 * coloured(6)
    z = unit(x, fit_noise(x, np.ones(N, dtype=bool), np.eye(3)))
    assert np.abs(z).max() < 1e-3


def test_whitening_is_linear():
    x, y = coloured(7), coloured(8)
    noise = fit_noise(x, np.ones(N, dtype=bool), np.eye(3))
    np.testing.assert_allclose(unit(2.0 * x - y, noise), 2.0 * unit(x, noise) - unit(y, noise), atol=1e-9)


def test_noise_of_one_drive_serves_another_with_full_weight_where_it_can():
    noise = fit_noise(coloured(9), np.ones(N, dtype=bool), np.eye(3))
    mask = np.ones(1000, dtype=bool)
    mask[300:400] = False
    other = for_mask(noise, mask)
    assert other.weights.shape == (3, 1000)
    assert np.all(other.weights[:, 300:400] == 0.0)
    # six samples after a gap have a bridged past
    assert np.all(other.weights[:, 400:406] == 0.0)
    assert np.all(other.weights[:, 406:] == 1.0)


def test_bridges_are_straight():
    x = np.arange(10.0)
    mask = np.ones(10, dtype=bool)
    mask[3:6] = False
    spoiled = np.where(mask, x, np.nan)
    np.testing.assert_allclose(bridged(spoiled[None], mask)[0], x)
    assert np.all(bridged(spoiled[None], np.zeros(10, dtype=bool)) == 0.0)


def test_what_came_before_the_log_is_its_first_second():
    x = np.full((1, 1, 500), 3.0)
    noise = fit_noise(coloured(10, 1000)[:1], np.ones(1000, dtype=bool), np.eye(1))
    z = whitened(x, for_mask(noise, np.ones(500, dtype=bool)))[0]
    np.testing.assert_allclose(z[:MEMORY], z[-1], rtol=1e-6)
