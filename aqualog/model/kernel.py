"""The compiled four-wheel simulation: right-hand side and time stepping.

States (index): speeds and attitude, low-passed specific forces, the driver, the wheels. The physics is that of
`aqualog.physics`, called on scalars.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aqualog.core.compiled import compiled, inlined
from aqualog.core.records import FloatArray
from aqualog.model import excitation
from aqualog.model.antilock import antilock
from aqualog.model.plant import F_Z_ANCHOR, F_Z_HALF_LENGTH, H_ANCHOR, P_ANCHOR, P_HALF_LENGTH, Plant, flat
from aqualog.model.road import (
    BUMPS,
    CONTACT_ROAD,
    CONTACT_WHEEL,
    DEPTH,
    DEPTH_LEFT,
    END,
    GRADE,
    IN_METRES,
    IRREGULARITY_LEFT,
    KICK_LOAD,
    KICK_TORQUE,
    LANE_COMPLIANCE,
    LANE_MU,
    ROLLING,
    ROUGHNESS,
    START,
    SURFACE_WIDTH,
    Road,
)
from aqualog.physics import (
    contact,
    hydroplaning,
    kinematics,
    load,
    resistance,
    rolling,
    slip,
    steering,
    surface,
    tyre_brush,
    water,
)
from aqualog.physics.load import G

__all__ = ["COLUMNS", "N_STATES", "Controls", "integrate", "run"]

# states
V_X, V_Y, YAW_RATE, PSI, S, Y_LAT, A_X, A_Y, INTEGRAL, DRIVE, BRAKE, STEER = range(12)
OMEGA, ANGLE, SLIP_X, SLIP_Y = 12, 16, 20, 24  # four each
N_STATES = 28
# the Jacobian: a diagonal, and behind it the coupling of v_x with the wheels, d(v_x')/d(omega) and d(omega')/d(v_x)
_J_V, _J_W = N_STATES, N_STATES + 4

# recorded columns; those of wheels take four places
_SCALARS = (
    "v_x", "v_y", "yaw_rate", "psi", "position", "y_lat", "a_x", "a_y", "steer_angle", "drive_torque", "brake_torque",
    "grade", "lane_front", "lane_rear", "drag", "nudge",
)  # fmt: skip
_WHEELS = (
    "omega", "angle", "torque", "F_x", "F_y", "F_z", "s_x", "slip_angle", "contact", "slope", "mu_max", "film",
    "water_torque", "wave_drag", "resisting_torque", "v_along", "r_e", "v_full",
    "aligning", "braking",
)  # fmt: skip
COLUMNS = {name: i for i, name in enumerate(_SCALARS)} | {name: len(_SCALARS) + 4 * i for i, name in enumerate(_WHEELS)}
_WIDTH = len(_SCALARS) + 4 * len(_WHEELS)

# driver (K): gains of a calm driver
K_SPEED = 0.8  # [1/s]
K_INTEGRAL = 0.04  # [1/s^2]
PEDAL_TIME = 0.25  # [s]
ENGINE_BRAKING = 0.04  # of the weight, as force
K_LATERAL = 0.004  # [rad/m]
PREVIEW_TIME = 1.5  # [s]
STEER_TIME = 0.2  # [s]
MAX_DRIVE = 0.6  # of the weight, as force
MAX_INTEGRAL = 0.2  # of the weight, as force
RUN_AWAY = 1.5  # driven wheels this much faster than the car make a driver lift


NO_TORQUE: FloatArray = np.zeros((1, 4))


class Controls(NamedTuple):
    """Inputs of driver and car; arrays (n + 1,) at every time step."""

    v_target: FloatArray
    a_target: FloatArray
    drive: FloatArray  # [N m] extra drive torque, or all of it without a driver
    brake: FloatArray  # [N m] sum of all wheels
    split_rear: FloatArray  # rear share of the drive torque
    steer: FloatArray  # [rad]
    exc: FloatArray  # unit excitation waveform
    grade: FloatArray  # [rad] on top of the road's
    wind: FloatArray  # [m/s] head wind on top of the plant's
    gain: FloatArray  # share of the driver's torque that reaches the wheels: clutch, gear shifts
    has_driver: bool
    keeps_lane: bool
    exc_kind: int  # 0 force, 1 traction coefficient, 2 relative
    exc_amplitude: float
    scatter: float
    antilock: bool = False  # the brakes release a wheel that is about to lock
    kicks: bool = False  # the road has kerbs or holes
    follow: float = 0.0  # [1/s] without a driver: how fast the speed is drawn to `v_target`; 0: runs free


def run(
    n: int, dt: float, every: int, y0: FloatArray, plant: Plant, road: Road, controls: Controls,
    applied: FloatArray = NO_TORQUE,
) -> FloatArray:  # fmt: skip
    """`integrate` with its inputs packed: records are plain memory, tuples of arrays cost a count at every access.

    `applied` (n + 1, 4) [N·m]: torque at each wheel on top of the driver's, scaled by the plant's `torque_gain`; one
    row holds for the whole drive.
    """
    fields = controls._asdict()
    settings = {name: float(x) for name, x in fields.items() if np.ndim(x) == 0} | {"dt": float(dt)}
    setting = np.zeros(1, dtype=[(name, np.float64) for name in settings])
    for name, x in settings.items():
        setting[name] = x
    series = np.zeros(n + 1, dtype=[(name, np.float64) for name, x in fields.items() if np.ndim(x) == 1])
    for name in series.dtype.names or ():
        series[name] = fields[name]
    rows: FloatArray = integrate(n, float(dt), every, y0, *flat(plant), road, setting, series, applied)
    return rows


_loads = inlined(load.loads_of_wheels)
_wheel_velocity = inlined(kinematics.wheel_velocity)
_bounded_slip = inlined(slip.bounded_slip)
_brush_forces = inlined(tyre_brush.brush_forces)
_friction_ratio = inlined(contact.friction_ratio)
_stiffness_ratio = inlined(contact.slip_stiffness_ratio)
_lost_contact = inlined(contact.lost_contact)
_half_length = inlined(contact.contact_half_length)
_load_shift = inlined(contact.load_shift)
_v_full = inlined(hydroplaning.full_aquaplaning_speed)
_film_drag = inlined(water.film_drag)
_wave_drag = inlined(water.wave_drag)
_residual_film = inlined(water.residual_film)
_series_slope = inlined(surface.series_slope)
_air_drag = inlined(resistance.air_drag)
_grade_force = inlined(resistance.grade_force)
_cornering_drag = inlined(resistance.cornering_drag)
_rolling_force = inlined(resistance.rolling_resistance_force)
_aligning_moment = inlined(steering.aligning_moment)
_effective_radius = inlined(rolling.effective_radius)
_warm_up_factor = inlined(rolling.warm_up_factor)
_load_factor = inlined(rolling.load_factor)
_amplitude = inlined(excitation.excitation_force_amplitude)
_SPIN_UP_RATIO = float(hydroplaning.SPIN_UP_RATIO)
_FIELD_SHARE = float(np.sqrt(0.5))  # half of the contact's variance is the road's, half the wheel's own


@compiled
def _at(field, column, position, ds):  # type: ignore[no-untyped-def]
    """Linear interpolation of a field over the position; constant beyond its ends."""
    x = position / ds
    last = field.shape[0] - 1
    if not x > 0.0:  # also a position that is no number
        return field[0, column]
    if x >= last:
        return field[last, column]
    j = int(x)
    return field[j, column] + (x - j) * (field[j + 1, column] - field[j, column])


@compiled
def _table(knots, x):  # type: ignore[no-untyped-def]
    """Linear interpolation in a table of knots (k, 2); constant beyond its ends."""
    if x <= knots[0, 0]:
        return knots[0, 1]
    for i in range(1, knots.shape[0]):
        if x < knots[i, 0]:
            w = (x - knots[i - 1, 0]) / (knots[i, 0] - knots[i - 1, 0])
            return knots[i - 1, 1] + w * (knots[i, 1] - knots[i - 1, 1])
    return knots[knots.shape[0] - 1, 1]


@compiled
def _lane(lanes, t, position):  # type: ignore[no-untyped-def]
    """Return the index of the stretch under the front axle, -1 for dry asphalt."""
    found = -1
    for i in range(lanes.shape[0]):
        x = position if lanes[i, IN_METRES] > 0.0 else t
        if lanes[i, START] <= x < lanes[i, END]:
            found = i
    return found


@compiled
def _track(track, position, ds):  # type: ignore[no-untyped-def]
    """Return the row of the front axle's record of a position: stretch and film; before the start: dry."""
    if not 0.0 <= position < ds * track.shape[0]:
        return -1
    return min(int(position / ds), track.shape[0] - 1)


