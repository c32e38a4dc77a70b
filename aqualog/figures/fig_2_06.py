"""Figure 2.6: slip of the driven wheels on the water over speed."""

from __future__ import annotations

from aqualog.figures.evidence import Evidence
from aqualog.figures.levels import V_KMH
from aqualog.figures.record import Axis, Figure, Panel
from aqualog.figures.selection import NotInCampaign
from aqualog.figures.slip_clouds import clouds
from aqualog.figures.spin_up_claims import chosen_spin_ups, far_below, irregular

__all__ = ["make"]

NUMBER = "2.6"


def make(evidence: Evidence) -> Figure:
    """Clouds of slips of the driven wheels; C20 and C21.

    Raises
    ------
    NotInCampaign
    """
    selected, spun = chosen_spin_ups(evidence, NUMBER)
    lines = clouds(evidence, selected.runs, "slip_max", selected.runs[0].vehicle.driven)
    if not lines:
        raise NotInCampaign("needs wheel speeds and the car's speed on water: no slip in any pass", where="figure 2.6")
    return Figure(
        NUMBER,
        "slip of the driven wheels on water over speed",
        f"{selected.fixed}. Each point is the greatest slip, rim against car, within 0.1 s on the water: 100 % turns "
        "twice "
        f"as fast as it rolls. {len(spun)} of {len(selected.runs)} passes spin up.",
        (Panel("Slip of the driven wheels", V_KMH, Axis("slip", "%"), tuple(lines)),),
        (*far_below(evidence, selected.runs), *irregular(evidence, selected.runs)),
        (),
        selected.used({r.index: "with spin-up" if r in spun else "without spin-up" for r in selected.runs}),
    )
