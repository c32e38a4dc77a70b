"""Rolling: radii, resistance and what changes them."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray

__all__ = [
    "carcass_torque", "effective_radius", "load_factor", "pressed_radius", "pressure_factor", "rolling_rise",
    "warm_up_factor",
]  # fmt: skip


def effective_radius(r_e: FloatArray, v: FloatArray, *, growth: float) -> FloatArray:
    """Effective rolling radius at speed, r_e (1 + growth v^2).

    Parameters
    ----------
    r_e : array
        At low speed. [m]
    v : array
        Speed. [m/s]
    growth : float
        Relative growth by centrifugal force; MF6.1 of a passenger tyre grows by 0.24 % from 60 to 120 km/h, which is
        2.9e-6. [s^2/m^2]

    Returns
    -------
    r_e : array
        [m]

    Source: MF6.1 [besselink2010] for the size; the square is centrifugal force, derived.
    """
    return r_e * (1.0 + growth * v * v)


def pressed_radius(F_z: FloatArray, *, F_z_ref: float, loss: float) -> FloatArray:
    """Effective rolling radius over that at the reference load, 1 - loss (F_z / F_z_ref - 1). [-]

    The belt keeps its length, so that little of a deflection reaches the rolling radius. The law [pacejka2012] with B
    8.4, D 0.27, F 0.07 and a deflection of 20 mm loses 0.0066 around its nominal load. Loss 0 gives 1 to the last bit.

    Source: the law of [pacejka2012], its tangent.
    """
    return 1.0 - loss * (F_z / F_z_ref - 1.0)


def warm_up_factor(t: FloatArray, *, extra: float, time_constant: float) -> FloatArray:
    """Rolling resistance of a cold tyre over that of a warm one, 1 + extra exp(-t / time_constant). [-]

    `extra` up to 0.4 in the cold (K); 10 degC cost 8 % (R117); half an hour warms a tyre through. [-], [s]

    Source: UN Regulation 117 [unece_r117_2011] for 8 % per 10 K; the shape is general knowledge (K).
    """
    return 1.0 + extra * np.exp(-t / time_constant)


def carcass_torque(twist: FloatArray, rate: FloatArray, *, stiffness: float, damping: float) -> FloatArray:
    """Torque that the rim hands to the belt through the side walls, forward positive. [N·m]

    `twist` and `rate`: angle of the rim ahead of the belt, and its rate [rad], [rad/s]; stiffness [N·m/rad] and damping
    [N·m·s/rad] of the side walls.

    Limits: a rim on a belt that the road holds swings at sqrt(stiffness / inertia of the rim); free of the road, faster
    by sqrt(1 + rim / belt). Slow changes of torque see a relaxation length of C_x r_e² / stiffness.

    Source: the rigid ring of [pacejka2012] (K), in rotation alone.
    """
    return stiffness * twist + damping * rate


def load_factor(F_z: FloatArray, *, F_z_ref: float, sensitivity: float) -> FloatArray:
    """Slip slope C_s / F_z over that at the reference load, 1 + sensitivity (F_z / F_z_ref - 1), at least 0.1.

    A published MF6.1 set, (21.687 + 13.728 df) exp(-0.4098 df), has 0.22: 19.9, 21.2, 22.1, 22.8 at -30, -10, +10,
    +30 % load; the straight line is its tangent, 1.9 % off at -30 %. Sensitivity 0 gives 1 to the last bit. [-]

    Source: the law of [besselink2010] with the coefficients of a published set.
    """
    return np.maximum(1.0 + sensitivity * (F_z / F_z_ref - 1.0), 0.1)


def pressure_factor(p: FloatArray, *, p_ref: float, p_nominal: float) -> FloatArray:
    """Slip slope at a pressure over that at `p_ref`: MF6.1's 1 - 0.3485 dp + 0.378 dp^2, dp = p / p_nominal - 1.

    Parameters
    ----------
    p, p_ref, p_nominal : array or float
        Inflation pressure, that at which the slope is known, and that of the coefficients. [Pa]

    Returns
    -------
    factor : array
        1 at p_ref; +11 % at 25 % below nominal, -7 % at 30 % above. Supports C53: less slope at high pressure. [-]

    Source: the law of [besselink2010] with the coefficients of a published set.
    """
    dp = p / p_nominal - 1.0
    dp_ref = p_ref / p_nominal - 1.0
    return (1.0 - 0.3485 * dp + 0.378 * dp * dp) / (1.0 - 0.3485 * dp_ref + 0.378 * dp_ref * dp_ref)


def rolling_rise(v: FloatArray) -> FloatArray:
    """Rolling resistance less that at rest: MF6.1's 0.001515 u + 8.5e-5 u^4, u = v / 16.67 m/s, on 0.00702. [-]

    0.0016 at 60 and 0.0044 at 120 km/h. v (n,) [m/s].

    Source: the law of [besselink2010] with the coefficients of a published set.
    """
    u: FloatArray = v / 16.67
    rise: FloatArray = 0.001515 * u + 8.5e-5 * u**4
    return rise
