"""Intervals, patches and waves over time and place: unknown forms of few values, and the begin of effects. A smooth
function of time with a dozen values cannot be distinguished from slow noise; these say the same with few, which slow
noise cannot do."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import chain
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from aqualog.core.compiled import compiled, plain
from aqualog.core.records import BoolArray, FloatArray
from aqualog.diagnose.arena import SHAPE_PRIOR, Arena
from aqualog.diagnose.channels import block_step, contrasts
from aqualog.diagnose.competition import Block
from aqualog.diagnose.drive import Drive
from aqualog.diagnose.hypotheses import Hypothesis
from aqualog.diagnose.noise import white_noise
from aqualog.diagnose.shapes import MECHANISMS, POINTS, Basis, Mechanism, Shape
from aqualog.diagnose.threads import beside
from aqualog.diagnose.words import listed, number
from aqualog.model.effects import EFFECTS

__all__ = ["EDGES", "against", "begun", "clipped", "gain_of", "intervals", "moments", "trapezoid", "with_elements"]

EDGES = 75  # of intervals, evenly over the drive
OUTLIER = 6.0  # of the median size (4 standard deviations), beyond which a sample counts no more
LASTS = 20  # [samples] to either side, of whose median it may be an outlier
SHORTEST = 3  # edges outside of an interval, and from the drive's ends to what begins
GUST = 40  # [samples] that an interval lasts at the least: gusts and kerbs last less (K)
SHORTEST_S = 1.0  # of a change that begins, in blocks of 0.1 s, and of one that comes again after equal times
INTERVALS, PART = 5, 0.1  # the most intervals of a form, each with this share of what the one before explains (K)
AGAIN, AGAIN_STEP, PHASES = (1.5, 25.0), 0.03, 40  # times that patches come again over a drive; phases of one turn
# waves: from half a period over the drive to ... periods, in steps of ...
PERIODS, STEP = 150.0, 0.5
SAMPLES_A_WAVE = 6.0  # least
LEAST_PERIODS = 0.5  # half a wave is a drift
RATES = 50  # waves at a time, to spare memory


def clipped(left: FloatArray, used: BoolArray, *, lasts: int = LASTS) -> FloatArray:
    """What is left in white noise (C, n), without outliers from the median of so many samples to either side: a kerb or
    a shift of a second is no form, what `lasts` longer is."""
    most = OUTLIER * np.median(np.abs(left[:, used]), axis=1, keepdims=True)
    if lasts:
        near = np.pad(left, [(0, 0), (lasts, lasts)], mode="edge")
        most = most + np.abs(np.median(sliding_window_view(near, 2 * lasts + 1, axis=1), axis=-1))
    return np.asarray(np.clip(left, -most, most))


def against(response: FloatArray, left: FloatArray, used: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Weight and score (n,) of a response among what is left (C, n), 0 where masked: a modulation m of it explains
    (m · score)² / (m² · weight)."""
    return np.where(used, (response**2).sum(axis=0), 0.0), np.where(used, (response * left).sum(axis=0), 0.0)


