"""Intervals and waves: unknown forms of few values over time and place.

A smooth function of time with a dozen values cannot be distinguished from slow noise. An offset that begins and ends,
or a wave of one length, says the same with two or three values, which slow noise cannot do.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from aqualog.core.records import BoolArray, FloatArray
from aqualog.diagnose.arena import SHAPE_PRIOR, Arena
from aqualog.diagnose.channels import contrasts
from aqualog.diagnose.competition import Block
from aqualog.diagnose.noise import white_noise
from aqualog.diagnose.shapes import MECHANISMS, Mechanism, Shape
from aqualog.diagnose.spline import POINTS, Basis

__all__ = ["with_elements"]

EDGES = 75  # of intervals, evenly over the drive
OUTLIER = 6.0  # of the median size (4 standard deviations), beyond which a sample counts no more
SHORTEST = 3  # edges from the begin of an interval to its end
# waves: from half a period over the drive to ... periods, in steps of ...
PERIODS, STEP = 150.0, 0.5
SAMPLES_A_WAVE = 6.0  # least
LEAST_PERIODS = 0.5  # half a wave is a drift


class _Found(NamedTuple):
    kind: str
    manner: str
    gain: float
    basis: Basis
    tried: float


def with_elements(arena: Arena) -> Arena:
    """The arena with the interval and the wave of each mechanism that explain most beside the tolerances.

    They are sought in the metric of white noise: what is slow must not count as noise here.
    """
    if len(arena.parts) > 1:
        return arena
    part = arena.parts[0]
    used = part.mask
    deviations = arena.tolerance @ arena.tolerant(arena.white())[:-1, -1]
    white = white_noise(part.residual, used, contrasts(part.channels)).rotation
    left = white @ (part.residual - arena.made(0, deviations[None])[0])
    # a kerb or a shift of a second is no form
    most = OUTLIER * np.median(np.abs(left[:, used]), axis=1, keepdims=True)
    left = np.clip(left, -most, most)
    drive = arena.evidence.drives[part.drive]
    along = {n: drive.coordinates[n][part.at] for n in ("t", "position") if n in drive.coordinates}
    made = []
    for m in MECHANISMS:
        names = [n for n in along if (n,) in m.over]
        if m.is_road or m.source not in part.responses or not names:
            continue
        response = white @ part.responses[m.source]
        weight = np.where(used, (response**2).sum(axis=0), 0.0)
        score = np.where(used, (response * left).sum(axis=0), 0.0)
        found = [_wave(n, along[n], weight, score, used) for n in names]
        found.append(_interval(along["t"], weight, score))
        made += [(m, f) for f in found if f is not None]
    return _extended(arena, made)


def _extended(arena: Arena, made: Sequence[tuple[Mechanism, _Found]]) -> Arena:
    shapes, blocks, sd, n = list(arena.shapes), list(arena.blocks), [arena.sd], arena.width
    for m, f in made:
        each = sum(s.mechanism is m for s in arena.shapes)
        k = f.basis.columns.shape[1]
        own = tuple(range(n, n + k))
        # one of all that were tried is left
        usual = math.log(SHAPE_PRIOR / max(each, 1)) - math.log(f.tried)
        blocks.append(
            Block(f"{m.name}({f.kind} of {f.basis.names[0]})", "shape", own, f.basis.prior, usual, len(shapes))
        )
        shapes.append(Shape(m, f.basis.names, f.basis, f.manner))
        sd.append(np.full(k, m.usual))
        n += k
    tolerance = np.zeros((n, n))
    tolerance[: arena.width, : arena.width] = arena.tolerance
    return replace(
        arena, shapes=tuple(shapes), blocks=tuple(blocks), sd=np.concatenate(sd), tolerance=tolerance
    )  # fmt: skip


def _interval(t: FloatArray, weight: FloatArray, score: FloatArray) -> _Found | None:
    """The offset that begins and ends, suddenly or slowly, and explains most beside a constant."""
    A = np.concatenate([[0.0], np.cumsum(weight)])
    B = np.concatenate([[0.0], np.cumsum(score)])
    at = np.linspace(0, t.size, EDGES + 1).astype(np.intp)
    i, j = np.triu_indices(EDGES + 1, SHORTEST)
    usable = i + EDGES - j >= SHORTEST
    i, j = at[i[usable]], at[j[usable]]
    a, b = A[j] - A[i], B[j] - B[i]
    rest = np.maximum(a * (1.0 - a / A[-1]), 1e-9 * A[-1])
    best = int(np.argmax((b - a / A[-1] * B[-1]) ** 2 / rest))
    low, high, rise = int(i[best]), int(j[best]), 0
    inside = (low > 0, high < t.size)
    gain = 0.0
    step = int(at[1])
    shortest = SHORTEST * step
    while step >= 1:
        moves = [(d * inside[0], e * inside[1], r) for d in (-step, 0, step) for e in (-step, 0, step)
                 for r in (-step, 0, step)]  # fmt: skip
        tried = [(low + d, high + e, max(rise + r, 0)) for d, e, r in moves]
        each = [_gain(_trapezoid(t.size, *x), weight, score) if x[1] - x[0] >= shortest else 0.0 for x in tried]
        k = int(np.argmax(each))
        if each[k] <= gain * (1.0 + 1e-9):
            step //= 2
        else:
            gain, (low, high, rise) = each[k], tried[k]
    if gain <= 0.0:
        return None
    column = _trapezoid(t.size, low, high, rise)
    points = np.linspace(t[0], t[-1], 4 * POINTS)
    at_points = np.interp(points, t, column)[:, None]
    basis = Basis(("t",), column[:, None], np.eye(1), points[:, None], at_points, np.ones(points.size, dtype=bool))
    begin, end = (f"{t[min(i, t.size - 1)]:.0f} s" for i in (low, high))
    manner = (
        f"from {begin} to {end}" if low > 0 and high < t.size else f"from {begin} on" if low > 0 else f"until {end}"
    )
    return _Found("interval", manner, gain, basis, 0.5 * EDGES**2)


def _trapezoid(n: int, low: int, high: int, rise: int) -> FloatArray:
    """One from `low` to `high`, with slopes of `rise` samples about both ends; no slope at the drive's own ends."""
    k = np.arange(n) + 0.5
    width = max(rise, 1)
    up = np.clip((k - low) / width + 0.5, 0.0, 1.0) if low > 0 else np.ones(n)
    down = np.clip((high - k) / width + 0.5, 0.0, 1.0) if high < n else np.ones(n)
    return np.asarray(np.minimum(up, down))


