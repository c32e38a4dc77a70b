"""How much work a benchmark does."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["FULL", "STANDARD", "TINY", "Scale"]


@dataclass(frozen=True)
class Scale:
    """Sizes of what is made and read.

    `hour_s`: length of the standard log [s]. `hours`: lengths of logs for memory and growth, the first is what the
    others stand beside. `logs`: numbers of logs for growth. `batch`: logs of `log_s` [s] in a batch. `steps` of a
    recursion, `slow_steps` where plain Python does it. `mf4` records and channels of the wide file. `messages_s`: length
    of the ROS 2 recording [s]. `runs` and `samples` of each in the regression. `rounds`: None for each row's own.
    """

    hour_s: float = 3600.0
    hours: tuple[float, ...] = (1.0, 4.0)
    logs: tuple[int, ...] = (10, 100)
    batch: int = 100
    log_s: float = 60.0
    steps: int = 1_000_000
    slow_steps: int = 10_000
    mf4: tuple[int, int] = (180_000, 400)
    messages_s: float = 600.0
    runs: int = 200
    samples: int = 6000
    simulated_s: float = 120.0
    rounds: int | None = None


STANDARD = Scale()
FULL = Scale(hours=(1.0, 10.0, 100.0), logs=(10, 100, 1000, 10_000), batch=1000)
TINY = Scale(
    hour_s=240.0, hours=(0.02, 0.04), logs=(2, 4), batch=10, log_s=10.0, steps=4000, slow_steps=1000, mf4=(2000, 30),
    messages_s=2.0, runs=12, samples=600, simulated_s=2.0, rounds=1,
)  # fmt: skip
