"""Estimate velocity and kinematic acceleration of the vehicle from a reference, the wheels and the accelerometer.

The detectors need the velocity only to distinguish a slow wheel from a fast one. They need the kinematic acceleration
as that of a healthy wheel. Neither may follow a wheel that has left the road's speed.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from aqualog.core.compiled import compiled, part, plain
from aqualog.core.records import FloatArray
from aqualog.features.smoothing import gain

__all__ = ["VelocityParams", "VelocityState", "initial_state", "observe", "params_from_seconds"]

_N = 4


class VelocityParams(NamedTuple):
    """Per-sample factors of the observer; made by `params_from_seconds`."""

    dt: float
    k_v: float  # share of the innovation that corrects the velocity
    k_b: float  # the same for the offset between accelerometer and kinematic acceleration [1/s]
    has_accelerometer: bool
    gate_abs: float  # [m/s] innovations beyond gate_abs + gate_rel v are not believed
    gate_rel: float
    tau_radius: float  # [s] time constant of the radius correction
    b_max: float  # [m/s^2] bound of the offset: mounting, drift and grade stay below
    fade: float  # [s] how long the last acceleration lasts in a gap of the accelerometer
    trust: float  # [s] in which a reference that the accelerometer follows is believed against all wheels
    tau_side: float  # [s] in which a drift to the side is forgotten: longer, and the bank of a road adds up


class VelocityState(NamedTuple):
    """State of the observer: v [m/s], b [m/s²], acceleration [m/s²], time without a measurement that is trusted or
    that the wheels do not contradict [s], drift to the left [m/s]."""

    v: float
    b: float
    a: float
    lost: float
    v_y: float
    kappa: FloatArray  # (4,) share by which a wheel's effective radius is larger than the file says
    age: FloatArray  # (4,)


def initial_state() -> VelocityState:
    """Return the state before the first sample."""
    return VelocityState(math.nan, 0.0, 0.0, 0.0, 0.0, np.zeros(_N), np.ones(_N))


def params_from_seconds(dt: float, *, has_accelerometer: bool) -> VelocityParams:
    """Turn tuning in seconds into per-sample factors.

    With an accelerometer its integral gives the short-term motion, and the offset b (mounting, drift, grade) follows in
    about 5 s. Without one b itself is the acceleration and must follow in 0.3 s.
    """
    tau_v, tau_b = (0.25, 5.0) if has_accelerometer else (0.15, 0.3)
    k_v = gain(tau_v, dt)
    return VelocityParams(dt, k_v, k_v / tau_b, has_accelerometer, 0.7, 0.02, 30.0, 3.0, 0.5, 10.0, 2.0)


@part
def _step(p, motion, kappa, age, v_ref, w, weights, a_x, a_y, yaw_rate):  # type: ignore[no-untyped-def]
    """Process one sample: `motion` is (v, b, a, lost, v_y); `kappa`, `age`, `w` are the caller's, changed in place.

    Returns the motion, and velocity and acceleration where a wheel or the reference has a value.
    """
    v, b, a, lost, v_y = motion
    for i in range(_N):
        w[i] = w[i] * (1.0 + kappa[i])
    if not p.has_accelerometer:
        a = -b
    elif not math.isnan(a_x):
        aside = a_y - yaw_rate * v
        v_y += ((0.0 if math.isnan(aside) else aside) - v_y / p.tau_side) * p.dt
        a = a_x - b + (0.0 if math.isnan(yaw_rate) else yaw_rate * v_y)
    else:
        a = a * (1.0 - p.dt / p.fade)  # a gap: the last acceleration fades

    if math.isnan(v):
        v = v_ref if not math.isnan(v_ref) else _median(w)
        if math.isnan(v):
            return (math.nan, b, a, lost, v_y), math.nan, math.nan
        lost = 0.0
    else:
        v = v + a * p.dt

    gate = p.gate_abs + p.gate_rel * abs(v)
    middle = _median(w)
    close = 0.5 * gate
    agreeing = 0
    known = 0.0
    for i in range(_N):
        if not math.isnan(w[i]):
            known += weights[i]
            if abs(w[i] - middle) <= close:
                agreeing += 1
    # a reference cannot spin, but it can fail: three wheels that agree outvote one that is far off, but not at once one
    # where the accelerometer expects it: on water all wheels can be lost
    is_outvoted = agreeing >= 3 and abs(v_ref - middle) > 4.0 * gate
    use_reference = not math.isnan(v_ref) and (not is_outvoted or (abs(v_ref - v) <= gate and lost < p.trust))
    total = 0.0
    error = 0.0
    far = 0.0
    if use_reference:
        error = min(max(v_ref - v, -4.0 * gate), 4.0 * gate)
        total = 1.0
    else:
        for i in range(_N):
            if math.isnan(w[i]):
                continue
            e = w[i] - v
            far += weights[i] * min(max(e, -gate), gate)
            # three wheels that agree outvote a prediction that has gone astray; otherwise the prediction chooses
            if (agreeing >= 3 and abs(w[i] - middle) <= close) or (agreeing < 3 and abs(e) <= gate):
                total += weights[i]
                error += weights[i] * min(max(e, -gate), gate)
    if total > 0.0:
        error /= total
        lost = lost + p.dt if is_outvoted else 0.0
        v += p.k_v * error
        b -= p.k_b * error
        if p.has_accelerometer:
            b = min(max(b, -p.b_max), p.b_max)
    else:
        lost += p.dt
        if known > 0.0:
            v += 0.3 * p.k_v * far / known
        if lost > 2.0:
            v = middle
            lost = 0.0
            if math.isnan(v):
                return (math.nan, b, a, lost, v_y), math.nan, math.nan

    if v > 8.0 and abs(a) < 1.5 and not abs(yaw_rate) > 0.1:
        _learn_radii(p, kappa, age, w, v, use_reference)
    is_seen = known > 0.0 or use_reference
    return (v, b, a, lost, v_y), (v if is_seen else math.nan), (a if is_seen else math.nan)


@part
def _learn_radii(p, kappa, age, w, v, has_reference):  # type: ignore[no-untyped-def]
    """Update the radius corrections while the car rolls steadily."""
    mean = 0.0
    count = 0
    for i in range(_N):
        e = w[i] - v
        if abs(e) < 0.035 * v:
            kappa[i] -= p.dt / age[i] * e / v
            kappa[i] = min(max(kappa[i], -0.03), 0.03)
            age[i] = min(age[i] + p.dt, p.tau_radius)
        if not math.isnan(w[i]):
            mean += kappa[i]
            count += 1
    if not has_reference and count > 0:
        # without a reference only the ratios can be known: their mean must not wander
        for i in range(_N):
            kappa[i] -= mean / count


@part
def _median(w):  # type: ignore[no-untyped-def]
    """Return the median of the known wheels, by how many lie below each: called per sample, so nothing is allocated."""
    n = 0
    for i in range(_N):
        n += not math.isnan(w[i])
    low, high = math.nan, math.nan
    for i in range(_N):
        below = 0
        for j in range(_N):
            below += w[j] < w[i] or (w[j] == w[i] and j < i)
        if not math.isnan(w[i]):
            if below == (n - 1) // 2:
                low = w[i]
            if below == n // 2:
                high = w[i]
    return high if n % 2 else (low + high) / 2


@compiled
def _scan(p, motion, kappa, age, v_ref, v_w, weights, a_x, a_y, yaw_rate):  # type: ignore[no-untyped-def]
    n = v_ref.size
    velocity = np.empty(n)
    acceleration = np.empty(n)
    corrected = np.empty((_N, n))
    w = np.empty(_N)
    for k in range(n):
        for i in range(_N):
            w[i] = v_w[i, k]
        motion, velocity[k], acceleration[k] = _step(
            p, motion, kappa, age, v_ref[k], w, weights, a_x[k], a_y[k], yaw_rate[k]
        )  # fmt: skip
        for i in range(_N):
            corrected[i, k] = w[i]
    return velocity, acceleration, corrected, motion


def observe(
    p: VelocityParams,
    state: VelocityState,
    v_ref: FloatArray,
    v_w: FloatArray,
    a_x: FloatArray,
    a_y: FloatArray,
    yaw_rate: FloatArray,
    *,
    weights: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, VelocityState]:
    """Observe the velocity with bounded trust in every source.

    dv/dt = a_x - b + yaw_rate v_y + (v_m - v) / tau_v, db/dt = -(v_m - v) / (tau_v tau_b), and of a car that slides or
    spins round dv_y/dt = a_y - yaw_rate v - v_y / tau_side. v_m is the reference velocity. Without one
    it is the weighted mean of the wheels that agree: three or more with each other, else those that agree with the
    prediction. A wheel that spins or locks leaves the gate and no longer counts. A reference that three agreeing
    wheels contradict does not count either; one that the accelerometer follows counts for 10 s yet. Where no wheel
    agrees for 2 s the observer restarts.

    A slow correction per wheel (time constant 30 s, within 3 %, updated only while rolling steadily) removes radius
    errors: a reference that differs by 1 % in scale must not look like slip.

    Parameters
    ----------
    state : VelocityState
        Not changed.
    v_ref : array (n,)
        Reference velocity, NaN where missing. [m/s]
    v_w : array (4, n)
        Wheel speeds on the centre line. [m/s]
    a_x : array (n,)
        Accelerometer, specific force; NaN where missing. [m/s²]
    a_y : array (n,)
        The same to the left; where it is missing a drift fades. [m/s²]
    yaw_rate : array (n,)
        NaN where missing. [rad/s]
    weights : array (4,)
        Trust in each wheel; less for driven ones.

    Returns
    -------
    v_x : array (n,)
        Velocity. NaN where neither a reference nor a wheel has a value. [m/s]
    a_kin : array (n,)
        Kinematic acceleration dv_x/dt, free of grade and of the accelerometer's offset (E2). [m/s²]
    v_w : array (4, n)
        Wheel speeds with the radius correction. [m/s]
    state : VelocityState
    """
    kappa, age = state.kappa.copy(), state.age.copy()
    velocity, acceleration, corrected, motion = _scan(
        p, state[:5], kappa, age, *plain(v_ref, v_w, weights, a_x, a_y, yaw_rate)
    )
    return velocity, acceleration, corrected, VelocityState._make((*motion, kappa, age))