def begun(weight: FloatArray, score: FloatArray) -> tuple[int, int]:
    """Middle and length [samples] of the ramp to a lasting offset that explains most beside a constant."""
    n = weight.size
    A, B = (np.concatenate([[0.0], np.cumsum(x)]) for x in (weight, score))
    at = np.linspace(0, n, EDGES + 1).astype(np.intp)[SHORTEST:-SHORTEST]
    a, b = A[-1] - A[at], B[-1] - B[at]
    rest = np.maximum(a * (1.0 - a / A[-1]), 1e-9 * A[-1])
    best = int(np.argmax((b - a / A[-1] * B[-1]) ** 2 / rest))
    (low, _, rise), _ = _moved(int(at[best]), n, n // EDGES, np.zeros((0, n)), weight, score)
    return low, rise


def intervals(weight: FloatArray, score: FloatArray) -> list[tuple[int, int, int]]:
    """Offsets that begin and end, suddenly or slowly, each the one that explains most beside those before: from a
    sample to another, with slopes of so many samples."""
    n = weight.size
    at = np.linspace(0, n, EDGES + 1).astype(np.intp)
    i, j = np.triu_indices(EDGES + 1, 1)
    usable = i + EDGES - j >= SHORTEST
    i, j = at[i[usable]], at[j[usable]]
    A = np.concatenate([[0.0], np.cumsum(weight)])
    a = A[j] - A[i]
    rest = np.maximum(a * (1.0 - a / A[-1]), 1e-9 * A[-1])
    out: list[tuple[int, int, int]] = []
    beside, known, last = np.zeros((0, n)), 0.0, 0.0
    for _ in range(INTERVALS):
        X = np.vstack([np.ones(n), beside])
        gram = (X * weight) @ X.T
        gram += 1e-9 * np.trace(gram) * np.eye(len(X))
        left = score - weight * (np.linalg.solve(gram, X @ score) @ X)
        B = np.concatenate([[0.0], np.cumsum(left)])
        b = B[j] - B[i]
        best = int(np.argmax((b - a / A[-1] * B[-1]) ** 2 / rest))
        edges, gain = _moved(int(i[best]), int(j[best]), int(at[1]), beside, weight, score)
        if gain - known <= PART * last:
            break
        out.append(edges)
        beside, last, known = np.vstack([beside, trapezoid(n, *edges)]), gain - known, gain
    return out


def _moved(
    low: int, high: int, step: int, beside: FloatArray, weight: FloatArray, score: FloatArray
) -> tuple[tuple[int, int, int], float]:  # fmt: skip
    """An interval with ends and slopes where it explains most beside others, and what they all explain."""
    n, rise, gain = weight.size, 0, 0.0
    X = np.vstack([np.ones(n), beside])
    inverse = np.linalg.inv((X * weight) @ X.T)
    right = X @ score
    known = float(right @ inverse @ right - right[0] ** 2 / weight.sum())
    inside = (low > 0, high < n)
    shortest = min(step, high - low)
    while step >= 1:
        moves = [(d * inside[0], e * inside[1], r) for d in (-step, 0, step) for e in (-step, 0, step)
                 for r in (-step, 0, step)]  # fmt: skip
        tried = [(low + d, high + e, max(rise + r, 0)) for d, e, r in moves]
        tried = [x for x in dict.fromkeys(tried) if x[1] - x[0] >= shortest]
        T = _trapezoids(n, np.array(tried))
        shared, own = T @ (X * weight).T, (T**2) @ weight
        cross = shared @ inverse
        left = own - (cross * shared).sum(axis=1)
        each = known + (T @ score - cross @ right) ** 2 / np.maximum(left, 1e-9 * own + 1e-30)
        k = int(np.argmax(each))
        if each[k] <= gain * (1.0 + 1e-9):
            step //= 2
        else:
            gain, (low, high, rise) = float(each[k]), tried[k]
    return (low, high, rise), gain


def trapezoid(n: int, low: int, high: int, rise: int) -> FloatArray:
    """One from `low` to `high`, with slopes of `rise` samples about both ends; no slope at the drive's own ends."""
    return np.asarray(_trapezoids(n, np.array([(low, high, rise)]))[0])


def _trapezoids(n: int, edges: npt.NDArray[np.int64]) -> FloatArray:
    """`trapezoid` of each row of edges (k, 3). (k, n)"""
    k = np.arange(n) + 0.5
    low, high, rise = edges.T[..., None]
    width = np.maximum(rise, 1)
    up, down = (k - low) / width + 0.5, (high - k) / width + 0.5
    up[low[:, 0] <= 0] = down[high[:, 0] >= n] = 1.0
    return np.asarray(np.clip(np.minimum(up, down), 0.0, 1.0))


def gain_of(columns: FloatArray, weight: FloatArray, score: FloatArray) -> float:
    """What columns (k, n) or (n,) explain beside a constant."""
    X = np.vstack([np.ones(weight.size), columns])
    gram, right = (X * weight) @ X.T, X @ score
    gram += 1e-9 * np.trace(gram) * np.eye(len(X))
    return float(right @ np.linalg.solve(gram, right) - right[0] ** 2 / gram[0, 0])


def moments(
    drive: Drive, residual: FloatArray, asked: Sequence[Hypothesis], signatures: Sequence[FloatArray]
) -> tuple[Hypothesis, ...]:
    """Each effect that begins during the drive at each wheel, with the begin and duration that explain most. The
    response of the effect that `DriveSearch.begins_like` names, times a ramp, stands for it, in white noise: what is
    slow must not count as noise here. `residual` (C, n); `asked` and their `signatures` (k, C, n): the other
    hypotheses."""
    white = white_noise(residual, drive.mask, contrasts(drive.channels)).rotation
    left = clipped(white @ residual, drive.mask)
    dt = block_step(drive.dt)
    out = []
    for effect in EFFECTS.values():
        like = effect.drive.begins_like
        for h, signature in zip(asked, signatures, strict=True) if like else ():
            if h.effect.name != like or h.where is None or len(h.where) == 1:
                continue
            weight, score = against(white @ signature[0], left, drive.mask)
            if weight.sum() <= 0.0:
                continue
            low, rise = begun(weight, score)
            duration = max(rise * dt, SHORTEST_S)
            fixed = {"start": max(low * dt - 0.5 * duration, 0.0), "duration": duration}
            out.append(Hypothesis(effect, h.where, tuple(p.name for p in effect.parameters[:1]), fixed))
    return tuple(out)


class _Found(NamedTuple):
    kind: str
    manner: str
    basis: Basis
    tried: float


def with_elements(arena: Arena) -> Arena:
    """The arena with the interval and the wave of each mechanism that explain most beside the tolerances, in the metric
    of white noise: what is slow must not count as noise here."""
    if len(arena.parts) > 1:
        return arena
    part = arena.parts[0]
    used = part.mask
    white = white_noise(part.residual, used, contrasts(part.channels)).rotation
    # what a fault makes of the car's deviations is none: they are those beside which no sample is an outlier
    calm = replace(part, residual=np.asarray(np.linalg.solve(white, clipped(white @ part.residual, used, lasts=0))))
    deviations = arena.tolerance @ arena.tolerant(replace(arena, parts=(calm,)).white())[:-1, -1]
    left = clipped(white @ (part.residual - arena.made(0, deviations[None])[0]), used)
    drive = arena.evidence.drives[part.drive]
    along = {n: drive.coordinates[n][part.at] for n in ("t", "position") if n in drive.coordinates}
    sought = [
        (m, *against(white @ part.responses[m.source], left, used)) for m in MECHANISMS
        if not m.is_road and m.source in part.responses and any((n,) in m.over for n in along)
    ]  # fmt: skip

    def over(name: str) -> dict[tuple[str, str], tuple[_Found | None, _Found | None]]:
        """Waves and patches over one coordinate: they are made once for all mechanisms."""
        own = [s for s in sought if (name,) in s[0].over]
        x, weights, scores = along[name], np.array([s[1] for s in own]), np.array([s[2] for s in own])
        both = zip(_waves(name, x, weights, scores, used), _patches(name, x, weights, scores), strict=True)
        return dict(zip([(m.name, name) for m, _, _ in own], both, strict=True))

    looked = {k: both for each in beside(over, along) for k, both in each.items()}

    def of(s: tuple[Mechanism, FloatArray, FloatArray]) -> list[tuple[Mechanism, _Found]]:
        m, weight, score = s
        lasting = [x for x in intervals(weight, score) if x[1] - x[0] >= GUST]
        several = lasting[: None if m.recurs else 1]
        both = [looked.get((m.name, n), (None, None)) for n in along]
        found = [wave for wave, _ in both]
        found += [_stepped(along["t"], several[:k]) for k in sorted({min(1, len(several)), len(several)} - {0})]
        found += [patches for _, patches in both if m.recurs]
        return [(m, f) for f in found if f is not None]

    return _extended(arena, list(chain.from_iterable(beside(of, sought))))


def _extended(arena: Arena, made: Sequence[tuple[Mechanism, _Found]]) -> Arena:
    shapes, blocks, sd, n = list(arena.shapes), list(arena.blocks), [arena.sd], arena.sd.size
    for m, f in made:
        each = sum(s.mechanism is m for s in arena.shapes)
        k = f.basis.columns.shape[1]
        own = tuple(range(n, n + k))
        # one of all that were tried is left
        usual = math.log(SHAPE_PRIOR / max(each, 1)) - math.log(f.tried)
        key = f"{m.name}({f.kind} of {f.basis.names[0]})"
        blocks.append(Block(key, "shape", own, f.basis.prior, usual, len(shapes)))
        shapes.append(Shape(m, f.basis.names, f.basis, f.manner))
        sd.append(np.full(k, m.usual))
        n += k
    tolerance = np.pad(arena.tolerance, (0, n - arena.sd.size))
    return replace(arena, shapes=tuple(shapes), blocks=tuple(blocks), sd=np.concatenate(sd), tolerance=tolerance)


def _stepped(t: FloatArray, edges: Sequence[tuple[int, int, int]]) -> _Found:
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
    return _Found(kind, listed(said), basis, (0.5 * EDGES**2) ** len(edges))


def _patches(name: str, x: FloatArray, weights: FloatArray, scores: FloatArray) -> list[_Found | None]:
    """For each row of weights (k, n), the offset that comes again after equal ways, or times, and explains most."""
    if not len(weights) or not np.isfinite(x).all() or np.ptp(x) <= 0.0:
        return [None] * len(weights)
    rates = np.arange(*AGAIN, AGAIN_STEP)
    where = np.zeros((len(weights), 3))
    _fold(x, float(x.min()), float(x.max()), rates, *plain(weights, scores), where)
    tried = rates.size * PHASES * (PHASES // 2)
    return beside(lambda s: _patch(name, x, *s, tried), zip(weights, scores, where.tolist(), strict=True))


@compiled
def _fold(x, low, high, rates, weights, scores, where):  # type: ignore[no-untyped-def]
    """Fill start, length and period of the patch that explains most, for each row of weights and scores (k, n)."""
    best = np.zeros(len(weights))
    at = np.empty(x.size, dtype=np.int64)
    for f in rates:
        period = (high - low) / f
        for t in range(x.size):
            turns = (x[t] - low) / period
            at[t] = int((turns - np.floor(turns)) * PHASES)
        for k in range(len(weights)):
            w, s = np.zeros(PHASES), np.zeros(PHASES)
            for t in range(x.size):
                w[at[t]] += weights[k, t]
                s[at[t]] += scores[k, t]
            total, right = w.sum(), s.sum()
            for i in range(PHASES):
                a = b = 0.0
                for j in range(PHASES // 2):  # a patch may begin at the end of a turn
                    a += w[(i + j) % PHASES]
                    b += s[(i + j) % PHASES]
                    gain = (b - a / total * right) ** 2 / max(a * (1.0 - a / total), 1e-9 * total)
                    if gain > best[k]:
                        best[k] = gain
                        where[k, 0], where[k, 1] = low + i / PHASES * period, (j + 1) / PHASES * period
                        where[k, 2] = period


def _patch(
    name: str, x: FloatArray, weight: FloatArray, score: FloatArray, now: Sequence[float], count: float
) -> _Found | None:
    """The patch near a start, a length and a period that explains most beside a constant."""

    def column(v: Sequence[float]) -> FloatArray:
        return np.asarray(np.mod(x - v[0], v[2]) < v[1], dtype=np.float64)

    low, span = float(x.min()), float(np.ptp(x))
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
    start, length, period = now
    # what the driver does again and again jolts the car for an instant each time
    if gain <= 0.0 or (name == "t" and length < SHORTEST_S):
        return None
    own = column(now)
    points = np.linspace(low, low + span, 8 * POINTS)
    there = np.asarray(np.mod(points - start, period) < length, dtype=np.float64)[:, None]
    basis = Basis((name,), own[:, None], np.eye(1), points[:, None], there, np.ones(points.size, dtype=bool))
    unit = "m" if name == "position" else "s"
    return _Found("patches", f"for {number(length)} {unit} in every {number(period)} {unit}", basis, count)


def _waves(
    name: str, x: FloatArray, weights: FloatArray, scores: FloatArray, used: BoolArray
) -> list[_Found | None]:  # fmt: skip
    """For each row of weights (k, n), the wave over a coordinate that explains most, beside a constant."""
    known = used & np.isfinite(x)
    if not len(weights) or not known.any() or np.ptp(x[known]) <= 0.0:
        return [None] * len(weights)
    low, span = float(x[known].min()), float(np.ptp(x[known]))
    z, W, S = (x[known] - low) / span, weights[:, known], scores[:, known]
    most = min(PERIODS, float(known.sum()) / SAMPLES_A_WAVE)
    rates = np.arange(LEAST_PERIODS, most, STEP)
    coarse = _gains(rates, z, W, S)
    out: list[_Found | None] = []
    for k, (w, s) in enumerate(zip(W, S, strict=True)):
        best = max(zip(coarse[:, k].tolist(), rates.tolist(), strict=True), default=(0.0, 0.0))
        if best[0] <= 0.0:
            out.append(None)
            continue
        near = best[1] + STEP * np.linspace(-0.8, 0.8, 9)
        _, f = max([best, *zip(_gains(near, z, w[None], s[None])[:, 0].tolist(), near.tolist(), strict=True)])
        columns = np.zeros((x.size, 2))
        columns[known] = _circle(2.0 * np.pi * f * z).T
        points = np.linspace(0.0, 1.0, max(POINTS, min(1200, int(12 * f))))
        grid = (low + span * points)[:, None]
        at_points = _circle(2.0 * np.pi * f * points).T
        basis = Basis((name,), columns, np.eye(2), grid, at_points, np.ones(points.size, dtype=bool))
        unit = "m" if name == "position" else "s"
        manner = f"in waves of {number(span / f)} {unit}" if f >= 1.0 else ""
        out.append(_Found("wave", manner, basis, (most - LEAST_PERIODS) / STEP))
    return out


def _gains(rates: FloatArray, z: FloatArray, weights: FloatArray, scores: FloatArray) -> FloatArray:
    """`gain_of` cosine and sine of each rate (F,) over z (n,), for each row of weights (k, n). (F, k) Their inner
    products are sums over the wave and over that of twice the rate."""
    out = np.zeros((rates.size, len(weights)))
    all_w, all_s = weights.sum(axis=1), scores.sum(axis=1)
    for i in range(0, rates.size, RATES):
        turns = np.exp(2j * np.pi * rates[i : i + RATES, None] * z)
        once, twice, right = turns @ weights.T, (turns * turns) @ weights.T, turns @ scores.T
        gram = np.empty((*once.shape, 3, 3))
        gram[..., 0, 0] = all_w
        gram[..., 0, 1] = gram[..., 1, 0] = once.real
        gram[..., 0, 2] = gram[..., 2, 0] = once.imag
        gram[..., 1, 1], gram[..., 2, 2] = 0.5 * (all_w + twice.real), 0.5 * (all_w - twice.real)
        gram[..., 1, 2] = gram[..., 2, 1] = 0.5 * twice.imag
        gram += 1e-9 * np.trace(gram, axis1=2, axis2=3)[..., None, None] * np.eye(3)
        r = np.stack([np.broadcast_to(all_s, right.shape), right.real, right.imag], axis=-1)
        explained = (r * np.linalg.solve(gram, r[..., None])[..., 0]).sum(axis=-1)
        out[i : i + RATES] = explained - all_s**2 / gram[..., 0, 0]
    return out


def _circle(phase: FloatArray) -> FloatArray:
    return np.stack([np.cos(phase), np.sin(phase)])
