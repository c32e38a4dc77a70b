"""Coloured noise of residual channels: an autoregression with a long memory, and the smoothed spectrum of its
remainder.

The channels are combined so that they share little noise, each combination follows an autoregression on its last
samples and on means over ever longer stretches of its past (up to 13 s), and the remainders are made uncorrelated
across the combinations. What colour is left is taken off by the remainder's own cross spectrum, so that the gain of any
column under noise alone follows its chi-squared distribution.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from aqualog.core.compiled import compiled, plain
from aqualog.core.records import BoolArray, FloatArray
from aqualog.diagnose.threads import beside

__all__ = ["MEMORY", "Noise", "Weighing", "bridged", "fit_noise", "for_mask", "weighing", "white_noise", "whitened"]

# lags of the autoregression, from ... to, as means [samples]
_BLOCKS = (
    (1, 1), (2, 2), (3, 3), (4, 4), (5, 5), (6, 6), (7, 10), (11, 18), (19, 34), (35, 66), (67, 130),
)  # fmt: skip
_EDGES = np.array([0, *(b for _, b in _BLOCKS)])
_ORDERS = np.array([1, 2, 3, 4, 6, 8, 9, 10, 11])
MEMORY = 130
AFTER_GAP = 6  # [samples] whose past is bridged
HUBER = 3.0  # [sd] larger innovations weigh less
AROUND, FEW = 100, 20.0  # [samples] to either side, over which their size is found; of the whole drive's that count too
RIDGE = 1e-6
# [m/s^2], [m/s], [N] white noise that every channel is taken to have besides: without it, every smooth signal would be
# predictable from its past and would count as noise
FLOOR = 5e-3
BANDWIDTH = 0.3  # of the frequency: share that spectra are averaged over to either side
NARROWEST, WIDEST = 10, 40  # bins to either side
SLOPED = 60  # lines whose power may follow a power law
FASTEST_HZ, BLOCK_S = 1.5, 0.1  # half of the log-likelihood counts there: cars pitch at 1 to 2 Hz (K); samples' step
LAST_HZ = 3.0  # of the lines beyond, of which less than 6 % would count, there are two in five
CHUNK, TILE = 6, 256  # columns, and their lines, that are transformed together and stay in the processor's memory


@dataclass(frozen=True, slots=True)
class Noise:
    """`rotation` (C, C) from channels to scaled contrasts, `taps` (C, 131) of the whitening filters, `shaping` (C, C)
    from their innovations to unit ones, `weights` (C, n) square roots of the robust weights, 0 where masked.
    """

    rotation: FloatArray
    taps: FloatArray
    shaping: FloatArray
    weights: FloatArray

    @property
    def sharpness(self) -> float:
        """Half the log determinant of its covariance, without a constant."""
        sharp = np.log(np.abs(np.diag(self.shaping))).sum() + np.linalg.slogdet(self.rotation)[1]
        used = self.weights > 0.0
        return -float(sharp) * float(used.sum()) / len(self.taps) - float(np.log(self.weights[used]).sum())


def bridged(x: FloatArray, mask: BoolArray) -> FloatArray:
    """Masked samples by straight lines between usable ones, in the precision of x. (..., n)"""
    if mask.all():
        return x
    good = np.flatnonzero(mask)
    if good.size == 0:
        return np.zeros_like(x)
    bad = np.flatnonzero(~mask)
    after = np.searchsorted(good, bad)
    left, right = good[np.maximum(after - 1, 0)], good[np.minimum(after, good.size - 1)]
    share = np.clip((bad - left) / np.maximum(right - left, 1), 0.0, 1.0)
    share = share.astype(x.dtype)
    out = x.copy()
    out[..., bad] = (1.0 - share) * x[..., left] + share * x[..., right]
    return out


def good_size(n: int) -> int:
    """Smallest size from n on with small prime factors."""
    odd = (1, 3, 5, 9, 15, 25, 45, 75, 225)
    return min(k << max((n - 1) // k, 0).bit_length() for k in odd)


def fit_noise(residual: FloatArray, mask: BoolArray, contrasts: FloatArray) -> Noise:
    """Noise of a residual (C, n), known effects subtracted, on its usable samples `mask` (n,): some hundreds at least.
    `contrasts` (C, C): combinations of channels that share little noise, as rows. The order is chosen per contrast by
    Akaike's criterion [akaike1974]. Innovations beyond 3 standard deviations weigh less (Huber [huber1981])."""
    x = bridged(residual, mask)
    used = _settled(mask)
    C, n = x.shape
    scale = np.maximum((contrasts @ x)[:, mask].std(axis=1), FLOOR)
    rotation = contrasts / scale[:, None]
    z = rotation @ x
    # an offset is an effect, not noise: an autoregression would take it for a slow wave
    z = z - z[:, mask].mean(axis=1, keepdims=True)
    taps = np.zeros((C, MEMORY + 1))
    weights: FloatArray = np.ones((C, n)) * used
    for _ in range(2):
        for c in range(C):
            taps[c] = _autoregression(z[c], weights[c], (FLOOR / float(scale[c])) ** 2)
        e = whitened(z[None], Noise(np.eye(C), taps, np.eye(C), np.ones((C, 1)))).reshape(C, n)
        local = _local(e, used)
        size = np.abs(e) / local
        robust = np.where(size > HUBER, HUBER / np.maximum(size, 1e-12), 1.0) * used
        weights = robust / (local / np.exp(np.log(local).mean(axis=1, keepdims=True))) ** 2
    count = robust.sum(axis=1)
    root = np.sqrt(weights)
    loss = np.array([np.count_nonzero(t) for t in taps], dtype=np.float64)
    cov = (e * root) @ (e * root).T / np.sqrt(np.outer(count - loss, count - loss))
    cov += RIDGE * np.diag(np.diag(cov)) + np.diag((FLOOR / scale) ** 2)
    shaping = np.linalg.inv(np.linalg.cholesky(cov))
    return Noise(rotation, taps, shaping, root)


