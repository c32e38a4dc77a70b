"""Figure 2.10: resistance measure over time, from dry road onto water."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aqualog.campaign.samples import RunInfo
from aqualog.figures.evidence import KMH, Evidence
from aqualog.figures.measures import TEN, lines_through, pool_of, resistance_of
from aqualog.figures.record import Axis, Figure, Finding, Line, Panel, judged
from aqualog.figures.resistance_figure import UNIT
from aqualog.figures.run_panels import TIME, aligned, spread_over, water_of
from aqualog.figures.selection import NotInCampaign, Wish, choose
from aqualog.figures.tyres import VERY_WORN
from aqualog.report.theme import INK, MUTED, THRESHOLD

__all__ = ["make"]

NUMBER = "2.10"
_WISH = Wish((), VERY_WORN, "lowest", 1.3)
_SPEED = 100 * KMH  # [m/s] of the pass that is drawn (K: the thesis gives none)
_THRESHOLD = 0.2  # [m/s^2] thesis 2.2
_SHOWN = (-1.0, 2.0)  # [m/s^2]


def _c37(evidence: Evidence, runs: Sequence[RunInfo]) -> list[Finding]:
    pool = pool_of(evidence, runs, resistance_of())
    if pool is None:
        return []
    v = pool.columns["v_x"]
    level = lines_through(pool, [np.ones(v.size), (v - v.mean()) / TEN])[0]
    if level.ci is None:
        return []
    return [
        Finding(
            "C37",
            "At constant speed the resistance measure rises when the car comes from dry asphalt onto the water.",
            "mean on the water less the run's own mean on the dry road before it, over all passes at constant speed, "
            "at "
            f"their mean speed: interval above 0; in part: above 0 in the mean; {_THRESHOLD:g} {UNIT} is the thesis' "
            "threshold",
            f"{level.words(3)} {UNIT} at {v.mean() / KMH:.0f} km/h",
            judged(whole=level.is_above, part=level.value > 0.0),
            "" if level.is_above else "The scatter from run to run is as large.",
            level.value, level.ci, UNIT,
        )
    ]  # fmt: skip


def make(evidence: Evidence) -> Figure:
    """The measure of one pass over time; C37 over all passes at constant speed of the configuration.

    Raises
    ------
    NotInCampaign
    """
    needs = "a pass at constant speed from dry road onto water, with torque, acceleration and speed"
    selected = choose(
        evidence.data.runs, _WISH, campaign=evidence.name, number=NUMBER, is_of_use=evidence.has_resistance, needs=needs
    )
    constant = [r for r in selected.runs if evidence.of(r).is_constant]
    if not constant:
        raise NotInCampaign(f"needs {needs}: none in {selected.fixed}", where=f"figure {NUMBER}")
    shown = spread_over(constant, evidence, [_SPEED])[0]
    r = evidence.drive(shown)
    part, t = aligned(r)
    raw = r.feature("delta_a_x")[part]
    samples = evidence.data.samples(shown)
    near = (samples.t >= r.t[part][0]) & (samples.t <= r.t[part][-1])
    width = max(1, round(0.5 / samples.step_s))
    mean = np.convolve(np.nan_to_num(samples.array("delta_a_x")), np.ones(width) / width, mode="same")[near]
    lines = (
        Line("as measured", t, raw, colour=MUTED, width=0.8, opacity=0.6),
        Line("mean over 0.5 s", np.round(samples.t[near] - r.entry + 1.0, 4), mean, colour=INK, width=2.2),
        Line(
            "threshold of the thesis",
            np.array([t[0], t[-1]]),
            np.full(2, _THRESHOLD),
            colour=THRESHOLD,
            dash="dot",
            width=1.2,
        ),
    )
    return Figure(
        NUMBER,
        "resistance measure over time, from dry road onto water",
        f"{selected.fixed}. {shown.name}: the pass at constant speed nearest to {_SPEED / KMH:.0f} km/h "
        f"({evidence.of(shown).v / KMH:.0f} km/h). (2.9) as it is, with all that the car's parameters leave of it on "
        "the dry "
        f"road. The claim is judged over all {len(constant)} passes at constant speed.",
        (
            Panel(
                "Resistance measure", TIME, Axis("resistance measure", UNIT, limits=_SHOWN),
                (*lines, water_of(r, *_SHOWN)),
            ),
        ),
        tuple(_c37(evidence, constant)),
        (),
        selected.used({i.index: "drawn, and counted" if i.index == shown.index else
                       "counted" if i in constant else "not at constant speed" for i in selected.runs}),
    )  # fmt: skip
