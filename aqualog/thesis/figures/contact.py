"""Figures 2.1 and 2.2: the contact patch on water in the simulator's physics, with a campaign's measured slopes."""

from __future__ import annotations

import math

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.model.plant import F_Z_HALF_LENGTH, P_HALF_LENGTH
from aqualog.model.programme import PRESSURES
from aqualog.model.tyre import TYRES
from aqualog.physics.contact import contact_half_length, contact_share, friction_ratio, load_shift, slip_stiffness_ratio
from aqualog.physics.hydroplaning import F_Z_ANCHOR, H_ANCHOR, P_ANCHOR
from aqualog.report.theme import INK, MUTED, WATER, wheel_colour
from aqualog.thesis.catalogue import figure_of
from aqualog.thesis.claims import Check, judge
from aqualog.thesis.evidence.campaign import KMH, Evidence
from aqualog.thesis.evidence.measures import Effect, fall
from aqualog.thesis.figures.panels import PALETTE, V_KMH
from aqualog.thesis.figures.slip_slopes import Slopes, measured_slopes
from aqualog.thesis.record import Axis, Figure, Line, Note, Panel, RunsUsed

__all__ = ["FIGURES"]

TYRE = TYRES["worn_summer"]
LOAD = F_Z_ANCHOR  # [N] a wheel of the thesis' test car
DEPTH = H_ANCHOR  # [m] as in most of the thesis' figures


def half_length(p: float) -> float:
    """Half the contact length of the standing wheel at a pressure [Pa]. [m]"""
    a = contact_half_length(
        np.array([LOAD]), p=p, a_ref=TYRE.half_length, F_z_ref=F_Z_HALF_LENGTH, p_ref=P_HALF_LENGTH
    )  # fmt: skip
    return float(a[0])


def full_speed(h: float, p: float) -> float:
    """Speed of full aquaplaning in a depth [m] at a pressure [Pa]. [m/s]"""
    return float(TYRE.full_speed(np.array([h]), np.array([LOAD]), p=p)[0])


def share(v: FloatArray, h: float, p: float) -> FloatArray:
    """Remaining share of the contact length over speed (n,) [m/s]. [-]"""
    return contact_share(v, np.full_like(v, full_speed(h, p)), exponent=TYRE.contact_exponent)


_SPEEDS = (80.0, 100.0, 120.0)  # [km/h]
_DEPTHS = (0.6, 1.3, 2.0)  # [mm] the thesis' least, usual and greatest
_GRID = np.arange(60.0, 121.0, 5.0)  # [km/h] of the thesis' passes
_DRY = "#8C6D31"
_POINTS = 101
_TOP = 4.6  # [bar] of the picture


def _parabola(x: FloatArray, a: float) -> FloatArray:
    """Pressure of the dry contact that (2.1) integrates: all the load over -a ... a and the width. [Pa]"""
    pressure: FloatArray = 0.75 * LOAD / (a * TYRE.width) * np.maximum(1.0 - (x / a) ** 2, 0.0)
    return pressure


def _panel(kmh: float) -> Panel:
    a = half_length(P_ANCHOR)
    L = float(share(np.array([kmh * KMH]), DEPTH, P_ANCHOR)[0])
    b = a * (2.0 * L - 1.0)
    whole = np.linspace(-a, a, _POINTS)
    dry = np.linspace(-a, b, _POINTS)
    carried = LOAD * (1.0 - float(friction_ratio(np.array([L]))[0]))
    wedge = carried / ((a - b) * TYRE.width)
    e = float(load_shift(np.array([L]), np.array([a]), arm=TYRE.wedge_arm)[0])
    mm, bar = 1e3, 1e-5
    edge = np.array([-a, *dry, b])
    height = np.array([0.0, *_parabola(dry, a), 0.0])
    return Panel(
        f"{kmh:g} km/h: {100 * L:.0f} % of the contact remains and carries {100 - 100 * carried / LOAD:.0f} % of "
        "the load",
        Axis("along the patch, forward", "mm", limits=(-1.25 * a * mm, 1.25 * a * mm)),
        Axis("pressure", "bar", limits=(0.0, _TOP)),
        (
            Line("dry contact", edge * mm, height * bar, colour=_DRY, is_filled=True),
            Line("water wedge (mean)", np.array([b, b, a, a]) * mm, np.array([0.0, wedge, wedge, 0.0]) * bar,
                 colour=WATER, is_filled=True),
            Line("on dry road", whole * mm, _parabola(whole, a) * bar, colour=MUTED, dash="dash", width=1.2),
        ),
        notes=(
            Note("b", b * mm + 3.0, 0.2, size=13),
            Note(f"load {e * mm:.0f} mm ahead", e * mm, 3.1, tail=(e * mm, 4.1), size=11),
            Note("drives this way →", 0.85 * a * mm, 4.4, size=11, colour=MUTED),
        ),
    )  # fmt: skip


