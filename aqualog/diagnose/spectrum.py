"""Inner products of residuals under their noise: an autoregression first, the smoothed spectrum of its remainder then.

The autoregression of `noise` handles gaps, outliers and long memory. What it leaves of the colour would inflate some
directions and not others; whitening by the remainder's own cross spectrum takes that off, so that the gain of any
column under noise alone follows its chi-squared distribution. Surrogates of the noise are then draws of normal numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from aqualog.core.records import BoolArray, FloatArray
from aqualog.diagnose.noise import Noise, Spectra, bridged, fit_noise, good_size, spectra, whitened
from aqualog.diagnose.threads import beside

__all__ = ["Weighing", "weighing"]

BANDWIDTH = 0.3  # of the frequency: share that spectra are averaged over to either side
NARROWEST, WIDEST = 10, 40  # bins to either side
SLOPED = 60  # lines whose power may follow a power law
FASTEST_HZ, BLOCK_S = 1.5, 0.1  # half of the log-likelihood counts there: cars pitch at 1 to 2 Hz (K); samples' step
CHUNK = 24  # columns that are transformed together

Complex = npt.NDArray[np.complex128]


@dataclass(frozen=True, slots=True)
class Weighing:
    """Turns residual-shaped arrays (C, n) of one drive into rows whose inner products are twice log-likelihoods.

    `inverse` (F, C, C): roots of the inverse cross spectra of the whitened remainder, `used` (n,) its samples;
    `sharpness`: half the log determinant of the noise's covariance, without a constant, so that half the inner product
    of a residual with itself and this is its negative log-likelihood.
    """

    noise: Noise
    mask: BoolArray
    used: BoolArray
    inverse: Complex
    size: int
    sharpness: float

    @property
    def width(self) -> int:
        """Length of a row."""
        return int(2 * self.inverse.shape[0] * self.inverse.shape[1])

    def surprise(self, residual: FloatArray) -> float:
        """Negative log-likelihood of a residual (C, n), without a constant."""
        row = self.rows(residual[None])[0]
        return self.sharpness + 0.5 * float(row @ row)

    def rows(self, x: FloatArray) -> FloatArray:
        """Arrays (k, C, n) as rows (k, M)."""
        return self._chunks(len(x), lambda at: self._transformed(x[at], np.float64), np.float64)

    def again(self, x: Spectra) -> FloatArray:
        """The rows of arrays whose transforms are known: they stay the same for every noise."""
        return self._chunks(len(x.values), lambda at: self._rows(x.of(range(at.start, at.stop))), x.values.dtype)

    def single(self, x: FloatArray) -> npt.NDArray[np.float32]:
        """The same in single precision, which takes half of memory and time."""
        rows: npt.NDArray[Any] = self._chunks(len(x), lambda at: self._transformed(x[at], np.float32), np.float32)
        return rows

    def _chunks(self, count: int, rows: Callable[[slice], FloatArray], kind: npt.DTypeLike) -> FloatArray:
        """Rows of `count` arrays, chunk by chunk in two threads."""
        out: FloatArray = np.empty((count, self.width), dtype=kind)

        def fill(i: int) -> None:
            at = slice(i, min(i + CHUNK, count))
            out[at] = rows(at)

        beside(fill, range(0, count, CHUNK))
        return out

    def _transformed(self, x: FloatArray, kind: npt.DTypeLike) -> FloatArray:
        return self._rows(spectra(bridged(np.asarray(x, dtype=kind), self.mask)))

    def _rows(self, x: Spectra) -> FloatArray:
        flat = whitened(x, self.noise).reshape(x.values.shape)
        each = _lines(flat[..., self.used], self.size)
        lines = np.matmul(self.inverse.astype(each.dtype), each.transpose(2, 1, 0))  # (F, C, k)
        return np.concatenate([lines.real, lines.imag]).reshape(-1, len(flat)).T


def weighing(
    residuals: Sequence[FloatArray] | FloatArray, mask: BoolArray, contrasts: FloatArray, noise: Noise | None = None
) -> Weighing:  # fmt: skip
    """The weighing by the noise of residuals (C, n) from which known effects have been subtracted.

    Several residuals are draws of one: what is subtracted is not exactly known.
    """
    noise = noise or fit_noise(residuals[0], mask, contrasts)
    used = np.asarray((noise.weights > 0.0).any(axis=0))
    count = int(used.sum())
    size = good_size(count)
    e = whitened(spectra(bridged(np.array(residuals), mask)), noise).reshape(-1, *residuals[0].shape)
    raw = np.fft.rfft(e[..., used], size).transpose(0, 2, 1) / np.sqrt(count)  # (draws, F, C)
    pilot = _power_law((np.abs(raw[:, 1:]) ** 2).mean(axis=0))
    pilot = np.concatenate([pilot[:1], pilot])
    flat = raw[:, 1:] / pilot[1:]
    cross = _averaged(np.einsum("dfi,dfj->fij", flat, flat.conj()) / len(flat))
    cross = np.concatenate([cross[:1].real.astype(complex), cross])
    cross += 1e-6 * np.trace(cross, axis1=1, axis2=2).real[:, None, None] * np.eye(raw.shape[-1])
    root = np.linalg.cholesky(cross) * pilot[:, :, None]
    counts = _trusted(np.arange(raw.shape[1]) / size)
    inverse = np.sqrt(counts)[:, None, None] * np.linalg.inv(root).astype(np.complex128)
    lines = np.full(raw.shape[1], 2.0)
    lines[0] = 1.0
    logdet = 2.0 * np.log(np.abs(np.diagonal(root, axis1=1, axis2=2))).sum(axis=1)
    logdet -= 2.0 * np.log(np.abs(np.fft.rfft(noise.taps, size)) + 1e-12).sum(axis=0)
    share = float(lines @ counts / lines.sum())
    sharpness = share * noise.sharpness + 0.5 * count / size * float((lines * counts) @ logdet)
    return Weighing(noise, mask, used, inverse, size, sharpness)


def _trusted(f: FloatArray) -> FloatArray:
    """Share of the log-likelihood that counts at frequencies f [1/sample]: a simulator without suspension, driveline
    and the tyres' own motion says little of a car's fast movements."""
    return np.asarray(1.0 / (1.0 + (f / (FASTEST_HZ * BLOCK_S)) ** 4))


def _lines(x: FloatArray, size: int) -> Complex:
    """Fourier lines (..., F), scaled so that their squares sum to the signal's."""
    lines = np.fft.rfft(x, size, axis=-1) * math.sqrt(2.0 / size)
    lines[..., 0] *= math.sqrt(0.5)
    if size % 2 == 0:
        lines[..., -1] *= math.sqrt(0.5)
    return np.asarray(lines)


