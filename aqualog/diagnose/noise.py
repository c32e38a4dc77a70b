"""Coloured noise of residual channels: an autoregression with a long memory, and whitening. The channels are combined
so that they share little noise, each combination follows an autoregression on its last samples and on means over ever
longer stretches of its past (up to 13 s), and the remainders are made uncorrelated across the combinations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aqualog.core.compiled import compiled, plain
from aqualog.core.records import BoolArray, FloatArray

__all__ = [
    "MEMORY", "Noise", "bridged", "fit_noise", "for_mask", "good_size", "white_noise", "whitened",
]  # fmt: skip

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
