"""One wheel in the compiled simulation: rolling, road, water, tyre, balance of torques, and what is recorded of it.

Each function is one term of the physics, on scalars, and gives a record that later terms read. `wheel` calls them in
order: another term is one function and one line there. Equations are those of `aqualog.physics`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aqualog.core.compiled import inlined, part
from aqualog.model.plant import F_Z_HALF_LENGTH, P_HALF_LENGTH
from aqualog.model.road import (
    BUMPS,
    CONTACT_ROAD,
    CONTACT_WHEEL,
    DEPTH,
    DEPTH_LEFT,
    HEIGHT,
    IRREGULARITY_LEFT,
    KICK_LOAD,
    KICK_TORQUE,
    LANE_COMPLIANCE,
    LANE_MU,
    ROLLING,
    ROUGHNESS,
    SURFACE_WIDTH,
    TRACK,
    at_position,
    rise_at,
)
from aqualog.model.state import (
    ANGLE,
    AT,
    BELT,
    J_SV,
    J_SW,
    J_V,
    J_VS,
    J_W,
    J_WS,
    LIFT,
    OMEGA,
    RISE,
    SLIP_X,
    SLIP_Y,
    TWIST,
    V_X,
    V_Y,
    YAW_RATE,
)
from aqualog.physics import (
    contact,
    driveline,
    hydroplaning,
    kinematics,
    load,
    rolling,
    slip,
    steering,
    surface,
    tyre_brush,
    water,
)
from aqualog.physics.hydroplaning import WaterLaw
from aqualog.physics.resistance import rolling_resistance_force

__all__ = [
    "Body", "Command", "Contact", "Ground", "Now", "Place", "even_full_speed", "ground_under", "over_road", "water_at",
    "wheel",
]  # fmt: skip

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
_skimming_share = inlined(water.skimming_share)
_series_slope = inlined(surface.series_slope)
_rolling_force = inlined(rolling_resistance_force)
_aligning_moment = inlined(steering.aligning_moment)
_effective_radius = inlined(rolling.effective_radius)
_pressed_radius = inlined(rolling.pressed_radius)
_load_factor = inlined(rolling.load_factor)
_carcass_torque = inlined(rolling.carcass_torque)
_differential_friction = inlined(driveline.differential_friction)
_hop = inlined(load.hop)
_HOP_MASS, _HOP_STIFFNESS, _HOP_DAMPING = load.HOP
_SPIN_UP_RATIO = float(hydroplaning.SPIN_UP_RATIO)
STICKS = 5.0  # times its time constant, a step within which a sliding wheel comes to stick
_FIELD_SHARE = float(np.sqrt(0.5))  # half of the contact's variance is the road's, half the wheel's own


class Now(NamedTuple):
    """Time [s], angle of the front wheels [rad] with cosine and sine, share of a leak so far. [-]"""

    t: float
    steer: float
    cos: float
    sin: float
    leak: float


class Command(NamedTuple):
    """Drive torque and sum of the brake torques [N·m], force of the excitation [N], rear share of the drive."""

    drive: float
    brake: float
    excitation: float
    split_rear: float


class Place(NamedTuple):
    """An axle on the road: way [m], stretch (-1: dry asphalt), row of the front axle's track (-1: none)."""

    way: float
    lane: int
    behind: int


class Body(NamedTuple):
    """Forces on the body [N] in its axes, and their moment about the vertical. [N·m]"""

    x: float
    y: float
    moment: float


class _Rolling(NamedTuple):
    """Lever arms from the centre of mass, speeds of the tread and over ground, radius, speed at it. [m, rad/s, m/s]"""

    x: float
    y: float
    omega: float
    along: float
    across: float
    r_e: float
    rim: float


class Ground(NamedTuple):
    """Load [N], friction, yield and rolling resistance coefficient [-], torque of bumps [N·m], film [m].

    `noise` is the fluctuation of the contact where there is a film, of unit variance; `climb` [N] what the slope of the
    road's unevenness holds the wheel's centre back with.
    """

    F_z: float
    climb: float
    mu: float
    compliance: float
    r_w: float
    bump: float
    film: float
    noise: float


