"""Sizes of a set of effects in the simulator's own terms: least squares in the model, weighted by the runs' scatter."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aqualog.core.intervals import student_quantile
from aqualog.core.records import FloatArray
from aqualog.diagnose.campaign.noise import inner, inverse_of, prior_of
from aqualog.diagnose.campaign.passes import Passes, expected_values
from aqualog.diagnose.evidence import Evidence
from aqualog.diagnose.hypotheses import Hypothesis, value_in, with_free
from aqualog.diagnose.records import Estimate
from aqualog.diagnose.refit import PRIOR_WIDTH
from aqualog.diagnose.search import DOUBT
from aqualog.model.term import Model

__all__ = ["Refit", "estimates", "refit", "settled"]

ROUNDS = 6
STEP = 0.1  # prior standard deviations, of a finite difference
DONE = 0.1  # standard errors
EDGE = 1e-6


@dataclass(frozen=True, slots=True)
class Refit:
    """A set at its best values: `theta` (k,) their distance from the model at hand in prior standard deviations; `x`
    (g, c, k) change of the observations by one of those there; `residual` (g, c); `at_bound` if a value sits at its
    physical bound."""

    members: tuple[Hypothesis, ...]
    theta: FloatArray
    model: Model
    residual: FloatArray
    x: FloatArray
    at_bound: bool

    @property
    def at_start(self) -> FloatArray:
        """Residual (g, c) that a linear model about these values would have had without the set."""
        return np.asarray(self.residual + self.x @ self.theta)

    @property
    def keys(self) -> str:
        """`contact_loss@f+water_drag`."""
        return "+".join(sorted(h.key for h in self.members)) or "none"


def refit(
    passes: Passes, evidence: Evidence, chosen: Sequence[int], start: FloatArray, x: FloatArray, weight: FloatArray,
    given: Model,
) -> Refit:  # fmt: skip
    """Fit a set by Gauss-Newton with the prior of each parameter, within its physical bounds, on a given model.
    `chosen`: hypotheses of the set; `start` (k,) in prior standard deviations; `x` (g, c, k): change of the
    observations by one of those near the start; `weight` (g, c, c): precision of each run."""
    members = tuple(evidence.asked[m] for m in chosen)
    columns = [c for m in chosen for c in evidence.columns[m]]
    told = [(h, h.parameter(n)) for h in members for n in h.free]
    now, lowest, highest = np.array([(value_in(given, h, p.name), p.low, p.high) for h, p in told]).reshape(-1, 3).T
    sigma = evidence.prior[columns]
    low, high = evidence.low[columns] / sigma, evidence.high[columns] / sigma

    def at(t: FloatArray) -> tuple[Model, FloatArray]:
        # a bound in units of sigma comes back with a rounding error beyond it
        model = with_free(given, members, np.clip(now + sigma * t, lowest, highest))
        return model, passes.values - expected_values(passes, model)[0]

    def loss(e: FloatArray, t: FloatArray) -> float:
        return float(inner(np.zeros((*e.shape, 0)), e, passes.nuisances, weight)[0, 0] + t @ t / PRIOR_WIDTH**2)

    def slopes(e: FloatArray, t: FloatArray) -> FloatArray:
        x = np.zeros((*e.shape, t.size))
        for k in range(t.size):
            step = STEP if t[k] + STEP <= high[k] else -STEP
            x[:, :, k] = np.nan_to_num((e - at(t + step * np.eye(t.size)[k])[1]) / step)
        return x

    theta = np.clip(start, low, high)
    model, e = at(theta)
    least, fresh = loss(e, theta), False
    for _ in range(ROUNDS if theta.size else 0):
        A = inner(x, e, passes.nuisances, weight)
        full = A[:-1, :-1] + np.eye(theta.size) / PRIOR_WIDTH**2
        way = np.linalg.solve(full, A[:-1, -1] - theta / PRIOR_WIDTH**2)
        for share in (1.0, 0.4, 0.16, 0.064):
            there = np.clip(theta + share * way, low, high)
            new, e_there = at(there)
            if loss(e_there, there) <= least:
                break
        else:
            if fresh:
                break
            x, fresh = slopes(e, theta), True
            continue
        moved = there - theta
        theta, model, e, least = there, new, e_there, loss(e_there, there)
        if float(moved @ full @ moved) < DONE**2:
            break
        x, fresh = slopes(e, theta), True
    at_bound = bool(np.any(((theta <= low + EDGE) | (theta >= high - EDGE)) & (np.abs(theta) >= EDGE)))
    return Refit(members, theta, model, e, x, at_bound)


def settled(found: Refit, passes: Passes, weight: FloatArray, by: NDArray[np.int64] | None = None) -> FloatArray:
    """Residual (g, c) with the free sizes (radii, delay) and the set's values at their best on the runs `by`."""
    x, _, size = _solved(found, passes, weight, np.arange(len(found.residual)) if by is None else by)
    return np.asarray(found.residual - x @ size)


def _solved(
    found: Refit, passes: Passes, weight: FloatArray, by: NDArray[np.int64]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """All columns (g, c, k), covariance (k, k) and sizes (k,) beside the set's values, by some of the runs."""
    k, free = found.theta.size, passes.nuisances.shape[-1]
    x = np.concatenate([passes.nuisances, found.x], axis=-1)
    prior = np.append(prior_of(free), np.full(k, PRIOR_WIDTH**-2.0))
    y = found.residual[by]
    own = np.where(np.isfinite(y)[:, :, None], x[by], 0.0)
    wx = weight[by] @ own
    covariance = inverse_of(np.einsum("rck,rcl->kl", own, wx) + np.diag(prior))
    pull = prior * np.append(np.zeros(free), -found.theta)
    return x, covariance, covariance @ (np.einsum("rck,rc->k", wx, np.nan_to_num(y)) + pull)


def estimates(found: Refit, passes: Passes, weight: FloatArray) -> list[Estimate]:
    """Value and 95 % interval of each parameter: cluster-robust variance with one run as the unit, blown up by its own
    leverage, at least that of the model; Student's t with the runs less the sizes that were fitted."""
    known = np.isfinite(found.residual)
    x, covariance, size = _solved(found, passes, weight, np.arange(len(known)))
    x = np.where(known[:, :, None], x, 0.0)
    e, wx = np.nan_to_num(found.residual) - x @ size, weight @ x
    hat = np.einsum("rck,kl,rdl->rcd", x, covariance, wx)
    grown = np.linalg.solve(np.eye(e.shape[1]) - np.clip(hat, -0.95, 0.95), e[:, :, None])
    scores = (wx.transpose(0, 2, 1) @ grown)[:, :, 0]
    robust = covariance @ (scores.T @ scores) @ covariance
    k = found.theta.size
    wide = student_quantile(0.975, max(int(known.any(axis=1).sum()) - k - 2, 1))
    sd = np.sqrt(np.maximum(np.diag(robust), np.diag(covariance)))[size.size - k :]
    out = []
    names = [(h, n) for h in found.members for n in h.free]
    for (h, name), s, change in zip(names, sd.tolist(), found.theta.tolist(), strict=True):
        p = h.parameter(name)
        value, half = value_in(found.model, h, name), p.sigma * wide * math.hypot(s, DOUBT * change)
        out.append(Estimate(value, max(value - half, p.low), min(value + half, p.high), p.unit))
    return out
