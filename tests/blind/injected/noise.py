"""Noise cut out of measured drives, for drives of a simulator: a world with real noise.

What is noise in a measured signal is what a second signal or its own neighbourhood does not show:

| signal | less | window |
|---|---|---|
| accelerometer, without its lag | derivative of the velocity (a parabola over 0.7 s) | mean over 4 s taken off |
| wheel speed | the wheels' mean, yaw rate, accelerations (least squares) | 4 s |
| velocity | the wheels' mean; without wheels its own mean over 0.7 s | 4 s |
| torque, yaw rate, steering | own mean over 0.7 s | 4 s |
| lateral accelerometer | velocity times yaw rate (least squares) | 4 s |

Samples beyond six robust standard deviations, such as steps of the pedal, are cut to them. What is slower than four seconds
(slopes of the road, drifts) stays out, since in a null it would be an effect; so does hard driving (2 m/s² and more). The signals of a source come from the same
moment, so noise that they share is kept. Torque alone is of another one: what a pedal does within 0.7 s is motion. The accelerometer
shows it, but the wheels, whose mean is taken off, do not, as if their forces built up slowly. An accelerometer that comes late would leave its delay times the jerk, together with the jerk in the other
signals: a delay that is there, and no noise. So the derivative is taken as late as the accelerometer follows it best. A piece that is too short goes on backwards; between samples runs a line, so that a
10 Hz source has no noise above 5 Hz.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aqualog.core.records import FloatArray
from tests.blind.injected.drives import TRIPS, WHEELS, Drive, filled, measured
from tests.blind.injected.physics import speed

__all__ = ["SOURCES", "Noise", "added", "noise_of", "noise_source"]

SOURCES = tuple(TRIPS)
_OTHERS = {"bmw": ("porsche", "rav4"), "porsche": ("rav4", "bmw"), "rav4": ("porsche", "bmw")}
_LONG_S, _SHORT_S, _PIECE_S, _V_LEAST, _CALM, _MOST = 4.0, 0.7, 2.0, 5.0, 2.0, 6.0
_LATEST_S, _ALIKE = 0.5, 0.5
_LIKE = {"torque_fl": "torque_f", "torque_fr": "torque_f", "torque_rl": "torque_r", "torque_rr": "torque_r"}


class Noise(NamedTuple):
    """Noise by signal at a constant step, of one moving part of a drive."""

    source: str
    dt: float
    columns: Mapping[str, FloatArray]


def noise_of(drive: Drive) -> Noise:
    """The noise of a drive's signals where it moves calmly, pieces of two seconds and more put one behind the other."""
    c = {n: filled(x) for n, x in drive.columns.items() if n != "t"}
    calm = _calm(drive, c)
    dt, out = drive.dt, {}
    wheels = [c[f"omega_{w}"] for w in WHEELS] if "omega_fl" in c else []
    mean = np.mean(wheels, axis=0) if wheels else None
    motion = [c[n] for n in ("yaw_rate", "a_x", "a_y") if n in c]
    for name, x in c.items():
        if name == "a_x":
            slope = _derivative(c["v_x"] if mean is None else mean * drive.vehicle.r_e("fl"), dt)
            rest = x - _as_late(slope, x, calm, dt)
        elif name.startswith("omega_") and mean is not None:
            rest = _unexplained(x, [mean, *motion])
        elif name == "v_x" and mean is not None:
            rest = _unexplained(x, [mean])
        elif name == "a_y" and "yaw_rate" in c:
            rest = _unexplained(x, [c["v_x"] * c["yaw_rate"], c["yaw_rate"]])
        else:
            rest = x - _mean(x, _SHORT_S, dt)
        out[name] = _cut((rest - _mean(rest, _LONG_S, dt))[calm])
    return Noise(drive.car, dt, out)


def _as_late(x: FloatArray, as_x: FloatArray, calm: NDArray[np.bool_], dt: float) -> FloatArray:
    """A smooth signal with the lag, up to half a second, at which another one follows it; as it is where none does."""
    at, other = np.arange(x.size), (as_x - _mean(as_x, _LONG_S, dt))[calm]
    shifted = [np.interp(at - lag / dt, at, x) for lag in np.arange(-_LATEST_S, _LATEST_S + 0.005, 0.01)]
    likes = [float(np.corrcoef((s - _mean(s, _LONG_S, dt))[calm], other)[0, 1]) for s in shifted]
    best = int(np.argmax(likes))
    return shifted[best] if likes[best] > _ALIKE else x


def _calm(drive: Drive, c: Mapping[str, FloatArray]) -> NDArray[np.bool_]:
    """Samples in motion without hard braking, pulling or cornering: there slip and pitch are no noise."""
    calm = speed(drive) > _V_LEAST
    for name in ("a_x", "a_y"):
        if name in c:
            calm &= np.abs(_mean(c[name] - np.median(c[name]), _SHORT_S, drive.dt)) < _CALM
    edges = np.flatnonzero(np.diff(np.concatenate([[0], calm.astype(int), [0]])))
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        if (end - begin) * drive.dt < _PIECE_S:
            calm[begin:end] = False
    return calm


def noise_source(source: str, folder: Path, seed: int) -> list[Noise]:
    """Noise of a car, and of the others for signals that it has not; of the BMW a trip drawn by seed."""
    out = []
    for car in (source, *_OTHERS[source]):
        trips = TRIPS[car]
        out.append(noise_of(measured(car, trips[seed % len(trips)], folder)))
    return out


def added(
    columns: Mapping[str, FloatArray], noises: Sequence[Noise], dt: float, rng: np.random.Generator
) -> dict[str, FloatArray]:
    """Signals (n,) at the step `dt` with noise: each of the first source that has it."""
    n = len(next(iter(columns.values())))
    motion, torque = ([int(rng.integers(len(next(iter(x.columns.values()))))) for x in noises] for _ in range(2))
    out = dict(columns)
    for name, x in columns.items():
        for noise, start in zip(noises, torque if name.startswith("torque") else motion, strict=True):
            like = name if name in noise.columns else _LIKE.get(name, "")
            if like in noise.columns:
                share = 0.5 if like != name else 1.0  # of an axle's torque
                out[name] = x + share * _piece(noise.columns[like], start, n, dt / noise.dt)
                break
    return out


def _piece(x: FloatArray, start: int, n: int, step: float) -> FloatArray:
    """`n` values `step` samples apart from `start` on, to and fro."""
    last = x.size - 1
    at = np.mod(start + np.arange(n) * step, 2.0 * last)
    return np.interp(np.where(at > last, 2.0 * last - at, at), np.arange(x.size), x)


def _mean(x: FloatArray, over_s: float, dt: float) -> FloatArray:
    k = max(round(0.5 * over_s / dt), 1)
    window = np.hanning(2 * k + 3)[1:-1]
    return np.convolve(np.pad(x, k, mode="reflect"), window / window.sum(), "valid")


def _derivative(v: FloatArray, dt: float) -> FloatArray:
    from scipy.signal import savgol_filter

    n = 2 * max(round(0.5 * _SHORT_S / dt), 2) + 1
    slope: FloatArray = savgol_filter(v, n, 2, deriv=1, delta=dt)
    return slope


def _unexplained(x: FloatArray, by: Sequence[FloatArray]) -> FloatArray:
    columns = np.column_stack([np.ones(x.size), *by])
    return x - columns @ np.linalg.lstsq(columns, x, rcond=None)[0]


def _cut(x: FloatArray) -> FloatArray:
    most = _MOST * 1.4826 * float(np.median(np.abs(x)))
    return np.clip(x, -most, most) if most > 0.0 else x
