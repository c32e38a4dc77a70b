"""Rows on disk, a line each: a run that was killed goes on where it stopped."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

from tests.blind.metrics.rows import Row, row_from, row_text

__all__ = ["Store"]


class Store:
    """Rows of a folder. Without a folder they are kept in memory only.

    A line that was cut off when the run was killed is left out, and its case done again.
    """

    def __init__(self, folder: Path | None) -> None:
        self._path = None if folder is None else folder / "rows.jsonl"
        self.rows: dict[str, Row] = {}
        if self._path is not None:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            if self._path.exists():
                self._read(self._path)

    def _read(self, path: Path) -> None:
        text = path.read_text(encoding="utf-8")
        for line in text.splitlines():
            try:
                row = row_from(line)
            except (json.JSONDecodeError, KeyError, TypeError):
                continue
            self.rows[row.key] = row
        if text and not text.endswith("\n"):
            with path.open("a", encoding="utf-8") as file:
                file.write("\n")

    def add(self, row: Row) -> None:
        """Keep a row and write it out at once."""
        self.rows[row.key] = row
        if self._path is not None:
            with self._path.open("a", encoding="utf-8") as file:
                file.write(row_text(row) + "\n")

    def having(self, keys: Iterable[str]) -> list[Row]:
        """The rows of these keys that there are; a case that failed counts as not there."""
        return [self.rows[k] for k in keys if k in self.rows]
