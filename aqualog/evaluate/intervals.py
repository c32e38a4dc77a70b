"""Confidence intervals of shares and of rates of rare events."""

from __future__ import annotations

import math
from collections.abc import Callable
from statistics import NormalDist

__all__ = ["poisson", "wilson"]


def wilson(k: int, n: int, level: float = 0.95) -> tuple[float, float]:
    """Return the interval of a share: k of n. Wilson 1927 [wilson1927]; (0, 1) for n = 0, never NaN.

    Parameters
    ----------
    k, n : int
        0 <= k <= n.
    level : float
        Confidence, 0 < level < 1.
    """
    if n == 0:
        return 0.0, 1.0
    z = NormalDist().inv_cdf(0.5 + 0.5 * level)
    p, denominator = k / n, 1.0 + z * z / n
    middle = (p + z * z / (2 * n)) / denominator
    half = z * math.sqrt(p * (1.0 - p) / n + z * z / (4.0 * n * n)) / denominator
    # at the ends it is 0 or 1 by algebra, not by floats
    return (0.0 if k == 0 else middle - half), (1.0 if k == n else middle + half)


def poisson(k: int, level: float = 0.95) -> tuple[float, float]:
    """Return the exact interval of the expected number of events where k were counted (Garwood 1936 [garwood1936]).

    Parameters
    ----------
    k : int
        Count, k >= 0.
    level : float
        Confidence, 0 < level < 1; half of the rest on either side, also for k = 0.
    """
    tail = 0.5 * (1.0 - level)
    low = 0.0 if k == 0 else _mean_where(lambda m: 1.0 - _cdf(k - 1, m) - tail, k)
    return low, _mean_where(lambda m: tail - _cdf(k, m), k)


def _cdf(k: int, mean: float) -> float:
    """Probability of at most k events; terms from the largest one down, so that nothing underflows."""
    if mean <= 0.0:
        return 1.0
    first = min(k, int(mean))
    log_first = first * math.log(mean) - mean - math.lgamma(first + 1.0)
    total = term = 1.0
    for i in range(first, 0, -1):
        term *= i / mean
        total += term
        if term < 1e-17 * total:
            break
    term = 1.0
    for i in range(first + 1, k + 1):
        term *= mean / i
        total += term
        if term < 1e-17 * total:
            break
    return min(1.0, total * math.exp(log_first))


def _mean_where(rising: Callable[[float], float], k: int) -> float:
    """Zero of a function that rises with the mean."""
    low, high = 0.0, k + 10.0 * math.sqrt(k + 1.0) + 20.0
    for _ in range(200):
        middle = 0.5 * (low + high)
        if rising(middle) > 0.0:
            high = middle
        else:
            low = middle
    return 0.5 * (low + high)
