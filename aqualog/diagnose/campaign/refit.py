"""Sizes of a set of effects in the simulator's own terms: least squares in the model, weighted by the runs' scatter."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from aqualog.core.intervals import student_quantile
from aqualog.core.records import FloatArray
from aqualog.diagnose.campaign.catalogue import Hypothesis, model_with
from aqualog.diagnose.campaign.noise import inverse_of, prior_of
from aqualog.diagnose.campaign.passes import Passes, expected_values
from aqualog.model.term import Model, Parameter

__all__ = ["Refit", "conditioned", "intervals", "refit", "weighed"]

ROUNDS = 6
STEP = 0.1  # prior standard deviations, of a finite difference
DONE = 0.02  # standard errors
EDGE = 1e-6


@dataclass(frozen=True, slots=True)
class Refit:
    """A set of effects at its best.

    `values` of each hypothesis; `residual` (g, c); `x` (g, c, k) change by one prior standard deviation, at the
    optimum; `theta` (k,) distance from neutral in those; `cost`: weighted square of the residual with the nuisances at
    their best; `information` (k, k), the nuisances taken out; `is_physical`: no value at a bound; `odds`: log odds
    against so many effects; `log_evidence`.
    """

    chosen: tuple[Hypothesis, ...]
    values: tuple[Mapping[str, float], ...]
    model: Model
    residual: FloatArray
    x: FloatArray
    theta: FloatArray
    cost: float
    information: FloatArray
    is_physical: bool
    odds: float
    log_evidence: float

    @property
    def keys(self) -> frozenset[str]:
        """Names with places."""
        return frozenset(h.key for h in self.chosen)

    @property
    def parameters(self) -> tuple[tuple[Hypothesis, Parameter], ...]:
        """All its parameters in the order of the columns."""
        return tuple((h, p) for h in self.chosen for p in h.parameters)


def conditioned(
    x: FloatArray, y: FloatArray, nuisances: FloatArray, weight: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Information (k, k), score (k,), cost of columns `x` (g, c, k) about `y` (g, c), sizes of the nuisances free."""
    both = np.concatenate([nuisances, x], axis=-1)
    both = np.where(np.isfinite(y)[:, :, None], both, 0.0)
    y = np.nan_to_num(y)
    wb = (weight @ both).reshape(y.size, -1)
    a, b = both.reshape(y.size, -1).T @ wb, y.ravel() @ wb
    cost = float(y.ravel() @ (weight @ y[:, :, None]).ravel())
    n = nuisances.shape[-1]
    a += np.diag(np.append(prior_of(n, 0), np.zeros(x.shape[-1])))
    inverse = inverse_of(a[:n, :n])
    across = a[n:, :n] @ inverse
    return a[n:, n:] - across @ a[:n, n:], b[n:] - across @ b[:n], cost - float(b[:n] @ inverse @ b[:n])


