"""A small four-wheel model of a drive over a watered lane.

Honest but small: straight-line dynamics with four wheels, brush tyres whose contact the water shortens, and sensors of
a series car. Spin-downs and spin-ups are not scripted; they come out of the wheels' torque balance when the contact is
gone. It stands in for the full simulator and knows nothing of the detectors.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from aqualog.core.compiled import compiled
from aqualog.core.notation import WHEELS
from aqualog.core.vehicle import Vehicle
from aqualog.physics.load import G

Array = NDArray[np.float64]

STEP = 1e-3  # [s] integration
RHO_WATER = 1000.0  # [kg/m^3]
TYRE_WIDTH = 0.205  # [m]
FRONT_SHIFT = 0.06  # [m] forward shift of the wheel load at full aquaplaning
TRACK_CLEARING = 0.45  # share of the water that the front wheels leave in the rear wheels' track
CONTACT_EXPONENT = 5.0  # L = 1 - (v / v_full)^n; n = 4-6 fits a half slip slope 20 km/h below full aquaplaning
CONTACT_SCATTER = 0.065  # relative scatter of v_full along the road (texture, waves)
CONTACT_TIME = 0.12  # [s] its correlation time
STORAGE_DEPTH = 0.4e-3  # [m] water that the road's texture holds and that costs no momentum


@dataclass(frozen=True)
class Lane:
    """A stretch of road that is not dry asphalt, from `start_s` to `end_s`."""

    start_s: float
    end_s: float
    depth_left: float = 0.0  # [m]
    depth_right: float = 0.0
    mu: float | None = None  # another surface: friction
    slope_factor: float = 1.0  # another surface: share of the dry slip slope
    roughness: float = 0.0  # [N m] rms of the wheel torque that unevenness makes


@dataclass(frozen=True)
class Drive:
    """What is driven. Profiles are (t [s], value) pairs, linear between them."""

    vehicle: Vehicle
    duration_s: float = 20.0
    seed: int = 1
    speed_kmh: tuple[tuple[float, float], ...] = ((0.0, 98.0),)
    lanes: tuple[Lane, ...] = ()
    v_full_kmh: float = 118.0  # at 1.3 mm: worn summer tyre, low pressure
    v_full_rear_kmh: float | None = None  # another tyre at the rear
    extra_torque: tuple[tuple[float, float], ...] = ()  # [N m] on top of the speed holder's, driven axles
    brake_torque: tuple[tuple[float, float], ...] = ()  # [N m] sum of all wheels
    yaw_rate: tuple[tuple[float, float], ...] = ()  # [rad/s]
    grade: tuple[tuple[float, float], ...] = ()  # slope angle [rad]
    holds_speed: bool = True
    ideal: bool = False
    a_x_offset: float = 0.0
    rate_hz: float = 100.0
    locks: tuple[tuple[float, float, str], ...] = field(default=())  # start, end, wheel: brake torque that locks it


@compiled
def _brush(s, C, mu, F_z):  # type: ignore[no-untyped-def]
    limit = mu * F_z
    if limit <= 0.0:
        return 0.0
    theta = min(C * abs(s) / (3.0 * limit), 1.0)
    force = limit * (1.0 - (1.0 - theta) ** 3)
    return force if s > 0 else -force


@compiled
def _integrate(  # type: ignore[no-untyped-def]
    n, dt, v, target, holds, extra, brake, lock, yaw, steer, grade, depth, mu_road, slope, rough, scatter,
    v_full_f, v_full_r, F_z, r_e, inertia, split, half_track, wheelbase, mass, r_w, c_air,
):  # fmt: skip
    omega = np.empty(4)
    y = np.array([half_track, -half_track, half_track, -half_track])
    for i in range(4):
        omega[i] = v / r_e[i]
    out = np.empty((n, 14))
    integral = 0.0
    drive = 0.0
    for k in range(n):
        error = target[k] - v
        if holds:
            integral += error * dt * 60.0
            wanted = (mass * 0.8 * error + integral) * 0.31 + c_air * v * v * 0.31 + r_w * mass * G * 0.31
            drive += max(min(wanted - drive, 4000.0 * dt), -4000.0 * dt)  # a driver's foot, not a controller
        engine = drive + extra[k]
        total = -c_air * v * v - mass * G * np.sin(grade[k])
        for i in range(4):
            is_front = i < 2
            v_i = v - yaw[k] * y[i]
            if is_front:
                v_i = v_i * np.cos(steer[k]) + yaw[k] * wheelbase * np.sin(steer[k])
            film = depth[k, i % 2] * (1.0 if is_front else TRACK_CLEARING)
            contact = 1.0
            if film > 0.0:
                v_full = v_full_f if is_front else v_full_r
                v_i_full = v_full * (film / 1.3e-3) ** -0.08 * (1.0 + CONTACT_SCATTER * scatter[k, i])
                contact = 1.0 - (v_i / max(v_i_full, 1.0)) ** CONTACT_EXPONENT
                contact = min(max(contact, 0.0), 1.0)
            mu = mu_road[k] * contact * contact * (3.0 - 2.0 * contact)
            C = slope[k] * F_z[i] * contact * contact
            rim = omega[i] * r_e[i]
            s = (rim - v_i) / max(abs(v_i), abs(rim), 0.5)
            force = _brush(s, C, mu, F_z[i])
            torque = (split if not is_front else 1.0 - split) * 0.5 * engine
            braking = brake[k] * (0.32 if is_front else 0.18) + lock[k, i]
            water = RHO_WATER * TYRE_WIDTH * max(film - STORAGE_DEPTH, 0.0) * v_i * v_i
            resist = (r_w * F_z[i] + water) * r_e[i] + FRONT_SHIFT * F_z[i] * (1.0 - contact)
            load = (torque - force * r_e[i] + rough[k, i]) - (resist + braking) * np.sign(omega[i])
            # the local slope of the brush curve: with the initial one, a sliding wheel would seem to have more inertia
            theta = min(C * abs(s) / max(3.0 * mu * F_z[i], 1.0), 1.0)
            stiff = C * (1.0 - theta) ** 2 * r_e[i] ** 2 / max(abs(v_i), 1.0)
            omega[i] += dt * load / (inertia[i] + dt * stiff)
            if omega[i] < 0.0:
                omega[i] = 0.0
            total += force
            out[k, i] = omega[i]
            out[k, 4 + i] = torque - braking
            out[k, 8 + i] = contact
        a = total / mass
        v += a * dt
        out[k, 12] = v
        out[k, 13] = a
    return out


def _profile(pairs: tuple[tuple[float, float], ...], t: Array) -> Array:
    if not pairs:
        return np.zeros_like(t)
    return np.interp(t, [p[0] for p in pairs], [p[1] for p in pairs])


def simulate(drive: Drive) -> dict[str, Array]:
    """Simulate a drive: canonical signals (n,) at `rate_hz` in SI, plus truth in names that begin with `true_`."""
    vehicle = drive.vehicle
    rng = np.random.default_rng(drive.seed)
    n = round(drive.duration_s / STEP)
    t = np.arange(n) * STEP
    target = _profile(drive.speed_kmh, t) / 3.6
    yaw = _profile(drive.yaw_rate, t)
    steer = np.arctan2(vehicle.wheelbase * yaw, np.maximum(target, 3.0))
    depth, mu, slope = np.zeros((n, 2)), np.full(n, vehicle.mu_max), np.full(n, vehicle.slip_slope_f)
    rough = np.zeros((n, 4))
    delay = max(1, round(vehicle.wheelbase / max(target.mean(), 1.0) / STEP))
    for lane in drive.lanes:
        inside = (t >= lane.start_s) & (t < lane.end_s)
        depth[inside, 0], depth[inside, 1] = lane.depth_left, lane.depth_right
        if lane.mu is not None:
            mu[inside] = lane.mu
        slope[inside] *= lane.slope_factor
        if lane.roughness:
            # the rear wheels run over the same bumps a wheelbase later
            for side in (0, 1):
                bumps = np.where(inside, lane.roughness * _ou(rng, n, 0.01), 0.0)
                rough[:, side] += bumps
                rough[delay:, side + 2] += bumps[:-delay]
    lock = np.zeros((n, 4))
    for start, end, wheel in drive.locks:
        lock[(t >= start) & (t < end), WHEELS.index(wheel)] = 6000.0
    scatter = np.column_stack([_ou(rng, n, CONTACT_TIME) for _ in WHEELS])
    weight = vehicle.mass * G
    loads = np.array([vehicle.l_r, vehicle.l_r, vehicle.l_f, vehicle.l_f]) * weight / (2.0 * vehicle.wheelbase)
    raw = _integrate(
        n, STEP, target[0], target, drive.holds_speed, _profile(drive.extra_torque, t), _profile(drive.brake_torque, t),
        lock, yaw, steer, _profile(drive.grade, t), depth, mu, slope, rough, scatter, drive.v_full_kmh / 3.6,
        (drive.v_full_rear_kmh or drive.v_full_kmh) / 3.6, loads,
        np.array([vehicle.r_e(w) for w in WHEELS]),
        np.array([vehicle.inertia(w) for w in WHEELS]), vehicle.torque_split_rear, 0.5 * vehicle.track,
        vehicle.wheelbase, vehicle.mass, vehicle.rolling_resistance, 0.5 * vehicle.drag_area * vehicle.air_density,
    )  # fmt: skip
    every = round(1.0 / (drive.rate_hz * STEP))
    pick = slice(every - 1, None, every)
    signals = {
        "t": t[pick],
        "v_x": raw[pick, 12],
        "a_x": raw[pick, 13] + G * np.sin(_profile(drive.grade, t)[pick]),
        "a_y": raw[pick, 12] * yaw[pick],
        "yaw_rate": yaw[pick],
        "steer_angle": steer[pick],
        **{f"omega_{w}": raw[pick, i] for i, w in enumerate(WHEELS)},
        **{f"torque_{w}": raw[pick, 4 + i] for i, w in enumerate(WHEELS)},
        "brake_pressure": _profile(drive.brake_torque, t)[pick] * 1.5e3,
        "on_water": (depth[pick].max(axis=1) > 0).astype(float),
        **{f"true_contact_{w}": raw[pick, 8 + i] for i, w in enumerate(WHEELS)},
        "true_grade": _profile(drive.grade, t)[pick],
    }
    signals["t"] = signals["t"] - signals["t"][0]
    return signals if drive.ideal else _sensors(signals, drive, rng)


def _ou(rng: np.random.Generator, n: int, tau: float) -> Array:
    """Ornstein-Uhlenbeck noise of unit variance."""
    keep = np.exp(-STEP / tau)
    noise = rng.normal(size=n) * np.sqrt(1.0 - keep * keep)
    return _recursive(keep, noise)


@compiled
def _recursive(keep, noise):  # type: ignore[no-untyped-def]
    y = np.empty_like(noise)
    last = 0.0
    for i in range(noise.size):
        last = keep * last + noise[i]
        y[i] = last
    return y


def _quantised(x: Array, step: float) -> Array:
    return np.round(x / step) * step


def _sensors(s: dict[str, Array], drive: Drive, rng: np.random.Generator) -> dict[str, Array]:
    """Sensors of a series car: noise and resolution of published sensors and CAN databases."""
    n = s["t"].size
    out = dict(s)
    for wheel in WHEELS:
        omega = s[f"omega_{wheel}"]
        noisy = omega * (1.0 + 4.5e-4 * rng.normal(size=n))
        out[f"omega_{wheel}"] = _quantised(noisy * drive.vehicle.r_e(wheel), 0.0075 / 3.6) / drive.vehicle.r_e(wheel)
        torque = s[f"torque_{wheel}"]
        out[f"torque_{wheel}"] = _quantised(torque * (1.0 + 0.01 * rng.normal()) + 2.0 * rng.normal(size=n), 1.0)
    out["v_x"] = s["v_x"] + 0.02 * rng.normal(size=n)
    out["a_x"] = _quantised(s["a_x"] + drive.a_x_offset + 0.06 * rng.normal(size=n), 0.03125)
    out["a_y"] = _quantised(s["a_y"] + 0.06 * rng.normal(size=n), 0.03125)
    out["yaw_rate"] = s["yaw_rate"] + 2e-3 * rng.normal(size=n)
    out["steer_angle"] = s["steer_angle"] + 5e-4 * rng.normal(size=n)
    return out
