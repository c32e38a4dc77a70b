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
_LEAST_FOR_WATER = 5  # one odd run is in half of the pairs of four
_FALLS = (-2.0, 0.0)  # exponent of the speed in the acceleration of full throttle
_FALLS_WET = (-0.5, 0.0)  # its relative change from dry road to water
_ROUNDS = 3


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


def expected_in_set(
    values: Sequence[float], speeds: Sequence[float] | None = None, wet: Sequence[float] | None = None
) -> FloatArray:
    """Return what the runs of a set let expect of each: their median; with less than three NaN, as none can differ.

    With `speeds` and `wet` the accelerations of full throttle. They fall with the speed v, and with the share of their
    window that is in water, whose drag and lost grip a run that enters slowly has for longer. v^n (1 + c (wet less its
    median)) about the median, n and c median slopes between two runs, in three rounds. n lies between 0 (constant
    force) and -2 (constant power, a quarter of its force against resistances), c between 0 and -0.5 (half the force
    lost in water). So neither equal speeds nor one run away from the others can bend it further.
    c is 0 with less than five runs.
    """
    x = np.array(values, dtype=np.float64)
    known = np.isfinite(x)
    if known.sum() < _LEAST_FOR_MEDIAN:
        return np.full(x.size, np.nan)
    v = np.ones(x.size) if speeds is None else np.array(speeds) / np.median(np.array(speeds)[known])
    few = wet is None or known.sum() < _LEAST_FOR_WATER
    in_water = np.zeros(x.size) if few else np.array(wet) - np.median(np.array(wet)[known])
    by_speed, by_water = np.ones(x.size), np.ones(x.size)
    for _ in range(_ROUNDS):
        by_speed = v ** _median_slope(v[known], (x / by_water)[known], _FALLS)
        by_water = 1.0 + _median_slope(in_water[known], (x / by_speed)[known], _FALLS_WET) * in_water
    return np.asarray(np.median((x / (by_speed * by_water))[known]) * by_speed * by_water, dtype=np.float64)


def _median_slope(x: FloatArray, y: FloatArray, bounds: tuple[float, float]) -> float:
    """Return the median slope between two points, y relative to its median, within bounds; 0 where all x are equal."""
    first, second = np.triu_indices(x.size, 1)
    run, rise = x[second] - x[first], (y[second] - y[first]) / np.median(y)
    return float(np.clip(np.median(rise[run != 0.0] / run[run != 0.0]), *bounds)) if (run != 0.0).any() else 0.0
