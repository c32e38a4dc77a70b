"""Figure 2.2: contact length over speed, and the remaining friction and slip slope."""

from __future__ import annotations

import math

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.figures.bin_lines import fall
from aqualog.figures.evidence import KMH, Evidence
from aqualog.figures.levels import PALETTE, V_KMH
from aqualog.figures.measures import Effect
from aqualog.figures.record import Axis, Figure, Finding, Line, Panel, RunsUsed, judged
from aqualog.figures.selection import Wish
from aqualog.figures.slope_figure import Slopes, measured_slopes
from aqualog.figures.tyres import WORN
from aqualog.figures.wedge import DEPTH, LOAD, full_speed, half_length, share
from aqualog.model.programme import PRESSURES
from aqualog.physics.contact import friction_ratio, slip_stiffness_ratio
from aqualog.report.theme import wheel_colour

__all__ = ["make"]

NUMBER = "2.2"
_WISH = Wish((), WORN, "lowest", 1.3)
_V = np.arange(0.0, 160.5, 1.0)  # [km/h]
_LOST = 0.9  # of the dry value: below it, a curve has begun to fall


def _first_below(y: FloatArray) -> float:
    """Speed at which a curve has fallen below `_LOST`. [km/h]"""
    return float(np.interp(-_LOST, -y, _V))


def _c10() -> Finding:
    earlier, below = [], True
    for p in PRESSURES.values():
        L = share(_V * KMH, DEPTH, p)
        C, mu = slip_stiffness_ratio(L), friction_ratio(L)
        part = (L > 0.0) & (L < 1.0)
        below &= bool(np.all(C[part] < mu[part]))
        earlier.append(_first_below(mu) - _first_below(C))
    whole = below and min(earlier) > 0.0
    return Finding(
        "C10",
        "With the measured contact lengths, (2.1) and (2.2): the slip slope falls earlier and further than the "
        "friction.",
        "at all three pressures slope ratio below friction ratio at every speed with partial contact, and it has "
        "lost a "
        "tenth at a lower speed",
        f"below at every speed: {'yes' if below else 'no'}; a tenth is lost "
        + ", ".join(f"{x:.0f}" for x in earlier) + " km/h earlier at "
        + ", ".join(f"{p * 1e-5:g}" for p in PRESSURES.values())
        + " bar. Contact lengths are the model's, not measured",
        judged(whole=whole, part=below),
        "" if whole else "The curves cross.",
        min(earlier), None, "km/h",
    )  # fmt: skip


def _measured(found: Slopes) -> tuple[list[Line], list[Finding]]:
    """Square of the contact of the campaign's bins, and whether it falls with speed as the model's does."""
    lines: list[Line] = []
    falls: dict[str, Effect] = {}
    level = found.levels[0]
    for wheel in found.wheels:
        rows = [r for r in found.of(level, wheel) if r.told and math.isfinite(r.contact_ratio)]
        if not rows:
            continue
        low, high = (
            np.array([r.contact_ratio_ci[k] ** 2 if r.reliable else np.nan for r in rows]) for k in (0, 1)
        )  # fmt: skip
        lines.append(
            Line(
                f"measured L^2, {wheel}", np.array([0.5 * (r.low_kmh + r.high_kmh) for r in rows]),
                np.array([r.contact_ratio**2 for r in rows]), low=low, high=high, colour=wheel_colour(wheel),
                mode="markers", size=8.0,
            )
        )  # fmt: skip
        change = fall(rows)
        if change is not None:
            falls[wheel] = change
    if not falls:
        return lines, []
    down = [w for w, e in falls.items() if e.is_below]
    least = max(falls.values(), key=lambda e: e.high)
    whole = len(down) == len(falls)
    finding = Finding(
        "C10 (measured)",
        "The slip slope falls with speed on water, by the square of the remaining contact.",
        "relative change of the slope per 10 km/h over the bins of one configuration: interval below 0 for every "
        "driven "
        "wheel; in part: for one",
        "; ".join(f"{w} {e.words(0)} %" for w, e in falls.items()),
        judged(whole=whole, part=bool(down)),
        "" if whole else "No clear difference from 0: " + ", ".join(w for w in falls if w not in down) + ".",
        least.value, least.ci, "% per 10 km/h",
    )  # fmt: skip
    return lines, [finding]


def make(evidence: Evidence | None = None) -> Figure:
    """Contact length, friction and slip slope over speed at three pressures (C10), with a campaign's measured slopes.

    Raises
    ------
    NotInCampaign
        If a campaign is given that has no slopes on water.
    """
    curves = {
        f"{name}, {p * 1e-5:g} bar": (2.0 * half_length(p), share(_V * KMH, DEPTH, p), PALETTE[i])
        for i, (name, p) in enumerate(PRESSURES.items())
    }
    slopes = [Line(n, _V, slip_stiffness_ratio(L), colour=c) for n, (_, L, c) in curves.items()]
    findings, said = [_c10()], ""
    runs: RunsUsed | None = None
    if evidence is not None:
        found = measured_slopes(evidence, _WISH, NUMBER, "runs on water with slip and traction of driven wheels")
        lines, more = _measured(found)
        slopes, findings = slopes + lines, findings + more
        runs = found.selected.used()
        said = f" Points: slip slope on water over that on dry road, {found.selected.fixed}, with 95 % intervals."
    return Figure(
        NUMBER,
        "contact length over speed, with the remaining friction and slip slope",
        f"Computed from the simulator's physics for a front wheel with a worn summer tyre and {LOAD:g} N in "
        f"{DEPTH * 1e3:g} mm; "
        f"full aquaplaning at " + ", ".join(f"{full_speed(DEPTH, p) / KMH:.0f}" for p in PRESSURES.values())
        + f" km/h. Friction by (2.1), slope by (2.2).{said}",
        (
            Panel("Contact length", V_KMH, Axis("contact length", "mm"),
                  tuple(Line(n, _V, 1e3 * length * L, colour=c) for n, (length, L, c) in curves.items())),
            Panel("Friction over that on dry road", V_KMH, Axis("mu_max / mu_0"),
                  tuple(Line(n, _V, friction_ratio(L), colour=c) for n, (_, L, c) in curves.items())),
            Panel("Slip slope over that on dry road", V_KMH, Axis("C / C_0", limits=(0.0, 1.3)), tuple(slopes)),
        ),
        tuple(findings),
        (),
        runs,
    )  # fmt: skip
