"""Gain of a set of effects on runs that it was not fitted to: a depth, pressure or fold left out."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from aqualog.core.records import FloatArray
from aqualog.diagnose.campaign.noise import Fit
from aqualog.diagnose.campaign.passes import RESISTANCE, Passes
from aqualog.diagnose.campaign.refit import Refit, settled
from aqualog.diagnose.records import ChannelGain, Gain

__all__ = ["gain"]

FOLDS = 5
LEAST = 3  # groups of a key, each left out once
MOST = 0.35  # share of the runs in a group; without more of them the rest is another campaign
DRAWS = 2000
KEYS = (("depth", "water_depth_mm", 1e3), ("pressure", "pressure_rear_bar", 1e-5))


def gain(passes: Passes, chosen: Refit, nothing: Refit, scatter: Fit, *, seed: int) -> Gain | None:
    """Leave groups of runs out, fit the sizes on the others, and predict those left out.

    Returns
    -------
    Gain
        `log_score` in nats (natural logarithm) over all runs left out, with a bootstrap interval over runs; None with
        few wet runs.
    """
    wet = np.flatnonzero(np.isfinite(passes.values[:, -1]))
    if wet.size < 2 * FOLDS:
        return None
    rng = np.random.default_rng([seed, 7])
    groups, names = _groups(passes, wet, rng)
    slips = [i for i, n in enumerate(passes.names) if not n.startswith("dry_")]
    before, after = np.full((2, *passes.values.shape), np.nan)
    for held in groups:
        rest = np.setdiff1d(np.arange(passes.values.shape[0], dtype=np.int64), held)
        for s, into in ((nothing, before), (chosen, after)):
            into[held] = settled(s, passes, scatter.weight, rest)[held]
    scores = 0.5 * (_scores(before, slips, scatter) - _scores(after, slips, scatter))[wet]
    drawn = scores[rng.integers(0, wet.size, (DRAWS, wet.size))].sum(axis=1)
    low, high = (float(x) for x in np.quantile(drawn, (0.025, 0.975)))
    channels = tuple(
        ChannelGain(n, "m/s^2" if n == RESISTANCE else "-", _rms(before[wet, i]), _rms(after[wet, i]))
        for i, n in enumerate(passes.names) if i in slips
    )  # fmt: skip
    return Gain(channels, float(scores.sum()), low, high, tuple(names), in_sample=False)


def _groups(
    passes: Passes, wet: NDArray[np.int64], rng: np.random.Generator
) -> tuple[list[NDArray[np.int64]], list[str]]:
    for word, key, factor in KEYS:
        x = np.round(passes.coordinates[word][wet] * factor, 3)
        values, counts = np.unique(x, return_counts=True)
        if values.size >= LEAST and min(counts) >= 2 and max(counts) <= MOST * wet.size:
            return [wet[x == v] for v in values], [f"runs with {key} = {v:g}" for v in values]
    order = rng.permutation(wet)
    names = [f"fold {k + 1} of {FOLDS} of the runs" for k in range(FOLDS)]
    return [np.sort(order[k::FOLDS]) for k in range(FOLDS)], names


def _scores(e: FloatArray, channels: list[int], scatter: Fit) -> FloatArray:
    """Weighted squares (g,) of the channels on the water; the dry ones' free offsets are not known there."""
    out = np.zeros(e.shape[0])
    for r in range(e.shape[0]):
        c = [i for i in channels if np.isfinite(e[r, i])]
        if c:
            # marginal precision of these channels
            whole = np.linalg.pinv(scatter.weight[r], hermitian=True)[np.ix_(c, c)]
            out[r] = float(e[r, c] @ np.linalg.solve(whole, e[r, c]))
    return out


def _rms(x: FloatArray) -> float:
    return math.sqrt(float(np.nanmean(x**2))) if np.isfinite(x).any() else math.nan
