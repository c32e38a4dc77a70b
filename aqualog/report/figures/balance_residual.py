"""Residual of the force balance before and after a calibration, over speed and wheel force."""

from __future__ import annotations

from typing import Any

import numpy as np

from aqualog.calibrate.records import Calibration
from aqualog.core.records import FloatArray
from aqualog.report.figures.slope_axes import axis, layout, rounded
from aqualog.report.theme import MUTED, wheel_colour

__all__ = ["balance_residuals"]

_MOST_DOTS = 6000
_BEFORE, _AFTER = MUTED, wheel_colour("fl")


def balance_residuals(c: Calibration) -> list[dict[str, Any]]:
    """Two figures: residual over speed, residual over wheel force."""
    v, force, before, after = (
        np.concatenate([getattr(d, name) for d in c.drives]) for name in ("v", "force", "before", "after")
    )
    return [
        _figure(3.6 * v, before, after, "residual over speed", "speed [km/h]"),
        _figure(1e-3 * force, before, after, "residual over wheel force", "force of the wheel torques [kN]"),
    ]


def _figure(x: FloatArray, before: FloatArray, after: FloatArray, title: str, label: str) -> dict[str, Any]:
    step = max(1, -(-x.size // _MOST_DOTS))
    data = [
        {
            "type": "scatter", "mode": "markers", "name": name, "x": rounded(x[::step]), "y": rounded(y[::step]),
            "marker": {"color": colour, "size": 5, "opacity": 0.5}, "hoverinfo": "skip",
        }
        for name, y, colour in (("vehicle file", before, _BEFORE), ("calibrated", after, _AFTER))
    ]  # fmt: skip
    return {"data": data, "layout": layout(title, axis(label), axis("measured minus expected [m/s²]"))}
