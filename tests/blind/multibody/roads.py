"""Speed programmes, roads and bends, drawn by seed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

__all__ = ["PROGRAMMES", "Place", "bends", "build_road", "speeds"]

DT = 0.01
LATERAL = {"city": 1.6, "country": 2.0, "motorway": 0.6, "staircase": 0.8, "coast_down": 0.4, "wet": 0.6}  # [m/s^2]


class Place(NamedTuple):
    """What belongs to the road: grade [rad], rolling of it [rad] with a length [m], water of each side over its label."""

    grade: float = 0.0
    rolling: float = 0.0
    length: float = 900.0
    depth_left: float = 1.0
    depth_right: float = 1.0


Leg = tuple[float, float, float, bool]  # speed [km/h], acceleration towards it, time at it [s], both feet off


def _city(rng: np.random.Generator) -> Iterator[Leg]:
    yield rng.uniform(15, 35), 1.0, 3.0, False
    while True:
        for _ in range(rng.integers(2, 5)):
            yield rng.uniform(18, 58), rng.uniform(1.0, 2.4), rng.uniform(2, 9), False
        if rng.random() < 0.6:
            yield 0.0, rng.uniform(1.2, 2.6), rng.uniform(2, 8), False


def _country(rng: np.random.Generator) -> Iterator[Leg]:
    yield rng.uniform(55, 75), 1.0, 4.0, False
    while True:
        yield rng.uniform(45, 75), rng.uniform(0.8, 2.6), rng.uniform(2, 8), False
        yield rng.uniform(80, 112), rng.uniform(0.8, 2.4), rng.uniform(3, 12), False


def _motorway(rng: np.random.Generator) -> Iterator[Leg]:
    yield rng.uniform(100, 125), 1.0, 10.0, False
    while True:
        yield rng.uniform(88, 138), rng.uniform(0.3, 1.0), rng.uniform(8, 30), False


def _staircase(rng: np.random.Generator) -> Iterator[Leg]:
    yield 20.0, 1.0, 4.0, False
    while True:
        top = rng.uniform(100, 130)
        for v in np.arange(35.0, top, 15.0):
            yield float(v), rng.uniform(1.2, 2.2), rng.uniform(4, 8), False
        for v in np.arange(top - 20.0, 25.0, -rng.uniform(18, 28)):
            yield float(v), rng.uniform(1.5, 3.0), rng.uniform(3, 6), False


def _coast_down(rng: np.random.Generator) -> Iterator[Leg]:
    yield rng.uniform(40, 60), 1.0, 4.0, False
    while True:
        yield rng.uniform(90, 128), rng.uniform(1.4, 2.6), rng.uniform(2, 5), False
        yield 0.0, 0.0, rng.uniform(18, 38), True
        if rng.random() < 0.6:
            yield rng.uniform(30, 60), rng.uniform(1.0, 3.0), rng.uniform(3, 6), False


def _wet(rng: np.random.Generator) -> Iterator[Leg]:
    yield rng.uniform(60, 80), 1.0, 5.0, False
    while True:
        yield rng.uniform(58, 112), rng.uniform(0.6, 1.6), rng.uniform(5, 12), False


PROGRAMMES = {
    "city": _city, "country": _country, "motorway": _motorway, "staircase": _staircase, "coast_down": _coast_down,
    "wet": _wet,
}  # fmt: skip


def speeds(programme: str, rng: np.random.Generator, duration_s: float, pull: float) -> tuple[np.ndarray, np.ndarray]:
    """Wanted speed [m/s] and whether the car coasts, (n + 200,); `pull` [m/s^2] is the most that the car can."""
    n = round(duration_s / DT) + 200
    v, off = np.zeros(n), np.zeros(n)
    k, now = 0, -1.0
    for aim, a, hold, coasts in PROGRAMMES[programme](rng):
        if k >= n:
            break
        aim = aim / 3.6
        if coasts:
            count = round(hold / DT)
            free = now * np.exp(-np.arange(count) * DT / 90.0)  # about what a car does; nobody steers by it
            part, flags = free[: n - k], 1.0
        else:
            begin = aim if now < 0.0 else now
            ramp = round(abs(aim - begin) / min(a, pull if aim > begin else 9.0) / DT)
            part = np.concatenate([np.linspace(begin, aim, ramp), np.full(round(hold / DT), aim)])[: n - k]
            flags = 0.0
        v[k : k + part.size], off[k : k + part.size] = part, flags
        k += part.size
        now = float(part[-1]) if part.size else now
    for width in (31, 51):  # twice a box: a foot has a bounded jerk
        padded = np.concatenate([np.full(width, v[0]), v, np.full(width, v[-1])])
        v = np.convolve(padded, np.full(width, 1.0 / width), mode="same")[width:-width]
    return np.maximum(v, 0.0), off


def bends(programme: str, rng: np.random.Generator, n: int) -> np.ndarray:
    """Wanted lateral acceleration (n,) [m/s^2]: bends of 2 to 8 s with straights between them."""
    x = np.zeros(n)
    k = round(rng.uniform(1.0, 5.0) / DT)
    while k < n:
        length = round(rng.uniform(2.0, 8.0) / DT)
        bend = np.sin(np.linspace(0.0, np.pi, length)) ** 1.5
        x[k : k + length] = (rng.uniform(0.3, 1.0) * rng.choice([-1.0, 1.0]) * LATERAL[programme] * bend)[: n - k]
        k += length + round(rng.uniform(1.0, 9.0) / DT)
    return x


def build_road(
    programme: str, rng: np.random.Generator, length: float, place: Place
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Uneven road (m, 2) every 0.1 m [m]; grade, bank, films (k, 4) every metre; labels of the films (k, 2)."""
    fine = _uneven(rng, round(length / 0.1))
    k = round(length)
    slow = np.zeros((k, 4))
    slow[:, 0] = place.grade + 1.5e-4 * _field(rng, k, 250.0)
    slow[:, 1] = 2e-3 * _field(rng, k, 150.0)
    waves = np.random.default_rng(rng.integers(2**32))
    if place.rolling > 0.0:
        slow[:, 0] += place.rolling * _hills(waves, k, place.length)
    label = np.zeros((k, 2))
    if programme == "wet":
        label = _pools(rng, k)
        for side, gain in enumerate((place.depth_left, place.depth_right)):
            slow[:, 2 + side] = label[:, side] * gain
    return fine, slow, label


