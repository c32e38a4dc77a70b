"""What is slow beside noise that is slow, too."""

import numpy as np
import pytest

from tests.diagnose.test_subsets import ASKED, AT, bench_of, held, waves

N = 1500


def drifting(walk, size=5.0, seed=0):
    """An effect that grows over the drive to so many standard deviations of white noise, beside that and a walk."""
    rng = np.random.default_rng(seed)
    s = waves(N, len(ASKED), seed=99) / np.array([h.parameter(h.free[0]).sigma for h in ASKED])[:, None, None]
    s[AT["road_grade"]] = np.linspace(0.0, 1.0, N) / ASKED[AT["road_grade"]].parameter("grade").sigma
    noise = rng.standard_normal((2, N)) + walk * np.cumsum(rng.standard_normal((2, N)), axis=1)
    return bench_of(noise + size * s[AT["road_grade"]] * ASKED[AT["road_grade"]].parameter("grade").sigma, s)


def chance(evidence):
    """Probability of the effect, and by how many nats a set may be likelier than none."""
    posterior = held(evidence)[1]
    return posterior.marginal.get("road_grade", 0.0), posterior.most


def test_a_drift_beside_noise_that_does_not_drift_is_certain():
    p, most = chance(drifting(0.0))
    assert p > 0.99
    assert most > 20.0


@pytest.mark.parametrize(("walk", "size", "seed"), [(0.05, 5.0, 11), (0.1, 8.0, 8)])
def test_a_drift_that_may_as_well_be_noise_is_not_sure(walk, size, seed):
    """Beside the noise that is left without the drift it would be certain."""
    p, most = chance(drifting(walk, size, seed))
    assert 0.5 < p < 0.95
    assert 0.0 < most < 3.0