def _shares() -> Panel:
    v = np.linspace(40.0, 140.0, _POINTS)
    lines = [
        Line(f"{h:g} mm", v, share(v * KMH, 1e-3 * h, P_ANCHOR), colour=PALETTE[i]) for i, h in enumerate(_DEPTHS)
    ]  # fmt: skip
    marks = Line(
        "shown", np.array(_SPEEDS), share(np.array(_SPEEDS) * KMH, DEPTH, P_ANCHOR), colour=INK, mode="markers"
    )
    return Panel("Remaining contact", Axis("velocity", "km/h"), Axis("share of the contact length"), (*lines, marks))


def _c9() -> Check:
    grid = np.stack([share(_GRID * KMH, 1e-3 * h, P_ANCHOR) for h in _DEPTHS])
    # a contact that is lost completely cannot fall further
    by_speed = bool(np.all((np.diff(grid, axis=1) < 0.0) | (grid[:, :-1] == 0.0)))
    by_depth = bool(np.all((np.diff(grid, axis=0) < 0.0) | (grid[:-1] == 0.0)))
    L = float(share(np.array([100 * KMH]), DEPTH, P_ANCHOR)[0])
    outcome = (
        f"falls with speed: {'yes' if by_speed else 'no'}, with depth: {'yes' if by_depth else 'no'}; "
        f"{DEPTH * 1e3:g} mm at 100 km/h leave {100 * L:.0f} %, full aquaplaning at "
        + ", ".join(f"{full_speed(1e-3 * h, P_ANCHOR) / KMH:.0f}" for h in _DEPTHS)
        + " km/h. A property of the model, which was made to have it; it measures nothing"
    )
    return judge("C9.figure", outcome, whole=by_speed and by_depth, part=by_speed or by_depth, value=L)


def figure_2_01() -> Figure:
    """Pressures along the patch at three speeds, and the share that is left over speed and depth; C9."""
    return figure_of("2.1", (*(_panel(v) for v in _SPEEDS), _shares()), (_c9(),))


_V = np.arange(0.0, 160.5, 1.0)  # [km/h]
_LOST = 0.9  # of the dry value: below it, a curve has begun to fall


def _first_below(y: FloatArray) -> float:
    """Speed at which a curve has fallen below `_LOST`. [km/h]"""
    return float(np.interp(-_LOST, -y, _V))


def _c10() -> Check:
    earlier, below = [], True
    for p in PRESSURES.values():
        L = share(_V * KMH, DEPTH, p)
        C, mu = slip_stiffness_ratio(L), friction_ratio(L)
        part = (L > 0.0) & (L < 1.0)
        below &= bool(np.all(C[part] < mu[part]))
        earlier.append(_first_below(mu) - _first_below(C))
    whole = below and min(earlier) > 0.0
    outcome = (
        f"below at every speed: {'yes' if below else 'no'}; a tenth is lost "
        + ", ".join(f"{x:.0f}" for x in earlier)
        + " km/h earlier at "
        + ", ".join(f"{p * 1e-5:g}" for p in PRESSURES.values())
        + " bar. Contact lengths are the model's, not measured"
    )
    return judge("C10.figure", outcome, whole=whole, part=below, value=min(earlier))


def _measured(found: Slopes) -> tuple[list[Line], list[Check]]:
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
    outcome = "; ".join(f"{w} {e.words(0)} %" for w, e in falls.items())
    part, value, ci95 = bool(down), least.value, least.ci
    fields = {"level": ", ".join(w for w in falls if w not in down)}
    return lines, [judge("C10.figure_measured", outcome, whole=whole, part=part, value=value, ci95=ci95, fields=fields)]


def figure_2_02(number: str = "2.2", evidence: Evidence | None = None) -> Figure:
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
    checks, said = [_c10()], ""
    runs: RunsUsed | None = None
    if evidence is not None:
        found = measured_slopes(number, evidence)
        lines, more = _measured(found)
        slopes, checks = slopes + lines, checks + more
        runs = found.selected.used()
        said = f" Points: slip slope on water over that on dry road, {found.selected.fixed}, with 95 % intervals."
    panels = (
        Panel("Contact length", V_KMH, Axis("contact length", "mm"),
              tuple(Line(n, _V, 1e3 * length * L, colour=c) for n, (length, L, c) in curves.items())),
        Panel("Friction over that on dry road", V_KMH, Axis("mu_max / mu_0"),
              tuple(Line(n, _V, friction_ratio(L), colour=c) for n, (_, L, c) in curves.items())),
        Panel("Slip slope over that on dry road", V_KMH, Axis("C / C_0", limits=(0.0, 1.3)), tuple(slopes)),
    )  # fmt: skip
    v_full = ", ".join(f"{full_speed(DEPTH, p) / KMH:.0f}" for p in PRESSURES.values())
    return figure_of(number, panels, checks, runs=runs, v_full=v_full, said=said)


FIGURES = {"2.1": figure_2_01, "2.2": figure_2_02}