def _uneven(rng: np.random.Generator, m: int) -> np.ndarray:
    """Two tracks of an even road, ISO 8608 class A: the tracks share what is longer than they lie apart."""
    ds, G_0 = 0.1, rng.uniform(1.5e-6, 6e-6)  # [m^3] at 0.1 1/m
    size = 2.0 * np.pi * 0.1 * np.sqrt(G_0 * ds / 2.0)
    out = np.zeros((m, 2))
    both = _walk(rng, m, size, 40.0)
    for side in (0, 1):
        out[:, side] = np.sqrt(0.7) * both + np.sqrt(0.3) * _walk(rng, m, size, 5.0)
        out[:, side] = np.convolve(out[:, side], [0.25, 0.5, 0.25], mode="same")  # the length of the contact
    ramp = np.clip(np.arange(m) * ds / 20.0 - 0.5, 0.0, 1.0)  # the car starts at rest on its springs
    return out * ramp[:, None]


def _walk(rng: np.random.Generator, m: int, size: float, length: float) -> np.ndarray:
    return lfilter([size], [1.0, -np.exp(-0.1 / length)], rng.standard_normal(m))


def _field(rng: np.random.Generator, k: int, length: float) -> np.ndarray:
    keep = np.exp(-1.0 / length)
    x = lfilter([1.0 - keep], [1.0, -keep], lfilter([1.0 - keep], [1.0, -keep], rng.standard_normal(k + 2000)))[2000:]
    return x * (2.0 * np.sqrt(length))  # of variance about one, whatever the length of the road


def _hills(rng: np.random.Generator, k: int, length: float) -> np.ndarray:
    s = np.arange(k)
    x = sum(np.sin(2.0 * np.pi * (s / (length * rng.uniform(0.5, 2.0)) + rng.random())) for _ in range(6))
    return x / np.sqrt(3.0)


def _pools(rng: np.random.Generator, k: int) -> np.ndarray:
    label = np.zeros((k, 2))
    x = rng.integers(150, 260)
    while x < k:
        length, depth = rng.integers(90, 230), rng.uniform(0.5e-3, 2.4e-3)
        label[x : x + length] = depth * np.array([rng.uniform(0.7, 1.0), 1.0])
        x += length + rng.integers(130, 340)
    return label
