"""Runs of a campaign that a figure shows: varied and fixed keys, the choice nearest to the thesis, worn tyres."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from aqualog.campaign.results import RunInfo
from aqualog.core.errors import FitError
from aqualog.thesis.catalogue import Wish
from aqualog.thesis.record import RunsUsed

__all__ = [
    "FAMILIES", "Level", "NotInCampaign", "Selected", "choose", "depth_mm", "is_winter", "keys_of", "label", "marks",
    "pairs", "value_of", "wear_rank",
]  # fmt: skip

FAMILIES: dict[str, tuple[str, ...]] = {
    "car": ("vehicle",),
    "tyre": ("tyre", "wear", "tread_depth_mm"),
    "pressure": ("pressure_front_bar", "pressure_rear_bar"),
    "depth": ("water_depth_mm", "water_depth_left_mm"),
    "load": ("load_front_kg", "load_rear_kg"),
}
"""Configuration keys that are varied together: a tyre has one wear, a depth one depth on the left."""

_NEAR_MM, _CLOSE_MM = 0.051, 0.31  # [mm] a water depth as the thesis has it, and one that will do
_MOST_LEVELS = 8  # lines that a reader can distinguish

Part = tuple[float | str | None, ...]
Value = tuple[Part, ...]
"""Values of several families."""


class NotInCampaign(FitError):  # noqa: N818 - what is lacking, not what failed
    """A campaign has not the runs that a figure needs."""


@dataclass(frozen=True, slots=True)
class Level:
    """One value of the varied key, in words, with its runs."""

    name: str
    value: Value
    runs: tuple[RunInfo, ...]

    def part(self, wish: Wish, family: str) -> Part:
        """The value of one of the varied families."""
        return self.value[wish.varies.index(family)]


@dataclass(frozen=True, slots=True)
class Selected:
    """Levels with their runs; `fixed` names the shared configuration, `is_thesis` whether it is that of the thesis."""

    wish: Wish
    levels: tuple[Level, ...]
    fixed: str
    is_thesis: bool
    campaign: str
    left_out: Mapping[str, int] = field(default_factory=dict)

    @property
    def runs(self) -> tuple[RunInfo, ...]:
        """All runs, level by level."""
        return tuple(r for level in self.levels for r in level.runs)

    def used(self, shown: Mapping[int, str] | None = None) -> RunsUsed:
        """For the figure's page; `shown` gives the label of a run by its index, if it is not its level."""
        rows = tuple(
            (r.name, (shown or {}).get(r.index, level.name or "all")) for level in self.levels for r in level.runs
        )
        return RunsUsed(self.campaign, rows, tuple(sorted(self.left_out.items())))


def keys_of(families: Sequence[str]) -> tuple[str, ...]:
    """Configuration keys of families."""
    return tuple(k for f in families for k in FAMILIES[f])


def value_of(info: RunInfo, family: str) -> Part:
    """Values of a family's keys; None where a run has no value. A missing load counts as no load, as in the batch."""
    if family == "car":
        return (info.run.vehicle.stem,)
    none: float | None = 0.0 if family == "load" else None
    return tuple(info.run.values.get(k, none) for k in FAMILIES[family])


def label(family: str, part: Part) -> str:
    """A value in words."""
    if family == "car":
        return str(part[0]).removeprefix("vehicle_").replace("_", " ")
    if family == "tyre":
        name, wear, tread = part
        known = name or wear
        return str(known).replace("_", " ") if known else f"{tread:g} mm tread" if tread is not None else "any tyre"
    if family == "load":
        words = [f"{x:g} kg {where}" for x, where in zip(part, ("front", "rear"), strict=True) if x]
        return " and ".join(words) if words else "no load"
    first, second = part
    if family == "depth":
        return "water depth not given" if first is None else "dry" if first == 0.0 else f"{first:g} mm"
    if first is None and second is None:
        return "pressure not given"
    if first == second or None in part:
        return f"{first if second is None else second:g} bar"
    return f"{first:g} bar front, {second:g} bar rear"


def choose(
    runs: Sequence[RunInfo], wish: Wish, *, campaign: str, number: str, is_of_use: Callable[[RunInfo], str], needs: str
) -> Selected:
    """Choose the configuration that a figure shows.

    Parameters
    ----------
    runs : sequence of RunInfo
        Of the whole campaign.
    wish : Wish
    campaign, number : str
        Names, for the words.
    is_of_use : callable
        Empty if a run has the data, else why not.
    needs : str
        Requirements of the figure, in words.

    Returns
    -------
    Selected
        Of all values that can be held fixed: the one most like the thesis', then the one with most levels of what
        varies, then with most runs.

    Raises
    ------
    NotInCampaign
    """
    why: Counter[str] = Counter()
    usable = []
    for info in runs:
        reason = ("without results" if not info.is_done else is_of_use(info)) or ""
        if reason:
            why[reason] += 1
        else:
            usable.append(info)
    held = [f for f in FAMILIES if f not in wish.varies]
    groups: dict[Value, list[RunInfo]] = {}
    for info in usable:
        groups.setdefault(tuple(value_of(info, f) for f in held), []).append(info)
    best: tuple[tuple[float, int, int], Value, dict[Value, list[RunInfo]]] | None = None
    for fixed, members in sorted(groups.items(), key=lambda item: str(item[0])):
        levels = _levels(members, wish)
        if len(levels) < (2 if wish.varies else 1):
            continue
        score = sum(_match(f, v, wish, usable, members[0]) for f, v in zip(held, fixed, strict=True))
        rank = (score, len(levels), sum(map(len, levels.values())))
        if best is None or rank > best[0]:
            best = rank, fixed, levels
    if best is None:
        raise NotInCampaign(_lacking(usable, wish, needs, why, len(runs)), where=f"figure {number}")
    (score, *_), fixed, levels = best
    kept = {r.index for members in levels.values() for r in members}
    other = sum(1 for r in usable if r.index not in kept)
    if other:
        why["in another configuration"] = other
    return Selected(
        wish,
        tuple(
            Level(", ".join(label(f, p) for f, p in zip(wish.varies, value, strict=True)), value, tuple(members))
            for value, members in sorted(levels.items(), key=lambda item: _order(wish, item[0]))
        ),
        ", ".join(w for f, v in zip(held, fixed, strict=True) if (w := label(f, v))),
        score >= len(held) - 1e-9,
        campaign,
        dict(why),
    )  # fmt: skip


