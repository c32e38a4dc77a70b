"""Samples of a drive at its own rate around its episodes, for the page of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import polars as pl

from aqualog.core.judgement import Judgement
from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray, Track

__all__ = ["BESIDE_S", "MOST_S", "FullRate"]

BESIDE_S = 2.0  # [s] before and after an episode
MOST_S = 300.0  # [s] of windows in one log: 5 min of 100 Hz take 1 MB
MOST_HELD_S = 1800.0  # [s] near any detection that are held until the episodes are known: 8 MB of 100 Hz
V_LEAST = 3.0  # [m/s] below, a wheel's deviation from the car is no slip
_LAST = ("wheel_lock", "single_detector")  # the other kinds come first

_Arrays = dict[str, FloatArray]


class FullRate:
    """Take a drive piece by piece; what is near a detection is held until its episodes are known.

    Parameters
    ----------
    dt : float
        Sample time of the drive. [s]

    Columns: `t` [s] from the log's first sample; `v_x` [m/s]; `slip_*` [-] rim against car with radii learnt; `mu_*`
    [-] by wheel torque; `delta_a_x` [m/s²] (2.9). Those that the drive does not have are not there. How the drive is
    cut does not matter.
    """

    def __init__(self, dt: float) -> None:
        self._dt = dt
        self._beside = max(1, round(BESIDE_S / dt))
        self._most = round(MOST_HELD_S / dt)
        self._start = 0  # row of the drive at which the pending data begin
        self._done = 0  # rows of the drive that are kept or left out
        self._held = 0
        self._pending: _Arrays = {}
        self._bits: BoolArray = np.zeros(0, dtype=np.bool_)
        self._kept: list[_Arrays] = []

    def push(self, features: Mapping[str, FloatArray], tracks: Sequence[Track]) -> None:
        """Take the next piece, arrays (n,)."""
        columns = _columns_of(features)
        active = np.any([np.zeros(features["v_x_hat"].size, dtype=np.bool_), *(t.active for t in tracks)], axis=0)
        held = self._pending
        self._pending = {k: np.concatenate([held[k], x]) for k, x in columns.items()} if held else columns
        self._bits = np.concatenate([self._bits, active])
        self._settle(self._start + self._bits.size - self._beside)

    def finish(self, judgement: Judgement) -> pl.DataFrame | None:
        """Return the samples around the episodes, at most `MOST_S` of them, in order of time; None without any."""
        self._settle(self._start + self._bits.size)
        if not self._kept:
            return None
        held = {k: np.concatenate([part[k] for part in self._kept]) for k in self._kept[0]}
        t = held["t"]
        wanted = np.zeros(t.size, dtype=np.bool_)
        most = round(MOST_S / self._dt)
        for e in sorted(judgement.episodes, key=lambda e: (e.kind in _LAST, e.start_s)):
            more = np.flatnonzero(~wanted & (t >= e.start_s - BESIDE_S) & (t <= e.end_s + BESIDE_S))
            wanted[more[: max(most - int(wanted.sum()), 0)]] = True
        if not wanted.any():
            return None
        return pl.DataFrame([
            pl.Series(k, x[wanted], dtype=pl.Float64 if k == "t" else pl.Float32, nan_to_null=True)
            for k, x in held.items()
        ])  # fmt: skip

    def _settle(self, end: int) -> None:
        """Keep or leave out all rows before `end`, whose neighbours are known."""
        if end <= self._done:
            return
        first, last = self._done - self._start, end - self._start
        total = np.concatenate([[0], np.cumsum(self._bits)])
        rows = np.arange(first, last)
        low, high = np.maximum(rows - self._beside, 0), np.minimum(rows + self._beside + 1, self._bits.size)
        near = rows[total[high] > total[low]][: max(self._most - self._held, 0)]
        if near.size:
            part = {k: x[near].astype(np.float32) for k, x in self._pending.items()}
            self._kept.append({"t": np.round((self._start + near) * self._dt, 6), **part})  # type: ignore[dict-item]
            self._held += near.size
        self._done = end
        gone = max(end - self._beside - self._start, 0)
        self._pending = {k: x[gone:].copy() for k, x in self._pending.items()}
        self._bits = self._bits[gone:].copy()
        self._start += gone


def _columns_of(f: Mapping[str, FloatArray]) -> dict[str, Any]:
    v = f["v_x_hat"]
    fast = np.where(v > V_LEAST, v, np.nan)
    slips = {f"slip_{w}": f[f"v_w_delta_{w}"] / fast for w in WHEELS if f"v_w_delta_{w}" in f}
    mus = {f"mu_{w}": f[f"mu_{w}"] for w in WHEELS if f"mu_{w}" in f}
    return {"v_x": v, **slips, **mus, **({"delta_a_x": f["delta_a_x"]} if "delta_a_x" in f else {})}
