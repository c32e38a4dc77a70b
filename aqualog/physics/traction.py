"""Traction coefficient from wheel torque, or from the acceleration that it gives."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.physics.resistance import air_drag, rolling_resistance_force

__all__ = ["DELTA_A_WATER", "residual_traction", "traction_coefficient", "traction_of_one_axle"]


DELTA_A_WATER = 0.2  # [m/s^2] thesis 2.2 (C44): less than that is no sign of water (snow, an offset, wind)


def traction_coefficient(
    torque: FloatArray, F_z: FloatArray, omega_dot: FloatArray, *, arm: float, inertia: float, r_w: float
) -> FloatArray:
    """Traction coefficient mu = F_x / F_z of one wheel.

    Parameters
    ----------
    torque : array (n,)
        Net wheel torque, drive minus brake. [N·m]
    F_z : array (n,)
        Wheel load. [N]
    omega_dot : array (n,)
        Angular acceleration. [rad/s²]
    arm, inertia, r_w : float
        Lever of torque over force, r_e (E24) [m], wheel inertia [kg·m²], rolling resistance coefficient [-].

    Returns
    -------
    mu : array (n,)
        Driving positive; NaN where the wheel carries less than 100 N. [-]

    F_x = (T - I omega_dot) / arm - r_w F_z: the thesis does not say that rolling resistance and inertia come off the
    torque of 3.14 (E13). A wheel that rolls freely at constant speed has mu = -r_w.

    Source: the torque balance behind Eq. (3.14) [fichtinger2024], as E13 completes it.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        mu = (torque - inertia * omega_dot) / (arm * F_z) - r_w
    return np.where(F_z > 100.0, mu, np.nan)


def residual_traction(mu: FloatArray, delta_a_x: FloatArray, F_z: FloatArray, *, mass: float) -> FloatArray:
    """Traction coefficient of a spinning wheel after the water's resistance has taken its share of the torque.

    Parameters
    ----------
    mu : array (n,)
        Traction coefficient from torque, as `traction_coefficient` gives it. [-]
    delta_a_x : array (n,)
        Resistance measure of the vehicle (thesis 2.9), low-passed. [m/s²]
    F_z : array (n,)
        Load of the wheel. [N]
    mass : float
        Vehicle mass. [kg]

    Returns
    -------
    mu : array (n,)
        mu - m max(delta_a_x - 0.2, 0) / F_z, NaN where the wheel carries less than 100 N. [-]

    A wheel that spins on water works against the shifted wheel load as well as the road: with a shift of 0.06 m that
    alone looks like a traction coefficient of 0.2, and the thesis' limit of 0.07 would reject full aquaplaning. What
    the torques should have done to the vehicle and did not, bounds what the road has taken: what exceeds the threshold
    of partial aquaplaning is booked on this wheel. On snow or ice less than that is missing (its rolling resistance, an
    accelerometer's offset), and the value is that of the torque. A lower bound: the front wheels' share is in it too.

    Source: derived; the limits 0.07 and 0.2 are those of [fichtinger2024] (C27, C44).
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        reduced = mu - mass * np.maximum(delta_a_x - DELTA_A_WATER, 0.0) / F_z
    return np.where(F_z > 100.0, reduced, np.nan)


def traction_of_one_axle(
    a_x: FloatArray,
    a_kin: FloatArray,
    v_x: FloatArray,
    F_z: FloatArray,
    F_z_free: FloatArray,
    *,
    mass: float,
    r_w: float,
    drag_area: float,
    air_density: float,
    free_wheel_mass: float,
) -> FloatArray:
    """Traction coefficients of the only driven axle's wheels, from the accelerometer.

    Parameters
    ----------
    a_x : array (n,)
        Specific force, forward: what an accelerometer shows. [m/s²]
    a_kin : array (n,)
        Kinematic acceleration, for the inertia of the free wheels. [m/s²]
    v_x : array (n,)
        Velocity. [m/s]
    F_z, F_z_free : array (2, n)
        Wheel loads of the driven and of the free axle. [N]
    mass, r_w, drag_area, air_density : float
        Vehicle. [kg, -, m^2, kg/m^3]
    free_wheel_mass : float
        I / r_e^2 of both free wheels together. [kg]

    Returns
    -------
    mu : array (2, n)
        Driving positive; the axle's force is halved to its wheels (an open differential). NaN where a wheel carries
        less than 100 N. [-]

    F_x = m a_x + drag + r_w F_z_free + I/r^2 a_kin: the contact force itself, so that it compares with
    `traction_coefficient`. A grade is in a_x as it is in the force (E2, E13). Holds while no brake acts. A constant
    error of the accelerometer shifts mu; an error of its scale scales it, and so does pitch: a body that tilts by
    1 deg at 1 g shows 1.7 % too much. The mass counts by the drag only, its distribution fully.

    Source: derived, a balance of forces.
    """
    resisting = air_drag(v_x, drag_area=drag_area, air_density=air_density)
    resisting = resisting + rolling_resistance_force(F_z_free, r_w=r_w).sum(axis=0) + free_wheel_mass * a_kin
    with np.errstate(invalid="ignore", divide="ignore"):
        mu: FloatArray = 0.5 * (mass * a_x + resisting) / F_z
    return np.where(F_z > 100.0, mu, np.nan)
