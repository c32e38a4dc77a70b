"""Differential slip and traction: the slip slope without the vehicle's speed (section 3.2 of [fichtinger2024]).

`i` is the axle (or wheel) that an equation is formulated at, `j` the opposite one; both on one side of the car, or the
means of both axles.
"""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.physics.slip import V_MIN

__all__ = [
    "beta_of_ratio", "differential_slip", "differential_traction", "jacobian", "predicted_differential_slip",
    "slope_ratio", "speed_ratio",
]  # fmt: skip


def differential_slip(v_i: FloatArray, v_j: FloatArray) -> FloatArray:
    """Differential slip at axle i, (r_i omega_i - r_j omega_j) / (r_i omega_i).

    Parameters
    ----------
    v_i, v_j : array (n,)
        Speeds at the rolling circumference, r_e omega, moved to the same path. [m/s]

    Returns
    -------
    s_delta : array (n,)
        Positive where axle i runs faster; NaN where it runs slower than 1 m/s. [-]

    Equal to s_i - rho s_j with the slips of (3.13), whatever the vehicle's speed; with j rolling freely it is the slip
    of i.

    Thesis [fichtinger2024]: Eq. (3.15), (3.16).
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(v_i > V_MIN, (v_i - v_j) / v_i, np.nan)


def speed_ratio(v_i: FloatArray, v_j: FloatArray) -> FloatArray:
    """rho = r_j omega_j / (r_i omega_i), near 1; NaN where axle i runs slower than 1 m/s. As `differential_slip`.

    Thesis [fichtinger2024]: Eq. (3.15).
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(v_i > V_MIN, v_j / v_i, np.nan)


def slope_ratio(slope_f: FloatArray, slope_r: FloatArray) -> FloatArray:
    """lambda = C_r / C_f, ratio of the slip slopes C_s / F_z of rear and front axle. [-]

    Thesis [fichtinger2024]: Eq. (3.17).
    """
    return slope_r / slope_f


def beta_of_ratio(ratio: float, *, front: bool) -> float:
    """Ratio parameter beta of the filter: 1 / lambda formulated at the front axle, lambda at the rear one. [-]

    Thesis [fichtinger2024]: Eq. (3.21). In both cases the slope of axle i over that of axle j.
    """
    return 1.0 / ratio if front else ratio


def differential_traction(mu_i: FloatArray, mu_j: FloatArray, *, rho: FloatArray, beta: FloatArray) -> FloatArray:
    """Differential traction coefficient at axle i, mu_i - beta rho mu_j.

    Parameters
    ----------
    mu_i, mu_j : array (n,)
        Traction coefficients F_x / F_z of both axles, rolling resistance and inertia taken off (E13). [-]
    rho : array (n,)
        As `speed_ratio` gives it. [-]
    beta : array or float
        Slope of axle i over that of axle j. [-]

    Returns
    -------
    mu_delta : array (n,)
        Zero where both axles slip alike: there the slope cannot be determined (C95). [-]

    Thesis [fichtinger2024]: the bracket of Eq. (3.18), (3.19).
    """
    return mu_i - beta * rho * mu_j


def predicted_differential_slip(
    mu_i: FloatArray, rho_mu_j: FloatArray, *, inverse_slope: FloatArray, beta: FloatArray, offset: FloatArray
) -> FloatArray:
    """Differential slip that linear tyres show, (mu_i - beta rho mu_j) / C_i + delta.

    Parameters
    ----------
    mu_i, rho_mu_j : array (n,)
        Traction coefficient of axle i, and that of axle j times rho. [-]
    inverse_slope, beta, offset : array or float
        1 / C_i, C_i / C_j, and the offset of the differential slip, delta_i - rho delta_j. [-]

    Returns
    -------
    s_delta : array (n,)

    Thesis [fichtinger2024]: Eq. (3.20); the offset is that of s = mu / C + delta. Printed with (3.14), mu = C (s +
    delta), its sign would be the other one (E8).
    """
    return (mu_i - beta * rho_mu_j) * inverse_slope + offset


def jacobian(
    mu_i: FloatArray, rho_mu_j: FloatArray, *, inverse_slope: FloatArray, beta: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Derivatives of `predicted_differential_slip` by 1 / C_i, beta and the offset.

    Thesis [fichtinger2024]: needed for the filter of Eq. (3.20) to (3.22), not printed.
    """
    return mu_i - beta * rho_mu_j, -rho_mu_j * inverse_slope, 1.0 + 0.0 * mu_i
