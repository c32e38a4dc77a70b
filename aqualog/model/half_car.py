"""Half-car of thesis 3.3 on brush tyres, which makes the noise-free input of the slip-slope estimator.

Two axles, each one wheel; quasi-static load transfer; no transient tyre or body. Forward driving only: rolling
resistance always acts backwards, as printed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from aqualog.core.compiled import compiled, inlined
from aqualog.core.errors import ConfigError
from aqualog.core.records import FloatArray
from aqualog.model.excitation import axle_forces, excitation_amplitude, waveform
from aqualog.model.scenario import Excitation
from aqualog.physics import load, resistance, slip, tyre_brush

__all__ = ["HalfCar", "HalfCarResult", "HalfCarRun", "SurfaceChange", "simulate_half_car"]


class HalfCar(NamedTuple):
    """Parameters, SI; `f` and `r` are whole axles. A mid-size car (K), slip slope 30 on high friction (thesis 3.3)."""

    mass: float = 1650.0
    l_f: float = 1.405
    l_r: float = 1.405
    h_cg: float = 0.52
    drag_area: float = 0.66  # c_w A [m^2]
    air_density: float = 1.204
    inertia_f: float = 2.4  # of both wheels [kg m^2]
    inertia_r: float = 2.4
    r_e_f: float = 0.317
    r_e_r: float = 0.317
    r_l_f: float = 0.309
    r_l_r: float = 0.309
    r_w: float = 0.0105  # rolling resistance coefficient, r_D of the thesis [-]
    mu: float = 1.0
    slope_f: float = 30.0  # C_s / F_z [-]
    slope_r: float = 30.0


@dataclass(frozen=True, slots=True)
class SurfaceChange:
    """Surface under both axles from the time `t` [s] on: slip slopes C_s / F_z and friction, all at once. [-]"""

    t: float
    slope_f: float
    slope_r: float
    mu: float


@dataclass(frozen=True, slots=True)
class HalfCarRun:
    """One drive: from `v0` [m/s] with the acceleration `a_x` [m/s²], `nu` of the force on the REAR axle (E19).

    Time runs from `t_start` [s]: excitation and surface changes are functions of it, so that a change can be at t = 0
    whatever the period.
    """

    duration: float
    dt: float = 1e-3
    v0: float = 30.0
    a_x: float = 0.0
    nu: float = 0.5
    excitation: Excitation | None = None
    surface: tuple[SurfaceChange, ...] = ()
    t_start: float = 0.0


@dataclass(frozen=True, slots=True)
class HalfCarResult:
    """Arrays (n + 1,) at t_start, t_start + dt, ... t_start + duration; SI.

    `a_x` is dv_x/dt; `s_*` slip of (3.13); `mu_*` the traction coefficient F_x / F_z; `slope_*` the true C_s / F_z and
    `mu_max` the friction under the axles.
    """

    t: FloatArray
    v_x: FloatArray
    omega_f: FloatArray
    omega_r: FloatArray
    a_x: FloatArray
    s_f: FloatArray
    s_r: FloatArray
    mu_f: FloatArray
    mu_r: FloatArray
    F_z_f: FloatArray
    F_z_r: FloatArray
    F_x_f: FloatArray
    F_x_r: FloatArray
    torque_f: FloatArray
    torque_r: FloatArray
    slope_f: FloatArray
    slope_r: FloatArray
    mu_max: FloatArray

    @property
    def slope(self) -> FloatArray:
        """True slip slope of the front axle, to which (3.18) refers. [-]"""
        return self.slope_f


class _Loads(NamedTuple):
    """Return static axle loads [N] and the load that 1 m/s² moves from the front to the rear axle [kg], (3.33)."""

    front: float
    rear: float
    transfer: float


class _Inputs(NamedTuple):
    """At every time step: axle torques [N·m], slip slopes and friction [-]."""

    torque_f: FloatArray
    torque_r: FloatArray
    slope_f: FloatArray
    slope_r: FloatArray
    mu: FloatArray


_brush_force = inlined(tyre_brush.brush_force)
_brush_slope = inlined(tyre_brush.brush_slope)
_bounded_slip = inlined(slip.bounded_slip)
_air_drag = inlined(resistance.air_drag)
_rolling_force = inlined(resistance.rolling_resistance_force)
_GAMMA = 1.0 - 1.0 / np.sqrt(2.0)


@compiled
def _rhs(p, z, v, omega_f, omega_r, torque_f, torque_r, slope_f, slope_r, mu):  # type: ignore[no-untyped-def]
    """Time derivatives of v_x and both wheel speeds (3.28 to 3.33), slips, traction coefficients and loads.

    At a given slip slope C_s / F_z the brush force is proportional to the load, so that the traction coefficients do
    not depend on the load. The loop of acceleration, load transfer and force (E15) then closes without iteration:
    m a = mu_f (F_z_f0 - c a) + mu_r (F_z_r0 + c a) - drag, c = m h / l.
    """
    s_f = _bounded_slip(omega_f * p.r_e_f, v)
    s_r = _bounded_slip(omega_r * p.r_e_r, v)
    mu_f = _brush_force(s_f, 1.0, mu, slope_f)
    mu_r = _brush_force(s_r, 1.0, mu, slope_r)
    drag = _air_drag(v, p.drag_area, p.air_density)
    a = (mu_f * z.front + mu_r * z.rear - drag) / (p.mass + (mu_f - mu_r) * z.transfer)
    F_z_f = z.front - z.transfer * a
    F_z_r = z.rear + z.transfer * a
    # r_D F_z of (3.29) is a force: it takes the arm of the wheel to be a torque (E14)
    rolling_f = _rolling_force(F_z_f, p.r_w)
    rolling_r = _rolling_force(F_z_r, p.r_w)
    omega_dot_f = (torque_f - p.r_l_f * (mu_f * F_z_f + rolling_f)) / p.inertia_f
    omega_dot_r = (torque_r - p.r_l_r * (mu_r * F_z_r + rolling_r)) / p.inertia_r
    return a, omega_dot_f, omega_dot_r, s_f, s_r, mu_f, mu_r, F_z_f, F_z_r


@compiled
def _slip_derivatives(rim, s, r_e):  # type: ignore[no-untyped-def]
    """Derivatives of the slip by wheel speed and by velocity."""
    if abs(rim) > 0.5:
        return r_e * (1.0 - s * np.sign(rim)) / abs(rim), -1.0 / abs(rim)
    return 2.0 * r_e, -2.0


@compiled
def _integrate(n, dt, v, omega_f, omega_r, p, z, u):  # type: ignore[no-untyped-def]
    """Integrate `n` steps; return rows of the state and the outputs of `_rhs` there.

    ROS2, (1 - g h J) k1 = f(y), (1 - g h J) k2 = f(y + h k1) - 2 k1, y += 1.5 h k1 + 0.5 h k2: a W-method, of second
    order for any J, L-stable for the exact one with g = 1 - 1/sqrt(2). J holds the tyres' slip: the wheels on their
    diagonal, and the coupling of each with the velocity. The diagonal alone is unstable where h g C_s/F_z / v exceeds
    about 0.7, at 10 ms up to 4 m/s. Missing in J: air drag and the load transfer, which are not stiff.

    Torques are taken at both ends of a step, slip slope and friction at its beginning, so that a change of the surface
    on a time step costs no accuracy.
    """
    rows = np.empty((n + 1, 10))
    for k in range(n + 1):
        slope_f, slope_r, mu = u.slope_f[k], u.slope_r[k], u.mu[k]
        a, acc_f, acc_r, s_f, s_r, mu_f, mu_r, F_z_f, F_z_r = _rhs(
            p, z, v, omega_f, omega_r, u.torque_f[k], u.torque_r[k], slope_f, slope_r, mu
        )
        rows[k, 0], rows[k, 1], rows[k, 2], rows[k, 3] = v, omega_f, omega_r, a
        rows[k, 4], rows[k, 5], rows[k, 6], rows[k, 7] = s_f, s_r, mu_f, mu_r
        rows[k, 8], rows[k, 9] = F_z_f, F_z_r
        if k == n:
            break
        # g h J, an arrow: the velocity in the first row and column, the wheels on the diagonal
        gh = _GAMMA * dt
        inverse_mass = 1.0 / (p.mass + (mu_f - mu_r) * z.transfer)
        C_f = gh * _brush_slope(s_f, 1.0, mu, slope_f) * F_z_f
        C_r = gh * _brush_slope(s_r, 1.0, mu, slope_r) * F_z_r
        ds_domega_f, ds_dv_f = _slip_derivatives(omega_f * p.r_e_f, s_f, p.r_e_f)
        ds_domega_r, ds_dv_r = _slip_derivatives(omega_r * p.r_e_r, s_r, p.r_e_r)
        vv = 1.0 - inverse_mass * (C_f * ds_dv_f + C_r * ds_dv_r)
        vf = inverse_mass * C_f * ds_domega_f
        vr = inverse_mass * C_r * ds_domega_r
        fv = -p.r_l_f / p.inertia_f * C_f * ds_dv_f
        rv = -p.r_l_r / p.inertia_r * C_r * ds_dv_r
        ff = 1.0 + p.r_l_f / p.inertia_f * C_f * ds_domega_f
        rr = 1.0 + p.r_l_r / p.inertia_r * C_r * ds_domega_r
        pivot = vv - vf * fv / ff - vr * rv / rr

        v1 = (a + vf * acc_f / ff + vr * acc_r / rr) / pivot
        f1 = (acc_f + fv * v1) / ff
        r1 = (acc_r + rv * v1) / rr
        a, acc_f, acc_r, _, _, _, _, _, _ = _rhs(
            p, z, v + dt * v1, omega_f + dt * f1, omega_r + dt * r1, u.torque_f[k + 1], u.torque_r[k + 1],
            slope_f, slope_r, mu,
        )  # fmt: skip
        a, acc_f, acc_r = a - 2.0 * v1, acc_f - 2.0 * f1, acc_r - 2.0 * r1
        v2 = (a + vf * acc_f / ff + vr * acc_r / rr) / pivot
        f2 = (acc_f + fv * v2) / ff
        r2 = (acc_r + rv * v2) / rr
        v += dt * (1.5 * v1 + 0.5 * v2)
        omega_f += dt * (1.5 * f1 + 0.5 * f2)
        omega_r += dt * (1.5 * r1 + 0.5 * r2)
    return rows


def _axle_loads(car: HalfCar, a_x: float) -> tuple[FloatArray, FloatArray]:
    """Loads of front and rear axle (1,). [N]"""
    fl, fr, rl, rr = load.loads_of_wheels(
        np.array([a_x]), np.zeros(1), mass=car.mass, l_f=car.l_f, l_r=car.l_r, h_cg=car.h_cg, track=1.0
    )
    return fl + fr, rl + rr


def _inputs(car: HalfCar, run: HalfCarRun, t: FloatArray) -> tuple[_Inputs, float, float]:
    """Return torques and surface over the drive, and the slips at its start."""
    v = run.v0 + run.a_x * (t - run.t_start)
    F_sum = car.mass * run.a_x + resistance.air_drag(v, drag_area=car.drag_area, air_density=car.air_density)
    F_exc = np.zeros_like(t)
    if run.excitation is not None:
        exc = run.excitation
        F_0_f, F_0_r = axle_forces(F_sum, F_exc, nu=run.nu)
        amplitude = excitation_amplitude(exc.amplitude_kind, exc.amplitude, F_0_f, F_0_r, *_axle_loads(car, 0.0))
        F_exc = amplitude * waveform(exc.waveform, t, period=exc.period_s)
    F_f, F_r = axle_forces(F_sum, F_exc, nu=run.nu)
    F_z_f, F_z_r = _axle_loads(car, run.a_x)

    slope_f = np.full_like(t, car.slope_f)
    slope_r = np.full_like(t, car.slope_r)
    mu = np.full_like(t, car.mu)
    for change in sorted(run.surface, key=lambda c: c.t):
        later = t > change.t - 1e-6 * run.dt
        slope_f[later] = change.slope_f
        slope_r[later] = change.slope_r
        mu[later] = change.mu
    rolling_f = resistance.rolling_resistance_force(F_z_f, r_w=car.r_w)
    rolling_r = resistance.rolling_resistance_force(F_z_r, r_w=car.r_w)
    torque_f = car.r_l_f * (F_f + rolling_f) + car.inertia_f * run.a_x / car.r_e_f
    torque_r = car.r_l_r * (F_r + rolling_r) + car.inertia_r * run.a_x / car.r_e_r
    s_f = float(tyre_brush.brush_slip(F_f[:1] / F_z_f, mu=mu[0], slope=slope_f[0])[0])
    s_r = float(tyre_brush.brush_slip(F_r[:1] / F_z_r, mu=mu[0], slope=slope_r[0])[0])
    return _Inputs(torque_f, torque_r, slope_f, slope_r, mu), s_f, s_r


def simulate_half_car(car: HalfCar, run: HalfCarRun) -> HalfCarResult:
    """Simulate the half-car.

    Parameters
    ----------
    run : HalfCarRun
        The requested speed v0 + a_x (t - t_start) must not become negative.

    Returns
    -------
    HalfCarResult

    The axle torques are functions of time, as in the thesis. They follow the axle forces of (3.26) and (3.27), whose
    sum is m a_x and the air drag at the requested speed: M = r_l (F_x + r_w F_z) + I a_x / r_e, with the loads at a_x.
    The axle forces then equal the requested ones except during changes of slip, in which the wheels take or give
    I (omega_dot - a_x / r_e) / r_l: below 1 N for 250 N of excitation at 8 s. An axle without force (nu = 0, 1) gets
    the torque of its own rolling resistance; without it the axle would brake the car. The run begins at the slip of its
    first forces.

    The loaded radius is the arm of the force and the effective one the rolling radius, as printed. Their difference
    makes the wheels give (r_e / r_l - 1), 2.6 %, more power to the car than they take from the drive. With equal radii
    the balance of energy closes.

    Thesis: Eq. (3.26) to (3.33), with E14 (rolling resistance is a torque r_l r_D F_z) and E15 (load transfer in closed
    form).
    """
    car = HalfCar(*(float(x) for x in car))
    if run.dt <= 0.0 or run.duration < run.dt:
        raise ConfigError(f"a run of {run.duration:g} s in steps of {run.dt:g} s", expected="0 < dt <= duration")
    if run.v0 <= 0.0 or run.v0 + run.a_x * run.duration < 0.0:
        raise ConfigError(
            "the half-car would stand still or drive backwards", expected="v0 > 0 and v0 + a_x duration >= 0"
        )
    n = round(run.duration / run.dt)
    t: FloatArray = run.t_start + np.arange(n + 1, dtype=np.float64) * run.dt
    inputs, s_f, s_r = _inputs(car, run, t)
    front, rear = _axle_loads(car, 0.0)
    loads = _Loads(float(front[0]), float(rear[0]), float((front - _axle_loads(car, 1.0)[0])[0]))
    omega_f = run.v0 / (car.r_e_f * (1.0 - s_f))
    omega_r = run.v0 / (car.r_e_r * (1.0 - s_r))
    rows = _integrate(n, float(run.dt), float(run.v0), omega_f, omega_r, car, loads, inputs)
    columns = np.ascontiguousarray(rows.T)
    v_x, omega, a_x, slip_x, mu_x, F_z = columns[0], columns[1:3], columns[3], columns[4:6], columns[6:8], columns[8:10]
    return HalfCarResult(
        t=t, v_x=v_x, omega_f=omega[0], omega_r=omega[1], a_x=a_x, s_f=slip_x[0], s_r=slip_x[1],
        mu_f=mu_x[0], mu_r=mu_x[1], F_z_f=F_z[0], F_z_r=F_z[1], F_x_f=mu_x[0] * F_z[0], F_x_r=mu_x[1] * F_z[1],
        torque_f=inputs.torque_f, torque_r=inputs.torque_r, slope_f=inputs.slope_f, slope_r=inputs.slope_r,
        mu_max=inputs.mu,
    )  # fmt: skip