def _power_law(power: FloatArray) -> FloatArray:
    """Amplitude (F, C) of f^-b at low frequencies, b >= 0, and constant beyond, from periodograms (F, C)."""
    k = np.arange(1, power.shape[0] + 1, dtype=np.float64)
    low = slice(0, min(SLOPED, power.shape[0]))
    x = np.log(k[low])
    y = np.log(power[low] + 1e-300)
    slope = (x - x.mean()) @ (y - y.mean(axis=0)) / ((x - x.mean()) @ (x - x.mean()))
    b = np.clip(-slope, 0.0, 2.0)
    return np.asarray((SLOPED / np.minimum(k, SLOPED))[:, None] ** (0.5 * b), dtype=np.float64)


def _averaged(cross: Complex) -> Complex:
    """Means over neighbouring frequencies of cross-spectra (F, C, C), reflected at both ends."""
    count = cross.shape[0]
    reach = np.clip((BANDWIDTH * np.arange(count)).astype(np.int64), NARROWEST, WIDEST)
    width = min(WIDEST, count - 1)
    reach = np.minimum(reach, width)
    padded = np.concatenate([cross[width:0:-1].conj(), cross, cross[-2 : -width - 2 : -1].conj()])
    total = np.concatenate([np.zeros((1, *cross.shape[1:])), np.cumsum(padded, axis=0)])
    at = np.arange(count) + width
    means: Complex = (total[at + reach + 1] - total[at - reach]) / (2.0 * reach + 1.0)[:, None, None]
    return means
