"""Episodes on simulated drives: as many as there are lanes of water, with its edges, and none on dry roads."""

import numpy as np
import pytest

from tests.detect import episode_study as study


def passes(n, first):
    found, seed = [], first
    while len(found) < n:
        found += [one] if (one := study.one_pass(seed, study.SCORING_POOL)) is not None else []
        seed += 1
    edges = np.abs([edge for one in found for edge in one.edges])
    return np.mean([one.is_counted for one in found]), np.mean(edges <= 1.0, axis=0), np.median(edges, axis=0)


def test_each_lane_is_an_episode_with_its_edges():
    counted, (begin, end), median = passes(20, 3000)
    assert counted >= 0.95
    assert min(begin, end) >= 0.93
    assert max(median) < 0.1


@pytest.mark.nightly
def test_number_and_edges_of_many_lanes():
    counted, (begin, end), _ = passes(400, 4000)
    assert counted >= 0.98
    assert begin >= 0.98
    assert end >= 0.98


@pytest.mark.parametrize("name", ["snow_entry", "hard_braking", "wind_shelter", "split_friction"])
def test_a_dry_drive_has_no_episode_of_aquaplaning(name):
    assert study.dry(name, 3000, study.SCORING_POOL)[1] == []


@pytest.mark.nightly
def test_a_hundred_dry_hours_have_at_most_one_episode_of_aquaplaning():
    assert len(study.alarms(100.0, 4000, study.SCORING_POOL)[1]) <= 1
