"""Inner products of residuals under their noise: an autoregression first, the smoothed spectrum of its remainder then.
What the autoregression of `noise` leaves of the colour is taken off by the remainder's own cross spectrum, so that the
gain of any column under noise alone follows its chi-squared distribution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from aqualog.core.compiled import compiled, plain
from aqualog.core.records import BoolArray, FloatArray
from aqualog.diagnose.noise import Noise, bridged, fit_noise, good_size, whitened
from aqualog.diagnose.threads import beside

__all__ = ["Weighing", "weighing"]

BANDWIDTH = 0.3  # of the frequency: share that spectra are averaged over to either side
NARROWEST, WIDEST = 10, 40  # bins to either side
SLOPED = 60  # lines whose power may follow a power law
FASTEST_HZ, BLOCK_S = 1.5, 0.1  # half of the log-likelihood counts there: cars pitch at 1 to 2 Hz (K); samples' step
LAST_HZ = 3.0  # of the lines beyond, of which less than 6 % would count, there are two in five
CHUNK, TILE = 6, 256  # columns, and their lines, that are transformed together and stay in the processor's memory


@dataclass(frozen=True, slots=True)
class Weighing:
    """Turns residual-shaped arrays (C, n) of one drive into rows whose inner products are twice log-likelihoods.

    `inverse` (2, C, C, F): real and imaginary parts of roots of the inverse cross spectra of the whitened remainder,
    lower triangular, scaled so that the squares of lines sum to the signal's; `used` (n,) its samples; `sharpness`:
    half the log determinant of the noise's covariance, without a constant.
    """

    noise: Noise
    mask: BoolArray
    used: BoolArray
    inverse: FloatArray
    size: int
    sharpness: float

    @property
    def width(self) -> int:
        """Length of a row."""
        return int(2 * self.inverse.shape[2] * self.inverse.shape[3])

    def surprise(self, residual: FloatArray) -> float:
        """Negative log-likelihood of a residual (C, n), without a constant."""
        row = self.rows(residual[None])[0]
        return self.sharpness + 0.5 * float(row @ row)

    def rows(self, x: FloatArray, kind: npt.DTypeLike = np.float64) -> FloatArray:
        """Arrays (k, C, n) as rows (k, M); single precision takes half of memory."""
        out: FloatArray = np.empty((len(x), self.width), dtype=kind)

        def fill(i: int) -> None:
            own = x[i : i + CHUNK]
            flat = whitened(bridged(own, self.mask), self.noise, self.used).reshape(*own.shape[:2], -1)
            lines = np.fft.rfft(flat, self.size)[..., : self.inverse.shape[3]]
            _unrelated(*plain(lines, self.inverse), out[i : i + CHUNK].reshape(len(own), 2, *lines.shape[1:]))

        beside(fill, range(0, len(x), CHUNK))
        return out


@compiled
def _unrelated(lines, inverse, out):  # type: ignore[no-untyped-def]
    """Fill real and imaginary parts (k, 2, C, F) of the channels' lines (k, C, F), made independent of each other."""
    k, C, F = lines.shape
    x, re, im = np.empty((2, C, TILE)), np.empty(TILE), np.empty(TILE)
    for low in range(0, F, TILE):
        n = min(TILE, F - low)
        at = slice(low, low + n)
        for i in range(k):
            for c in range(C):
                for f in range(n):  # an assignment of arrays compiles a message about shapes, for 3 s
                    x[0, c, f], x[1, c, f] = lines[i, c, low + f].real, lines[i, c, low + f].imag
            for c in range(C):
                re[:] = 0.0
                im[:] = 0.0
                for j in range(c + 1):
                    a, b, p, q = inverse[0, c, j, at], inverse[1, c, j, at], x[0, j], x[1, j]
                    for f in range(n):
                        re[f] += a[f] * p[f] - b[f] * q[f]
                        im[f] += a[f] * q[f] + b[f] * p[f]
                for f in range(n):
                    out[i, 0, c, low + f], out[i, 1, c, low + f] = re[f], im[f]


def weighing(residuals: Sequence[FloatArray] | FloatArray, mask: BoolArray, contrasts: FloatArray) -> Weighing:
    """The weighing by the noise of residuals (C, n) from which known effects have been subtracted; several are draws of
    one."""
    noise = fit_noise(residuals[0], mask, contrasts)
    used = np.asarray((noise.weights > 0.0).any(axis=0))
    count = int(used.sum())
    size = good_size(count)
    e = whitened(bridged(np.array(residuals), mask), noise, used).reshape(len(residuals), -1, count)
    raw = np.fft.rfft(e, size).transpose(0, 2, 1) / np.sqrt(count)  # (draws, F, C)
    pilot = _power_law((np.abs(raw[:, 1:]) ** 2).mean(axis=0))
    pilot = np.concatenate([pilot[:1], pilot])
    flat = raw[:, 1:] / pilot[1:]
    cross = _averaged(np.einsum("dfi,dfj->fij", flat, flat.conj()) / len(flat))
    cross = np.concatenate([cross[:1].real.astype(complex), cross])
    cross += 1e-6 * np.trace(cross, axis1=1, axis2=2).real[:, None, None] * np.eye(raw.shape[-1])
    lines = np.full(raw.shape[1], 2.0)
    lines[0] = 1.0
    last = int(size * LAST_HZ * BLOCK_S) + 1
    root = np.linalg.cholesky(cross[:last]) * pilot[:last, :, None]
    # the share of the log-likelihood that counts: a simulator without suspension, driveline and the tyres' own motion
    # says little of a car's fast movements
    counts = 1.0 / (1.0 + (np.arange(last) / size / (FASTEST_HZ * BLOCK_S)) ** 4)
    scale = lines[:last] / size
    inverse = np.sqrt(counts * scale) * np.linalg.inv(root).transpose(1, 2, 0)
    logdet = 2.0 * np.log(np.abs(np.diagonal(root, axis1=1, axis2=2))).sum(axis=1)
    logdet -= 2.0 * np.log(np.abs(np.fft.rfft(noise.taps, size)[:, :last]) + 1e-12).sum(axis=0)
    share = float(lines[:last] @ counts / lines.sum())
    sharpness = share * noise.sharpness + 0.5 * count / size * float((lines[:last] * counts) @ logdet)
    return Weighing(noise, mask, used, np.array([inverse.real, inverse.imag]), size, sharpness)


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
