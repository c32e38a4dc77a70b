"""Plane kinematics of the wheels."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray

__all__ = ["centre_line_speed", "kinematic_steer_angle", "wheel_velocity"]


def kinematic_steer_angle(yaw_rate: FloatArray, v_x: FloatArray, *, wheelbase: float) -> FloatArray:
    """Road-wheel angle of a car that rolls around a curve without slip angles.

    Parameters
    ----------
    yaw_rate : array (n,)
        Left positive. [rad/s]
    v_x : array (n,)
        Longitudinal velocity. [m/s] Below 3 m/s that value is taken.
    wheelbase : float
        [m]

    Returns
    -------
    delta : array (n,)
        atan(l psi_dot / v_x), left positive, within ±0.7. [rad]

    Source: derived; axes of ISO 8855 [iso8855_2011].
    """
    return np.clip(np.arctan2(wheelbase * yaw_rate, np.maximum(v_x, 3.0)), -0.7, 0.7)


def centre_line_speed(
    v_rim: FloatArray, yaw_rate: FloatArray, steer_angle: FloatArray, *, y: FloatArray | float, wheelbase: float
) -> FloatArray:
    """Speed that the vehicle's centre line has if a wheel at its side rolls without slip.

    A wheel on the outside of a curve runs faster, and a steered front wheel runs along its own plane:
    v_rim = (v_x - psi_dot y) cos(delta) + psi_dot l sin(delta), solved for v_x.

    Parameters
    ----------
    v_rim : array (n,)
        omega r_e. [m/s]
    yaw_rate : array (n,)
        Left positive. [rad/s]
    steer_angle : array (n,)
        Road-wheel angle of this wheel, left positive; 0 for an unsteered rear wheel. [rad]
    y : array or float
        Lateral position of the wheel, left positive; (k, 1) of k wheels with `v_rim` (k, n). [m]
    wheelbase : float
        Distance of the axles; the rear axle is taken to move straight ahead in the vehicle's frame, which costs
        less than 0.5 % of speed at 1 g. [m]

    Returns
    -------
    v : array (n,)
        [m/s]

    Limits: yaw_rate = 0 and steer_angle = 0 give v_rim.

    Source: derived; axes of ISO 8855 [iso8855_2011].
    """
    return (v_rim - yaw_rate * wheelbase * np.sin(steer_angle)) / np.cos(steer_angle) + yaw_rate * y


def wheel_velocity(
    v_x: FloatArray, v_y: FloatArray, yaw_rate: FloatArray, steer_angle: FloatArray, *, x: float, y: float
) -> tuple[FloatArray, FloatArray]:
    """Velocity of a wheel's centre in the wheel's own plane.

    Parameters
    ----------
    v_x, v_y : array (n,)
        Velocity of the centre of mass, forward and left. [m/s]
    yaw_rate : array (n,)
        Left positive. [rad/s]
    steer_angle : array (n,)
        Of this wheel, left positive. [rad]
    x, y : float
        Position of the wheel from the centre of mass, forward and left. [m]

    Returns
    -------
    v_along, v_across : array (n,)
        Along the wheel's plane and to its left. [m/s]

    Limits: no yaw, no steering: v_x, v_y. The inverse of `centre_line_speed` for a car that rolls without side slip.

    Source: derived; axes of ISO 8855 [iso8855_2011].
    """
    forward = v_x - yaw_rate * y
    left = v_y + yaw_rate * x
    c = np.cos(steer_angle)
    s = np.sin(steer_angle)
    return forward * c + left * s, left * c - forward * s
