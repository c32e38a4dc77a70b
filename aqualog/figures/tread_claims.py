"""Influence of deeper tread on the resistance: common claims of Figures 2.12 and 2.13."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aqualog.figures.measures import Effect, common
from aqualog.figures.record import Finding, judged
from aqualog.figures.resistance_figure import PER_TEN, UNIT, Resistance
from aqualog.figures.tyres import pairs

__all__ = ["tread_claims"]

_MUCH = 0.5  # of the worn tyre's resistance that is left, for "(much) lower"


def tread_claims(found: Resistance, claim: str) -> Sequence[Finding]:
    """The figure's own claim, and C42, over all waters in which both tyres ran."""
    rows: list[tuple[str, str, str, Effect, Effect, float]] = []
    for words, worn, new in pairs(found.levels, found.selected.wish):
        effect, both = found.difference(worn, new), common(found.pools[worn.name], found.pools[new.name])
        if effect is not None and both is not None:
            old, deep = (float(np.mean(p.columns["y"])) for p in both)
            rows.append((words, worn.name, new.name, *effect, deep / old if old > 0.0 else float("nan")))
    if not rows:
        return ()
    low = [r for r in rows if r[3].is_below]
    both_low = [r for r in rows if r[3].is_below and r[4].is_below]
    much = [r for r in rows if r[5] <= _MUCH]
    worst = max(rows, key=lambda r: r[3].high)
    steep = max(rows, key=lambda r: r[4].high)
    names = f"{rows[0][2].split(',')[0]} less {rows[0][1].split(',')[0]}"
    told = "; ".join(f"{w or 'all'}: level {a.words()} {UNIT}" for w, _, _, a, _, _ in rows)
    gradients = "; ".join(
        f"{w or 'all'}: gradient {b.words()} {PER_TEN}, level {100 * share:.0f} % of the worn tyre's"
        for w, _, _, _, b, share in rows
    )
    whole = len(both_low) == len(rows) and len(much) == len(rows)
    return (
        Finding(
            claim,
            "Worn summer tyres against new ones in two water depths: two bundles of curves, the new tyres' the lower.",
            "the interval of the difference of the levels is below 0 in every depth in which both ran; in part: in one",
            f"{names}: {told}",
            judged(whole=len(low) == len(rows), part=bool(low)),
            "" if len(low) == len(rows) else
            "Too few runs, or too little water, to distinguish the tyres in the others.",
            worst[3].value, worst[3].ci, UNIT,
        ),
        Finding(
            "C42",
            "New or deep treads: a (much) lower rise and gradient of the resistance than worn summer tyres.",
            f"in every depth the intervals of the differences of level and gradient are below 0, and the level is at "
            f"most {_MUCH:.0%} of the worn tyre's; in part: the levels' intervals are; value: the gradient's "
            "difference",
            f"{names}: {gradients}",
            judged(whole=whole, part=len(low) == len(rows)),
            "" if whole else f"Gradient lower in {len(both_low)} of {len(rows)} depths, level at most {_MUCH:.0%} in "
            f"{len(much)}.",
            steep[4].value, steep[4].ci, PER_TEN,
        ),
    )  # fmt: skip
