"""Logs that arrive in a folder: which of them are complete, by their size and time of change.

A folder of the network announces no changes, and may be away for a while. So it is looked at again and again, and what
was seen once is not forgotten.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from aqualog.io.open_log import LOG_SUFFIXES

__all__ = ["Arrivals", "Look", "State"]


class State(NamedTuple):
    """Size [byte] and time of change [ns] of a file."""

    size: int
    mtime_ns: int


@dataclass(frozen=True, slots=True)
class Look:
    """One look: logs that stayed as they are long enough, with their states, and those that still grow.

    `away`: why the folder cannot be read, empty if it can.
    """

    complete: tuple[tuple[Path, State], ...] = ()
    growing: tuple[Path, ...] = ()
    away: str = ""


class Arrivals:
    """The files of a folder and of those below it, over time.

    Parameters
    ----------
    folder : Path
    settle_s : float
        A file is complete when it has not changed for so long. [s]
    apart : iterable of Path
        Files that are no logs: the runs of the campaign.
    """

    def __init__(self, folder: Path, settle_s: float, apart: Iterable[Path] = ()) -> None:
        self.folder, self.settle_s = folder, settle_s
        root = folder.resolve()
        self._apart = {folder / q.relative_to(root) for q in (p.resolve() for p in apart) if q.is_relative_to(root)}
        self._seen: dict[Path, tuple[State, float]] = {}

    def look(self, now: float) -> Look:
        """Look at the folder; `now` is a clock that only goes forward. [s]"""
        try:
            found = dict(_logs_in(self.folder))
        except OSError as error:
            return Look(away=error.strerror or str(error))
        complete, growing = [], []
        for path in sorted(found.keys() - self._apart):
            state = found[path]
            before = self._seen.get(path)
            if before is None or before[0] != state:
                before = self._seen[path] = state, now
            if now - before[1] >= self.settle_s:
                complete.append((path, state))
            else:
                growing.append(path)
        return Look(tuple(complete), tuple(growing))


def _logs_in(folder: Path) -> Iterator[tuple[Path, State]]:
    """Files that bear the suffix of a log, without hidden ones: a copy under another name does not count yet."""
    folders = [folder]
    while folders:
        with os.scandir(folders.pop()) as entries:
            for entry in entries:
                if entry.name.startswith((".", "~")):
                    continue
                try:
                    if entry.is_dir(follow_symlinks=False):
                        folders.append(Path(entry.path))
                    elif entry.is_file() and Path(entry.name).suffix.lower() in LOG_SUFFIXES:
                        state = entry.stat()
                        yield Path(entry.path), State(state.st_size, state.st_mtime_ns)
                except FileNotFoundError:  # renamed or removed since the listing
                    continue
