"""Noise of the sensors, one class a drive: its colour, its outliers, its steps, its gaps, and gusts of wind."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

__all__ = ["NOISES", "Level", "coloured", "gaps", "gust_series", "levels", "of_level", "outliers", "quantised"]

NOISES = ("white", "ou01", "ou1", "ou5", "mix", "pink", "quantised", "student", "gusts", "gaps")
DT = 0.01

_STEP = {
    "a_x": 0.03125,
    "a_y": 0.03125,
    "yaw_rate": 1e-3,
    "steer_angle": 2e-4,
    "omega": 0.0066,
    "torque": 4.0,
    "v_x": 0.01,
}
_HOLD = {"a_x": 2, "a_y": 2, "yaw_rate": 2, "steer_angle": 2, "omega": 2, "torque": 3, "v_x": 5}  # [samples]


class Level(NamedTuple):
    """Rms of a signal's noise, and the share of its variance that has the drive's colour; the rest is white."""

    rms: float
    share: float


def levels(rng: np.random.Generator) -> dict[str, Level]:
    """Sizes of series sensors, drawn for a drive."""
    wheel, speed = rng.uniform(0.02, 0.05), rng.uniform(0.02, 0.05)
    return {
        "a_x": Level(0.05, 1.0), "a_y": Level(0.05, 1.0), "yaw_rate": Level(2e-3, 0.3), "steer_angle": Level(5e-4, 0.3),
        "omega": Level(wheel, 0.25), "torque": Level(3.0, 0.5), "torque_share": Level(0.01, 0.5), "v_x": Level(speed, 0.25),
    }  # fmt: skip


def coloured(kind: str, n: int, rng: np.random.Generator) -> np.ndarray:
    """Series (n,) of unit variance of a class."""
    if kind in ("ou01", "ou1", "ou5"):
        return _ou(n, {"ou01": 0.1, "ou1": 1.0, "ou5": 5.0}[kind], rng)
    if kind == "mix":
        return np.sqrt(0.5) * (rng.standard_normal(n) + _ou(n, 2.0, rng))
    if kind == "pink":
        f = np.fft.rfftfreq(n)
        spectrum = rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size)
        spectrum[0] = 0.0
        spectrum[1:] /= np.sqrt(f[1:])
        x = np.fft.irfft(spectrum, n)
        return x / x.std()
    if kind == "student":
        return rng.standard_t(3.0, n) / np.sqrt(3.0)
    return rng.standard_normal(n)


def of_level(kind: str, level: Level, n: int, rng: np.random.Generator) -> np.ndarray:
    """Noise (n,) of a signal."""
    white = rng.standard_normal(n)
    return level.rms * (np.sqrt(1.0 - level.share) * white + np.sqrt(level.share) * coloured(kind, n, rng))


def gust_series(kind: str, n: int, rng: np.random.Generator) -> np.ndarray:
    """Wind along the road (n,) [m/s], against the car positive, mean nought: calm but for the class `gusts`."""
    return 1.8 * _ou(n, 4.0, rng) if kind == "gusts" else np.zeros(n)


def outliers(x: np.ndarray, level: float, rng: np.random.Generator) -> np.ndarray:
    """Bursts of wrong samples, a dozen in five minutes, eight to twenty times the noise."""
    x = x.copy()
    for _ in range(rng.poisson(12.0 * x.size * DT / 300.0)):
        at, length = rng.integers(x.size), rng.integers(1, 30)
        x[at : at + length] += level * rng.uniform(8.0, 20.0) * rng.choice([-1.0, 1.0])
    return x


def quantised(name: str, x: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """Steps of the bus, held at its rate: one value of `x` and of its noise (n,) at a time.

    The held value is that of the middle of its time, as if the log had made up for the latency.
    """
    stem = name.split("_")[0] if name.startswith(("omega", "torque")) else name
    hold, step = _HOLD[stem], _STEP[stem]
    n = x.size
    middle = np.minimum(np.arange(0, n, hold) + (hold - 1) / 2.0, n - 1.0)
    value = np.interp(middle, np.arange(n), x) + noise[::hold]
    return np.repeat(np.rint(value / step) * step, hold)[:n]


def gaps(names: tuple[str, ...], n: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Missing samples by signal, True where there is none: of one signal, of one box, of all; about 3 %."""
    missing = {name: np.zeros(n, dtype=bool) for name in names}
    for _ in range(max(rng.poisson(30.0 * n * DT / 300.0), 1)):
        kind = rng.random()
        if kind < 0.5:
            of = [rng.choice(names)]
        elif kind < 0.9:
            stem = rng.choice(["omega", "torque", "a_", "v_x"])
            of = [s for s in names if s.startswith(stem)]
        else:
            of = list(names)
        at, length = rng.integers(n), int(rng.lognormal(4.0, 1.1)) + 1
        for name in of:
            missing[name][at : at + min(length, 600)] = True
    for name in names:  # single samples that the bus has lost
        missing[name] |= rng.random(n) < 0.002
    return missing


def _ou(n, tau, rng):
    keep = np.exp(-DT / tau)
    e = np.sqrt(1.0 - keep * keep) * rng.standard_normal(n)
    e[0] = rng.standard_normal()
    return lfilter([1.0], [1.0, -keep], e)
