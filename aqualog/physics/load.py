"""Wheel loads."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray

__all__ = ["G", "centre_shift", "loads_of_wheels", "wheel_loads"]

G = 9.80665  # [m/s^2]


def loads_of_wheels(
    a_x: FloatArray, a_y: FloatArray, *, mass: float, l_f: float, l_r: float, h_cg: float, track: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Quasi-static loads of fl, fr, rl, rr; see `wheel_loads`, which stacks them.

    Source: as `wheel_loads`.
    """
    l = l_f + l_r  # noqa: E741 - the field's symbol of the wheelbase
    axle_f = mass * (G * l_r - a_x * h_cg) / l
    axle_r = mass * (G * l_f + a_x * h_cg) / l
    lateral = mass * a_y * h_cg / track
    lateral_f = lateral * (l_r / l)
    lateral_r = lateral * (1.0 - l_r / l)
    fl = np.maximum(0.5 * axle_f - lateral_f, 0.0)
    fr = np.maximum(0.5 * axle_f + lateral_f, 0.0)
    rl = np.maximum(0.5 * axle_r - lateral_r, 0.0)
    rr = np.maximum(0.5 * axle_r + lateral_r, 0.0)
    # where a wheel lifts, the others carry the weight, not more; otherwise the factor is 1 to the last bit
    scale = np.minimum(mass * G * (1.0 + 1e-12) / np.maximum(fl + fr + rl + rr, 1e-9), 1.0)
    return fl * scale, fr * scale, rl * scale, rr * scale


def wheel_loads(
    a_x: FloatArray, a_y: FloatArray, *, mass: float, l_f: float, l_r: float, h_cg: float, track: float
) -> FloatArray:
    """Quasi-static wheel loads with longitudinal and lateral transfer.

    Parameters
    ----------
    a_x, a_y : array (n,)
        Specific force, forward and left (what an accelerometer shows: a grade shifts load as acceleration does).
        [m/s²]
    mass, l_f, l_r, h_cg, track : float
        Vehicle. [kg, m]

    Returns
    -------
    F_z : array (4, n)
        fl, fr, rl, rr; never negative. [N]

    Limits: a = 0 splits m g by l_r : l_f and left = right; the sum is m g, also where a wheel lifts. A left turn
    (a_y > 0) loads the right wheels. The lateral transfer is split by the static axle loads. Small grades: cos = 1.

    Source: derived, a quasi-static balance; for two axles it is that of Eq. (3.31) to (3.33) [fichtinger2024], without
    the loop of E15.
    """
    loads: FloatArray = np.array(loads_of_wheels(a_x, a_y, mass=mass, l_f=l_f, l_r=l_r, h_cg=h_cg, track=track))
    return loads


def centre_shift(mass: float, l_f: float, delta_mass: float, x: float) -> float:
    """Return how far the centre of mass moves rearwards when a mass is added. [m]

    Parameters
    ----------
    mass, l_f : float
        Of the car before: mass [kg] and distance of its centre from the front axle [m].
    delta_mass, x : float
        The added mass [kg], and its place, from the front axle rearwards [m].

    Source: derived.
    """
    return delta_mass * (x - l_f) / (mass + delta_mass)
