"""What can be fuzzed. A target makes small files, and judges what a reader makes of a damaged one."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

SECONDS = 10.0  # a reader that takes longer hangs
MEGABYTES = 400.0  # that a small file may take


@dataclass(frozen=True)
class Target:
    """Files by name, and `judge(name, damages, path)`: what is wrong with the outcome, or None.

    `path` holds the file `name` with these damages.
    """

    makers: dict[str, Callable[[Path], bytes]]
    judge: Callable[[str, tuple, Path], str | None]
    suffix: str


TARGETS: dict[str, Callable[[], Target]] = {}


def target(name: str) -> Callable[[Callable[[], Target]], Callable[[], Target]]:
    """Add a function that makes a target to the registry."""

    def add(make: Callable[[], Target]) -> Callable[[], Target]:
        TARGETS[name] = make
        return make

    return add
