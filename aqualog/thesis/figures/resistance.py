"""Figures 2.10 to 2.15: the resistance measure over time, and over speed by depth, tyre, pressure and load."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from aqualog.campaign.bins import Pool
from aqualog.campaign.results import RunInfo
from aqualog.report.theme import INK, MUTED, THRESHOLD
from aqualog.thesis.catalogue import figure_of, needs_of
from aqualog.thesis.claims import NEEDS_DATA, NOT_REPRODUCED, REPRODUCED, Check, Verdict, combined, judge, limit
from aqualog.thesis.evidence import measures
from aqualog.thesis.evidence.campaign import KMH, Evidence
from aqualog.thesis.evidence.selection import Level, NotInCampaign, Selected, depth_mm, marks, pairs
from aqualog.thesis.figures.panels import ALIGNED, V_KMH, Window, means_line, means_table, shifts, spread_over, styles
from aqualog.thesis.record import Axis, Figure, Line, Panel

__all__ = ["FIGURES"]

_HALF = limit("half", "C43.figure")  # [m/s^2] half of the 0.2 that the thesis takes for a threshold: no influence
THRESHOLD_A = 0.2  # [m/s^2] thesis 2.2
UNIT = "m/s^2"
PER_TEN = "m/s^2 per 10 km/h"
_MEASURE = Axis("mean resistance measure", UNIT)


@dataclass(frozen=True, slots=True)
class Resistance:
    """A selection with the pool of samples of each level, by name; levels without samples are not in it."""

    selected: Selected
    pools: Mapping[str, Pool]

    @property
    def levels(self) -> tuple[Level, ...]:
        """Levels that have samples."""
        return tuple(x for x in self.selected.levels if x.name in self.pools)

    def difference(self, a: Level, b: Level) -> tuple[measures.Effect, measures.Effect] | None:
        """Level and gradient of b less those of a."""
        return measures.difference(self.pools[a.name], self.pools[b.name])


def measured(number: str, evidence: Evidence) -> Resistance:
    """Choose runs and take their samples."""
    selected = evidence.choose(number, evidence.has_resistance)
    columns = measures.resistance_of()
    pools = {x.name: pool for x in selected.levels if (pool := measures.pool_of(evidence, x.runs, columns)) is not None}
    return Resistance(selected, pools)


def rising(found: Resistance) -> Check | None:
    """C39: the measure rises with speed, at every level."""
    slopes = {x.name: measures.trend(found.pools[x.name]) for x in found.levels}
    told = {n: e for n, e in slopes.items() if e.ci is not None}
    if not told:
        return None
    least = min(told.values(), key=lambda e: e.low)
    up = [n for n, e in told.items() if e.is_above]
    whole = len(up) == len(told)
    flat = ", ".join(f"{n}: {e.words(3)}" for n, e in told.items() if not e.is_above)
    outcome = (
        f"above 0 at {len(up)} of {len(told)} levels; gradients {min(e.value for e in told.values()):.3f} to "
        f"{max(e.value for e in told.values()):.3f} {PER_TEN}; the least certain one"
    )
    part = 2 * len(up) >= len(told) and not any(e.is_below for e in told.values())
    return judge("C39.figure", outcome, whole=whole, part=part, value=least.value, ci95=least.ci, fields={"flat": flat})


def over_speed(number: str, evidence: Evidence) -> Figure:
    """Means over speed, level by level, with C39 and the figure's own claims."""
    found = measured(number, evidence)
    means = {x.name: measures.bin_means(found.pools[x.name]) for x in found.levels}
    style, shift = styles(found.selected), shifts(found.levels)
    lines = [means_line(x.name, means[x.name], style[x.name], shift=shift[x.name]) for x in found.levels]
    panel = Panel("Resistance measure over speed", V_KMH, _MEASURE, (*lines, _threshold(lines)))
    tables = (means_table(f"Resistance measure [{UNIT}]", means, 3),)
    checks = [judged(found) for judged in (*_OF_FIGURE[number], rising)]
    used, fixed = found.selected.used(), found.selected.fixed
    return figure_of(number, (panel,), checks, tables, runs=used, fixed=fixed)


def _threshold(lines: Sequence[Line]) -> Line:
    x = np.concatenate([line.x for line in lines])
    ends = np.array([x.min(), x.max()])
    return Line("threshold of the thesis", ends, np.full(2, THRESHOLD_A), colour=THRESHOLD, dash="dot", width=1.2)


_MUCH = limit("much", "C42.figure")  # of the worn tyre's resistance that is left, for "(much) lower"


