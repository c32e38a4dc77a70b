"""The brush as a curve of traction over slip, and the surface of differential traction that two axles span."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.physics import tyre_brush
from aqualog.physics.differential import differential_slip, differential_traction, speed_ratio

__all__ = ["LOAD_REAR", "Road", "Split", "split", "surface", "tangent", "traction"]

LOAD_FRONT, LOAD_REAR = 0.4, 0.6  # shares of the car's weight (thesis Fig. 3.4)


@dataclass(frozen=True, slots=True)
class Road:
    """Friction and slip slope C_s / F_z of both axles' tyres. [-]"""

    name: str
    mu_max: float
    slope: float
    colour: str


def traction(s: FloatArray, *, slope: float, mu_max: float) -> FloatArray:
    """Traction coefficient of the brush over slip, arrays (n,). [-]"""
    return tyre_brush.brush_force(s, np.ones_like(s), mu=mu_max, C_s=slope)


def tangent(mu: FloatArray, *, slope: float, mu_max: float) -> FloatArray:
    """Slope of the brush's curve at the traction mu, C (1 - |mu| / mu_max)^(2/3). [-]"""
    return slope * np.maximum(1.0 - np.abs(mu) / mu_max, 0.0) ** (2.0 / 3.0)


@dataclass(frozen=True, slots=True)
class Split:
    """Working points (n,) of both axles: slips, differential slip and traction at the front axle. [-]"""

    s_f: FloatArray
    s_r: FloatArray
    s_delta: FloatArray
    mu_delta: FloatArray


def split(road: Road, force: FloatArray, nu: FloatArray | float) -> Split:
    """Where both axles work when they share a force.

    Parameters
    ----------
    road : Road
    force : array (n,)
        Sum of the axle forces over the car's weight. [-]
    nu : array (n,) or float
        Share of the rear axle.

    Thesis: Eq. (3.16), the bracket of (3.18) with lambda = 1.
    """
    nu = np.asarray(nu, dtype=np.float64)
    mu_f, mu_r = (1.0 - nu) * force / LOAD_FRONT, nu * force / LOAD_REAR
    s_f = tyre_brush.brush_slip(mu_f, slope=road.slope, mu=road.mu_max)
    s_r = tyre_brush.brush_slip(mu_r, slope=road.slope, mu=road.mu_max)
    # rolling speeds over the vehicle's, times 10 to be above the speed at which slips are no longer defined
    v_f, v_r = 10.0 / (1.0 - s_f), 10.0 / (1.0 - s_r)
    mu_delta = differential_traction(mu_f, mu_r, rho=speed_ratio(v_f, v_r), beta=np.ones(1))
    return Split(s_f, s_r, differential_slip(v_f, v_r), mu_delta)


def surface(road: Road, s_f: FloatArray, s_delta: FloatArray) -> FloatArray:
    """Differential traction (m, n) over front slip (n,) and differential slip (m,). [-]

    With rho = 1 - s_delta, since s_delta is (v_F - v_R) / v_F, and s_R = (s_F - s_delta) / rho.
    """
    x, y = np.meshgrid(s_f, s_delta)
    rho = 1.0 - y
    mu_r = traction((x - y) / rho, slope=road.slope, mu_max=road.mu_max)
    return traction(x, slope=road.slope, mu_max=road.mu_max) - rho * mu_r
