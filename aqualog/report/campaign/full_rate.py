"""Samples at the log's own rate around episodes, put into the lines of a run's page."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl

from aqualog.campaign.full_rate import BESIDE_S
from aqualog.core.judgement import Judgement
from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray
from aqualog.report.drive.judged import FOLDED
from aqualog.report.values import KMH, counted

__all__ = ["MOST_ROWS", "Dense", "dense_of"]

MOST_ROWS = 4000  # on a page: 40 s of 100 Hz in 300 kB


@dataclass(frozen=True, slots=True)
class Dense:
    """Rows (n,) of the store's table at the log's rate that a page holds; `sentence` says of which episodes."""

    frame: pl.DataFrame
    step_s: float
    sentence: str

    def into(self, drawn: dict[str, Any]) -> dict[str, Any]:
        """Return what the page draws, with these rows in place of its points where they are."""
        t = self._array("t")
        ends = np.flatnonzero(np.diff(t) > 1.5 * self.step_s)
        begins = np.concatenate([[0], ends + 1])
        spans = list(zip(t[begins].tolist(), t[np.concatenate([ends, [t.size - 1]])].tolist(), strict=True))
        old = np.array(drawn["t"], dtype=np.float64)
        stay = np.all([(old < a) | (old > b) for a, b in spans], axis=0) if old.size else np.zeros(0, dtype=np.bool_)
        order = np.argsort(np.concatenate([old[stay], t]), kind="stable")
        mine = self._lines()
        lines = {
            kind: [[name, wheel, _merged(y, stay, mine.get((kind, name)), order, t.size)] for name, wheel, y in own]
            for kind, own in drawn["lines"].items()
        }
        return {**drawn, "t": _merged(drawn["t"], stay, np.round(t, 4), order, t.size), "lines": lines}

    def _lines(self) -> dict[tuple[str, str], FloatArray]:
        """Values by kind and name of a line, as `run_page` has them."""
        v = KMH * self._array("v_x")
        found = {("speed", "v_x"): np.round(v, 2), ("resistance", "resistance"): np.round(self._array("delta_a_x"), 3)}
        for w in WHEELS:
            slip = self._array(f"slip_{w}")
            found["speed", w.upper()] = np.round(v * (1.0 + slip), 2)
            found["low", w.upper()] = found["high", w.upper()] = np.round(100.0 * slip, 2)
            found["traction", w.upper()] = np.round(self._array(f"mu_{w}"), 4)
        return found

    def _array(self, name: str) -> FloatArray:
        if name not in self.frame.columns:
            return np.full(self.frame.height, np.nan)
        values: FloatArray = self.frame.get_column(name).to_numpy().astype(np.float64)
        return values


def _merged(
    old: list[float | None], stay: BoolArray, new: FloatArray | None, order: Any, count: int
) -> list[float | None]:
    kept = [x for x, is_kept in zip(old, stay.tolist(), strict=True) if is_kept]
    more = [None] * count if new is None else [x if math.isfinite(x) else None for x in new.tolist()]
    both = kept + more
    return [both[i] for i in order.tolist()]


def dense_of(full: pl.DataFrame, judgement: Judgement) -> Dense | None:
    """Return the rows that a page holds, of whole episodes, the folded kinds last; None where none fits."""
    t = full.get_column("t").to_numpy()
    if t.size < 2:
        return None
    chosen, shown = np.zeros(t.size, dtype=np.bool_), 0
    for e in sorted(judgement.episodes, key=lambda e: (e.kind in FOLDED, e.start_s)):
        here = (t >= e.start_s - BESIDE_S) & (t <= e.end_s + BESIDE_S)
        if here.any() and int((chosen | here).sum()) <= MOST_ROWS:
            chosen, shown = chosen | here, shown + 1
    if not shown:
        return None
    step, all_of_them = float(np.median(np.diff(t))), len(judgement.episodes)
    which = "the episodes" if shown == all_of_them else f"{shown} of {counted(all_of_them, 'episode')}"
    sentence = (
        f"The log's own rate, one point every {step:.2g} s, from {BESIDE_S:g} s before to {BESIDE_S:g} s after "
        f"{which}. Elsewhere: "
    )
    return Dense(full.filter(pl.Series(chosen)), step, sentence)
