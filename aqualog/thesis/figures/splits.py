"""Figures 3.4 and 3.5: torque splits on the surface of differential traction."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.report.theme import INK, THRESHOLD
from aqualog.thesis.catalogue import figure_of
from aqualog.thesis.claims import judge
from aqualog.thesis.evidence.brush import LOAD_REAR, Road, Split, split, surface
from aqualog.thesis.evidence.half_car import (
    HIGH_MU,
    HIGH_SLOPE,
    LOW_MU,
    LOW_SLOPE,
    Case,
    drive,
    estimate,
    false_alarms,
    first_alarm,
    slope_at,
)
from aqualog.thesis.figures.timeline import COLOURS
from aqualog.thesis.record import Axis, Figure, Line, Panel, Sheet, Table, seconds

__all__ = ["FIGURES", "TRACTION"]

DRY = Road("dry", HIGH_MU, HIGH_SLOPE, COLOURS[1])
SNOW = Road("snowy", LOW_MU, LOW_SLOPE, COLOURS[0])

_REACH = 0.02  # slips that are drawn, to both sides [-]
FRONT_SLIP = Axis("s_F", "%", limits=(-100 * _REACH, 100 * _REACH))
DIFFERENCE = Axis("s_delta", "%", limits=(-100 * _REACH, 100 * _REACH))
TRACTION = Axis("mu_delta")


def sheet(road: Road) -> Sheet:
    """The surface of a road within the slips that are drawn."""
    s = np.linspace(-_REACH, _REACH, 41)
    return Sheet(f"surface, {road.name}", 100.0 * s, 100.0 * s, surface(road, s, s), road.colour)


def forces(road: Road) -> FloatArray:
    """Forces over the car's weight (n,), both ways through zero, up to 60 % of what the road holds. [-]"""
    return np.linspace(-0.6, 0.6, 241) * road.mu_max * 0.4


def split_lines(
    road: Road, nu: float, *, name: str, colour: str, dash: str = "solid", is_solid: bool = True
) -> Line:  # fmt: skip
    """Line of a fixed torque split over the force, in space or projected; cut where it leaves the view."""
    p = split(road, forces(road), nu)
    out = (np.abs(p.s_f) > _REACH) | (np.abs(p.s_delta) > _REACH)
    mu_delta = np.where(out, np.nan, p.mu_delta)
    if is_solid:
        x, y = 100.0 * p.s_f, 100.0 * p.s_delta
        return Line(name, x, y, z=mu_delta, colour=colour, dash=dash, width=3.0, group=name)
    return Line(name, 100.0 * p.s_delta, mu_delta, colour=colour, dash=dash, group=name)


def initial_slope(road: Road, nu: float) -> float:
    """mu_delta over s_delta of a fixed split as the force goes to zero; NaN where both axles slip alike. [-]"""
    p = split(road, np.array([1e-7]), nu)
    return float(p.mu_delta[0] / p.s_delta[0]) if abs(p.s_delta[0]) > 1e-12 else float("nan")


_NU = 0.3
_AT = 0.005  # differential slip at which both lines are compared [-]