@compiled
def _rhs(t, y, f, jac, out, recorded, p, wheels, extra, r, s, c, track, released, applied, step):  # type: ignore[no-untyped-def]
    """Compute the derivative `f` of the state, the stiff part `jac` of its Jacobian, and the `recorded` outputs.

    `track` (m, 3) holds the stretch and the film behind the left and right front wheel. `released` (4,) is the share of
    each wheel's brake torque that the antilock system releases. Row `step` of `applied` (m, 4) is the torque that is
    applied to each wheel.
    """
    v_x, v_y, yaw_rate, position = y[V_X], y[V_Y], y[YAW_RATE], y[S]
    wheelbase = p.l_f + p.l_r
    steer = c.steer + y[STEER]
    grade = c.grade + _at(r.fields, GRADE, position, r.ds)
    drag = _air_drag(v_x + p.head_wind + c.wind, p.drag_area, p.air_density) + _table(extra, v_x)
    drag += _cornering_drag(y[A_Y], p.mass, p.cornering_drag)
    if p.towed_mass > 0.0:
        drag += _rolling_force(p.towed_mass * G, wheels[2].r_w)
    slope_down = _grade_force(grade, p.mass)
    warm = _warm_up_factor(t, p.warmup_extra, p.warmup_time)
    loads = _loads(y[A_X], y[A_Y], p.mass, p.l_f, p.l_r, p.h_cg, p.track)
    leak = min(max((t - p.leak_start) / p.leak_time, 0.0), 1.0)

    split_rear = c.split_rear
    # mean loaded radius of the driven wheels, by their share
    r_drive = 0.5 * (
        (1.0 - split_rear) * (wheels[0].r_l + wheels[1].r_l) + split_rear * (wheels[2].r_l + wheels[3].r_l)
    )
    # the driver
    brake_total = c.brake + y[BRAKE]
    if s.has_driver > 0.0:
        # mean speed of the driven wheels
        turning = 0.5 * (1.0 - split_rear) * (y[OMEGA] + y[OMEGA + 1])
        turning += 0.5 * split_rear * (y[OMEGA + 2] + y[OMEGA + 3])
        error = c.v_target - v_x
        wanted = p.mass * (c.a_target + K_SPEED * error) + y[INTEGRAL] + drag + slope_down
        for i in range(4):
            wanted += _rolling_force(loads[i], wheels[i].r_w) * warm
        least = -ENGINE_BRAKING * p.mass * G
        most = MAX_DRIVE * p.mass * G
        runs_away = turning * r_drive > RUN_AWAY * max(v_x, 5.0)
        if c.brake > 0.0 or runs_away:  # the foot is on the other pedal, or lifts
            f[DRIVE] = -y[DRIVE] / PEDAL_TIME
            f[INTEGRAL] = 0.0
            f[BRAKE] = -y[BRAKE] / PEDAL_TIME
        else:
            f[DRIVE] = (min(max(wanted, least), most) * r_drive - y[DRIVE]) / PEDAL_TIME
            f[INTEGRAL] = K_INTEGRAL * p.mass * error
            if abs(y[INTEGRAL]) > MAX_INTEGRAL * p.mass * G and y[INTEGRAL] * error > 0.0:
                f[INTEGRAL] = 0.0
            f[BRAKE] = (max(least - wanted, 0.0) * r_drive - y[BRAKE]) / PEDAL_TIME
        drive = y[DRIVE] * c.gain + c.drive
        drive = min(drive, p.power / max(turning, 1.0))
        if drive < 0.0:  # an engine brakes, it does not drive backwards
            drive *= min(max(turning, 0.0), 1.0)
    else:
        f[DRIVE] = 0.0
        f[INTEGRAL] = 0.0
        f[BRAKE] = 0.0
        drive = c.drive * p.torque_gain
    if s.keeps_lane > 0.0:
        f[STEER] = (-K_LATERAL * (y[Y_LAT] + PREVIEW_TIME * v_x * y[PSI]) - y[STEER]) / STEER_TIME
    else:
        f[STEER] = -y[STEER] / STEER_TIME

    # active excitation: what one axle gains the other loses (3.26, 3.27)
    nominal = drive / r_drive
    exc = c.exc * _amplitude(
        int(s.exc_kind), s.exc_amplitude, (1.0 - split_rear) * nominal, split_rear * nominal,
        p.mass * G * p.l_r / wheelbase, p.mass * G * p.l_f / wheelbase,
    )  # fmt: skip

    lane_front = _lane(r.lanes, t, position)
    behind = _track(track, position - wheelbase, r.ds)
    lane_rear = int(track[behind, 0]) if behind >= 0 else -1

    jac[V_X] = 0.0
    jac[V_Y] = 0.0
    jac[YAW_RATE] = 0.0
    cos_steer, sin_steer = np.cos(steer), np.sin(steer)
    sum_x = 0.0
    sum_y = 0.0
    moment = 0.0
    for i in range(4):
        q = wheels[i]
        front = i < 2
        side = i % 2
        x = p.l_f if front else -p.l_r
        y_i = 0.5 * p.track if side == 0 else -0.5 * p.track
        angle = steer if front else 0.0
        F_z = loads[i]
        omega = y[OMEGA + i]
        v_along, v_across = _wheel_velocity(v_x, v_y, yaw_rate, angle, x, y_i)
        r_e = _effective_radius(q.r_e, v_along, q.radius_growth) * (1.0 - q.leak_radius * leak)
        r_l = q.r_l * (1.0 - q.leak_radius * leak)
        rim = omega * r_e

        # the road under this wheel
        where = position if front else position - wheelbase
        lane = lane_front if front else lane_rear
        mu = q.mu
        compliance = 0.0
        r_w = q.r_w * warm
        bump = 0.0
        film = 0.0
        of_side = SURFACE_WIDTH * side
        if lane >= 0:
            if r.lanes[lane, LANE_MU + of_side] >= 0.0:
                mu = r.lanes[lane, LANE_MU + of_side]
            compliance = r.lanes[lane, LANE_COMPLIANCE + of_side]
            r_w += r.lanes[lane, ROLLING + of_side]
            bump = r.lanes[lane, ROUGHNESS + of_side] * _at(r.fields, BUMPS + side, where, r.ds)
            if front:
                uneven = 1.0 + r.lanes[lane, IRREGULARITY_LEFT + side] * _at(r.fields, DEPTH + side, where, r.ds)
                film = r.lanes[lane, DEPTH_LEFT + side] * max(uneven, 0.0)
            else:
                film = track[behind, 1 + side]
        if s.kicks > 0.0:
            bump += _at(r.fields, KICK_TORQUE + side, where, r.ds)
            F_z = max(F_z + _at(r.fields, KICK_LOAD + side, where, r.ds), 0.0)

        # the effect of the water on the contact, and its resistance
        L = 1.0
        film_force = 0.0
        wave = 0.0
        shift = 0.0
        v_full = 1e6
        if film > 0.0:
            mu *= q.wet_friction
            v_full = _v_full(
                film, F_z, q.p, q.tread_capacity, q.v_anchor, H_ANCHOR, P_ANCHOR, F_Z_ANCHOR,
                q.h_bulk, q.h_onset, q.contact_exponent,
            )  # fmt: skip
            noise = _FIELD_SHARE * (
                _at(r.fields, CONTACT_ROAD + side, where, r.ds) + _at(r.fields, CONTACT_WHEEL + i, where, r.ds)
            )
            # a wheel that has slowed down floats down to a lower speed: Horne's spin-up speed
            rolling_share = min(max(rim / max(abs(v_along), 0.5), 0.0), 1.0)
            v_full *= _SPIN_UP_RATIO + (1.0 - _SPIN_UP_RATIO) * rolling_share
            v_full *= max(1.0 + s.scatter * q.contact_scatter * noise, 0.2)
            lost = _lost_contact(v_along, v_full, q.contact_exponent) * q.contact_gain
            L = 1.0 - min(max(lost, 0.0), 1.0)
            a = _half_length(F_z, q.p, q.half_length, F_Z_HALF_LENGTH, P_HALF_LENGTH)
            shift = _load_shift(L, a, q.wedge_peak) * F_z
            gain = q.water_drag_gain
            ahead = max(v_along, 0.0)
            film_force = gain * _film_drag(
                film, ahead, rim, q.width, q.tread_capacity, q.h_film, q.groove_relief
            )  # fmt: skip
            skid = max(v_along - rim, 0.0)  # a slower tread pushes what it no longer throws
            wave = gain * (
                _wave_drag(film, ahead, q.width, q.h_wave)
                + _film_drag(film, ahead, skid, q.width, q.tread_capacity, q.h_film, q.groove_relief)
            )
        slope = q.slip_slope * (1.0 + q.leak_slope * leak) * np.exp(min(max(q.slip_slope_drift * t, -3.0), 3.0))
        slope = _series_slope(slope * _load_factor(F_z, q.F_z_ref, q.load_sensitivity), compliance)
        C_x = slope * F_z
        C_y = _series_slope(q.cornering_slope, compliance) * F_z

        # slip, with a first-order build-up where the tyre has a relaxation length
        s_x = _bounded_slip(rim, v_along)
        speed = max(abs(rim), 0.5)
        s_y = -v_across / speed
        sigma = q.relaxation_length
        ds_domega = 0.0
        ds_dv = 0.0
        if sigma > 0.0:
            rate = speed / sigma
            f[SLIP_X + i] = rate * (s_x - y[SLIP_X + i])
            f[SLIP_Y + i] = rate * (s_y - y[SLIP_Y + i])
            jac[SLIP_X + i] = -rate
            jac[SLIP_Y + i] = -rate
            s_x = y[SLIP_X + i]
            s_y = y[SLIP_Y + i]
        else:
            f[SLIP_X + i] = 0.0
            f[SLIP_Y + i] = 0.0
            jac[SLIP_X + i] = 0.0
            jac[SLIP_Y + i] = 0.0
            ds_domega = max(v_along, 0.0) * r_e / (speed * speed) if abs(rim) > 0.5 else 2.0 * r_e
            ds_dv = -1.0 / speed
        F_x, F_y = _brush_forces(s_x, s_y, F_z, mu, C_x, C_y, L)

        # the wheel's balance of torques
        torque = 0.5 * (1.0 - split_rear if front else split_rear) * drive + (0.5 if front else -0.5) * exc * r_l
        torque += applied[step, i] * p.torque_gain
        braking = q.brake_split * brake_total * (1.0 - released[i])
        water_torque = film_force * r_l + shift
        resisting = _rolling_force(F_z, r_w) * r_l + water_torque + q.brake_drag
        # resistance fades out near standstill instead of jumping, over what one step of it can change
        standstill = max(1.0, s.dt * (resisting + braking) / q.inertia)
        turn = min(max(omega / standstill, -1.0), 1.0)
        f[OMEGA + i] = (torque - F_x * r_l - (resisting + braking) * turn + bump) / q.inertia
        # the secant, not the tangent: a sliding tyre must be damped too where one step would carry it past sticking
        dF_dsx = abs(F_x) / abs(s_x) if abs(s_x) > 1e-9 else C_x * _stiffness_ratio(L)
        arm = r_l / q.inertia
        jac[OMEGA + i] = -dF_dsx * ds_domega * arm
        jac[_J_W + i] = -dF_dsx * ds_dv * arm
        jac[_J_V + i] = dF_dsx * ds_domega / p.mass
        jac[V_X] += dF_dsx * ds_dv / p.mass
        across = C_y * ds_dv * (dF_dsx / max(C_x, 1.0))
        jac[V_Y] += across / p.mass
        jac[YAW_RATE] += across * x * x / p.I_zz
        if abs(omega) < standstill:
            jac[OMEGA + i] -= (resisting + braking) / (q.inertia * standstill)
        f[ANGLE + i] = omega

        # forces on the body, in its axes
        cos, sin = (cos_steer, sin_steer) if front else (1.0, 0.0)
        along = F_x - wave
        body_x = along * cos - F_y * sin
        body_y = along * sin + F_y * cos
        sum_x += body_x
        sum_y += body_y
        moment += x * body_y - y_i * body_x

        if recorded:
            base = len(_SCALARS) + i
            out[base] = omega
            out[base + 4] = y[ANGLE + i]
            out[base + 8] = torque - braking * turn
            out[base + 12] = F_x
            out[base + 16] = F_y
            out[base + 20] = F_z
            out[base + 24] = s_x
            out[base + 28] = -np.arctan2(v_across, max(abs(v_along), 0.5))
            out[base + 32] = L
            out[base + 36] = slope * _stiffness_ratio(L)
            out[base + 40] = mu * _friction_ratio(L)
            out[base + 44] = film
            out[base + 48] = water_torque * turn
            out[base + 52] = wave
            out[base + 56] = resisting * turn
            out[base + 60] = v_along
            out[base + 64] = r_e
            if front:
                half = _half_length(F_z, q.p, q.half_length, F_Z_HALF_LENGTH, P_HALF_LENGTH)
                out[base + 72] = _aligning_moment(s_x, s_y, F_z, mu, C_x, C_y, L, half)
            out[base + 76] = braking * turn
            out[base + 68] = v_full * max(q.contact_gain, 1e-30) ** (-1.0 / q.contact_exponent)

    # specific force: what an accelerometer shows; a trailer is pulled along
    a_x = (sum_x - drag) / (p.mass + p.towed_mass)
    a_y = sum_y / p.mass
    nudge = s.follow * (c.v_target - v_x)
    f[V_X] = a_x - slope_down / p.mass + yaw_rate * v_y + nudge
    f[V_Y] = a_y - yaw_rate * v_x
    f[YAW_RATE] = moment / p.I_zz
    f[PSI] = yaw_rate
    f[S] = v_x
    f[Y_LAT] = v_y + v_x * np.sin(y[PSI])
    f[A_X] = (a_x - y[A_X]) / p.roll_time
    f[A_Y] = (a_y - y[A_Y]) / p.roll_time

    if recorded:
        out[0], out[1], out[2], out[3], out[4], out[5] = v_x, v_y, yaw_rate, y[PSI], position, y[Y_LAT]
        out[6], out[7], out[8], out[9], out[10], out[11] = a_x, a_y, steer, drive, brake_total, grade
        out[12], out[13], out[14], out[15] = lane_front, lane_rear, drag, nudge


