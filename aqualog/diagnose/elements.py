"""Intervals, patches and waves: unknown forms of few values over time and place.

A smooth function of time with a dozen values cannot be distinguished from slow noise. Offsets that begin and end, a
patch that comes again, or a wave of one length, say the same with few values, which slow noise cannot do.
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
from aqualog.diagnose.steps import EDGES, against, clipped, gain_of, intervals, trapezoid

__all__ = ["with_elements"]

AGAIN, AGAIN_STEP, PHASES = (1.5, 25.0), 0.03, 40  # times that patches come again over a drive; phases of one turn
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
    left = clipped(white @ (part.residual - arena.made(0, deviations[None])[0]), used)
    drive = arena.evidence.drives[part.drive]
    along = {n: drive.coordinates[n][part.at] for n in ("t", "position") if n in drive.coordinates}
    made = []
    for m in MECHANISMS:
        names = [n for n in along if (n,) in m.over]
        if m.is_road or m.source not in part.responses or not names:
            continue
        weight, score = against(white @ part.responses[m.source], left, used)
        found = [_wave(n, along[n], weight, score, used) for n in names]
        several = intervals(weight, score)
        found += [_stepped(along["t"], several[:k], weight, score) for k in sorted({1, len(several)} - {0})]
        found += [_patches(n, along[n], weight, score) for n in names]
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


def _stepped(
    t: FloatArray, edges: Sequence[tuple[int, int, int]], weight: FloatArray, score: FloatArray
) -> _Found:  # fmt: skip
    """Intervals over time as a form of one value each."""
    columns = np.array([trapezoid(t.size, *x) for x in edges]).T
    points = np.linspace(t[0], t[-1], 4 * POINTS)
    at = np.array([np.interp(points, t, c) for c in columns.T]).T
    basis = Basis(("t",), columns, np.eye(len(edges)), points[:, None], at, np.ones(points.size, dtype=bool))
    said = []
    for low, high, _ in sorted(edges):
        begin, end = (f"{t[min(i, t.size - 1)]:.0f} s" for i in (low, high))
        inside = f"from {begin} to {end}" if low > 0 else f"until {end}"
        said.append(inside if high < t.size else f"from {begin} on")
    kind = "interval" if len(edges) == 1 else "intervals"
    gain = gain_of(columns.T, weight, score)
    return _Found(kind, " and ".join(said), gain, basis, (0.5 * EDGES**2) ** len(edges))


def _patches(name: str, x: FloatArray, weight: FloatArray, score: FloatArray) -> _Found | None:
    """The offset that comes again after equal ways, or times, and explains most beside a constant."""
    if not np.isfinite(x).all() or np.ptp(x) <= 0.0:
        return None
    low, span = float(x.min()), float(np.ptp(x))
    rate = np.arange(*AGAIN, AGAIN_STEP)
    i, j = (k.ravel() for k in np.meshgrid(np.arange(PHASES), np.arange(1, PHASES // 2 + 1), indexing="ij"))
    total, right = weight.sum(), score.sum()
    best: tuple[float, tuple[float, float, float]] = (0.0, (0.0, 0.0, 0.0))
    for f in rate.tolist():
        # phases of one turn, twice: a patch may begin at the end of a turn
        at = (np.mod((x - low) / span * f, 1.0) * PHASES).astype(np.intp)
        folded = (np.tile(np.bincount(at, v, PHASES), 2) for v in (weight, score))
        A, B = (np.concatenate([[0.0], np.cumsum(v)]) for v in folded)
        a, b = A[i + j] - A[i], B[i + j] - B[i]
        each = (b - a / total * right) ** 2 / np.maximum(a * (1.0 - a / total), 1e-9 * total)
        k = int(np.argmax(each))
        if each[k] > best[0]:
            period = span / f
            best = float(each[k]), (low + i[k] / PHASES * period, j[k] / PHASES * period, period)

    def column(v: tuple[float, float, float]) -> FloatArray:
        return np.asarray(np.mod(x - v[0], v[2]) < v[1], dtype=np.float64)

    now = best[1]
    gain, step = 0.0, now[1] / 4.0
    while step > 0.01 * now[1]:
        tried = [(now[0] + p * step, now[1] + q * step, now[2] + r * step / AGAIN[1])
                 for p in (-1, 0, 1) for q in (-1, 0, 1) for r in (-1, 0, 1)]  # fmt: skip
        each = np.array([gain_of(column(v), weight, score) if 0.0 < v[1] < v[2] else 0.0 for v in tried])
        k = int(np.argmax(each))
        if each[k] <= gain * (1.0 + 1e-9):
            step *= 0.5
        else:
            gain, now = float(each[k]), tried[k]
    if gain <= 0.0:
        return None
    start, length, period = now
    own = column(now)
    points = np.linspace(low, low + span, 8 * POINTS)
    at_points = np.asarray(np.mod(points - start, period) < length, dtype=np.float64)
    basis = Basis(
        (name,), own[:, None], np.eye(1), points[:, None], at_points[:, None], np.ones(points.size, dtype=bool)
    )
    unit = "m" if name == "position" else "s"
    return _Found("patches", f"for {length:.3g} {unit} in every {period:.4g} {unit}", gain, basis, rate.size * i.size)


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
        gain = gain_of(_circle(2.0 * np.pi * f * z), w, s)
        best = max(best, (gain, float(f)))
    if best[0] <= 0.0:
        return None
    for f in best[1] + STEP * np.linspace(-0.8, 0.8, 9):
        best = max(best, (gain_of(_circle(2.0 * np.pi * f * z), w, s), float(f)))
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
