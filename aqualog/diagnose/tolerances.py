"""Quantities that no vehicle file or simulator has exactly: taken into account, but never reported as causes.

The geometry of curves, the height of the centre of mass, the form of a tyre's curve, offsets of steering and gyro. Each
has the form of an effect, so that simulation gives its change of the residuals. `friction` is mostly the curvature of a
tyre's curve well below its peak: laws go from a parabola to a straight line.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from aqualog.model.plant import Plant
from aqualog.model.sensors import Channel
from aqualog.model.term import Effect, Parameter, Setup

__all__ = ["STAND_IN", "TOLERANCES", "WATER_TOLERANCES"]


def _plant(change: Callable[[Plant, float], Plant]) -> Callable[[Setup, Mapping[str, float], str | None], Setup]:
    return lambda setup, v, _: setup._replace(plant=change(setup.plant, v["by"]))


def _channel(signal: str, change: Callable[[Channel, float], Channel]) -> Callable[
    [Setup, Mapping[str, float], str | None], Setup
]:  # fmt: skip
    def apply(setup: Setup, v: Mapping[str, float], _: str | None) -> Setup:
        old = setup.sensors.channels.get(signal, Channel())
        return setup._replace(sensors=setup.sensors.with_channel(signal, change(old, v["by"])))

    return apply


def _of(name: str, unit: str, sd: float, apply: Callable[[Setup, Mapping[str, float], str | None], Setup]) -> Effect:
    by = Parameter("by", unit, 0.0, sd, -20.0 * sd, 20.0 * sd, sd, "deviation; sigma is the tolerance (K)")
    return Effect(name, "tolerance", "", "general knowledge", (by,), apply)


TOLERANCES: tuple[Effect, ...] = (
    _of("track", "-", 0.02, _plant(lambda p, x: p._replace(track=p.track * (1.0 + x)))),
    _of("h_cg", "-", 0.1, _plant(lambda p, x: p._replace(h_cg=p.h_cg * (1.0 + x)))),
    _of("axle_distance", "m", 0.03, _plant(lambda p, x: p._replace(l_f=p.l_f + x, l_r=p.l_r - x))),
    _of("cornering_front", "-", 0.2, _plant(lambda p, x: p._replace(
        cornering_slope=p.cornering_slope * [1.0 + x, 1.0 + x, 1.0, 1.0]))),
    _of("cornering_rear", "-", 0.2, _plant(lambda p, x: p._replace(
        cornering_slope=p.cornering_slope * [1.0, 1.0, 1.0 + x, 1.0 + x]))),
    _of("friction", "-", 0.5, _plant(lambda p, x: p._replace(mu=p.mu * (1.0 + x)))),
    _of("steer_offset", "rad", 5e-3, _channel("steer_angle", lambda c, x: replace(c, bias=c.bias + x))),
    _of("steer_gain", "-", 0.03, _channel("steer_angle", lambda c, x: replace(c, gain=c.gain * (1.0 + x)))),
    _of("gyro_offset", "rad/s", 2e-3, _channel("yaw_rate", lambda c, x: replace(c, bias=c.bias + x))),
    _of("gyro_gain", "-", 0.02, _channel("yaw_rate", lambda c, x: replace(c, gain=c.gain * (1.0 + x)))),
)  # fmt: skip

# the torque that the model needs on a flat road, in place of a missing one: load, wind and slopes are not in it
STAND_IN = _of("stand_in_torque", "-", 0.2, _plant(lambda p, x: p._replace(torque_gain=p.torque_gain * (1.0 + x))))

# The form of the water's laws; their sizes are effects and have tolerances of their own. A range given by a source
# counts as two standard deviations to either side.
WATER_TOLERANCES: tuple[Effect, ...] = (
    # 4 to 6 reproduce the slip slope measured 20 km/h below full aquaplaning (D)
    _of("contact_exponent", "-", 0.5, _plant(lambda p, x: p._replace(
        contact_exponent=np.maximum(p.contact_exponent + x, 1.0)))),
    # no vehicle file gives the tread: voids of 0.25 to 0.35 at 1.6 mm (K)
    _of("tread_capacity", "m", 5e-5, _plant(lambda p, x: p._replace(
        tread_capacity=np.maximum(p.tread_capacity + x, 0.0)))),
    # a fraction of the texture's depth, 0.6 to 1.6 times (K)
    _of("film_onset", "-", 0.25, _plant(lambda p, x: p._replace(h_onset=p.h_onset * np.exp(x)))),
    # full aquaplaning falls with depth as h^-0.06 (Gallaway) to h^-0.26 (PAVDRN, K)
    _of("bulk_depth", "m", 2.5e-4, _plant(lambda p, x: p._replace(h_bulk=np.maximum(p.h_bulk + x, 1e-4)))),
    # resistance hardly changes from 0.6 to 1.3 mm and is clearly higher at 2 mm (D, thesis Fig. 2.11)
    _of("film_thrown", "m", 5e-5, _plant(lambda p, x: p._replace(h_film=np.maximum(p.h_film + x, 0.0)))),
    _of("bow_wave", "m", 1.5e-4, _plant(lambda p, x: p._replace(h_wave=np.maximum(p.h_wave + x, 0.0)))),
    # what full grooves save, 0.5 to 0.9 (K)
    _of("groove_relief", "-", 0.1, _plant(lambda p, x: p._replace(
        groove_relief=np.clip(p.groove_relief + x, 0.0, 1.0)))),
    # the load's shift at full aquaplaning, 60 mm to within 7 (D)
    _of("wedge_peak", "-", 0.025, _plant(lambda p, x: p._replace(wedge_peak=np.clip(p.wedge_peak + x, 0.4, 1.0)))),
)  # fmt: skip
