"""Quantiles for confidence intervals."""

from __future__ import annotations

import math

import numpy as np

__all__ = ["student_quantile"]


def student_quantile(probability: float, dof: float) -> float:
    """Quantile of Student's t: 0.5 < probability < 1, real dof >= 1."""
    u = np.linspace(0.0, math.pi / 2.0, 20_001)  # t = sqrt(dof) tan(u) turns the density into a power of the cosine
    density = np.cos(u) ** (dof - 1.0)
    area = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]))])
    return math.sqrt(dof) * math.tan(float(np.interp(2.0 * probability - 1.0, area / area[-1], u)))
