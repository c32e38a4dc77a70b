"""Resistance of the water alone, from a longitudinal model with grade (thesis [36])."""

from __future__ import annotations

from functools import partial

import numpy as np

from aqualog.core.records import Track
from aqualog.detect.detector import Detector, Needs, Scene, Setup, any_wheel, missing_balance, too_slow
from aqualog.detect.resistance import RESISTANCE
from aqualog.detect.rivals.rival import MIN_RATE, WholeDrive, alarm_bits
from aqualog.features.smoothing import UNSET, fading_lowpass, lowpass
from aqualog.physics.load import G

__all__ = ["RESISTANCE_MODEL", "THRESHOLD"]

THRESHOLD = 0.35  # [m/s^2]
TAU_GRADE = 1.0  # [s] a road's grade changes with its length, an accelerometer's noise does not
TAU_MEASURE = 0.7  # [s]
FADE = 0.3  # [s] what was before a gap says little behind it
V_MIN = 10.0  # [m/s] below, water costs nothing that a balance can show
A_Y_MAX = 2.5  # [m/s^2] beyond, cornering itself costs more than water does


def run(r: Scene, setup: Setup) -> tuple[Track, ...]:
    """Run the method: one track of the car; the statistic is the low-passed extra resistance over the mass. [m/s²]

    Wheel forces less nominal rolling and air resistance, less m (dv/dt + g sin(theta)). The grade is the slow part of
    accelerometer less kinematic acceleration, so that an accelerometer's offset looks like a grade and remains. A plain
    low-pass (0.7 s) against a threshold, no sum. Held under braking, below 36 km/h and beyond 2.5 m/s² sideways.

    Thesis [36].
    """
    f = r.f
    a_x = r.columns["a_x"]
    grade, _ = lowpass((a_x - f["a_kin"]) / G, UNSET, tau=TAU_GRADE, dt=setup.dt)  # sin(theta)
    beyond = f["delta_a_x"] + a_x - (f["a_kin"] + G * grade)
    with np.errstate(invalid="ignore"):
        usable = (f["v_x_hat"] > V_MIN) & (np.abs(f["a_y_slow"]) < A_Y_MAX) & ~any_wheel(r.braking)
    measure = np.where(usable, beyond, np.nan)
    slow, _ = fading_lowpass(measure, 0.0, tau=TAU_MEASURE, fade=FADE, dt=setup.dt)
    statistic = np.where(np.isnan(measure), np.nan, slow)
    bits = alarm_bits(statistic, setup.threshold, off_share=0.7, dt=setup.dt)
    return (setup.track(statistic, bits),)


RESISTANCE_MODEL = Detector(
    name="resistance_model",
    title="resistance from a longitudinal model",
    meaning="what holds the car back beyond nominal rolling, air and grade is water that the tyres displace",
    statistic="statistic",
    start=partial(WholeDrive, run=run),
    kind="rival",
    reference="[36]",
    unit="m/s^2",
    threshold=THRESHOLD,
    needs=lambda car, have, rate: Needs((*missing_balance(car, have), *too_slow(rate, MIN_RATE))),
    counterpart=RESISTANCE,
)
