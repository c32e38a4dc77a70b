"""Divide drives into those to tune on and those to report on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

__all__ = ["Split", "split_runs"]


@dataclass(frozen=True, slots=True)
class Split:
    """Indices of the drives: to tune on, to report on, and those that would mix both; `rule` in words."""

    tuning: tuple[int, ...]
    reporting: tuple[int, ...]
    unused: tuple[int, ...]
    rule: str


def split_runs(groups: Sequence[Mapping[str, str]]) -> Split:
    """Halve the drives so that the two halves share as little as possible.

    Parameters
    ----------
    groups : sequence of mapping
        Configuration of each drive; its `vehicle` and `tyre` are used.

    Returns
    -------
    Split
        By the first rule that leaves drives on both sides. (1) Families of drives that share a vehicle or a tyre stay
        together. (2) Half of the vehicles with half of the tyres against the other halves; drives that mix them are
        unused. (3) By tyre. (4) By vehicle. (5) Every other drive. Values in their sorted order, every other one to
        either side; the same drives are always divided alike.
    """
    every = range(len(groups))
    tyres = [g.get("tyre", "") for g in groups]
    vehicles = [g.get("vehicle", "") for g in groups]
    families = _families(vehicles, tyres)
    if len(set(families)) > 1:
        return _of(_halves(families), every, "no vehicle and no tyre is in both parts")
    v, y = _halves(vehicles), _halves(tyres)
    both: list[bool | None] = [a if a == b else None for a, b in zip(v, y, strict=True)]
    if True in both and False in both:
        return _of(both, every, "no vehicle and no tyre is in both parts; drives that mix them are left out")
    if len(set(tyres)) > 1:
        return _of(y, every, "no tyre is in both parts, the vehicle is the same")
    if len(set(vehicles)) > 1:
        return _of(v, every, "no vehicle is in both parts, the tyre is the same")
    return _of([bool(i % 2) for i in every], every, "every other drive: vehicle and tyre are the same in both parts")


def _of(is_reporting: Sequence[bool | None], every: Sequence[int], rule: str) -> Split:
    return Split(
        tuple(i for i in every if is_reporting[i] is False),
        tuple(i for i in every if is_reporting[i] is True),
        tuple(i for i in every if is_reporting[i] is None),
        rule,
    )


def _halves(values: Sequence[str]) -> list[bool]:
    """Return whether the value of each drive belongs to the second half: every other one in sorted order."""
    rank = {value: i for i, value in enumerate(sorted(set(values)))}
    return [bool(rank[value] % 2) for value in values]


def _families(first: Sequence[str], second: Sequence[str]) -> list[str]:
    """Return a name for each drive that is the same for drives connected by a shared value of either kind."""
    name = [min(pair) for pair in zip((f"a{x}" for x in first), (f"b{x}" for x in second), strict=True)]
    while True:
        before = list(name)
        for values in (first, second):
            least: dict[str, str] = {}
            for value, n in zip(values, name, strict=True):
                least[value] = min(n, least.get(value, n))
            name = [least[value] for value in values]
        if name == before:
            return name
