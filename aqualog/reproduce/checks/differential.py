"""Differential slip and the filter's output equation, each against a second derivation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.detect.slip_slope.tuning import TUNING
from aqualog.figures.study import SUV
from aqualog.model.half_car import HalfCarRun, simulate_half_car
from aqualog.physics import differential
from aqualog.physics.slip import wheel_slip
from aqualog.physics.tyre_brush import brush_stiffness
from aqualog.reproduce.check import Check, Checks, Maker, Plan
from aqualog.reproduce.road_noise import DT, run
from aqualog.reproduce.verdict import judged

__all__ = ["CHECKS", "SEEDS"]

SEEDS = range(11000, 11200)
_EXACT = 1e-11
_N = 5000


def _identity(claim: str, what: str, worst: float, *, most: float = _EXACT, part: str = "", n: int = _N) -> Check:
    """A check of two derivations of one number."""
    return Check(
        claim,
        f"{what}: largest deviation below {most:g}",
        f"{worst:.1e} over {n} random cases",
        judged(whole=worst < most),
        part=part,
        value=worst,
        reason="" if worst < most else "The derivations differ.",
        source="random numbers, second derivation",
    )


def _axles(plan: Plan) -> dict[str, FloatArray]:
    """Random linear tyres on both axles, arrays (n,): slopes, traction, offsets, slips and rim speeds."""
    rng = np.random.default_rng(plan.seeds[0])
    x = {
        name: rng.uniform(low, high, _N)
        for name, low, high in (
            ("C_F", 8.0, 60.0),
            ("C_R", 8.0, 60.0),
            ("mu_F", -0.3, 0.3),
            ("mu_R", -0.3, 0.3),
            ("d_F", -5e-3, 5e-3),
            ("d_R", -5e-3, 5e-3),
            ("v", 8.0, 60.0),
            ("r_F", 0.28, 0.38),
            ("r_R", 0.28, 0.38),
        )
    }
    for axle in "FR":
        x[f"s_{axle}"] = x[f"mu_{axle}"] / x[f"C_{axle}"] + x[f"d_{axle}"]
        x[f"omega_{axle}"] = x["v"] / (1.0 - x[f"s_{axle}"]) / x[f"r_{axle}"]
        x[f"v_{axle}"] = x[f"r_{axle}"] * x[f"omega_{axle}"]
    return x


def _slips(plan: Plan) -> Checks:
    x = _axles(plan)
    # 3.12: bristles bent from the front edge on, summed over the patch
    a, c_px = 0.2 * x["r_F"], 1e6 * x["C_F"]
    node, weight = np.polynomial.legendre.leggauss(4)
    place = a[:, None] * node
    summed = np.sum(c_px[:, None] * (a[:, None] - place) * a[:, None] * weight, axis=1)
    c79 = float(np.abs(summed / brush_stiffness(c_px, a) - 1.0).max())
    # 3.13: way of the rim against way of the car over one turn
    turn = 2.0 * np.pi
    rim, car = turn * x["r_F"], turn / x["omega_F"] * x["v"]
    c80 = float(np.abs((rim - car) / rim - wheel_slip(x["omega_F"] * x["r_F"], x["v"], 1.0)).max())
    rho = differential.speed_ratio(x["v_F"], x["v_R"])
    s_delta = differential.differential_slip(x["v_F"], x["v_R"])
    c84 = float(
        max(
            np.abs(s_delta + rho * x["s_R"] - x["s_F"]).max(),
            np.abs(rho - (x["r_R"] * x["omega_R"]) / (x["r_F"] * x["omega_F"])).max(),
        )
    )
    # no velocity: the same wheel speeds from a car at another speed with other slips
    worst = 0.0
    for i, j, front in (("F", "R", True), ("R", "F", False)):
        ratio = differential.slope_ratio(x["C_F"], x["C_R"])
        beta = np.array([differential.beta_of_ratio(float(r), front=front) for r in ratio])
        ratio_v = differential.speed_ratio(x[f"v_{i}"], x[f"v_{j}"])
        predicted = differential.predicted_differential_slip(
            x[f"mu_{i}"],
            ratio_v * x[f"mu_{j}"],
            inverse_slope=1.0 / x[f"C_{i}"],
            beta=beta,
            offset=x[f"d_{i}"] - ratio_v * x[f"d_{j}"],
        )
        worst = max(worst, float(np.abs(predicted - (1.0 - x[f"v_{j}"] / x[f"v_{i}"])).max()))
    sign = (
        "With the printed 3.14, mu = C (s + delta), the offsets of 3.18 and 3.19 would have the other sign; 3.18 as "
        "printed belongs to mu = C (s - delta), which is taken here. Slopes do not depend on it."
    )
    # the printed pair of 3.14 and 3.18, taken literally
    literal = np.abs(x["d_F"] - rho * x["d_R"]).max() * 2.0
    c86 = _identity("C86", "slip from wheel speeds against prediction, both axles, s = mu / C + delta", worst)
    return (
        _identity("C79", "integral over the bristles against 2 c_px a^2, relative", c79),
        _identity("C80", "ways of rim and car over a turn against the slip", c80),
        _identity("C84", "slips of both axles against the wheel speeds alone", c84),
        replace(
            c86,
            verdict=judged(whole=False, part=worst < _EXACT),
            reason=sign,
            found=f"{c86.found}; 3.14 and 3.18 as printed, taken together, are up to {literal:.1e} of slip apart",
        ),
    )


def _output_equation(plan: Plan) -> Checks:
    x = _axles(plan)
    rng = np.random.default_rng(plan.seeds[0] + 1)
    k, beta, delta = rng.uniform(0.01, 0.2, _N), rng.uniform(0.3, 3.0, _N), rng.uniform(-0.02, 0.02, _N)
    states = np.array([k, beta, delta])

    def h(z: FloatArray) -> FloatArray:
        return differential.predicted_differential_slip(
            x["mu_F"], x["mu_R"], inverse_slope=z[0], beta=z[1], offset=z[2]
        )

    H = differential.jacobian(x["mu_F"], x["mu_R"], inverse_slope=k, beta=beta)
    worst = 0.0
    for axis, step in enumerate((1e-4, 1e-3, 1e-4)):
        move = np.zeros((3, 1))
        move[axis] = step
        worst = max(worst, float(np.abs(H[axis] - (h(states + move) - h(states - move)) / (2.0 * step)).max()))
    # both forms give the same statement on the pair of wheel speeds
    rho = x["v_R"] / x["v_F"]
    ratio = x["C_R"] / x["C_F"]
    front = differential.predicted_differential_slip(
        x["mu_F"], rho * x["mu_R"], inverse_slope=1.0 / x["C_F"], beta=1.0 / ratio, offset=x["d_F"] - rho * x["d_R"]
    )
    rear = differential.predicted_differential_slip(
        x["mu_R"], x["mu_F"] / rho, inverse_slope=1.0 / x["C_R"], beta=ratio, offset=x["d_R"] - x["d_F"] / rho
    )
    forms = float(np.abs((1.0 - front) * (1.0 - rear) - 1.0).max())
    return (
        _identity(
            "C88", "derivatives of the output equation against central differences", worst, most=1e-9, part="Jacobian"
        ),
        _identity("C88", "front and rear form predict the same pair of wheel speeds", forms, part="both forms"),
    )


def _one_driven_axle(_: Plan) -> Checks:
    """Half-car with one driven axle: the true slope, whatever ratio is assumed; each side by itself."""
    worst_slip, errors = 0.0, []
    for nu, front in ((0.0, True), (1.0, False)):
        for true in (30.0, 18.0):
            car = SUV._replace(slope_f=true, slope_r=true)
            parts = [
                simulate_half_car(car, HalfCarRun(4.0, v0=20.0, a_x=a, nu=nu)) for a in (0.1, 0.3, -0.3, 0.2, -0.4, 0.3)
            ]
            i, j = ("f", "r") if front else ("r", "f")
            col = {
                n: np.concatenate([getattr(p, n)[::10] for p in parts])
                for n in (f"omega_{i}", f"omega_{j}", f"mu_{i}", f"mu_{j}", f"s_{i}")
            }
            v_i, v_j = col[f"omega_{i}"] * 0.4, col[f"omega_{j}"] * 0.4
            y, rho = differential.differential_slip(v_i, v_j), differential.speed_ratio(v_i, v_j)
            worst_slip = max(worst_slip, float(np.abs(y - col[f"s_{i}"])[20:].max()))
            for beta in (0.6, 1.0, 1.7):
                e = run(TUNING, y, col[f"mu_{i}"], rho * col[f"mu_{j}"], slope=1.2 * true, beta=beta)
                errors.append(float(e.slope[-1]) / true - 1.0)
    sides = []
    t = np.arange(6000) * DT
    mu_F, mu_R = 0.05 + 0.05 * np.sin(t), 0.04 + 0.04 * np.sin(1.7 * t)
    for true in (14.0, 33.0):
        v_F, v_R = 25.0 / (1.0 - mu_F / true), 25.0 / (1.0 - mu_R / true)
        e = run(TUNING, differential.differential_slip(v_F, v_R), mu_F, v_R / v_F * mu_R)
        sides.append(float(e.slope[-1]) / true - 1.0)
    worst = max(map(abs, (*errors, *sides)))
    whole = worst < 0.05 and worst_slip < 2e-4
    return (
        Check(
            "C87",
            "half-car with front or rear drive: differential slip within 2e-4 of the driven axle's slip, slope "
            "within 5 % of the true one whatever ratio (0.6, 1, 1.7) is assumed; two sides with slopes of 14 and 33 "
            "each within 5 %",
            f"slip within {worst_slip:.1e}; slope off by {100 * min(errors):.1f} to {100 * max(errors):.1f} % over "
            f"{len(errors)} cases; sides {100 * sides[0]:+.1f} and {100 * sides[1]:+.1f} %",
            judged(whole=whole, part=worst < 0.15),
            value=worst,
            ci95=(min(errors), max(errors)),
            reason="" if whole else "The brush's curve bends; a line through its points is flatter than its tangent.",
            source="half-car of 3.3, noise-free",
        ),
    )


CHECKS: tuple[tuple[tuple[str, ...], Maker], ...] = (
    (("C79", "C80", "C84", "C86"), _slips),
    (("C87",), _one_driven_axle),
    (("C88",), _output_equation),
)
