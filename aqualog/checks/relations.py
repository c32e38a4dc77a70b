"""How surely two signals move together, or against each other: over the changes of a drive, in blocks."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from aqualog.core.intervals import half_width
from aqualog.core.records import FloatArray

__all__ = ["Relation", "changes", "relate"]

LEVEL_S = 5.0  # [s] what changes more slowly is left out: grade, bank, wind, offsets and radii do
BLOCK_S = 2.5  # [s] beyond, changes have little to do with each other
LEAST_BLOCKS = 12
FEW = 3.0  # blocks that weigh as much as a third of the least number may be one event, as water on one side
DOUBT = 1e-4  # chance that the sign of a relation is wrong


class Relation(NamedTuple):
    """Correlation of two signals, and half of the interval beyond which its sign is not in doubt; NaN if not known."""

    r: float
    half: float

    @property
    def is_sure(self) -> bool:
        """Whether the sign of the correlation is beyond doubt."""
        return abs(self.r) > self.half

    @property
    def weight(self) -> float:
        """How sure the sign is; 0 where it is not known."""
        return abs(self.r) / max(self.half, 1e-3) if self.is_sure else 0.0


NO_RELATION = Relation(math.nan, math.nan)


def changes(x: FloatArray, step_s: float) -> FloatArray:
    """Return a signal (n,) less its centred mean over `LEVEL_S`; NaN where half of that is not known."""
    half = max(1, round(0.5 * LEVEL_S / step_s))
    known = np.isfinite(x)
    total, count = (_sums(np.where(known, y, 0.0), half) for y in (x, np.ones_like(x)))
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(count > half, x - total / count, np.nan))


def _sums(x: FloatArray, half: int) -> FloatArray:
    """Sum the neighbours up to `half` on either side."""
    upto = np.concatenate([np.zeros(half + 1), np.cumsum(x), np.full(half, x.sum())])
    return np.asarray(upto[2 * half + 1 :] - upto[: -2 * half - 1])


def relate(x: FloatArray, y: FloatArray, step_s: float, *, least: float, blocks: int = LEAST_BLOCKS) -> Relation:
    """Correlate changes (n,) about zero; the interval is from blocks of the drive left out in turn.

    Parameters
    ----------
    least : float
        Root mean square that both must reach: less is the noise of sensors.
    blocks : int
        Least number of blocks.
    """
    good = np.isfinite(x) & np.isfinite(y)
    if int(good.sum()) * step_s < blocks * BLOCK_S:
        return NO_RELATION
    block = (np.flatnonzero(good) * step_s // BLOCK_S).astype(np.int64)
    _, block = np.unique(block, return_inverse=True)
    x, y = x[good], y[good]
    xx, yy, xy = (np.bincount(block, weights=p) for p in (x * x, y * y, x * y))
    if xx.size < blocks or min(xx.sum(), yy.sum()) < least**2 * x.size:
        return NO_RELATION
    if (xy**2).sum() * blocks > FEW * np.abs(xy).sum() ** 2:
        return NO_RELATION
    r = float(xy.sum() / math.sqrt(xx.sum() * yy.sum()))
    with np.errstate(invalid="ignore", divide="ignore"):
        without = (xy.sum() - xy) / np.sqrt((xx.sum() - xx) * (yy.sum() - yy))
    if not np.isfinite(without).all():
        return NO_RELATION
    n = xx.size
    sd = math.sqrt((n - 1.0) / n * float(((without - without.mean()) ** 2).sum()))
    return Relation(r, half_width(sd, n - 1.0, level=1.0 - 2.0 * DOUBT))
