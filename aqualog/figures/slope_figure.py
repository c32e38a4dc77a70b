"""Slip slope of driven wheels over speed, level by level: common parts of Figures 2.17 to 2.20."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aqualog.campaign.bins import Plan
from aqualog.campaign.samples import RunInfo
from aqualog.campaign.slip_slope import SlopeRow, SlopeTable, slip_slopes
from aqualog.figures.evidence import Evidence
from aqualog.figures.levels import V_KMH, Style, shifts, styles
from aqualog.figures.record import Axis, Figure, Finding, Line, Panel, Table
from aqualog.figures.scene_panels import WHEEL_WORDS
from aqualog.figures.selection import FAMILIES, Level, NotInCampaign, Selected, Wish, choose, keys_of, value_of

__all__ = ["Slopes", "measured_slopes", "slope_figure"]

_SLOPE = Axis("slip slope", "-")
_FAMILIES = tuple(FAMILIES)


@dataclass(frozen=True, slots=True)
class Slopes:
    """A selection with its slopes: rows by level's name, of all driven wheels, by speed."""

    selected: Selected
    rows: Mapping[str, tuple[SlopeRow, ...]]
    table: SlopeTable
    wheels: tuple[str, ...]

    @property
    def levels(self) -> tuple[Level, ...]:
        """Levels that have a slope somewhere."""
        return tuple(x for x in self.selected.levels if any(r.told for r in self.rows[x.name]))

    def of(self, level: Level, wheel: str | None = None) -> list[SlopeRow]:
        """Rows of a level, of one wheel or of all."""
        return [r for r in self.rows[level.name] if wheel in (None, r.wheel)]


def measured_slopes(evidence: Evidence, wish: Wish, number: str, needs: str) -> Slopes:
    """Choose runs and estimate their slopes, with dry references of the same configuration where the campaign has them.

    Raises
    ------
    NotInCampaign
    """
    selected = choose(
        evidence.data.runs, wish, campaign=evidence.name, number=number, is_of_use=evidence.has_slope, needs=needs
    )
    runs = {r.index: r for r in (*selected.runs, *_dry(evidence, selected))}
    keys = tuple(k for k in ("vehicle", *keys_of(_FAMILIES)) if any(_has(r, k) for r in runs.values()))
    table = slip_slopes(evidence.part([runs[i] for i in sorted(runs)]), Plan(tuple(dict.fromkeys(keys))))
    of = {r.index: x.name for x in selected.levels for r in x.runs}
    groups = {_group(r, table.plan.keys): of[r.index] for r in selected.runs}
    rows: dict[str, list[SlopeRow]] = {x.name: [] for x in selected.levels}
    for row in table.rows:
        if row.group in groups:
            rows[groups[row.group]].append(row)
    found = {n: tuple(x) for n, x in rows.items()}
    wheels = tuple(dict.fromkeys(w for r in selected.runs for w in r.vehicle.driven))
    slopes = Slopes(selected, found, table, wheels)
    if not slopes.levels:
        why = next((r.reason for x in found.values() for r in x if r.reason), "no bin of speed has enough samples")
        raise NotInCampaign(f"needs {needs}: no slope can be estimated ({why})", where=f"figure {number}")
    return slopes


def _has(info: RunInfo, key: str) -> bool:
    return key == "vehicle" or key in info.run.values


def _group(info: RunInfo, keys: Sequence[str]) -> tuple[tuple[str, float | str | None], ...]:
    return tuple((k, info.run.vehicle.stem if k == "vehicle" else info.run.values.get(k)) for k in keys)


def _dry(evidence: Evidence, selected: Selected) -> list[RunInfo]:
    """Other runs of the same cars, tyres, pressures and loads: their driving on dry road is a reference too."""
    dry_keys = [f for f in _FAMILIES if f != "depth"]
    wanted = {tuple(value_of(r, f) for f in dry_keys) for r in selected.runs}
    return [
        r for r in evidence.data.done
        if not evidence.of(r).wet and tuple(value_of(r, f) for f in dry_keys) in wanted
    ]  # fmt: skip


def slope_line(name: str, rows: Sequence[SlopeRow], style: Style, *, shift: float) -> Line:
    """Slopes with an estimate, with their intervals where available."""
    colour, dash, symbol = style
    told = sorted((r for r in rows if r.told), key=lambda r: r.low_kmh)
    low, high = (np.array([r.slope_ci[i] if r.reliable else np.nan for r in told]) for i in (0, 1))
    return Line(
        name, np.array([0.5 * (r.low_kmh + r.high_kmh) + shift for r in told]), np.array([r.slope for r in told]),
        low=low, high=high, colour=colour, dash=dash, width=1.6, mode="lines+markers", symbol=symbol,
    )  # fmt: skip


def slope_figure(
    evidence: Evidence,
    number: str,
    title: str,
    wish: Wish,
    needs: str,
    claims: Callable[[Slopes], Sequence[Finding]],
) -> Figure:
    """Figure of slopes over speed, a panel per driven wheel.

    Raises
    ------
    NotInCampaign
    """
    found = measured_slopes(evidence, wish, number, needs)
    style, shift = styles(found.selected), shifts(found.levels)
    panels = []
    for wheel in found.wheels:
        lines = [slope_line(x.name, found.of(x, wheel), style[x.name], shift=shift[x.name]) for x in found.levels]
        drawn = tuple(line for line in lines if line.x.size)
        if drawn:
            panels.append(Panel(f"Slip slope, {WHEEL_WORDS[wheel]}", V_KMH, _limited(drawn), drawn))
    late = "; ".join(
        f"v_x of {d.vehicle} is {d.value:.3f} s late [{d.ci[0]:.3f}, {d.ci[1]:.3f}]" if d.told
        else f"delay of v_x of {d.vehicle} left open ({d.reason})"
        for d in found.table.delays
    )  # fmt: skip
    return Figure(
        number,
        title,
        f"{found.selected.fixed}. Slip over traction by regression in bins of 10 km/h, at constant speed and under "
        f"moderate acceleration; bars are 95 % intervals with the run as the unit, missing with fewer than three runs. "
        + (f"{late[0].upper()}{late[1:]}." if late else ""),
        tuple(panels),
        tuple(claims(found)),
        (_table(found),),
        found.selected.used(),
    )


def _limited(lines: Sequence[Line]) -> Axis:
    """From zero to a little above the largest slope; bars of the least certain bins may leave the picture."""
    top = max(float(np.nanmax(line.y)) for line in lines)
    return Axis(_SLOPE.label, _SLOPE.unit, limits=(0.0, 1.35 * top))


def _table(found: Slopes) -> Table:
    rows = []
    for level in found.levels:
        for r in found.of(level):
            ci = f"{r.slope_ci[0]:.1f} to {r.slope_ci[1]:.1f}" if r.reliable else "–"
            share = f"{100 * r.slope / r.slope_dry:.0f} %" if r.told and r.slope_dry > 0.0 else "–"
            rows.append(
                (level.name, r.wheel, f"{r.low_kmh:.0f} to {r.high_kmh:.0f}", f"{r.slope:.1f}" if r.told else "–", ci,
                 share, str(r.runs), str(r.samples), r.reason or "")
            )  # fmt: skip
    return Table(
        "Slip slope [-]",
        ("level", "wheel", "km/h", "slope", "95 %", "of the dry one", "runs", "samples", "why not"),
        tuple(rows),
    )