def marks(levels: Sequence[Level], wish: Wish) -> tuple[list[str], list[tuple[float, ...]]]:
    """Which levels (rows) have a load or the higher pressure (columns, by name), for effects that add; empty names if
    none varies.
    """
    loads = [any(x.part(wish, "load")) for x in levels]
    pressures = [_pressure(x.part(wish, "pressure")) for x in levels]
    higher = [p > min(pressures) for p in pressures]
    columns = {n: bits for n, bits in (("load", loads), ("higher pressure", higher)) if len(set(bits)) > 1}
    return list(columns), [tuple(float(c[i]) for c in columns.values()) for i in range(len(levels))]


def _levels(members: Sequence[RunInfo], wish: Wish) -> dict[Value, list[RunInfo]]:
    levels: dict[Value, list[RunInfo]] = {}
    for info in members:
        levels.setdefault(tuple(value_of(info, f) for f in wish.varies), []).append(info)
    levels = _restricted(levels, wish)
    if len(wish.varies) > 1:
        levels = _compared(levels, wish)
    if len(levels) > _MOST_LEVELS:
        most = sorted(levels, key=lambda v: -len(levels[v]))[:_MOST_LEVELS]
        levels = {v: levels[v] for v in most}
    return levels


def _restricted(levels: dict[Value, list[RunInfo]], wish: Wish) -> dict[Value, list[RunInfo]]:
    """Levels that the thesis shows, if two of them are there."""
    if "tyre" in wish.varies and wish.only_tyres:
        at = wish.varies.index("tyre")
        tyres = [next((v[at] for w in words for v in levels if w in v[at][:2]), None) for words in wish.only_tyres]
        if None not in tyres:
            levels = {v: r for v, r in levels.items() if v[at] in tyres}
    if "pressure" in wish.varies and wish.only_lowest_pressures:
        at = wish.varies.index("pressure")
        low = sorted({v[at] for v in levels}, key=_pressure)[: wish.only_lowest_pressures]
        levels = {v: r for v, r in levels.items() if v[at] in low}
    return levels


def _compared(levels: dict[Value, list[RunInfo]], wish: Wish) -> dict[Value, list[RunInfo]]:
    """Levels that another one differs from in the first family only, or in one family only."""

    def is_pair(a: Value, b: Value) -> bool:
        differ = [i for i, (x, y) in enumerate(zip(a, b, strict=True)) if x != y]
        return differ == [0] if not wish.any_one else len(differ) == 1

    return {v: r for v, r in levels.items() if any(is_pair(v, u) for u in levels)}


def _pressure(part: Part) -> float:
    """Rear pressure, else front. [bar]"""
    told = [p for p in (part[1], part[0]) if isinstance(p, float)]
    return told[0] if told else float("inf")


def _match(family: str, part: Part, wish: Wish, usable: Sequence[RunInfo], one: RunInfo) -> float:
    """How much a fixed value is that of the thesis, 0 to 1."""
    if family == "car":
        return float(one.vehicle.drivetrain == "rwd")
    if family == "load":
        return float(not any(part))
    if family == "tyre":
        near = [1.0 - 0.2 * i for i, word in enumerate(wish.tyre) if word in part[:2]]
        return max(near, default=0.0) if wish.tyre else 1.0
    if family == "pressure":
        told = [p for r in usable if (p := _pressure(value_of(r, "pressure"))) < float("inf")]
        extreme = (min if wish.pressure == "lowest" else max)(told, default=float("nan"))
        return float(_pressure(part) == extreme)
    if wish.depth_mm is None:
        return 1.0
    away = abs(part[0] - wish.depth_mm) if isinstance(part[0], float) else float("inf")
    return 1.0 if away < _NEAR_MM else 0.5 if away < _CLOSE_MM else 0.0


def _order(wish: Wish, value: Value) -> tuple[tuple[tuple[int, float, str], ...], ...]:
    """Numbers by size, words by the alphabet, missing values last."""
    return tuple(
        tuple(
            (2, 0.0, "") if x is None else (0, x, "") if isinstance(x, float) else (1, 0.0, x)
            for x in ((_pressure(part),) if f == "pressure" else part)
        )
        for f, part in zip(wish.varies, value, strict=True)
    )  # fmt: skip


def _lacking(usable: Sequence[RunInfo], wish: Wish, needs: str, why: Counter[str], total: int) -> str:
    if not usable:
        reasons = "; ".join(f"{n} {reason}" for reason, n in why.most_common(3))
        return f"needs {needs}: none of {total} runs ({reasons})"
    there = {f: sorted({label(f, value_of(r, f)) for r in usable}) for f in wish.varies}
    words = "; ".join(f"{f}: {', '.join(v[:6])}" for f, v in there.items())
    return f"needs {needs}: {len(usable)} of {total} runs have the data, but with {words}"


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
