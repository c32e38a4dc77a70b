"""The drive itself: four wheels, body with pitch and roll, a human at the pedals and the wheel. Runge-Kutta 4.

Between two samples (10 ms) torques and steering run linearly; the step is 1 ms, and less where the tyres at low speed are
stiffer than that.
"""

from __future__ import annotations

from math import ceil, cos, exp, pi, sin, tanh

import numpy as np

from aqualog.core.compiled import compiled

from .tyre import combined, load_law, lost_contact, saddle, water_force
from .world import CAR, TYRE, G

__all__ = ["OUT", "drive_car"]

DT = 0.01  # [s] of samples and of the driver
# states
VX, VY, YAW, S, EY, PSI, PITCH, PITCH_RATE, ROLL, ROLL_RATE = range(10)
OMEGA, SX, SY, ANGLE = 10, 14, 18, 22
N = 26

OUT = {name: i for i, name in enumerate((
    "v_x", "v_y", "yaw_rate", "steer_angle", "a_x", "a_y", "position", "offset", "drag", "grade", "depth_left",
    "depth_right", *(f"{stem}_{w}" for stem in ("omega", "torque", "angle", "F_x", "F_z", "slip", "film", "lost")
                     for w in ("fl", "fr", "rl", "rr")),
))}  # fmt: skip
_WHEEL_OUT = OUT["omega_fl"]
_WIDTH = len(OUT)

# columns of the road: see road.py
CURVATURE, GRADE, LEFT, RIGHT, PATCH = range(5)

MASS, L_F, L_R, H_CG, TRACK, I_ZZ = (CAR[n] for n in ("mass", "l_f", "l_r", "h_cg", "track", "I_zz"))
AREA, RHO, WIND, CORNER_DRAG = (CAR[n] for n in ("drag_area", "air_density", "head_wind", "cornering_drag"))
GAIN, GEAR_LOSS, WARM, WARM_TIME = (CAR[n] for n in ("torque_gain", "gear_loss", "warm_extra", "warm_time"))
TOWED, TOWED_RW, LEAK_0, LEAK_T = (CAR[n] for n in ("towed_mass", "towed_r_w", "leak_start", "leak_time"))
HUMP_F, HUMP_V, HUMP_W = (CAR[n] for n in ("hump_force", "hump_v", "hump_width"))
WET_F, WET_VH, WET_W = (CAR[n] for n in ("wet_force", "wet_vh", "wet_width"))
SADDLE, SADDLE_AT, SADDLE_W = (CAR[n] for n in ("saddle_depth", "saddle_at", "saddle_width"))
SPLIT, BRAKE_F, POWER, R_DRIVE = (CAR[n] for n in ("split_rear", "brake_front", "power", "r_drive"))
KIND = CAR["tyre_kind"]
PITCH_HZ, PITCH_D, FILM = (CAR[n] for n in ("pitch_hz", "pitch_damping", "track_film"))
HABIT_M, HABIT_D, HABIT_R, SHIFTS = (CAR[n] for n in ("habit_mass", "habit_drag", "habit_r_w", "shifts"))
R_E, GROWTH, INERTIA, R_W, BRAKE_DRAG = (TYRE[n] for n in ("r_e", "growth", "inertia", "r_w", "brake_drag"))
SLOPE, SLOPE_DRIFT, LOAD_DELTA, F_REF, MU = (TYRE[n] for n in ("slope", "slope_drift", "load_delta", "F_ref", "mu"))
RELAX, WATER, CONTACT = (TYRE[n] for n in ("relaxation", "water_gain", "contact_gain"))
LEAK_R, LEAK_S, CORNERING, SIDE_Y = (TYRE[n] for n in ("leak_radius", "leak_slope", "cornering", "side_y"))

V_LOW = 1.0  # [m/s] below it slip is damped like in a thick fluid
WAVE_SHARE = 0.35  # of the water's drag that pushes the wheel's centre, the rest brakes the tread
WEDGE = 0.06  # [m] shift of the load on a floating wheel
WET_FRICTION = 0.8


@compiled
def _at(road, column, s, ds):
    x = s / ds
    if not x > 0.0:
        return road[0, column]
    last = road.shape[0] - 1
    if x >= last:
        return road[last, column]
    j = int(x)
    return road[j, column] + (x - j) * (road[j + 1, column] - road[j, column])


