"""Unknown forms: the response of a mechanism to a constant deviation, times a smooth function of one or two coordinates
of the drive. Responses follow within 0.1 s, so a modulation needs no further simulation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray
from aqualog.diagnose.spline import Basis, basis
from aqualog.diagnose.words import PLACES
from aqualog.model.effects import EFFECTS

__all__ = ["ALONG", "MECHANISMS", "Mechanism", "Shape", "shapes"]


@dataclass(frozen=True, slots=True)
class Mechanism:
    """`source`: effect and place whose signature is the response, in `unit`; `usual` size of a deviation, and the one
    by which a car and its simulation differ anyway; `family`: whether there is a form is asked of all of these; `over`:
    coordinates of its functions, alone or in pairs; `scales`: the signal that it multiplies, on which what it does
    depends as well."""

    name: str
    title: str
    source: str
    unit: str
    usual: float
    allowed: float
    over: tuple[tuple[str, ...], ...]
    is_road: bool = False  # every road has it: no unknown form
    is_fast: bool = False  # it multiplies a fast signal: over time and place a smooth function is more than slow noise
    scales: str = ""
    family: str = ""

    @property
    def is_whole(self) -> bool:
        """Whether it is of all axles at once, beside mechanisms of one axle each."""
        return self.name == f"{self.family}_all"

    def change(self, size: FloatArray) -> FloatArray:
        """Change of the effect's value that acts as this size of the response does; NaN where no value does. They are
        the same, but for what acts as one over its value, whose response is that to a step from the file's value."""
        effect = EFFECTS.get(self.source.partition("@")[0])
        if effect is None or not effect.drive.divides:
            return size
        first = effect.parameters[0]
        left = 1.0 - size / (1.0 + first.step / first.neutral)
        return 1.0 / np.where(left > 0.0, left, np.nan) - 1.0


ALONG = ("t", "position")
_STATE = (
    "v_x", "torque", "a_x", "a_y", "yaw_rate", "steer_angle", "since_braking", "water_depth", "ambient_temperature",
)  # fmt: skip


def _over(*more: str | tuple[str, str], without: str = "") -> tuple[tuple[str, ...], ...]:
    """Each coordinate of the driving state alone, without some, and others. No mechanism has both torque and
    acceleration: their difference is the residual of the balance, with its noise."""
    state = tuple((n,) for n in _STATE if n not in without.split())
    return (*state, *((n,) if isinstance(n, str) else n for n in more))


_SLIP = _over("t", without="steer_angle ambient_temperature a_x")
_RADIUS = _over("t", without="steer_angle yaw_rate a_x water_depth")
MECHANISMS: tuple[Mechanism, ...] = (
    Mechanism(
        "force", "a force on the car", "unit_force", "N", 150.0, 7.5,
        _over("position", "t", ("v_x", "torque"), ("v_x", "water_depth"), without="a_x"),
    ),
    Mechanism(
        "accelerometer", "an offset of the accelerometer", "accelerometer_bias@a_x", "m/s^2", 0.15, 0.005,
        _over("t", without="torque steer_angle yaw_rate water_depth"),
    ),
    Mechanism(
        "accelerometer_gain", "the gain of the accelerometer", "accelerometer_gain@a_x", "-", 0.05, 0.005,
        _over("t", without="torque steer_angle yaw_rate water_depth since_braking"), is_fast=True, scales="a_x",
    ),
    Mechanism(
        "torque", "the torque at the wheels", "torque_gain", "-", 0.08, 0.01,
        _over("t", without="a_x steer_angle yaw_rate water_depth"), is_fast=True,
    ),
    Mechanism("slip_f", "the slip slope of the front axle", "slip_stiffness@f", "-", 0.3, 0.035, _SLIP, is_fast=True,
              family="slip"),
    Mechanism("slip_r", "the slip slope of the rear axle", "slip_stiffness@r", "-", 0.3, 0.035, _SLIP, is_fast=True,
              family="slip"),
    Mechanism(
        "slip_all", "the slip slope of all driven wheels", "slip_stiffness", "-", 0.3, 0.035,
        _over(without="steer_angle ambient_temperature a_x water_depth"), family="slip",
    ),
    Mechanism("radius_f", "the radius of the front wheels", "tyre_radius@f", "-", 0.005, 0.00035, _RADIUS),
    Mechanism("radius_r", "the radius of the rear wheels", "tyre_radius@r", "-", 0.005, 0.00035, _RADIUS),
    *(
        Mechanism(f"radius_{w}", f"the radius of the {PLACES[w]}", f"tyre_radius@{w}", "-", 0.01, 0.0005,
                  (("v_x",), ("t",)), family="radius")
        for w in WHEELS
    ),
    Mechanism(
        "velocity", "the scale of the reference velocity", "velocity_scale@v_x", "-", 0.01, 0.0005,
        _over("position", "t", without="torque steer_angle yaw_rate since_braking water_depth"),
    ),
    Mechanism(
        "lateral", "the lateral acceleration", "accelerometer_bias@a_y", "m/s^2", 0.3, 0.05,
        _over(without="a_x yaw_rate steer_angle water_depth since_braking"),
    ),
    Mechanism(
        "bank", "the bank of the road", "accelerometer_bias@a_y", "m/s^2", 0.2, 0.0, (("position",), ("t",)),
        is_road=True,
    ),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Shape:
    """A mechanism over coordinates: `basis` (n, K) with the covariance of its coefficients at a usual size of one;
    `manner`: in words, where it is no smooth function."""

    mechanism: Mechanism
    coordinates: tuple[str, ...]
    basis: Basis
    manner: str = ""

    @property
    def key(self) -> str:
        """`force(v_x)`."""
        return f"{self.mechanism.name}({', '.join(self.coordinates)})"


def shapes(coordinates: Mapping[str, FloatArray], mask: BoolArray, dt: float, has: Sequence[str]) -> tuple[Shape, ...]:
    """All shapes that a drive can show; `has`: the sources for which there are responses."""
    made: dict[tuple[str, ...], Basis | None] = {}
    out = []
    for m in MECHANISMS:
        if m.source not in has:
            continue
        for names in m.over:
            # else a smooth function over time and place is no other than slow noise: see `elements`
            may_drift = m.is_road or m.is_fast
            if not all(n in coordinates for n in names) or (not may_drift and set(names) & set(ALONG)):
                continue
            if names not in made:
                made[names] = basis(names, [coordinates[n] for n in names], mask, dt)
            found = made[names]
            if found is not None:
                out.append(Shape(m, names, found))
    return tuple(out)