class Contact(NamedTuple):
    """Remaining contact and friction [-], force of film and wave [N], torque of the load's shift, full speed."""

    contact: float
    mu: float
    film_force: float
    wave: float
    shift: float
    v_full: float


class _Stiffness(NamedTuple):
    """Slip slope [-], and stiffness along and across. [N]"""

    slope: float
    C_x: float
    C_y: float


class _Slip(NamedTuple):
    """Slip along and across, and derivatives of the first by wheel speed and velocity."""

    s_x: float
    s_y: float
    by_omega: float
    by_v: float


class _Balance(NamedTuple):
    """Torques [N·m]; `turn`, `rim_turn`: signs of the tread's and the rim's turning, smooth within `standstill`."""

    torque: float
    braking: float
    water: float
    resisting: float
    standstill: float
    turn: float
    rim_turn: float


@part
def over_road(i, F_z, way, m, p, fields):  # type: ignore[no-untyped-def]
    """Let wheel `i` hop over the unevenness at a way [m]; return its load and what the slope there takes. [N]"""
    side = i % 2
    height = at_position(fields, HEIGHT + side, way, p.ds)
    rate = m.y[RISE + i]
    added, rising = _hop(m.y[LIFT + i], rate, height, _HOP_MASS, _HOP_STIFFNESS, _HOP_DAMPING)
    m.f[LIFT + i] = rate
    m.f[RISE + i] = rising
    F_z = max(F_z + added, 0.0)
    return F_z, F_z * rise_at(fields, HEIGHT + side, way, p.ds)


@part
def ground_under(i, warm, weight, place, p, q, lanes, fields, track):  # type: ignore[no-untyped-def]
    """Return the road under wheel `i`; the film of a rear wheel is what the front one has left.

    `weight`: what `over_road` returns, or the static load and 0 on an even road.
    """
    F_z, climb = weight
    lane, side = place.lane, i % 2
    mu = q.mu
    compliance = 0.0
    r_w = q.r_w * warm
    bump = 0.0
    film = 0.0
    noise = 0.0
    of_side = SURFACE_WIDTH * side
    if lane >= 0:
        if lanes[lane, LANE_MU + of_side] >= 0.0:
            mu = lanes[lane, LANE_MU + of_side]
        compliance = lanes[lane, LANE_COMPLIANCE + of_side]
        r_w += lanes[lane, ROLLING + of_side]
        bump = lanes[lane, ROUGHNESS + of_side] * at_position(fields, BUMPS + side, place.way, p.ds)
        if i < 2:
            uneven = 1.0 + lanes[lane, IRREGULARITY_LEFT + side] * at_position(fields, DEPTH + side, place.way, p.ds)
            film = lanes[lane, DEPTH_LEFT + side] * max(uneven, 0.0)
        else:
            uneven = 1.0 + p.scatter * q.track_irregularity * at_position(fields, TRACK + side, place.way, p.ds)
            film = track[place.behind, 1 + side] * max(uneven, 0.0)
    if p.kicks > 0.0:
        bump += at_position(fields, KICK_TORQUE + side, place.way, p.ds)
        F_z = max(F_z + at_position(fields, KICK_LOAD + side, place.way, p.ds), 0.0)
    if film > 0.0:
        noise = _FIELD_SHARE * (
            at_position(fields, CONTACT_ROAD + side, place.way, p.ds)
            + at_position(fields, CONTACT_WHEEL + i, place.way, p.ds)
        )
    return Ground(F_z, climb, mu, compliance, r_w, bump, film, noise)


