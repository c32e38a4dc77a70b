"""What can be fuzzed: a target has small sound files and says what is wrong with what aqualog makes of any other."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

SECONDS = 10.0  # of processor time: what takes longer hangs
MEGABYTES = 400.0  # that a small file may take


@dataclass(frozen=True)
class Target:
    """Files of one kind.

    `seeds()` gives sound files by name. `one(data)` works on a file with this content and raises whatever is wrong: an
    `AssertionError`, or what aqualog raises and should not. `known(seed, damages, data)`, where there is one, does the
    same and more: it knows which file that was, and so what may come of it. Of texts, words are damaged as well as bytes.
    `may_end`: a library may end the process, which is counted and is no fault: aqualog reads logs in one of their own.
    """

    about: str
    seeds: Callable[[], Mapping[str, bytes]]
    one: Callable[[bytes], None]
    known: Callable[[str, tuple, bytes], None] | None = None
    is_text: bool = False
    may_end: bool = False


TARGETS: dict[str, Target] = {}


def add(name: str, target: Target) -> None:
    """Add a target to the registry."""
    TARGETS[name] = target


def all_targets() -> dict[str, Target]:
    """Every target, by name."""
    from tests.fuzz import (  # noqa: F401 - each adds itself
        targets_campaign,
        targets_config,
        targets_csv,
        targets_dbc,
        targets_mcap,
        targets_mdf,
        targets_parquet,
        targets_ros,
        targets_simulation,
    )

    return dict(sorted(TARGETS.items()))
