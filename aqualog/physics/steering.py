"""Steering: from tyre forces to tie rods and the steering wheel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.physics.tyre_brush import brush_parts, sliding_edge

__all__ = [
    "STEERING", "SteeringGeometry", "aligning_moment", "held_angle", "kingpin_moment", "steering_torque",
    "tie_rod_force",
]  # fmt: skip


class SteeringGeometry(NamedTuple):
    """Front suspension of a passenger car, the rods behind the axle. [m, rad]

    General knowledge (K) throughout: arm 0.11-0.15 m, caster trail 15-35 mm, hub offset 30-75 mm, inclination 10-15
    deg, caster angle 4-8 deg, rack 45-60 mm per turn of the pinion.
    """

    arm: float = 0.13  # from the kingpin to the rod
    caster_trail: float = 0.020  # kingpin's ground point ahead of the contact's centre
    hub_offset: float = 0.060  # wheel centre outboard of the kingpin, at its height
    inclination: float = 0.218  # kingpin leans inward
    caster: float = 0.10  # kingpin leans back
    ratio: float = 8.0e-3  # pinion's pitch radius: torque at the steering over the rack's force
    stiffness: float = 1.8e6  # [N/m] of the column at the rack: 2 N·m per degree of the pinion


STEERING = SteeringGeometry()


def aligning_moment(
    s_x: FloatArray,
    s_y: FloatArray,
    F_z: FloatArray,
    *,
    mu: float,
    C_x: float,
    C_y: float,
    L: FloatArray | float,
    a: FloatArray,
) -> FloatArray:
    """Moment of the lateral force of a brush tyre about the vertical through the centre of its patch.

    Parameters
    ----------
    s_x, s_y, F_z, mu, C_x, C_y, L
        As in `brush_forces`.
    a : array
        Half length of the patch. [m]

    Returns
    -------
    M_z : array
        Turning left positive: a force to the left behind the centre turns the wheel to the right. [N·m]

    The sticking bristles' forces grow linearly from the front edge b of the dry contact to where they begin to slide:
    they act at two thirds of that stretch. The sliding ones follow the rest of the parabola. Limits: small slip gives
    -a (1 - 2 L / 3) F_y, which is -a/3 F_y on a full contact; full sliding gives -3 a (1 - L)^2 / (3 - 2 L) F_y, which
    is 0 on a full contact. A shortened contact acts further back, until its force vanishes with L.

    Source: chapter 3 of Pacejka [pacejka2012] (K) for L = 1; derived for L < 1.
    """
    g_x = C_x * s_x
    g_y = C_y * s_y
    g = np.sqrt(g_x * g_x + g_y * g_y)
    s = np.sqrt(s_x * s_x + s_y * s_y)
    limit = np.maximum(mu * F_z, 1e-9)
    theta = g / (3.0 * limit)
    stuck, _ = brush_parts(theta, L)
    b = 2.0 * L - 1.0
    xi = sliding_edge(theta, L)
    at_stuck = b - 2.0 / 3.0 * (b - xi)
    # 3/4 of the integral of x (1 - x^2) from -1 to xi, the sliding bristles' share of the parabola
    moment_slid = -0.1875 * (1.0 - xi * xi) ** 2
    stuck_y = limit * stuck * g_y / np.maximum(g, 1e-12)
    M_z: FloatArray = a * (stuck_y * at_stuck + limit * moment_slid * s_y / np.maximum(s, 1e-15))
    return M_z


def kingpin_moment(
    F_x: FloatArray,
    F_y_outward: FloatArray,
    F_z: FloatArray,
    M_z_outward: FloatArray,
    braking: FloatArray,
    *,
    r_l: float,
    geometry: SteeringGeometry = STEERING,
) -> FloatArray:
    """Moment of all forces on a front wheel about its kingpin.

    Parameters
    ----------
    F_x : array
        Longitudinal force that the wheel hands to its carrier: of the tyre less that of the water on the wheel's
        centre, forward positive. [N]
    F_y_outward, M_z_outward : array
        Lateral force away from the centre line, and `aligning_moment` that turns the wheel's front there (left wheel:
        M_z, right wheel: -M_z). [N], [N·m]
    F_z : array
        Wheel load. [N]
    braking : array
        Brake torque, which the carrier takes up, >= 0. [N·m]
    r_l : float
        Loaded radius. [m]

    Returns
    -------
    M : array
        Turning the wheel's front outward positive. [N·m]

    A rolling or driven wheel turns on bearings: its longitudinal force acts at the wheel centre, with the hub offset as
    its lever, and backward forces turn it outward. Under braking the lever is the scrub radius,
    hub_offset - r_l sin(inclination). The load acts about both leans of the kingpin: scrub radius times sin(caster) and
    caster trail times sin(inclination). A load that the wedge carries ahead of the centre is a moment about the wheel's
    axis. The bearings do not pass it on: it slows the wheel down and comes back as longitudinal force. Small angles; no
    steer angle, no inertia of the wheel about the kingpin, no friction, no toe.

    Thesis [fichtinger2024]: section 2.4 measures what comes of it (C61-C63); geometry K.
    """
    sine = np.sin(geometry.inclination)
    scrub = geometry.hub_offset - r_l * sine
    moment: FloatArray = (
        M_z_outward
        - geometry.caster_trail * F_y_outward
        - geometry.hub_offset * F_x
        - sine * braking
        - (scrub * np.sin(geometry.caster) + geometry.caster_trail * sine) * F_z
    )
    return moment


def steering_torque(rod_left: FloatArray, rod_right: FloatArray, *, ratio: float = STEERING.ratio) -> FloatArray:
    """Torque at the steering, assistance and driver together, that holds the rack against its rods.

    Tie-rod forces in N, compression positive, rods behind the axle; `ratio` in m. Left positive: in a left turn the
    outer, right rod is pressed and the left one pulled, and the steering is held to the left. What both front wheels
    show alike cancels. [N·m]

    Source: derived.
    """
    return ratio * (rod_right - rod_left)


def held_angle(rack: FloatArray, free: FloatArray, *, friction: float, per_force: float) -> FloatArray:
    """Angle by which dry friction holds the front wheels away from where they would turn without it. [rad]

    Parameters
    ----------
    rack, free : array
        Road-wheel angles, left positive: at which the rack stood a moment ago, and without friction, from the steering
        wheel and what the rods' force bends the column. [rad]
    friction, per_force : float
        Dry friction of the rack, 100 to 200 N on a car (K); angle over the rack's force. >= 0 [N], [rad/N]

    Limits: at friction times `per_force` the rack slides, below it stands. The friction's force on it is the angle over
    `per_force`. Without friction 0. Around any closed course of `free` it takes energy or, where the rack stands, none.

    Source: an elastic column in series with Coulomb friction, derived; [knapczyk2004] fits such a model to a rig.
    """
    most = friction * per_force
    held: FloatArray = np.minimum(np.maximum(rack - free, -most), most)
    return held


def tie_rod_force(
    F_x: FloatArray, F_y_outward: FloatArray, *, c0: Sequence[float], c_y: Sequence[float], c_x: Sequence[float]
) -> FloatArray:
    """Tie-rod force of one front wheel by a polynomial transfer function.

    Parameters
    ----------
    F_x : array
        Longitudinal force on the wheel, forward positive. [N]
    F_y_outward : array
        Lateral force on the wheel away from the vehicle's centre line (left wheel: F_y, right wheel: -F_y): one rod is
        pressed where the other is pulled, so both sides share the coefficients and a mirrored drive swaps them. [N]
    c0, c_y, c_x : sequence of float
        c0[0]; then powers from the first on: c_y[0] F_y + c_y[1] F_y^2 + ... [N, -, 1/N, ...]

    Returns
    -------
    F : array
        Compression positive. [N]

    Thesis [fichtinger2024]: section 2.4 (no number): a polynomial from a multi-body simulation of the front axle.
    """
    force = np.zeros_like(np.asarray(F_x, dtype=np.float64)) + sum(c0)
    for power, c in enumerate(c_y, 1):
        force = force + c * F_y_outward**power
    for power, c in enumerate(c_x, 1):
        force = force + c * F_x**power
    return force
