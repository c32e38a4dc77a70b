"""Turn a statistic into a detection bit."""

from __future__ import annotations

import math

import numpy as np

from aqualog.core.compiled import compiled
from aqualog.core.records import BoolArray, FloatArray

__all__ = ["alarm_bits"]


@compiled
def _alarm_bits(x, on, off, stay, patience):  # type: ignore[no-untyped-def]
    bits = np.zeros(x.size, dtype=np.bool_)
    active = False
    left = 0
    for i in range(x.size):
        if math.isnan(x[i]) or math.isnan(stay[i]):
            left = max(left - 1, 0)
            active = active and left > 0
        else:
            active = stay[i] > off if active and x[i] <= on else x[i] > on
            left = patience
        bits[i] = active
    return bits


def alarm_bits(
    statistic: FloatArray,
    threshold: float,
    *,
    off_share: float = 0.5,
    stay: FloatArray | None = None,
    patience_s: float = 0.0,
    dt: float,
) -> BoolArray:
    """Return the bit from the statistic's rise above the threshold to its fall below a share of it.

    Parameters
    ----------
    statistic : array (n,)
        NaN: no evidence; the bit goes off unless there is patience.
    threshold : float
        > 0, in the unit of the statistic.
    off_share : float
        0 ... 1. [-]
    stay : array (n,), optional
        Statistic that ends the alarm, in the same unit and never less than the statistic; default the same.
    patience_s, dt : float
        Time that an alarm outlasts missing evidence; sample time. [s]

    Returns
    -------
    bool array (n,)
        Sample by sample, a larger threshold never sets a bit that a smaller one does not.
    """
    x = np.ascontiguousarray(statistic, dtype=np.float64)
    keep = x if stay is None else np.ascontiguousarray(stay, dtype=np.float64)
    bits: BoolArray = _alarm_bits(x, threshold, off_share * threshold, keep, round(patience_s / dt))
    return bits
