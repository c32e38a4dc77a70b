"""What a set of runs says: which runs count, their mean with an interval, and their spread."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aqualog.core.intervals import NOWHERE, Interval
from aqualog.core.records import FloatArray
from aqualog.trade.likelihood import censored_mean
from aqualog.trade.limits import SetLimits

__all__ = ["Summary", "expected_in_set", "summarised"]

_LEAST_FOR_MEDIAN = 3  # runs without which no run can be said to differ from the others
_FALLS = (-2.0, 0.0)  # exponent of the speed in the acceleration of full throttle


@dataclass(frozen=True, slots=True)
class Summary:
    """Mean of the valid runs of a set, its interval, and their spread, in the unit of the values.

    `runs` in all, `valid` of them, `censored` of these. `above`: where all valid runs are censored, the lowest of their
    bounds, which the mean lies above as far as one can say; else NaN. `notes`: what is to be said of the set.
    `is_enough`: there are enough valid runs, and they scatter little enough.
    """

    runs: int
    valid: int
    censored: int = 0
    mean: float = math.nan
    ci: Interval = NOWHERE
    sd: float = math.nan
    above: float = math.nan
    notes: tuple[str, ...] = ()
    is_enough: bool = False

    @property
    def cv(self) -> float:
        """Coefficient of variation sd / mean. [-] NaN without two values."""
        return self.sd / self.mean if self.mean > 0.0 else math.nan

    @property
    def dof(self) -> int:
        """Degrees of freedom of the spread."""
        return max(self.valid - self.censored - 1, 0)


def summarised(values: Sequence[float], bounds: Sequence[float], runs: int, limits: SetLimits) -> Summary:
    """Summarise the valid runs of a set.

    Parameters
    ----------
    values, bounds : sequence of float
        Of valid runs: seen values, and bounds that censored runs lie above.
    runs : int
        All runs of the set, valid or not.
    """
    valid = len(values) + len(bounds)
    notes: list[str] = []
    if valid < limits.runs:
        notes.append(f"{valid} valid {'run' if valid == 1 else 'runs'} of {runs}, at least {limits.runs:g} needed")
    if not values:
        if not bounds:
            return Summary(runs, 0, notes=tuple(notes))
        notes.append("no run reached its value: the mean lies above what is given, by how much is not known")
        return Summary(runs, valid, valid, above=min(bounds), notes=tuple(notes))
    found = censored_mean(np.array(values), np.array(bounds))
    if bounds and math.isnan(found.mean):
        notes.append(f"one value and {len(bounds)} censored: they give no mean")
    elif bounds:
        notes.append(f"{len(bounds)} of {valid} runs did not reach their value and count as above it")
    if found.sd == 0.0:
        notes.append("all values are equal: the interval has no width")
    summary = Summary(runs, valid, len(bounds), found.mean, found.ci, found.sd)
    if summary.cv > limits.cv:
        notes.append(
            f"the coefficient of variation is {100 * summary.cv:.1f} %, at most {100 * limits.cv:g} % expected"
        )
    is_enough = valid >= limits.runs and summary.cv <= limits.cv
    return replace(summary, notes=tuple(notes), is_enough=is_enough)


def expected_in_set(values: Sequence[float], speeds: Sequence[float] | None = None) -> FloatArray:
    """Return what the runs of a set let expect of each: their median; with less than three NaN, as none can differ.

    With `speeds` the accelerations of full throttle, which fall with the speed v: v^n about the median, n the median
    slope between two runs. It lies between 0 (constant force) and -2 (constant power, a quarter of its
    force against resistances), so that neither equal speeds nor one run away from the others can bend it further.
    """
    x = np.array(values, dtype=np.float64)
    known = np.isfinite(x)
    if known.sum() < _LEAST_FOR_MEDIAN:
        return np.full(x.size, np.nan)
    v = np.ones(x.size) if speeds is None else np.array(speeds) / np.median(np.array(speeds)[known])
    first, second = np.triu_indices(int(known.sum()), 1)
    rise, run = (y[known][second] - y[known][first] for y in (x / np.median(x[known]), v))
    slope = float(np.clip(np.median(rise[run != 0.0] / run[run != 0.0]), *_FALLS)) if (run != 0.0).any() else 0.0
    return np.asarray(np.median((x / v**slope)[known]) * v**slope, dtype=np.float64)
