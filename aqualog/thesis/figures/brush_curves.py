"""Figures 3.1 and 3.3 to 3.5: curves of the brush, and torque splits on the surface of differential traction."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.model.scenario import SURFACES
from aqualog.physics.surface import series_slope
from aqualog.physics.tyre_brush import brush_slip
from aqualog.report.theme import INK, THRESHOLD
from aqualog.thesis.catalogue import figure_of
from aqualog.thesis.claims import judge
from aqualog.thesis.evidence import half_car
from aqualog.thesis.evidence.brush import LOAD_REAR, Road, split, surface, traction
from aqualog.thesis.figures.timeline import COLOURS
from aqualog.thesis.record import Axis, Figure, Line, Panel, Sheet, Table, seconds

__all__ = ["FIGURES", "TRACTION"]

_TYRE_SLOPE, _TYRE_MU = 30.0, 1.0  # on dry asphalt
_NAMES = {"asphalt": "dry asphalt", "snow": "snow on asphalt", "snow_on_ice": "snow on ice", "wet_ice": "wet ice"}
_SHOWN = 0.10  # largest slip that is drawn [-]


def figure_3_01() -> Figure:
    """Curves of the brush with the ground's yield in series with the tread."""
    slopes = {n: float(series_slope(np.array(_TYRE_SLOPE), compliance=SURFACES[n].compliance)) for n in _NAMES}
    mus = {n: SURFACES[n].mu or _TYRE_MU for n in _NAMES}
    s = np.linspace(0.0, _SHOWN, 401)
    curves = {n: traction(s, slope=slopes[n], mu_max=mus[n]) for n in _NAMES}
    # where the linear part has given way: 90 % of the friction is used
    bends = {n: float(brush_slip(np.array([0.9 * mus[n]]), slope=slopes[n], mu=mus[n])[0]) for n in _NAMES}

    ratios = [max(slopes[a], slopes[b]) / min(slopes[a], slopes[b]) for a, b in combinations(_NAMES, 2)]
    snows = max(mus["snow"], mus["snow_on_ice"]) / min(mus["snow"], mus["snow_on_ice"]) - 1.0
    snow_slopes = max(slopes["snow"], slopes["snow_on_ice"]) / min(slopes["snow"], slopes["snow_on_ice"]) - 1.0
    outcome = (
        f"slopes {', '.join(f'{slopes[n]:.0f}' for n in _NAMES)}: least ratio {min(ratios):.2f}; snow on asphalt and "
        f"on ice: friction {100 * snows:.0f} % apart, slopes {100 * snow_slopes:.0f} %, bends at "
        f"{100 * bends['snow']:.1f} and {100 * bends['snow_on_ice']:.1f} % slip"
    )
    whole = min(ratios) > 1.15 and snows < 0.10 and snow_slopes > 0.25
    c81 = judge("C81.figure", outcome, whole=whole, part=min(ratios) > 1.15, value=min(ratios))

    # the curve's own slope near zero against the law of springs in series
    small = np.array([1e-6])
    error = max(
        abs(
            float(traction(small, slope=slopes[n], mu_max=mus[n])[0]) / 1e-6
            * (1.0 / _TYRE_SLOPE + SURFACES[n].compliance) - 1.0
        )
        for n in _NAMES
    )  # fmt: skip
    yields = [n for n in _NAMES if SURFACES[n].compliance > 0.0]
    drops = all(slopes[n] < _TYRE_SLOPE for n in yields)
    outcome = (
        f"largest deviation {100 * error:.4f} %; slope {', '.join(f'{slopes[n]:.0f}' for n in yields)} of "
        f"{_TYRE_SLOPE:.0f} where the ground yields"
    )
    c82 = judge("C82.figure", outcome, whole=error < 1e-3 and drops, part=drops, value=error)
    lines = tuple(
        Line(label, 100.0 * s, curves[n], colour=c) for (n, label), c in zip(_NAMES.items(), COLOURS, strict=False)
    )
    rows = tuple((label, f"{mus[n]:.2f}", f"{slopes[n]:.1f}", f"{100 * bends[n]:.1f}") for n, label in _NAMES.items())
    panel = Panel("Traction coefficient over slip", Axis("slip", "%"), Axis("traction coefficient"), lines)
    table = Table("Curves", ("surface", "friction [-]", "slip slope [-]", "slip at 90 % of the friction [%]"), rows)
    return figure_of("3.1", (panel,), (c81, c82), (table,))