def refit(
    passes: Passes,
    base: Model,
    chosen: Sequence[Hypothesis],
    weight: FloatArray,
    *,
    per_effect: float,
    start: Mapping[str, Mapping[str, float]] | None = None,
    rounds: int = ROUNDS,
) -> Refit:
    """Fit a set by Gauss-Newton with the prior of each parameter, within its physical bounds.

    Parameters
    ----------
    passes, base
    chosen : sequence of Hypothesis
        Empty for the model as it is.
    weight : array (g, c, c)
        Precision of each run.
    per_effect : float
        Odds against one more effect.
    start : mapping, optional
        Values to begin at, by key.
    """
    chosen = tuple(chosen)
    told = [(h, p) for h in chosen for p in h.parameters]
    sigma, neutral = (np.array([getattr(p, n) for _, p in told]) for n in ("sigma", "neutral"))
    low, high = (np.array([(getattr(p, n) - p.neutral) / p.sigma for _, p in told]) for n in ("low", "high"))
    theta = np.array([((start or {}).get(h.key, {}).get(p.name, p.neutral) - p.neutral) / p.sigma for h, p in told])

    def values_of(t: FloatArray) -> tuple[dict[str, float], ...]:
        # a bound in units of sigma comes back with a rounding error beyond it
        flat = [min(max(n + s * z, p.low), p.high) for n, s, z, (_, p) in zip(neutral, sigma, t, told, strict=True)]
        return tuple({p.name: flat[i] for i, (h, p) in enumerate(told) if h is c} for c in chosen)

    def left(t: FloatArray) -> FloatArray:
        expected: FloatArray = expected_values(passes, model_with(base, chosen, values_of(t)))[0]
        return passes.values - expected

    def loss(e: FloatArray, t: FloatArray) -> float:
        return conditioned(nothing, e, passes.nuisances, weight)[2] + float(t @ t)

    nothing = np.zeros((*passes.values.shape, 0))
    e = left(theta)
    now = loss(e, theta)
    x = np.zeros((*e.shape, theta.size))
    information = np.zeros((theta.size, theta.size))
    for _ in range(rounds if theta.size else 0):
        for k in range(theta.size):
            step = STEP if theta[k] + STEP <= high[k] else -STEP
            moved = theta.copy()
            moved[k] += step
            x[:, :, k] = np.nan_to_num((e - left(moved)) / step)
        information, score, _ = conditioned(x, e, passes.nuisances, weight)
        full = information + np.eye(theta.size)
        way = np.linalg.solve(full, score - theta)
        share = 1.0
        for _ in range(4):
            there = np.clip(theta + share * way, low, high)
            e_there = left(there)
            then = loss(e_there, there)
            if then <= now:
                break
            share *= 0.4
        else:
            break
        moved_by = there - theta
        theta, e, now = there, e_there, then
        if float(moved_by @ full @ moved_by) < DONE**2:
            break
    inside = bool(np.all((theta > low + EDGE) & (theta < high - EDGE) | (np.abs(theta) < EDGE)))
    odds = len(chosen) * math.log(per_effect)
    evidence = -0.5 * now - 0.5 * np.linalg.slogdet(np.eye(theta.size) + information)[1] - odds
    values = values_of(theta)
    return Refit(
        chosen, values, model_with(base, chosen, values), e, x, theta, now - float(theta @ theta), information, inside,
        odds, float(evidence),
    )  # fmt: skip


def weighed(found: Refit, passes: Passes, weight: FloatArray) -> Refit:
    """The same fit judged with other weights: its evidence, information and cost; the sizes stay."""
    information, _, cost = conditioned(found.x, found.residual, passes.nuisances, weight)
    k = found.theta.size
    evidence = -0.5 * (cost + float(found.theta @ found.theta)) - 0.5 * np.linalg.slogdet(np.eye(k) + information)[1]
    evidence -= found.odds
    return replace(found, cost=cost, information=information, log_evidence=float(evidence))


def intervals(found: Refit, passes: Passes, weight: FloatArray) -> list[tuple[float, float, float]]:
    """Value and ends of the 95 % interval of each parameter, by the scores of the runs.

    Cluster-robust variance with one run as the unit (each run's residual blown up by its own leverage), at least that
    of the model; Student's t with the runs less the sizes that were fitted.
    """
    k = found.theta.size
    n = passes.nuisances.shape[-1]
    both = np.concatenate([passes.nuisances, found.x], axis=-1)
    both = np.where(np.isfinite(found.residual)[:, :, None], both, 0.0)
    wb = np.einsum("rcd,rdk->rck", weight, both)
    a = np.einsum("rck,rcl->kl", both, wb)
    inverse = inverse_of(a + np.diag(np.append(prior_of(n, 0), np.zeros(k))))
    y = np.nan_to_num(found.residual)
    e = y - np.einsum("rck,k->rc", both, inverse @ np.einsum("rck,rc->k", wb, y))
    hat = np.einsum("rck,kl,rdl->rcd", both, inverse, wb)
    c = e.shape[1]
    grown = np.linalg.solve(np.eye(c) - np.clip(hat, -0.95, 0.95), e[:, :, None])[:, :, 0]
    scores = np.einsum("rck,rc->rk", wb, grown)
    robust = inverse @ (scores.T @ scores) @ inverse
    runs = int(np.isfinite(found.residual).any(axis=1).sum())
    wide = student_quantile(0.975, max(runs - k - 2, 1))
    out = []
    for i, (_, p) in enumerate(found.parameters):
        variance = max(float(robust[n + i, n + i]), float(inverse[n + i, n + i]))
        value = p.neutral + p.sigma * float(found.theta[i])
        half = wide * p.sigma * math.sqrt(max(variance, 0.0))
        out.append((value, value - half, value + half))
    return out