@compiled
def _rhs(t, y, f, out, keep, p, w, road, ds, drive, brake, steer, gust):
    v_x, v_y, yaw, s = y[VX], y[VY], y[YAW], y[S]
    base = p[L_F] + p[L_R]
    grade = _at(road, GRADE, s, ds)
    front_left, front_right = _at(road, LEFT, s, ds), _at(road, RIGHT, s, ds)
    air = v_x + p[WIND] + gust
    drag = 0.5 * p[RHO] * p[AREA] * air * abs(air)
    drag += p[CORNER_DRAG] * p[MASS] * y[ROLL] * y[ROLL] + _at(road, PATCH, s, ds)
    rolls = tanh(v_x / 0.5)
    drag += p[TOWED] * G * p[TOWED_RW] * rolls
    if p[HUMP_F] != 0.0:
        z = (v_x - p[HUMP_V]) / p[HUMP_W]
        drag += p[HUMP_F] * exp(-0.5 * z * z) * rolls
    depth = 0.5 * (front_left + front_right)
    if p[WET_F] != 0.0 and depth > 1e-5:
        z = (v_x * depth - p[WET_VH]) / p[WET_W]
        drag += p[WET_F] * exp(-0.5 * z * z)
    warm = 1.0 + p[WARM] * exp(-t / p[WARM_TIME])
    leak = min(max((t - p[LEAK_0]) / p[LEAK_T], 0.0), 1.0)
    shift_x = p[MASS] * y[PITCH] * p[H_CG] / base
    shift_y = p[MASS] * y[ROLL] * p[H_CG] / p[TRACK]
    c, sn = cos(steer), sin(steer)
    sum_x = 0.0
    sum_y = 0.0
    moment = 0.0
    stiffest = 0.0
    for i in range(4):
        front = i < 2
        left = i % 2 == 0
        x_i = p[L_F] if front else -p[L_R]
        y_i = w[i, SIDE_Y]
        axle = (p[MASS] * G * p[L_R] / base - shift_x) if front else (p[MASS] * G * p[L_F] / base + shift_x)
        lateral = shift_y * (p[L_R] if front else p[L_F]) / base
        F_z = max(0.5 * axle - (lateral if left else -lateral), 0.0)
        u_x = v_x - yaw * y_i
        u_y = v_y + yaw * x_i
        if front:
            along, across = c * u_x + sn * u_y, c * u_y - sn * u_x
        else:
            along, across = u_x, u_y
        omega = y[OMEGA + i]
        r_e = w[i, R_E] * (1.0 + w[i, GROWTH] * along * along) * (1.0 - w[i, LEAK_R] * leak)
        rim = omega * r_e
        # water
        film = front_left if left else front_right
        if not front:
            film = _at(road, LEFT if left else RIGHT, s - base, ds)
            film = min(film, p[FILM]) + 0.03 * max(film - p[FILM], 0.0)
        mu = w[i, MU]
        contact = 1.0
        lost = 0.0
        tread = 0.0
        wave = 0.0
        if film > 1e-5:
            lost = min(lost_contact(along, film, F_z) * w[i, CONTACT], 1.0)
            contact = 1.0 - lost
            mu *= WET_FRICTION * contact * contact * (3.0 - 2.0 * contact)
            force = water_force(along, film) * w[i, WATER]
            wave = WAVE_SHARE * force
            tread = (1.0 - WAVE_SHARE) * force * r_e + F_z * WEDGE * lost**1.8
        # tyre
        slope = w[i, SLOPE] * (1.0 + w[i, LEAK_S] * leak) * exp(w[i, SLOPE_DRIFT] * t)
        slope *= load_law(F_z, w[i, F_REF], w[i, LOAD_DELTA]) * contact * contact
        speed = max(abs(rim), V_LOW)
        sigma_x = (rim - along) / speed
        sigma_y = -across / speed
        if w[i, RELAX] > 0.0:
            rate = speed / w[i, RELAX]
            f[SX + i] = rate * (sigma_x - y[SX + i])
            f[SY + i] = rate * (sigma_y - y[SY + i])
            sigma_x, sigma_y = y[SX + i], y[SY + i]
        else:
            f[SX + i] = 0.0
            f[SY + i] = 0.0
        if p[SADDLE] != 0.0:
            slope *= saddle(sigma_x, p[SADDLE], p[SADDLE_AT], p[SADDLE_W])
        K_x = slope * F_z
        K_y = w[i, CORNERING] * F_z * contact * contact
        F_x, F_y = combined(p[KIND], sigma_x, sigma_y, F_z, mu, K_x, K_y)
        stiffest = max(stiffest, K_x * r_e * r_e / (w[i, INERTIA] * speed))
        # wheel
        share_d = 0.5 * ((1.0 - p[SPLIT]) if front else p[SPLIT])
        share_b = 0.5 * (p[BRAKE_F] if front else 1.0 - p[BRAKE_F])
        driven = share_d * drive
        reported = driven - share_b * brake * tanh(omega / 0.5)
        torque = p[GAIN] * reported - p[GEAR_LOSS] * max(driven, 0.0) ** 2
        resist = w[i, R_W] * warm * F_z * r_e + w[i, BRAKE_DRAG] + tread
        f[OMEGA + i] = (torque - F_x * r_e - resist * tanh(omega / 1.5)) / w[i, INERTIA]
        f[ANGLE + i] = omega
        # body
        pull = F_x - wave
        b_x, b_y = (c * pull - sn * F_y, sn * pull + c * F_y) if front else (pull, F_y)
        sum_x += b_x
        sum_y += b_y
        moment += x_i * b_y - y_i * b_x
        if keep:
            o = _WHEEL_OUT + i
            out[o], out[o + 4], out[o + 8], out[o + 12] = omega, reported, y[ANGLE + i], F_x
            out[o + 16], out[o + 20], out[o + 24], out[o + 28] = F_z, sigma_x, film, lost
    a_x = (sum_x - drag) / (p[MASS] + p[TOWED])
    a_y = sum_y / p[MASS]
    f[VX] = a_x - G * sin(grade) + yaw * v_y
    f[VY] = a_y - yaw * v_x
    f[YAW] = moment / p[I_ZZ]
    f[S] = v_x
    f[EY] = v_y + v_x * sin(y[PSI])
    f[PSI] = yaw - _at(road, CURVATURE, s, ds) * v_x
    n_p = 2.0 * pi * p[PITCH_HZ]
    f[PITCH] = y[PITCH_RATE]
    f[PITCH_RATE] = n_p * n_p * (a_x - y[PITCH]) - 2.0 * p[PITCH_D] * n_p * y[PITCH_RATE]
    n_r = 1.1 * n_p
    f[ROLL] = y[ROLL_RATE]
    f[ROLL_RATE] = n_r * n_r * (a_y - y[ROLL]) - 2.0 * p[PITCH_D] * n_r * y[ROLL_RATE]
    if keep:
        out[0], out[1], out[2], out[3], out[4], out[5], out[6] = v_x, v_y, yaw, steer, a_x, a_y, s
        out[7], out[8], out[9], out[10], out[11] = y[EY], drag, grade, front_left, front_right
    return stiffest