_FRONT, _REAR, _MU = 30.0, 24.0, 1.0
_RATIO = _REAR / _FRONT  # lambda of (3.17)
_POINTS = (0.02, 0.12)  # traction coefficients of front and rear axle in the example
_EQUAL = 0.12  # of the front axle, where the transformed slips shall be equal


def figure_3_03() -> Figure:
    """Both curves, the rear one as it is and scaled by lambda and rho, with the slope between two working points."""
    s = np.linspace(0.0, 0.03, 301)
    rear = traction(s, slope=_REAR, mu_max=_MU)
    front = traction(s, slope=_FRONT, mu_max=_MU)
    s_f = float(brush_slip(np.array([_POINTS[0]]), slope=_FRONT, mu=_MU)[0])
    s_r = float(brush_slip(np.array([_POINTS[1]]), slope=_REAR, mu=_MU)[0])
    rho = (1.0 - s_f) / (1.0 - s_r)  # v_R / v_F with v = v_x / (1 - s)
    scaled_s, scaled_mu = rho * s, rho * rear / _RATIO

    initial = float(scaled_mu[1] / scaled_s[1])
    s_delta, mu_delta = s_f - rho * s_r, _POINTS[0] - rho * _POINTS[1] / _RATIO
    chord = mu_delta / s_delta
    # the same slip on both axles: the remaining slip for an estimate of the slope
    s_r_equal = float(brush_slip(np.array([_EQUAL * _RATIO]), slope=_REAR, mu=_MU)[0])
    s_f_equal = float(brush_slip(np.array([_EQUAL]), slope=_FRONT, mu=_MU)[0])
    rho_equal = (1.0 - s_f_equal) / (1.0 - s_r_equal)
    left = abs(s_f_equal - rho_equal * s_r_equal)
    initial_error, chord_error = abs(initial / _FRONT - 1.0), abs(chord / _FRONT - 1.0)
    outcome = f"initial slope {initial:.2f}, slope between the points {chord:.1f}, front tyre {_FRONT:.0f}"
    whole = initial_error < 0.01 and chord_error < 0.15
    fields = {"flatter": 100 * chord_error, "left": 100 * left}
    c92 = judge("C92.figure", outcome, whole=whole, part=initial_error < 0.01, value=chord, fields=fields)
    front_slip, rear_slip, scaled_rear = 100.0 * s_f, 100.0 * s_r, 100.0 * rho * s_r  # [%]
    front_mu, rear_mu = _POINTS[0], rho * _POINTS[1] / _RATIO

    def point(name: str, x: float, y: float, colour: str) -> Line:
        return Line(name, np.array([x]), np.array([y]), colour=colour, mode="markers", size=10.0)

    first = (
        Line("rear tyre", 100.0 * s, rear, colour=COLOURS[1]),
        point("rear working point", rear_slip, _POINTS[1], COLOURS[1]),
    )
    second = (
        Line("front tyre", 100.0 * s, front, colour=COLOURS[0]),
        Line("rear tyre, scaled", 100.0 * scaled_s, scaled_mu, colour=COLOURS[1], dash="dash"),
        point("front working point", front_slip, front_mu, COLOURS[0]),
        point("rear working point, scaled", scaled_rear, rear_mu, COLOURS[1]),
        Line("differential slip and traction", 100.0 * np.array([s_f, rho * s_r, rho * s_r]),
             np.array([front_mu, front_mu, rear_mu]), colour=COLOURS[2], dash="dot"),
    )  # fmt: skip
    slip, scaled = Axis("rear slip", "%"), Axis("front slip, scaled rear slip", "%")
    of_rear, of_both = (Axis(n, limits=(0.0, 0.8)) for n in ("traction coefficient", "traction coefficient, scaled"))
    panels = (
        Panel("Rear curve", slip, of_rear, first), Panel("Front curve and scaled rear curve", scaled, of_both, second),
    )  # fmt: skip
    rows = (("front", s_f, front_mu), ("rear, scaled", rho * s_r, rear_mu), ("difference", s_delta, mu_delta))
    table = Table(
        "The example", ("", "slip [%]", "traction [-]"), tuple((n, f"{100 * x:.4f}", f"{y:.4f}") for n, x, y in rows)
    )
    return figure_of("3.3", panels, (c92,), (table,), rho=rho)


