"""Reduce a long drive to the least and greatest value of each stretch, so that no peak is lost."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import TypeVar

import numpy as np

from aqualog.core.records import FloatArray

__all__ = ["Extremes"]

STRETCHES = 50_000

_Key = TypeVar("_Key", bound=Hashable)


class Extremes:
    """Two rows for each stretch of a drive: its least and greatest value, in the order of their times.

    Parameters
    ----------
    rows : int
        Of the drive.
    dt_ns : int
        [ns]
    """

    def __init__(self, rows: int, dt_ns: int) -> None:
        self._length = max(2, -(-rows // STRETCHES))
        self._length += self._length % 2
        self.dt_ns = self._length * dt_ns // 2
        self._left = rows
        self._rest: dict[Hashable, FloatArray] = {}
        self._kept: dict[Hashable, list[FloatArray]] = {}

    def push(self, columns: Mapping[_Key, FloatArray]) -> None:
        """Take the next rows (n,) of all columns; a stretch without any number is drawn as NaN."""
        n = next(iter(columns.values())).size
        self._left -= n
        for key, new in columns.items():
            x = np.concatenate([self._rest[key], new]) if key in self._rest else new
            if self._left <= 0 and x.size % self._length:
                x = np.concatenate([x, np.full(-x.size % self._length, np.nan)])
            whole = x.size // self._length * self._length
            self._kept.setdefault(key, []).append(_extremes(x[:whole].reshape(-1, self._length)))
            self._rest[key] = x[whole:].copy()

    def columns(self) -> dict[_Key, FloatArray]:
        """Return the extremes, by the names that were given."""
        return {key: np.concatenate(parts) for key, parts in self._kept.items()}  # type: ignore[misc]


def _extremes(x: FloatArray) -> FloatArray:
    """Return least and greatest value of each row (m, k), earlier first: (2 m,)."""
    missing = np.isnan(x)
    low, high = np.where(missing, np.inf, x), np.where(missing, -np.inf, x)
    at_low, at_high = low.argmin(axis=1), high.argmax(axis=1)
    m = np.arange(len(x))
    out = np.stack([x[m, np.minimum(at_low, at_high)], x[m, np.maximum(at_low, at_high)]], axis=1)
    nothing = missing.all(axis=1)
    out[nothing] = np.nan
    return np.asarray(out.reshape(-1))
