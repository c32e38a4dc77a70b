"""Detect resistance: a CUSUM of the balance of forces, where it can be trusted."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np

from aqualog.calibrate import online
from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.detect import cusum
from aqualog.detect.braking import hold_on
from aqualog.detect.cusum import CusumParams
from aqualog.detect.detector import Detector, Needs, Output, Scene, Setup, missing_balance, too_slow
from aqualog.detect.events import AFTER, SINCE
from aqualog.detect.minor_spin_down import MINOR_SPIN_DOWN
from aqualog.detect.slip_slope.watch import SLIP_SLOPE_DROP
from aqualog.detect.spin import HELD_BACK, SPIN_DOWN

__all__ = [
    "LEVEL", "MEASURE", "MIN_RATE", "RESISTANCE", "ResistanceWatch", "alarm_params", "trusted_measure",
    "usable_for_offset",
]  # fmt: skip

THRESHOLD = 0.2  # [m/s]
LEVEL = 0.2  # [m/s^2] thesis 2.2: partial aquaplaning (C44)
LATEST = 2.0  # [s] at most so long after it begins a resistance of 0.2 m/s^2 is reported
MIN_RATE = 2.0  # [Hz]
MEASURE = "trusted_measure"  # as later detectors find it
FREEZE = 2.0  # [s] after a wheel has left the road's speed nothing is learnt as dry
V_MIN = 14.0  # [m/s] below 50 km/h even 2 mm of water cost less than 0.12 m/s^2; traffic rules the balance
CLIP = 0.8  # [m/s^2] a gear change or a bump shows more for a moment than water ever does (C46)
V_OFFSET = 5.0  # [m/s] from here on the dry offset is learnt; the less water shows, the better
BRAKE_UNSURE = 0.2  # [-] of a brake's torque that no log knows
BACK, BACK_S = 0.03, 1.0  # [m/s, s] a sum beyond the drift that shows a force at all, and how long it is remembered
A_OFFSET = 1.0  # [m/s^2] beyond, a wrong mass shows in the measure, and curves cost more than the model knows
A_Y_MAX = 2.5  # [m/s^2] beyond, cornering itself costs more than water does


def alarm_params(dt: float, threshold: float = THRESHOLD) -> CusumParams:
    """Tuning of the single detector, robust: its drift is half the change that is to be found.

    It reports 0.2 m/s² after 2 s, 0.4 m/s² after 0.7 s (C76).
    """
    # the clamp does not follow a low threshold: joint detector 2 takes the sum up to 0.3 m/s
    return CusumParams(0.5 * LEVEL, threshold, max(1.5 * threshold, 0.3), dt)


def trusted_measure(delta_a_x: FloatArray, v_x: FloatArray, a_y: FloatArray, is_braking: BoolArray) -> FloatArray:
    """Return the resistance measure where the longitudinal balance can be trusted.

    Elsewhere it is zero: no evidence, and sums decay. Under braking it is the least value, so that an alarm ends within
    a quarter of a second: brake torque is rarely known well enough.

    `delta_a_x` is the nominal less the measured acceleration (thesis 2.9) [m/s²], more resistance positive; `v_x`
    [m/s]; `a_y` lateral acceleration, low-passed [m/s²]. The result is within ±0.8; NaN stays NaN. [m/s²]
    """
    with np.errstate(invalid="ignore"):
        trusted = (v_x > V_MIN) & (np.abs(a_y) < A_Y_MAX)
    x = np.where(trusted, np.clip(delta_a_x, -CLIP, CLIP), 0.0)
    return np.where(np.isnan(delta_a_x), np.nan, np.where(is_braking, -CLIP, x))


def usable_for_offset(
    delta_a_x: FloatArray, v_x: FloatArray, a_kin: FloatArray, a_y: FloatArray, is_braking: BoolArray
) -> FloatArray:
    """Return the resistance measure where it shows its own offset on dry road: rolling steadily, straight, no brake.

    Arrays (n,) as in `trusted_measure`; `a_kin` is the kinematic acceleration, low-passed [m/s²]. The measure is within
    ±0.8, NaN elsewhere. [m/s²]
    """
    with np.errstate(invalid="ignore"):
        usable = (v_x > V_OFFSET) & (np.abs(a_kin) < A_OFFSET) & (np.abs(a_y) < A_OFFSET) & ~is_braking
    return np.where(usable, np.clip(delta_a_x, -CLIP, CLIP), np.nan)


class ResistanceWatch:
    """Resistance measure, its offset on dry road, and its alarm.

    The trusted measure (n,) [m/s²] is shared as `MEASURE`, and as `HELD_BACK` where something holds the car back, or
    where that is not known. Where a wheel or the slip slope suggests that this is not dry road, the offset is frozen.
    """

    def __init__(self, setup: Setup) -> None:
        self._setup = setup
        self._dt = setup.dt
        self._params = alarm_params(setup.dt, setup.threshold)
        self._online = online.OnlineParams.make(setup.dt) if setup.settings.learns_offset else None
        self._offset = online.initial_state()
        self._sum, self._ages = cusum.initial_state(), cusum.new_ages()
        self._back_params, self._back = CusumParams(0.5 * LEVEL, BACK, 2.0 * BACK, setup.dt), cusum.initial_state()
        self._frozen = self._held = 0

    def push(self, scene: Scene) -> Output:
        """Take the next piece: one track, the sum. [m/s]"""
        f = scene.f
        suspects = scene.of(*RESISTANCE.reads)
        suspicion = np.any([np.zeros(scene.size, dtype=bool), *(t.active for t in suspects)], axis=0)
        frozen, self._frozen = hold_on(suspicion, self._frozen, seconds=FREEZE, dt=self._dt)
        measure, features = f["delta_a_x"], {}
        if self._online is not None:
            usable = usable_for_offset(measure, f["v_x_hat"], f["a_kin_slow"], f["a_y_slow"], scene.is_braking)
            offset, self._offset = online.scan(self._online, self._offset, usable, f["v_x_hat"], frozen)
            features["delta_a_x_offset"] = offset
            measure = measure - offset
        # the torques show how hard stability control brakes a wheel, if not to the last tenth
        one_side = scene.one_side_braked
        sure = np.where(one_side, measure - BRAKE_UNSURE * self._braked(scene), measure)
        x = trusted_measure(sure, f["v_x_hat"], f["a_y_slow"], scene.is_braking & ~one_side)
        g, bits, self._sum = cusum.scan(self._params, self._sum, x)
        since, after, self._ages = cusum.ages(self._dt, self._ages, g, bits)
        evidence: dict[str, Any] = {
            "v_x": ("first", f["v_x_hat"]),
            "v_x_min": ("min", f["v_x_hat"]),
            "v_x_max": ("max", f["v_x_hat"]),
            "delta_a_x_max": ("max", np.where(scene.is_braking, np.nan, measure)),
            SINCE: ("first", np.minimum(since, LATEST)),
            AFTER: ("last", after),
        }
        _, back, self._back = cusum.scan(self._back_params, self._back, np.clip(sure, -CLIP, CLIP))
        held, self._held = hold_on(back, self._held, seconds=BACK_S, dt=self._dt)
        shared = {MEASURE: x, HELD_BACK: held | np.isnan(measure)}
        return Output(((self._setup.track(g, bits), evidence),), features, shared)

    def _braked(self, scene: Scene) -> FloatArray:
        """Return the deceleration that negative torques make. (n,) [m/s²]"""
        vehicle, none = self._setup.vehicle, np.zeros(scene.size)
        forces = [np.minimum(scene.columns.get(f"torque_{w}", none), 0.0) / vehicle.arm(w) for w in WHEELS]
        return np.asarray(-np.sum(forces, axis=0) / vehicle.mass)


def _needs(vehicle: Vehicle, have: Collection[str], rate_hz: float) -> Needs:
    slow = too_slow(rate_hz, MIN_RATE, "signals at {:g} Hz or more (check the unit of the time)")
    return Needs((*missing_balance(vehicle, have), *slow))


RESISTANCE = Detector(
    name="resistance",
    title="Resistance",
    unit="m/s",
    meaning="sum of the resistance measure beyond 0.1 m/s²",
    statistic="sum of the resistance measure beyond its drift",
    threshold=THRESHOLD,
    needs=_needs,
    start=ResistanceWatch,
    reads=(SPIN_DOWN, MINOR_SPIN_DOWN, SLIP_SLOPE_DROP),
)
