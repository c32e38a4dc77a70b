"""Damage drawn at random on small files of each format: what was recorded, or an error; never anything else."""

import pytest
from hypothesis import HealthCheck, given, settings

from tests.fuzz import targets_csv, targets_mcap, targets_parquet, targets_ros
from tests.fuzz.damaged_files import damaged

TARGETS = {
    "mcap": (targets_mcap.seeds, targets_mcap.one),
    "ros": (targets_ros.seeds, targets_ros.one),
    "bz2": (targets_ros.seeds_with_checksums, targets_ros.with_checksums),
    "csv": (targets_csv.seeds, targets_csv.one),
    "parquet": (targets_parquet.seeds, targets_parquet.one),
}


def go_through(name: str, examples: int) -> None:
    seeds, one = TARGETS[name]

    @settings(
        max_examples=examples, deadline=None, database=None, derandomize=examples < 100,
        suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    @given(damaged(seeds()))
    def check(data: bytes) -> None:
        one(data)

    check()


@pytest.mark.parametrize("name", TARGETS)
def test_sound_files_are_read_whole(name):
    seeds, one = TARGETS[name]
    for data in seeds():
        one(data)


@pytest.mark.parametrize("name", TARGETS)
def test_damage_drawn_at_random(name):
    go_through(name, 25)


@pytest.mark.long
@pytest.mark.parametrize("name", TARGETS)
def test_much_damage_drawn_at_random(name):
    go_through(name, 2000)
