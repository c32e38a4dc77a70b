"""A human at the pedals and the wheel, and the loop over a drive."""

from __future__ import annotations

from math import exp, pi, sin, tanh

import numpy as np

from aqualog.core.compiled import compiled, part

from .dynamics import (
    A_X,
    A_Y,
    ANGLE,
    AUX,
    BELT,
    ENGINE,
    FORCE,
    LOAD,
    LOST,
    PITCH,
    PITCH_RATE,
    RIM,
    ROLL,
    SLIP,
    STATES,
    T_SHAFT,
    VX,
    VY,
    WAY,
    YAW,
    H,
    advance,
)  # fmt: skip

__all__ = ["ENGINE_HOLDS", "MOTOR_HOLDS", "ROWS", "draw_style", "drive_along"]

DT = 0.01
G = 9.81
_SUB = round(DT / H)
ROWS = {name: i for i, name in enumerate((
    "v_x", "yaw_rate", "steer_angle", "a_x", "a_y", "pitch_rate", "way", "film_l", "film_r", "pitch", "roll", "v_y",
    *(f"{stem}_{w}" for stem in ("omega", "torque", "angle", "load", "slip", "force", "lost")
      for w in ("fl", "fr", "rl", "rr")),
))}  # fmt: skip
"""Columns of what happened. Means over the 10 ms from the row's time on, `way`, `film` and `angle` at its beginning."""
_OMEGA, _TORQUE, _ANGLE, _LOAD, _SLIP, _FORCE, _LOST = (ROWS[f"{s}_fl"] for s in (
    "omega", "torque", "angle", "load", "slip", "force", "lost"))  # fmt: skip
_WIDTH = len(ROWS)
ENGINE_HOLDS, MOTOR_HOLDS = 0.025, 0.14  # of the weight, before the brakes
UPSHIFTS = np.array([5.0, 10.0, 15.5, 21.5, 29.0])  # [m/s]


def draw_style(rng: np.random.Generator) -> np.ndarray:
    """Reaction [s], look-ahead [s], gain [1/s], integral [1/s^2], pedal's time [s], hands' time [s], skill at the wheel."""
    return np.array([
        rng.uniform(0.2, 0.5), rng.uniform(0.3, 0.7), rng.uniform(0.3, 0.7), rng.uniform(0.01, 0.05),
        rng.uniform(0.08, 0.3), rng.uniform(0.12, 0.3), rng.uniform(0.0, 0.4),
    ])  # fmt: skip


