"""The control tyre: its value between its sets by run order, and the index of a set against it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from aqualog.core.intervals import NOWHERE, Interval, student_quantile

__all__ = ["Block", "Control", "Drift", "Estimate", "Index", "blocks_of", "fieller", "index_of"]


class Estimate(NamedTuple):
    """A value, its variance, and the degrees of freedom of that."""

    value: float
    variance: float
    dof: float


class Block(NamedTuple):
    """Runs of the control in a row: mean of their places in the order, and their estimate."""

    order: float
    estimate: Estimate
    runs: int


class Drift(NamedTuple):
    """Change of the control from its first to its last set, relative to the first one, with its interval. [-]"""

    change: float
    ci: Interval


@dataclass(frozen=True, slots=True)
class Index:
    """Index of a set: 100 (or what the user wants) times its value over that of the control at the same place in the
    order, with Fieller's interval [fieller1954].

    `sentence` says what that means, `control` is the control's value there.
    """

    value: float = math.nan
    ci: Interval = NOWHERE
    control: float = math.nan
    sentence: str = ""


@dataclass(frozen=True, slots=True)
class Control:
    """The sets of a control tyre, in the order of the runs.

    `is_pooled`: all blocks share one estimate of the spread, whose degrees of freedom are those of each.
    """

    name: str
    blocks: tuple[Block, ...]
    is_pooled: bool = False

    def at(self, orders: Sequence[float]) -> Estimate:
        """Return the control's mean over places in the order: linear between sets, constant beyond them."""
        weights = np.mean([self._weights(o) for o in orders], axis=0)
        parts = [b.estimate for b in self.blocks]
        return combined(parts, weights, is_pooled=self.is_pooled)

    def _weights(self, order: float) -> list[float]:
        places = [b.order for b in self.blocks]
        return [float(np.interp(order, places, row)) for row in np.eye(len(places))]

    def drift(self, level: float = 0.95) -> Drift | None:
        """Return the change from the first to the last set; None with one set."""
        if len(self.blocks) < 2:
            return None
        first, last = self.blocks[0].estimate, self.blocks[-1].estimate
        dof = first.dof if self.is_pooled else satterthwaite([last.variance, first.variance], [last.dof, first.dof])
        low, high = fieller(last, first, level=level, dof=dof)
        return Drift(last.value / first.value - 1.0, (low - 1.0, high - 1.0))


def blocks_of(orders: Sequence[float], own: Sequence[bool]) -> list[list[int]]:
    """Return the runs that are the control's (by place in the arguments), each list in a row in the order of all runs.

    `own` says which runs are the control's; runs of others between them begin a new list.
    """
    found: list[list[int]] = []
    was_own = False
    for i in sorted(range(len(orders)), key=lambda k: orders[k]):
        if own[i]:
            if not was_own:
                found.append([])
            found[-1].append(i)
        was_own = own[i]
    return found


def combined(parts: Sequence[Estimate], weights: Sequence[float] | np.ndarray, *, is_pooled: bool) -> Estimate:
    """Return the weighted sum of independent estimates."""
    w = [float(x) for x in weights]
    variances = [k * k * p.variance for k, p in zip(w, parts, strict=True)]
    value = sum(k * p.value for k, p in zip(w, parts, strict=True) if k)
    dof = parts[0].dof if is_pooled else satterthwaite(variances, [p.dof for p in parts])
    return Estimate(value, sum(v for k, v in zip(w, variances, strict=True) if k), dof)


def satterthwaite(variances: Sequence[float], dofs: Sequence[float]) -> float:
    """Return the degrees of freedom of a sum of variances [satterthwaite1946]: (sum s^2)^2 / sum (s^4 / dof)."""
    below = sum(v * v / d for v, d in zip(variances, dofs, strict=True) if v > 0.0 and d > 0.0)
    return sum(variances) ** 2 / below if below > 0.0 else max(dofs, default=0.0)


def fieller(a: Estimate, b: Estimate, *, level: float = 0.95, dof: float | None = None) -> Interval:
    """Return the interval of the ratio of two independent means [fieller1954].

    Parameters
    ----------
    a, b : Estimate
        Numerator and denominator.
    level : float
        Confidence.
    dof : float, optional
        Degrees of freedom; else those of the sum of both variances at the ratio (Satterthwaite [satterthwaite1946]).

    Returns
    -------
    interval : (float, float)
        The ratios r with (a - r b)^2 <= t^2 (s_a^2 + r^2 s_b^2). NaN where the spread is not known, or where b does not
        differ from 0, since then the ratios have no bound.

    Limits: without spread both ends are a / b; s_b = 0 gives a's own interval over b.
    """
    ratio = a.value / b.value if b.value else math.nan
    if dof is None:
        dof = satterthwaite([a.variance, ratio * ratio * b.variance], [a.dof, b.dof])
    if not (math.isfinite(ratio) and math.isfinite(a.variance + b.variance) and dof >= 1.0):
        return NOWHERE
    t2 = student_quantile(0.5 + level / 2.0, dof) ** 2
    below = b.value**2 - t2 * b.variance
    inner = (a.value * b.value) ** 2 - (a.value**2 - t2 * a.variance) * below
    if below <= 0.0 or inner < 0.0:
        return NOWHERE
    root = math.sqrt(inner)
    return (a.value * b.value - root) / below, (a.value * b.value + root) / below


def index_of(
    estimate: Estimate, orders: Sequence[float], control: Control, *, of: float = 100.0, level: float = 0.95
) -> Index:
    """Return the index of a set against the control.

    Parameters
    ----------
    estimate : Estimate
        Value of the set.
    orders : sequence of float
        Places of its valid runs in the order of all runs.
    of : float
        Index of the control.
    """
    there = control.at(orders)
    ratio = estimate.value / there.value if there.value else math.nan
    low, high = fieller(estimate, there, level=level)
    found = Index(of * ratio, (of * low, of * high), there.value)
    return Index(found.value, found.ci, found.control, _sentence(found, of, control.name))


def _sentence(found: Index, of: float, name: str) -> str:
    low, high = found.ci
    if not math.isfinite(found.value):
        return "no index: there is no mean"
    if not math.isfinite(low + high):
        return f"index {found.value:.1f} without an interval: whether it differs from {name} is not known"
    told = f"index {found.value:.1f} ({low:.1f} to {high:.1f})"
    if low <= of <= high:
        return f"not different from {name}: {told}"
    return f"{abs(found.value - of):.1f} points {'above' if found.value > of else 'below'} {name}: {told}"
