"""Figure 2.14: resistance measure over speed for several tyre pressures."""

from __future__ import annotations

from collections.abc import Sequence

from aqualog.figures.evidence import Evidence
from aqualog.figures.record import Figure, Finding, judged
from aqualog.figures.resistance_figure import HALF, UNIT, Resistance, resistance_figure
from aqualog.figures.selection import Wish
from aqualog.figures.tyres import WORN

__all__ = ["make"]

NUMBER = "2.14"
_WISH = Wish(("pressure",), (*WORN, "very_worn"), depth_mm=1.3)


def _c43(found: Resistance) -> Sequence[Finding]:
    low, high = found.levels[0], found.levels[-1]
    effect = found.difference(low, high) if low is not high else None
    if effect is None:
        return ()
    level = effect[0]
    whole = level.is_within(HALF)
    return (
        Finding(
            "C43",
            "In 1.3 mm the pressure has no significant influence on the resistance, although it has on the speed of "
            "aquaplaning.",
            f"the interval of the level at the highest less that at the lowest pressure stays within {HALF:g} {UNIT}, "
            "half of the thesis' threshold; in part: it holds 0",
            f"{high.name} less {low.name}: level {level.words()} {UNIT}",
            judged(whole=whole, part=level.low <= 0.0 <= level.high),
            "" if whole else "A higher pressure lifts the wheel later, and the water under it takes less.",
            level.value, level.ci, UNIT,
        ),
    )  # fmt: skip


def make(evidence: Evidence) -> Figure:
    """Means over speed by pressure; C43 and C39."""
    return resistance_figure(
        evidence, NUMBER, "resistance measure over speed by tyre pressure", _WISH,
        "runs at two tyre pressures, else alike, on water, with torque, acceleration and speed", _c43,
    )  # fmt: skip
