"""One key of a settings file, as data: what the loader checks and the reference shows."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["FileKey"]


@dataclass(frozen=True, slots=True)
class FileKey:
    """`table` is the TOML table, empty for the top level; `default` is text, empty where the key has no effect if it
    is left out.
    """

    table: str
    name: str
    kind: str
    unit: str
    default: str
    meaning: str