@part
def wheel(i, now, ground, command, m, p, q):  # type: ignore[no-untyped-def]
    """Fill what wheel `i` contributes to derivative, Jacobian and record; return its forces on the body."""
    roll = _rolling(i, now, ground.F_z, m, p, q)
    wet = _water(roll, ground, p.scatter, q)
    stiff = _stiffness(now, ground, q)
    slips = _slip(i, m, roll, q.relaxation_length, p.dt)
    F_x, F_y = _brush_forces(slips.s_x, slips.s_y, ground.F_z, wet.mu, stiff.C_x, stiff.C_y, wet.contact)
    balance = _balance(i, roll, ground, wet, command, m, p, q)
    if q.belt_inertia > 0.0:
        _twist(i, m, F_x, roll, ground, balance, q)
    else:
        m.f[OMEGA + i] = (
            balance.torque - F_x * roll.r_e - (balance.resisting + balance.braking) * balance.turn + ground.bump
        ) / q.inertia
    m.f[ANGLE + i] = m.y[OMEGA + i]
    if m.is_first > 0.0:
        _jacobian(i, m, F_x, roll, slips, stiff, wet.contact, balance, p, q)
    out = m.out
    if m.is_recorded > 0.0:
        out[AT.omega + i] = m.y[OMEGA + i]
        out[AT.angle + i] = m.y[ANGLE + i]
        out[AT.torque + i] = balance.torque - balance.braking * balance.rim_turn
    if m.is_detailed > 0.0:
        _record(i, out, roll, ground, wet, balance, stiff.slope)
        out[AT.twist + i] = m.y[TWIST + i]
        out[AT.F_x + i] = F_x
        out[AT.F_y + i] = F_y
        out[AT.s_x + i] = slips.s_x
        out[AT.v_full + i] = wet.v_full
        if q.contact_gain != 1.0:
            out[AT.v_full + i] *= max(q.contact_gain, 1e-30) ** (-1.0 / q.contact_exponent)
        if i < 2:
            half = _half_length(ground.F_z, q.p, q.half_length, F_Z_HALF_LENGTH, P_HALF_LENGTH)
            out[AT.aligning + i] = _aligning_moment(
                slips.s_x, slips.s_y, ground.F_z, wet.mu, stiff.C_x, stiff.C_y, wet.contact, half
            )
    return _on_body(i, now, roll, F_x - wet.wave - ground.climb, F_y)


@part
def _rolling(i, now, F_z, m, p, q):  # type: ignore[no-untyped-def]
    front = i < 2
    x = p.l_f if front else -p.l_r
    side = 0.5 * p.track if i % 2 == 0 else -0.5 * p.track
    angle = now.steer if front else 0.0
    along, across = _wheel_velocity(m.y[V_X], m.y[V_Y], m.y[YAW_RATE], angle, x, side)
    r_e = _effective_radius(q.r_e, along, q.radius_growth) * (1.0 - q.leak_radius * now.leak)
    r_e *= _pressed_radius(F_z, q.F_z_ref, q.radius_loss)
    omega = m.y[BELT + i] if q.belt_inertia > 0.0 else m.y[OMEGA + i]
    return _Rolling(x, side, omega, along, across, r_e, omega * r_e)


@part
def even_full_speed(film, F_z, q):  # type: ignore[no-untyped-def]
    """Return the speed of full aquaplaning of a rolling wheel with the numbers `q` in an even film [m] and load [N]."""
    law = WaterLaw(
        q.v_anchor, q.pressure_exponent, q.thin_gain, q.h_bulk, q.h_onset, q.tread_gain, q.contact_exponent,
        q.aspect_exponent,
    )  # fmt: skip
    return _v_full(film, F_z, q.p, q.tread_depth, q.tread_capacity, 1.0, 0.5 * q.width / q.half_length, law)


@part
def water_at(film, F_z, v_even, along, rim, mu, q):  # type: ignore[no-untyped-def]
    """Return what water does to the contact, and its resistance.

    `v_even` [m/s]: full aquaplaning of a rolling wheel here; speeds [m/s] of the wheel's centre and of its rim.
    """
    way = 1.0 if along >= 0.0 else -1.0  # water acts on a car that has turned round as it does on one that goes ahead
    ahead, rim = way * along, way * rim
    # a wheel that has slowed down floats down to a lower speed: Horne's spin-up speed
    rolling_share = min(max(rim / max(ahead, 0.5), 0.0), 1.0)
    v_full = v_even * (_SPIN_UP_RATIO + (1.0 - _SPIN_UP_RATIO) * rolling_share)
    lost = _lost_contact(along, v_full, q.contact_exponent) * q.contact_gain
    L = 1.0 - min(max(lost, 0.0), 1.0)
    half = _half_length(F_z, q.p, q.half_length, F_Z_HALF_LENGTH, P_HALF_LENGTH)
    shift = _load_shift(L, half, q.wedge_arm) * F_z
    gain = q.water_drag_gain * _skimming_share(ahead, v_full)
    film_force = gain * _film_drag(film, ahead, rim, q.width, q.tread_capacity, q.h_film, q.groove_relief)
    skid = max(ahead - rim, 0.0)  # a slower tread pushes what it no longer throws
    wave = (
        way
        * gain
        * (
            _wave_drag(film, ahead, q.width, q.h_wave)
            + _film_drag(film, ahead, skid, q.width, q.tread_capacity, q.h_film, q.groove_relief)
        )
    )
    return Contact(L, mu * q.wet_friction, film_force, wave, shift, v_full)


