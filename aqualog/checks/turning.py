"""Scale of the turning: a yaw rate in the wrong unit against the course, the wheels' differences and a_y over v."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from aqualog.checks.doubts import Change, Doubt
from aqualog.checks.relations import BLOCK_S, LEAST_BLOCKS, changes, relate
from aqualog.checks.signs import LATERAL, named, witnesses
from aqualog.checks.windows import Windows
from aqualog.core.records import FloatArray
from aqualog.physics.load import G

__all__ = ["turning_scale_doubts"]

LEAST_CORRELATION = 0.6  # from which two signals of one quantity show their ratio
LEAST_OF_WHEELS = 0.8  # of the wheels' differences: radii, slip and steering angle are in them
RATIO = 3.0  # of turnings: banks, roll and slow front wheels make less; deg/s makes 57, rpm 9.5, g 9.8
ALIKE = 1.6  # between the factors that two witnesses give
_OTHERS = {
    "yaw_rate": ("course", "rear", "front", "a_y"),
    "a_y": ("course", "rear", "front", "yaw_rate"),
}  # fmt: skip
"""Signals that are judged, and by what, the surest first."""
SHORT_BLOCKS = 4  # of 2.5 s: on a drive shorter than 30 s a unit must explain the factor
_DEGREE = math.pi / 180.0
_UNITS = {
    "yaw_rate": {_DEGREE: "deg/s read as rad/s", 1.0 / _DEGREE: "rad/s read as deg/s"},
    "a_y": {1.0 / G: "m/s² read as g"},
}
"""Factors on a signal that a mistaken unit explains; banks make a_y as small as g read as m/s² does."""
_NEAR = 1.4  # about such a factor: banks, bends and noise change it


def turning_scale_doubts(windows: Windows, *, are_speeds_right: bool) -> Iterator[Doubt]:
    """Yield a yaw rate or a lateral acceleration that is many times too large or too small for the other witnesses.

    A wrong speed counts in the wheels' differences and in a_y, not in the course.
    """
    speed = windows.speed
    if not speed.size:
        return
    found = witnesses(windows, speed, on_banks=True)
    if not are_speeds_right:
        found = {n: x for n, x in found.items() if n in ("yaw_rate", "course")}
    seen = {n: changes(x, windows.step_s) for n, x in found.items()}
    factors = {s: _factors(s, seen, windows.step_s) for s in _OTHERS if s in seen}
    # a yaw rate of many times its size is left out in all bends: its level is what is left
    levels = {n: x - np.mean(x[np.isfinite(x)]) for n, x in found.items() if np.isfinite(x).any()}
    factors = {s: f or _factors(s, levels, windows.step_s) for s, f in factors.items() if s in levels}
    long = {s for s in factors if np.isfinite(seen[s]).sum() * windows.step_s >= LEAST_BLOCKS * BLOCK_S} - {"a_y"}
    off = {s: f for s, f in factors.items() if _is_agreed(f) and (_unit(s, f)[1] or (s in long and set(f) - {"a_y"}))}
    for symbol, own in list(off.items())[:1]:  # yaw rate against a_y alone: the unit of one of them explains it
        yield _doubt(symbol, own)


def _factors(symbol: str, seen: Mapping[str, FloatArray], step_s: float) -> dict[str, float]:
    """Return by witness what a signal must be multiplied by; 1 where noise may explain the difference."""
    own = seen[symbol]
    size = _rms(own)
    found = {}
    for name in _OTHERS[symbol]:
        if name not in seen or not size > 0.0:
            continue
        like = own * (_rms(seen[name]) / size)
        relation = relate(like, seen[name], step_s, least=LATERAL, blocks=SHORT_BLOCKS)
        least = LEAST_OF_WHEELS if name in ("front", "rear") else LEAST_CORRELATION
        if not relation.is_sure or abs(relation.r) < least:
            continue
        both = np.isfinite(own) & np.isfinite(seen[name])
        ratio, r = _rms(seen[name][both]) / _rms(own[both]), abs(relation.r)
        found[name] = ratio if r * ratio > RATIO or ratio / r < 1.0 / RATIO else 1.0
    # a bend shows at both axles; what one alone shows is slip, as on water
    axles = {"front", "rear"} & seen.keys()
    if len(axles) == 2 and len(axles & found.keys()) == 1:
        return {n: x for n, x in found.items() if n not in axles}
    return found


def _rms(x: FloatArray) -> float:
    known = x[np.isfinite(x)]
    return float(np.sqrt(np.mean(known**2))) if known.size else 0.0


def _is_agreed(factors: Mapping[str, float]) -> bool:
    """Whether all witnesses give a factor that is not 1, and the same."""
    own = list(factors.values())
    return bool(own) and 1.0 not in own and max(own) < ALIKE * min(own)


def _unit(symbol: str, factors: Mapping[str, float]) -> tuple[float, str]:
    """Return factor and words of the unit that explains the factor; 0 and nothing if none does."""
    first = next(iter(factors.values()))
    return next(((f, w) for f, w in _UNITS[symbol].items() if 1.0 / _NEAR < first / f < _NEAR), (0.0, ""))


def _doubt(symbol: str, factors: Mapping[str, float]) -> Doubt:
    name, first = next(iter(factors.items()))
    factor, words = _unit(symbol, factors)
    size = f"{1.0 / first:.3g} times too large" if first < 1.0 else f"{first:.3g} times too small"
    by = {"a_y": "a_y / v" if symbol == "yaw_rate" else "a_y", "yaw_rate": "yaw_rate times v"}.get(name, named(name))
    what = f"{symbol} is {size} for {by}{f' ({words}?)' if words else ''}"
    way = {symbol: Change(factor, radius=1.0) if words else Change(first)}
    return Doubt("scale", (symbol,), what, "check its unit", (way,), first)
