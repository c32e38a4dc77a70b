"""Intervals and words for the numbers of a check."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.evaluate.intervals import wilson

__all__ = ["bootstrap", "percent", "ratio_of_counts", "share"]

_RESAMPLES, _SEED = 2000, 20240301


def bootstrap(
    values: Sequence[float] | FloatArray, statistic: Callable[[FloatArray], float] | None = None
) -> tuple[float, float]:
    """95 % percentile interval of a statistic over runs (default: the mean), by resampling the runs [efron1979].

    Parameters
    ----------
    values : array (n,) or (n, k)
        One row a run, n >= 1; rows are drawn with replacement.
    statistic : callable, optional
        Of a resample.
    """
    x = np.asarray(values, dtype=np.float64)
    rows = np.random.default_rng(_SEED).integers(0, x.shape[0], (_RESAMPLES, x.shape[0]))
    if statistic is None:
        found = x[rows].mean(axis=1)
    else:
        found = np.array([statistic(x[r]) for r in rows[:500]])
    low, high = np.nanquantile(found, [0.025, 0.975])
    return float(low), float(high)


def share(k: int, n: int) -> str:
    """A share in words with its Wilson interval [wilson1927]: 17 of 20 (64 to 95 %)."""
    low, high = wilson(k, n)
    return f"{k} of {n} ({100 * low:.0f} to {100 * high:.0f} %)"


def ratio_of_counts(k: int, base: int) -> tuple[float, float] | None:
    """95 % interval of the ratio of two counts over the same time; None where the base is 0.

    Given their sum, the first is binomial: its Wilson interval [wilson1927], turned into a ratio. Both are taken as
    independent.
    """
    if base == 0:
        return None
    low, high = wilson(k, k + base)
    return low / (1.0 - low), high / (1.0 - high)


def percent(x: float) -> str:
    """A share as per cent."""
    return f"{100.0 * x:.0f} %"
