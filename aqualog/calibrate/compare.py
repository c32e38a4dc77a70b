"""Test whether the car of one drive is heavier than that of others, with an interval for one more drive of the kind."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from aqualog.calibrate.spread import half_width

__all__ = ["LEAST_DRIVES", "mass_difference"]

LEAST_DRIVES = 2


def mass_difference(mass: float, sd: float, others: Sequence[float]) -> tuple[float, float, float]:
    """Return the difference between a drive's mass and the mean of others, with the 95 % interval.

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

    Two drives with the same load differ by driver, fuel, rig, driveline temperature and all else that the balance does
    not know. The scatter among the other drives, times sqrt(1 + 1/J), is the difference to expect of this drive without
    any load. Its own scatter counts where it is larger.
    """
    n = len(others)
    if n < LEAST_DRIVES:
        return math.nan, math.nan, math.nan
    spread = float(np.std(others, ddof=1))
    half = half_width(math.sqrt(max(spread, sd) ** 2 + spread**2 / n), n - 1.0)
    difference = mass - float(np.mean(others))
    return difference, difference - half, difference + half
