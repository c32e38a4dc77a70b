"""Contact patch: residual friction and slip stiffness by integration, and a friction estimate under noise."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.model.tyre import F_Z_ANCHOR, TYRES
from aqualog.physics.contact import contact_share, friction_ratio, remaining_share, slip_stiffness_ratio
from aqualog.physics.tyre_brush import brush_force, brush_stiffness
from aqualog.reproduce.check import Check, Checks, Maker, Plan
from aqualog.reproduce.verdict import judged

__all__ = ["CHECKS", "SEEDS"]

SEEDS = range(11000, 11200)
KMH = 1.0 / 3.6  # [m/s]
_TINY_SLIP = 1e-9
_EXACT = 1e-9  # relative deviation of two derivations of one number


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


def _friction(plan: Plan) -> Checks:
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
    return (
        Check(
            "C7",
            f"formulas within {_EXACT:g} of mu F_z, the brush at a slip of 1e6 within 1e-6 (it only comes near its "
            "limit), 0 and mu F_z at b = -a and b = a",
            f"largest deviation {worst:.1e} of mu F_z over {a.size} random contacts (package, print, integral of the "
            f"parabola from -a to b), {limit:.1e} against the brush; ends {ends[0]:g} and {ends[1]:g}",
            judged(whole=whole),
            value=max(worst, limit),
            reason="" if whole else "The derivations differ.",
            source="integration",
        ),
    )


def _stiffness(plan: Plan) -> Checks:
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
    return (
        Check(
            "C8",
            f"formulas within {_EXACT:g}, the brush's own slope at a slip of {_TINY_SLIP:g} within 1e-5 of C_0",
            f"largest deviation {worst:.1e} of C_0 over {a.size} random contacts (package, print, integral over the "
            f"bristles), {slope:.1e} against the slope of the brush",
            judged(whole=worst < _EXACT and slope < 1e-5),
            value=max(worst, slope),
            reason="" if worst < _EXACT and slope < 1e-5 else "The derivations differ.",
            source="integration",
        ),
    )


def _pure_tyre_parameter(plan: Plan) -> Checks:
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
    return (
        Check(
            "C2",
            "central difference of the brush force at zero slip, two random frictions each: alike within 1e-5",
            f"largest relative difference {between:.1e} over {n} pairs of frictions between 0.05 and 1.2 ({off:.1e} "
            "against the stiffness itself)",
            judged(whole=between < 1e-5 and off < 1e-5),
            value=between,
            reason="" if max(between, off) < 1e-5 else "Friction is in the initial slope.",
            source="finite differences of the brush",
        ),
    )


def _early(_: Plan) -> Checks:
    L = np.linspace(0.001, 0.999, 999)
    one = np.ones(1)
    big, tiny = np.array([1e7]), np.array([_TINY_SLIP])
    mu = np.array([float(brush_force(big, one, mu=1.0, C_s=30.0, L=x)[0]) for x in L])
    C = np.array([float(brush_force(tiny, one, mu=1.0, C_s=30.0, L=x)[0]) / _TINY_SLIP / 30.0 for x in L])
    lead = float((mu - C).min())
    power = float(np.polyfit(np.log(L), np.log(C), 1)[0])
    k = int(np.searchsorted(L, 0.9))
    whole = lead > 0.0 and abs(power - 2.0) < 1e-3
    return (
        Check(
            "C11",
            "normalised slope below normalised friction for every 0 < L < 1, exponent of L 2 within 0.001",
            f"least lead {lead:.1e} over {L.size} contact lengths, exponent {power:.4f}; at 90 % of the contact the "
            f"slope has lost {100 * (1 - C[k]):.0f} %, the friction {100 * (1 - mu[k]):.1f} %",
            judged(whole=whole),
            value=lead,
            reason="" if whole else "The friction falls first somewhere.",
            source="slope and maximum of the brush on a shortened contact",
        ),
    )


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
    model = (
        "The law of the contact length is the simulator's own, chosen in shape (1 - (v / v_full)^4) from published "
        "curves: that it grows so on a road needs a tyre sensor."
    )
    L = 1.0 - lost[:, 3]
    C, mu = slip_stiffness_ratio(L), friction_ratio(L)
    inside = (L > 0.0) & (L < 1.0)
    below = float((mu - C)[inside].min())
    at = [[float(v[np.argmax(curve < 0.8)] / KMH) for curve in curves] for curves in (C, mu)]
    order = below > 0.0 and all(c < m for c, m in zip(*at, strict=True)) and at[0] == sorted(at[0])
    return (
        Check(
            "C9",
            "the lost share of the contact grows with speed and with water height everywhere below full aquaplaning; "
            "measured, for the claim as a whole",
            f"least growth over 2 km/h {over_v:.1e}, over the steps of {len(heights)} heights from 0.6 to 3 mm "
            f"{over_h:.1e}, at {', '.join(f'{p / 1e5:g}' for p in pressures)} bar",
            judged(whole=False, part=grows),
            value=min(over_v, over_h),
            reason=model,
            source="contact law, simulator",
        ),
        Check(
            "C10",
            "for three pressures at 1.3 mm the slope lies below the friction at every speed, loses 20 % at a lower "
            "one, and later with more pressure; measured contact lengths, for the claim as a whole",
            f"20 % lost at {', '.join(f'{x:.0f}' for x in at[0])} km/h (slope) and "
            f"{', '.join(f'{x:.0f}' for x in at[1])} km/h (friction) at "
            f"{', '.join(f'{p / 1e5:g}' for p in pressures)} bar; least lead {below:.1e}",
            judged(whole=False, part=order),
            value=at[1][0] - at[0][0],
            unit="km/h",
            reason=model,
            source="contact law, simulator; 2.1, 2.2",
        ),
    )


CHECKS: tuple[tuple[tuple[str, ...], Maker], ...] = (
    (("C2",), _pure_tyre_parameter),
    (("C7",), _friction),
    (("C8",), _stiffness),
    (("C9", "C10"), _wedge),
    (("C11",), _early),
)
