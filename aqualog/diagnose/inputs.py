"""Inputs of the simulation without their sensors' noise.

What drives the simulation is compared with nothing, but its noise would be on both sides: in the residual, and in what
an effect would take away from it. A regression then finds effects in noise.
"""

from __future__ import annotations

import numpy as np

from aqualog.types import BoolArray, FloatArray

__all__ = ["SPEED_S", "quiet", "quiet_speed", "quiet_torque", "smooth"]

NOISE_BAND_HZ = 3.0  # above, a drive torque is noise
SPEED_BAND_HZ = (2.0, 4.5)  # there a speed is noise: 0.1 m/s^2 are below 8 mm/s; beyond, slow buses are interpolated
SPEED_S = 1.0  # [s] over which a measured speed is averaged: its noise must not pass for motion
NOT_TORQUE = 15.0  # [N m] rms of a difference that is a sensor's, not the car's
NOT_TORQUE_SHARE = 0.05  # of the rms of all wheels
LOCAL = 9  # frequencies over which a spectrum is smoothed


def smooth(x: FloatArray, dt: float, over: float) -> FloatArray:
    """Mean with a raised cosine over some time, centred: it has no delay."""
    k = round(over / dt) | 1
    if k < 3:
        return x
    window = np.hanning(k + 2)[1:-1]
    return np.convolve(np.pad(x, k // 2, mode="edge"), window / window.sum(), "valid")


def quiet(x: FloatArray, dt: float) -> FloatArray:
    """A signal by Wiener's filter: each frequency by the share of it that stands out of the white noise.

    The noise is what the signal has above 3 Hz; a signal that is not sampled fast enough to tell stays as it is. Zero
    phase: nothing is delayed. (n,) to (n,)
    """
    frequency = np.fft.rfftfreq(2 * x.size, dt)
    high = frequency > NOISE_BAND_HZ
    if high.sum() < 0.3 * high.size:
        return x
    return _filtered(x, high)


def quiet_speed(v: FloatArray, dt: float) -> FloatArray:
    """A speed without its noise, by Wiener's filter and a mean over a second; it has no delay. (n,) to (n,) [m/s]

    At a constant speed what is left of the noise after a mean would be all of the motion: led along it, the car shows
    it again, and a shift of it finds itself.
    """
    frequency = np.fft.rfftfreq(2 * v.size, dt)
    band = (frequency > SPEED_BAND_HZ[0]) & (frequency < SPEED_BAND_HZ[1])
    return smooth(_filtered(v, band) if band.sum() > LOCAL else v, dt, SPEED_S)


def _filtered(x: FloatArray, band: BoolArray) -> FloatArray:
    """The signal by the share of each frequency that stands out of the noise that the band shows."""
    n = x.size
    line = np.linspace(x[0], x[-1], n)
    # mirrored, so that the ends meet
    f = np.fft.rfft(np.concatenate([x - line, -(x - line)[::-1]]))
    power = np.abs(f) ** 2
    noise = float(np.median(power[band])) / np.log(2.0)
    local = np.convolve(np.pad(power, LOCAL // 2, mode="edge"), np.full(LOCAL, 1.0 / LOCAL), "valid")
    share = np.maximum(1.0 - 2.0 * noise / np.maximum(local, 1e-300), 0.0)
    return np.asarray(line + np.fft.irfft(f * share, 2 * n)[:n])


def quiet_torque(torque: FloatArray, dt: float) -> FloatArray:
    """Wheel torques (4, n) [N m] without noise.

    Left and right of an axle get its mean, unless they differ by more than sensors do; an axle without torque gets its
    mean over the drive; the axle with most of it never does.
    """
    out = np.empty_like(torque)
    total = float(np.sqrt((torque.sum(axis=0) ** 2).mean()))
    least = max(NOT_TORQUE, NOT_TORQUE_SHARE * total)
    driven = 0 if float((torque[:2].sum(axis=0) ** 2).mean()) > float((torque[2:].sum(axis=0) ** 2).mean()) else 2
    for a, b in ((0, 1), (2, 3)):
        both, half = torque[a] + torque[b], 0.5 * (torque[a] - torque[b])
        axle = quiet(both, dt) if a == driven or float(both.std()) > NOT_TORQUE else np.full_like(both, both.mean())
        apart = quiet(half, dt) if float(np.sqrt((half**2).mean())) > least else np.zeros_like(half)
        out[a], out[b] = 0.5 * axle + apart, 0.5 * axle - apart
    return out
