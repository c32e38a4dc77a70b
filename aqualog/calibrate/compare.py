"""Is one drive's car heavier than that of others: an interval for one more drive of the same kind."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from aqualog.calibrate.spread import half_width

__all__ = ["LEAST_DRIVES", "mass_difference"]

LEAST_DRIVES = 2


def mass_difference(mass: float, sd: float, others: Sequence[float]) -> tuple[float, float, float]:
    """Difference of a drive's mass to the mean of others, with the 95 % interval.

    Parameters
    ----------
    mass, sd : float
        Of the drive, and its standard deviation within the drive. [kg]
    others : sequence of float
        Masses by the other drives, each from that drive alone. [kg]

    Returns
    -------
    difference, low, high : float
        NaN with fewer than two others. [kg]

    Two drives of the same load differ by driver, fuel, rig, temperature of the driveline and all else that the balance
    does not know. What the others differ by among themselves, times sqrt(1 + 1/J), is what this drive may differ by
    without any load; its own scatter counts where it is larger.
    """
    n = len(others)
    if n < LEAST_DRIVES:
        return math.nan, math.nan, math.nan
    spread = float(np.std(others, ddof=1))
    half = half_width(math.sqrt(max(spread, sd) ** 2 + spread**2 / n), n - 1.0)
    difference = mass - float(np.mean(others))
    return difference, difference - half, difference + half
