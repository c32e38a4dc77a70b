"""The driveline between a motor and the wheels of an axle."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray

__all__ = ["differential_friction"]

TURNS = 0.5  # [rad/s] of difference, from which on the gears of a differential slide


def differential_friction(
    ahead: FloatArray, torque: FloatArray, *, preload: float, locking: float
) -> FloatArray:  # fmt: skip
    """Torque by which a differential brakes the faster wheel of an axle, and drives the slower one. [N·m]

    Parameters
    ----------
    ahead : array (n,)
        Speed of this wheel less that of the other one. [rad/s]
    torque : array (n,)
        Half of the axle's torque. [N·m]
    preload, locking : float
        Torque without load, and per torque. [N·m], [-]

    Returns
    -------
    friction : array (n,)
        (preload + locking |torque|) tanh(ahead / 0.5 rad/s): positive at the faster wheel, from which it is taken; the
        other wheel has the same of the other sign. An open differential has 0 to 30 N·m and 0.03 to 0.12, which is a
        locking value of 3 to 12 % (K).

    Source: Coulomb friction of gears that turn, smooth about no difference.
    """
    friction: FloatArray = (preload + locking * np.abs(torque)) * np.tanh(ahead / TURNS)
    return friction
