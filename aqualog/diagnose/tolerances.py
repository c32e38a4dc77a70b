"""Quantities that no vehicle file or simulator has exactly: taken into account, but never reported as causes. Each has
the form of an effect. `friction` is mostly the curvature of a tyre's curve well below its peak: laws go from a parabola
to a straight line. `radius_loss`: wheels that carry more roll on less radius, in curves the outer ones. `preload` and
`locking`: a differential brakes the outer wheel and drives the inner one, which looks like another slip of both.
`antenna_height`: a car pitches by 0.01 rad per m/s² at the most, 1 m below an antenna on its roof (K)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from aqualog.core.notation import AXLES, WHEELS
from aqualog.model.plant import Plant
from aqualog.model.sensors import Channel
from aqualog.model.term import Effect, Parameter, Setup

__all__ = ["LANE_TOLERANCES", "STAND_IN", "TOLERANCES"]


_Apply = Callable[[Setup, Mapping[str, float], str | None], Setup]


def _plant(change: Callable[[Plant, float], Plant]) -> _Apply:
    return lambda setup, v, _: setup._replace(plant=change(setup.plant, v["by"]))


def _channel(signal: str, change: Callable[[Channel, float], Channel]) -> _Apply:
    def apply(setup: Setup, v: Mapping[str, float], _: str | None) -> Setup:
        old = setup.sensors.channels.get(signal, Channel())
        return setup._replace(sensors=setup.sensors.with_channel(signal, change(old, v["by"])))

    return apply


def _of(name: str, what: str, unit: str, sd: float, apply: _Apply, places: tuple[str, ...] = ()) -> Effect:
    by = Parameter("by", unit, 0.0, sd, -20.0 * sd, 20.0 * sd, sd, "deviation; sigma is the tolerance (K)")
    return Effect(name, what, "", "general knowledge", (by,), apply, places)


def _at_axles(name: str) -> _Apply:
    def apply(setup: Setup, v: Mapping[str, float], where: str | None) -> Setup:
        at = np.isin(WHEELS, AXLES[where] if where else WHEELS)
        return setup._replace(plant=setup.plant._replace(**{name: getattr(setup.plant, name) + v["by"] * at}))

    return apply


TOLERANCES: tuple[Effect, ...] = (
    _of("track", "track width, relative", "-", 0.02, _plant(lambda p, x: p._replace(track=p.track * (1.0 + x)))),
    _of("h_cg", "height of the centre of mass, relative", "-", 0.1,
        _plant(lambda p, x: p._replace(h_cg=p.h_cg * (1.0 + x)))),
    _of("axle_distance", "the centre of mass nearer to the rear axle", "m", 0.03,
        _plant(lambda p, x: p._replace(l_f=p.l_f + x, l_r=p.l_r - x))),
    _of("yaw_inertia", "yaw inertia, relative", "-", 0.2,
        _plant(lambda p, x: p._replace(I_zz=p.I_zz * max(1.0 + x, 0.05)))),
    _of("cornering_front", "cornering stiffness, front, relative", "-", 0.2, _plant(lambda p, x: p._replace(
        cornering_slope=p.cornering_slope * [1.0 + x, 1.0 + x, 1.0, 1.0]))),
    _of("cornering_rear", "cornering stiffness, rear, relative", "-", 0.2, _plant(lambda p, x: p._replace(
        cornering_slope=p.cornering_slope * [1.0, 1.0, 1.0 + x, 1.0 + x]))),
    _of("friction", "peak of the tyre's curve, relative: how early the curve bends", "-", 0.5,
        _plant(lambda p, x: p._replace(mu=p.mu * max(1.0 + x, 0.3)))),
    _of("radius_loss", "radius over wheel load, relative", "-", 0.005,
        _plant(lambda p, x: p._replace(radius_loss=p.radius_loss + x))),
    _of("antenna_height", "speed of the antenna by pitching, over the rate of a_x", "s^2", 0.01,
        _channel("v_x", lambda c, x: replace(c, pitching=c.pitching + x))),
    _of("steer_offset", "offset of the steering angle", "rad", 5e-3,
        _channel("steer_angle", lambda c, x: replace(c, bias=c.bias + x))),
    _of("steer_gain", "gain of the steering angle, relative", "-", 0.03,
        _channel("steer_angle", lambda c, x: replace(c, gain=c.gain * (1.0 + x)))),
    _of("gyro_offset", "offset of the yaw rate", "rad/s", 2e-3,
        _channel("yaw_rate", lambda c, x: replace(c, bias=c.bias + x))),
    _of("gyro_gain", "gain of the yaw rate, relative", "-", 0.02,
        _channel("yaw_rate", lambda c, x: replace(c, gain=c.gain * (1.0 + x)))),
    # the file has none, and an open differential up to twice these
    _of("preload", "friction of an axle's differential", "N*m", 15.0, _at_axles("preload"), tuple(AXLES)),
    _of("locking", "the same, over the torque of a wheel", "-", 0.06, _at_axles("locking"), tuple(AXLES)),
)  # fmt: skip

# the torque that the model needs on a flat road, in place of a missing one: load, wind and slopes are not in it
STAND_IN = _of("stand_in_torque", "torque in place of a missing one, relative", "-", 0.2, _at_axles("torque_gain"),
               tuple(AXLES))  # fmt: skip

# What one lane may differ by from the other lanes, of the size of an effect on all of them: its depth is known to 15 %,
# and the form of a law makes another error at each depth and speed. From sources, full aquaplaning falls with depth as
# h^-0.06 to h^-0.26, which is 18 % of the lost contact between 0.6 and 1.3 mm (K); drag within a factor of two (D).
_LANES = (("contact_loss", ("f", "r"), 0.2), ("water_drag", ("f", "r"), 0.3), ("uneven_water", ("left", "right"), 0.15))
LANE_TOLERANCES: dict[tuple[str, str], Effect] = {
    (effect, where): _of(f"{effect}_{where}_by_lane", "one lane's own, relative", "-", sd, lambda setup, _v, _w: setup)
    for effect, places, sd in _LANES
    for where in places
}
