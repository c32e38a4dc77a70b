"""A method of the prior art as a detector: it takes a whole drive as one piece.

One rule, fixed beforehand, gives the default thresholds. It takes the smallest of a grid in steps of about a tenth at
which 10 h of simulated dry, damp and rough driving raise at most one alarm; each rival raised no alarm. The 180 drives
of 200 s between 40 and 130 km/h use three cars, four tyres, grades, wind, series sensors and vehicle files with errors;
seeds 1-180. Recall has no part in the rule. The inputs of the methods and the conditions that hold them were developed
on the same drives and on 120 passes over a watered lane. The rule covers no kerbs, gear shifts or brakes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from typing import Any

import numpy as np

from aqualog.core.compiled import compiled
from aqualog.core.records import BoolArray, FloatArray, Track
from aqualog.core.vehicle import Vehicle
from aqualog.detect.detector import Needs, Output, Scene, Setup, missing_torques, missing_wheels, too_slow
from aqualog.physics.slip import slip_of_wheel_speed

__all__ = ["MIN_RATE", "WholeDrive", "alarm_bits", "needs_slip", "needs_wheels"]

MIN_RATE = 5.0  # [Hz] as of the spin detectors: a full spin-down lasts half a second and more


class WholeDrive:
    """A rival on one drive, which is one piece: its methods look at the past as a whole.

    `run`: (whole drive, setup) -> tracks.
    """

    def __init__(self, setup: Setup, *, run: Callable[[Scene, Setup], tuple[Track, ...]]) -> None:
        self._setup = setup
        self._run = run

    def push(self, scene: Scene) -> Output:
        """Take the whole drive."""
        return Output(tuple((t, _evidence(scene, t)) for t in self._run(scene, self._setup)))


def _evidence(scene: Scene, track: Track) -> dict[str, Any]:
    f = scene.f
    evidence: dict[str, Any] = {"v_x": ("first", f["v_x_hat"]), "statistic_max": ("max", track.statistic)}
    if track.wheel is not None:
        slip = slip_of_wheel_speed(f[f"v_w_{track.wheel}"], f["v_x_hat"])
        braking = ("any", scene.braking[track.wheel])
        evidence |= {"slip_min": ("min", slip), "slip_max": ("max", slip), "braking": braking}
    return evidence


def needs_wheels(vehicle: Vehicle, have: Collection[str], rate_hz: float, *, least: float = MIN_RATE) -> Needs:
    """Wheel speeds of all wheels at a rate. [Hz]"""
    return Needs((*missing_wheels(have), *too_slow(rate_hz, least)))


def needs_slip(vehicle: Vehicle, have: Collection[str], rate_hz: float) -> Needs:
    """Wheel speeds, driving torque, and a velocity that no driven wheel makes: for AWD a reference and its lag."""
    velocity = [s for s in ("v_x", "a_x") if s not in have] if vehicle.drivetrain == "awd" else []
    return Needs((*needs_wheels(vehicle, have, rate_hz).missing, *missing_torques(vehicle, have), *velocity))


@compiled
def _alarm_bits(x, on, off, stay, patience):  # type: ignore[no-untyped-def]
    bits = np.zeros(x.size, dtype=np.bool_)
    active = False
    left = 0
    for i in range(x.size):
        if math.isnan(x[i]) or math.isnan(stay[i]):
            left = max(left - 1, 0)
            active = active and left > 0
        else:
            active = stay[i] > off if active and x[i] <= on else x[i] > on
            left = patience
        bits[i] = active
    return bits


def alarm_bits(
    statistic: FloatArray,
    threshold: float,
    *,
    off_share: float = 0.5,
    stay: FloatArray | None = None,
    patience_s: float = 0.0,
    dt: float,
) -> BoolArray:
    """Return the bit from the statistic's rise above the threshold to its fall below a share of it.

    Parameters
    ----------
    statistic : array (n,)
        NaN: no evidence; the bit goes off unless there is patience.
    threshold : float
        > 0, in the unit of the statistic.
    off_share : float
        0 ... 1. [-]
    stay : array (n,), optional
        Statistic that ends the alarm, in the same unit and never less than the statistic; default the same.
    patience_s, dt : float
        Time that an alarm outlasts missing evidence; sample time. [s]

    Returns
    -------
    bool array (n,)
        Sample by sample, a larger threshold never sets a bit that a smaller one does not.
    """
    x = np.ascontiguousarray(statistic, dtype=np.float64)
    keep = x if stay is None else np.ascontiguousarray(stay, dtype=np.float64)
    bits: BoolArray = _alarm_bits(x, threshold, off_share * threshold, keep, round(patience_s / dt))
    return bits
