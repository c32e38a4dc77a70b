"""Detector `margin`: it warns before the car floats."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from aqualog.core.notation import SIDES
from aqualog.core.records import FloatArray, Margin, Track
from aqualog.core.vehicle import Vehicle
from aqualog.detect.braking import lasting
from aqualog.detect.detector import (
    Detector,
    Needs,
    Output,
    Scene,
    Setup,
    missing_balance,
    missing_drivetrain,
    missing_torques,
    missing_wheels,
    too_slow,
)
from aqualog.detect.margin.emissions import emissions_of
from aqualog.detect.margin.inputs import Reader, has_balance
from aqualog.detect.margin.recursion import scan
from aqualog.detect.margin.state import OUTPUTS, Filter, FilterParams

__all__ = ["FEATURES", "MARGIN", "Least", "MarginWatch", "params"]

THRESHOLD = 0.25  # [-] dry roads stay below it, and it finds passes 20 km/h away that a half does not
NEAR = 30.0 / 3.6  # [m/s]
STEP_S = 0.1  # of the filter
MIN_RATE = 10.0  # [Hz]
ALONE = 1.5  # by which a warning is stricter without torque: of a probability, what may be left is divided by it
GRADE = 0.05  # [-] unknown without torque, standard deviation: of hilly roads (K)
PROBABLE = 0.5  # [-] of water: below it there is no distance
FEATURES: Mapping[str, str] = {
    "aquaplaning_margin": "median", "aquaplaning_margin_low": "low", "aquaplaning_margin_high": "high",
    "aquaplaning_margin_q25": "q25", "aquaplaning_margin_q75": "q75", "full_speed_expected": "v_full",
    "contact_expected": "contact",
}  # fmt: skip
"""Feature -> row of the filter. They have a value where water is probable; `water_probability` has one everywhere.
Without torque all have one in a warning alone."""


def params(vehicle: Vehicle, dt: float, *, balanced: bool = True) -> FilterParams:
    """Return the tuning for a car and a sample time [s]; `balanced`: torques say what water costs."""
    block = max(1, round(STEP_S / dt))
    p = FilterParams(
        block, block * dt, NEAR, vehicle.slip_slope_f, vehicle.slip_slope_r, vehicle.rolling_resistance, vehicle.mu_max,
    )  # fmt: skip
    # where nothing is known of drag, shake alone is no sign: torques that change in turn shake wheels, too
    return p if balanced else p._replace(grade=GRADE * _slip_by_force(vehicle), shakes=math.inf)


def _slip_by_force(vehicle: Vehicle) -> float:
    """Slip of the front axle less that of the rear one that a force of the car's weight would make of dry tyres. [-]"""
    rear = vehicle.torque_split_rear
    front = (1.0 - rear) * vehicle.wheelbase / (vehicle.l_r * vehicle.slip_slope_f)
    return abs(front - rear * vehicle.wheelbase / (vehicle.l_f * vehicle.slip_slope_r))


class MarginWatch:
    """Distance to full aquaplaning, and a warning while it is probably below 30 km/h, in three steps in a row."""

    def __init__(self, setup: Setup) -> None:
        vehicle = setup.vehicle
        self._setup = setup
        self._reader = Reader(vehicle, setup.dt)
        self._params, self._alone = (params(vehicle, setup.dt, balanced=x) for x in (True, False))
        self._emissions = emissions_of(vehicle.drivetrain)
        self._state = Filter.new(self._params, self._emissions)
        self._least = 2 * self._params.block + 1
        self._run = 0

    def push(self, scene: Scene) -> Output:
        """Take the next piece: one track, the probability that full aquaplaning is less than 30 km/h away. [-]"""
        v = scene.f["v_x_hat"]
        balanced, setup = has_balance(self._setup.vehicle, scene), self._setup
        setup = setup if balanced else replace(setup, threshold=setup.detector.scaled(setup.threshold, ALONE))
        p = self._params if balanced else self._alone
        values, self._state = scan(p, self._emissions, self._state, self._reader.push(scene))
        values = np.where(np.isnan(v), np.nan, values)
        rows = dict(zip(OUTPUTS, values, strict=True))
        with np.errstate(invalid="ignore"):
            near = rows["p_near"] > setup.threshold
            active, self._run = lasting(near & (rows["shows"] > 0.0), self._run, least=self._least, stays=near)
            wet = rows["p_water"] > PROBABLE if balanced else active
        features = {name: np.where(wet, rows[row], np.nan) for name, row in FEATURES.items()}
        margin = features["aquaplaning_margin"]
        evidence = {"v_x": ("first", v), "margin_min": ("min", margin), "contact_min": ("min", rows["contact"])}
        track = setup.track(rows["p_near"], active)
        water = rows["p_water"] if balanced else np.where(active, rows["p_water"], np.nan)
        return Output(((track, evidence),), {**features, "water_probability": water})


class Least:
    """The least distance of a drive, gathered piece by piece; `dt` is the sample time. [s]"""

    def __init__(self, dt: float) -> None:
        self._dt = dt
        self._rows = 0
        self._best = (math.inf, math.nan, math.nan, math.nan)
        self._warned = math.nan

    def push(self, features: Mapping[str, FloatArray], track: Track | None) -> None:
        """Take features (n,) and the detector's track of the next samples."""
        if track is None:
            return
        # a distance by the resistance alone, without a slip, is no least one, nor is a near one that the road shows not
        counts = (track.statistic > 0.0) & (track.active | (track.statistic <= track.threshold))
        margin = np.where(counts, features["aquaplaning_margin"], np.nan)
        if np.isfinite(margin).any():
            i = int(np.nanargmin(margin))
            if margin[i] < self._best[0]:
                low, high = features["aquaplaning_margin_low"][i], features["aquaplaning_margin_high"][i]
                self._best = (float(margin[i]), float(low), float(high), (self._rows + i) * self._dt)
        if math.isnan(self._warned) and track.active.any():
            self._warned = (self._rows + int(np.argmax(track.active))) * self._dt
        self._rows += margin.size

    def result(self) -> Margin | None:
        """Return the least distance; None where no water was probable."""
        least, low, high, at_s = self._best
        return Margin(least, (low, high), at_s, self._warned) if math.isfinite(least) else None


def _needs(vehicle: Vehicle, have: Collection[str], rate_hz: float) -> Needs:
    has_side = any(not missing_wheels(have, wheels) for wheels in SIDES.values())
    wheels = missing_wheels(have)
    torques = missing_torques(vehicle, have)
    # without torque the acceleration says how hard wheels pull, uphill too, and only the pressure whether they brake
    needed = () if "a_x" in have else ("a_x",)
    missing = (*(() if has_side else wheels), *missing_drivetrain(vehicle), *needed, *too_slow(rate_hz, MIN_RATE))
    unknown = ("brake_pressure",) if torques and "brake_pressure" not in have else ()
    return Needs(missing, (*wheels, *(torques or missing_balance(vehicle, have)), *unknown))


MARGIN = Detector(
    name="margin",
    title="Margin",
    unit="-",
    meaning="probability that full aquaplaning is less than 30 km/h away",
    statistic="probability that full aquaplaning is less than 30 km/h away",
    threshold=THRESHOLD,
    needs=_needs,
    start=MarginWatch,
    kind="warning",
    highest=1.0,
)