DRY = Road("dry", half_car.HIGH_MU, half_car.HIGH_SLOPE, COLOURS[1])
SNOW = Road("snowy", half_car.LOW_MU, half_car.LOW_SLOPE, COLOURS[0])

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


def initial_slope(road: Road, nu: float) -> float:
    """mu_delta over s_delta of a fixed split as the force goes to zero; NaN where both axles slip alike. [-]"""
    p = split(road, np.array([1e-7]), nu)
    return float(p.mu_delta[0] / p.s_delta[0]) if abs(p.s_delta[0]) > 1e-12 else float("nan")


_NU = 0.3
_AT = 0.005  # differential slip at which both lines are compared [-]


def _both_views(road: Road, nu: float, *, name: str, colour: str, dash: str) -> tuple[Line, Line]:
    """Line of a fixed torque split over the force, in space and projected; cut where it leaves the view."""
    p = split(road, forces(road), nu)
    out = (np.abs(p.s_f) > _REACH) | (np.abs(p.s_delta) > _REACH)
    x, y, z = 100.0 * p.s_f, 100.0 * p.s_delta, np.where(out, np.nan, p.mu_delta)
    return (
        Line(name, x, y, z=z, colour=colour, dash=dash, width=3.0, group=name),
        Line(name, y, z, colour=colour, dash=dash, group=name),
    )


def figure_3_04() -> Figure:
    """Two surfaces with a line of fixed split each, and their projection."""
    roads = (DRY, SNOW)
    slopes = [initial_slope(r, _NU) for r in roads]
    errors = [abs(s / r.slope - 1.0) for s, r in zip(slopes, roads, strict=True)]
    heights = []
    for road in roads:
        p = split(road, forces(road), _NU)
        order = np.argsort(p.s_delta)
        heights.append(float(np.interp(_AT, p.s_delta[order], p.mu_delta[order])))
    ratio = heights[0] / heights[1]
    outcome = (
        f"initial slopes {slopes[0]:.2f} and {slopes[1]:.2f} (tyres {DRY.slope:.0f} and {SNOW.slope:.0f}); "
        f"at {100 * _AT:g} % the dry line is {ratio:.1f} times as high"
    )
    part, value = max(errors) < 0.01, max(errors)
    c93 = judge("C93.figure", outcome, whole=part and ratio > 2.0, part=part, value=value)
    solid, flat = zip(
        *(
            _both_views(r, _NU, name=f"nu = {_NU}, {r.name}", colour=r.colour, dash=d)
            for r, d in zip(roads, ("solid", "dot"), strict=True)
        ),
        strict=True,
    )
    sheets = (sheet(DRY), sheet(SNOW))
    panels = (
        Panel("Surfaces and lines of a fixed split", FRONT_SLIP, DIFFERENCE, solid, TRACTION, sheets),
        Panel("Projection", DIFFERENCE, TRACTION, flat),
    )
    table = Table(
        "Lines of the fixed split",
        ("road", "slip slope [-]", "initial slope [-]", f"mu_delta at {100 * _AT:g} % [-]"),
        tuple(
            (r.name, f"{r.slope:.1f}", f"{s:.3f}", f"{h:.4f}") for r, s, h in zip(roads, slopes, heights, strict=True)
        ),
    )
    return figure_of("3.4", panels, (c93,), (table,))


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
        low, high = (nu, high) if slip_per_force(np.array([nu]), force)[0] > 0.0 else (low, nu)
    return 0.5 * (low + high)