@compiled
def drive_along(target, coast, lateral, unrest, wander, gust, fine, slow, p, odd, style, knows):
    """Drive a programme; rows (n, len(ROWS)).

    `target` (n + 200,) wanted speed [m/s], `coast` (n + 200,) above a half: both feet off. By sample (n,): `lateral`
    wanted lateral acceleration [m/s^2], `unrest` of the foot [m/s^2], `wander` of the hands [rad], `gust` [m/s].
    `knows` (4,): mass, drag area times half the density, rolling resistance, radius by which the driver presses.
    """
    n = gust.shape[0]
    react, ahead, gain, integral_gain, foot_time, hand_time, skill = style
    y, f, before, aux = np.zeros(STATES), np.zeros(STATES), np.zeros(STATES), np.zeros(AUX)
    braked = np.zeros(4)
    rows = np.zeros((n, _WIDTH))
    y[VX] = target[0]
    for i in range(4):
        y[RIM + i] = y[BELT + i] = target[0] / p.r_e[i]
    for a in range(2):
        y[ENGINE + a] = 0.5 * (y[RIM + 2 * a] + y[RIM + 2 * a + 1])
    base = p.l_f + p.l_r
    mass, square, rolling, radius = knows
    grade_of_understeer = (1.0 / p.cornering[0] - 1.0 / p.cornering[2]) / G
    share_driven = p.split_rear * p.l_f / base + (1.0 - p.split_rear) * p.l_r / base
    if 0.0 < p.split_rear < 1.0:
        share_driven = 1.0
    grip = 0.5 * mass * G * share_driven
    gear, dip, integral, linger = 0, -1.0, 0.0, 0.0
    while p.is_electric < 0.5 and gear < 5 and target[0] > UPSHIFTS[gear]:
        gear += 1
    pedal = (rolling * mass * G + square * target[0] ** 2) * radius if target[0] > 0.5 else 0.0
    drive, brake, foot, steer, hands = pedal, 0.0, 0.0, 0.0, 0.0
    late, look = int(react / DT), int(ahead / DT)
    for k in range(n):
        v = y[VX]
        seen = rows[k - late, 0] if k > late else target[max(k - late, 0)]
        error = target[max(k - late, 0)] - seen
        error = error - 0.1 if error > 0.1 else (error + 0.1 if error < -0.1 else 0.0)
        wanted = (target[k + look] - target[k]) / max(look * DT, DT)
        if v > 1.0 and coast[k] < 0.5:
            integral = min(max(integral + integral_gain * error * DT, -0.8), 0.8)
        want = wanted + gain * error + integral + unrest[k] * min(v / 4.0, 1.0)
        force = mass * min(max(want, -6.0), 4.5) + (rolling * mass * G + square * seen * seen) * min(
            max(seen, 0.0), 1.0
        )
        if target[k + look] < 0.3 and v < 0.8:
            force = -0.12 * mass * G
        if coast[k] > 0.5:
            force = 0.0
        least = (-MOTOR_HOLDS if p.is_electric > 0.5 else -ENGINE_HOLDS) * mass * G * tanh(max(v - 0.5, 0.0) / 2.0)
        up = min(force, min(grip, p.power / max(v, 4.0))) * radius
        down = 0.0
        if force < least:
            up, down = least * radius, (least - force) * radius
        pedal += min(max((up - pedal) * DT / foot_time, -70.0), 45.0)
        foot += min(max((down - foot) * DT / 0.12, -160.0), 120.0)
        cut = 1.0
        if p.is_electric < 0.5:
            if dip < 0.0 and gear < 5 and v > UPSHIFTS[gear] * (0.95 + 0.2 * min(max(want, 0.0) / 2.5, 1.0)):
                gear, dip = gear + 1, 0.0
            elif dip < 0.0 and gear > 0 and v < 0.65 * UPSHIFTS[gear - 1]:
                gear, dip = gear - 1, 0.0
            if dip >= 0.0:
                cut = 1.0 - 0.85 * sin(pi * min(dip / 0.35, 1.0)) ** 2
                dip = dip + DT if dip < 1.2 else -1.0
        linger = 1.0 if foot > 20.0 else (linger * exp(-DT / odd.linger[1]) if foot < 5.0 else linger)
        resting = 0.0 if foot > 20.0 else linger
        curve = min(max(lateral[k] / max(v, 5.0) ** 2, -0.05), 0.05)
        angle = curve * (base + grade_of_understeer * v * v) + skill * (curve * v - y[YAW]) * base / max(v, 5.0)
        hands += (min(max(angle + wander[k], -0.4), 0.4) - hands) * DT / hand_time
        next_drive = pedal * cut
        row = rows[k]
        row[6], row[7], row[8] = y[WAY], slow_film(slow, 2, y[WAY] + base), slow_film(slow, 3, y[WAY] + base)
        for i in range(4):
            row[_ANGLE + i] = y[ANGLE + i]
        for j in range(_SUB):
            x = (j + 0.5) / _SUB
            now_drive, now_brake = drive + x * (next_drive - drive), brake + x * (foot - brake)
            now_steer = steer + x * (hands - steer)
            advance(
                k * DT + j * H, k / n, y, f, before, aux, fine, slow, p, odd, now_drive, now_brake, gear, now_steer,
                gust[k], resting, braked,
            )  # fmt: skip
            row[0] += y[VX] / _SUB
            row[1] += y[YAW] / _SUB
            row[2] += now_steer / _SUB
            row[3] += aux[A_X] / _SUB
            row[4] += aux[A_Y] / _SUB
            row[5] += y[PITCH_RATE] / _SUB
            row[9] += y[PITCH] / _SUB
            row[10] += y[ROLL] / _SUB
            row[11] += y[VY] / _SUB
            for i in range(4):
                row[_OMEGA + i] += y[RIM + i] / _SUB
                row[_TORQUE + i] += (aux[T_SHAFT + i] - braked[i]) / _SUB
                row[_LOAD + i] += aux[LOAD + i] / _SUB
                row[_SLIP + i] += aux[SLIP + i] / _SUB
                row[_FORCE + i] += aux[FORCE + i] / _SUB
                row[_LOST + i] += aux[LOST + i] / _SUB
        drive, brake, steer = next_drive, foot, hands
    return rows


@part
def slow_film(slow, column, way):
    """Film at the nearest metre [m]."""
    return slow[min(max(int(way + 0.5), 0), slow.shape[0] - 1), column]
