"""Nuisances of driver, motor and road on dry asphalt: wheels and torques move as on water, and no wheel floats."""

from __future__ import annotations

import math

from aqualog.core.notation import WHEELS
from aqualog.model.drawing import KMH, Drawing, Taken, lagging_torque, slalom_angle, terms
from aqualog.model.scenario import Kick, Steering
from aqualog.model.sensors import ESC
from aqualog.model.situations_made import Makers
from aqualog.model.term import Model

__all__ = ["CHASSIS"]

_NONE = Model()
Points = list[tuple[float, float]]


class _Motor:
    """Torque of the driven wheels in place of the driver's foot, with the speed that follows from it.

    The foot is off where a brake torque is asked for: a thousandth of a newton metre brakes nobody.
    """

    def __init__(self, k: Drawing, v: float, t: float) -> None:
        self.k, self.t, self.v = k, t, v
        self.speed: Points = [(0.0, v), (t, v)]
        self.torque: Points = [(0.0, 0.0), (t, 0.0)]
        self._off: Points = [(0.0, 0.0), (t, 0.0)]

    def drive(self, a: float, seconds: float, rise: float, shuffle: float = 0.0) -> None:
        """Accelerate by `a` [m/s²] for some seconds; torque rises within `rise` [s] and shuffles by a share of it."""
        now = self.torque[-1][1]
        step = self.k.vehicle.mass * a * self.k.vehicle.r_e_r - now
        f, decay = self.k.between(3.0, 7.0), self.k.between(0.2, 0.5)
        for i in range(1, 76 if shuffle else 1):
            s = 0.02 * i
            if rise + s < seconds:
                swing = shuffle * step * math.exp(-s / decay) * math.sin(2.0 * math.pi * f * s)
                self.torque.append((self.t + rise + s, now + step + swing))
        self.torque += [(self.t + rise, now + step), (self.t + seconds, now + step)]
        self.torque.sort()
        self._off += [(self.t + 0.01, 1e-3), (self.t + seconds, 1e-3)]
        self.t, self.v = self.t + seconds, max(self.v + a * seconds, 3.0)
        self.speed.append((self.t, self.v))

    def foot(self, v: float, a: float, rise: float) -> None:
        """Give the pedal back to the driver, who drives to a speed v [m/s] by `a` [m/s²] and stays there for 2 s."""
        self.torque.append((self.t + rise, 0.0))
        self._off.append((self.t + 0.01, 0.0))
        self.t += rise + abs(v - self.v) / a
        self.speed += [(self.t, v), (self.t + 2.0, v)]
        self.t, self.v = self.t + 2.0, v
        self.torque.append((self.t, 0.0))
        self._off.append((self.t, 0.0))

    def taken(self, note: str, lag_s: float = 0.0) -> Taken:
        """The drive."""
        sensors = lagging_torque(ESC, lag_s) if lag_s else ESC
        scenario = self.k.drive(
            self.t + 4.0, tuple(self.speed), extra_torque=tuple(self.torque), brake_torque=tuple(self._off),
            sensors=sensors,
        )  # fmt: skip
        return Taken(scenario, _NONE, note)


def _spare(k: Drawing) -> Taken:
    """2 to 6 % smaller and narrower (T125/80 R15 beside 205/55 R16: 3 %, K), at most 80 km/h."""
    v, duration, wheel = k.between(50.0, 80.0) * KMH, k.between(60.0, 110.0), k.one_of(*WHEELS)
    smaller, slope = k.between(0.02, 0.06), k.between(0.7, 0.95)
    model = terms(("tyre_radius", {"delta": -smaller}, wheel), ("slip_stiffness", {"gain": slope}, wheel))
    return Taken(k.drive(duration, k.cruise(duration, v, spread=0.12)), model, f"{wheel} {smaller:.1%} smaller")


def _regeneration(k: Drawing) -> Taken:
    """The motor brakes the driven axle alone, by 1 to 2.5 m/s²."""
    v = k.between(80.0, 110.0) * KMH
    motor = _Motor(k, v, k.between(8.0, 12.0))
    for _ in range(2):
        a = k.between(1.0, 2.5)
        motor.drive(-a, (v - k.between(50.0, 60.0) * KMH) / a, k.between(0.15, 0.5))
        motor.foot(v, k.between(0.8, 1.8), k.between(0.15, 0.5))
    return motor.taken(f"from {v / KMH:.0f} km/h by the motor")


def _one_pedal(k: Drawing) -> Taken:
    """Town with one pedal: the motor drives and brakes in turn."""
    motor = _Motor(k, k.between(40.0, 60.0) * KMH, k.between(6.0, 9.0))
    while motor.t < 70.0:
        a, low = k.between(1.2, 2.5), k.between(10.0, 25.0) * KMH
        motor.drive(-a, max((motor.v - low) / a, 0.8), k.between(0.2, 0.5))
        motor.drive(k.between(0.8, 2.0), k.between(2.0, 5.0), k.between(0.2, 0.5))
        motor.foot(k.between(40.0, 70.0) * KMH, k.between(0.8, 1.5), 0.3)
    return motor.taken("drives and brakes in turn")


