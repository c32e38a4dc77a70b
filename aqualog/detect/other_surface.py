"""Decide whether water can be the cause of a lost slip slope: snow and gravel lose it too, in another way (C57)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from aqualog.core.compiled import compiled, plain
from aqualog.core.records import BoolArray, FloatArray
from aqualog.features.smoothing import gain

__all__ = ["OtherParams", "OtherState", "initial_state", "scan"]


class OtherParams(NamedTuple):
    """Bounds; made by `make`."""

    dt: float
    k: float  # share of a new sample in the mean of the resistance measure
    resistance: float  # [m/s^2] that water takes at least where it takes half of the slope
    still: float  # [m/s^2] it goes on while this much is left
    v_min: float  # [m/s] below, no film of road water takes half of the slope
    v_proof: float  # [m/s] a slope that is lost below this speed is lost to something else
    proof: float  # [s] of it
    recovered: float  # [-] a loss below this is dry road again
    forget: float  # [s] of dry road after which a proof is no longer one

    @classmethod
    def make(cls, dt: float) -> OtherParams:
        """Return bounds from the physics of the film.

        Half of the slope is lost at a contact of 0.71 (C68), which the simulated wedge reaches at 0.70 of the speed of
        full aquaplaning. That is 85 km/h and more in deep water at 1.8 bar (Horne [horne1963]), so 60 km/h and more. In
        5 to 8 mm worn tyres float at 75 km/h, and the bound is 8 km/h late. The thesis finds at least 0.2 m/s² of
        resistance there (C3, C44). Compacted snow costs 0.05 to 0.15 m/s² (K).
        """
        return cls(dt, gain(0.8, dt), 0.2, 0.1, 17.0, 14.0, 1.0, 0.3, 10.0)


class OtherState(NamedTuple):
    """Mean of the resistance measure [m/s²], seconds of a loss at low speed, seconds of dry road, the bit."""

    mean: float
    proved: float
    dry: float
    allowed: bool


def initial_state() -> OtherState:
    """Nothing seen."""
    return OtherState(0.0, 0.0, 0.0, allowed=False)


@compiled
def _scan(p, mean, proved, dry, allowed, x, v_x, dropped, loss):  # type: ignore[no-untyped-def]
    out = np.zeros(x.size, dtype=np.bool_)
    for i in range(x.size):
        if not math.isnan(x[i]):
            mean += p.k * (x[i] - mean)
        if dropped[i] and v_x[i] < p.v_proof:
            proved = min(proved + p.dt, p.proof)
            dry = 0.0
        elif loss[i] < p.recovered:
            dry += p.dt
            if dry > p.forget:
                proved = 0.0
        elif dropped[i]:
            dry = 0.0
        least = p.still if allowed and dropped[i] else p.resistance
        allowed = mean > least and v_x[i] > p.v_min and proved < p.proof
        out[i] = allowed
    return out, mean, proved, dry, allowed


def scan(
    p: OtherParams, state: OtherState, x: FloatArray, v_x: FloatArray, dropped: BoolArray, loss: FloatArray
) -> tuple[BoolArray, OtherState]:
    """Flag samples where water may be the cause of a lost slope.

    Parameters
    ----------
    x : array (n,)
        Trusted resistance measure, NaN where missing. [m/s²]
    v_x : array (n,)
        [m/s]
    dropped : bool array (n,)
        Criterion 4 on any wheel.
    loss : array (n,)
        Largest lost share of the dry slope over the wheels, NaN where missing. [-]

    Returns
    -------
    allowed : bool array (n,)
        The resistance (mean over 0.8 s) exceeds 0.2 m/s² (0.1 during a drop that counted), the car is faster than
        61 km/h, and no slope was lost below 50 km/h since the last 10 s of dry road.
    state : OtherState

    Thesis: section 2.3: a drop on snow, ice and gravel does not depend on the speed, that on water does (C57).
    """
    out, mean, proved, dry, is_on = _scan(p, *state, *plain(x, v_x, dropped, loss))
    return out, OtherState(mean, proved, dry, allowed=bool(is_on))