def _runs() -> tuple[tuple[str, float, float, int], ...]:
    """Name, detection time, slope 8 s after the change and false alarms: blind split, another one, excitation."""
    cases = {
        "nu = 0.6, no excitation": half_car.Case("", a_x=0.0),
        "nu = 0.6, no excitation, 1 m/s^2": half_car.Case("", a_x=1.0),
        "nu = 0.3, no excitation, 1 m/s^2": half_car.Case("", a_x=1.0, nu=0.3),
        "nu = 0.6, sine of 0.07, 8 s": half_car.Case("sine", 0.07, "mu", a_x=0.0),
    }
    out = []
    for name, case in cases.items():
        d, e = half_car.drive(case), half_car.estimate(case)
        out.append((name, half_car.first_alarm(d, e), half_car.slope_at(d, e, 8.0), half_car.false_alarms(d, e)))
    return tuple(out)


def figure_3_05() -> Figure:
    """Lines of fixed splits and of a fixed force; where both axles slip alike."""
    force = forces(DRY)
    lines = {nu: split(DRY, force, nu) for nu in _NUS}
    front = float(np.abs(lines[0.0].s_delta - lines[0.0].s_f).max())
    rear = float(np.abs(lines[1.0].s_f).max())
    zero = force.size // 2
    origin = max(max(abs(float(p.s_delta[zero])), abs(float(p.mu_delta[zero]))) for p in lines.values())
    outcome = f"largest deviation: nu = 0 {front:.1e}, nu = 1 {rear:.1e}, origin {origin:.1e}"
    worst = max(front, rear, origin)
    c94 = judge("C94.figure", outcome, whole=worst < 1e-12, part=worst < 1e-3, value=worst)

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

    views = [_both_views(DRY, nu, name=f"nu = {nu:g}", colour=c, dash=d)
             for nu, c, d in zip(_NUS, _HUES, _DASHES, strict=True)]  # fmt: skip
    nus = np.linspace(0.0, 1.0, 21)
    const = split(DRY, np.full_like(nus, _F_SUM), nus)
    name = f"F_sum = {_F_SUM:g} of the weight, nu = 0 ... 1"
    x, y, z = 100.0 * const.s_f, 100.0 * const.s_delta, const.mu_delta
    solid = (*(s for s, _ in views), Line(name, x, y, z=z, colour=COLOURS[0], mode="lines+markers", group=name))
    flat = (*(f for _, f in views), Line(name, y, z, colour=COLOURS[0], mode="lines+markers", group=name))
    fine = np.linspace(0.0, 1.0, 101)
    sensitivity = [
        Line(f"force {f:g} of the weight", fine, slip_per_force(fine, f), colour=c)
        for f, c in zip(_FORCES, COLOURS, strict=False)
    ]
    sensitivity.append(Line("rear share of the load", np.full(2, LOAD_REAR), np.array([-0.06, 0.09]), colour=THRESHOLD,
                            dash="dash", width=1.0))  # fmt: skip
    share_axis, slip_axis = Axis("rear share nu"), Axis("s_delta over force / weight")
    panels = (
        Panel("Surface and lines of fixed splits", FRONT_SLIP, DIFFERENCE, solid, TRACTION, (sheet(DRY),)),
        Panel("Projection", DIFFERENCE, TRACTION, flat),
        Panel("Differential slip per force", share_axis, slip_axis, tuple(sensitivity)),
    )
    initial = {nu: initial_slope(DRY, nu) for nu in _NUS}
    slopes = Table(
        "Initial slope of the projected lines",
        ("nu", "initial slope [-]", "s_delta per force over weight [-]"),
        tuple(
            (f"{nu:g}", "–" if np.isnan(v) else f"{v:.2f}", f"{slip_per_force(np.array([nu]), 1e-6)[0]:.5f}")
            for nu, v in initial.items()
        ),
    )
    over_change = Table(
        "Runs over the change at t = 0 (slope 30 to 10), with a required minimum of differential traction",
        ("run", "drop found [s]", "slope after 8 s [-]", "false alarms"),
        tuple((n, seconds(t), f"{s:.1f}", str(k)) for n, t, s, k in runs),
    )
    return figure_of("3.5", panels, (c94, c95), (slopes, over_change))


FIGURES = {"3.1": figure_3_01, "3.3": figure_3_03, "3.4": figure_3_04, "3.5": figure_3_05}
