"""Rating of a simulated time history against a measured one, by the method of ISO/TS 18571 [iso18571_2024].

R = 0.4 Z + 0.2 E_P + 0.2 E_M + 0.2 E_S, each from 0 to 1. The standard is written for crash signals of 10 kHz; here a
sample is the mean over a block of 0.1 s, so the nine samples of the slope's mean are 0.9 s.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aqualog.core.compiled import compiled
from aqualog.core.records import FloatArray

__all__ = ["LEAST_SAMPLES", "Rating", "rating"]

LEAST_SAMPLES = 30  # so that a shift of 20 % leaves enough to compare
INNER, OUTER = 0.05, 0.5  # corridors, of the largest measured value
MOST_SHIFT = 0.2  # of the length
EPS_M = 0.5  # relative error of the magnitude at which its rating is 0
EPS_S = 2.0  # the same of the slope
WARP = 0.1  # of the length: how far dynamic time warping may go from the diagonal
WEIGHTS = (0.4, 0.2, 0.2, 0.2)
SLOPE_SAMPLES = 9


@dataclass(frozen=True, slots=True)
class Rating:
    """Corridor Z, phase E_P, magnitude E_M and slope E_S. `shift` [samples]: positive where the simulation is late; the
    phase goes by it, as in the standard. `late` [samples]: the same between samples."""

    corridor: float
    phase: float
    magnitude: float
    slope: float
    shift: int
    late: float

    @property
    def total(self) -> float:
        """R, 0 to 1."""
        own = (self.corridor, self.phase, self.magnitude, self.slope)
        return float(sum(w * x for w, x in zip(WEIGHTS, own, strict=True)))


def rating(reference: FloatArray, simulated: FloatArray) -> Rating:
    """Rate a simulated time history against the measured one.

    Z is the mean of 1 in the inner corridor (5 % of max |T|), 0 beyond the outer one (50 %), and in between the squared
    share that is left. E_P falls with the shift of the greatest correlation, to 0 at 20 % of the length.

    Parameters
    ----------
    reference, simulated : array (n,)
        Measured and simulated samples at the same times, finite, at least `LEAST_SAMPLES`.

    Raises
    ------
    ValueError
        If there are fewer samples, or not as many of both.
    """
    if reference.shape != simulated.shape or reference.size < LEAST_SAMPLES:
        raise ValueError(f"{reference.size} and {simulated.size} samples, {LEAST_SAMPLES} of both are needed")
    shift, late = _shift(reference, simulated)
    measured, moved = _overlapping(reference, simulated, shift)
    most = MOST_SHIFT * reference.size
    return Rating(
        _corridor(reference, simulated),
        float(max(0.0, (most - abs(shift)) / most)),
        magnitude(measured, moved),
        slope(measured, moved),
        shift,
        late,
    )


def _corridor(reference: FloatArray, simulated: FloatArray) -> float:
    largest = float(np.abs(reference).max())
    if largest == 0.0:
        return float("nan")
    off = np.abs(simulated - reference) / largest
    return float((np.clip((OUTER - off) / (OUTER - INNER), 0.0, 1.0) ** 2).mean())


def _shift(reference: FloatArray, simulated: FloatArray) -> tuple[int, float]:
    """By how many samples the simulation is late, where the correlation is greatest (of equal ones the smallest), and
    the same between samples, by a parabola."""
    most = int(MOST_SHIFT * reference.size)
    nearest = sorted(range(-most, most + 1), key=lambda k: (abs(k), -k))
    r = {k: _correlation(*_overlapping(reference, simulated, k)) for k in nearest}
    at = max(nearest, key=lambda k: r[k])
    before, after = (r.get(k, float("nan")) for k in (at - 1, at + 1))
    bend = before - 2.0 * r[at] + after
    return at, at + (0.5 * (before - after) / bend if bend < 0.0 else 0.0)


def _overlapping(reference: FloatArray, simulated: FloatArray, shift: int) -> tuple[FloatArray, FloatArray]:
    """The samples that are left of both once the simulation is moved back by `shift`."""
    if shift > 0:
        return reference[:-shift], simulated[shift:]
    if shift < 0:
        return reference[-shift:], simulated[:shift]
    return reference, simulated


def _correlation(a: FloatArray, b: FloatArray) -> float:
    a, b = a - a.mean(), b - b.mean()
    norm = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / norm if norm > 0.0 else 0.0


def magnitude(reference: FloatArray, simulated: FloatArray) -> float:
    """E_M: 1 - error / 0.5, the error over the sum of |T| after dynamic time warping within a tenth of the length."""
    window = int(np.ceil(WARP * reference.size)) - 1
    off, norm = _warped(np.ascontiguousarray(reference), np.ascontiguousarray(simulated), max(window, 1))
    return _rated(off, norm, EPS_M)


def slope(reference: FloatArray, simulated: FloatArray) -> float:
    """E_S: 1 - error / 2.0, of the slopes as means over nine samples; near the ends over as many as stand there."""
    a, b = _slope(reference), _slope(simulated)
    return _rated(float(np.abs(a - b).sum()), float(np.abs(a).sum()), EPS_S)


def _slope(x: FloatArray) -> FloatArray:
    d = np.gradient(x)
    total = np.concatenate([[0.0], np.cumsum(d)])
    i = np.arange(d.size)
    half = np.minimum(np.minimum(i, d.size - 1 - i), SLOPE_SAMPLES // 2)
    return np.asarray((total[i + half + 1] - total[i - half]) / (2 * half + 1))


def _rated(off: float, norm: float, most: float) -> float:
    if norm == 0.0:
        return 1.0 if off == 0.0 else 0.0
    return max(0.0, 1.0 - off / norm / most)


@compiled
def _warped(a: FloatArray, b: FloatArray, window: int) -> tuple[float, float]:
    """Sums of |b - a| and |a| along the path of least squared distance, at most `window` off the diagonal."""
    n = a.size
    width = 2 * window + 1
    cost = np.full((n, width), np.inf)  # column k: sample i + k - window of b
    step = np.zeros((n, width), dtype=np.int8)
    for i in range(n):
        for k in range(width):
            j = i + k - window
            if j < 0 or j >= n:
                continue
            own = (a[i] - b[j]) ** 2
            if i == 0 and j == 0:
                cost[i, k] = own
                continue
            least, way = np.inf, 0
            if i > 0 and k + 1 < width and cost[i - 1, k + 1] < least:
                least, way = cost[i - 1, k + 1], 1
            if k > 0 and cost[i, k - 1] < least:
                least, way = cost[i, k - 1], 2
            if i > 0 and cost[i - 1, k] < least:
                least, way = cost[i - 1, k], 3
            cost[i, k] = own + least
            step[i, k] = way
    i, k = n - 1, window
    off, norm = 0.0, 0.0
    while True:
        off += abs(b[i + k - window] - a[i])
        norm += abs(a[i])
        way = step[i, k]
        if way == 0:
            return off, norm
        if way == 1:
            i, k = i - 1, k + 1
        elif way == 2:
            k -= 1
        else:
            i -= 1
