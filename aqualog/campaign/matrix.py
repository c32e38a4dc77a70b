"""The test matrix: configurations with the number of their runs, and missing configurations.

Keys of the runs are sorted into constants (one value in all runs), factors that were varied, and keys that follow a
factor (each of its values has one value of theirs, so that their effects cannot be distinguished). A configuration is
one combination of the factors' values. A combination that was never driven is reported as missing where it would close
a gap: where neighbours (next value of one factor, all others alike) were driven along at least two factors.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from aqualog.campaign.definition import Campaign, Run
from aqualog.core.errors import listed

__all__ = ["FEW", "TOO_FEW", "Configuration", "Factor", "Gap", "Matrix", "campaign_matrix", "speeds_of"]

TOO_FEW = 3  # runs below which an interval over runs is useless: two runs have one degree of freedom (D)
FEW = 5  # below which it is wide: t(0.975) is 4.3 with 3 runs, 2.8 with 5, 2.0 with many (D)

_CONFIGURATION = (
    "vehicle", "tyre", "wear", "tread_depth_mm", "pressure_rear_bar", "pressure_front_bar", "water_depth_mm",
    "water_depth_left_mm", "load_front_kg", "load_rear_kg",
)  # fmt: skip
_OF_OTHERS = {"wear", "tread_depth_mm", "pressure_front_bar", "water_depth_left_mm"}  # tyre's, rear pressure's, depth's
_SPEED = "x_speed_kmh"


@dataclass(frozen=True, slots=True)
class Factor:
    """A key that was varied: its values in order, empty text where a run gives no value, with the number of runs."""

    key: str
    values: tuple[str, ...]
    runs: tuple[int, ...]
    is_ordered: bool


@dataclass(frozen=True, slots=True)
class Configuration:
    """Runs of one configuration. `values` are those of the factors; `speeds` [km/h] the distinct ones, sorted."""

    values: tuple[str, ...]
    runs: tuple[int, ...]
    manoeuvres: Mapping[str, int]
    speeds: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Gap:
    """A configuration that was not driven; `beside` counts the neighbours that were."""

    values: tuple[str, ...]
    beside: int


@dataclass(frozen=True, slots=True)
class Matrix:
    """The driven configurations. `together` maps a key to the factor that it follows; `others` are further keys with
    the number of their values.
    """

    constants: Mapping[str, str]
    factors: tuple[Factor, ...]
    together: Mapping[str, str]
    others: Mapping[str, int]
    configurations: tuple[Configuration, ...]
    gaps: tuple[Gap, ...]
    notes: tuple[str, ...]


def speeds_of(run: Run) -> tuple[float, ...]:
    """Speeds [km/h] of a run from the campaign file: its `x_speed_kmh`."""
    value = _number(str(run.values.get(_SPEED, "")).replace(",", "."))
    return (value,) if value is not None and math.isfinite(value) else ()


def campaign_matrix(campaign: Campaign, speeds: Callable[[int, Run], Sequence[float]] | None = None) -> Matrix:
    """The matrix of a campaign. `speeds` of (index of the run, run) are its speeds [km/h]; default `speeds_of`."""
    groups = [r.groups for r in campaign.runs]
    columns = {k: [g.get(k, "") for g in groups] for k in _CONFIGURATION}
    columns = {k: c for k, c in columns.items() if any(c)}
    constants = {k: c[0] for k, c in columns.items() if len(set(c)) == 1 and c[0]}
    varied = {k: c for k, c in columns.items() if len(set(c)) > 1}
    together = _together(varied)
    keys = [k for k in varied if k not in together]
    factors = tuple(_factor(k, varied[k]) for k in keys)
    cells: dict[tuple[str, ...], list[int]] = {}
    for index in range(len(campaign.runs)):
        cells.setdefault(tuple(varied[k][index] for k in keys), []).append(index)
    ranks = [{v: i for i, v in enumerate(f.values)} for f in factors]
    order = sorted(cells, key=lambda values: [r[v] for r, v in zip(ranks, values, strict=True)])
    told = speeds or (lambda _, run: speeds_of(run))
    configurations = []
    for values in order:
        own = [(i, campaign.runs[i]) for i in cells[values]]
        manoeuvres = Counter(str(run.values.get("manoeuvre", "")) for _, run in own)
        driven = sorted({round(v, 1) for i, run in own for v in told(i, run)})
        configurations.append(
            Configuration(values, tuple(cells[values]), dict(sorted(manoeuvres.items())), tuple(driven))
        )
    shown = {*_CONFIGURATION, "manoeuvre", _SPEED, "lane_start_s", "lane_end_s"}
    others = {k: len({g.get(k, "") for g in groups}) for k in campaign.keys if k not in shown}
    return Matrix(
        constants, factors, together, others, tuple(configurations), _gaps(factors, set(cells)), _notes(campaign)
    )  # fmt: skip


def _together(varied: Mapping[str, Sequence[str]]) -> dict[str, str]:
    """Keys that are a function of another key, which stays as a factor.

    Tyre, depth and similar keys are hidden behind another key only if each determines the other: a tyre that was driven
    on one depth only is still a factor.
    """
    found: dict[str, str] = {}
    order = list(varied)
    for key, column in varied.items():
        for other, theirs in varied.items():
            if other == key or other in found:
                continue
            is_function = len(set(zip(theirs, column, strict=True))) == len(set(theirs))
            both_ways = is_function and len(set(theirs)) == len(set(column))
            # of two keys that determine each other, the first one stays
            is_first = both_ways and order.index(key) < order.index(other)
            if is_function and not is_first and (both_ways or key in _OF_OTHERS):
                found[key] = other
                break
    for key, other in found.items():  # a key may follow one that follows another: the last of the chain is the factor
        while other in found:
            other = found[other]
        found[key] = other
    return found


def _factor(key: str, column: Sequence[str]) -> Factor:
    counts = Counter(column)
    numbers = {v: _number(v) for v in counts}
    is_ordered = all(n is not None for v, n in numbers.items() if v)
    values = sorted(counts, key=lambda v: (v == "", (numbers[v] or 0.0) if is_ordered else 0.0, v))
    return Factor(key, tuple(values), tuple(counts[v] for v in values), is_ordered)


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _gaps(factors: Sequence[Factor], driven: set[tuple[str, ...]]) -> tuple[Gap, ...]:
    """Combinations that were not driven, with neighbours along two factors or more; most neighbours first."""
    if len(factors) < 2:
        return ()
    steps = [_steps(f) for f in factors]
    beside: dict[tuple[str, ...], set[tuple[int, str]]] = {}
    for values in driven:
        for axis, near in enumerate(steps):
            for other in near[values[axis]]:
                candidate = (*values[:axis], other, *values[axis + 1 :])
                if candidate not in driven:
                    beside.setdefault(candidate, set()).add((axis, values[axis]))
    found = [Gap(v, len(near)) for v, near in beside.items() if len({axis for axis, _ in near}) >= 2]
    ranks = [{v: i for i, v in enumerate(f.values)} for f in factors]
    return tuple(sorted(found, key=lambda g: (-g.beside, [r[v] for r, v in zip(ranks, g.values, strict=True)])))


def _steps(factor: Factor) -> dict[str, tuple[str, ...]]:
    """Neighbours of each value: the next ones of an ordered factor, all others for names; an unknown value has no
    neighbours."""
    known = [v for v in factor.values if v]
    if not factor.is_ordered:
        return {v: tuple(o for o in known if o != v) if v else () for v in factor.values}
    near = {v: tuple(known[j] for j in (i - 1, i + 1) if 0 <= j < len(known)) for i, v in enumerate(known)}
    return {**near, "": ()}


def _notes(campaign: Campaign) -> tuple[str, ...]:
    """Data that the runs lack, beyond configurations."""
    runs = campaign.runs
    notes = []
    for key, what in (("tyre", "tyres cannot be compared"), ("water_depth_mm", "dry or wet is not known")):
        blank = sum(key not in r.values for r in runs)
        if blank:
            notes.append(f"{_runs(blank, len(runs))} without {key}: {what}")
    wheres = [r for r in runs if r.lane is None and r.labels is None and r.values.get("water_depth_mm") != 0.0]
    if wheres:
        notes.append(
            f"{_runs(len(wheres), len(runs))} without lane times and labels: only a signal on_water in the log "
            "can show when it was on water"
        )
    dry = {_mounted(r) for r in runs if r.values.get("water_depth_mm") == 0.0}
    wet = dict.fromkeys(_mounted(r) for r in runs if float(r.values.get("water_depth_mm", 0.0)) > 0.0)
    lacking = [" on ".join(x for x in m if x) for m in wet if m not in dry]
    if lacking:
        notes.append(
            f"no dry run of {listed(lacking, 6)}: the dry slip slope comes from the driving before and after the lane"
        )
    return tuple(notes)


def _mounted(run: Run) -> tuple[str, str]:
    return str(run.values.get("tyre", "")), run.vehicle.stem


def _runs(count: int, total: int) -> str:
    if count == total:
        return "all runs"
    return f"{count} of {total} runs"
