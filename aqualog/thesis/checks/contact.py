"""Contact patch: residual friction and slip stiffness by integration, and a friction estimate under noise."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.model.tyre import TYRES
from aqualog.physics.contact import contact_share, friction_ratio, remaining_share, slip_stiffness_ratio
from aqualog.physics.hydroplaning import F_Z_ANCHOR
from aqualog.physics.tyre_brush import brush_force, brush_stiffness
from aqualog.thesis.claims import Check, Checks, judge, limit, limits
from aqualog.thesis.evidence.seeds import Maker, Plan, bootstrap

__all__ = ["CHECKS"]

KMH = 1.0 / 3.6  # [m/s]
_TINY_SLIP = 1e-9
_EXACT = limit("exact")  # relative deviation of two derivations of one number


def _gauss(low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Nodes and weights (n, 8) of Gauss-Legendre between bounds (n,); exact for polynomials up to degree 15."""
    x, w = np.polynomial.legendre.leggauss(8)
    half = 0.5 * (high - low)[:, None]
    return half * x + 0.5 * (high + low)[:, None], half * w


def _edges(plan: Plan, n: int = 2000) -> tuple[FloatArray, FloatArray]:
    """Half lengths and front edges of the dry contact, arrays (n,). [m]"""
    rng = np.random.default_rng(plan.seeds[0])
    a = rng.uniform(0.04, 0.10, n)
    return a, a * rng.uniform(-1.0, 1.0, n)


def _friction(plan: Plan) -> Check:
    a, b = _edges(plan)
    mu, F_z = 0.8, 4000.0
    x, w = _gauss(-a, b)
    pressure = 0.75 * F_z / a[:, None] * (1.0 - (x / a[:, None]) ** 2)
    integral = mu * np.sum(pressure * w, axis=1)
    L = remaining_share(b, a)
    ours = mu * F_z * friction_ratio(L)
    printed = (2.0 * a - b) * (a + b) ** 2 * F_z * mu / (4.0 * a**3)
    # the brush at a slip at which all of the remaining contact slides
    brush = np.array([float(brush_force(np.array([1e6]), np.array([F_z]), mu=mu, C_s=1e5, L=x)[0]) for x in L])
    worst = float(max(np.abs(ours - y).max() for y in (integral, printed)) / (mu * F_z))
    limit = float(np.abs(ours - brush).max() / (mu * F_z))
    ends = [float(friction_ratio(np.array([x]))[0]) for x in (0.0, 1.0)]
    whole = worst < _EXACT and limit < 1e-6 and ends == [0.0, 1.0]
    outcome = (
        f"largest deviation {worst:.1e} of mu F_z over {a.size} random contacts (package, print, integral of the "
        f"parabola from -a to b), {limit:.1e} against the brush; ends {ends[0]:g} and {ends[1]:g}"
    )
    return judge("C7.theory", outcome, whole=whole, value=max(worst, limit))


def _stiffness(plan: Plan) -> Check:
    a, b = _edges(plan)
    c_px = np.random.default_rng(plan.seeds[0] + 1).uniform(5e6, 20e6, a.size)
    x, w = _gauss(-a, b)
    bristles = np.sum(c_px[:, None] * (b[:, None] - x) * w, axis=1)  # a bristle at x has been bent since the edge b
    L = remaining_share(b, a)
    C_0 = brush_stiffness(c_px, a)
    ours = slip_stiffness_ratio(L) * C_0
    printed = 0.5 * c_px * (a + b) ** 2
    force = np.array(
        [
            float(brush_force(np.array([_TINY_SLIP]), np.array([4000.0]), mu=0.8, C_s=C, L=x)[0]) / _TINY_SLIP
            for C, x in zip(C_0, L, strict=True)
        ]
    )
    worst = float(max(np.abs((ours - y) / C_0).max() for y in (bristles, printed)))
    slope = float(np.abs((ours - force) / C_0).max())
    outcome = (
        f"largest deviation {worst:.1e} of C_0 over {a.size} random contacts (package, print, integral over the "
        f"bristles), {slope:.1e} against the slope of the brush"
    )
    return judge("C8.theory", outcome, whole=worst < _EXACT and slope < 1e-5, value=max(worst, slope))


