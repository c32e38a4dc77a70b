"""Compare front wheels with a stored reference, and with the rear wheels over the same spot (thesis [33], [34])."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from aqualog.core.compiled import compiled
from aqualog.core.notation import SIDES
from aqualog.core.records import FloatArray, Track
from aqualog.detect.detector import Detector, Scene, Setup
from aqualog.detect.minor_spin_down import MINOR_SPIN_DOWN
from aqualog.detect.rivals.rival import WholeDrive, alarm_bits, needs_wheels
from aqualog.features.smoothing import fading_lowpass, gain

__all__ = ["FRONT_REAR_PATTERN", "THRESHOLD", "at_the_rear", "dips"]

MIN_RATE = 20.0  # [Hz] the axles pass the same spot within a tenth of a second
THRESHOLD = 9.0  # [-] times the stored reference
TAU_REFERENCE = 20.0  # [s] memory of the reference
STEP_MAX = 0.005  # [-] a larger deviation does not move the reference by more: it is what is looked for
DIP_MAX = 0.05  # [-] deep enough; more would only outlast its cause in the power
TAU_POWER = 0.15  # [s] about a minor spin-down
REPEATED = 2.0  # share of the rear's dips taken off: the same bump never shakes two axles alike
TOLERANCE = 0.02  # [s] a wheel feels a bump half a contact length earlier or later, and samples are not exact
FLOOR = 1e-3  # [-] a reference rms below this is that of a sensor, not of a road
V_MIN = 8.0  # [m/s]
A_Y_MAX = 4.0  # [m/s^2] as of the minor spin-downs


@compiled
def _dips(k, step_max, dip_max, x):  # type: ignore[no-untyped-def]
    out = np.empty_like(x)
    reference = math.nan
    for i in range(x.size):
        if math.isnan(x[i]):
            out[i] = math.nan
            continue
        if math.isnan(reference):
            reference = x[i]
        e = x[i] - reference
        reference += k * min(max(e, -step_max), step_max)
        out[i] = min(max(-e, 0.0), dip_max)
    return out


@compiled
def _over_reference(k, floor, front, rear):  # type: ignore[no-untyped-def]
    out = np.empty_like(front)
    reference = floor * floor
    for i in range(front.size):
        if math.isnan(front[i]) or math.isnan(rear[i]):
            out[i] = math.nan
            continue
        out[i] = math.sqrt(max(front[i] - rear[i], 0.0) / max(reference, floor * floor))
        reference += k * (min(front[i], 4.0 * max(reference, floor * floor)) - reference)
    return out


def dips(deviation: FloatArray, *, dt: float) -> FloatArray:
    """Return how far a wheel's deviation from the car lies below its own slow reference, 0 ... 5 %. [-]

    NaN: reference held, NaN. The reference starts at the first sample and follows with 20 s. Its rate is at most that
    for a deviation of half a per cent.
    """
    y: FloatArray = _dips(gain(TAU_REFERENCE, dt), STEP_MAX, DIP_MAX, np.ascontiguousarray(deviation, dtype=np.float64))
    return y


def at_the_rear(front: FloatArray, v_x: FloatArray, *, wheelbase: float, dt: float) -> FloatArray:
    """Return the front wheel's signal at the rear wheel's place, a wheelbase earlier on the way.

    Parameters
    ----------
    front : array (n,)
        A front wheel's signal.
    v_x : array (n,)
        Velocity; NaN counts as standing. [m/s]
    wheelbase, dt : float
        [m], [s]

    Returns
    -------
    array (n,)
        Linear between samples; NaN for the first wheelbase, and beside a NaN of `front`.
    """
    way = np.cumsum(np.maximum(np.nan_to_num(v_x), 0.0)) * dt
    # a car that stands passes no new spot; the tiny slope only orders the samples
    way = way + 1e-9 * np.arange(way.size)
    return np.interp(way - wheelbase, way, front, left=np.nan) if way.size else front


def _widened(x: FloatArray, samples: int) -> FloatArray:
    """Return the largest value of the last 2 samples + 1; NaN where the newest is NaN."""
    largest = x.copy()
    for _ in range(2 * samples):
        largest[1:] = np.fmax(x[1:], largest[:-1])
    return np.where(np.isnan(x), np.nan, largest)


def run(r: Scene, setup: Setup) -> tuple[Track, ...]:
    """Run the method: one track per side, at the front wheel; statistic: the front's dips over their reference. [-]

    The numerator is the rms of the front's dips (0.15 s) less those that the rear wheel repeats over the same spot; the
    denominator is the slow rms of the front's dips. A bump is under both axles. A front wheel that loses the road in
    water clears it for the rear one. Held under braking, below 30 km/h and beyond 4 m/s² sideways. The statistic is
    late by wheelbase / v and 0.02 s, so that the rear wheel may repeat the bump a little earlier or later.

    Thesis [33], [34].
    """
    f = r.f
    v_x = f["v_x_hat"]
    late = max(round(TOLERANCE / setup.dt), 1)
    tracks = []
    for side, (front, rear) in SIDES.items():
        with np.errstate(invalid="ignore", divide="ignore"):
            usable = (v_x > V_MIN) & ~(np.abs(f["a_y_slow"]) > A_Y_MAX) & ~r.braking[front] & ~r.braking[rear]
            share = {
                w: np.where(usable, (f[f"v_w_delta_{w}"] - f["v_w_delta_common"]) / v_x, np.nan) for w in SIDES[side]
            }
        there = at_the_rear(dips(share[front], dt=setup.dt), v_x, wheelbase=setup.vehicle.wheelbase, dt=setup.dt)
        there = np.concatenate([np.full(min(late, there.size), np.nan), there[:-late]])
        here = _widened(dips(share[rear], dt=setup.dt), late)
        both = there + here  # a power needs both wheels
        power_f, power_r = (
            fading_lowpass(np.where(np.isnan(both), np.nan, x * x), 0.0, tau=TAU_POWER, fade=TAU_POWER, dt=setup.dt)[0]
            for x in (there, here)
        )
        power_f = np.where(np.isnan(both), np.nan, power_f)
        statistic = _over_reference(gain(TAU_REFERENCE, setup.dt), FLOOR, power_f, REPEATED * power_r)
        bits = alarm_bits(statistic, setup.threshold, dt=setup.dt)
        tracks.append(setup.track(statistic, bits, wheel=front))
    return tuple(tracks)


FRONT_REAR_PATTERN = Detector(
    name="front_rear_pattern",
    title="front-rear comparison over the same spot",
    meaning="dips of a front wheel beyond a stored reference that the rear wheel does not repeat over the same spot",
    statistic="statistic",
    start=partial(WholeDrive, run=run),
    kind="rival",
    reference="[33], [34]",
    unit="-",
    threshold=THRESHOLD,
    needs=partial(needs_wheels, least=MIN_RATE),
    counterpart=MINOR_SPIN_DOWN,
)
