"""Speed programmes: what the driver wants over time, drawn by seed."""

from __future__ import annotations

import numpy as np

__all__ = ["PROGRAMMES", "speed_programme"]

KMH = 1.0 / 3.6
DT = 0.01


def speed_programme(name: str, seed: int, duration_s: float, *, pace: float = 1.0, pull: float = 3.3) -> np.ndarray:
    """Wanted speed (n + 300,) [m/s] at 100 Hz, three seconds longer than the drive; `pace` scales the
    speeds, `pull` [m/s^2] is the most that the car is asked to accelerate."""
    rng = np.random.default_rng([seed, 11])
    n = round(duration_s / DT) + 300
    knots_t, knots_v = [0.0], []
    for v, a, hold in PROGRAMMES[name](rng):
        v *= pace
        if not knots_v:
            knots_v.append(v)
        else:
            ramp = abs(v - knots_v[-1]) / (min(a, pull) if v > knots_v[-1] else a)
            if ramp > 0.0:
                knots_t.append(knots_t[-1] + ramp)
                knots_v.append(v)
        knots_t.append(knots_t[-1] + hold)
        knots_v.append(v)
        if knots_t[-1] > n * DT:
            break
    v = np.interp(np.arange(n) * DT, knots_t, knots_v)
    width = 80  # [samples] jerk of a human foot
    kernel = np.hanning(width + 2)[1:-1]
    padded = np.concatenate([np.full(width, v[0]), v, np.full(width, v[-1])])
    smooth = np.convolve(padded, kernel / kernel.sum(), mode="same")[width:-width]
    return np.maximum(smooth, 0.0)


def _mixed(rng):
    v = rng.uniform(40, 60) * KMH
    yield v, 1.0, rng.uniform(2, 6)
    while True:
        if rng.random() < 0.45:  # town
            for _ in range(rng.integers(3, 6)):
                yield rng.uniform(22, 60) * KMH, rng.uniform(0.8, 1.9), rng.uniform(2, 8)
        else:  # country
            for _ in range(rng.integers(3, 6)):
                yield rng.uniform(60, 105) * KMH, rng.uniform(0.7, 2.0), rng.uniform(4, 12)


def _motorway(rng):
    v = rng.uniform(108, 128) * KMH
    yield v, 1.0, rng.uniform(15, 30)
    while True:
        yield rng.uniform(98, 136) * KMH, rng.uniform(0.25, 0.7), rng.uniform(12, 40)


def _handling(rng):
    yield rng.uniform(45, 60) * KMH, 1.0, 2.0
    while True:
        yield rng.uniform(80, 115) * KMH, rng.uniform(2.4, 3.3), rng.uniform(0.5, 3)
        yield rng.uniform(38, 62) * KMH, rng.uniform(3.0, 4.0), rng.uniform(0.5, 2.5)


def _stop_and_go(rng):
    yield rng.uniform(10, 20) * KMH, 1.0, 2.0
    while True:
        if rng.random() < 0.55:
            yield 0.0, rng.uniform(1.0, 2.2), rng.uniform(3, 7)
        for _ in range(rng.integers(1, 4)):
            yield rng.uniform(8, 45) * KMH, rng.uniform(0.8, 2.2), rng.uniform(2, 8)


def _wet(rng):
    yield rng.uniform(65, 80) * KMH, 1.0, rng.uniform(4, 8)
    while True:
        yield rng.uniform(60, 110) * KMH, rng.uniform(0.5, 1.6), rng.uniform(5, 14)


PROGRAMMES = {
    "mixed": _mixed, "hilly": _mixed, "motorway": _motorway, "handling": _handling, "stop_and_go": _stop_and_go,
    "wet": _wet,
}  # fmt: skip
"""Generators of (speed [m/s], acceleration to it [m/s^2], how long it is held [s])."""