def _treads(found: Resistance) -> list[tuple[str, str, measures.Effect, measures.Effect, float]]:
    """Water, both tyres, new less worn in level and gradient, and level over the worn tyre's, where both ran."""
    rows = []
    for words, worn, new in pairs(found.levels, found.selected.wish):
        effect, both = found.difference(worn, new), measures.common(found.pools[worn.name], found.pools[new.name])
        if effect is not None and both is not None:
            old, deep = (float(np.mean(p.columns["y"])) for p in both)
            names = f"{new.name.split(',')[0]} less {worn.name.split(',')[0]}"
            rows.append((words or "all", names, *effect, deep / old if old > 0.0 else float("nan")))
    return rows


def treads_differ(claim: str, found: Resistance) -> Check | None:
    """C40 and C41: the less worn tyre's level is the lower, in all waters in which both ran."""
    rows = _treads(found)
    if not rows:
        return None
    low = [r for r in rows if r[2].is_below]
    worst = max((r[2] for r in rows), key=lambda e: e.high)
    outcome = f"{rows[0][1]}: " + "; ".join(f"{w}: level {a.words()} {UNIT}" for w, _, a, _, _ in rows)
    whole = len(low) == len(rows)
    return judge(f"{claim}.figure", outcome, whole=whole, part=bool(low), value=worst.value, ci95=worst.ci)


def _c42(found: Resistance) -> Check | None:
    rows = _treads(found)
    if not rows:
        return None
    low = [r for r in rows if r[2].is_below]
    both_low = [r for r in low if r[3].is_below]
    much = [r for r in rows if r[4] <= _MUCH]
    steep = max((r[3] for r in rows), key=lambda e: e.high)
    outcome = f"{rows[0][1]}: " + "; ".join(
        f"{w}: gradient {b.words()} {PER_TEN}, level {100 * share:.0f} % of the worn tyre's"
        for w, _, _, b, share in rows
    )
    whole = len(both_low) == len(much) == len(rows)
    fields = {"lower": len(both_low), "all": len(rows), "at_most": len(much)}
    part = len(low) == len(rows)
    return judge("C42.figure", outcome, whole=whole, part=part, value=steep.value, ci95=steep.ci, fields=fields)


_SPEED = 100 * KMH  # [m/s] of the pass that is drawn (K: the thesis gives none)
_THRESHOLD = limit("threshold", "C37.figure")  # [m/s^2] thesis 2.2
_SHOWN = (-1.0, 2.0)  # [m/s^2]


def _c37(evidence: Evidence, runs: Sequence[RunInfo]) -> Check | None:
    pool = measures.pool_of(evidence, runs, measures.resistance_of())
    if pool is None:
        return None
    v = pool.columns["v_x"]
    level = measures.lines_through(pool, [np.ones(v.size), (v - v.mean()) / measures.TEN])[0]
    if level.ci is None:
        return None
    outcome = f"{level.words(3)} {UNIT} at {v.mean() / KMH:.0f} km/h"
    return judge("C37.figure", outcome, whole=level.is_above, part=level.value > 0.0, value=level.value, ci95=level.ci)


def figure_2_10(number: str, evidence: Evidence) -> Figure:
    """The measure of one pass over time; C37 over all passes at constant speed of the configuration."""
    selected = evidence.choose(number, evidence.has_resistance)
    constant = [r for r in selected.runs if evidence.of(r).is_constant]
    if not constant:
        raise NotInCampaign(f"needs {needs_of(number)}: none in {selected.fixed}", where=f"figure {number}")
    shown = spread_over(constant, evidence, [_SPEED])[0]
    r = evidence.drive(shown)
    window = Window.aligned(r)
    ends = r.t[window.part][[0, -1]]
    samples = evidence.data.samples(shown)
    near = (samples.t >= ends[0]) & (samples.t <= ends[1])
    width = max(1, round(0.5 / samples.step_s))
    mean = np.convolve(np.nan_to_num(samples.array("delta_a_x")), np.ones(width) / width, mode="same")[near]
    lines = (
        Line("as measured", window.t, r.feature("delta_a_x")[window.part], colour=MUTED, width=0.8, opacity=0.6),
        Line("mean over 0.5 s", np.round(samples.t[near] - r.entry + 1.0, 4), mean, colour=INK, width=2.2),
        Line("threshold of the thesis", window.t[[0, -1]], np.full(2, _THRESHOLD), colour=THRESHOLD, dash="dot",
             width=1.2),
        window.water(*_SHOWN),
    )  # fmt: skip
    axis = Axis("resistance measure", UNIT, limits=_SHOWN)
    shown_as = {i.index: "counted" if i in constant else "not at constant speed" for i in selected.runs}
    return figure_of(
        number, (Panel("Resistance measure", ALIGNED, axis, lines),), [_c37(evidence, constant)],
        runs=selected.used(shown_as | {shown.index: "drawn, and counted"}), fixed=selected.fixed, run=shown.name,
        kmh=evidence.of(shown).v / KMH, passes=len(constant),
    )  # fmt: skip


