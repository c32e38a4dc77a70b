"""Family-wise test for any effect; campaigns without effect set its level."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from aqualog.core.intervals import chi2_log_p
from aqualog.core.records import FloatArray
from aqualog.diagnose.campaign.noise import Design, Fit, Scatter, design_of, fit, prior_of
from aqualog.diagnose.campaign.refit import conditioned

__all__ = ["Anything", "Group", "anything", "whole_fit"]

AGAIN = 4  # rounds of the scatter of a surrogate, which begins at that of the data
ROUNDS = 25
Group = tuple[str, tuple[int, ...]]


@dataclass(frozen=True, slots=True)
class Anything:
    """Family-wise test: `statistic` is -log10 of the smallest p-value of the groups, `best` the group that has it."""

    statistic: float
    threshold: float
    p_value: float
    achieved: float
    surrogates: int
    best: str


def whole_fit(
    y: FloatArray, x: FloatArray, road: FloatArray, nuisances: FloatArray, start: Scatter | None = None
) -> Fit:
    """Scatter of the runs with all columns at their most likely size under the priors."""
    return fit(_design(y, x, road, nuisances), start=start, rounds=AGAIN if start else ROUNDS)


def _design(y: FloatArray, x: FloatArray, road: FloatArray, nuisances: FloatArray) -> Design:
    prior = prior_of(nuisances.shape[-1], x.shape[-1])
    return design_of(y, np.concatenate([nuisances, x], axis=-1), road, prior)


def anything(
    y: FloatArray,
    x: FloatArray,
    groups: Sequence[Group],
    road: FloatArray,
    nuisances: FloatArray,
    *,
    rng: np.random.Generator,
    level: float,
    surrogates: int,
    report: Callable[[float], None] = lambda share: None,
) -> Anything:
    """Test whether any group of columns explains the runs' deviation better than chance.

    Parameters
    ----------
    y : array (g, c)
        Deviation from the model.
    x : array (g, c, k)
    groups : sequence of (name, columns)
        Columns of x that belong to one effect or function.
    surrogates : int
        Campaigns of the same runs without effect: scatter estimated from the data, with each run's own deviation drawn
        from all runs' with random sign.

    Each surrogate estimates the scatter in the same way as the data, so that its uncertainty counts.
    """
    null = whole_fit(y, np.zeros((*y.shape, 0)), road, nuisances)
    whole = whole_fit(y, x, road, nuisances)
    scored = _scores(y, x, groups, nuisances, whole.weight)
    best = max(scored, key=lambda n: scored[n], default="")
    statistic = scored.get(best, 0.0)
    known = np.isfinite(y)
    pieces = _white(y, road, nuisances, null)
    drawn = np.empty(surrogates)
    factor = _roots(road, null)
    for b in range(surrogates):
        pick = rng.integers(0, len(pieces), y.shape[0])
        flat = pieces[pick] * rng.choice([-1.0, 1.0], (y.shape[0], 1))
        made = np.where(known, np.einsum("rcd,rd->rc", factor, flat), np.nan)
        found = whole_fit(made, x, road, nuisances, whole.scatter)
        drawn[b] = max(_scores(made, x, groups, nuisances, found.weight).values(), default=0.0)
        report((b + 1) / surrogates)
    threshold = float(np.quantile(drawn, 1.0 - level, method="higher"))
    beyond = int(np.count_nonzero(drawn >= statistic))
    return Anything(
        statistic, threshold, (1 + beyond) / (1 + surrogates), float(np.mean(drawn > threshold)), surrogates, best
    )  # fmt: skip


def _scores(
    y: FloatArray, x: FloatArray, groups: Sequence[Group], nuisances: FloatArray, weight: FloatArray
) -> dict[str, float]:
    information, score, _ = conditioned(x, y, nuisances, weight)
    out = {}
    for name, columns in groups:
        c = list(columns)
        a = information[np.ix_(c, c)]
        size = np.linalg.pinv(a, rcond=1e-8, hermitian=True)
        rank = int(np.linalg.matrix_rank(a, hermitian=True))
        if rank:
            out[name] = chi2_log_p(float(score[c] @ size @ score[c]), rank)
    return out


def _roots(road: FloatArray, found: Fit) -> FloatArray:
    v = found.scatter.sigma[None] + np.einsum("rc,cd->rcd", found.scatter.kappa * road, np.eye(road.shape[1]))
    return np.asarray(np.linalg.cholesky(v))


def _white(y: FloatArray, road: FloatArray, nuisances: FloatArray, found: Fit) -> FloatArray:
    """Deviations of the runs (g, c) in units of their scatter, of unit variance; missing values are drawn as 0."""
    known = np.isfinite(y)
    e = np.where(known, y - np.einsum("rck,k->rc", nuisances, found.size[: nuisances.shape[-1]]), 0.0)
    root = _roots(road, found)
    flat = np.linalg.solve(root, e[:, :, None])[:, :, 0]
    whole = known.all(axis=1)
    flat = flat[whole] if whole.sum() >= 20 else flat
    return np.asarray(flat / np.maximum(np.sqrt(np.mean(flat**2, axis=0)), 1e-12))