@compiled
def drive_car(target, ability, unrest, wander, gust, road, ds, p, w, style, refine):
    """Drive a programme; rows (n, len(OUT)) at every sample.

    `target` (n + 300,) wanted speed [m/s]; `ability`, `unrest`, `wander`, `gust` (n + 1,): the driver's gain, pedal noise
    [m/s^2], steering noise [rad], wind along the road [m/s]. `style`: reaction time [s], look-ahead [s], gain [1/s],
    integral gain [1/s^2], time constants of pedals [s], preview of the road [s].
    `refine`: so many times finer steps than need be.
    """
    n = gust.shape[0] - 1
    react, ahead, k_p, k_i, lag, lag_brake, preview = style
    y = np.zeros(N)
    y[VX] = target[0]
    for i in range(4):
        y[OMEGA + i] = target[0] / w[i, R_E]
    f, total, z = np.zeros(N), np.zeros(N), np.zeros(N)
    rows = np.zeros((n, _WIDTH))
    base = p[L_F] + p[L_R]
    weight = p[HABIT_M] * G
    d = int(react / DT)
    look = max(int(ahead / DT), 1)
    engine = (-0.03 if p[SHIFTS] > 0.0 else -0.11) * weight
    # no more than half of what the driven axles hold: a foot that knows its car
    held = p[HABIT_M] * G / base
    grip = 0.55 * w[0, MU] * held * (p[L_F] if p[SPLIT] == 1.0 else (p[L_R] if p[SPLIT] == 0.0 else base))
    pedal = (p[HABIT_R] * weight + p[HABIT_D] * target[0] ** 2) * p[R_DRIVE] if target[0] > 0.5 else 0.0
    foot = 0.0 if target[0] > 0.5 else 0.1 * weight * p[R_DRIVE]
    integral = 0.0
    hands = 0.0
    gear = 0
    ups = np.array([4.5, 9.0, 14.5, 20.5, 28.0])
    while gear < 5 and target[0] > ups[gear]:
        gear += 1
    dip = -1.0
    drive, brake, steer = pedal, foot, 0.0
    stiffest = 2000.0
    for k in range(n):
        v = y[VX]
        # the driver sees what was, and knows what he wants
        seen = rows[max(k - d, 0), 0] if k > 0 else v
        error = target[max(k - d, 0)] - seen
        error = error - 0.15 if error > 0.15 else (error + 0.15 if error < -0.15 else 0.0)
        wanted = (target[k + look] - target[k]) / (look * DT)
        if v > 1.0:
            integral = min(max(integral + k_i * p[HABIT_M] * error * DT, -0.08 * weight), 0.08 * weight)
        force = p[HABIT_M] * (ability[k] * (wanted + k_p * error) + unrest[k] * min(v / 5.0, 1.0))
        force += (p[HABIT_R] * weight + p[HABIT_D] * seen * seen) * min(max(seen, 0.0), 1.0) + integral
        if target[k + look] < 0.3 and v < 0.6:
            force = -0.1 * weight
        fade = tanh(max(v, 0.0))
        least = engine * fade
        up = min(max(force, least), p[POWER] / max(v, 3.0), grip) * p[R_DRIVE]
        down = max(least - force, 0.0) * p[R_DRIVE]
        if down > 0.0 and pedal > 0.0:
            up = least * p[R_DRIVE]
        pedal += min(max((up - pedal) / lag, -9000.0), 6000.0) * DT
        foot = max(foot + min(max((down - foot) / lag_brake, -15000.0), 12000.0) * DT, 0.0)
        share = 1.0
        if p[SHIFTS] > 0.0:
            if dip < 0.0 and gear < 5 and v > ups[gear] * (0.95 + 0.15 * min(max(force, 0.0) / (0.25 * weight), 1.0)):
                gear += 1
                dip = 0.0
            elif dip < 0.0 and gear > 0 and v < 0.62 * ups[gear - 1]:
                gear -= 1
                dip = 0.0
            if dip >= 0.0:
                share = 1.0 - 0.9 * sin(pi * min(dip / 0.4, 1.0)) ** 2
                dip += DT
                if dip > 1.5:
                    dip = -1.0
        next_drive = pedal * share if pedal > 0.0 else pedal * fade
        # the road ahead
        bend = _at(road, CURVATURE, y[S] + preview * v, ds)
        under = (p[MASS] / base) * (
            p[L_R] / (w[0, CORNERING] * G * p[MASS] * p[L_R] / base)
            - p[L_F] / (w[2, CORNERING] * G * p[MASS] * p[L_F] / base)
        )
        reach = preview * max(v, 4.0)
        angle = (bend - 1.4 * (y[EY] + reach * y[PSI]) / (reach * reach)) * (base + under * v * v)
        hands += (min(max(angle + wander[k], -0.3), 0.3) - hands) / 0.2 * DT
        # ten milliseconds of physics
        steps = refine * max(10, ceil(DT * 1.15 * stiffest / 2.0))
        h = DT / steps
        stiffest = 0.0
        d_drive, d_brake, d_steer = (next_drive - drive) / steps, (foot - brake) / steps, (hands - steer) / steps
        for j in range(steps):
            t = k * DT + j * h
            a, b, e = drive + j * d_drive, brake + j * d_brake, steer + j * d_steer
            g = gust[k] + (gust[k + 1] - gust[k]) * j / steps
            for stage in range(4):  # one call: its code is compiled once
                x = 0.0 if stage == 0 else 1.0 if stage == 3 else 0.5
                for i in range(N):
                    z[i] = y[i] + x * h * f[i] if stage > 0 else y[i]
                keep = j == 0 and stage == 0
                stiff = _rhs(
                    t + x * h, z, f, rows[k], keep, p, w, road, ds, a + x * d_drive, b + x * d_brake, e + x * d_steer, g
                )  # fmt: skip
                for i in range(N):
                    total[i] = f[i] if stage == 0 else total[i] + (2.0 if stage < 3 else 1.0) * f[i]
                stiffest = max(stiffest, stiff) if stage == 0 else stiffest
            for i in range(N):
                y[i] += h / 6.0 * total[i]
        drive, brake, steer = next_drive, foot, hands
    return rows
