"""Slip of a wheel that rolls over even water at a speed, by the balance of its torques."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.model.plant import F_Z_HALF_LENGTH, P_HALF_LENGTH, P_NOMINAL
from aqualog.model.tyre import P_REFERENCE, Tyre
from aqualog.physics.contact import contact_half_length, contact_share, load_shift
from aqualog.physics.hydroplaning import SPIN_UP_RATIO
from aqualog.physics.rolling import pressure_factor
from aqualog.physics.tyre_brush import brush_forces
from aqualog.physics.water import film_drag, skimming_share

__all__ = ["even_slip", "front_slip_slope"]

_SLIPS = np.concatenate([[0.0], np.geomspace(1e-4, 1.0, 56)])


def front_slip_slope(tyre: Tyre, vehicle: Vehicle, p: float) -> float:
    """C_s / F_z of a front tyre on dry road at a pressure. [Pa] to [-]

    Source: `pressure_factor`, as in `model/plant.py`.
    """
    factor = float(pressure_factor(np.array([p]), p_ref=P_REFERENCE, p_nominal=P_NOMINAL)[0])
    return vehicle.slip_slope_f * tyre.slip_slope_factor * factor


def even_slip(
    tyre: Tyre,
    vehicle: Vehicle,
    v: FloatArray,
    h_w: FloatArray,
    F_z: FloatArray,
    *,
    p: float,
    demand: FloatArray,
    scales: FloatArray,
) -> FloatArray:
    """Slip at which the torques of a front wheel balance on even water.

    Parameters
    ----------
    tyre : Tyre
    vehicle : Vehicle
        Slip slope, friction, rolling resistance and effective radius of the front axle.
    v, h_w, F_z : array (n,)
        Speed [m/s], water [m], wheel load [N].
    p : float
        Inflation pressure. [Pa]
    demand : array (n,)
        Drive force over load; NaN for a free wheel. [-]
    scales : array (m,)
        The tyre's speed of full aquaplaning times these.

    Returns
    -------
    s : array (n, m)
        (rim - v) / rim; NaN where no slip balances: the wheel floats. [-]

    A slower wheel floats sooner, as in the simulation. Limits: dry, minus rolling resistance over slip slope.

    Source: the balance of torques of `model/wheel.py`.
    """
    v_full = tyre.full_speed(h_w, F_z, p=p)[:, None] * scales
    force = np.where(np.isfinite(demand), demand, 0.0) * F_z
    slows = _balance(tyre, vehicle, (v, h_w, F_z), p, v_full, -_SLIPS, force)
    speeds = _balance(tyre, vehicle, (v, h_w, F_z), p, v_full, _SLIPS, force) if np.any(demand > 0.0) else slows
    s: FloatArray = np.where(slows[0, :, :] < 0.0, _root(slows, -_SLIPS), _root(-speeds, _SLIPS))
    return s


def _balance(
    tyre: Tyre, vehicle: Vehicle, at: tuple[FloatArray, FloatArray, FloatArray], p: float, v_full: FloatArray,
    slips: FloatArray, force: FloatArray,
) -> FloatArray:  # fmt: skip
    """What is left over for the rotation, as a force at the rim, over (slip, n, m). [N]"""
    v, h_w, F_z = (x[None, :, None] for x in at)
    s = slips[:, None, None]
    rim = v / (1.0 - s) if slips[-1] < 0.0 else v / np.maximum(1.0 - s, 0.05)
    turning = SPIN_UP_RATIO + (1.0 - SPIN_UP_RATIO) * np.minimum(rim / v, 1.0)
    floats = v_full[None] * turning
    L = contact_share(v, floats, exponent=tyre.contact_exponent)
    mu = vehicle.mu_max * tyre.mu_factor * tyre.wet_friction
    slope = front_slip_slope(tyre, vehicle, p)
    per_load, _ = brush_forces(s, np.zeros_like(L), np.ones_like(L), mu=mu, C_x=slope, C_y=tyre.cornering_slope, L=L)
    a = contact_half_length(F_z, p=p, a_ref=tyre.half_length, F_z_ref=F_Z_HALF_LENGTH, p_ref=P_HALF_LENGTH)
    film = film_drag(
        h_w, v, rim, width=tyre.width, tread_capacity=tyre.tread_capacity, h_film=tyre.h_film, relief=tyre.groove_relief
    )
    shift = load_shift(L, a, arm=tyre.wedge_arm) * F_z / vehicle.r_e_f
    resistance = film * skimming_share(v, floats) + shift + vehicle.rolling_resistance * F_z
    left: FloatArray = force[None, :, None] - per_load * F_z - resistance
    return left


def _root(left: FloatArray, slips: FloatArray) -> FloatArray:
    """First slip at which a course over slip rises to zero, between its points; NaN if it does not."""
    above = left >= 0.0
    first = np.argmax(above, axis=0)
    i = np.maximum(first, 1)
    y0, y1 = np.take_along_axis(left, (i - 1)[None], 0)[0], np.take_along_axis(left, i[None], 0)[0]
    share = np.where(y1 != y0, -y0 / np.where(y1 != y0, y1 - y0, 1.0), 0.0)
    s = slips[i - 1] + np.clip(share, 0.0, 1.0) * (slips[i] - slips[i - 1])
    return np.where(above.any(axis=0), np.where(first == 0, 0.0, s), np.nan)
