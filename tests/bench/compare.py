"""Two ways to the same result, timed in turns."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

ROUNDS = 7


@dataclass(frozen=True)
class Row:
    """A benchmark: `ours` and `peer` give results that `differ` compares (empty text: the same).

    `target`: the ratio of the peer's time to ours that is to be reached. `clock`: "cpu" or "wall". `work`: how much of
    the same work a call of ours does, `peer_work` one of the peer: the ratio is per unit. A peer that is a number is a
    time in seconds, such as real time.
    """

    name: str
    peer_name: str
    target: float
    ours: Callable[[], Any]
    peer: Callable[[], Any] | float
    differ: Callable[[Any, Any], str] = lambda _a, _b: ""
    clock: str = "cpu"
    conditions: str = ""
    rounds: int = ROUNDS
    work: float = 1.0
    peer_work: float = 1.0


@dataclass(frozen=True)
class Measured:
    """What came of a row: ratios of each round, seconds of each side."""

    row: Row
    ratios: tuple[float, ...]
    ours_s: tuple[float, ...]
    peer_s: tuple[float, ...]

    @property
    def is_reached(self) -> bool:
        return statistics.median(self.ratios) >= self.row.target


def measured(row: Row) -> Measured:
    """Check that both agree, then time them in turns; the first round warms both up and counts for nothing."""
    clock = time.perf_counter if row.clock == "wall" else time.process_time
    first = row.ours()
    if not isinstance(row.peer, float):
        fault = row.differ(first, row.peer())
        if fault:
            raise AssertionError(f"{row.name}: {fault}")
    ours, peer = [], []
    for _ in range(row.rounds):
        for call, times, work in ((row.ours, ours, row.work), (row.peer, peer, row.peer_work)):
            if isinstance(call, float):
                times.append(call / work)
                continue
            begin = clock()
            call()
            times.append((clock() - begin) / work)
    return Measured(row, tuple(b / a for a, b in zip(ours, peer, strict=True)), tuple(ours), tuple(peer))


def line(m: Measured) -> str:
    """A row of the table: ratio min / median / max, target, whether it is reached, time of ours."""
    low, middle, high = min(m.ratios), statistics.median(m.ratios), max(m.ratios)
    reached = "reached" if m.is_reached else "not reached"
    return (
        f"| {m.row.name} | {m.row.peer_name} | {m.row.target:g} | {low:.3g} / **{middle:.3g}** / {high:.3g} | {reached} "
        f"| {_time(min(m.ours_s) * m.row.work)} {m.row.clock} | {m.row.conditions} |"
    )


def _time(seconds: float) -> str:
    return f"{seconds:.3g} s" if seconds >= 1.0 else f"{1e3 * seconds:.3g} ms"


HEAD = (
    "| benchmark | peer | to reach | peer's time over ours, min / median / max | | ours | conditions |\n"
    "|---|---|---|---|---|---|---|"
)
