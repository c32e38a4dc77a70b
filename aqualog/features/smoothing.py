"""First-order low-pass and its derivative, as recursions.

Both are tuned by a time constant in seconds, so that they behave alike at any sample rate.
"""

from __future__ import annotations

import math

import numpy as np

from aqualog.core.compiled import compiled, plain
from aqualog.core.records import FloatArray

__all__ = ["UNSET", "derivative", "earlier", "fading_lowpass", "gain", "lowpass"]

UNSET = math.nan  # state before the first sample


def gain(tau: float, dt: float) -> float:
    """Share of a new sample in a first-order low-pass, 1 - exp(-dt / tau); 1 for tau = 0. [s, s]"""
    return 1.0 if tau <= 0.0 else -math.expm1(-dt / tau)


@compiled
def _lowpass(k, y, x):  # type: ignore[no-untyped-def]
    out = np.empty_like(x)
    for i in range(x.size):
        if math.isnan(x[i]):
            out[i] = math.nan
            continue
        y = x[i] if math.isnan(y) else y + k * (x[i] - y)
        out[i] = y
    return out, y


@compiled
def _fading(k, keep, y, x):  # type: ignore[no-untyped-def]
    out = np.empty_like(x)
    for i in range(x.size):
        y = y * keep if math.isnan(x[i]) else y + k * (x[i] - y)
        out[i] = y
    return out, y


@compiled
def _derivative(k, dt, y, x):  # type: ignore[no-untyped-def]
    out = np.empty_like(x)
    for i in range(x.size):
        if math.isnan(x[i]):
            # a value held over a gap would show the whole gap's change as one step
            y = math.nan
            out[i] = math.nan
        elif math.isnan(y):
            y = x[i]
            out[i] = math.nan
        else:
            step = k * (x[i] - y)
            y = y + step
            out[i] = step / dt
    return out, y


def lowpass(x: FloatArray, state: float, *, tau: float, dt: float) -> tuple[FloatArray, float]:
    """Low-pass y += (1 - exp(-dt / tau)) (x - y) of an input (n,), starting at the first sample.

    NaN: state held, output NaN. `state`: `UNSET`, or the return value of the call before; `tau` time constant, `dt`
    sample time [s]. Returns y (n,) and the state.
    """
    y, last = _lowpass(gain(tau, dt), state, *plain(np.asarray(x, np.float64)))
    return y, last


def fading_lowpass(x: FloatArray, state: float, *, tau: float, fade: float, dt: float) -> tuple[FloatArray, float]:
    """Low-pass of an input (n,) that bridges gaps: the last value fades to zero with the time constant `fade`. [s]

    `state`: 0, or the return value of the call before; `tau`, `dt` [s]. Returns y (n,), never NaN, and the state.

    For corrections whose loss must not hide the corrected signal: a lost yaw rate must not blind the wheel detectors.
    """
    y, last = _fading(gain(tau, dt), math.exp(-dt / fade), state, *plain(np.asarray(x, np.float64)))
    return y, last


def derivative(x: FloatArray, state: float, *, tau: float, dt: float) -> tuple[FloatArray, float]:
    """Time derivative (n,) [unit of x / s] of the low-passed input (n,), and the state.

    NaN: restarts after the gap; the first sample and the first after a gap give NaN. `state`: `UNSET`, or the return
    value of the call before; `tau` time constant, 0 for the backward difference, `dt` sample time [s].

    A plain difference of 10 ms samples of a wheel speed carries 1 m/s² rms of tooth noise, and five times that at
    500 Hz; the time constant makes it one quantity.
    """
    y, last = _derivative(gain(tau, dt), dt, state, *plain(np.asarray(x, np.float64)))
    return y, last


def earlier(x: FloatArray, lag: float, dt: float) -> FloatArray:
    """Shift a signal that is late by `lag` [s] back; linear between its samples, NaN beyond its ends."""
    if lag == 0.0:
        return x
    k = np.arange(x.size, dtype=np.float64)
    moved: FloatArray = np.interp(k + lag / dt, k, x, left=math.nan, right=math.nan)
    return moved
