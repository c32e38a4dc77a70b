"""What is slow beside noise that is slow, too."""

from itertools import combinations

import numpy as np
import pytest

from aqualog.diagnose.arena import arena_of
from aqualog.diagnose.compete import begin, compete
from tests.diagnose.test_subsets import ASKED, AT, bench_of, held, made, waves

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


@pytest.mark.parametrize(("walk", "size", "seed"), [(0.05, 5.0, 11), (0.1, 0.0, 9)])
def test_a_drift_that_may_as_well_be_noise_is_not_sure(walk, size, seed):
    """Beside the noise that is left without the drift it would be certain."""
    p, most = chance(drifting(walk, size, seed))
    assert 0.5 < p < 0.95
    assert 0.0 < most < 3.0


def known_signatures():
    return waves(N, len(ASKED), seed=99) / np.array([h.parameter(h.free[0]).sigma for h in ASKED])[:, None, None]


@pytest.mark.parametrize("seed", [0, 1])
def test_a_channel_of_small_steps_does_not_hide_what_another_one_shows(seed):
    """By steps from sample to sample the load is that of the second channel, which has a contradiction of its own."""
    s, load = known_signatures(), AT["payload_mass"]
    s[load, 1] *= 0.05
    noise = np.random.default_rng(seed).standard_normal((2, N)) * [[1.0], [0.05]]
    own = s[load] * ASKED[load].parameter("delta_mass").sigma
    posterior = held(bench_of(noise + np.array([[2.0], [-4.0]]) * own, s))[1]
    assert posterior.marginal["payload_mass"] > 0.95


@pytest.mark.parametrize(("size", "low", "high"), [(4.0, 0.95, 1.0), (0.0, 0.0, 0.5)])
@pytest.mark.parametrize("seed", [0, 4, 5])
def test_an_offset_is_no_noise_that_only_a_drift_would_leave(seed, size, low, high):
    """Beside hills of half of a unit; what the drift leaves is a ramp, whose noise has room for an offset."""
    rng, s = np.random.default_rng(seed), known_signatures()
    ramp = np.linspace(0.0, 1.0, N)
    for key, row in (("road_grade", np.ones(N)), ("head_wind", 2.0 * ramp - 1.0), ("rolling_resistance", ramp**2)):
        h = ASKED[AT[key]]
        s[AT[key]] = np.stack([row, 0.0 * row]) / h.parameter(h.free[0]).sigma
    window = np.hanning(301) / np.sqrt((np.hanning(301) ** 2).sum())
    hills = np.convolve(rng.standard_normal(N + 300), window, "valid")
    first = size + 0.5 * hills + 0.1 * rng.standard_normal(N)
    posterior = held(bench_of(np.stack([first, rng.standard_normal(N)]), s))[1]
    assert low <= posterior.marginal.get("road_grade", 0.0) <= high


def test_a_noise_is_sought_beside_the_best_set_without_each_of_its_effects():
    """One of them may only stand for noise, beside which none of the set would be likelier than noise alone."""
    arena = arena_of(made(road_grade=3.0, torque_gain=3.0, payload_mass=3.0), ())
    begun = begin(arena)
    best = compete(arena, begun=begun).best
    tried = {members for members, _ in begun.tried}
    assert len(best) == 3
    assert set(combinations(best, 2)) <= {tuple(sorted(m)) for m in tried}
