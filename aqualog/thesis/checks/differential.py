"""Differential slip and the filter's output equation against a second derivation, and the half-car's balances."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.detect.slip_slope.tuning import TUNING
from aqualog.model.half_car import HalfCarRun, SurfaceChange, simulate_half_car
from aqualog.model.scenario import Excitation
from aqualog.physics import differential
from aqualog.physics.slip import wheel_slip
from aqualog.physics.tyre_brush import brush_stiffness
from aqualog.thesis.claims import Check, Checks, judge
from aqualog.thesis.evidence.half_car import DT, HIGH_SLOPE, LOW_SLOPE, SUV, estimated
from aqualog.thesis.evidence.seeds import Maker, Plan

__all__ = ["CHECKS"]

_EXACT = 1e-11
_N = 5000


def _identity(key: str, worst: float, *, most: float = _EXACT) -> Check:
    """A check of two derivations of one number."""
    return judge(key, f"{worst:.1e} over {_N} random cases", whole=worst < most, value=worst)


def _axles(plan: Plan) -> dict[str, FloatArray]:
    """Random linear tyres on both axles, arrays (n,): slopes, traction, offsets, slips and rim speeds."""
    rng = np.random.default_rng(plan.seeds[0])
    bounds = {
        "C_F": (8.0, 60.0), "C_R": (8.0, 60.0), "mu_F": (-0.3, 0.3), "mu_R": (-0.3, 0.3), "d_F": (-5e-3, 5e-3),
        "d_R": (-5e-3, 5e-3), "v": (8.0, 60.0), "r_F": (0.28, 0.38), "r_R": (0.28, 0.38),
    }  # fmt: skip
    x = {name: rng.uniform(low, high, _N) for name, (low, high) in bounds.items()}
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
    of_slip = np.abs(s_delta + rho * x["s_R"] - x["s_F"]).max()
    c84 = float(max(of_slip, np.abs(rho - (x["r_R"] * x["omega_R"]) / (x["r_F"] * x["omega_F"])).max()))
    # no velocity: the same wheel speeds from a car at another speed with other slips
    worst = 0.0
    for i, j, front in (("F", "R", True), ("R", "F", False)):
        ratio = differential.slope_ratio(x["C_F"], x["C_R"])
        beta = np.array([differential.beta_of_ratio(float(r), front=front) for r in ratio])
        ratio_v = differential.speed_ratio(x[f"v_{i}"], x[f"v_{j}"])
        inverse, offset = 1.0 / x[f"C_{i}"], x[f"d_{i}"] - ratio_v * x[f"d_{j}"]
        predicted = differential.predicted_differential_slip(
            x[f"mu_{i}"], ratio_v * x[f"mu_{j}"], inverse_slope=inverse, beta=beta, offset=offset
        )
        worst = max(worst, float(np.abs(predicted - (1.0 - x[f"v_{j}"] / x[f"v_{i}"])).max()))
    # the printed pair of 3.14 and 3.18, taken literally
    literal = np.abs(x["d_F"] - rho * x["d_R"]).max() * 2.0
    outcome = (
        f"{worst:.1e} over {_N} random cases; 3.14 and 3.18 as printed, taken together, are up to "
        f"{literal:.1e} of slip apart"
    )
    return (
        _identity("C79.theory", c79),
        _identity("C80.theory", c80),
        _identity("C84.theory", c84),
        judge("C86.theory", outcome, part=worst < _EXACT, value=worst),
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
    return (_identity("C88.theory_jacobian", worst, most=1e-9), _identity("C88.theory_forms", forms))


def _one_driven_axle(_: Plan) -> Check:
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
                e = estimated(TUNING, y, col[f"mu_{i}"], rho * col[f"mu_{j}"], slope=1.2 * true, beta=beta)
                errors.append(float(e.slope[-1]) / true - 1.0)
    sides = []
    t = np.arange(6000) * DT
    mu_F, mu_R = 0.05 + 0.05 * np.sin(t), 0.04 + 0.04 * np.sin(1.7 * t)
    for true in (14.0, 33.0):
        v_F, v_R = 25.0 / (1.0 - mu_F / true), 25.0 / (1.0 - mu_R / true)
        e = estimated(TUNING, differential.differential_slip(v_F, v_R), mu_F, v_R / v_F * mu_R)
        sides.append(float(e.slope[-1]) / true - 1.0)
    worst = max(map(abs, (*errors, *sides)))
    whole = worst < 0.05 and worst_slip < 2e-4
    outcome = (
        f"slip within {worst_slip:.1e}; slope off by {100 * min(errors):.1f} to {100 * max(errors):.1f} % over "
        f"{len(errors)} cases; sides {100 * sides[0]:+.1f} and {100 * sides[1]:+.1f} %"
    )
    return judge("C87.theory", outcome, whole=whole, part=worst < 0.15, value=worst, ci95=(min(errors), max(errors)))


def _half_car(_: Plan) -> Check:
    """C98: the half-car keeps its balances, and has the slopes that the thesis names."""
    worst_force = worst_energy = worst_load = 0.0
    for waveform in ("triangle", "sine", "ramp", "step"):
        for a_x in (0.0, 0.5, 1.0):
            car = SUV._replace(r_l_f=SUV.r_e_f, r_l_r=SUV.r_e_r)
            excitation, change = (
                Excitation(waveform, 250.0, "force", 8.0),
                SurfaceChange(6.0, LOW_SLOPE, LOW_SLOPE, 0.4),
            )
            ride = HalfCarRun(12.0, v0=20.0, a_x=a_x, nu=0.6, excitation=excitation, surface=(change,))
            r = simulate_half_car(car, ride)
            drag = 0.5 * car.drag_area * car.air_density * r.v_x**2
            worst_force = max(worst_force, float(np.abs(car.mass * r.a_x - r.F_x_f - r.F_x_r + drag).max()))
            worst_load = max(worst_load, float(np.abs(r.F_z_f + r.F_z_r - car.mass * 9.80665).max()))
            kinetic = 0.5 * (car.mass * r.v_x**2 + car.inertia_f * r.omega_f**2 + car.inertia_r * r.omega_r**2)
            power = r.torque_f * r.omega_f + r.torque_r * r.omega_r - drag * r.v_x
            for axle in "fr":
                F, s, F_z, omega = (getattr(r, f"{name}_{axle}") for name in ("F_x", "s", "F_z", "omega"))
                power = power - F * s * omega * car.r_e_f - car.r_w * F_z * car.r_e_f * omega
            gained = np.sum(0.5 * (power[1:] + power[:-1]) * ride.dt)
            worst_energy = max(worst_energy, float(abs(kinetic[-1] - kinetic[0] - gained) / kinetic[0]))
    high, low = _first_slopes()
    balanced = worst_force < 1e-6 and worst_load < 1e-6 and worst_energy < 1e-4
    off = max(float(np.abs(high / HIGH_SLOPE - 1.0).max()), float(np.abs(low / LOW_SLOPE - 1.0).max()))
    outcome = (
        f"forces {worst_force:.1e} N, loads {worst_load:.1e} N, energy {worst_energy:.1e}; traction over slip "
        f"{high.min():.2f} to {high.max():.2f} and {low.min():.2f} to {low.max():.2f}"
    )
    return judge("C98.half_car", outcome, whole=balanced and off < 0.01, part=balanced, value=off)


def _first_slopes() -> tuple[FloatArray, FloatArray]:
    """Traction over slip of both axles where the traction is small, before and after the change. [-]"""
    ride = HalfCarRun(8.0, v0=5.0, a_x=0.02, nu=0.6, surface=(SurfaceChange(4.0, LOW_SLOPE, LOW_SLOPE, 0.4),))
    r = simulate_half_car(SUV, ride)
    of = np.concatenate([r.mu_f / r.s_f, r.mu_r / r.s_r])
    small = np.concatenate([np.abs(r.mu_f), np.abs(r.mu_r)]) < 0.01
    t = np.tile(r.t, 2)
    return of[small & (t > 1.0) & (t < 4.0)], of[small & (t > 5.0)]


CHECKS = (
    Maker(("C79", "C80", "C84", "C86"), _slips),
    Maker(("C87",), _one_driven_axle),
    Maker(("C88",), _output_equation),
    Maker(("C98",), _half_car),
)
