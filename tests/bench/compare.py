"""Two ways to the same result, measured in turns."""

from __future__ import annotations

import ctypes
import ctypes.util
import importlib.util
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

ROUNDS = 7
INSTALL = "pip install -e '.[bench]'"


@dataclass(frozen=True)
class Row:
    """A benchmark: `ours` and `peer` give results that `differ` compares (empty text: the same).

    `target`: the ratio of the peer's cost to ours that is to be reached. `clock`: "cpu" or "wall". `cost`: what a call
    took where its result tells it and no clock here does (of a process, of memory, of a page), in `unit`. `work`: how
    much of the same work a call of ours does, `peer_work` one of the peer: the ratio is per unit. A peer that is a
    number is a cost, such as real time. `needs`: modules of the peer, without which the row is not run. `is_once`: a
    process does this once, so that each side starts with memory given back.
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
    cost: Callable[[Any], float] | None = None
    unit: str = "s"
    needs: tuple[str, ...] = ()
    is_once: bool = False

    @property
    def is_runnable(self) -> bool:
        """Whether what the peer needs is installed."""
        return all(importlib.util.find_spec(n) for n in self.needs)


@dataclass(frozen=True)
class Measured:
    """What came of a row: ratios of each round, cost of each side."""

    row: Row
    ratios: tuple[float, ...]
    ours_s: tuple[float, ...]
    peer_s: tuple[float, ...]

    @property
    def is_reached(self) -> bool:
        return statistics.median(self.ratios) >= self.row.target


def measured(row: Row, rounds: int | None = None) -> Measured:
    """Check that both agree, then measure them in turns; the first round warms both up and counts for nothing."""
    first = row.ours()
    if not isinstance(row.peer, float):
        fault = row.differ(first, row.peer())
        if fault:
            raise AssertionError(f"{row.name}: {fault}")
    del first
    ours, peer = [], []
    for _ in range(rounds or row.rounds):
        for call, costs, work in ((row.ours, ours, row.work), (row.peer, peer, row.peer_work)):
            costs.append((call if isinstance(call, float) else _cost(row, call)) / work)
    return Measured(row, tuple(b / a for a, b in zip(ours, peer, strict=True)), tuple(ours), tuple(peer))


def _cost(row: Row, call: Callable[[], Any]) -> float:
    if row.is_once:
        _give_back_memory()
    clock = time.perf_counter if row.clock == "wall" else time.process_time
    begin = clock()
    result = call()
    return clock() - begin if row.cost is None else row.cost(result)


def _give_back_memory() -> None:
    """Start each side as a process of its own starts: pages that the other side has left are no gift to it."""
    libc = ctypes.CDLL(ctypes.util.find_library("c"))
    if hasattr(libc, "malloc_trim"):  # of glibc alone
        libc.malloc_trim(0)


def line(m: Measured) -> str:
    """A row of the table: ratio min / median / max, target, whether it is reached, least cost of ours."""
    low, middle, high = min(m.ratios), statistics.median(m.ratios), max(m.ratios)
    ours = _amount(min(m.ours_s) * m.row.work, m.row.unit)
    return _cells(
        m.row, f"{low:.3g} / **{middle:.3g}** / {high:.3g}", "reached" if m.is_reached else "not reached",
        f"{ours} {m.row.clock}".strip(),
    )  # fmt: skip


def line_without(row: Row, why: str) -> str:
    """A row of the table that was not measured."""
    return _cells(row, why, "", "")


def _cells(row: Row, ratio: str, reached: str, ours: str) -> str:
    return f"| {row.name} | {row.peer_name} | {row.target:.3g} | {ratio} | {reached} | {ours} | {row.conditions} |"


def _amount(value: float, unit: str) -> str:
    if unit == "s":
        return f"{value:.3g} s" if value >= 1.0 else f"{1e3 * value:.3g} ms"
    return f"{value:.3g} {unit}" if value < 100.0 else f"{value:.0f} {unit}"


HEAD = (
    "| benchmark | peer | to reach | peer's cost over ours, min / median / max | | ours | conditions |\n"
    "|---|---|---|---|---|---|---|"
)
