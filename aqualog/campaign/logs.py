"""Finds which logs of a campaign exist."""

from __future__ import annotations

import difflib
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from aqualog.campaign.records import Campaign

__all__ = ["LogState", "log_states", "missing_lines", "near_name"]

MOST_NEAR = 20  # missing logs for which a folder is searched for a similar name


@dataclass(frozen=True, slots=True)
class LogState:
    """One file: its size [byte], None if it is not there; `place` of the first run that names it, and `runs` naming it.

    `near` is a file beside it with a similar name, where it is missing.
    """

    path: Path
    size: int | None
    place: str
    runs: int
    near: str = ""


def log_states(campaign: Campaign, places: Sequence[str] = ()) -> tuple[LogState, ...]:
    """State of every file that the runs name, each once; a ROS 2 bag is one, with the size of its files.

    Parameters
    ----------
    campaign : Campaign
    places : sequence of str
        Where each run stands (`config.campaign.read_campaign`); empty: the campaign file.
    """
    first: dict[Path, str] = {}
    count: dict[Path, int] = {}
    for index, run in enumerate(campaign.runs):
        for path in run.logs:
            first.setdefault(path, places[index] if places else campaign.path.name)
            count[path] = count.get(path, 0) + 1
    states = []
    searched = 0
    for path, place in first.items():
        size = _size(path)
        near = ""
        if size is None and searched < MOST_NEAR:
            searched += 1
            near = near_name(path)
        states.append(LogState(path, size, place, count[path], near))
    return tuple(states)


def _size(path: Path) -> int | None:
    try:
        if path.is_dir():
            return sum(p.stat().st_size for p in path.iterdir() if p.is_file())
        return path.stat().st_size
    except OSError:
        return None


def near_name(path: Path) -> str:
    """A file beside a missing one with a similar name, or an empty string."""
    try:
        names = [n.name for n in os.scandir(path.parent)]
    except OSError:
        return ""
    near = difflib.get_close_matches(path.name, names[:2000], n=1, cutoff=0.75)
    return near[0] if near else ""


def missing_lines(states: Sequence[LogState], most: int = 10) -> list[str]:
    """One sentence per log that is missing, at most `most` of them and how many there are beyond."""
    missing = [s for s in states if s.size is None]
    lines = [
        f"{s.place}: no such log {s.path}" + (f' (did you mean "{s.near}"?)' if s.near else "") for s in missing[:most]
    ]
    return [*lines, f"and {len(missing) - most} more logs are missing"] if len(missing) > most else lines