def _tip_in(k: Drawing) -> Taken:
    """Pedal down and up within a tenth of a second; the driveline shuffles at 3 to 7 Hz (K)."""
    v = k.between(30.0, 90.0) * KMH
    motor, n = _Motor(k, v, k.between(6.0, 9.0)), int(k.rng.integers(4, 8))
    for _ in range(n):
        motor.drive(k.between(1.0, 2.5), k.between(1.5, 3.0), k.between(0.08, 0.2), k.between(0.1, 0.4))
        motor.drive(-0.4, k.between(1.5, 3.0), k.between(0.08, 0.2), k.between(0.1, 0.4))
        motor.foot(v, 1.2, 0.3)
    return motor.taken(f"{n} tip-ins and tip-outs at {v / KMH:.0f} km/h", k.between(0.05, 0.12))


def _lane_change(k: Drawing) -> Taken:
    """There and back, as between the cones of ISO 3888-1 (K)."""
    v, a_y = k.between(60.0, 100.0) * KMH, k.between(3.0, 6.0)
    angle = slalom_angle(k.vehicle, k.tyre, v, a_y) * k.one_of(-1.0, 1.0)
    steering = Steering(angle, k.between(2.2, 3.2), k.between(8.0, 12.0), "lane_change")
    scenario = k.drive(steering.start_s + 3.0 * steering.period_s + 8.0, ((0.0, v),), steering=steering)
    return Taken(scenario, _NONE, f"{a_y:.1f} m/s^2 at {v / KMH:.0f} km/h")


def _humps(k: Drawing) -> Taken:
    """Humps of 2 to 4 m and 5 to 8 cm: up against the wheel, down with it (K)."""
    v, duration = k.between(20.0, 45.0) * KMH, k.between(60.0, 90.0)
    kicks: list[Kick] = []
    for _ in range(int(k.rng.integers(3, 7))):
        at, half = k.between(6.0, duration - 6.0) * v, k.between(1.0, 2.0)
        torque, load = k.between(40.0, 120.0), k.between(800.0, 2500.0)
        # the load swings below the static one as it leaves the hump: the rebound of the second half
        kicks += [Kick(at, half, "both", torque, load), Kick(at + half, half, "both", -torque, -0.4 * load)]
    kicks.sort(key=lambda x: x.at)
    scenario = k.drive(duration, k.cruise(duration, v, spread=0.06), kicks=tuple(kicks))
    return Taken(scenario, _NONE, f"{len(kicks) // 2} humps at {v / KMH:.0f} km/h")


def _rumble(k: Drawing) -> Taken:
    """A milled strip at the road's edge, 13 mm deep every 0.3 m, under one side, for 20 to 50 m (V pitch, K force)."""
    v, duration, side = k.between(60.0, 110.0) * KMH, k.between(40.0, 60.0), k.one_of("left", "right")
    kicks: list[Kick] = []
    for start in (k.between(8.0, 14.0), k.between(20.0, 26.0)):
        torque, load = k.between(20.0, 80.0), k.between(400.0, 1500.0)
        kicks += [Kick(v * start + 0.3 * i, 0.15, side, torque, load) for i in range(int(k.between(65.0, 165.0)))]
    scenario = k.drive(duration, k.cruise(duration, v, spread=0.04), kicks=tuple(kicks))
    return Taken(scenario, _NONE, f"two strips {side} at {v / KMH:.0f} km/h")


def _vectoring(k: Drawing) -> Taken:
    """Two motors on an axle: 150 to 500 N·m from one wheel to the other with the steering, and on a straight road."""
    v, a_y, size = k.between(50.0, 90.0) * KMH, k.between(1.5, 4.0), k.between(150.0, 500.0)
    steering = Steering(slalom_angle(k.vehicle, k.tyre, v, a_y), k.between(3.0, 6.0), k.between(14.0, 18.0))
    late = k.between(0.0, 0.15)
    swing = [
        (t + late, size * math.sin(2.0 * math.pi * (t - steering.start_s) / steering.period_s))
        for t in (steering.start_s + 0.1 * i for i in range(int(10.0 * 4.0 * steering.period_s)))
    ]
    step = [(8.0, 0.0), (8.1, 0.6 * size), (10.0, 0.6 * size), (10.1, -0.6 * size), (12.0, -0.6 * size), (12.1, 0.0)]
    scenario = k.drive(swing[-1][0] + 5.0, ((0.0, v),), steering=steering, vectoring=(*step, *swing))
    return Taken(scenario, _NONE, f"{size:.0f} N m, {a_y:.1f} m/s^2 at {v / KMH:.0f} km/h")


CHASSIS: Makers = {
    "spare_wheel": ("a temporary spare wheel", _spare),
    "regeneration": ("regenerative braking on the driven axle", _regeneration),
    "one_pedal": ("one-pedal driving in town", _one_pedal),
    "tip_in": ("tip-in and tip-out, with a driveline that shuffles", _tip_in),
    "lane_change": ("double lane change", _lane_change),
    "humps": ("humps in the road", _humps),
    "rumble_strips": ("rumble strips under one side", _rumble),
    "torque_vectoring": ("motors that vector torque from side to side", _vectoring),
}
