"""Intervals for shares and for quantiles."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

__all__ = ["bootstrap", "clopper_pearson"]


def clopper_pearson(hits: int, count: int, level: float = 0.95) -> tuple[float, float]:
    """Exact interval of a share (Clopper and Pearson 1934); (0, 1) without a trial."""
    from scipy.stats import binomtest

    found = binomtest(hits, count).proportion_ci(level, "exact") if count else (0.0, 1.0)
    return float(found[0]), float(found[1])


def bootstrap(
    values: Sequence[float], statistic: Callable[[np.ndarray], float], level: float = 0.95, seed: int = 1
) -> tuple[float, float]:
    """Percentile interval of a statistic; a case is the unit that is drawn. NaN below two values."""
    from scipy import stats

    if len(values) < 2:
        return float("nan"), float("nan")
    drawn = {"n_resamples": 2000, "vectorized": False, "method": "percentile", "rng": seed}
    found = stats.bootstrap((np.asarray(values, dtype=float),), statistic, confidence_level=level, **drawn)
    return float(found.confidence_interval[0]), float(found.confidence_interval[1])
