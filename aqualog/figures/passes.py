"""Passes over the water as points: the speed from which events occur, and its relation to other quantities."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from aqualog.campaign.bins import Pool
from aqualog.campaign.full_speed import fit_half
from aqualog.campaign.samples import RunInfo
from aqualog.campaign.spin_downs import Pass, passes
from aqualog.core.records import BoolArray, FloatArray
from aqualog.figures.evidence import Evidence
from aqualog.figures.measures import LEAST_RUNS, Effect, lines_through

__all__ = ["begins", "full_speed", "half_speeds", "has_full", "has_minor", "over_passes", "passes_of"]

_DRAWS, _SEED = 400, 20_240  # of passes, for the interval; as in `campaign.full_speed`


def passes_of(evidence: Evidence, runs: Sequence[RunInfo]) -> list[Pass]:
    """Passes of some runs."""
    return passes(evidence.part(runs))


def has_minor(p: Pass) -> bool:
    """Whether a free wheel has a minor spin-down."""
    return any(p.minor.values())


def has_full(p: Pass) -> bool:
    """Whether a free wheel loses half of its speed."""
    return any(p.full.values())


def begins(p: Pass) -> bool:
    """Whether a free wheel has a minor spin-down, or is beyond."""
    return has_minor(p) or has_full(p)


def half_speeds(found: Sequence[Pass], events: Sequence[Callable[[Pass], bool]]) -> list[tuple[float, FloatArray]]:
    """For each kind of event: speed at which half of the passes have one, and the same for bootstrapped passes,
    array (400,). [m/s] NaN where the passes are of one kind.
    """
    v = np.array([p.v_mean for p in found])
    rng = np.random.default_rng(_SEED)
    times = rng.multinomial(v.size, np.full(v.size, 1.0 / v.size), size=_DRAWS).astype(np.float64)
    out = []
    for event in events:
        hit: BoolArray = np.array([event(p) for p in found], dtype=bool)
        out.append((float(fit_half(v, hit, np.ones((1, v.size)))[0]), fit_half(v, hit, times)))
    return out


def full_speed(found: Sequence[Pass]) -> float:
    """Speed at which half of the passes have a full spin-down; NaN where none or all have. [m/s]"""
    return half_speeds(found, [has_full])[0][0] if found else float("nan")


def over_passes(columns: Sequence[FloatArray], y: FloatArray) -> list[Effect] | None:
    """Coefficients of columns (each (n,)) over passes, one value each; None with too few passes."""
    n = y.size
    x = np.stack(columns)
    if n < max(LEAST_RUNS, len(columns) + 2) or np.linalg.matrix_rank(x) < len(columns):
        return None
    return lines_through(Pool(np.arange(n), np.zeros(n, dtype=np.int64), {"y": y}), list(columns), scatters=False)
