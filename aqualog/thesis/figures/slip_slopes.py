"""Figures 2.16 to 2.20: the slip slope of driven wheels, and over speed by depth, pressure, tyre and load."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from aqualog.campaign.bins import KMH, Plan, group_of
from aqualog.campaign.delay import late_slip
from aqualog.campaign.results import RunInfo
from aqualog.campaign.slip_slope import SlopeRow, SlopeTable, at_zero_slip, slip_slopes
from aqualog.report.theme import MUTED, wheel_colour
from aqualog.thesis.catalogue import figure_of, needs_of
from aqualog.thesis.claims import NEEDS_DATA, NOT_REPRODUCED, Check, combined, judge, limit
from aqualog.thesis.evidence.campaign import Evidence
from aqualog.thesis.evidence.measures import (
    TEN,
    TOO_FEW,
    Effect,
    Means,
    fall,
    full_speed,
    line_of_logs,
    passes_of,
    ratio,
    uneven,
    usable,
)
from aqualog.thesis.evidence.selection import FAMILIES, Level, NotInCampaign, Selected, keys_of, marks, pairs, value_of
from aqualog.thesis.figures.panels import V_KMH, WHEEL_WORDS, Style, means_line, shifts, styles
from aqualog.thesis.record import Axis, Figure, Line, Panel, Table

__all__ = ["FIGURES", "Slopes", "measured_slopes"]

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


def measured_slopes(number: str, evidence: Evidence) -> Slopes:
    """Choose runs and estimate their slopes, with dry references of the same configuration where there are some."""
    selected = evidence.choose(number, evidence.has_slope)
    runs = {r.index: r for r in (*selected.runs, *_dry(evidence, selected))}
    given = {k for r in runs.values() for k in ("vehicle", *r.run.values)}
    keys = dict.fromkeys(k for k in ("vehicle", *keys_of(_FAMILIES)) if k in given)
    table = slip_slopes(evidence.part([runs[i] for i in sorted(runs)]), Plan(tuple(keys)))
    of = {r.index: x.name for x in selected.levels for r in x.runs}
    groups = {group_of(r.run, table.plan.keys): of[r.index] for r in selected.runs}
    found = {
        x.name: tuple(row for row in table.rows if groups.get(row.group) == x.name) for x in selected.levels
    }  # fmt: skip
    wheels = tuple(dict.fromkeys(w for r in selected.runs for w in r.vehicle.driven))
    slopes = Slopes(selected, found, table, wheels)
    if not slopes.levels:
        why = next((r.reason for x in found.values() for r in x if r.reason), "no bin of speed has enough samples")
        raise NotInCampaign(f"needs {needs_of(number)}: no slope can be estimated ({why})", where=f"figure {number}")
    return slopes


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
    told = sorted((r for r in rows if r.told), key=lambda r: r.low_kmh)
    ends = [r.slope_ci if r.reliable else (np.nan, np.nan) for r in told]
    bins = [(0.5 * (r.low_kmh + r.high_kmh), r.slope, *ci, r.runs, r.samples) for r, ci in zip(told, ends, strict=True)]
    return means_line(name, Means(*np.array(bins, dtype=np.float64).reshape(-1, 6).T), style, shift=shift)


def over_speed(number: str, evidence: Evidence) -> Figure:
    """Slopes over speed at zero slip, a panel per driven wheel, with the figure's claims.

    Regression lines, as they are, where a slope lacks its dry reference.
    """
    found = measured_slopes(number, evidence)
    told = [r for rows in found.rows.values() for r in rows if r.told]
    if all(math.isfinite(r.contact_ratio) for r in told):
        found = replace(found, rows={name: tuple(map(at_zero_slip, rows)) for name, rows in found.rows.items()})
    style, shift = styles(found.selected), shifts(found.levels)
    panels = []
    for wheel in found.wheels:
        lines = [slope_line(x.name, found.of(x, wheel), style[x.name], shift=shift[x.name]) for x in found.levels]
        drawn = tuple(line for line in lines if line.x.size)
        if drawn:
            # a little above the largest slope: bars of the least certain bins may leave the picture
            limits = 0.0, 1.35 * max(float(np.nanmax(line.y)) for line in drawn)
            panels.append(Panel(f"Slip slope, {WHEEL_WORDS[wheel]}", V_KMH, Axis("slip slope", "-", limits), drawn))
    late = "; ".join(
        f"v_x of {d.vehicle} is {d.value:.3f} s late [{d.ci[0]:.3f}, {d.ci[1]:.3f}]" if d.told
        else f"delay of v_x of {d.vehicle} left open ({d.reason})"
        for d in found.table.delays
    )  # fmt: skip
    checks = [judged(found) for judged in _OF_FIGURE[number]]
    delays = f"{late[0].upper()}{late[1:]}." if late else ""
    used, fixed = found.selected.used(), found.selected.fixed
    return figure_of(number, panels, checks, (_table(found),), runs=used, fixed=fixed, delays=delays)


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


_BELOW, _DEFAULT = 20 * KMH, 100 * KMH  # [m/s] below full aquaplaning; the thesis' speed, if that is not known
_MOST = 1200  # points of a cloud
_MU = Axis("traction coefficient")


def _c48(rows: Sequence[SlopeRow]) -> Check | None:
    ratios = {r.wheel: r.over_dry for r in rows if math.isfinite(r.contact_ratio)}
    told = {w: (x, ci) for w, (x, ci) in ratios.items() if all(map(math.isfinite, ci))}
    if not told:
        return None
    low = [w for w, (_, ci) in told.items() if ci[1] < 1.0]
    value, ci = max(told.values(), key=lambda found: found[1][1])
    whole = len(low) == len(told)
    outcome = (
        "; ".join(f"{w} {x:.2f} [{c[0]:.2f}, {c[1]:.2f}]" for w, (x, c) in told.items())
        + f" at {rows[0].low_kmh:.0f} to {rows[0].high_kmh:.0f} km/h"
    )
    fields = {"level": ", ".join(w for w in told if w not in low)}
    return judge("C48.figure", outcome, whole=whole, part=bool(low), value=value, ci95=(ci[0], ci[1]), fields=fields)


def _cloud(evidence: Evidence, found: Slopes, row: SlopeRow, *, is_wet: bool) -> tuple[np.ndarray, np.ndarray]:
    """Slip [%] and traction of the samples behind a slope, corrected for the delay of v_x."""
    late = {d.vehicle: d.value for d in found.table.delays if d.told}
    s, m = [], []
    for info in found.selected.runs:
        samples = evidence.data.samples(info)
        v = samples.array("v_x") / KMH
        here = samples.is_usable & (samples.on_water == (1.0 if is_wet else 0.0))
        if is_wet:
            here &= (v >= row.low_kmh) & (v < row.high_kmh)
        slip = samples.array(f"slip_{row.wheel}")
        if info.about.get("slip_against") == "v_x":
            slip = slip - late_slip(samples, late.get(info.run.vehicle.stem, 0.0)).slip
        mu = samples.array(f"mu_{row.wheel}")
        good = here & np.isfinite(slip + mu) & (np.abs(slip) < 0.05)
        s.append(100.0 * slip[good])
        m.append(mu[good])
    slips, mus = np.concatenate(s), np.concatenate(m)
    every = slice(None, None, max(1, -(-slips.size // _MOST)))
    return slips[every], mus[every]


def _panel_of_wheel(evidence: Evidence, found: Slopes, row: SlopeRow) -> Panel:
    lines = []
    dry = next((d for d in found.table.dry if d.wheel == row.wheel and d.told), None)
    kinds = (("dry", dry, MUTED, "square", False), ("water", row, wheel_colour(row.wheel), "circle", True))
    for name, fit, colour, symbol, is_wet in kinds:
        s, m = _cloud(evidence, found, row, is_wet=is_wet)
        if s.size:
            lines.append(
                Line(f"{name}, samples", s, m, colour=colour, mode="markers", symbol=symbol, size=3.0, opacity=0.5)
            )
        if fit is not None and fit.told and s.size:
            mu = np.array([0.0, float(m.max())])
            slip = 100.0 * (mu / fit.slope + fit.intercept)
            lines.append(Line(f"{name}, slope {fit.slope:.1f}", slip, mu, colour=colour, width=3.0))
    return Panel(f"Traction over slip, {WHEEL_WORDS[row.wheel]}", Axis("slip", "%"), _MU, tuple(lines))


def figure_2_16(number: str, evidence: Evidence) -> Figure:
    """Samples and lines, dry and wet, a panel per driven wheel; C48."""
    found = measured_slopes(number, evidence)
    level = found.levels[0]
    full = full_speed(passes_of(evidence, found.selected.runs))
    v = full - _BELOW if math.isfinite(full) else _DEFAULT
    told = [r for r in found.of(level) if r.told and math.isfinite(r.slope_dry)]
    if not told:
        why = f"needs {needs_of(number)}: no slope, or no dry one, in {found.selected.fixed}"
        raise NotInCampaign(why, where=f"figure {number}")
    best = min({(r.low_kmh, r.high_kmh) for r in told}, key=lambda b: (
        -any(r.reliable for r in told if r.low_kmh == b[0]), abs(0.5 * (b[0] + b[1]) * KMH - v)))  # fmt: skip
    at = [r for r in told if r.low_kmh == best[0]]
    rest = f"full aquaplaning is at {full / KMH:.0f} km/h" if math.isfinite(full) else "full aquaplaning is not reached"
    panels = [_panel_of_wheel(evidence, found, r) for r in at]
    table = Table(
        "Slip slope [-]",
        ("wheel", "dry", "water", "water over dry", "95 %", "runs"),
        tuple(
            (r.wheel, f"{r.slope_dry:.1f}", f"{r.slope:.1f}", f"{r.over_dry[0]:.2f}",
             "{:.2f} to {:.2f}".format(*r.over_dry[1]) if r.reliable else "–", str(r.runs))
            for r in at
        ),
    )  # fmt: skip
    return figure_of(
        number, panels, [_c48(at)], (table,), runs=found.selected.used(), fixed=found.selected.fixed, low=best[0],
        high=best[1], kmh=v / KMH, rest=rest,
    )  # fmt: skip


_SAME = limit("same", "C50.figure")  # of the slope: less is no clear influence
# share of bins with so many runs in which the method gives a slope
_TOLD, _LEAST_RUNS = limit("given", "C49.figure"), limit("least_runs", "C49.figure")
_SLIGHT_RATIO = limit("slight", "C52.figure")  # times: "slightly higher"


def _c49(found: Slopes) -> Check | None:
    rows = [r for x in found.levels for r in found.of(x) if r.runs >= _LEAST_RUNS]
    if not rows:
        return None
    told = len(usable(rows)) / len(rows)
    return judge("C49.figure", f"in {len(usable(rows))} of {len(rows)} bins", whole=told >= _TOLD, value=100 * told)


def _c50(found: Slopes) -> Check | None:
    levels = [x for x in found.levels if usable(found.of(x))]
    effects = {
        w: e for w in found.wheels
        if len(levels) > 1 and (e := ratio(found.of(levels[0], w), found.of(levels[-1], w))) is not None
    }  # fmt: skip
    if not effects:
        return None
    ratios = {w: e[0] for w, e in effects.items()}
    verdicts = [e.mapped(lambda x: x - 1.0).absent(_SAME) for e in ratios.values()]
    reason = TOO_FEW if NEEDS_DATA in verdicts and NOT_REPRODUCED not in verdicts else None
    worst = min(ratios.values(), key=lambda e: e.value)
    outcome = f"{levels[-1].name} over {levels[0].name}: " + "; ".join(f"{w} {e.words(2)}" for w, e in ratios.items())
    verdict = combined(verdicts)
    return judge("C50.figure", outcome, verdict=verdict, value=worst.value, ci95=worst.ci, reason=reason)


def _c51(found: Slopes) -> Check | None:
    falls = {f"{x.name} {w}": e for x in found.levels for w in found.wheels if (e := fall(found.of(x, w))) is not None}
    if not falls:
        return None
    down = [n for n, e in falls.items() if e.value < 0.0]
    sure = sum(e.is_below for e in falls.values())
    least = max(falls.values(), key=lambda e: e.value)
    outcome = (
        f"below 0 in {len(down)} of {len(falls)} curves, with the interval in {sure}; changes "
        f"{min(e.value for e in falls.values()):.0f} to {least.value:.0f} % per 10 km/h; the least one"
    )
    whole, part = len(down) == len(falls), 2 * len(down) >= len(falls) and not any(e.is_above for e in falls.values())
    fields = {"level": ", ".join(n for n in falls if n not in down)}
    return judge("C51.figure", outcome, whole=whole, part=part, value=least.value, ci95=least.ci, fields=fields)


def _c52(found: Slopes) -> Check | None:
    left, right = (next((w for w in found.wheels if w[1] == side), None) for side in "lr")
    if left is None or right is None:
        return None
    both = [
        (a, b) for x in found.levels for a, b in [(found.of(x, left), found.of(x, right))] if usable(a) and usable(b)
    ]
    effects = [e[0] for a, b in both if (e := ratio([replace(r, wheel=left) for r in b], a)) is not None]
    rough = [(uneven(a), uneven(b)) for a, b in both]
    rough = [(a, b) for a, b in rough if a == a and b == b]
    if not effects:
        return None
    higher = [e for e in effects if e.low > 1.0]
    most = [e for e in effects if e.value > 1.0]
    rougher = sum(a > b for a, b in rough)
    mean = sorted(effects, key=lambda e: e.value)[len(effects) // 2]
    is_higher = len(most) == len(effects) and 2 * len(higher) >= len(effects) and mean.value < _SLIGHT_RATIO
    is_rougher = bool(rough) and 2 * rougher > len(rough)
    outcome = (
        "left over right: "
        + "; ".join(e.words(2) for e in effects)
        + f"; left less uniform in {rougher} of {len(rough)}"
    )
    whole, part = is_higher and is_rougher, is_higher or is_rougher
    reason = f"Above 1 at {len(most)} of {len(effects)} levels, significantly above it at {len(higher)}"
    reason += "." if is_rougher else "; the right wheels, on more water, scatter as much."
    reason = "" if whole else reason
    return judge("C52.figure", outcome, whole=whole, part=part, value=mean.value, ci95=mean.ci, reason=reason)


_SLOW_KMH = limit("slow_kmh", "C53.figure")  # "low velocities", far below aquaplaning
_ALIKE = limit("same", "C53.figure")  # of the slope: less is alike


def _c53(found: Slopes) -> Check | None:
    levels = found.levels
    if len(levels) < 2:
        return None
    low, high = found.of(levels[0]), found.of(levels[-1])
    slow, over_all = ratio(low, high, up_to_kmh=_SLOW_KMH), ratio(low, high)
    near = ratio(low, found.of(levels[1])) if len(levels) > 2 else None
    if slow is None or over_all is None:
        return None
    is_less, is_flatter = slow[0].high < 1.0, over_all[1].is_above
    # an interval that holds 1 may be wide: alike is what lies near 1 as a whole
    alike = near is None or (near[0].low >= 1.0 - _ALIKE and near[0].high <= 1.0 + _ALIKE)
    middle = f"; {levels[1].name} over {levels[0].name}: {near[0].words(2)}" if near is not None else ""
    whole = is_less and is_flatter and alike
    lacking = [
        n for n, ok in (("the smaller slope at low speed", is_less), ("the smaller fall", is_flatter),
                        ("low and medium pressure alike", alike)) if not ok
    ]  # fmt: skip
    outcome = (
        f"{levels[-1].name} over {levels[0].name}: {slow[0].words(2)} below {_SLOW_KMH:g} km/h, fall per 10 km/h "
        f"less by {over_all[1].words(1)} %{middle}"
    )
    part = is_less or is_flatter
    fields = {"lacking": ", ".join(lacking)}
    return judge("C53.figure", outcome, whole=whole, part=part, value=slow[0].value, ci95=slow[0].ci, fields=fields)


_NONE = limit("none", "C54.figure")  # [% per 10 km/h] a fall that does not count: a tenth over the speeds driven


def _c54(found: Slopes) -> Check | None:
    rows = []
    for words, worn, new in pairs(found.levels, found.selected.wish):
        for wheel in found.wheels:
            old, deep = fall(found.of(worn, wheel)), fall(found.of(new, wheel))
            if old is not None and deep is not None:
                rows.append((f"{words} {wheel}".strip(), old, deep))
    if not rows:
        return None
    level = [r for r in rows if r[2].low >= -_NONE]
    falling = [r for r in rows if r[1].is_below]
    less = [r for r in rows if r[2].value > r[1].value / 3.0]
    worst = min((r[2] for r in rows), key=lambda e: e.low)
    whole = len(level) == len(rows) and len(falling) == len(rows)
    outcome = "; ".join(f"{n}: worn {a.words(1)}, less worn {b.words(1)} %" for n, a, b in rows)
    part = len(less) == len(rows)
    fields = {"still": len(level), "all": len(rows), "falling": len(falling)}
    is_open = len(falling) == len(rows) and not any(r[2].is_below for r in rows if r not in level)
    verdict, reason = (NEEDS_DATA, TOO_FEW) if is_open and not whole and not part else (None, None)
    return judge(
        "C54.figure", outcome, whole=whole, part=part, verdict=verdict, value=worst.value, ci95=worst.ci,
        reason=reason, fields=fields,
    )  # fmt: skip


_SLIGHT_PERCENT = limit("slight", "C55.figure")  # [%] more is not "slight"


def _effects_of_load_and_pressure(found: Slopes) -> dict[str, Effect]:
    """Relative change of the slope by load and by pressure, which add to one curve over speed. [%]"""
    names, of_level = marks(found.levels, found.selected.wish)
    rows = [(r, m) for x, m in zip(found.levels, of_level, strict=True) for r in usable(found.of(x))]
    if not names or not rows:
        return {}
    v = np.array([r.v_mean for r, _ in rows])
    x = (v - v.mean()) / TEN
    left = np.array([float(r.wheel[1] == "l") for r, _ in rows])
    columns = [np.ones(x.size), x, x * x] + ([left] if 0.0 < left.mean() < 1.0 else [])
    fits = line_of_logs([r for r, _ in rows], columns + [np.array([m[i] for _, m in rows]) for i in range(len(names))])
    return {} if fits is None else {
        n: e.mapped(lambda x: 100.0 * math.expm1(x))
        for n, e in zip(names, fits[len(columns):], strict=True)
    }  # fmt: skip


def _c55(found: Slopes) -> Check | None:
    effects = _effects_of_load_and_pressure(found)
    if not effects:
        return None
    up = [n for n, e in effects.items() if e.is_above]
    slight = all(abs(e.value) < _SLIGHT_PERCENT for e in effects.values())
    name, first = next(iter(effects.items()))
    whole = len(up) == len(effects) and slight
    outcome = "; ".join(f"{n}: {e.words(1)} %" for n, e in effects.items())
    lacking = ", ".join(n for n in effects if n not in up)
    reason = "" if whole else f"Not higher by {lacking}." if lacking else "More than slightly."
    fields, part = {"name": name}, bool(up)
    return judge(
        "C55.figure", outcome, whole=whole, part=part, value=first.value, ci95=first.ci, reason=reason, fields=fields
    )


_OF_FIGURE: Mapping[str, tuple[Callable[[Slopes], Check | None], ...]] = {
    "2.17": (_c49, _c50, _c51, _c52), "2.18": (_c53,), "2.19": (_c54,), "2.20": (_c55,)
}  # fmt: skip
FIGURES = {"2.16": figure_2_16, **dict.fromkeys(_OF_FIGURE, over_speed)}