_SHALLOW, _DEEP = 1.35, limit("deep", "C38.figure")  # [mm] up to, and from
# [m/s^2], [m/s^2 per 10 km/h]: a quarter of the threshold of 0.2, and a tenth, matter
_LEVEL, _GRADIENT = limit("level", "C38.figure"), limit("gradient", "C38.figure")


def _c38(found: Resistance) -> Check | None:
    known = sorted(
        ((d, x.name, x) for x in found.levels if (d := depth_mm(x, found.selected.wish)) is not None and d > 0.0),
        key=lambda m: m[:2],
    )
    shallow: list[Level] = [x for d, _, x in known if d <= _SHALLOW]
    deep: list[Level] = [x for d, _, x in known if d >= _DEEP]
    if not shallow or not deep:
        return None
    rise = found.difference(shallow[-1], deep[-1])
    flat = found.difference(shallow[0], shallow[-1]) if len(shallow) > 1 else None
    if rise is None or (len(shallow) > 1 and flat is None):
        return None
    is_risen = rise[0].is_above and rise[1].is_above
    risen = REPRODUCED if is_risen else NOT_REPRODUCED if rise[0].ci else NEEDS_DATA
    flats = [e.absent(most) for e, most in zip(flat or (), (_LEVEL, _GRADIENT), strict=False)]
    flatness = NOT_REPRODUCED if NOT_REPRODUCED in flats else NEEDS_DATA if NEEDS_DATA in flats else REPRODUCED
    words = (
        f"{shallow[-1].name} to {deep[-1].name}: level {rise[0].words()} {UNIT}, gradient {rise[1].words()} {PER_TEN}"
    )
    if flat is not None:
        words = (
            f"{shallow[0].name} to {shallow[-1].name}: level {flat[0].words()} {UNIT}, gradient {flat[1].words()} "
            f"{PER_TEN}; {words}"
        )
    verdict = combined((flatness, risen))
    fields = {"why": _reason(flats, rise)}
    return judge("C38.figure", words, verdict=verdict, value=rise[0].value, ci95=rise[0].ci, fields=fields)


_SHALLOW_WORDS = {
    NOT_REPRODUCED: "the {} changes already within the shallow waters",
    NEEDS_DATA: "the runs are too few to say that the {} stays within the shallow waters",
}


def _reason(flats: Sequence[Verdict], rise: tuple[measures.Effect, measures.Effect]) -> str:
    names = ("level", "gradient")
    words = [_SHALLOW_WORDS[v].format(n) for n, v in zip(names, flats, strict=False) if v in _SHALLOW_WORDS]
    words += [
        f"the {n} in deep water does not differ significantly"
        for n, e in zip(names, rise, strict=True)
        if not e.is_above
    ]
    return (", ".join(words) + ".").capitalize()


def _c43(found: Resistance) -> Check | None:
    low, high = found.levels[0], found.levels[-1]
    effect = found.difference(low, high) if low is not high else None
    if effect is None:
        return None
    level = effect[0]
    verdict = level.absent(_HALF)
    outcome = f"{high.name} less {low.name}: level {level.words()} {UNIT}"
    reason = measures.TOO_FEW if verdict == NEEDS_DATA else None
    return judge("C43.figure", outcome, verdict=verdict, value=level.value, ci95=level.ci, reason=reason)


def _c45(found: Resistance) -> Check | None:
    names, rows = marks(found.levels, found.selected.wish)
    if not names:
        return None
    effects = dict(zip(names, measures.additive([found.pools[x.name] for x in found.levels], rows), strict=True))
    down = [n for n, e in effects.items() if e.is_below]
    whole = len(down) == len(effects)
    first = effects[names[0]]
    outcome = "; ".join(f"{n}: {e.words()} {UNIT}" for n, e in effects.items())
    fields = {"first": names[0], "others": ", ".join(n for n in effects if n not in down)}
    return judge("C45.figure", outcome, whole=whole, part=bool(down), value=first.value, ci95=first.ci, fields=fields)


_OF_FIGURE: Mapping[str, tuple[Callable[[Resistance], Check | None], ...]] = {
    "2.11": (_c38,), "2.12": (partial(treads_differ, "C40"), _c42), "2.13": (partial(treads_differ, "C41"), _c42),
    "2.14": (_c43,), "2.15": (_c45,),
}  # fmt: skip
FIGURES = {"2.10": figure_2_10, **dict.fromkeys(_OF_FIGURE, over_speed)}
