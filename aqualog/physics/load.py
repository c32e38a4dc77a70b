"""Wheel loads."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aqualog.core.records import FloatArray

__all__ = ["HOP", "G", "Hop", "centre_shift", "hop", "loads_of_wheels", "unevenness_rms", "wheel_loads"]

G = 9.80665  # [m/s^2]
_N_0 = 0.1  # [1/m] spatial frequency at which [iso8608_2016] states unevenness


class Hop(NamedTuple):
    """A wheel with its hub between road and body: it hops at 11 Hz with a quarter of critical damping (K).

    Mass [kg], vertical stiffness of the tyre [N/m], damper to the body [N·s/m].
    """

    mass: float = 40.0
    stiffness: float = 2.0e5
    damping: float = 1500.0


HOP = Hop()


def unevenness_rms(unevenness: FloatArray, *, length: float) -> FloatArray:
    """Rms of a height whose waves much shorter than 2 pi `length` [m] are a road's by ISO 8608 [iso8608_2016]. [m]

    `unevenness` is G_d(n_0) at n_0 = 0.1 1/m: 16e-6 a very good road (class A), 256e-6 an average one (class C). [m³]
    Limits: the one-sided density of an exponential correlation, 4 rms² length / (1 + (2 pi n length)²), falls as
    G_d (n_0 / n)² where n is large.

    Source: classes and the square law from memory (K); the relation derived.
    """
    rms: FloatArray = np.pi * _N_0 * np.sqrt(unevenness * length)
    return rms


def hop(
    lift: FloatArray, rate: FloatArray, height: FloatArray, *, mass: float, stiffness: float, damping: float
) -> tuple[FloatArray, FloatArray]:
    """Load that a hopping wheel adds to the static one [N], and the wheel's acceleration upward. [m/s²]

    `lift` and `rate`: height of the wheel above its place on an even road, and its rate; `height` of the road under it,
    all upward positive. [m], [m/s] The others are those of `Hop`. The body stays where it is: it follows slow waves
    only, which `unevenness_rms` leaves out.

    Limits: a wheel that follows the road adds no load. On a road of `unevenness` G_d the damper takes
    pi² n_0² G_d stiffness from the motion, as a force on each wheel, at any speed, mass and damping.

    Source: [zuo2011] for that power (formula K, its dependences read in the abstract); derived.
    """
    load = stiffness * (height - lift)
    return load, (load - damping * rate) / mass


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
