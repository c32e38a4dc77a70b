"""Intervals and quantiles: of Student's t, of chi-squared, of shares and of rates of rare events."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from statistics import NormalDist

import numpy as np

from aqualog.core.records import FloatArray

__all__ = [
    "NOWHERE", "Z95", "Interval", "chi2_log_p", "half_width", "jackknife_sd", "poisson", "same_decimals",
    "student_quantile", "variance_ratio_chance", "widened", "wilson", "worth",
]  # fmt: skip

Interval = tuple[float, float]
NOWHERE: Interval = (math.nan, math.nan)
Z95 = 1.959964  # 97.5 % quantile of the normal distribution


def same_decimals(value: float, ci: Interval) -> tuple[str, str, str]:
    """Return a value and both ends of its interval in the same decimals, by the interval; empty where not finite.

    Half of the interval has two digits. Without an interval five digits stand.
    """
    half = 0.5 * (ci[1] - ci[0])
    form = f".{min(max(1 - math.floor(math.log10(half)), 0), 9)}f" if 0.0 < half < math.inf else ".5g"
    shown, low, high = (f"{x:{form}}" if math.isfinite(x) else "" for x in (value, *ci))
    return shown, low, high


@lru_cache(maxsize=256)
def student_quantile(probability: float, dof: float) -> float:
    """Quantile of Student's t [student1908]: 0.5 < probability < 1, real dof >= 1."""
    # t = sqrt(dof) tan(u) turns the density into a power of the cosine, which is nothing beyond twelve deviations
    u = np.linspace(0.0, min(0.5 * math.pi, 12.0 / math.sqrt(dof)), 4_001)
    density = np.cos(u) ** (dof - 1.0)
    area = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]))])
    return math.sqrt(dof) * math.tan(float(np.interp(2.0 * probability - 1.0, area / area[-1], u)))


def half_width(sigma: float, dof: float, level: float = 0.95) -> float:
    """Half the interval of a value with standard deviation `sigma`, by Student's t."""
    return student_quantile(0.5 + level / 2.0, dof) * sigma


def widened(value: float, draws: FloatArray, dof: float, level: float = 0.95) -> Interval:
    """Return the interval of a value from its bootstrap draws (b,): few units with `dof` degrees of freedom.

    The distances of the draws' quantiles from the value, times Student's t over the normal quantile [student1908]. The
    value is within, also where the draws lie on one side of it.
    """
    tail = 0.5 * (1.0 - level)
    factor = student_quantile(1.0 - tail, dof) / NormalDist().inv_cdf(1.0 - tail)
    low, high = (factor * (float(x) - value) for x in np.quantile(draws, (tail, 1.0 - tail)))
    return value + min(low, 0.0), value + max(high, 0.0)


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


def wilson(k: float, n: float, level: float = 0.95) -> tuple[float, float]:
    """Return the interval of a share: k of n. Wilson 1927 [wilson1927]; (0, 1) for n = 0, never NaN.

    Parameters
    ----------
    k, n : float
        0 <= k <= n; not whole as in `poisson`.
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


def poisson(k: float, level: float = 0.95) -> tuple[float, float]:
    """Return the exact interval of the expected number of events where k were counted (Garwood 1936 [garwood1936]).

    Parameters
    ----------
    k : float
        Count, k >= 0; not whole where it is that of as many single events as clumped ones are worth.
    level : float
        Confidence, 0 < level < 1; half of the rest on either side, also for k = 0.
    """
    tail = 0.5 * (1.0 - level)
    low = 0.0 if k == 0 else _mean_where(lambda m: _reached(k, m) - tail, k)
    return low, _mean_where(lambda m: _reached(k + 1.0, m) - 1.0 + tail, k)


def worth(counts: Sequence[float], sizes: Sequence[float], *, of_shares: bool) -> float:
    """How many single events each event is worth, where those of one run or drive come together; 1 at most.

    Parameters
    ----------
    counts, sizes : sequences of float (g,)
        Of each run: events, and cases or time in which they might be.
    of_shares : bool
        Whether sizes are cases, each with one event at most.

    The design effect is the variance of the ratio of the sums from run to run ([bell2002], one column of
    `aqualog.core.regression`) over that of single events. Counts so much smaller, and Student's t in place of the
    normal quantile, give the intervals of [korn1998]. The degrees of freedom are those of the part between the runs
    [satterthwaite1946]: that of single events is known. With one run, without an event, or with one in each case, it
    does not show whether they come together: 1.
    """
    y, x = (np.asarray(v, dtype=np.float64) for v in (counts, sizes))
    y, x = y[x > 0.0], x[x > 0.0]
    total, size = float(y.sum()), float(x.sum())
    # of n cases p (1 - p) shows (n - 1) / n
    single = total * (size - total) / max(size - 1.0, 1.0) if of_shares else total
    if y.size < 2 or single <= 1e-9 * total:
        return 1.0
    share = np.minimum(x / size, 1.0 - 1e-6)
    odds = share / (1.0 - share)
    effect = float(np.sum((y - total * share) ** 2 / (1.0 - share))) / single
    if effect <= 1.0 + 1e-9:
        return 1.0
    power = float(odds @ odds - 2.0 * (odds @ (share * odds)) + (share @ odds) ** 2)
    dof = max(1.0 / power, 1.0) * (effect / (effect - 1.0)) ** 2
    return (Z95 / student_quantile(0.975, min(dof, 1e3))) ** 2 / effect


def _reached(k: float, mean: float) -> float:
    """Chance of at least k events: the incomplete gamma function by its series, whose terms are all positive."""
    if k <= 0.0 or mean <= 0.0:
        return 1.0 if k <= 0.0 else 0.0
    term = total = 1.0
    n = k
    while term > 1e-17 * total:
        n += 1.0
        term *= mean / n
        total += term
    return min(1.0, total * math.exp(k * math.log(mean) - mean - math.lgamma(k + 1.0)))


def _mean_where(rising: Callable[[float], float], k: float) -> float:
    """Zero of a function that rises with the mean."""
    low, high = 0.0, k + 10.0 * math.sqrt(k + 1.0) + 20.0
    for _ in range(64):
        middle = 0.5 * (low + high)
        if rising(middle) > 0.0:
            high = middle
        else:
            low = middle
    return 0.5 * (low + high)


def variance_ratio_chance(ratio: float, dof: float, dof_below: float) -> float:
    """Return the chance that F of two independent variances exceeds `ratio`; degrees of freedom >= 1 for both."""
    # x = sin^2(u) turns the beta density of x = dof F / (dof F + dof_below) into powers without a pole
    u = np.linspace(0.0, 0.5 * math.pi, 4_001)
    density = np.sin(u) ** (dof - 1.0) * np.cos(u) ** (dof_below - 1.0)
    area = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]))])
    at = math.atan(math.sqrt(ratio * dof / dof_below))
    return 1.0 - float(np.interp(at, u, area)) / float(area[-1])


def jackknife_sd(left: FloatArray) -> FloatArray:
    """Return the standard deviation of an estimate, from the estimates with one of n parts left out each: (n, ...)."""
    n = len(left)
    return np.asarray(np.sqrt((n - 1.0) / n * ((left - left.mean(axis=0)) ** 2).sum(axis=0)))
