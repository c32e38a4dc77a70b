"""The compiled four-wheel simulation: right-hand side and time stepping.

`rhs` calls driver, road, wheels and body in order; each is a function of its own, on scalars, by the equations of
`aqualog.physics`.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from aqualog.core.compiled import compiled, inlined, part
from aqualog.core.records import FloatArray
from aqualog.model.driver import antilock, driver, keep_lane
from aqualog.model.plant import Plant, flat, records
from aqualog.model.road import GRADE, Road, at_position, stretch_at, track_row
from aqualog.model.state import (
    A_X,
    A_Y,
    AT,
    J_SV,
    J_SW,
    J_V,
    J_VS,
    J_W,
    J_WS,
    MOTION_WIDTH,
    N_JACOBIAN,
    N_STATES,
    OMEGA,
    PSI,
    SLIP_X,
    STEER,
    V_X,
    V_Y,
    WIDTH,
    Y_LAT,
    YAW_RATE,
    S,
)
from aqualog.model.wheel import Now, Place, ground_under, over_road, wheel
from aqualog.physics import load, resistance, rolling, steering, water
from aqualog.physics.load import G

__all__ = ["Controls", "integrate", "run"]

NO_TORQUE: FloatArray = np.zeros((1, 4))
# a car that is followed stands where the measured one stands: a driver holds it on a slope, with a force that no log
# has, and what a rolling start differs by would last for seconds
SLOW, AT_REST = 3.0, 15.0  # [m/s] below it the speed is drawn harder, at rest by so many times
# nor does a measured car spin where the simulated one has too little grip: a rear axle that slides by this angle [rad]
# is turned back at this rate [1/s], in full from half as much beyond it, to a lateral acceleration that tyres hold
SLIDES, TURNED_BACK, BEYOND, HELD = 0.1, 8.0, 0.5, 5.0


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
    is_uneven: bool = False  # the road has heights
    steering_friction: float = 0.0  # [N] of the rack
    follow: float = 0.0  # [1/s] without a driver: how fast the speed is drawn to `v_target`, see `SLOW`; 0: free
    motion_only: bool = False  # the first `MOTION_WIDTH` columns are recorded, the others not


def run(
    n: int, dt: float, every: int, y0: FloatArray, plant: Plant, road: Road, controls: Controls,
    applied: FloatArray = NO_TORQUE,
) -> FloatArray:  # fmt: skip
    """`integrate` with its inputs packed: records are plain memory, tuples of arrays cost a count at every access.

    `applied` (n + 1, 4) [N·m]: torque at each wheel on top of the driver's, scaled by the plant's `torque_gain`; one
    row holds for the whole drive.
    """
    fields = controls._asdict()
    settings = {name: float(x) for name, x in fields.items() if np.ndim(x) == 0}
    series = records({name: x for name, x in fields.items() if np.ndim(x) == 1}, n + 1)
    memory = np.zeros(1, dtype=_MEMORY)
    memory["y"] = y0
    car, wheels, drag = flat(plant, **settings, dt=float(dt), ds=float(road.ds))
    # from NumPy, which asks for large pages: 120 s take 125 MB, and a fault for every 4 kB took a fifth of the time
    rows = np.empty((MOTION_WIDTH if controls.motion_only else WIDTH, n // every + 1)).T  # each column in one piece
    integrate(every, memory, car, wheels, drag, road.lanes, road.fields, series, applied, rows)
    return rows


_called = partial(part, is_inline=False)  # from two places: its code once
_loads = inlined(load.loads_of_wheels)
_residual_film = inlined(water.residual_film)
_air_drag = inlined(resistance.air_drag)
_grade_force = inlined(resistance.grade_force)
_cornering_drag = inlined(resistance.cornering_drag)
_rolling_force = inlined(resistance.rolling_resistance_force)
_warm_up_factor = inlined(rolling.warm_up_factor)
_held_angle = inlined(steering.held_angle)
_kingpin_moment = inlined(steering.kingpin_moment)
_PER_FORCE = 1.0 / (steering.STEERING.stiffness * steering.STEERING.arm)  # [rad/N] of the column, at the road wheels


# memory of a step: state `y`, derivative `f` there, both stages with the stiff Jacobian `jac` of the first, the record
# `out`; of each wheel the share of the brake that is held off, and torque on top of the driver's [N·m]; the angle at
# which the rack stands and how far the rods' force bends the column [rad]
_MEMORY = np.dtype([
    *((name, np.float64, N_STATES) for name in ("y", "f", "k1", "k2", "rest")),
    ("jac", np.float64, N_JACOBIAN), ("turned", np.float64, 8),
    ("out", np.float64, WIDTH), *((name, np.float64, 4) for name in ("released", "releasing", "applied")),
    *((name, np.float64) for name in ("is_first", "is_recorded", "is_detailed", "rack", "bent")),
])  # fmt: skip


@part
def _table(knots, x):  # type: ignore[no-untyped-def]
    """Linear interpolation in a table of knots (k, 2); constant beyond its ends."""
    if x <= knots[0, 0]:
        return knots[0, 1]
    for i in range(1, knots.shape[0]):
        if x < knots[i, 0]:
            w = (x - knots[i - 1, 0]) / (knots[i, 0] - knots[i - 1, 0])
            return knots[i - 1, 1] + w * (knots[i, 1] - knots[i - 1, 1])
    return knots[knots.shape[0] - 1, 1]


@_called
def _rhs(t, m, c, p, wheels, knots, lanes, fields, track):  # type: ignore[no-untyped-def]
    """Fill derivative, Jacobian and record at the time t [s], the state `m.y` and the controls c of the step.

    `p` and `wheels` are the records of `plant.flat`; `track` (m, 3) holds the stretch and the film behind the left and
    right front wheel.
    """
    y = m.y
    position = y[S]
    grade = c.grade + at_position(fields, GRADE, position, p.ds)
    drag = _drag(y, c, p, wheels, knots)
    slope_down = _grade_force(grade, p.mass)
    leak = min(max((t - p.leak_start) / p.leak_time, 0.0), 1.0)
    turned = c.steer + y[STEER]
    held = 0.0
    if p.steering_friction > 0.0:
        held = _held_angle(m.rack, turned + m.bent, p.steering_friction, _PER_FORCE)
    steer = turned + held
    warm = _warm_up_factor(t, p.warmup_extra, p.warmup_time) if p.warmup_extra != 0.0 else 1.0
    now = Now(t, steer, np.cos(steer), np.sin(steer), leak)
    loads = _loads(y[A_X], y[A_Y], p.mass, p.l_f, p.l_r, p.h_cg, p.track)
    command = driver(m, c, p, wheels, loads, warm, drag, slope_down)
    keep_lane(m, p.keeps_lane)

    way_rear = position - (p.l_f + p.l_r)
    behind = track_row(track, way_rear, p.ds)
    front = Place(position, stretch_at(lanes, t, position), -1)
    rear = Place(way_rear, int(track[behind, 0]) if behind >= 0 else -1, behind)
    if m.is_first > 0.0:
        m.jac[V_X], m.jac[V_Y], m.jac[YAW_RATE] = 0.0, 0.0, 0.0
    sum_x = 0.0
    sum_y = 0.0
    moment = 0.0
    for i in range(4):
        q = wheels[i]
        place = front if i < 2 else rear
        weight = over_road(i, loads[i], place.way, m, p, fields) if p.is_uneven > 0.0 else (loads[i], 0.0)
        ground = ground_under(i, warm, weight, place, p, q, lanes, fields, track)
        forces = wheel(i, now, ground, command, m, p, q)
        sum_x += forces.x
        sum_y += forces.y
        moment += forces.moment
    _turn_driveline(m.f, wheels)

    # specific force: what an accelerometer shows; a trailer is pulled along
    a_x = (sum_x - drag) / (p.mass + p.towed_mass)
    a_y = sum_y / p.mass
    slow = max(1.0 - c.v_target / SLOW, 0.0)
    nudge = p.follow * (1.0 + AT_REST * slow * slow) * (c.v_target - y[V_X])
    _move(m, a_x, a_y, slope_down / p.mass, moment / p.I_zz, nudge, p.roll_time)
    slides = _turned_back(m, p, wheels, c.v_target, steer) if p.follow > 0.0 else 0.0
    out = m.out
    if m.is_recorded > 0.0:
        out[AT.v_x], out[AT.a_x], out[AT.a_y], out[AT.yaw_rate] = y[V_X], a_x, a_y, y[YAW_RATE]
        out[AT.steer_angle], out[AT.position], out[AT.nudge], out[AT.slides] = turned, position, nudge, slides
    if m.is_detailed > 0.0:
        out[AT.v_y], out[AT.psi], out[AT.y_lat] = y[V_Y], y[PSI], y[Y_LAT]
        out[AT.drive_torque], out[AT.brake_torque] = command.drive, command.brake
        out[AT.grade], out[AT.lane_front], out[AT.lane_rear] = grade, front.lane, rear.lane
        out[AT.drag], out[AT.held] = drag, held


@part
def _turn_driveline(f, wheels):  # type: ignore[no-untyped-def]
    """Let the wheels of each axle turn the driveline by their mean: an open differential. Changes `f`. [rad/s²]

    Wheels that turn alike carry half of it each; one that spins alone a quarter, and it turns the other one back. The
    Jacobian stays that of the wheels: of second order all the same, and too stiff rather than too soft.
    """
    for i in range(0, 4, 2):
        quarter = 0.25 * wheels[i].driveline
        if quarter > 0.0:
            left, right = wheels[i].inertia, wheels[i + 1].inertia
            on_left, on_right = f[OMEGA + i] * left, f[OMEGA + i + 1] * right
            both = (left + quarter) * (right + quarter) - quarter * quarter
            f[OMEGA + i] = ((right + quarter) * on_left - quarter * on_right) / both
            f[OMEGA + i + 1] = ((left + quarter) * on_right - quarter * on_left) / both


@part
def _drag(y, c, p, wheels, knots):  # type: ignore[no-untyped-def]
    """Return the force against the motion that does not act at the wheels of the car. [N]"""
    drag = _air_drag(y[V_X] + p.head_wind + c.wind, p.drag_area, p.air_density) + _table(knots, y[V_X])
    drag += _cornering_drag(y[A_Y], p.mass, p.cornering_drag)
    if p.towed_mass > 0.0:
        drag += _rolling_force(p.towed_mass * G, wheels[2].r_w)
    return drag


@part
def _move(m, a_x, a_y, uphill, turning, nudge, roll_time):  # type: ignore[no-untyped-def]
    """Fill the derivatives of the body by its specific forces, slope and angular acceleration."""
    y, f = m.y, m.f
    f[V_X] = a_x - uphill + y[YAW_RATE] * y[V_Y] + nudge
    f[V_Y] = a_y - y[YAW_RATE] * y[V_X]
    f[YAW_RATE] = turning
    f[PSI] = y[YAW_RATE]
    f[S] = np.sqrt(y[V_X] * y[V_X] + y[V_Y] * y[V_Y])  # the length of its path: a car that turns round goes on
    f[Y_LAT] = y[V_Y] * np.cos(y[PSI]) + y[V_X] * np.sin(y[PSI])
    f[A_X] = (a_x - y[A_X]) / roll_time
    f[A_Y] = (a_y - y[A_Y]) / roll_time


@part
def _turned_back(m, p, wheels, v_target, steer):  # type: ignore[no-untyped-def]
    """Add to the derivatives what turns back a led car whose rear axle slides; return the share of it that acts."""
    y, f = m.y, m.f
    v = max(y[V_X], SLOW)
    slide = y[V_Y] - p.l_r * y[YAW_RATE]
    share = min((abs(slide) / (SLIDES * v) - 1.0) / BEYOND, 1.0)
    if share <= 0.0:
        return 0.0
    rate = TURNED_BACK * share
    turning = min(max(v * np.tan(steer) / (p.l_f + p.l_r), -HELD / v), HELD / v)
    f[YAW_RATE] += rate * (turning - y[YAW_RATE])
    f[V_Y] -= rate * slide
    f[V_X] += rate * (v_target - y[V_X])
    for i in range(4):
        f[OMEGA + i] += rate * (v_target / wheels[i].r_e - y[OMEGA + i])
    return share


@_called
def _solve(f, jac, h, k, turned):  # type: ignore[no-untyped-def]
    """Solve (1 - h J) k = f: J is diagonal but for v_x, the wheels with their belts, and slips that build up.

    The slip that a wheel's force waits for swings with it. It is eliminated first: `k` holds its part until then.
    """
    for i in range(N_STATES):
        k[i] = f[i] / (1.0 - h * jac[i])
    right = f[V_X]
    left = 1.0 - h * jac[V_X]
    for i in range(8):
        own, to_v, of_v = 1.0 - h * jac[OMEGA + i], h * jac[J_V + i], h * jac[J_W + i]
        if jac[J_WS + i] != 0.0:
            s = i % 4
            slip = 1.0 - h * jac[SLIP_X + s]
            own -= h * h * jac[J_WS + i] * jac[J_SW + s] / slip
            of_v += h * h * jac[J_WS + i] * jac[J_SV + s] / slip
            to_v += h * h * jac[J_VS + s] * jac[J_SW + s] / slip
            right += h * jac[J_VS + s] * k[SLIP_X + s]
            left -= h * h * jac[J_VS + s] * jac[J_SV + s] / slip
            k[OMEGA + i] = (f[OMEGA + i] + h * jac[J_WS + i] * k[SLIP_X + s]) / own
        right += to_v * k[OMEGA + i]
        left -= to_v * of_v / own
        turned[i] = of_v / own
    k[V_X] = right / left
    for i in range(8):
        k[OMEGA + i] += turned[i] * k[V_X]
        if jac[J_WS + i] != 0.0:
            s = i % 4
            more = jac[J_SW + s] * k[OMEGA + i] + jac[J_SV + s] * k[V_X]
            k[SLIP_X + s] += h * more / (1.0 - h * jac[SLIP_X + s])


@part
def _leave_track(track, written, m, wheels, ds):  # type: ignore[no-untyped-def]
    """Write what the front axle leaves for the rear one, up to its position; return the last row that is written."""
    here = min(int(max(m.out[AT.position], 0.0) / ds), track.shape[0] - 1)
    for j in range(written + 1, here + 1):
        track[j, 0] = m.out[AT.lane_front]
        for side in range(2):
            h_track = wheels[2 + side].h_track
            track[j, 1 + side] = _residual_film(m.out[AT.film + side], m.out[AT.contact + side], h_track)
    return max(written, here)


@part
def _settle_rack(m, wheels, friction):  # type: ignore[no-untyped-def]
    """Let the rack slide where the step recorded more than its friction holds. Changes `m.rack` and `m.bent`.

    The rods' force is a step late: it changes little within one, and the column gives way by a fifth of its change.
    """
    out, moment = m.out, 0.0
    for i in range(2):
        outward = 1.0 - 2.0 * i
        force = out[AT.F_x + i] - out[AT.wave_drag + i] - out[AT.climb + i]
        moment += outward * _kingpin_moment(
            force, outward * out[AT.F_y + i], out[AT.F_z + i], outward * out[AT.aligning + i], out[AT.braking + i],
            wheels[i].r_l, steering.STEERING,
        )  # fmt: skip
    m.bent = moment / steering.STEERING.arm * _PER_FORCE
    free = out[AT.steer_angle] + m.bent
    m.rack = free + _held_angle(m.rack, free, friction, _PER_FORCE)


@part
def _fill(applied, of_time, k):  # type: ignore[no-untyped-def]
    """Put row k of a table (n, 4) in place; its last row holds from there on."""
    for i in range(4):
        applied[i] = of_time[min(k, of_time.shape[0] - 1), i]


@compiled
def integrate(every, memory, car, wheels, knots, lanes, fields, controls, applied, rows):  # type: ignore[no-untyped-def]
    """Integrate over all rows of `controls` from the state in `memory`; fill `rows` at every `every`-th step.

    ROS2 [verwer1999], a Rosenbrock [rosenbrock1963] W-method [steihaug1979] of two stages: second order for any
    Jacobian, L-stable for the part in the Jacobian, which is the stiff one: wheels and body on the tyres' slip.
    """
    m, p = memory[0], car[0]
    n, dt = controls.shape[0] - 1, p.dt
    h = (1.0 - np.sqrt(0.5)) * dt
    y = np.empty(N_STATES)
    for i in range(N_STATES):
        y[i] = m.y[i]
    wanted = rows.shape[1]
    needs_detail = lanes.shape[0] > 0 or p.steering_friction > 0.0  # what a step leaves for later ones
    cells = 2 + int((n * dt * 120.0 + 50.0) / p.ds) if lanes.shape[0] > 0 else 2
    track = np.zeros((cells, 3))
    track[:, 0] = -1.0
    written = -1
    for k in range(n + 1):
        t = k * dt
        _fill(m.applied, applied, k)
        is_kept = k % every == 0
        m.is_first = 1.0
        m.is_recorded = 1.0 if is_kept or needs_detail else 0.0
        m.is_detailed = 1.0 if needs_detail or (is_kept and wanted == WIDTH) else 0.0
        _rhs(t, m, controls[k], p, wheels, knots, lanes, fields, track)
        if is_kept:
            for i in range(wanted):
                rows[k // every, i] = m.out[i]
        if k == n:
            break
        if lanes.shape[0] > 0:
            written = _leave_track(track, written, m, wheels, p.ds)
        if p.antilock > 0.0:
            antilock(m, dt)
        if p.steering_friction > 0.0:
            _settle_rack(m, wheels, p.steering_friction)
        _solve(m.f, m.jac, h, m.k1, m.turned)
        for i in range(N_STATES):
            m.y[i] = y[i] + dt * m.k1[i]
        _fill(m.applied, applied, k + 1)
        m.is_first, m.is_recorded, m.is_detailed = 0.0, 0.0, 0.0
        _rhs(t + dt, m, controls[k + 1], p, wheels, knots, lanes, fields, track)
        for i in range(N_STATES):
            m.rest[i] = m.f[i] - 2.0 * m.k1[i]
        _solve(m.rest, m.jac, h, m.k2, m.turned)
        total = 0.0
        for i in range(N_STATES):
            y[i] += dt * (1.5 * m.k1[i] + 0.5 * m.k2[i])
            m.y[i] = y[i]
            total += y[i]
        if not np.isfinite(total):
            rows[:] = np.nan
            return