def figure_3_04() -> Figure:
    """Two surfaces with a line of fixed split each, and their projection."""
    slopes = {r.name: initial_slope(r, _NU) for r in (DRY, SNOW)}
    errors = [abs(slopes[r.name] / r.slope - 1.0) for r in (DRY, SNOW)]
    heights = []
    for road in (DRY, SNOW):
        p = split(road, forces(road), _NU)
        order = np.argsort(p.s_delta)
        heights.append(float(np.interp(_AT, p.s_delta[order], p.mu_delta[order])))
    ratio = heights[0] / heights[1]
    outcome = (
        f"initial slopes {slopes['dry']:.2f} and {slopes['snowy']:.2f} (tyres {DRY.slope:.0f} and {SNOW.slope:.0f}); "
        f"at {100 * _AT:g} % the dry line is {ratio:.1f} times as high"
    )
    c93 = judge(
        "C93.figure", outcome, whole=max(errors) < 0.01 and ratio > 2.0, part=max(errors) < 0.01, value=max(errors)
    )
    solid = tuple(
        split_lines(r, _NU, name=f"nu = {_NU}, {r.name}", colour=r.colour, dash=d)
        for r, d in ((DRY, "solid"), (SNOW, "dot"))
    )
    flat = tuple(
        split_lines(r, _NU, name=f"nu = {_NU}, {r.name}", colour=r.colour, dash=d, is_solid=False)
        for r, d in ((DRY, "solid"), (SNOW, "dot"))
    )
    return figure_of(
        "3.4",
        (
            Panel(
                "Surfaces and lines of a fixed split",
                FRONT_SLIP,
                DIFFERENCE,
                solid,
                TRACTION,
                (sheet(DRY), sheet(SNOW)),
            ),
            Panel("Projection", DIFFERENCE, TRACTION, flat),
        ),
        (c93,),
        (
            Table(
                "Lines of the fixed split",
                ("road", "slip slope [-]", "initial slope [-]", f"mu_delta at {100 * _AT:g} % [-]"),
                tuple(
                    (r.name, f"{r.slope:.1f}", f"{slopes[r.name]:.3f}", f"{h:.4f}")
                    for r, h in zip((DRY, SNOW), heights, strict=True)
                ),
            ),
        ),
    )


_NUS = (0.0, 0.2, 0.4, 0.5, 0.6, 0.7, 0.8, 1.0)
_DASHES = ("solid", "solid", "solid", "solid", "dash", "dot", "dot", "dot")
_HUES = (COLOURS[2], COLOURS[5], COLOURS[4], COLOURS[1], INK, COLOURS[3], COLOURS[1], COLOURS[2])
_F_SUM = 0.1  # over the weight: 1 m/s^2
_FORCES = (0.02, 0.1, 0.2)  # over the weight


def slip_per_force(nu: FloatArray, force: float) -> FloatArray:
    """Differential slip over the force (over the car's weight) for splits (n,), dry road. [-]"""
    return split(DRY, np.full_like(nu, force), nu).s_delta / force


def blind_split(force: float) -> float:
    """Split at which both axles slip alike, by halving. [-]"""
    low, high = 0.0, 1.0
    while high - low > 1e-9:
        nu = 0.5 * (low + high)
        if slip_per_force(np.array([nu]), force)[0] > 0.0:
            low = nu
        else:
            high = nu
    return 0.5 * (low + high)


def _runs() -> tuple[tuple[str, float, float, int], ...]:
    """Name, detection time, slope 8 s after the change and false alarms: blind split, another one, excitation."""
    cases = {
        "nu = 0.6, no excitation": Case("", a_x=0.0),
        "nu = 0.6, no excitation, 1 m/s^2": Case("", a_x=1.0),
        "nu = 0.3, no excitation, 1 m/s^2": Case("", a_x=1.0, nu=0.3),
        "nu = 0.6, sine of 0.07, 8 s": Case("sine", 0.07, "mu", a_x=0.0),
    }
    out = []
    for name, case in cases.items():
        d, e = drive(case), estimate(case)
        out.append((name, first_alarm(d, e), slope_at(d, e, 8.0), false_alarms(d, e)))
    return tuple(out)


