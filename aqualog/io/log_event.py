"""A span of time with a name, as log formats keep it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

__all__ = ["LogEvent"]


@dataclass(frozen=True, slots=True)
class LogEvent:
    """What happened between two moments of a log.

    `start_ns` and `end_ns` count from the log's start, `end_ns` >= `start_ns`. `text` is a sentence for a reader,
    `properties` are plain values by name.
    """

    name: str
    start_ns: int
    end_ns: int
    text: str
    properties: Mapping[str, str]
