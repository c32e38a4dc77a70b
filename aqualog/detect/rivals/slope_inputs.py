"""Slip and traction of driven wheels against a velocity from other sources, for the slip-slope rivals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray, Track
from aqualog.detect.braking import hold_on
from aqualog.detect.detector import Scene, Setup
from aqualog.detect.rivals.rival import alarm_bits
from aqualog.detect.slip_slope.activation import ACTIVE, JUMPING, LIMITS, SPINNING, inactive_reason
from aqualog.detect.slip_slope.watch import AFTER_JUMP, TAU_SMOOTH
from aqualog.features.smoothing import UNSET, derivative, lowpass
from aqualog.physics.differential import differential_slip
from aqualog.physics.load import G

__all__ = ["PATIENCE", "Driven", "contiguous", "driven_wheels", "line_tracks", "reference_slope", "velocity_lag"]

PATIENCE = 1.0  # [s] an alarm outlasts missing estimates by this
SLIP_LINE = 0.1  # [-] beyond, a line says no more
A_X_MAX_LATE = 0.5  # [m/s^2] beyond, what is left of a reference's lag (0.03 s) is a third of the slip
# Traction below which errors of the velocity are as large as the slip: 1e-3 of free wheels, 2e-3 of a reference
SHOWN, SHOWN_LATE = 0.03, 0.06  # [-]
SLIP_MAX = 0.3  # [-] beyond, every tyre slides
SETTLE, OWN = 10.0, 40.0  # [s] of estimating until, and for which, the drive's own slope becomes the reference
OWN_LOW, OWN_HIGH = 10.0, 100.0  # [-] a slope that a tyre on asphalt can have: 15-50 (K), and room for radii that err

LAG_TAU = 0.3  # [s] both accelerations are smoothed alike
LAG_TAU_SLOW = 5.0  # [s] grade and offset of the accelerometer change more slowly
LAG_MAX = 0.5  # [s]
# Integral of the squared jerk at which half of a lag is reported, less of it before: a receiver counts as in time at
# first. 5 s of accelerations that change by 0.1 m/s³ have it
LAG_KNOWN = 0.05  # [m^2/s^5]


def contiguous(slip: FloatArray, mu: FloatArray, is_active: BoolArray) -> tuple[FloatArray, FloatArray, BoolArray]:
    """The inputs (n,) of a compiled scan, as it reads them."""
    return (
        np.ascontiguousarray(slip, dtype=np.float64), np.ascontiguousarray(mu, dtype=np.float64),
        np.ascontiguousarray(is_active, dtype=np.bool_),
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Driven:
    """One driven wheel, arrays (n,).

    `slip` (3.13) and traction `mu`, low-passed alike, NaN where not active [-]; `is_active` where both are available;
    `is_shown` where the traction is large enough for a slope to show; `expected` the slip slope of the vehicle file
    [-], `is_given` whether the file gives it.
    """

    wheel: str
    slip: FloatArray
    mu: FloatArray
    is_active: BoolArray
    is_shown: BoolArray
    expected: float
    is_given: bool


def driven_wheels(r: Scene, setup: Setup) -> tuple[Driven, ...]:
    """Return driven wheels, each against the faster free wheel; on an AWD car, the reference velocity without its lag.

    A driven wheel that leaves the road's speed stays in: that is the slope's fall. A free wheel in water can only be
    slow, so that the faster one gives the velocity. If that one leaves the road's speed, too, no velocity is available.
    """
    f, car, dt = r.f, setup.vehicle, setup.dt
    free = [w for w in WHEELS if w not in car.driven]
    if free:
        v_free, a_free = _faster(r, free)
    else:  # the velocity without the lag of its reference, v(t) = v(t - lag) + lag a
        v_free = f["v_x_hat"] + velocity_lag(r.columns["v_x"], r.columns["a_x"], dt=dt) * f["a_kin_slow"]
        a_free = np.zeros(v_free.size)
    limits = LIMITS if free else LIMITS._replace(a_x_max=A_X_MAX_LATE)
    found = []
    for wheel in car.driven:
        slip = np.clip(differential_slip(f[f"v_line_{wheel}"], v_free), -SLIP_MAX, SLIP_MAX)
        # the torque's own rate: that of the traction holds the wheel's acceleration
        pull = r.columns[f"torque_{wheel}"] / (car.arm(wheel) * 0.25 * car.mass * G)
        rate, _ = derivative(pull, UNSET, tau=TAU_SMOOTH, dt=dt)
        reason = inactive_reason(
            v_x=f["v_x_hat"], a_x=f["a_kin_slow"], a_y=f["a_y_slow"], yaw_rate=f["yaw_rate_slow"], a_w_delta=a_free,
            is_braking=np.any([r.braking[w] for w in (wheel, *free)], axis=0), mu_rate=np.abs(np.nan_to_num(rate)),
            limits=limits,
        )  # fmt: skip
        unsettled, _ = hold_on((reason == JUMPING) | (reason == SPINNING), 0, seconds=AFTER_JUMP, dt=dt)
        is_active = (reason == ACTIVE) & ~unsettled
        mu, _ = lowpass(np.where(is_active, f[f"mu_{wheel}"], np.nan), UNSET, tau=TAU_SMOOTH, dt=dt)
        with np.errstate(invalid="ignore"):
            shown = np.abs(mu) > (SHOWN if free else SHOWN_LATE)
        key = f"slip_slope_{wheel[0]}"
        found.append(
            Driven(
                wheel,
                lowpass(np.where(is_active, slip, np.nan), UNSET, tau=TAU_SMOOTH, dt=dt)[0],
                mu,
                is_active,
                shown,
                float(getattr(car, key)),
                f"tyre.{key}" in car.given,
            )
        )
    return tuple(found)


def _faster(r: Scene, free: list[str]) -> tuple[FloatArray, FloatArray]:
    """Return the speed of the faster free wheel [m/s], and its acceleration difference, absolute [m/s²]."""
    f, (one, other) = r.f, free
    with np.errstate(invalid="ignore"):
        first = ~(f[f"v_line_{other}"] > f[f"v_line_{one}"])
    v = np.where(first, f[f"v_line_{one}"], f[f"v_line_{other}"])
    a_w = np.where(first, f[f"a_w_delta_{one}"], f[f"a_w_delta_{other}"])
    return v, np.abs(a_w)


def reference_slope(wheel: Driven, slope: FloatArray, *, dt: float) -> FloatArray:
    """Return the dry slope for the comparison: the vehicle file's, else that of the drive's own first stable part.

    Parameters
    ----------
    slope : array (n,)
        Estimate, NaN where not active. [-]
    dt : float
        [s]

    Returns
    -------
    array (n,)
        [-] Without a value in the file the median of 30 s of estimates after 10 s, NaN until they have passed. It stays
        NaN if it is no slope of a tyre on asphalt (10-100). Limitation: a drive that begins on snow without a value in
        the file is compared with snow.
    """
    if wheel.is_given:
        return np.full(slope.size, wheel.expected)
    reference = np.full(slope.size, np.nan)
    known = np.flatnonzero(np.isfinite(slope))
    first, last = round(SETTLE / dt), round(OWN / dt)
    if known.size > last:
        own = float(np.median(slope[known[first:last]]))
        reference[known[last] :] = own if OWN_LOW < own < OWN_HIGH else np.nan
    return reference


def line_tracks(r: Scene, setup: Setup, slope_of: Callable[[Driven, FloatArray], FloatArray]) -> tuple[Track, ...]:
    """Return a track per driven wheel: the lost share of the dry slope, 1 - C / C_ref.

    `slope_of` (wheel, its slip within the line (n,)) -> slope (n,), NaN where not active. [-]
    """
    tracks = []
    for w in driven_wheels(r, setup):
        slope = slope_of(w, np.clip(w.slip, -SLIP_LINE, SLIP_LINE))
        loss = 1.0 - slope / reference_slope(w, slope, dt=setup.dt)
        statistic = np.where(w.is_shown, loss, np.nan)
        bits = alarm_bits(statistic, setup.threshold, off_share=0.8, patience_s=PATIENCE, dt=setup.dt)
        tracks.append(setup.track(statistic, bits, wheel=w.wheel))
    return tuple(tracks)


def velocity_lag(v_x: FloatArray, a_x: FloatArray, *, dt: float) -> FloatArray:
    """Return the lag of a velocity behind the accelerometer, from the drive so far.

    Parameters
    ----------
    v_x : array (n,)
        Reference velocity. [m/s]
    a_x : array (n,)
        Specific force; its own latency, some 10 ms, is left out. [m/s²]
    dt : float
        [s]

    Returns
    -------
    lag : array (n,)
        0 ... 0.5, starting at 0, never NaN. [s]

    Least squares of dv_x/dt - a_x = -lag da_x/dt beyond the slow part, which holds the grade. Wheel speeds are not
    used: a slip grows with the acceleration as a lag does, and would look like one.
    """
    a_v, _ = derivative(v_x, UNSET, tau=LAG_TAU, dt=dt)
    smooth, _ = lowpass(a_x, UNSET, tau=LAG_TAU, dt=dt)
    jerk, _ = derivative(smooth, UNSET, tau=LAG_TAU, dt=dt)
    late = a_v - smooth
    slow, _ = lowpass(late, UNSET, tau=LAG_TAU_SLOW, dt=dt)
    # the difference is smoothed as the jerk is, or the jerk would be the later one
    behind, _ = lowpass(late - slow, UNSET, tau=LAG_TAU, dt=dt)
    along = np.cumsum(np.nan_to_num(-behind * jerk)) * dt
    size = np.cumsum(np.where(np.isnan(behind), 0.0, np.nan_to_num(jerk * jerk))) * dt
    return np.clip(along / (size + LAG_KNOWN), 0.0, LAG_MAX)
