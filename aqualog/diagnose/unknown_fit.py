"""Fit of a penalised spline to a whitened residual, in the coordinates where it falls into independent parts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from aqualog.core.records import FloatArray

__all__ = [
    "Parts",
    "energies",
    "noise_level",
    "noise_like",
    "null_scores",
    "parts_of",
    "roughness",
    "simultaneous",
    "weights",
]

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


BANDWIDTH = 0.3  # of the frequency: share that spectra are averaged over to either side
NARROWEST, WIDEST = 10, 40  # bins to either side
LOWEST = 400  # lines in which functions of a coordinate are looked for
SLOPED = 60  # lines whose power may follow a power law


def noise_like(rows: FloatArray, count: int, rng: np.random.Generator) -> FloatArray:
    """Gaussian noise (count, C, n) with the smoothed spectra and cross-spectra of a whitened residual (C, n).

    Spectra are averaged over neighbouring frequencies, so that peaks of an effect do not count as noise; below `SLOPED`
    they follow a power law, for long-lived noise that the whitening has left. Samples at which all rows are zero stay
    zero.
    """
    used = (rows != 0.0).any(axis=0)
    x = rows[:, used]
    n = x.shape[1]
    lines = np.fft.rfft(x, axis=1)[:, 1:].T
    pilot = _power_law(np.abs(lines) ** 2)
    flat = lines / pilot
    cross = _averaged(flat[:, :, None] * flat[:, None, :].conj())
    cross += 1e-9 * np.trace(cross, axis1=1, axis2=2).real[:, None, None] * np.eye(rows.shape[0])
    root = np.linalg.cholesky(cross) * pilot[:, :, None]
    out = np.zeros((count, *rows.shape))
    for i in range(count):
        xi = rng.standard_normal((2, *lines.shape)) * np.sqrt(0.5)
        drawn = np.einsum("fij,fj->if", root, xi[0] + 1j * xi[1])
        out[i][:, used] = np.fft.irfft(np.concatenate([np.zeros((rows.shape[0], 1)), drawn], axis=1), n=n, axis=1)
    return out


def _power_law(power: FloatArray) -> FloatArray:
    """Amplitude (F, C) of f^-b at low frequencies, b >= 0, and constant beyond, from periodograms (F, C)."""
    k = np.arange(1, power.shape[0] + 1, dtype=np.float64)
    low = slice(0, min(SLOPED, power.shape[0]))
    x = np.log(k[low])
    y = np.log(power[low] + 1e-300)
    slope = (x - x.mean()) @ (y - y.mean(axis=0)) / ((x - x.mean()) @ (x - x.mean()))
    b = np.clip(-slope, 0.0, 2.0)
    return np.asarray((SLOPED / np.minimum(k, SLOPED))[:, None] ** (0.5 * b), dtype=np.float64)


def _averaged(cross: npt.NDArray[np.complex128]) -> npt.NDArray[np.complex128]:
    """Means over neighbouring frequencies of cross-spectra (F, C, C), reflected at both ends."""
    count = cross.shape[0]
    reach = np.clip((BANDWIDTH * np.arange(count)).astype(np.int64), NARROWEST, WIDEST)
    width = min(WIDEST, count - 1)
    reach = np.minimum(reach, width)
    padded = np.concatenate([cross[width:0:-1].conj(), cross, cross[-2 : -width - 2 : -1].conj()])
    total = np.concatenate([np.zeros((1, *cross.shape[1:])), np.cumsum(padded, axis=0)])
    at = np.arange(count) + width
    means: npt.NDArray[np.complex128] = (total[at + reach + 1] - total[at - reach]) / (2.0 * reach + 1.0)[:, None, None]
    return means


def noise_level(part: FloatArray, rows: FloatArray, shape: tuple[int, int]) -> FloatArray:
    """Energy of each whitened series (N, m) beside a function, per dimension: (m,), 1 under white unit noise.

    Uses the remainder after the function, over the frequencies of the function and their neighbours. The explained part
    is compared with this energy, so that neither the residual's own spectrum nor an effect in it sets the scale.

    Parameters
    ----------
    part : (N, K)
        Orthonormal whitened columns of the function.
    rows : (N, m)
        Whitened series; N = C n in the order of `shape`.
    """
    n = shape[1]
    own = _lines(part, shape)
    held = (np.abs(own) ** 2).sum(axis=-1) / n
    width = min(NARROWEST, held.shape[1] - 1)
    padded = np.pad(held, ((0, 0), (width, width)), mode="reflect")
    near = np.lib.stride_tricks.sliding_window_view(padded, 2 * width + 1, axis=1).mean(axis=-1)
    left = _lines(rows, shape) - own @ (part.T @ rows)
    energy = np.einsum("cf,cfm->m", near, np.abs(left) ** 2) * 2.0 / n
    return np.asarray(energy / max(2.0 * float((near * (1.0 - held)).sum()), 1e-12), dtype=np.float64)


def _lines(rows: FloatArray, shape: tuple[int, int]) -> npt.NDArray[np.complex128]:
    """Fourier lines (C, F, m) of whitened series, the lowest ones without the constant."""
    lines = np.fft.rfft(rows.reshape(*shape, -1), axis=1)[:, 1 : LOWEST + 1]
    return np.asarray(lines, dtype=np.complex128)


def null_scores(ratios: FloatArray) -> FloatArray:
    """Scores that are about standard normal under noise, from ratios of energies.

    Parameters
    ----------
    ratios : (..., 1 + S)
        The residual's own first, then those of its surrogates, each positive.

    Returns
    -------
    scores : (..., 1 + S)
        Logarithms (Fisher's z [fisher1924], K) by mean and standard deviation of the surrogates'. Each surrogate is
        judged by the others, in the same way as the residual.
    """
    z = np.log(np.maximum(ratios, 1e-300))
    null = z[..., 1:] - z[..., 1:].mean(axis=-1, keepdims=True)
    z = z - z[..., 1:].mean(axis=-1, keepdims=True)
    count = null.shape[-1]
    squares = (null * null).sum(axis=-1, keepdims=True)
    mean = np.concatenate([np.zeros_like(squares), -null / (count - 1)], axis=-1)
    square = np.concatenate([squares / count, (squares - null * null) / (count - 1)], axis=-1)
    sd = np.sqrt(np.maximum(square - mean * mean, 1e-12))
    return np.asarray((z - mean) / sd, dtype=np.float64)