def figure_3_05() -> Figure:
    """Lines of fixed splits and of a fixed force; where both axles slip alike."""
    force = forces(DRY)
    lines: dict[float, Split] = {nu: split(DRY, force, nu) for nu in _NUS}
    front = float(np.abs(lines[0.0].s_delta - lines[0.0].s_f).max())
    rear = float(np.abs(lines[1.0].s_f).max())
    zero = force.size // 2
    origin = max(max(abs(float(p.s_delta[zero])), abs(float(p.mu_delta[zero]))) for p in lines.values())
    outcome = f"largest deviation: nu = 0 {front:.1e}, nu = 1 {rear:.1e}, origin {origin:.1e}"
    whole = max(front, rear, origin) < 1e-12
    c94 = judge(
        "C94.figure", outcome, whole=whole, part=max(front, rear, origin) < 1e-3, value=max(front, rear, origin)
    )

    blind = [blind_split(f) for f in _FORCES]
    runs = _runs()
    found, slope = runs[0][1], runs[0][2]
    vanishes = all(abs(b - 0.6) < 0.02 for b in blind)
    unseen = bool(np.isnan(found)) and slope > 0.85 * DRY.slope
    outcome = (
        f"vanishes at nu = {', '.join(f'{b:.4f}' for b in blind)} (forces {', '.join(f'{f:g}' for f in _FORCES)} of "
        "the weight); run without excitation: drop "
        f"{'not found' if np.isnan(found) else f'found after {seconds(found)} s'}, slope {slope:.1f} after 8 s on 10"
    )
    c95 = judge("C95.figure", outcome, whole=vanishes and unseen, part=vanishes, value=blind[1])

    solid = [split_lines(DRY, nu, name=f"nu = {nu:g}", colour=c, dash=d)
             for nu, c, d in zip(_NUS, _HUES, _DASHES, strict=True)]  # fmt: skip
    flat = [split_lines(DRY, nu, name=f"nu = {nu:g}", colour=c, dash=d, is_solid=False)
            for nu, c, d in zip(_NUS, _HUES, _DASHES, strict=True)]  # fmt: skip
    nus = np.linspace(0.0, 1.0, 21)
    const = split(DRY, np.full_like(nus, _F_SUM), nus)
    name = f"F_sum = {_F_SUM:g} of the weight, nu = 0 ... 1"
    solid.append(Line(name, 100.0 * const.s_f, 100.0 * const.s_delta, z=const.mu_delta, colour=COLOURS[0],
                      mode="lines+markers", group=name))  # fmt: skip
    flat.append(Line(name, 100.0 * const.s_delta, const.mu_delta, colour=COLOURS[0], mode="lines+markers", group=name))
    fine = np.linspace(0.0, 1.0, 101)
    sensitivity = [
        Line(f"force {f:g} of the weight", fine, slip_per_force(fine, f), colour=c)
        for f, c in zip(_FORCES, COLOURS, strict=False)
    ]
    sensitivity.append(Line("rear share of the load", np.full(2, LOAD_REAR), np.array([-0.06, 0.09]), colour=THRESHOLD,
                            dash="dash", width=1.0))  # fmt: skip
    return figure_of(
        "3.5",
        (
            Panel("Surface and lines of fixed splits", FRONT_SLIP, DIFFERENCE, tuple(solid), TRACTION, (sheet(DRY),)),
            Panel("Projection", DIFFERENCE, TRACTION, tuple(flat)),
            Panel(
                "Differential slip per force",
                Axis("rear share nu"),
                Axis("s_delta over force / weight"),
                tuple(sensitivity),
            ),
        ),
        (c94, c95),
        (
            Table(
                "Initial slope of the projected lines",
                ("nu", "initial slope [-]", "s_delta per force over weight [-]"),
                tuple(
                    (
                        f"{nu:g}",
                        "–" if np.isnan(v := initial_slope(DRY, nu)) else f"{v:.2f}",
                        f"{slip_per_force(np.array([nu]), 1e-6)[0]:.5f}",
                    )
                    for nu in _NUS
                ),
            ),
            Table(
                "Runs over the change at t = 0 (slope 30 to 10), with a required minimum of differential traction",
                ("run", "drop found [s]", "slope after 8 s [-]", "false alarms"),
                tuple((n, seconds(t), f"{s:.1f}", str(k)) for n, t, s, k in runs),
            ),
        ),
    )


FIGURES = {"3.4": figure_3_04, "3.5": figure_3_05}