def _wave(name: str, x: FloatArray, weight: FloatArray, score: FloatArray, used: BoolArray) -> _Found | None:
    """The wave over a coordinate that explains most, beside a constant."""
    known = used & np.isfinite(x)
    if not known.any() or np.ptp(x[known]) <= 0.0:
        return None
    low, span = float(x[known].min()), float(np.ptp(x[known]))
    z = np.where(known, (x - low) / span, 0.0)
    w, s = np.where(known, weight, 0.0), np.where(known, score, 0.0)
    most = min(PERIODS, float(known.sum()) / SAMPLES_A_WAVE)
    best: tuple[float, float] = (0.0, 0.0)
    for f in np.arange(LEAST_PERIODS, most, STEP):
        gain = _gain(_circle(2.0 * np.pi * f * z), w, s)
        best = max(best, (gain, float(f)))
    if best[0] <= 0.0:
        return None
    for f in best[1] + STEP * np.linspace(-0.8, 0.8, 9):
        best = max(best, (_gain(_circle(2.0 * np.pi * f * z), w, s), float(f)))
    phase = 2.0 * np.pi * best[1] * z
    columns = np.where(known, _circle(phase), 0.0).T
    points = np.linspace(0.0, 1.0, max(POINTS, min(1200, int(12 * best[1]))))
    at = 2.0 * np.pi * best[1] * points
    grid = (low + span * points)[:, None]
    basis = Basis((name,), columns, np.eye(2), grid, _circle(at).T, np.ones(points.size, dtype=bool))
    unit = "m" if name == "position" else "s"
    manner = f"in waves of {span / best[1]:.3g} {unit}" if best[1] >= 1.0 else ""
    return _Found("wave", manner, best[0], basis, (most - LEAST_PERIODS) / STEP)


def _circle(phase: FloatArray) -> FloatArray:
    return np.stack([np.cos(phase), np.sin(phase)])


def _gain(columns: FloatArray, weight: FloatArray, score: FloatArray) -> float:
    """What columns (k, n) or (n,) explain beside a constant."""
    X = np.vstack([np.ones(weight.size), columns])
    gram, right = (X * weight) @ X.T, X @ score
    gram += 1e-9 * np.trace(gram) * np.eye(len(X))
    return float(right @ np.linalg.solve(gram, right) - right[0] ** 2 / gram[0, 0])
