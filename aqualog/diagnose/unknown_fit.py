"""Fit of a penalised spline to a whitened residual, in the coordinates where it falls into independent parts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aqualog.core.records import FloatArray

__all__ = ["Parts", "energies", "parts_of", "roughness", "simultaneous", "weights"]

FREEDOM = (1.5, 3.0, 6.0, 12.0)  # degrees of freedom at which a function is looked for
ROUGHNESS = np.logspace(-9.0, 6.0, 61)  # relative to the data
DRAWS = 1000  # for the simultaneous band
_SINGULAR = 1e-9


class Parts(NamedTuple):
    """Directions (K, P) of the coefficients in which data and penalty are both diagonal.

    A direction has unit information; `stiffness` (P,) is its penalty, zero for a straight line.
    """

    directions: FloatArray
    stiffness: FloatArray


def parts_of(gram: FloatArray, penalty: FloatArray) -> Parts:
    """Of whitened columns with this Gram matrix; directions without information in the data are left out."""
    values, vectors = np.linalg.eigh(gram)
    seen = values > _SINGULAR * max(float(values[-1]), 1e-300)
    white = vectors[:, seen] / np.sqrt(values[seen])
    stiffness, turn = np.linalg.eigh(white.T @ penalty @ white)
    return Parts(white @ turn, np.clip(np.asarray(stiffness, dtype=np.float64), 0.0, None))


def weights(stiffness: FloatArray, lam: float) -> FloatArray:
    """Share of each part that a fit of this roughness penalty keeps."""
    return np.asarray(1.0 / (1.0 + lam * stiffness), dtype=np.float64)


def energies(parts: Parts, loads: FloatArray) -> FloatArray:
    """Energies (len(FREEDOM), m) that functions of several smoothnesses take out of m residuals.

    `loads` (K, m): whitened columns times whitened residuals.
    """
    z2 = (parts.directions.T @ loads) ** 2
    grid = _scaled(parts.stiffness)
    freedom = np.array([weights(parts.stiffness, lam).sum() for lam in grid])
    # freedom falls over the grid
    chosen = [float(np.interp(-min(d, freedom[0]), -freedom, np.log(grid))) for d in FREEDOM]
    return np.stack([weights(parts.stiffness, float(np.exp(g))) @ z2 for g in chosen])


def roughness(parts: Parts, load: FloatArray, dispersion: float) -> float:
    """Penalty factor of the largest restricted likelihood, for a noise `dispersion` times the whitened one."""
    z2 = (parts.directions.T @ load) ** 2 / dispersion
    grid = _scaled(parts.stiffness)
    bent = parts.stiffness > 1e-12 * max(float(parts.stiffness.max(initial=0.0)), 1e-300)
    if not bent.any():
        return float(grid[0])
    excess = 1.0 + 1.0 / (grid[:, None] * parts.stiffness[bent])
    likelihood = -0.5 * (np.log(excess) + z2[bent] / excess).sum(axis=1)
    return float(grid[int(np.argmax(likelihood))])


def _scaled(stiffness: FloatArray) -> FloatArray:
    positive = stiffness[stiffness > 0.0]
    return np.asarray(ROUGHNESS / (np.median(positive) if positive.size else 1.0), dtype=np.float64)


def simultaneous(at_points: FloatArray, root: FloatArray, rng: np.random.Generator) -> tuple[FloatArray, float]:
    """Standard deviation (k,) of a function at points, and the factor of its simultaneous 95 % band.

    `root` (K, P): a square root of the coefficients' covariance.
    """
    spread = at_points @ root
    sd: FloatArray = np.sqrt((spread * spread).sum(axis=1))
    ok = sd > 0.0
    if not ok.any():
        return sd, 0.0
    draws = np.abs(spread[ok] @ rng.standard_normal((root.shape[1], DRAWS))) / sd[ok, None]
    return sd, float(np.quantile(draws.max(axis=0), 0.95))
