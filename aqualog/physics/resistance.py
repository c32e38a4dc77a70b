"""Driving resistance and the acceleration that it leaves."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.physics.load import G

__all__ = ["air_drag", "cornering_drag", "grade_force", "nominal_acceleration", "rolling_resistance_force"]


def air_drag(v: FloatArray, *, drag_area: float, air_density: float) -> FloatArray:
    """Air drag, c_x v^2 with c_x = 1/2 c_w A rho.

    Parameters
    ----------
    v : array (n,)
        Speed through the air: the vehicle's plus a head wind's. [m/s]
    drag_area : float
        c_w A. [m^2]
    air_density : float
        [kg/m^3]

    Returns
    -------
    F : array (n,)
        Against the motion, positive; negative where a tail wind is faster than the car. [N]

    Source: Eq. (2.10) [fichtinger2024].
    """
    return 0.5 * drag_area * air_density * v * np.abs(v)


def rolling_resistance_force(F_z: FloatArray, *, r_w: float) -> FloatArray:
    """Rolling resistance r_w F_z. [N] Load [N], coefficient [-]; against the motion, positive.

    Source: Eq. (2.10) [fichtinger2024].
    """
    return r_w * F_z


def grade_force(theta: FloatArray, *, mass: float) -> FloatArray:
    """Downhill force of a grade, m g sin(theta). [N]

    Uphill positive, against the motion; theta in rad, a grade of 5 % is 0.05. An accelerometer does not feel it (E2).

    Source: derived.
    """
    return mass * G * np.sin(theta)


def cornering_drag(a_y: FloatArray, *, mass: float, coefficient: float) -> FloatArray:
    """Extra resistance of cornering beyond what the two-track model has, coefficient m a_y^2. [N]

    `coefficient` [s^2/m]; scrub and toe make it; against the motion.

    Source: general knowledge (K).
    """
    return coefficient * mass * a_y * a_y


def nominal_acceleration(
    torque: FloatArray, F_z: FloatArray, v_x: FloatArray, omega_dot: FloatArray, *, arm: FloatArray,
    inertia: FloatArray, mass: float, r_w: float, drag_area: float, air_density: float,
) -> FloatArray:  # fmt: skip
    """Acceleration that the wheel torques give a car on dry road, as an accelerometer shows it.

    Parameters
    ----------
    torque : array (4, n)
        Net wheel torques, drive minus brake. [N·m]
    F_z : array (4, n)
        Wheel loads. [N]
    v_x : array (n,)
        Velocity, negative in reverse. [m/s]
    omega_dot : array (4, n)
        Angular accelerations of the wheels; zeros give the equation as printed. [rad/s²]
    arm, inertia : array (4,)
        Levers of torque over force [m], wheel inertias [kg·m²].
    mass, r_w, drag_area, air_density : float
        Vehicle. [kg, -, m^2, kg/m^3]

    Returns
    -------
    a_nom : array (n,)
        Forward positive. A grade is absent on purpose: it is absent from the accelerometer's specific force too, so
        that it cancels in the difference (E2). [m/s²]

    Thesis [fichtinger2024]: Eq. (2.10), with the part of the torque that spins the wheels taken off (E5): without it a
    wheel that spins up by 100 rad/s² looks like 0.23 m/s² of resistance.

    The printed lever is r_l. r_e agrees with rolling resistance and power: a tyre without slip loss has
    T = F_x r_e + r_w F_z r_e. 2.8 % between both are 0.077 m/s² at 2.35 m/s² (E24).
    """
    traction = (torque - inertia[:, None] * omega_dot) / arm[:, None]
    rolling = np.where(v_x < 0.0, -1.0, 1.0) * rolling_resistance_force(F_z, r_w=r_w)  # against the motion
    drag = air_drag(v_x, drag_area=drag_area, air_density=air_density)
    a_nom: FloatArray = ((traction - rolling).sum(axis=0) - drag) / mass
    return a_nom