@compiled
def _solve(f, jac, h, k):  # type: ignore[no-untyped-def]
    """Solve (1 - h J) k = f: J is diagonal but for v_x and the wheels, which are coupled."""
    for i in range(N_STATES):
        k[i] = f[i] / (1.0 - h * jac[i])
    right = f[V_X]
    left = 1.0 - h * jac[V_X]
    for i in range(4):
        own = 1.0 - h * jac[OMEGA + i]
        right += h * jac[_J_V + i] * f[OMEGA + i] / own
        left -= h * h * jac[_J_V + i] * jac[_J_W + i] / own
    k[V_X] = right / left
    for i in range(4):
        k[OMEGA + i] = (f[OMEGA + i] + h * jac[_J_W + i] * k[V_X]) / (1.0 - h * jac[OMEGA + i])


@compiled
def integrate(n, dt, every, y0, car, wheels, extra, r, settings, controls, applied):  # type: ignore[no-untyped-def]
    """Integrate `n` steps of `dt` [s] from the state `y0`; record every `every`-th, the first included.

    ROS2 [verwer1999], a Rosenbrock [rosenbrock1963] W-method [steihaug1979] of two stages: second order for any
    Jacobian, L-stable for the part in the Jacobian, which is the stiff one: wheels and body on the tyres' slip.
    """
    h = (1.0 - np.sqrt(0.5)) * dt
    y = y0.copy()
    f = np.zeros(N_STATES)
    k1 = np.zeros(N_STATES)
    k2 = np.zeros(N_STATES)
    rest = np.zeros(N_STATES)
    jac = np.zeros(N_STATES + 8)
    unused = np.zeros(N_STATES + 8)
    row = np.zeros(_WIDTH)
    rows = np.zeros((n // every + 1, _WIDTH))
    cells = 2 + int((n * dt * 120.0 + 50.0) / r.ds) if r.lanes.shape[0] > 0 else 2
    track = np.zeros((cells, 3))
    track[:, 0] = -1.0
    released = np.zeros(4)
    releasing = np.zeros(4)
    p = car[0]
    s = settings[0]
    recorded, silent = True, False
    h_track_left, h_track_right = wheels[2].h_track, wheels[3].h_track
    film, contact_at = len(_SCALARS) + 44, len(_SCALARS) + 32
    omega_at, v_at, r_at = len(_SCALARS), len(_SCALARS) + 60, len(_SCALARS) + 64
    written = -1
    for k in range(n + 1):
        t = k * dt
        step = min(k, applied.shape[0] - 1)
        _rhs(t, y, f, jac, row, recorded, p, wheels, extra, r, s, controls[k], track, released, applied, step)
        if k % every == 0:
            rows[k // every] = row
        if k == n:
            break
        # what the front axle leaves for the rear one
        if r.lanes.shape[0] > 0:
            here = min(int(max(y[S], 0.0) / r.ds), cells - 1)
            for j in range(written + 1, here + 1):
                track[j, 0] = row[12]
                track[j, 1] = _residual_film(row[film], row[contact_at], h_track_left)
                track[j, 2] = _residual_film(row[film + 1], row[contact_at + 1], h_track_right)
            written = max(written, here)
        if s.antilock > 0.0:
            antilock(released, releasing, row, omega_at, v_at, r_at, dt)
        _solve(f, jac, h, k1)
        y1 = y + dt * k1
        step = min(k + 1, applied.shape[0] - 1)
        then = controls[k + 1]
        _rhs(t + dt, y1, f, unused, row, silent, p, wheels, extra, r, s, then, track, released, applied, step)
        for i in range(N_STATES):
            rest[i] = f[i] - 2.0 * k1[i]
        _solve(rest, jac, h, k2)
        total = 0.0
        for i in range(N_STATES):
            y[i] += dt * (1.5 * k1[i] + 0.5 * k2[i])
            total += y[i]
        if not np.isfinite(total):
            rows[:] = np.nan
            return rows
    return rows