def _pure_tyre_parameter(plan: Plan) -> Check:
    rng = np.random.default_rng(plan.seeds[0])
    n = 2000
    C, F_z, mus = rng.uniform(4e4, 4e5, n), rng.uniform(1e3, 8e3, n), rng.uniform(0.05, 1.2, (2, n))
    step = np.array([_TINY_SLIP])

    def slope(mu: float, F: float, C_s: float) -> float:
        rise = brush_force(step, np.array([F]), mu=mu, C_s=C_s) - brush_force(-step, np.array([F]), mu=mu, C_s=C_s)
        return float(rise[0]) / (2.0 * _TINY_SLIP)

    found = np.array([[slope(m, F, c) for m, F, c in zip(row, F_z, C, strict=True)] for row in mus])
    between = float(np.abs(found[0] / found[1] - 1.0).max())
    off = float(np.abs(found / C - 1.0).max())
    outcome = (
        f"largest relative difference {between:.1e} over {n} pairs of frictions between 0.05 and 1.2 ({off:.1e} "
        "against the stiffness itself)"
    )
    return judge("C2.theory", outcome, whole=between < 1e-5 and off < 1e-5, value=between)


def _early(_: Plan) -> Check:
    L = np.linspace(0.001, 0.999, 999)
    one = np.ones(1)
    big, tiny = np.array([1e7]), np.array([_TINY_SLIP])
    mu = np.array([float(brush_force(big, one, mu=1.0, C_s=30.0, L=x)[0]) for x in L])
    C = np.array([float(brush_force(tiny, one, mu=1.0, C_s=30.0, L=x)[0]) / _TINY_SLIP / 30.0 for x in L])
    lead = float((mu - C).min())
    power = float(np.polyfit(np.log(L), np.log(C), 1)[0])
    k = int(np.searchsorted(L, 0.9))
    whole = lead > 0.0 and abs(power - 2.0) < 1e-3
    outcome = (
        f"least lead {lead:.1e} over {L.size} contact lengths, exponent {power:.4f}; at 90 % of the contact the "
        f"slope has lost {100 * (1 - C[k]):.0f} %, the friction {100 * (1 - mu[k]):.1f} %"
    )
    return judge("C11.theory", outcome, whole=whole, value=lead)


def _v_full(h: float, p: float) -> float:
    return float(TYRES["worn_summer"].full_speed(np.array(h), np.array(F_Z_ANCHOR), p=p))


def _wedge(_: Plan) -> Checks:
    exponent = TYRES["worn_summer"].contact_exponent
    v = np.arange(20.0, 150.0, 2.0) * KMH
    heights = (0.6e-3, 0.8e-3, 1.1e-3, 1.3e-3, 2.0e-3, 3.0e-3)
    pressures = (1.9e5, 2.3e5, 2.8e5)
    lost = np.array(
        [[1.0 - contact_share(v, np.array(_v_full(h, p)), exponent=exponent) for h in heights] for p in pressures]
    )
    partial = lost[..., :-1] < 1.0
    over_v = float((np.diff(lost, axis=2)[partial]).min())
    over_h = float((np.diff(lost, axis=1)[lost[:, :-1] < 1.0]).min())
    grows = over_v > 0.0 and over_h > 0.0
    L = 1.0 - lost[:, 3]
    C, mu = slip_stiffness_ratio(L), friction_ratio(L)
    inside = (L > 0.0) & (L < 1.0)
    below = float((mu - C)[inside].min())
    at = [[float(v[np.argmax(curve < 0.8)] / KMH) for curve in curves] for curves in (C, mu)]
    order = below > 0.0 and all(c < m for c, m in zip(*at, strict=True)) and at[0] == sorted(at[0])
    bars = ", ".join(f"{p / 1e5:g}" for p in pressures)
    of_slope, of_friction = (", ".join(f"{x:.0f}" for x in speeds) for speeds in at)
    growth = (
        f"least growth over 2 km/h {over_v:.1e}, over the steps of {len(heights)} heights from 0.6 to 3 mm "
        f"{over_h:.1e}, at {bars} bar"
    )
    lead = (
        f"20 % lost at {of_slope} km/h (slope) and {of_friction} km/h (friction) at {bars} bar; least lead {below:.1e}"
    )
    return (
        judge("C9.theory", growth, part=grows, value=min(over_v, over_h)),
        judge("C10.theory", lead, part=order, value=at[1][0] - at[0][0]),
    )