def white_noise(residual: FloatArray, mask: BoolArray, contrasts: FloatArray, *, whole: bool = False) -> Noise:
    """Noise without colour, of the size of the steps from sample to sample, or of the `whole` residual."""
    x = contrasts @ bridged(residual, mask)
    steps = x[:, mask] if whole else np.diff(x, axis=1) * np.sqrt(0.5)
    scale = np.maximum(1.4826 * np.median(np.abs(steps), axis=1), FLOOR)
    taps = np.zeros((len(scale), MEMORY + 1))
    taps[:, 0] = 1.0
    return Noise(contrasts / scale[:, None], taps, np.eye(len(scale)), np.ones((len(scale), 1)) * _settled(mask))


def for_mask(noise: Noise, mask: BoolArray) -> Noise:
    """The same noise on another drive: full weight wherever it can be used."""
    return Noise(noise.rotation, noise.taps, noise.shaping, np.ones((len(noise.taps), 1)) * _settled(mask))


def _local(e: FloatArray, used: BoolArray) -> FloatArray:
    """Size of innovations (C, n) over the samples around each: rough roads and slow wheels make more noise. (C, n)"""
    usual: FloatArray = 1.4826 * np.median(np.abs(e[:, used]), axis=1, keepdims=True) + 1e-15
    count = _around(used.astype(np.float64)) + FEW
    local = np.broadcast_to(usual, e.shape)
    for _ in range(2):
        # an outlier must not make its neighbours look small, nor a rough stretch its own samples look like outliers
        square = np.where(used, np.minimum(np.abs(e), HUBER * local), 0.0) ** 2
        # samples of the whole drive besides: a stretch with few of its own has the size of all
        local = np.sqrt((_around(square) + usual**2 * FEW) / count)
    return np.asarray(local)


def _around(x: FloatArray) -> FloatArray:
    """Sums over the samples around each. (..., n)"""
    total = np.cumsum(np.pad(x, [(0, 0)] * (x.ndim - 1) + [(AROUND + 1, AROUND)]), axis=-1)
    return np.asarray(total[..., 2 * AROUND + 1 :] - total[..., : -2 * AROUND - 1])


def _settled(mask: BoolArray) -> BoolArray:
    """Usable samples whose nearest past is usable too."""
    good = mask.astype(np.float64)
    past = np.convolve(good, np.ones(AFTER_GAP + 1), "full")[: mask.size]
    settled = past > AFTER_GAP + 0.5
    settled[:AFTER_GAP] = mask[:AFTER_GAP]
    return np.asarray(settled)


