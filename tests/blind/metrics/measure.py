"""A measured figure beside its target, and the small arithmetic that all metrics share."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from tests.blind.metrics.intervals import bootstrap, clopper_pearson
from tests.blind.metrics.rows import Row

__all__ = ["Measure", "by", "quantity", "right_first", "right_or_listed", "share"]

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Measure:
    """`number`: of the metric. `reached` is None where there were too few cases to say."""

    number: int
    name: str
    count: int
    value: float
    low: float
    high: float
    target: str
    reached: bool | None
    note: str = ""


def accepts(target: str) -> Callable[..., bool]:
    """Whether a value is what a target says: `>= 0.95`, `<= 0.05`, `0.92 ... 0.98`, `1.00`, or anything (`-`)."""
    if target == "-":
        return lambda *_: True
    if target[:2] in ("<=", ">="):
        limit = float(target[2:])
        return (lambda v, *_: v >= limit) if target[0] == ">" else (lambda v, *_: v <= limit)
    low, _, high = target.partition(" ... ")
    return lambda v, *_: float(low) <= v <= float(high or low)


def share(
    number: int, name: str, hits: Sequence[bool], target: str, *, accept: Callable[..., bool] | None = None,
    least: int = 1, note: str = "",
) -> Measure:  # fmt: skip
    """A share with its exact interval. `accept(value, low, high)`, where `target` does not say it; fewer than `least`
    cases decide nothing."""
    n, k = len(hits), sum(hits)
    low, high = clopper_pearson(k, n)
    value = k / n if n else float("nan")
    reached = (accept or accepts(target))(value, low, high) if n >= max(least, 1) else None
    return Measure(number, name, n, value, low, high, target, reached, note)


def quantity(
    number: int, name: str, values: Sequence[float], statistic: Callable[[np.ndarray], float], target: str, *,
    accept: Callable[..., bool] | None = None, least: int = 1, note: str = "",
) -> Measure:  # fmt: skip
    """A statistic of the values with its bootstrap interval. A value that is not finite decides nothing and is left out."""
    x = [v for v in values if math.isfinite(v)]
    value = float(statistic(np.asarray(x))) if x else float("nan")
    low, high = bootstrap(x, statistic)
    reached = (accept or accepts(target))(value) if len(x) >= max(least, 1) else None
    return Measure(number, name, len(x), value, low, high, target, reached, note)


def by(rows: Iterable[T], key: Callable[[T], str]) -> dict[str, list[T]]:
    """Rows in groups."""
    groups: dict[str, list[T]] = {}
    for row in rows:
        groups.setdefault(key(row), []).append(row)
    return groups


def right_first(row: Row) -> bool:
    """The first cause is what is hidden, and nothing else is named beside it without reserve."""
    return bool(row.causes) and row.found and row.causes[0].key in row.hidden and not row.wrong


def right_or_listed(row: Row) -> bool:
    """All that is hidden stands among what the verdict names or leaves open."""
    return row.found and set(row.hidden) <= row.listed
