"""Faults of a campaign's runs, wherever a run stands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from aqualog.config.table_faults import LineFaults
from aqualog.config.toml_file import TableFaults

__all__ = ["RunFaults", "RunKey", "TableRun", "TomlRun"]


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
    """Where faults of a run go: to its line of a table, or to its key of a TOML file."""

    def add(self, key: str, message: str) -> None:
        """Note a fault at a key."""

    def unknown(self, key: str, known: Sequence[str]) -> None:
        """Note a key that does not exist."""

    def number(self, key: str, value: Any, of: RunKey) -> float | None:
        """A number within its bounds, or None with the fault noted."""


class TomlRun:
    """Faults of a `[[run]]` table."""

    def __init__(self, faults: TableFaults) -> None:
        self._faults = faults

    def add(self, key: str, message: str) -> None:
        """Note a fault at a key."""
        self._faults.add(key, message)

    def unknown(self, key: str, known: Sequence[str]) -> None:
        """Note a key that does not exist."""
        self._faults.unknown(key, known)

    def number(self, key: str, value: Any, of: RunKey) -> float | None:
        """A number within its bounds, or None with the fault noted."""
        return self._faults.number({key: value}, key, low=of.low, high=of.high, unit=of.unit)


class TableRun:
    """Faults of a line of the table of runs."""

    def __init__(self, faults: LineFaults, line: int) -> None:
        self._faults, self._line = faults, line

    def add(self, key: str, message: str) -> None:
        """Note a fault at a key."""
        self._faults.add(self._line, message)

    def unknown(self, key: str, known: Sequence[str]) -> None:
        """Note a key that does not exist."""
        self._faults.unknown(self._line, "key", key, known)

    def number(self, key: str, value: Any, of: RunKey) -> float | None:
        """A number within its bounds, or None with the fault noted."""
        return self._faults.number(self._line, key, value, low=of.low, high=of.high, unit=of.unit)