def _autoregression(z: FloatArray, weights: FloatArray, white: float) -> FloatArray:
    """Taps (131,) of the whitening filter of one channel: weighted least squares, order by Akaike's criterion."""
    total = np.cumsum(np.concatenate([[0.0], np.full(MEMORY, z[:10].mean()), z]))
    totals = np.array([total[MEMORY - b : MEMORY - b + z.size] for b in _EDGES.tolist()])
    root = np.sqrt(weights)
    A = (totals[:-1] - totals[1:]) / np.diff(_EDGES)[:, None] * root
    y = z * root
    gram, right, power = A @ A.T, A @ y, float(y @ y)
    count = max(float(weights.sum()), 10.0)
    # as if white noise of the floor were added: of means over blocks it leaves less
    power += count * white
    gram += RIDGE * np.diag(np.diag(gram)) + np.diag([count * white / (b - a + 1) + 1e-30 for a, b in _BLOCKS])
    # orders are leading blocks of one factor: what each explains is a sum of squares
    explained = np.cumsum(np.linalg.solve(np.linalg.cholesky(gram), right) ** 2)[_ORDERS - 1]
    order = _ORDERS[np.argmin(count * np.log(np.maximum(power - explained, 1e-30)) + 2.0 * _ORDERS)]
    chosen = np.linalg.solve(gram[:order, :order], right[:order])
    taps = np.zeros(MEMORY + 1)
    taps[0] = 1.0
    for share, (a, b) in zip(chosen.tolist(), _BLOCKS, strict=False):
        taps[a : b + 1] -= share / (b - a + 1)
    return taps


def whitened(x: FloatArray, noise: Noise, used: BoolArray | None = None) -> FloatArray:
    """Arrays (k, C, n), bridged, as independent unit innovations, flat: (k, C n), or of the m `used` samples: (k, C m).
    Their first second replaces the unknown past. Inner products are in units of twice the log-likelihood; masked
    samples are zero."""
    kept = np.arange(x.shape[-1]) if used is None else np.flatnonzero(used)
    out = np.empty((*x.shape[:-1], kept.size))
    shares = np.diff(np.pad(-noise.taps[:, [a for a, _ in _BLOCKS]], [(0, 0), (1, 1)]))
    weights = np.broadcast_to(noise.weights, x.shape[1:])
    _whiten(*plain(x, noise.rotation, shares, weights, noise.shaping, kept), out)
    return out.reshape(len(x), -1)


@compiled
def _whiten(x, rotation, shares, weights, shaping, kept, out):  # type: ignore[no-untyped-def]
    """Fill the innovations of arrays: what each combination is beyond its last samples and means over blocks of them.
    These are differences of running totals: `shares` (C, 12) are those of the totals up to each edge."""
    _, C, n = x.shape
    m = kept.size
    e = np.empty((C, n))
    z = np.empty(n + MEMORY)
    total = np.zeros(n + MEMORY + 1)
    for i in range(x.shape[0]):
        for c in range(C):
            now, own = z[MEMORY:], e[c]
            now[:] = 0.0
            for j in range(C):
                share = rotation[c, j]
                for t in range(n if share != 0.0 else 0):
                    now[t] += share * x[i, j, t]
            z[:MEMORY] = now[:10].mean()
            for t in range(n + MEMORY):
                total[t + 1] = total[t] + z[t]
            for t in range(n):  # an assignment of arrays compiles a message about shapes, for 3 s
                own[t] = now[t]
            for b in range(0, _EDGES.size, 4):
                p, q, r, s = shares[c, b], shares[c, b + 1], shares[c, b + 2], shares[c, b + 3]
                P, Q = total[MEMORY - _EDGES[b] :], total[MEMORY - _EDGES[b + 1] :]
                R, S = total[MEMORY - _EDGES[b + 2] :], total[MEMORY - _EDGES[b + 3] :]
                for t in range(n):
                    own[t] -= p * P[t] + q * Q[t] + r * R[t] + s * S[t]
            for t in range(n):
                own[t] *= weights[c, t]
            for t in range(m if m < n else 0):
                own[t] = own[kept[t]]  # they ascend
        for c in range(C):
            to = out[i, c]
            to[:] = 0.0
            for j in range(c + 1):  # the inverse of a Cholesky factor
                share = shaping[c, j]
                for t in range(m):
                    to[t] += share * e[j, t]


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
