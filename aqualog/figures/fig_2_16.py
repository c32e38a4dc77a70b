"""Figure 2.16: traction over slip of driven wheels on dry and on water-covered road."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from aqualog.campaign.bins import KMH
from aqualog.campaign.slip_slope import SlopeRow
from aqualog.figures.evidence import Evidence
from aqualog.figures.passes import full_speed, passes_of
from aqualog.figures.record import Axis, Figure, Finding, Line, Panel, Table, judged
from aqualog.figures.scene_panels import WHEEL_WORDS
from aqualog.figures.selection import NotInCampaign, Wish
from aqualog.figures.slope_figure import Slopes, measured_slopes
from aqualog.figures.tyres import VERY_WORN
from aqualog.report.theme import MUTED, wheel_colour

__all__ = ["make"]

NUMBER = "2.16"
_WISH = Wish((), VERY_WORN, "lowest", 0.8)
_BELOW, _DEFAULT = 20 * KMH, 100 * KMH  # [m/s] below full aquaplaning; the thesis' speed, if that is not known
_MOST = 1200  # points of a cloud
_MU = Axis("traction coefficient")


def _c48(rows: Sequence[SlopeRow]) -> list[Finding]:
    ratios = {r.wheel: r.over_dry for r in rows if math.isfinite(r.contact_ratio)}
    told = {w: (x, ci) for w, (x, ci) in ratios.items() if all(map(math.isfinite, ci))}
    if not told:
        return []
    low = [w for w, (_, ci) in told.items() if ci[1] < 1.0]
    value, ci = max(told.values(), key=lambda found: found[1][1])
    whole = len(low) == len(told)
    return [
        Finding(
            "C48",
            "20 km/h below full aquaplaning the slip slope on water is clearly less than on dry road.",
            "slope on water over that on dry road, same configuration: interval below 1 for every driven wheel; in "
            "part: "
            "for one; value: the largest ratio",
            "; ".join(f"{w} {x:.2f} [{c[0]:.2f}, {c[1]:.2f}]" for w, (x, c) in told.items())
            + f" at {rows[0].low_kmh:.0f} to {rows[0].high_kmh:.0f} km/h",
            judged(whole=whole, part=bool(low)),
            "" if whole else "No clear difference from dry at " + ", ".join(w for w in told if w not in low) + ".",
            value, (ci[0], ci[1]), "-",
        )
    ]  # fmt: skip


def _cloud(evidence: Evidence, found: Slopes, row: SlopeRow, *, is_wet: bool) -> tuple[np.ndarray, np.ndarray]:
    """Slip [%] and traction of the samples behind a slope, corrected for the delay of v_x."""
    late = {d.vehicle: d.value for d in found.table.delays if d.told}
    s, m = [], []
    for info in found.selected.runs:
        samples = evidence.data.samples(info)
        v = samples.array("v_x") / KMH
        here = samples.is_usable & (samples.on_water == (1.0 if is_wet else 0.0))
        if is_wet:
            here &= (v >= row.low_kmh) & (v < row.high_kmh)
        slip = samples.array(f"slip_{row.wheel}")
        if info.about.get("slip_against") == "v_x":
            slip = slip - late.get(info.run.vehicle.stem, 0.0) * samples.array("a_over_v")
        mu = samples.array(f"mu_{row.wheel}")
        good = here & np.isfinite(slip + mu) & (np.abs(slip) < 0.05)
        s.append(100.0 * slip[good])
        m.append(mu[good])
    slips, mus = np.concatenate(s), np.concatenate(m)
    every = slice(None, None, max(1, -(-slips.size // _MOST)))
    return slips[every], mus[every]


def _panel(evidence: Evidence, found: Slopes, row: SlopeRow) -> Panel:
    lines = []
    dry = next((d for d in found.table.dry if d.wheel == row.wheel and d.told), None)
    kinds = (("dry", dry, MUTED, "square", False), ("water", row, wheel_colour(row.wheel), "circle", True))
    for name, fit, colour, symbol, is_wet in kinds:
        s, m = _cloud(evidence, found, row, is_wet=is_wet)
        if s.size:
            lines.append(
                Line(f"{name}, samples", s, m, colour=colour, mode="markers", symbol=symbol, size=3.0, opacity=0.5)
            )
        if fit is not None and fit.told and s.size:
            mu = np.array([0.0, float(m.max())])
            lines.append(
                Line(
                    f"{name}, slope {fit.slope:.1f}",
                    100.0 * (mu / fit.slope + fit.intercept),
                    mu,
                    colour=colour,
                    width=3.0,
                )
            )
    return Panel(f"Traction over slip, {WHEEL_WORDS[row.wheel]}", Axis("slip", "%"), _MU, tuple(lines))


def make(evidence: Evidence) -> Figure:
    """Samples and lines, dry and wet, a panel per driven wheel; C48.

    Raises
    ------
    NotInCampaign
    """
    needs = "passes over water with slip and traction of driven wheels that vary enough for a slope, and dry road"
    found = measured_slopes(evidence, _WISH, NUMBER, needs)
    level = found.levels[0]
    full = full_speed(passes_of(evidence, found.selected.runs))
    v = full - _BELOW if math.isfinite(full) else _DEFAULT
    told = [r for r in found.of(level) if r.told and math.isfinite(r.slope_dry)]
    if not told:
        raise NotInCampaign(
            f"needs {needs}: no slope, or no dry one, in {found.selected.fixed}", where=f"figure {NUMBER}"
        )
    best = min({(r.low_kmh, r.high_kmh) for r in told}, key=lambda b: (
        -any(r.reliable for r in told if r.low_kmh == b[0]), abs(0.5 * (b[0] + b[1]) * KMH - v)))  # fmt: skip
    rows = [r for r in told if r.low_kmh == best[0]]
    rest = f"full aquaplaning is at {full / KMH:.0f} km/h" if math.isfinite(full) else "full aquaplaning is not reached"
    return Figure(
        NUMBER,
        "traction over slip of driven wheels, dry and on water",
        f"{found.selected.fixed}. Water: {best[0]:.0f} to {best[1]:.0f} km/h, the bin with an interval nearest to "
        f"{v / KMH:.0f} km/h ({rest}). Dry: straight driving of the same runs off the water, at all speeds. Lines "
        "are the "
        f"regressions over all runs; runs differ in where they cross zero, so a cloud may lie beside its line.",
        tuple(_panel(evidence, found, r) for r in rows),
        tuple(_c48(rows)),
        (
            Table(
                "Slip slope [-]",
                ("wheel", "dry", "water", "water over dry", "95 %", "runs"),
                tuple(
                    (r.wheel, f"{r.slope_dry:.1f}", f"{r.slope:.1f}", f"{r.over_dry[0]:.2f}",
                     "{:.2f} to {:.2f}".format(*r.over_dry[1]) if r.reliable else "–", str(r.runs))
                    for r in rows
                ),
            ),
        ),
        found.selected.used(),
    )  # fmt: skip
