"""Mean resistance measure over speed, level by level: common parts of Figures 2.11 to 2.15."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aqualog.campaign.bins import Pool
from aqualog.figures.evidence import Evidence
from aqualog.figures.levels import V_KMH, means_line, means_table, shifts, styles
from aqualog.figures.measures import Effect, bin_means, difference, pool_of, resistance_of, trend
from aqualog.figures.record import Axis, Figure, Finding, Line, Panel, judged
from aqualog.figures.selection import Level, Selected, Wish, choose
from aqualog.report.theme import THRESHOLD

__all__ = ["HALF", "PER_TEN", "UNIT", "Resistance", "measured", "resistance_figure", "rising"]

HALF = 0.1  # [m/s^2] half of the 0.2 m/s^2 that the thesis takes for a threshold: less is no influence
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

    def difference(self, a: Level, b: Level) -> tuple[Effect, Effect] | None:
        """Level and gradient of b less those of a."""
        return difference(self.pools[a.name], self.pools[b.name])


def measured(evidence: Evidence, wish: Wish, number: str, needs: str) -> Resistance:
    """Choose runs and take their samples.

    Raises
    ------
    NotInCampaign
    """
    selected = choose(
        evidence.data.runs, wish, campaign=evidence.name, number=number, is_of_use=evidence.has_resistance, needs=needs
    )
    columns = resistance_of()
    pools = {x.name: pool for x in selected.levels if (pool := pool_of(evidence, x.runs, columns)) is not None}
    return Resistance(selected, pools)


def rising(found: Resistance) -> list[Finding]:
    """C39: the measure rises with speed, at every level."""
    slopes = {x.name: trend(found.pools[x.name]) for x in found.levels}
    told = {n: e for n, e in slopes.items() if e.ci is not None}
    if not told:
        return []
    least = min(told.values(), key=lambda e: e.low)
    up = [n for n, e in told.items() if e.is_above]
    whole = len(up) == len(told)
    flat = ", ".join(f"{n}: {e.words(3)}" for n, e in told.items() if not e.is_above)
    return [
        Finding(
            "C39",
            "For all tyres and parameters the resistance measure rises with speed.",
            "the interval of the gradient is above 0 at every level shown; in part: at half of them, and no gradient's "
            "interval below 0",
            f"above 0 at {len(up)} of {len(told)} levels; gradients {min(e.value for e in told.values()):.3f} to "
            f"{max(e.value for e in told.values()):.3f} {PER_TEN}; the least certain one",
            judged(whole=whole, part=2 * len(up) >= len(told) and not any(e.is_below for e in told.values())),
            "" if whole else f"No clear difference from 0: {flat}.",
            least.value, least.ci, PER_TEN,
        )
    ]  # fmt: skip


def resistance_figure(
    evidence: Evidence,
    number: str,
    title: str,
    wish: Wish,
    needs: str,
    claims: Callable[[Resistance], Sequence[Finding]],
) -> Figure:
    """Figure of means over speed with C39 and the figure's own claims.

    Raises
    ------
    NotInCampaign
    """
    found = measured(evidence, wish, number, needs)
    means = {x.name: bin_means(found.pools[x.name]) for x in found.levels}
    style, shift = styles(found.selected), shifts(found.levels)
    lines = [means_line(x.name, means[x.name], style[x.name], shift=shift[x.name]) for x in found.levels]
    return Figure(
        number,
        title,
        f"{found.selected.fixed}. Mean of (2.9) on the water less the run's own mean on the dry road before it, in "
        "bins "
        f"of 10 km/h; bars are 95 % intervals with the run as the unit, missing where fewer than three runs passed. "
        f"Straight driving without brakes.",
        (Panel("Resistance measure over speed", V_KMH, _MEASURE, (*lines, _threshold(lines))),),
        (*claims(found), *rising(found)),
        (means_table(f"Resistance measure [{UNIT}]", means, 3),),
        found.selected.used(),
    )


def _threshold(lines: Sequence[Line]) -> Line:
    x = np.concatenate([line.x for line in lines])
    ends = np.array([x.min(), x.max()])
    return Line("threshold of the thesis", ends, np.full(2, THRESHOLD_A), colour=THRESHOLD, dash="dot", width=1.2)
