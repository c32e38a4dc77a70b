"""Figure 2.13: resistance measure over speed, worn summer against new winter tyres."""

from __future__ import annotations

from aqualog.figures.evidence import Evidence
from aqualog.figures.record import Figure
from aqualog.figures.resistance_figure import resistance_figure
from aqualog.figures.selection import Wish
from aqualog.figures.tread_claims import tread_claims
from aqualog.figures.tyres import VERY_WORN

__all__ = ["make"]

NUMBER = "2.13"
_WISH = Wish(("tyre", "depth"), only_tyres=(VERY_WORN, ("new_winter",)))


def make(evidence: Evidence) -> Figure:
    """Means over speed by tyre and water depth; C41, C42 and C39."""
    return resistance_figure(
        evidence, NUMBER, "resistance measure over speed, worn summer and new winter tyres", _WISH,
        "runs with two tyres in the same water, with torque, acceleration and speed",
        lambda found: tread_claims(found, "C41"),
    )  # fmt: skip
