"""Figure 2.15: resistance measure over speed by tyre pressure and load."""

from __future__ import annotations

from collections.abc import Sequence

from aqualog.figures.evidence import Evidence
from aqualog.figures.measures import additive
from aqualog.figures.record import Figure, Finding, judged
from aqualog.figures.resistance_figure import UNIT, Resistance, resistance_figure
from aqualog.figures.selection import Wish, marks
from aqualog.figures.tyres import WORN

__all__ = ["make"]

NUMBER = "2.15"
_WISH = Wish(("pressure", "load"), (*WORN, "very_worn"), depth_mm=1.2, any_one=True, only_lowest_pressures=2)


def _c45(found: Resistance) -> Sequence[Finding]:
    names, rows = marks(found.levels, found.selected.wish)
    if not names:
        return ()
    effects = dict(zip(names, additive([found.pools[x.name] for x in found.levels], rows), strict=True))
    down = [n for n, e in effects.items() if e.is_below]
    whole = len(down) == len(effects)
    first = effects[names[0]]
    return (
        Finding(
            "C45",
            "Additional load, in front or at the rear, and pressure lower the resistance measure.",
            "one line over speed for all, to which load and pressure each add: the intervals of both contributions are "
            "below "
            f"0; in part: one of them; value: {names[0]}",
            "; ".join(f"{n}: {e.words()} {UNIT}" for n, e in effects.items()),
            judged(whole=whole, part=bool(down)),
            "" if whole else "Not lower by " + ", ".join(n for n in effects if n not in down) + ".",
            first.value, first.ci, UNIT,
        ),
    )  # fmt: skip


def make(evidence: Evidence) -> Figure:
    """Means over speed by pressure and load; C45 and C39."""
    return resistance_figure(
        evidence, NUMBER, "resistance measure over speed by tyre pressure and load", _WISH,
        "runs with two loads or at two tyre pressures, else alike, on water, with torque, acceleration and speed", _c45,
    )  # fmt: skip
