"""Moments of samples in blocks, for straight lines over one drive or many: normal equations block by block."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aqualog.core.records import FloatArray

__all__ = ["Noise", "block_moments", "block_starts", "second_difference"]


class Noise(NamedTuple):
    """Noise of the design: its `variance`, and by how much it `enters` each column (a number or (n,))."""

    variance: float
    enters: Sequence[FloatArray | float]


def block_starts(label: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return where the samples of each block begin; labels (n,) ascend."""
    return np.flatnonzero(np.diff(label, prepend=label[0] - 1))


def block_moments(
    columns: Sequence[FloatArray] | FloatArray,
    y: FloatArray,
    first: NDArray[np.int64],
    *,
    weight: FloatArray | None = None,
    noises: Sequence[Noise] = (),
) -> tuple[FloatArray, FloatArray]:
    """Return X'WX (g, p, p) and X'Wy (g, p) of each block.

    Parameters
    ----------
    columns : p arrays (n,)
        Of the design X.
    y : array (n,)
    first : int array (g,)
        As `block_starts`.
    weight : array (n,), optional
        Diagonal of W; 1 by default.
    noises : sequence of Noise
        Independent of each other; their products are subtracted from those of the columns.
    """
    p = len(columns)
    h, c = np.empty((first.size, p, p)), np.empty((first.size, p))
    for i in range(p):
        weighed = columns[i] if weight is None else weight * columns[i]
        c[:, i] = np.add.reduceat(weighed * y, first)
        for j in range(i + 1):
            product = weighed * columns[j]
            for noise in noises:
                product -= noise.variance * noise.enters[i] * noise.enters[j]
            h[:, i, j] = h[:, j, i] = np.add.reduceat(product, first)
    return h, c


def second_difference(x: FloatArray, apart: int) -> FloatArray:
    """Return x[k + 2 a] - 2 x[k + a] + x[k]: fast changes and noise, without level and drift. (n - 2 a,)"""
    return x[2 * apart :] - 2.0 * x[apart:-apart] + x[: -2 * apart]
