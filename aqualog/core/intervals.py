"""Quantiles and tails of distributions, for intervals and tests."""

from __future__ import annotations

import math

import numpy as np

__all__ = ["chi2_log_p", "student_quantile"]


def student_quantile(probability: float, dof: float) -> float:
    """Quantile of Student's t [student1908]: 0.5 < probability < 1, real dof >= 1."""
    u = np.linspace(0.0, math.pi / 2.0, 20_001)  # t = sqrt(dof) tan(u) turns the density into a power of the cosine
    density = np.cos(u) ** (dof - 1.0)
    area = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]))])
    return math.sqrt(dof) * math.tan(float(np.interp(2.0 * probability - 1.0, area / area[-1], u)))


def chi2_log_p(x: float, dof: int) -> float:
    """-log10 of the probability that chi^2 with `dof` degrees of freedom is beyond x."""
    x = max(x, 1e-12)
    # log of the upper tail, by the recurrence in steps of two degrees of freedom
    half = 0.5 * x
    if dof % 2:
        tail = math.erfc(math.sqrt(half))
        log_tail = math.log(tail) if tail > 1e-300 else -half - 0.5 * math.log(math.pi * half)
        term, first = -half + 0.5 * math.log(half) - math.lgamma(1.5), 3
    else:
        log_tail, term, first = -half, -half + math.log(half), 4
    for k in range(first, dof + 1, 2):
        log_tail = float(np.logaddexp(log_tail, term))
        term += math.log(half) - math.log(0.5 * k)
    return -log_tail / math.log(10.0)
