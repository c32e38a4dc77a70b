"""Collect the faults of a table file (CSV) into one message."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable
from pathlib import Path

from aqualog.core.errors import ConfigError

__all__ = ["LineFaults"]

LONGEST = 500  # characters of one fault; a cell may be of any length
MOST = 20  # faults that are spelt out; a table with a wrong column has one in every line


class LineFaults:
    """Collects the faults of a file by line, then raises them together."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._found: list[str] = []

    def add(self, line: int | None, message: str) -> None:
        """Note a fault on a line (from 1), or of the file."""
        short = message if len(message) <= LONGEST else f"{message[: LONGEST // 2]} ... {message[-LONGEST // 2 :]}"
        self._found.append(f"line {line}: {short}" if line else short)

    def unknown(self, line: int | None, what: str, name: str, known: Iterable[str], *, hint: str = "") -> None:
        """Note a name that does not exist, with the nearest one that does; else with the hint."""
        near = difflib.get_close_matches(name.lower(), sorted(known), n=1, cutoff=0.5)
        told = f' (did you mean "{near[0]}"?)' if near else f" ({hint})" if hint else ""
        self.add(line, f'unknown {what} "{name[:60]}"{told}')

    def number(self, line: int | None, name: str, text: str, *, low: float, high: float, unit: str) -> float | None:
        """Return a number within its bounds, or None with the fault noted."""
        try:
            value = math.nan if "_" in text else float(text)  # Python reads 1_9 as 19
        except ValueError:
            value = math.nan
        if math.isnan(value):
            told = f" (in {unit}, without the unit)" if unit and text.lower().endswith(unit.lower()) else ""
            self.add(line, f"{name} = {text[:40]!r} is not a number{told}")
            return None
        if not low <= value <= high:
            self.add(line, f"{name} = {value:g} is outside {low:g} ... {high:g} {unit}".rstrip())
            return None
        return value

    def raise_if_any(self) -> None:
        """Raise one ConfigError with the faults."""
        if self._found:
            more = f"; and {len(self._found) - MOST} more" if len(self._found) > MOST else ""
            raise ConfigError("; ".join(self._found[:MOST]) + more, where=str(self._path))
