"""The driver in the compiled simulation: pedals, antilock brakes, steering wheel, and the excitation of the axles."""

from __future__ import annotations

from aqualog.core.compiled import inlined, part
from aqualog.model import excitation
from aqualog.model.state import AT, BRAKE, DRIVE, INTEGRAL, OMEGA, PSI, STEER, V_X, Y_LAT
from aqualog.model.wheel import Command
from aqualog.physics.load import G
from aqualog.physics.resistance import rolling_resistance_force

__all__ = ["antilock", "driver", "keep_lane"]

# gains of a calm driver (K)
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

_rolling_force = inlined(rolling_resistance_force)
_amplitude = inlined(excitation.excitation_force_amplitude)


@part
def driver(m, c, p, wheels, loads, warm, drag, slope_down):  # type: ignore[no-untyped-def]
    """Fill the derivatives of the pedals and return the torques of the step.

    `drag` and `slope_down` [N] are what the driver feels against the car besides its rolling resistance.
    """
    y, f = m.y, m.f
    split_rear = c.split_rear
    # mean radius of the driven wheels, by their share
    r_drive = 0.5 * (
        (1.0 - split_rear) * (wheels[0].r_e + wheels[1].r_e) + split_rear * (wheels[2].r_e + wheels[3].r_e)
    )
    if p.has_driver > 0.0:
        # mean speed of the driven wheels
        turning = 0.5 * (1.0 - split_rear) * (y[OMEGA] + y[OMEGA + 1])
        turning += 0.5 * split_rear * (y[OMEGA + 2] + y[OMEGA + 3])
        error = c.v_target - y[V_X]
        wanted = p.mass * (c.a_target + K_SPEED * error) + y[INTEGRAL] + drag + slope_down
        for i in range(4):
            wanted += _rolling_force(loads[i], wheels[i].r_w) * warm
        runs_away = turning * r_drive > RUN_AWAY * max(y[V_X], 5.0)
        _pedals(m, wanted, error, r_drive, p.mass, c.brake > 0.0 or runs_away)
        drive = y[DRIVE] * c.gain + c.drive
        drive = min(drive, p.power / max(turning, 1.0))
        if drive < 0.0:  # an engine brakes, it does not drive backwards
            drive *= min(max(turning, 0.0), 1.0)
    else:
        f[DRIVE] = 0.0
        f[INTEGRAL] = 0.0
        f[BRAKE] = 0.0
        drive = c.drive * ((1.0 - split_rear) * wheels[0].torque_gain + split_rear * wheels[2].torque_gain)
    return Command(drive, c.brake + y[BRAKE], _excitation(c, p, drive / r_drive), split_rear)


@part
def _pedals(m, wanted, error, r_drive, mass, is_off):  # type: ignore[no-untyped-def]
    """Fill the derivatives of pedals and integral; `is_off`: the foot is on the other pedal, or lifts."""
    y, f = m.y, m.f
    least = -ENGINE_BRAKING * mass * G
    most = MAX_DRIVE * mass * G
    if is_off:
        f[DRIVE] = -y[DRIVE] / PEDAL_TIME
        f[INTEGRAL] = 0.0
        f[BRAKE] = -y[BRAKE] / PEDAL_TIME
    else:
        f[DRIVE] = (min(max(wanted, least), most) * r_drive - y[DRIVE]) / PEDAL_TIME
        f[INTEGRAL] = K_INTEGRAL * mass * error
        if abs(y[INTEGRAL]) > MAX_INTEGRAL * mass * G and y[INTEGRAL] * error > 0.0:
            f[INTEGRAL] = 0.0
        f[BRAKE] = (max(least - wanted, 0.0) * r_drive - y[BRAKE]) / PEDAL_TIME


@part
def _excitation(c, p, nominal):  # type: ignore[no-untyped-def]
    """Return the active excitation: what one axle gains the other loses (3.26, 3.27). [N]"""
    wheelbase = p.l_f + p.l_r
    return c.exc * _amplitude(
        int(p.exc_kind), p.exc_amplitude, (1.0 - c.split_rear) * nominal, c.split_rear * nominal,
        p.mass * G * p.l_r / wheelbase, p.mass * G * p.l_f / wheelbase,
    )  # fmt: skip


@part
def keep_lane(m, keeps_lane):  # type: ignore[no-untyped-def]
    """Fill the derivative of the steering angle: back to the middle of the lane, or straight ahead."""
    y, f = m.y, m.f
    if keeps_lane > 0.0:
        f[STEER] = (-K_LATERAL * (y[Y_LAT] + PREVIEW_TIME * y[V_X] * y[PSI]) - y[STEER]) / STEER_TIME
    else:
        f[STEER] = -y[STEER] / STEER_TIME


SLIP_RELEASE = 0.12  # [-] brake slip at which pressure is let go, about the peak of a tyre on any road (K)
SLIP_BUILD = 0.04  # [-] at which it comes back (K)
RELEASE_RATE = 9.0  # [1/s] of the whole torque: a valve empties a brake in about a tenth of a second (K)
BUILD_RATE = 2.5  # [1/s] stepwise build-up, on average (K)
V_OFF = 2.0  # [m/s] below, wheels may lock: 3-10 km/h on series cars (K)


@part
def antilock(m, dt):  # type: ignore[no-untyped-def]
    """One step of a two-state controller per wheel, in place, by the speeds that the step recorded.

    `m.released` (4,) is the share of the brake torque that is held off, `m.releasing` (4,) 1 while it falls. The cycle
    of 3 to 10 Hz follows from rates, thresholds and the wheel's inertia.
    """
    for i in range(4):
        v = m.out[AT.v_along + i]
        slip = 1.0 - m.out[AT.omega + i] * m.out[AT.r_e + i] / max(v, 0.1)
        if v < V_OFF or slip < SLIP_BUILD:
            m.releasing[i] = 0.0
        elif slip > SLIP_RELEASE:
            m.releasing[i] = 1.0
        if m.releasing[i] > 0.0:
            m.released[i] = min(m.released[i] + RELEASE_RATE * dt, 1.0)
        else:
            m.released[i] = max(m.released[i] - BUILD_RATE * dt, 0.0)
