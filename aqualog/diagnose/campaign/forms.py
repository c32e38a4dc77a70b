"""Unknown forms of a campaign: slip or resistance departs from the model over speed, depth, pressure or load."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.diagnose.campaign.passes import RESISTANCE, Passes
from aqualog.diagnose.competition import Block
from aqualog.diagnose.records import Remainder
from aqualog.diagnose.sets import Sets, fitted_in
from aqualog.diagnose.shapes import Mechanism, Shape
from aqualog.diagnose.spline import basis
from aqualog.diagnose.unexplained import Clear, band, nearest_to

__all__ = ["described", "shapes_of"]

OVER = {"v_x": "speed", "depth": "depth", "pressure": "pressure", "load": "load"}
USUAL = 0.2  # of the channel's rms
ALIKE = 0.2  # share of the best coordinate's probability from which the runs cannot distinguish another


def shapes_of(passes: Passes) -> tuple[tuple[Shape, ...], FloatArray]:
    """All functions, and their columns (g, c, K) at a usual size."""
    wet = np.asarray(np.isfinite(passes.values[:, -1]))
    shapes, columns = [], [np.zeros((*passes.values.shape, 0))]
    for name, channels in _channels(passes.names).items():
        usual = USUAL * float(np.sqrt(np.nanmean(passes.values[:, channels] ** 2)))
        unit = "m/s^2" if name == RESISTANCE else "-"
        mechanism = Mechanism(name, name, name, unit, usual, 0.0, tuple((n,) for n in OVER))
        response = np.zeros((len(passes.names), 1))
        response[channels] = usual
        for names in mechanism.over:
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


def described(
    passes: Passes, shapes: Sequence[Shape], blocks: Sequence[Block], found: Sets, inner: FloatArray, clear: Clear,
    x: FloatArray, y: FloatArray, *, seed: int,
) -> Remainder:  # fmt: skip
    """A form of the best set with its band, from all columns `x` (g, c, K) and the residual `y` (g, c)."""
    block = blocks[clear.first]
    s = shapes[block.tag]
    fit = fitted_in(blocks, inner, found.best)
    own = [fit.columns.index(c) for c in block.columns]
    at = s.basis.at_points * s.mechanism.usual
    f, half = at @ fit.mean[own], band(at, fit.covariance[np.ix_(own, own)], s.basis.supported, seed)
    f, half = (np.where(s.basis.supported, z, np.nan) for z in (f, half))
    proxies = {
        shapes[blocks[m].tag].coordinates[0]
        for m, q in found.blocks.items()
        if blocks[m].kind == "shape" and shapes[blocks[m].tag].mechanism is s.mechanism
        and q >= ALIKE * found.blocks[clear.first]
    }  # fmt: skip
    channels = _channels(passes.names)[s.mechanism.name]
    e = y[:, channels]
    left = e - (x[:, :, list(block.columns)] @ fit.mean[own])[:, channels]
    share = max(1.0 - float(np.nanvar(left) / np.nanvar(e)), 0.0)
    nearest, cosine = nearest_to(blocks, inner, clear.first, fit.mean[own])
    unit = "m/s²" if s.mechanism.name == RESISTANCE else "slip"
    sentence = (
        f"{s.mechanism.name} departs from the model by {np.nanmin(f):+.2g} to {np.nanmax(f):+.2g} ({unit}) over the "
        f"{OVER[s.coordinates[0]]}; the most similar effect is {nearest} (similarity {cosine:.2f} of 1)."
    )
    return Remainder(
        s.mechanism.name, s.coordinates, share, math.nan, s.basis.points, f, f - half, f + half,
        tuple(sorted(proxies - set(s.coordinates))), nearest, cosine, sentence, probability=clear.probability,
    )  # fmt: skip
