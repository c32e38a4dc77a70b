"""What a set of runs says: which runs count, their mean with an interval, and their spread."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aqualog.core.intervals import NOWHERE, Interval
from aqualog.trade.likelihood import censored_mean
from aqualog.trade.limits import SetLimits

__all__ = ["Summary", "away_from_set", "summarised"]

_LEAST_FOR_MEDIAN = 3  # runs without which no run can be said to differ from the others


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


def away_from_set(values: Sequence[float], share: float) -> list[bool]:
    """Return which values lie further from their median than a share of it; with fewer than three none does.

    NaN counts neither for the median nor as away.
    """
    x = np.array(values, dtype=np.float64)
    known = x[np.isfinite(x)]
    if known.size < _LEAST_FOR_MEDIAN:
        return [False] * x.size
    median = float(np.median(known))
    return [bool(math.isfinite(v) and abs(v - median) > share * abs(median)) for v in x]
