"""Ways to damage a file, each with its number so that it can be made again."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from tests.damaged.bombs import bombs_of

HUGE = (2**31 - 1, 2**32 - 1, 2**40, 2**62)


class Damage(NamedTuple):
    """What is done; `touched` bytes of the file are not what they were (0: unknown, more than a few)."""

    fault: str
    number: int
    touched: int
    make: Callable[[bytes], bytes]


def _at(data: bytes, number: int, size: int = 1) -> int:
    return int(np.random.default_rng(number).integers(0, max(1, len(data) - size)))


def cut(number: int, share: float) -> Damage:
    return Damage("cut", number, 0, lambda data: data[: max(1, min(len(data) - 3, round(share * len(data))))])


def flip(number: int, count: int = 1) -> Damage:
    def make(data: bytes) -> bytes:
        rng, out = np.random.default_rng(number), bytearray(data)
        for at in rng.integers(0, len(data), count):
            out[at] ^= 1 << int(rng.integers(0, 8))
        return bytes(out)

    return Damage("flipped", number, count, make)


def zero(number: int, size: int = 512) -> Damage:
    def make(data: bytes) -> bytes:
        at = _at(data, number, size)
        return data[:at] + bytes(len(data[at : at + size])) + data[at + size :]

    return Damage("zeroed", number, size, make)


def swap(number: int, size: int = 256) -> Damage:
    def make(data: bytes) -> bytes:
        a, b = sorted(int(x) for x in np.random.default_rng(number).integers(0, len(data) - 2 * size, 2))
        b = max(b, a + size)
        return data[:a] + data[b : b + size] + data[a + size : b] + data[a : a + size] + data[b + size :]

    return Damage("swapped", number, 2 * size, make)


def lie(number: int) -> Damage:
    """A number that may be a size or an address says something else."""

    def make(data: bytes) -> bytes:
        words = np.frombuffer(data[: len(data) // 4 * 4], dtype="<u4")
        likely = np.flatnonzero((words > 0) & (words <= len(data)))
        rng = np.random.default_rng(number)
        at = 4 * int(rng.choice(likely)) if likely.size else 0
        wide = 8 if data[at + 4 : at + 8] == bytes(4) else 4
        value = HUGE[number % 4] if wide == 8 else HUGE[number % 2]
        return data[:at] + value.to_bytes(wide, "little") + data[at + wide :]

    return Damage("lying size", number, 8, make)


def drop(number: int, size: int = 100) -> Damage:
    def make(data: bytes) -> bytes:
        at = _at(data, number, size)
        return data[:at] + data[at + size :]

    return Damage("bytes missing", number, 0, make)


def double(number: int, size: int = 1000) -> Damage:
    def make(data: bytes) -> bytes:
        at = _at(data, number, size)
        return data[: at + size] + data[at:]

    return Damage("bytes twice", number, 0, make)


def tail(number: int) -> Damage:
    return Damage("garbage behind", number, 0, lambda data: data + np.random.default_rng(number).bytes(777))


def bombs(name: str) -> tuple[Damage, ...]:
    """Of a format: small files that unpack to more than they say, and that say more than there can be."""
    return tuple(Damage("bomb", k, 0, make) for k, make in enumerate(bombs_of(name)))


DAMAGES: tuple[Damage, ...] = (
    *(cut(k, share) for k, share in enumerate((0.0, 0.02, 0.3, 0.6, 0.9, 1.0))),
    *(flip(k) for k in range(10)),
    *(flip(k, 20) for k in range(10, 13)),
    *(zero(k) for k in range(3)),
    *(swap(k) for k in range(3)),
    *(lie(k) for k in range(6)),
    *(drop(k) for k in range(2)),
    double(0),
    tail(0),
)

DAMAGED_EACH = len(DAMAGES) + 2
"""Damaged logs of a format: every damage, and two bombs."""
