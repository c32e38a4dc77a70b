"""Slip over traction as a straight line: slope, offset, and how sure both are."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aqualog.intervals import student_quantile
from aqualog.types import FloatArray

__all__ = ["Interval", "Line", "Trend", "fit_line", "fit_trend", "noise_of_traction"]

LEVEL = 0.95
LEAST_BLOCKS = 5
CORRECTED_FROM = 0.01  # share of k that noise of the traction takes away, from which it is given back
NOISE_MAX = 0.30  # beyond, the correction rests on the noise more than on the data

Interval = tuple[float, float]
_NOWHERE: Interval = (math.nan, math.nan)


@dataclass(frozen=True, slots=True)
class Line:
    """The line s = k mu + delta, and the slip slope C = 1 / k.

    `slope` C_s / F_z [-] with its 95 % interval `slope_ci`; `k` [-] with `k_ci`; `offset` delta [-] with `offset_ci`;
    `scatter` rms of the slip about the line [-]; `attenuation` share of k that the noise of the traction takes away,
    given back where `is_corrected`; `blocks` of neighbouring samples that the intervals rest on. `reason` says why
    there is no slope; then `slope` and `slope_ci` are NaN.
    """

    k: float
    k_ci: Interval
    offset: float
    offset_ci: Interval
    scatter: float
    attenuation: float
    is_corrected: bool
    samples: int
    blocks: int
    reason: str = ""

    @property
    def told(self) -> bool:
        """Whether there is a slope."""
        return not self.reason

    @property
    def slope(self) -> float:
        """C_s / F_z. [-]"""
        return 1.0 / self.k if self.told else math.nan

    @property
    def slope_ci(self) -> Interval:
        """95 % interval of the slope: that of k turned over, exact as long as 0 is outside (Fieller). [-]"""
        return (1.0 / self.k_ci[1], 1.0 / self.k_ci[0]) if self.told else _NOWHERE


@dataclass(frozen=True, slots=True)
class Trend:
    """Relative change of the slope from first to last sample, C(end) / C(start) - 1, with its 95 % interval. [-]"""

    change: float
    change_ci: Interval


def fit_line(mu: FloatArray, slip: FloatArray, label: NDArray[np.int64], *, noise: float = 0.0) -> Line:
    """Regress slip on traction.

    Parameters
    ----------
    mu : array (n,)
        Traction coefficient F_x / F_z. [-]
    slip : array (n,)
        [-]
    label : int array (n,)
        Block of each sample, ascending; blocks are taken to be independent, samples of one block are not.
    noise : float
        Variance of the noise of `mu`. [-]

    Returns
    -------
    Line
        `reason` is set with fewer than 5 blocks, where k = 0 is in its interval, or where more than 30 % of the
        variance of `mu` is noise.

    Slip is the noisy one of the two: regressing traction on it would give a slope that is too low (a published drive:
    28.7 instead of 41.6). Noise of the traction biases k towards 0 by noise / var(mu); beyond 1 % its variance is taken
    off the moments, which is Deming's regression with the noise of the traction known instead of a ratio.

    Intervals: jackknife over the blocks with Student's t; degrees of freedom count the blocks by their information.

    Thesis: Eq. (3.14), reference [15]; the sign of the offset as in E8.
    """
    blocks = int(np.unique(label).size)
    spread = float(np.var(mu)) if mu.size else 0.0
    attenuation = noise / spread if spread > 0.0 else math.nan
    if blocks < LEAST_BLOCKS or not spread > 0.0:
        reason = f"too few stretches of usable driving: {blocks} of at least {LEAST_BLOCKS}"
        return Line(
            math.nan, _NOWHERE, math.nan, _NOWHERE, math.nan, attenuation, is_corrected=False, samples=mu.size,
            blocks=blocks, reason=reason if blocks < LEAST_BLOCKS else "the traction is constant",
        )  # fmt: skip
    is_corrected = CORRECTED_FROM < attenuation <= NOISE_MAX
    one, zero = np.ones_like(mu), np.zeros_like(mu)
    design, noisy = np.column_stack([mu, one]), np.column_stack([one, zero])
    value, half = _jackknife(design, slip, label, noise=noise if is_corrected else 0.0, noisy=noisy)
    k, offset = float(value[0]), float(value[1])
    k_ci = (k - float(half[0]), k + float(half[0]))
    reason = ""
    if attenuation > NOISE_MAX:
        reason = f"{100 * min(attenuation, 1.0):.0f} % of the variation of the traction is noise"
    elif not k_ci[0] > 0.0:
        reason = (
            f"1 / slope is {k:.3f} with a 95 % interval of {k_ci[0]:.3f} ... {k_ci[1]:.3f}, which holds 0: the "
            "traction changes too seldom or too little for the noise of the slip"
        )
    scatter = float(np.sqrt(np.mean((slip - k * mu - offset) ** 2)))
    return Line(
        k, k_ci, offset, (offset - float(half[1]), offset + float(half[1])), scatter, attenuation, is_corrected,
        mu.size, blocks, reason,
    )  # fmt: skip


def fit_trend(
    t: FloatArray, mu: FloatArray, slip: FloatArray, label: NDArray[np.int64], *, noise: float = 0.0
) -> Trend:
    """Change of the slope with time, s = (k + k' tau) mu + delta + delta' tau, tau from -1/2 to 1/2.

    Parameters
    ----------
    t : array (n,)
        [s]
    mu, slip, label, noise
        As in `fit_line`.

    Returns
    -------
    Trend
        The offset may drift too: tyres warm up and grow.
    """
    tau = (t - t[0]) / (t[-1] - t[0]) - 0.5
    zero = np.zeros_like(mu)
    design = np.column_stack([mu, np.ones_like(mu), tau * mu, tau])
    noisy = np.column_stack([np.ones_like(mu), zero, tau, zero])
    is_corrected = CORRECTED_FROM < noise / float(np.var(mu)) <= NOISE_MAX
    value, half = _jackknife(design, slip, label, noise=noise if is_corrected else 0.0, noisy=noisy)
    k = abs(float(value[0]))
    low, middle, high = (_change_of_slope((float(value[2]) + r * float(half[2])) / k) for r in (1.0, 0.0, -1.0))
    return Trend(middle, (low, high))


def _change_of_slope(c: float) -> float:
    """C(end) / C(start) - 1 where 1 / C grows by the share `c` of its middle value, c from -2 to 2."""
    return math.inf if c <= -2.0 else max((1.0 - 0.5 * c) / (1.0 + 0.5 * c), 0.0) - 1.0


def noise_of_traction(mu: FloatArray, slip: FloatArray, is_used: NDArray[np.bool_], *, apart: int, k: float) -> float:
    """Variance of that part of the fast changes of the traction which the slip does not follow.

    Parameters
    ----------
    mu, slip : array (n,)
        Samples in order of time. [-]
    is_used : bool array (n,)
        Which ones are fitted.
    apart : int
        Samples between values whose noise is independent: the length of the smoothing.
    k : float
        Slip per traction, 1 / C. [-]

    Returns
    -------
    variance : float
        Of the samples as they are. 0 where nothing can be told. [-]

    From second differences D: real changes show in both, so var(D mu) - cov(D mu, D s) / k is noise alone, six times.
    Noise that changes more slowly than the smoothing is not seen.
    """
    if mu.size <= 2 * apart or not k > 0.0:
        return 0.0
    whole = is_used[2 * apart :] & is_used[apart:-apart] & is_used[: -2 * apart]
    if np.count_nonzero(whole) < 20:
        return 0.0
    d_mu, d_s = (
        (x[2 * apart :] - 2.0 * x[apart:-apart] + x[: -2 * apart])[whole] for x in (mu, slip)
    )  # fmt: skip
    real = float(np.mean(d_mu * d_s)) / k
    return max(float(np.mean(d_mu * d_mu)) - max(real, 0.0), 0.0) / 6.0


def _jackknife(
    design: FloatArray, y: FloatArray, label: NDArray[np.int64], *, noise: float, noisy: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Least squares with the noise of the design taken off its moments; errors by leaving out one block at a time.

    Parameters
    ----------
    design : array (n, p)
    y : array (n,)
    label : int array (n,)
        Ascending.
    noise : float
        Variance of one noise that enters the columns as `noisy`.
    noisy : array (n, p)

    Returns
    -------
    value, half : array (p,)
        Estimate and half width of the 95 % interval.
    """
    first = np.flatnonzero(np.diff(label, prepend=label[0] - 1))
    unit = np.sqrt(np.mean(design * design, axis=0))  # columns differ by orders of magnitude
    x, c = design / unit, noisy / unit
    h = np.add.reduceat(x[:, :, None] * x[:, None, :] - noise * c[:, :, None] * c[:, None, :], first, axis=0)
    g = np.add.reduceat(x * y[:, None], first, axis=0)
    inverse = np.linalg.pinv(h.sum(axis=0), rcond=1e-9, hermitian=True)
    value = inverse @ g.sum(axis=0)
    without = np.einsum("bij,bj->bi", np.linalg.pinv(h.sum(axis=0) - h, rcond=1e-9, hermitian=True), g.sum(axis=0) - g)
    blocks = first.size
    sigma = np.sqrt((blocks - 1) / blocks * np.sum((without - value) ** 2, axis=0))
    # information of a block about a parameter: what its samples weigh in the estimate
    inform = np.add.reduceat((x @ inverse) ** 2, first, axis=0)
    dof = np.maximum(inform.sum(axis=0) ** 2 / np.sum(inform**2, axis=0) - 1.0, 1.0)
    half = np.array([student_quantile(0.5 + LEVEL / 2.0, float(d)) for d in dof]) * sigma
    return value / unit, half / unit
