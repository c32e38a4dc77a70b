"""Steps over time: offsets that begin, or begin and end, where they explain most; effects that begin in a drive."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from aqualog.core.records import BoolArray, FloatArray
from aqualog.diagnose.channels import block_step, contrasts
from aqualog.diagnose.drive import Drive
from aqualog.diagnose.hypotheses import Hypothesis
from aqualog.diagnose.noise import white_noise
from aqualog.model.effects import EFFECTS

__all__ = ["EDGES", "against", "begun", "clipped", "gain_of", "intervals", "moments", "trapezoid"]

EDGES = 75  # of intervals, evenly over the drive
OUTLIER = 6.0  # of the median size (4 standard deviations), beyond which a sample counts no more
LASTS = 20  # [samples] to either side, of whose median it may be an outlier
SHORTEST = 3  # edges outside of an interval, and from the drive's ends to what begins
SHORTEST_S = 1.0  # of a change that begins; a faster one looks the same in blocks of 0.1 s
INTERVALS, PART = 5, 0.1  # the most intervals of a form, each with this share of what the one before explains (K)


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
