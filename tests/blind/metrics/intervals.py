"""Intervals for shares and for quantiles."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

__all__ = ["bootstrap", "clopper_pearson"]

_DRAWS = 2000


def clopper_pearson(hits: int, count: int, level: float = 0.95) -> tuple[float, float]:
    """Exact interval of a share, from the beta distribution (Clopper and Pearson 1934); (0, 1) without a trial."""
    from scipy.stats import beta

    tail = (1.0 - level) / 2.0
    low = beta.ppf(tail, hits, count - hits + 1) if hits > 0 else 0.0
    high = beta.ppf(1.0 - tail, hits + 1, count - hits) if hits < count else 1.0
    return float(low), float(high)


def bootstrap(
    values: Sequence[float], statistic: Callable[[np.ndarray], float], level: float = 0.95, seed: int = 1
) -> tuple[float, float]:
    """Percentile interval of a statistic; a case is the unit that is drawn. NaN below two values."""
    x = np.asarray(values, dtype=float)
    if x.size < 2:
        return float("nan"), float("nan")
    rng = np.random.default_rng(seed)
    drawn = [statistic(x[rng.integers(0, x.size, x.size)]) for _ in range(_DRAWS)]
    tail = (1.0 - level) / 2.0
    low, high = np.quantile(drawn, [tail, 1.0 - tail])
    return float(low), float(high)
