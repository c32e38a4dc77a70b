"""Lateral force of the front axle from what a car measures, and its share per wheel."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray

__all__ = ["front_axle_lateral_force", "outward", "split_by_load", "yaw_inertia"]


def yaw_inertia(*, mass: float, l_f: float, l_r: float) -> float:
    """Yaw inertia of a car whose radius of gyration is the geometric mean of its axle distances, m l_f l_r. [kg·m²]

    Mass [kg], axle distances from the centre of mass [m]. Passenger cars lie within about 10 % of it (K). With it a
    force at the front axle leaves the rear one alone.

    Source: general knowledge (K).
    """
    return mass * l_f * l_r


def front_axle_lateral_force(
    a_y: FloatArray, yaw_acceleration: FloatArray, *, mass: float, l_f: float, l_r: float, inertia: float
) -> FloatArray:
    """Lateral force of the front axle that balances the car, m a_y l_r / l + I_zz psi_ddot / l.

    Parameters
    ----------
    a_y : array (n,)
        Specific force of the centre of mass, left positive; a road's bank is in it as it is in the force. [m/s²]
    yaw_acceleration : array (n,)
        psi_ddot, left positive. [rad/s²]
    mass, l_f, l_r : float
        Vehicle. [kg, m]
    inertia : float
        I_zz, see `yaw_inertia`. [kg·m²]

    Returns
    -------
    F_y : array (n,)
        Of both wheels together, in the vehicle's frame, left positive; NaN where an input is NaN. [N]

    From m a_y = F_y,f + F_y,r and I_zz psi_ddot = l_f F_y,f - l_r F_y,r. The balance ignores the road: on water
    it gives the force that the axle had, not the force that its tyres could have. Left out: moments of unequal
    longitudinal forces left and right (1 kN of difference over 1.5 m of track is 0.3 kN), F_x sin(delta) of steered
    driven wheels, aligning moments (below 2 %). Limits: steady cornering gives the static share l_r / l of m a_y.

    Thesis [fichtinger2024]: section 2.4 takes lateral forces from a two-wheel model (no number). Departure: that model
    would need steering and side-slip angles and cornering stiffness; the balance of forces needs no stiffness. A loss
    of lateral force then shows in the acceleration, not in the residual.
    """
    wheelbase = l_f + l_r
    return (mass * l_r * a_y + inertia * yaw_acceleration) / wheelbase


def split_by_load(F_axle: FloatArray, F_z_left: FloatArray, F_z_right: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Share of the left and the right wheel in an axle's lateral force, in proportion to the wheel loads.

    Parameters
    ----------
    F_axle : array (n,)
        Left positive. [N]
    F_z_left, F_z_right : array (n,)
        Quasi-static wheel loads, >= 0. [N]

    Returns
    -------
    F_left, F_right : array (n,)
        Left positive; their sum is the axle's force; halves where the axle carries nothing. [N]

    Equal side-slip angles and a cornering stiffness proportional to the load: exact for the simulator's tyre without
    load sensitivity; a real tyre stiffens less than its load grows, so the outer wheel gets some per cent too much.

    Source: section 2.4 of [fichtinger2024] (C59).
    """
    total = F_z_left + F_z_right
    share = np.where(total > 0.0, F_z_left / np.where(total > 0.0, total, 1.0), 0.5)
    F_left = share * F_axle
    return F_left, F_axle - F_left


def outward(F_left: FloatArray, F_right: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Lateral forces of a pair of wheels away from the centre line: what `physics.steering` takes. [N]

    A left wheel's is its force to the left, a right wheel's that to the right; in a left turn the left wheel's is
    positive (inwards of the curve is outwards of the car there), the right one's negative.

    Source: derived; axes of ISO 8855 [iso8855_2011].
    """
    return F_left, -F_right
