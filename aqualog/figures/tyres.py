"""Finds the worn one of two tyres from a campaign's data."""

from __future__ import annotations

from collections.abc import Sequence

from aqualog.figures.selection import Level, Part, Wish, label

__all__ = ["VERY_WORN", "WORN", "depth_mm", "is_winter", "pairs", "wear_rank"]

WORN = ("worn_summer", "worn")
VERY_WORN = ("very_worn_summer", "very_worn", *WORN)
_WEAR = {"very_worn": 0.0, "worn": 1.0, "new": 2.0}


def wear_rank(tyre: Part) -> float | None:
    """A smaller value is more worn: depth of the tread, else the given wear; None without both."""
    name, wear, tread = tyre
    if isinstance(tread, float):
        return tread
    if isinstance(wear, str) and wear in _WEAR:
        return _WEAR[wear]
    return next((rank for word, rank in _WEAR.items() if str(name).startswith(word)), None)


def is_winter(tyre: Part) -> bool:
    """Whether its name marks it as such."""
    return "winter" in str(tyre[0]).lower()


def depth_mm(level: Level, wish: Wish) -> float | None:
    """Water depth of a level that varies in it. [mm]"""
    value = level.part(wish, "depth")[0]
    return value if isinstance(value, float) else None


def pairs(levels: Sequence[Level], wish: Wish) -> list[tuple[str, Level, Level]]:
    """(others in words, more worn, less worn) for each value of the other families with two tyres of different wear."""
    at = wish.varies.index("tyre")
    by_rest: dict[object, list[Level]] = {}
    for level in levels:
        rest = tuple(v for i, v in enumerate(level.value) if i != at)
        by_rest.setdefault(rest, []).append(level)
    found = []
    for members in by_rest.values():
        ranked = sorted(
            ((rank, x.name, x) for x in members if (rank := wear_rank(x.value[at])) is not None), key=lambda m: m[:2]
        )
        if len(ranked) > 1 and ranked[0][0] < ranked[-1][0]:
            worn, new = ranked[0][2], ranked[-1][2]
            words = ", ".join(label(f, v) for f, v in zip(wish.varies, worn.value, strict=True) if f != "tyre")
            found.append((words, worn, new))
    return found
