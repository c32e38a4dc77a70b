"""Unknown forms of a campaign: slip or resistance departs from the model over speed, depth, pressure or load."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.diagnose.campaign.passes import RESISTANCE, Passes
from aqualog.diagnose.shapes import Mechanism, Shape
from aqualog.diagnose.spline import basis

__all__ = ["explained", "shapes_of"]

OVER = (("v_x",), ("depth",), ("pressure",), ("load",))
USUAL = 0.2  # of the channel's rms
TITLES = {
    "f": "the slip of the front wheels", "r": "the slip of the rear wheels", "left": "the slip of the left wheels",
    "right": "the slip of the right wheels", RESISTANCE: "the resistance of the water",
}  # fmt: skip


def shapes_of(passes: Passes) -> tuple[tuple[Shape, ...], FloatArray]:
    """All functions, and their columns (g, c, K) at a usual size."""
    wet = np.asarray(np.isfinite(passes.values[:, -1]))
    shapes, columns = [], [np.zeros((*passes.values.shape, 0))]
    for name, channels in _channels(passes.names).items():
        usual = USUAL * float(np.sqrt(np.nanmean(passes.values[:, channels] ** 2)))
        unit = "m/s^2" if name == RESISTANCE else "-"
        mechanism = Mechanism(name, TITLES[name.removeprefix("slip_slope_")], name, unit, usual, 0.0, OVER)
        response = np.zeros((len(passes.names), 1))
        response[channels] = usual
        for names in OVER:
            found = basis(names, [passes.coordinates[n] for n in names], wet, 1.0)
            if found is not None:
                shapes.append(Shape(mechanism, names, found))
                columns.append(found.columns[:, None, :] * response)
    return tuple(shapes), np.concatenate(columns, axis=-1)


def _channels(names: Sequence[str]) -> dict[str, list[int]]:
    """Columns of the observations by what departs: an axle's slip, a side's, the resistance."""
    slips = [i for i, n in enumerate(names) if n.startswith("slip_slope_")]
    out = {f"slip_slope_{a}": [i for i in slips if names[i][-2] == a] for a in "fr"}
    out |= {f"slip_slope_{s}": [i for i in slips if names[i][-1] == s[0]] for s in ("left", "right")}
    out[RESISTANCE] = [names.index(RESISTANCE)]
    return {n: c for n, c in out.items() if c}


def explained(passes: Passes, name: str, y: FloatArray, form: FloatArray) -> float:
    """Share of the variance of `y` (g, c), where a mechanism acts, that a form (g, c) explains."""
    c = _channels(passes.names)[name]
    return max(1.0 - float(np.nanvar((y - form)[:, c]) / np.nanvar(y[:, c])), 0.0)
