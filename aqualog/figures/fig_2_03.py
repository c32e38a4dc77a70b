"""Figure 2.3: wheel speeds in passes at several speeds, with minor and full spin-downs of free wheels."""

from __future__ import annotations

import numpy as np

from aqualog.figures.evidence import KMH, Evidence
from aqualog.figures.passes import full_speed, passes_of
from aqualog.figures.record import Figure
from aqualog.figures.run_panels import speed_panels, spread_over
from aqualog.figures.selection import NotInCampaign, Wish, choose
from aqualog.figures.spin_down_claims import at_89, at_118, before_full, rising_number
from aqualog.figures.tyres import WORN

__all__ = ["WISH", "make"]

NUMBER = "2.3"
WISH = Wish((), WORN, "lowest", 1.3)
_BELOW = (29.0, 20.0, 12.0, 0.0)  # [km/h] below full aquaplaning: the thesis' 89, 98, 106 and 118 km/h


def make(evidence: Evidence) -> Figure:
    """Four passes at constant speed over time; C14 to C17 over all passes of the configuration.

    Raises
    ------
    NotInCampaign
    """
    needs = "two passes at constant speed over water in one configuration"
    selected = choose(
        evidence.data.runs, WISH, campaign=evidence.name, number=NUMBER, is_of_use=evidence.has_water, needs=needs
    )
    found = passes_of(evidence, selected.runs)
    constant = [p.info for p in found if evidence.of(p.info).is_constant]
    if len(constant) < 2:
        raise NotInCampaign(f"needs {needs}: {len(constant)} in {selected.fixed}", where=f"figure {NUMBER}")
    v_full = full_speed(found)
    top = v_full if np.isfinite(v_full) else max(p.v_mean for p in found)
    shown = spread_over(constant, evidence, [top - b * KMH for b in _BELOW])
    what = "the speed at which half of the passes have a full spin-down" if np.isfinite(v_full) else "the fastest pass"
    words = {r.index: "drawn, and counted" for r in shown}
    claims = [*rising_number(found), *before_full(found)]
    if selected.is_thesis:
        claims = [*at_89(found), *claims, *at_118(evidence, found)]
    return Figure(
        NUMBER,
        "wheel speeds in passes over water, free wheels spin down",
        f"{selected.fixed}. Shown are the passes at constant speed nearest to {', '.join(f'{b:g}' for b in _BELOW)} "
        "km/h "
        f"below {top / KMH:.0f} km/h, {what}; the water begins at 1 s; each panel has its own scale. "
        "Claims are judged over all passes.",
        tuple(speed_panels(evidence, shown)),
        tuple(sorted(claims, key=lambda c: c.claim)),
        (),
        selected.used({r.index: words.get(r.index, "counted") for r in selected.runs}),
    )
