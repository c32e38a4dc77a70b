"""The rating of ISO/TS 18571: each part worked out by hand, and the whole beside a published library."""

import numpy as np
import pytest

from aqualog.validate.rating import WEIGHTS, _slope, magnitude, rating, slope

T = np.arange(0.0, 20.0, 0.1)
PULSE = np.exp(-(((T - 8.0) / 1.5) ** 2))


def test_the_same_twice_is_one():
    found = rating(PULSE, PULSE)
    assert (found.corridor, found.phase, found.magnitude, found.slope, found.shift) == (1.0, 1.0, 1.0, 1.0, 0)
    assert found.total == pytest.approx(1.0)
    assert sum(WEIGHTS) == pytest.approx(1.0)


def test_corridor():
    # max |T| = 10: inner 0.5, outer 5; off by 0.4 -> 1, by 2.75 -> ((5 - 2.75)/4.5)² = 0.25, by 6 -> 0
    reference = np.tile([10.0, -10.0, 10.0], 20)
    assert rating(reference, reference + np.tile([0.4, 2.75, 6.0], 20)).corridor == pytest.approx(
        (1.0 + 0.25 + 0.0) / 3.0
    )


@pytest.mark.parametrize("late", [10, -10, 20, 39])
def test_phase(late):
    moved = np.roll(PULSE, late)
    found = rating(PULSE, moved)
    assert found.shift == late
    assert found.phase == pytest.approx(1.0 - abs(late) / 40.0)  # 20 % of 200 samples are 40


@pytest.mark.parametrize("late", [0.4, -0.4, 12.3])
def test_the_delay_lies_between_samples(late):
    moved = np.exp(-(((T - 8.0 - 0.1 * late) / 1.5) ** 2))
    found = rating(PULSE, moved)
    assert found.late == pytest.approx(late, abs=0.01)
    assert found.shift == round(late)  # by which the phase goes


def test_magnitude_of_a_constant():
    # every pairing is off by 1 of 5: error 0.2, E_M = 1 - 0.2/0.5
    assert magnitude(np.full(50, 5.0), np.full(50, 6.0)) == pytest.approx(0.6)
    assert magnitude(np.full(50, 5.0), np.full(50, 8.0)) == 0.0


def test_warping_forgives_what_comes_a_little_later():
    # 4 samples of 100 late: within the tenth that warping may go
    a, b = (np.exp(-(((np.arange(100) - m) / 6.0) ** 2)) for m in (50.0, 54.0))
    assert magnitude(a, b) > 0.97 > slope(a, b)


def test_slope_of_ramps():
    # slopes 2 and 3: error 0.5, E_S = 1 - 0.5/2
    ramp = np.arange(50.0)
    assert slope(2.0 * ramp, 3.0 * ramp) == pytest.approx(0.75)
    assert slope(2.0 * ramp, 6.0 * ramp) == 0.0
    assert slope(np.full(50, 1.0), ramp) == 0.0


def test_nine_samples_of_the_slope():
    # a step of 9 between two samples: the central differences are 4.5 twice, their means over nine 1 in eight places,
    # 0.5 at either end
    step = np.where(np.arange(60) < 30, 0.0, 9.0)
    found = _slope(step)
    assert found[found > 0.0] == pytest.approx([0.5, *[1.0] * 8, 0.5])


def test_the_total_is_weighed():
    found = rating(PULSE, 0.8 * np.roll(PULSE, 10))
    own = (found.corridor, found.phase, found.magnitude, found.slope)
    assert found.total == pytest.approx(0.4 * own[0] + 0.2 * sum(own[1:]))
    assert 0.0 < found.total < 1.0


def test_too_short():
    with pytest.raises(ValueError, match="30"):
        rating(PULSE[:20], PULSE[:20])


# what objective-rating-metrics 1.3 (TU Graz, PyPI) gives for these curves: corridor, phase, magnitude, slope, total
PUBLISHED = {
    "late": (0.839775, 0.825, 0.92488, 0.95, 0.875886),
    "early": (0.74299, 0.625, 0.746556, 0.9, 0.751507),
    "wave": (0.762126, 0.9, 0.931831, 0.970316, 0.86528),
    "noisy": (0.742289, 0.875, 0.844472, 0.873329, 0.815476),
    "opposite": (0.127315, 0.0, 0.167864, 0.829868, 0.250473),
}


def curves():
    wave = np.sin(0.7 * T) * np.exp(-0.05 * T) + 0.2
    other = 0.9 * np.sin(0.7 * (T - 0.4)) * np.exp(-0.04 * T) + 0.25
    noise = np.random.default_rng(3).standard_normal((2, T.size))
    return {
        "late": (PULSE, 0.9 * np.roll(PULSE, 7)),
        "early": (PULSE, 1.2 * np.roll(PULSE, -15) + 0.02),
        "wave": (wave, other),
        "noisy": (wave + 0.05 * noise[0], other + 0.05 * noise[1]),
        "opposite": (wave, -wave),
    }


@pytest.mark.parametrize("name", curves())
def test_beside_a_published_library(name):
    found = rating(*curves()[name])
    own = (found.corridor, found.phase, found.magnitude, found.slope, found.total)
    assert own == pytest.approx(PUBLISHED[name], abs=1e-6)
