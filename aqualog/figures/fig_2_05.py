"""Figure 2.5: wheel speeds in passes at several speeds in which driven wheels spin up."""

from __future__ import annotations

import numpy as np

from aqualog.figures.evidence import KMH, Evidence
from aqualog.figures.record import Figure
from aqualog.figures.run_panels import speed_panels, spread_over
from aqualog.figures.spin_up_claims import chosen_spin_ups, far_below, irregular

__all__ = ["make"]

NUMBER = "2.5"
_PANELS = 4


def make(evidence: Evidence) -> Figure:
    """Four passes with spin-ups over time; C20 and C21 over all passes of the configuration.

    Raises
    ------
    NotInCampaign
    """
    selected, spun = chosen_spin_ups(evidence, NUMBER)
    v = [evidence.of(r).v for r in spun]
    shown = spread_over(spun, evidence, list(np.linspace(min(v), max(v), _PANELS)))
    drawn = {r.index for r in shown}
    return Figure(
        NUMBER,
        "wheel speeds in passes over water, driven wheels spin up",
        f"{selected.fixed}. Shown are passes with a spin-up at speeds spread from the slowest, {min(v) / KMH:.0f} "
        "km/h, to "
        f"the fastest, {max(v) / KMH:.0f} km/h; the water begins at 1 s. Claims are judged over all passes.",
        tuple(speed_panels(evidence, shown)),
        (*far_below(evidence, selected.runs), *irregular(evidence, selected.runs)),
        (),
        selected.used({r.index: "drawn, and counted" if r.index in drawn else "counted" for r in selected.runs}),
    )
