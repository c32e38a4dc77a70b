"""Seeds of a study, work on them by several processes, and results with their uncertainty."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypedDict, TypeVar

import numpy as np
from numpy.typing import NDArray

from aqualog.core.errors import ConfigError
from aqualog.core.intervals import Z95, student_quantile, wilson
from aqualog.core.records import BoolArray, FloatArray
from aqualog.guard.worker import Crashed, work_on
from aqualog.thesis.claims import Check, Checks
from aqualog.thesis.evidence.passes import Pass, PassFigures, figures_of

__all__ = [
    "PASS_SEEDS", "Maker", "Plan", "Rows", "Statistic", "Table", "bootstrap", "by_passes", "cells_of", "estimate",
    "first_speed", "mean", "mean_of", "number", "ratio_of_counts", "said", "scatter", "share", "spread_over", "told",
]  # fmt: skip

PASS_SEEDS, RULE_SEEDS = range(12000, 12200), range(11000, 11200)  # that reported numbers are from
SEED_COUNT = 20  # of the seeds that a plan has, those that passes are made with
DRY_SEED_COUNT = 2  # nothing fluctuates on a dry road
_DRAWS = 400  # of the bootstrap
_BATCH = 10  # items that a process is given at once
_WORTH = 40  # items below which processes take longer to start than to work

Rows = NDArray[np.intp]
Statistic = Callable[[Rows], float]
"""A number from some of the seeds, given as rows."""

Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class Plan:
    """How checks are made.

    `seeds` of the simulated drives: those that the figures reported are from; `jobs` processes at most; `tell` gets a
    sentence on the progress at times.
    """

    seeds: Sequence[int]
    jobs: int = 1
    tell: Callable[[str], None] | None = None

    def first(self, n: int) -> tuple[int, ...]:
        """The first n seeds; fewer if there are fewer."""
        return tuple(self.seeds[:n])


@dataclass(frozen=True, slots=True)
class Maker:
    """Makes the checks of some claims from its `seeds`; `spreads` its work over processes itself."""

    claims: tuple[str, ...]
    make: Callable[[Plan], Check | Checks]
    seeds: Sequence[int] = RULE_SEEDS
    spreads: bool = False

    def checks(self, plan: Plan | None = None) -> Checks:
        """Its checks, of a plan or of its own seeds."""
        made = self.make(plan or Plan(self.seeds))
        return (made,) if isinstance(made, Check) else made


@dataclass(frozen=True, slots=True)
class Cell:
    """One pass over all seeds of a plan."""

    figures: tuple[PassFigures, ...]

    def of(self, name: str) -> FloatArray:
        """A figure of each seed, array (n, ...)."""
        return np.asarray([getattr(f, name) for f in self.figures], dtype=np.float64)


Table = Mapping[Pass, Cell]
_MADE: dict[tuple[Pass, int], PassFigures] = {}


def table_of(wanted: Iterable[Pass], plan: Plan) -> dict[Pass, Cell]:
    """Passes over the first seeds of a plan; each is made once in a process.

    A dry pass has two seeds only.
    """
    passes = tuple(dict.fromkeys(wanted))
    seeds = {p: plan.first(SEED_COUNT if p.h > 0.0 else DRY_SEED_COUNT) for p in passes}
    todo = [(p, s) for p in passes for s in seeds[p] if (p, s) not in _MADE]
    _MADE.update(zip(todo, spread_over(_one, todo, plan, "passes"), strict=True))
    return {p: Cell(tuple(_MADE[p, s] for s in seeds[p])) for p in passes}


def _one(item: tuple[Pass, int]) -> PassFigures:
    return figures_of(*item)


def by_passes(claim: str, needs: Callable[[], Iterable[Pass]], judge: Callable[[Table], Check | Checks]) -> Maker:
    """A maker of checks that are judged from passes."""
    return Maker((claim,), lambda plan: judge(table_of(needs(), plan)), PASS_SEEDS, spreads=True)


def spread_over(work: Callable[[Item], Result], items: Sequence[Item], plan: Plan, what: str) -> list[Result]:
    """Results of all items in order, by as many processes as the plan allows.

    Parameters
    ----------
    work : callable
        A function of a module.
    items : sequence
        Picklable.
    plan : Plan
        Its `tell` gets the number of finished items of `what`.

    Raises
    ------
    ConfigError
        If a process ends without a message.
    """
    if plan.jobs < 2 or len(items) < _WORTH:
        return [work(item) for item in items]
    found = {0: [work(items[0])]}  # compiles once, before several processes do

    def record(start: int, results: list[Result] | Crashed) -> None:
        if isinstance(results, Crashed):
            raise ConfigError(
                f"a process that made {what} ended without a message",
                expected="memory for every process",
                hint="fewer jobs",
            )
        found[start] = results
        if plan.tell is not None:
            plan.tell(f"{sum(len(x) for x in found.values())} of {len(items)} {what}")

    batches = {k: (work, tuple(items[k : k + _BATCH])) for k in range(1, len(items), _BATCH)}
    work_on(batches, _each, jobs=plan.jobs, record=record)
    return [result for k in sorted(found) for result in found[k]]


def _each(work: Callable[[Item], Result], items: tuple[Item, ...]) -> list[Result]:
    return [work(item) for item in items]


def cells_of(table: Table, passes: Iterable[Pass], name: str) -> FloatArray:
    """A figure of several passes over all seeds, array (passes, seeds)."""
    return np.stack([table[p].of(name) for p in passes])


def mean(values: FloatArray) -> float:
    """Mean of the finite values; NaN without one."""
    there = values[np.isfinite(values)]
    return float(there.mean()) if there.size else math.nan


def mean_of(values: FloatArray) -> Statistic:
    """Mean over some of the seeds; values (seeds,)."""
    average = np.nanmean if np.isnan(values).any() else np.mean
    return lambda rows: float(average(values[rows]))


def scatter(values: FloatArray) -> float:
    """Standard deviation of the finite values over the seeds; NaN with fewer than two."""
    there = values[np.isfinite(values)]
    return float(there.std(ddof=1)) if there.size > 1 else math.nan


def first_speed(speeds: Sequence[float], met: BoolArray, least: float = 0.5) -> Statistic:
    """Lowest speed at which a share of the seeds meets something; linear between the speeds, infinite where never.

    Parameters
    ----------
    speeds : sequence of float
        Increasing.
    met : bool array (speeds, seeds)
    least : float
        The share. [-]
    """

    def statistic(rows: Rows) -> float:
        share = met[:, rows].mean(axis=1)
        at = np.flatnonzero(share >= least)
        if not at.size:
            return math.inf
        i = int(at[0])
        if i == 0:
            return float(speeds[0])
        q, p = share[i - 1], share[i]
        return float(speeds[i - 1] + (least - q) / (p - q) * (speeds[i] - speeds[i - 1]))

    return statistic


def estimate(statistic: Statistic, n: int, *, of: int = 1) -> tuple[float, tuple[float, float]]:
    """A number from n seeds and its 95 % interval: percentiles of a bootstrap over the seeds, `widened`.

    Draws in which the number is not there (NaN) are left out; without any the interval is that of the number alone.
    Where one of several numbers is chosen, `of` is how many: all their intervals hold together.
    """
    value = statistic(np.arange(n))
    draws = np.random.default_rng(20240301).integers(n, size=(_DRAWS, n))
    drawn = np.array([statistic(rows) for rows in draws])
    drawn = np.sort(drawn[~np.isnan(drawn)])
    if not drawn.size:
        return value, (value, value)
    ends = float(drawn[int(0.025 * drawn.size)]), float(drawn[math.ceil(0.975 * drawn.size) - 1])
    return value, widened(value, ends, n, of=of)


def widened(value: float, ends: tuple[float, float], n: int, *, of: int = 1) -> tuple[float, float]:
    """A bootstrap's 95 % interval for few units, by Student's t, as in `aqualog.diagnose.gain`.

    Resamples of n vary less than samples do, by (n - 1) / n, and few of them do not show how much. `of` intervals hold
    together [bonferroni1936].
    """
    if n < 2 or not math.isfinite(value):
        return ends
    wider = math.sqrt(n / (n - 1.0)) * student_quantile(1.0 - 0.025 / of, n - 1.0) / Z95
    return value + wider * (ends[0] - value), value + wider * (ends[1] - value)


class Number(TypedDict):
    """The number of a check with its interval."""

    value: float | None
    ci95: tuple[float, float] | None


def number(value: float, ci95: tuple[float, float]) -> Number:
    """A number for a check; None where it, or an end of its interval, is not finite."""
    there = math.isfinite(value)
    return {"value": value if there else None, "ci95": ci95 if there and np.isfinite(ci95).all() else None}


def told(value: float, ci95: tuple[float, float], digits: int = 1) -> str:
    """A number with its interval: 91.3 (90.8 to 92.0)."""
    if math.isinf(value):
        return "never"
    low, high = (f"{x:.{digits}f}" if math.isfinite(x) else "never" for x in ci95)
    return f"{value:.{digits}f} ({low} to {high})"


def said(statistic: Statistic, n: int, digits: int = 1) -> str:
    """`told` of an estimate."""
    return told(*estimate(statistic, n), digits)


_RESAMPLES, _SEED = 2000, 20240301


def bootstrap(
    values: Sequence[float] | FloatArray, statistic: Callable[[FloatArray], float] | None = None
) -> tuple[float, float]:
    """95 % interval of a statistic over runs (default: the mean), by resampling the runs [efron1979], `widened`.

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
        value, found = float(x.mean()), x[rows].mean(axis=1)
    else:
        value, found = statistic(x), np.array([statistic(x[r]) for r in rows[:500]])
    low, high = np.nanquantile(found, [0.025, 0.975])
    return widened(value, (float(low), float(high)), x.shape[0])


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
