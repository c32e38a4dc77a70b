"""Collect the faults of a campaign's runs, from a TOML file or a table."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from aqualog.campaign.records import Run
from aqualog.config.table_faults import LineFaults
from aqualog.config.toml_file import TableFaults

__all__ = ["RunFaults", "RunKey", "TableRun", "TomlRun", "check_twice"]


@dataclass(frozen=True, slots=True)
class RunKey:
    """One key of a run: `kind` is `text`, `path` or `number`; `low` and `high` bound numbers, in `unit`."""

    name: str
    kind: str
    meaning: str
    unit: str = ""
    low: float = 0.0
    high: float = 0.0


class RunFaults(Protocol):
    """Sink for the faults of a run: at its line of a table, or at its key of a TOML file."""

    place: str

    def add(self, key: str, message: str) -> None:
        """Note a fault at a key."""

    def unknown(self, key: str, known: Sequence[str]) -> None:
        """Note a key that does not exist."""

    def number(self, key: str, value: Any, of: RunKey) -> float | None:
        """Return a number within its bounds, or None with the fault noted."""


class TomlRun:
    """Faults of the `index`-th `[[run]]` table."""

    def __init__(self, faults: TableFaults, index: int, place: str) -> None:
        self._faults, self._index = faults, index
        self.place = place

    def add(self, key: str, message: str) -> None:
        """Note a fault at a key."""
        with self._faults.inside("run", self._index):
            self._faults.add(key, message)

    def unknown(self, key: str, known: Sequence[str]) -> None:
        """Note a key that does not exist."""
        with self._faults.inside("run", self._index):
            self._faults.unknown(key, known)

    def number(self, key: str, value: Any, of: RunKey) -> float | None:
        """Return a number within its bounds, or None with the fault noted."""
        if isinstance(value, str) and _reads_as_number(value):
            self.add(key, f'{key} = "{value[:40]}" is a text, not a number; write it without quotes, with a point')
            return None
        if isinstance(value, int | float) and not isinstance(value, bool) and of.low <= value <= of.high:
            return float(value)
        with self._faults.inside("run", self._index):
            return self._faults.number({key: value}, key, low=of.low, high=of.high, unit=of.unit)


def _reads_as_number(text: str) -> bool:
    try:
        float(text.strip().replace(",", "."))
    except ValueError:
        return False
    return True


class TableRun:
    """Faults of a line of the table of runs."""

    def __init__(self, faults: LineFaults, line: int, place: str) -> None:
        self._faults, self._line = faults, line
        self.place = place

    def add(self, key: str, message: str) -> None:
        """Note a fault at a key."""
        self._faults.add(self._line, message)

    def unknown(self, key: str, known: Sequence[str]) -> None:
        """Note a key that does not exist."""
        self._faults.unknown(self._line, "key", key, known)

    def number(self, key: str, value: Any, of: RunKey) -> float | None:
        """Return a number within its bounds, or None with the fault noted."""
        return self._faults.number(self._line, key, value, low=of.low, high=of.high, unit=of.unit)


def check_twice(found: list[tuple[Run | None, RunFaults]]) -> None:
    """Note a drive that is in two runs, and would count twice, unless each run is another stretch of it."""
    by_logs: dict[tuple[str, ...], list[tuple[Run, RunFaults]]] = {}
    for run, sink in found:
        if run is not None:
            key = tuple(sorted(os.path.normcase(os.path.normpath(p)) for p in run.logs))
            by_logs.setdefault(key, []).append((run, sink))
    for several in by_logs.values():
        if len(several) == 1:
            continue
        name = several[0][0].logs[0].name
        for (run, sink), (_, before) in zip(several[1:], several, strict=False):
            if run.lane is None or several[0][0].lane is None:
                sink.add("log", f"log {name!r} stands in {before.place} too; runs of one log need lane times each")
        laned = sorted(((r.lane, s) for r, s in several if r.lane is not None), key=lambda x: x[0])
        for (lane, sink), (previous, other) in zip(laned[1:], laned, strict=False):
            if lane[0] < previous[1]:
                sink.add("lane_start_s", f"the lane overlaps with that in {other.place}, of the same log {name!r}")
