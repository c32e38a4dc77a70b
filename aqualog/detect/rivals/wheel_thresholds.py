"""Thresholds on wheel deceleration and slip, with and without braking (thesis [32])."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from aqualog.core.compiled import compiled
from aqualog.core.notation import WHEELS
from aqualog.core.records import FloatArray, Track
from aqualog.detect.detector import Detector, Scene, Setup
from aqualog.detect.rivals.rival import WholeDrive, alarm_bits, needs_wheels
from aqualog.detect.spin import SLIP_FULL, SPIN_DOWN
from aqualog.features.smoothing import UNSET, derivative
from aqualog.features.stream import TAU_WHEEL
from aqualog.physics.slip import slip_of_wheel_speed

__all__ = ["THRESHOLD", "WHEEL_THRESHOLDS", "critical_share"]

THRESHOLD = 1.0  # [-] of both critical levels; rule in `rival`, as for all rivals
# Without brakes nothing but water (or another slippery road) slows a wheel faster than the car (K): lifting off takes
# 1-2 m/s^2 and less than 1 % of slip. With brakes a wheel on a dry road reaches 2-3 g and 20 % of slip before its
# controller lets go (K).
DECELERATION, SLIP = 2.5, 0.02  # [m/s^2], [-]
DECELERATION_BRAKING, SLIP_BRAKING = 40.0, 0.35  # [m/s^2], [-]
MEMORY = 0.15  # [s] the deceleration comes before the slip that it makes
V_MIN = 5.0  # [m/s]


@compiled
def _envelope(keep, x):  # type: ignore[no-untyped-def]
    out = np.empty_like(x)
    peak = 0.0
    for i in range(x.size):
        if math.isnan(x[i]):
            peak = peak * keep
            out[i] = math.nan
        else:
            peak = max(x[i], peak * keep)
            out[i] = peak
    return out


def critical_share(deceleration: FloatArray, negative_slip: FloatArray, *, dt: float) -> FloatArray:
    """Return the smaller one of the shares of both critical levels that a wheel has reached.

    Parameters
    ----------
    deceleration, negative_slip : array (n,)
        Of the wheel, over their critical levels; positive where the wheel slows down. NaN: NaN. [-]
    dt : float
        [s]

    Returns
    -------
    share : array (n,)
        The deceleration counts as its decaying peak, which fades with 0.15 s: it comes before the slip. [-]
    """
    peak: FloatArray = _envelope(math.exp(-dt / MEMORY), np.ascontiguousarray(deceleration, dtype=np.float64))
    return np.minimum(peak, negative_slip)


def run(r: Scene, setup: Setup) -> tuple[Track, ...]:
    """Run the method: one track per wheel; the statistic is the share of both critical levels. [-]

    The deceleration is the wheel's own, not its difference to the car's: the method uses wheel speeds alone. An
    alarm ends when the slip has fallen below half its level.

    Thesis [32]: critical deceleration levels and slips for spin-downs with and without braking.
    """
    v_x = r.f["v_x_hat"]
    tracks = []
    for wheel in WHEELS:
        braking = r.braking[wheel]
        v_w = r.f[f"v_w_{wheel}"]
        a_w, _ = derivative(v_w, UNSET, tau=TAU_WHEEL, dt=setup.dt)
        with np.errstate(invalid="ignore"):
            slip = -slip_of_wheel_speed(v_w, v_x) / np.where(braking, SLIP_BRAKING, SLIP)
            slip = np.where(v_x < V_MIN, 0.0, slip)
        deceleration = -a_w / np.where(braking, DECELERATION_BRAKING, DECELERATION)
        statistic = critical_share(deceleration, slip, dt=setup.dt)
        bits = alarm_bits(statistic, setup.threshold, stay=slip, dt=setup.dt)
        tracks.append(setup.track(statistic, bits, wheel=wheel))
    return tuple(tracks)


def _severity(evidence: Mapping[str, Any]) -> str:
    """Return full where the wheel has lost a quarter of its speed without brakes; braked wheels lose it on any road."""
    lost = evidence.get("slip_min", 0.0) < SLIP_FULL
    return "full" if lost and not evidence.get("braking", False) else "partial"


WHEEL_THRESHOLDS = Detector(
    name="wheel_thresholds",
    title="thresholds on wheel deceleration and slip",
    meaning="a wheel that decelerates and slips beyond critical levels, higher ones under braking, spins down",
    statistic="statistic",
    start=partial(WholeDrive, run=run),
    kind="rival",
    reference="[32]",
    unit="-",
    threshold=THRESHOLD,
    needs=needs_wheels,
    counterpart=SPIN_DOWN,
    severity=_severity,
)