@part
def _water(roll, ground, scatter, q):  # type: ignore[no-untyped-def]
    if not ground.film > 0.0:
        return Contact(1.0, ground.mu, 0.0, 0.0, 0.0, 1e6)
    v_even = even_full_speed(ground.film, ground.F_z, q)
    v_even *= max(1.0 + scatter * q.contact_scatter * ground.noise, 0.2)
    return water_at(ground.film, ground.F_z, v_even, roll.along, roll.rim, ground.mu, q)


@part
def _stiffness(now, ground, q):  # type: ignore[no-untyped-def]
    drifted = np.exp(min(max(q.slip_slope_drift * now.t, -3.0), 3.0)) if q.slip_slope_drift != 0.0 else 1.0
    slope = q.slip_slope * (1.0 + q.leak_slope * now.leak) * drifted
    slope = _series_slope(slope * _load_factor(ground.F_z, q.F_z_ref, q.load_sensitivity), ground.compliance)
    across = _series_slope(q.cornering_slope, ground.compliance)
    return _Stiffness(slope, slope * ground.F_z, across * ground.F_z)


@part
def _slip(i, m, roll, sigma, dt):  # type: ignore[no-untyped-def]
    """Return the slips, with a first-order build-up where the tyre has a relaxation length that it takes longer than a
    step to roll."""
    s_x = _bounded_slip(roll.rim, roll.along)
    speed = max(abs(roll.rim), 0.5)
    s_y = -roll.across / speed
    by_omega = max(roll.along, 0.0) * roll.r_e / (speed * speed) if abs(roll.rim) > 0.5 else 2.0 * roll.r_e
    if sigma > 0.0:
        rate = min(speed / sigma, 1.0 / dt)
        m.f[SLIP_X + i] = rate * (s_x - m.y[SLIP_X + i])
        m.f[SLIP_Y + i] = rate * (s_y - m.y[SLIP_Y + i])
        if m.is_first > 0.0:
            m.jac[SLIP_X + i] = -rate
            m.jac[SLIP_Y + i] = -rate
            m.jac[J_SW + i], m.jac[J_SV + i] = rate * by_omega, -rate / speed
        if sigma > speed * dt:
            return _Slip(m.y[SLIP_X + i], m.y[SLIP_Y + i], 0.0, 0.0)
    return _Slip(s_x, s_y, by_omega, -1.0 / speed)


@part
def _balance(i, roll, ground, wet, command, m, p, q):  # type: ignore[no-untyped-def]
    front = i < 2
    share = 1.0 - command.split_rear if front else command.split_rear
    torque = 0.5 * share * command.drive + (0.5 if front else -0.5) * command.excitation * roll.r_e
    torque += m.applied[i] * q.torque_gain
    if q.preload != 0.0 or q.locking != 0.0:
        torque -= _differential_friction(m.y[OMEGA + i] - m.y[OMEGA + (i ^ 1)], torque, q.preload, q.locking)
    braking = q.brake_split * command.brake * (1.0 - m.released[i])
    water_torque = wet.film_force * roll.r_e + wet.shift
    resisting = _rolling_force(ground.F_z, ground.r_w) * roll.r_e + water_torque + q.brake_drag
    # resistance fades out near standstill instead of jumping, over what one step of it can change
    standstill = max(1.0, p.dt * (resisting + braking) / q.inertia)
    turn = min(max(roll.omega / standstill, -1.0), 1.0)
    rim_turn = min(max(m.y[OMEGA + i] / standstill, -1.0), 1.0)
    return _Balance(torque, braking, water_torque, resisting, standstill, turn, rim_turn)


