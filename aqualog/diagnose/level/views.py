"""Residuals of a campaign for the page: one value per run and channel, before and after."""

from __future__ import annotations

import math

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.diagnose.level.passes import RESISTANCE, Passes
from aqualog.diagnose.records import ResidualView

__all__ = ["views"]


def views(name: str, passes: Passes, before: FloatArray, after: FloatArray) -> tuple[ResidualView, ...]:
    """Views of the channels on the water; coordinates are those of the runs, in the order of their speed."""
    order = np.argsort(passes.coordinates["v_x"], kind="stable")
    order = order[np.isfinite(passes.values[order, -1])]
    coordinates = {k: x[order] for k, x in passes.coordinates.items()}
    out = []
    for c, channel in enumerate(passes.names):
        if channel.startswith("dry_"):
            continue
        is_force = channel == RESISTANCE
        title = "resistance on the water" if is_force else f"slip of {channel[-2:]} on water minus slip on dry road"
        unit = "m/s^2" if is_force else "-"
        out.append(
            ResidualView(name, channel, title, unit, math.nan, coordinates, before[order, c], after[order, c])
        )  # fmt: skip
    return tuple(out)
