"""Gain of the extended model on runs that it was not fitted to: a depth, pressure or fold left out."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aqualog.core.records import FloatArray
from aqualog.diagnose.campaign.noise import Fit, inverse_of, prior_of
from aqualog.diagnose.campaign.passes import RESISTANCE, Passes
from aqualog.diagnose.campaign.refit import Refit
from aqualog.diagnose.records import ChannelGain, Gain

__all__ = ["gain"]

FOLDS = 5
LEAST = 3  # groups of a key, each left out once
MOST = 0.35  # share of the runs in a group; without more of them the rest is another campaign
DRAWS = 2000
KEYS = (("depth", "water_depth_mm", 1e3), ("pressure", "pressure_rear_bar", 1e-5))


def gain(
    passes: Passes, sets: Sequence[Refit], scatter: Fit, base: FloatArray, rng: np.random.Generator
) -> Gain | None:
    """Leave groups of runs out, choose among the sets and fit the sizes on the others, and predict those left out.

    Parameters
    ----------
    passes : Passes
    sets : sequence of Refit
        Sets among which each fold chooses, in the linear model about each set.
    scatter : Fit
    base : array (g, c)
        Expectation of the model without any effect.

    Returns
    -------
    Gain
        `log_score` in nats (natural logarithm) over all runs left out, with a bootstrap interval over runs; None
        without wet runs.
    """
    wet = np.flatnonzero(np.isfinite(passes.values[:, -1]))
    if wet.size < 2 * FOLDS:
        return None
    groups, names = _groups(passes, wet, rng)
    slips = [i for i, n in enumerate(passes.names) if not n.startswith("dry_")]
    before, after = np.full((2, *passes.values.shape), np.nan)
    plain = next((s for s in sets if not s.chosen), None)
    for held in groups:
        rest = np.setdiff1d(np.arange(passes.values.shape[0]), held)
        options = [_trained(s, passes, scatter, rest) for s in sets]
        chosen = int(np.argmax([o[0] for o in options]))
        after[held] = _left(sets[chosen], passes, options[chosen][1], held)
        if plain is not None:
            index = next(i for i, s in enumerate(sets) if s is plain)
            before[held] = _left(plain, passes, options[index][1], held)
        else:
            before[held] = (passes.values - base)[held]
    scores = _scores(before, slips, scatter) - _scores(after, slips, scatter)
    scores = 0.5 * scores[wet]
    total = float(scores.sum())
    drawn = scores[rng.integers(0, wet.size, (DRAWS, wet.size))].sum(axis=1)
    low, high = (float(x) for x in np.quantile(drawn, (0.025, 0.975)))
    units = {RESISTANCE: "m/s^2"}
    channels = tuple(
        ChannelGain(passes.names[i], units.get(passes.names[i], "-"), _rms(before[wet, i]), _rms(after[wet, i]))
        for i in slips
    )
    return Gain(channels, total, low, high, tuple(names), in_sample=False)


def _groups(
    passes: Passes, wet: NDArray[np.int64], rng: np.random.Generator
) -> tuple[list[NDArray[np.int64]], list[str]]:
    for word, key, factor in KEYS:
        x = np.round(passes.coordinates[word][wet] * factor, 3)
        values = np.unique(x)
        counts = [int((x == v).sum()) for v in values]
        if values.size >= LEAST and min(counts) >= 2 and max(counts) <= MOST * wet.size:
            return [wet[x == v] for v in values], [f"runs with {key} = {v:g}" for v in values]
    order = rng.permutation(wet)
    names = [f"fold {k + 1} of {FOLDS} of the runs" for k in range(FOLDS)]
    return [np.sort(order[k::FOLDS]) for k in range(FOLDS)], names


def _trained(s: Refit, passes: Passes, scatter: Fit, rest: NDArray[np.int64]) -> tuple[float, FloatArray]:
    """Log evidence on the other runs, and by how much nuisances and sizes move from the fit to all runs."""
    n = passes.nuisances.shape[-1]
    y = s.residual[rest]
    x = np.concatenate([passes.nuisances, s.x], axis=-1)[rest]
    x = np.where(np.isfinite(y)[:, :, None], x, 0.0)
    y = np.nan_to_num(y)
    wx = scatter.weight[rest] @ x
    a, b = np.einsum("rck,rcl->kl", x, wx), np.einsum("rck,rc->k", wx, y)
    full = a + np.diag(prior_of(n, s.theta.size))
    pull = np.concatenate([np.zeros(n), -s.theta])
    size = inverse_of(full) @ (b + pull)
    cost = float(np.einsum("rc,rcd,rd->", y, scatter.weight[rest], y)) - 2.0 * float(size @ b) + float(size @ a @ size)
    cost += float((s.theta + size[n:]) @ (s.theta + size[n:]))
    # of the sizes alone: the nuisances are the same in all sets
    across = a[n:, :n] @ np.linalg.pinv(a[:n, :n], rcond=1e-12, hermitian=True) @ a[:n, n:]
    volume = np.linalg.slogdet(np.eye(s.theta.size) + a[n:, n:] - across)[1] if s.theta.size else 0.0
    return -0.5 * cost - 0.5 * float(volume) - s.odds, size


def _left(s: Refit, passes: Passes, size: FloatArray, held: NDArray[np.int64]) -> FloatArray:
    x = np.concatenate([passes.nuisances, s.x], axis=-1)[held]
    left: FloatArray = s.residual[held] - x @ size
    return left


def _scores(e: FloatArray, channels: Sequence[int], scatter: Fit) -> FloatArray:
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
