"""Figure 3.5: torque splits from front to rear drive on the surface of differential traction."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.figures.curves import LOAD_REAR, Split, split
from aqualog.figures.record import Axis, Figure, Finding, Line, Panel, Table, judged, seconds
from aqualog.figures.solid import DIFFERENCE, DRY, FRONT_SLIP, TRACTION, forces, initial_slope, sheet, split_lines
from aqualog.figures.study import Case, drive, estimate, false_alarms, first_alarm, slope_at
from aqualog.figures.timeline import COLOURS
from aqualog.report.theme import INK, THRESHOLD

__all__ = ["blind_split", "make", "slip_per_force"]

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


def make() -> Figure:
    """Lines of fixed splits and of a fixed force; where both axles slip alike."""
    force = forces(DRY)
    lines: dict[float, Split] = {nu: split(DRY, force, nu) for nu in _NUS}
    front = float(np.abs(lines[0.0].s_delta - lines[0.0].s_f).max())
    rear = float(np.abs(lines[1.0].s_f).max())
    zero = force.size // 2
    origin = max(max(abs(float(p.s_delta[zero])), abs(float(p.mu_delta[zero]))) for p in lines.values())
    c94 = Finding(
        "C94",
        "All splits pass through the origin; front drive (nu = 0) has s_delta = s_F, rear drive (nu = 1) runs over "
        "s_F = 0.",
        "each within 1e-12",
        f"largest deviation: nu = 0 {front:.1e}, nu = 1 {rear:.1e}, origin {origin:.1e}",
        judged(whole=max(front, rear, origin) < 1e-12, part=max(front, rear, origin) < 1e-3),
        value=max(front, rear, origin),
    )

    blind = [blind_split(f) for f in _FORCES]
    runs = _runs()
    found, slope = runs[0][1], runs[0][2]
    vanishes = all(abs(b - 0.6) < 0.02 for b in blind)
    unseen = bool(np.isnan(found)) and slope > 0.85 * DRY.slope
    c95 = Finding(
        "C95",
        "With a split near 0.6 both axles slip alike, differential slip and traction stay near zero, and no slope "
        "can be detected.",
        "the differential slip vanishes within 0.02 of 0.6, and a run at constant speed with this split finds no "
        "drop and keeps the old slope within 15 %; in part: the first only",
        f"vanishes at nu = {', '.join(f'{b:.4f}' for b in blind)} (forces {', '.join(f'{f:g}' for f in _FORCES)} of "
        "the weight); run without excitation: drop "
        f"{'not found' if np.isnan(found) else f'found after {seconds(found)} s'}, slope {slope:.1f} after 8 s on 10",
        judged(whole=vanishes and unseen, part=vanishes),
        f"It is the rear axle's share of the load, {LOAD_REAR}, while the slopes are alike. Load transfer moves it: "
        "at 1 m/s² the same split is no longer quite blind.",
        blind[1],
    )

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
    return Figure(
        "3.5",
        "torque splits on the surface of differential traction",
        "Dry road of figure 3.4. Lines of a fixed split from front drive (nu = 0) to rear drive (nu = 1), and of a "
        "fixed sum of the forces with the split varied. (c) Differential slip of a force, over the split.",
        (
            Panel("Surface and lines of fixed splits", FRONT_SLIP, DIFFERENCE, tuple(solid), TRACTION, (sheet(DRY),)),
            Panel("Projection", DIFFERENCE, TRACTION, tuple(flat)),
            Panel("Differential slip per force", Axis("rear share nu"), Axis("s_delta over force / weight"),
                  tuple(sensitivity)),
        ),
        (c94, c95),
        (
            Table(
                "Initial slope of the projected lines",
                ("nu", "initial slope [-]", "s_delta per force over weight [-]"),
                tuple(
                    (f"{nu:g}", "–" if np.isnan(v := initial_slope(DRY, nu)) else f"{v:.2f}",
                     f"{slip_per_force(np.array([nu]), 1e-6)[0]:.5f}")
                    for nu in _NUS
                ),
            ),
            Table(
                "Runs over the change at t = 0 (slope 30 to 10), with a required minimum of differential traction",
                ("run", "drop found [s]", "slope after 8 s [-]", "false alarms"),
                tuple((n, seconds(t), f"{s:.1f}", str(k)) for n, t, s, k in runs),
            ),
        ),
    )  # fmt: skip