# C1: slip as measured on a road, 5 times a second for 10 s, with the offset of the radii unknown
_NOISE, _POINTS, _SLOPE = 5e-4, 50, 30.0
_GOOD = 0.10  # [-] spread of mu_max that may be called known
_DRY_RANGE = limits("dry_range", "C1.theory")  # [-] utilisation at which it is
_UTILISATION = np.arange(0.30, 0.96, 0.05)


def _estimates(rng: np.random.Generator, utilisation: float, mu_max: float, runs: int) -> FloatArray:
    """Estimated mu_max (runs,) of points up to a utilisation; slope, offset and mu_max by least squares of the slip."""
    mu = np.linspace(0.0, utilisation * mu_max, _POINTS)
    grid = mu_max * np.geomspace(max(1.001 * utilisation, 0.2), 20.0, 400)

    def shape(limit: FloatArray) -> FloatArray:
        return 3.0 * limit * (1.0 - np.cbrt(1.0 - mu / limit))  # slip times slope (brush, solved for the slip)

    slip = shape(np.array(mu_max)) / _SLOPE + _NOISE * rng.standard_normal((runs, _POINTS))
    left = np.empty((grid.size, runs))
    for i, top in enumerate(grid):
        design, _ = np.linalg.qr(np.column_stack([shape(top), np.ones(_POINTS)]))
        left[i] = np.sum(slip**2, axis=1) - np.sum((slip @ design) ** 2, axis=1)
    return np.asarray(grid[np.argmin(left, axis=0)])


def _utilisation(plan: Plan) -> Check:
    rng = np.random.default_rng(plan.seeds[0])
    runs = min(max(len(plan.seeds), 20), 200)
    spread = np.empty((2, _UTILISATION.size))
    needed = []
    bands = []
    for row, mu_max in enumerate((1.0, 0.3)):
        found = [_estimates(rng, u, mu_max, runs) / mu_max for u in _UTILISATION]
        half = [0.5 * float(np.subtract(*np.quantile(x, [0.84, 0.16]))) for x in found]
        spread[row] = half
        good = np.flatnonzero(np.array(half) < _GOOD)
        needed.append(float(_UTILISATION[good[0]]) if good.size else 1.0)
        bands.append(found)
    k = int(np.searchsorted(_UTILISATION, 0.6 - 1e-9))
    ci = bootstrap(bands[0][k], lambda x: 0.5 * float(np.subtract(*np.quantile(x, [0.84, 0.16]))))
    dry, low = needed
    whole = _DRY_RANGE[0] <= dry <= _DRY_RANGE[1] and low > dry
    outcome = (
        f"{dry:.2f} at mu_max = 1 and {low:.2f} at 0.3; spread at a utilisation of 0.4, 0.6, 0.8: "
        + ", ".join(f"{100 * spread[0, i]:.0f}" for i in (k - 4, k, k + 4))
        + " % dry, "
        + ", ".join(f"{100 * spread[1, i]:.0f}" for i in (k - 4, k, k + 4))
        + f" % slippery ({runs} runs each; brush of slope {_SLOPE:g}, slip noise {_NOISE:g} rms, {_POINTS} points, "
        "slope and slip offset unknown)"
    )
    return judge("C1.theory", outcome, whole=whole, part=low > dry, value=float(spread[0, k]), ci95=(min(ci), max(ci)))


CHECKS = (
    Maker(("C2",), _pure_tyre_parameter),
    Maker(("C7",), _friction),
    Maker(("C8",), _stiffness),
    Maker(("C9", "C10"), _wedge),
    Maker(("C11",), _early),
    Maker(("C1",), _utilisation),
)
