"""Figure 2.7: traction coefficient of driven wheels in spin-ups over speed."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from aqualog.campaign.bins import Plan
from aqualog.campaign.samples import RunInfo
from aqualog.campaign.spin_ups import spin_ups
from aqualog.figures.evidence import Evidence
from aqualog.figures.levels import V_KMH, means_line, means_table
from aqualog.figures.measures import bin_means
from aqualog.figures.record import Axis, Figure, Line, Panel
from aqualog.figures.scene_panels import WHEEL_WORDS
from aqualog.figures.selection import NotInCampaign
from aqualog.figures.spin_up_claims import chosen_spin_ups, falling_traction, sides_differ, spin_up_pool
from aqualog.report.theme import wheel_colour

__all__ = ["make"]

NUMBER = "2.7"
_MU = Axis("traction coefficient")


def _lower_bound(evidence: Evidence, spun: Sequence[RunInfo]) -> list[Line]:
    """Means of the traction that is left to push the car."""
    rows = [r for r in spin_ups(evidence.part(spun), Plan(()), residual=True) if math.isfinite(r.value)]
    lines = []
    for i, wheel in enumerate(dict.fromkeys(r.place for r in rows)):
        of = [r for r in rows if r.place == wheel]
        v = np.array([0.5 * (r.low_kmh + r.high_kmh) + 0.4 * (2 * i - 1) for r in of])
        low, high = (np.array([r.ci[k] for r in of]) for k in (0, 1))
        lines.append(
            Line(WHEEL_WORDS[wheel], v, np.array([r.value for r in of]), low=low, high=high, colour=wheel_colour(wheel),
                 width=1.6, mode="lines+markers")
        )  # fmt: skip
    return lines


def make(evidence: Evidence) -> Figure:
    """Mean traction coefficient per bin of speed and wheel; C22 and C23.

    Raises
    ------
    NotInCampaign
    """
    selected, spun = chosen_spin_ups(evidence, NUMBER)
    wheels = selected.runs[0].vehicle.driven
    pools = {w: p for w in wheels if (p := spin_up_pool(evidence, spun, w)) is not None}
    means = {w: m for w, p in pools.items() if (m := bin_means(p)).v_kmh.size}
    if not means:
        raise NotInCampaign(
            "needs the torque of the driven wheels in spin-ups on water: no traction in any", where="figure 2.7"
        )  # fmt: skip
    lines = [
        means_line(WHEEL_WORDS[w], m, (wheel_colour(w), "solid", "circle"), shift=0.4 * (2 * i - 1))
        for i, (w, m) in enumerate(means.items())
    ]
    low = tuple(_lower_bound(evidence, spun))
    return Figure(
        NUMBER,
        "traction coefficient of driven wheels in spin-ups over speed",
        f"{selected.fixed}. Mean while the rim is faster than the car by 5 % on the water, bins of 10 km/h; bars: 95 % "
        "intervals with the run as the unit, missing with fewer than three runs. The torque is "
        "corrected for the wheel's own acceleration.",
        (
            Panel("Traction coefficient in spin-ups, from the torque", V_KMH, _MU, tuple(lines)),
            *([Panel("Less the water's share of the torque (lower bound)", V_KMH, _MU, low)] if low else []),
        ),
        (*falling_traction(pools), *sides_differ(pools)),
        (means_table("Traction coefficient [-]", {WHEEL_WORDS[w]: m for w, m in means.items()}, 4),),
        selected.used({r.index: "with spin-up" if r in spun else "without spin-up" for r in selected.runs}),
    )
