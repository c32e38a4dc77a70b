"""Figure 2.4: slip of the free wheels on the water over speed."""

from __future__ import annotations

from aqualog.figures.evidence import Evidence, free_wheels
from aqualog.figures.fig_2_03 import WISH
from aqualog.figures.levels import V_KMH
from aqualog.figures.passes import passes_of
from aqualog.figures.record import Axis, Figure, Finding, Panel
from aqualog.figures.selection import NotInCampaign, Selected, choose, label, value_of
from aqualog.figures.slip_clouds import clouds
from aqualog.figures.spin_down_claims import before_full, exponential, new_tread
from aqualog.figures.tyres import is_winter, wear_rank

__all__ = ["make"]

NUMBER = "2.4"


def _deep(evidence: Evidence, selected: Selected) -> list[Finding]:
    """C19 over the passes of winter tyres that are less worn than the tyres shown."""
    shown = wear_rank(value_of(selected.runs[0], "tyre"))
    runs = [
        r for r in evidence.data.done
        if not evidence.has_water(r) and is_winter(tyre := value_of(r, "tyre")) and shown is not None
        and (rank := wear_rank(tyre)) is not None and rank > shown
    ]  # fmt: skip
    if not runs:
        return []
    return new_tread(passes_of(evidence, runs), label("tyre", value_of(runs[0], "tyre")))


def make(evidence: Evidence) -> Figure:
    """Clouds of slips of the free wheels; C17 to C19.

    Raises
    ------
    NotInCampaign
    """
    selected = choose(
        evidence.data.runs, WISH, campaign=evidence.name, number=NUMBER, is_of_use=evidence.has_water,
        needs="passes over water with speed and wheel speeds",
    )  # fmt: skip
    lines = clouds(evidence, selected.runs, "slip_min", free_wheels(selected.runs[0]))
    if not lines:
        raise NotInCampaign("needs wheel speeds and the car's speed on water: no slip in any pass", where="figure 2.4")
    found = passes_of(evidence, selected.runs)
    return Figure(
        NUMBER,
        "slip of the free wheels on water over speed",
        f"{selected.fixed}. Each point is the least slip, rim against car, within 0.1 s on the water: 0 rolls, -100 "
        "% stands "
        f"still. A cloud of many points shows every so many of them.",
        (Panel("Slip of the free wheels", V_KMH, Axis("slip", "%"), tuple(lines)),),
        (*before_full(found), *exponential(found), *_deep(evidence, selected)),
        (),
        selected.used(),
    )