@part
def _twist(i, m, F_x, roll, ground, balance, q):  # type: ignore[no-untyped-def]
    """Fill the derivatives of a rim, on which drive and brake act, and of its belt, on which the road acts."""
    y, f = m.y, m.f
    rate = y[OMEGA + i] - roll.omega
    carcass = _carcass_torque(y[TWIST + i], rate, q.torsion_stiffness, q.torsion_damping)
    at_rim = balance.braking + q.brake_drag
    f[OMEGA + i] = (balance.torque - at_rim * balance.rim_turn - carcass) / q.inertia
    at_belt = (balance.resisting - q.brake_drag) * balance.turn
    f[BELT + i] = (carcass - F_x * roll.r_e - at_belt + ground.bump) / q.belt_inertia
    f[TWIST + i] = rate


@part
def _jacobian(i, m, F_x, roll, slips, stiff, L, balance, p, q):  # type: ignore[no-untyped-def]
    # the secant, not the tangent: a sliding tyre must be damped too where one step would carry it past sticking
    sticking = stiff.C_x * _stiffness_ratio(L)
    dF_dsx = abs(F_x) / abs(slips.s_x) if abs(slips.s_x) > 1e-9 else sticking
    jac = m.jac
    # where rim and belt are two, the tread is the belt's; their own coupling is not stiff
    tread, turned = (i + 4, q.belt_inertia) if q.belt_inertia > 0.0 else (i, q.inertia)
    arm = roll.r_e / turned
    # one step makes it stick, and there it is stiffer: else the wheel swings to and fro from step to step
    if p.dt * dF_dsx * slips.by_omega * arm > STICKS:
        dF_dsx = max(dF_dsx, sticking)
    jac[OMEGA + tread] = -dF_dsx * slips.by_omega * arm
    jac[J_W + tread] = -dF_dsx * slips.by_v * arm
    jac[J_V + tread] = dF_dsx * slips.by_omega / p.mass
    jac[V_X] += dF_dsx * slips.by_v / p.mass
    if q.relaxation_length > 0.0:
        lags = 1.0 if slips.by_v == 0.0 else 0.0
        jac[J_WS + tread], jac[J_VS + i] = -lags * dF_dsx * arm, lags * dF_dsx / p.mass
    across = stiff.C_y * slips.by_v * (dF_dsx / max(stiff.C_x, 1.0))
    jac[V_Y] += across / p.mass
    jac[YAW_RATE] += across * roll.x * roll.x / p.I_zz
    if abs(roll.omega) < balance.standstill:
        jac[OMEGA + tread] -= (balance.resisting + balance.braking) / (turned * balance.standstill)


@part
def _on_body(i, now, roll, along, F_y):  # type: ignore[no-untyped-def]
    cos, sin = (now.cos, now.sin) if i < 2 else (1.0, 0.0)
    x = along * cos - F_y * sin
    y = along * sin + F_y * cos
    return Body(x, y, roll.x * y - roll.y * x)


@part
def _record(i, out, roll, ground, wet, balance, slope):  # type: ignore[no-untyped-def]
    out[AT.tread_omega + i] = roll.omega
    out[AT.climb + i] = ground.climb
    out[AT.F_z + i] = ground.F_z
    out[AT.slip_angle + i] = -np.arctan2(roll.across, max(abs(roll.along), 0.5))
    out[AT.contact + i] = wet.contact
    out[AT.slope + i] = slope * _stiffness_ratio(wet.contact)
    out[AT.mu_max + i] = wet.mu * _friction_ratio(wet.contact)
    out[AT.film + i] = ground.film
    out[AT.water_torque + i] = balance.water * balance.turn
    out[AT.wave_drag + i] = wet.wave
    out[AT.resisting_torque + i] = balance.resisting * balance.turn
    out[AT.v_along + i] = roll.along
    out[AT.r_e + i] = roll.r_e
    out[AT.braking + i] = balance.braking * balance.rim_turn
