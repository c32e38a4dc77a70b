"""Fit slip over traction with a straight line: slope, offset, and their intervals."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aqualog.core.intervals import NOWHERE, Interval
from aqualog.core.moments import Design, Noise, second_difference
from aqualog.core.records import BoolArray, FloatArray
from aqualog.core.regression import NOISE_MAX, jackknife

__all__ = ["Late", "Line", "Trend", "fit_line", "fit_trend", "lag_of_slip", "noise_of_traction"]

LEAST_BLOCKS = 5
CORRECTED_FROM = 0.01  # share of k that noise of the traction takes away, from which it is given back
SHARED_MAX = 0.95  # of the traction with a / v; beyond, its errors of some percent count five times and more
TRACTION_MIN = 1e-3  # [-] standard deviation; a slip of 3e-5 goes with it, less than any wheel speed resolves
SLIP_MIN = 1e-7  # [-] standard deviation; measured speeds have more
EXACT = 1e-12  # relative half width; rounding, not an interval
SLOPE_RANGE = (1.0, 300.0)  # [-] of a tyre on any road, as the estimator's
OFFSET_MAX = 0.10  # [-] radii of one car differ by less
TIMES_MAX = 10.0  # change of the slope beyond which a straight line in time says only that it is large
LAG_MAX = 0.5  # [s]
LAG_SAMPLES = 20_000

_STILL = "check the wheel mapping: two wheels on one channel, or a signal that stands still"
_FEW = "a longer drive with straight stretches, or a larger --mu-max"
_EVEN = "a drive that accelerates and coasts on a straight road"
_APART = "a drive at different speeds or on grades, or --delay where it is known (`aqualog align`)"
_TURNED = "check drivetrain, wheel mapping, and the sign and unit of the torque"
_UNITS = "check the torque's unit and whether it is of one wheel, and the mass in the vehicle file"


class Late(NamedTuple):
    """The slip that a late reference velocity adds: delay times acceleration over speed, v(t - tau) = v - a tau.

    `column` (n,) a / v [1/s]; `noise` (n,) its standard deviation. `half` [s]: the slip is already corrected by a delay
    known to ± this value; NaN: the fit estimates the delay.
    """

    column: FloatArray
    noise: FloatArray
    half: float = math.nan

    @property
    def is_open(self) -> bool:
        """Return whether the fit estimates the delay."""
        return math.isnan(self.half)

    def part(self, which: NDArray[np.int64]) -> Late:
        """Return some of the samples."""
        return Late(self.column[which], self.noise[which], self.half)


@dataclass(frozen=True, slots=True)
class Line:
    """The line s = k mu + delta, and the slip slope C = 1 / k.

    `slope` C_s / F_z [-] with its 95 % interval `slope_ci`; `k` [-] with `k_ci`; `offset` delta [-] with `offset_ci`.
    `scatter` rms of the slip about the line [-]. `attenuation` share of k that the noise of the traction takes away,
    corrected where `is_corrected`. `blocks` of neighbouring samples that the intervals rest on. `delay` of the
    reference velocity with `delay_ci` [s]; `shared`, share of the traction's variance that goes with a / v [-]; NaN
    unless estimated. `reason` says why there is no slope, `hint` what to try; then `slope` and `slope_ci` are NaN.
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
    hint: str = ""
    delay: float = math.nan
    delay_ci: Interval = NOWHERE
    shared: float = math.nan

    @property
    def told(self) -> bool:
        """Return whether there is a slope."""
        return not self.reason

    @property
    def slope(self) -> float:
        """C_s / F_z. [-]"""
        return 1.0 / self.k if self.told else math.nan

    @property
    def slope_ci(self) -> Interval:
        """Return the 95 % interval of the slope: the inverse of that of k, exact if 0 is outside [fieller1954]. [-]"""
        return (1.0 / self.k_ci[1], 1.0 / self.k_ci[0]) if self.told else NOWHERE


@dataclass(frozen=True, slots=True)
class Trend:
    """Relative change of the slope from first to last sample, C(end) / C(start) - 1, with its 95 % interval. [-]

    Infinite beyond ten times, minus infinite below a tenth.
    """

    change: float
    change_ci: Interval


def fit_line(
    mu: FloatArray, slip: FloatArray, label: NDArray[np.int64], *, noise: float = 0.0, late: Late | None = None
) -> Line:
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
    late : Late, optional
        For a slip against a velocity whose clock may be late.

    Returns
    -------
    Line
        `reason` is set with fewer than 5 blocks, where traction or slip are constant, where k = 0 is in its interval,
        where more than 30 % of the variance of `mu` is noise, where the delay cannot be distinguished from the slope,
        and where slope or offset are not those of a tyre.

    Slip is the noisy one of the two: a regression of traction on slip would give a slope that is too low (a published
    drive [gustafsson2000]: 28.7 instead of 41.6). Noise of the traction biases k towards 0 by noise / var(mu). Beyond 1
    % its variance is subtracted from the moments; this is Deming's regression [deming1943] with the noise of the
    traction known instead of a ratio. If the delay is estimated, only that part of the traction counts which does not
    go with a / v, and the noise of a / v is subtracted, too.

    Intervals: jackknife over the blocks with Student's t; degrees of freedom count the blocks by their information.

    Thesis: Eq. (3.14), reference [15], [gustafsson1997]; the sign of the offset as in E8. Section 3.2 for the delay.
    """
    blocks = int(np.unique(label).size)
    spread = float(np.var(mu)) if mu.size else 0.0
    reason = hint = ""
    if blocks < LEAST_BLOCKS:
        reason, hint = f"too few stretches of usable driving: {blocks} of at least {LEAST_BLOCKS}", _FEW
    elif not spread > TRACTION_MIN**2:
        reason, hint = "the traction is constant", _EVEN
    elif not float(np.std(slip)) > SLIP_MIN:
        reason, hint = "the slip is constant", _STILL
    if reason:
        return Line(
            math.nan, NOWHERE, math.nan, NOWHERE, math.nan, math.nan, is_corrected=False, samples=mu.size,
            blocks=blocks, reason=reason, hint=hint,
        )  # fmt: skip
    fitted = late if late is not None and late.is_open else None
    attenuation, shared = noise / spread, math.nan
    if fitted is not None and attenuation <= NOISE_MAX:
        attenuation, shared = _alone(mu, fitted, noise)
    is_corrected = CORRECTED_FROM < attenuation <= NOISE_MAX
    value, half = _fit(mu, slip, label, noise if is_corrected else 0.0, fitted, with_noise=is_corrected)
    k, offset = float(value[0]), float(value[1])
    half_k = float(half[0])
    if late is not None and not late.is_open:
        half_k = math.hypot(half_k, late.half * float(np.mean(late.column * (mu - mu.mean()))) / spread)
    k_ci = (k - half_k, k + half_k)
    if attenuation > NOISE_MAX and math.isnan(shared):
        reason, hint = f"{100 * min(attenuation, 1.0):.0f} % of the variation of the traction is noise", _EVEN
    elif not half_k > EXACT * abs(k):
        reason, hint = "slip and traction repeat themselves exactly: the slope has no measurable uncertainty", _EVEN
    elif k_ci[1] < 0.0 and attenuation <= NOISE_MAX:
        reason, hint = f"slip falls with traction (1 / slope is {k:.3f})", _TURNED
    elif attenuation > NOISE_MAX or shared > SHARED_MAX or not k_ci[0] > 0.0:
        reason, hint = _open_slope(mu, slip, label, k, k_ci, shared)
    elif abs(offset) > OFFSET_MAX:
        faster = 100.0 * (1.0 / (1.0 - offset) - 1.0) if offset < 1.0 else math.inf
        word = "faster" if offset > 0.0 else "slower"
        reason = (
            f"the radii in the vehicle file do not fit: without traction the driven wheels run {abs(faster):.0f} % "
            f"{word} than the free ones (or v_x)"
        )
        hint = "check r_e and the units of the wheel speeds"
    elif not SLOPE_RANGE[0] <= 1.0 / k <= SLOPE_RANGE[1]:
        low, high = SLOPE_RANGE
        reason, hint = f"a slope of {1.0 / k:.3g} is outside what a tyre has ({low:g} to {high:g})", _UNITS
    residual = slip - k * mu - offset
    delay, delay_ci = math.nan, NOWHERE
    if fitted is not None:
        delay = float(value[2])
        delay_ci = (delay - float(half[2]), delay + float(half[2]))
        residual = residual - delay * fitted.column
    return Line(
        k, k_ci, offset, (offset - float(half[1]), offset + float(half[1])), float(np.sqrt(np.mean(residual**2))),
        attenuation, is_corrected, mu.size, blocks, reason, hint, delay, delay_ci, shared,
    )  # fmt: skip


def _alone(mu: FloatArray, late: Late, noise: float) -> tuple[float, float]:
    """Return the noise share of the traction that does not go with a / v, and the share of the traction that does."""
    u = late.column - late.column.mean()
    var_u, var_mu = float(np.mean(u * u)), float(np.var(mu))
    slope = float(np.mean(u * mu)) / var_u if var_u > 0.0 else 0.0
    alone = max(var_mu - slope**2 * var_u, 0.0)
    blur = noise + slope**2 * float(np.mean(late.noise**2))
    return blur / alone if alone > TRACTION_MIN**2 else math.inf, 1.0 - alone / var_mu


def _open_slope(
    mu: FloatArray, slip: FloatArray, label: NDArray[np.int64], k: float, k_ci: Interval, shared: float
) -> tuple[str, str]:
    """Return why a fitted line gives no slope: for the delay alone, or for the noise."""
    if math.isfinite(shared):
        value, half = _fit(mu, slip, label, 0.0, None, with_noise=False)
        if k_ci[0] > 0.0 or abs(float(value[0])) > float(half[0]):
            return (
                f"{100.0 * shared:.1f} % of the traction's variation goes with acceleration over speed: a delay of v_x "
                "cannot be distinguished from the slope", _APART,
            )  # fmt: skip
    return (
        f"1 / slope is {k:.3f} with a 95 % interval of {k_ci[0]:.3f} ... {k_ci[1]:.3f}, which holds 0: the "
        "traction changes too seldom or too little for the noise of the slip", _EVEN,
    )  # fmt: skip


def _fit(
    mu: FloatArray, slip: FloatArray, label: NDArray[np.int64], noise: float, late: Late | None, *, with_noise: bool
) -> tuple[FloatArray, FloatArray]:
    columns: list[FloatArray] = [mu, np.ones_like(mu)]
    if late is None:
        return jackknife(Design(np.stack(columns), slip, label), [Noise(noise, (1.0, 0.0))])
    noises = [Noise(noise, (1.0, 0.0, 0.0)), *([Noise(1.0, (0.0, 0.0, late.noise))] if with_noise else [])]
    return jackknife(Design(np.stack([*columns, late.column]), slip, label), noises)


def fit_trend(
    t: FloatArray,
    mu: FloatArray,
    slip: FloatArray,
    label: NDArray[np.int64],
    *,
    noise: float = 0.0,
    late: Late | None = None,
) -> Trend:
    """Estimate the change of the slope with time, s = (k + k' tau) mu + delta + delta' tau, tau from -1/2 to 1/2.

    Parameters as in `fit_line`, at times `t` (n,) [s]. With `late` a delay of the reference is estimated too, the same
    for the whole time. The offset may drift: tyres warm up and grow.
    """
    tau = (t - t[0]) / (t[-1] - t[0]) - 0.5
    columns: list[FloatArray] = [mu, np.ones_like(mu), tau * mu, tau]
    noisy: tuple[FloatArray | float, ...] = (1.0, 0.0, tau, 0.0)
    is_corrected = CORRECTED_FROM < noise / float(np.var(mu)) <= NOISE_MAX
    if late is not None:
        columns, noisy = [*columns, late.column], (*noisy, 0.0)
    noises = [Noise(noise if is_corrected else 0.0, noisy)]
    if late is not None and is_corrected:
        noises.append(Noise(1.0, (0.0, 0.0, 0.0, 0.0, late.noise)))
    value, half = jackknife(Design(np.stack(columns), slip, label), noises)
    k = abs(float(value[0]))
    low, middle, high = (_change_of_slope((float(value[2]) + r * float(half[2])) / k) for r in (1.0, 0.0, -1.0))
    return Trend(middle, (low, high))


def _change_of_slope(c: float) -> float:
    """Return C(end) / C(start) - 1 if 1 / C grows by the share `c` of its middle value; infinite beyond ten times."""
    at_end, at_start = 1.0 + 0.5 * c, 1.0 - 0.5 * c
    if at_start >= TIMES_MAX * at_end:
        return math.inf
    return -math.inf if at_end >= TIMES_MAX * at_start else at_start / at_end - 1.0


def noise_of_traction(mu: FloatArray, slip: FloatArray, is_used: BoolArray, *, apart: int, k: float) -> float:
    """Return the variance of that part of the fast changes of the traction which the slip does not follow. [-]

    Of samples (n,) in order of time [-], of which `is_used` are fitted. `apart`: samples between values whose noise is
    independent, the length of the smoothing; `k`: slip per traction, 1 / C [-]. 0 where it cannot be estimated.

    From second differences D: real changes show in both, so var(D mu) - cov(D mu, D s) / k is noise alone, six times.
    Noise that changes more slowly than the smoothing stays undetected.
    """
    if mu.size <= 2 * apart or not k > 0.0:
        return 0.0
    whole = is_used[2 * apart :] & is_used[apart:-apart] & is_used[: -2 * apart]
    if np.count_nonzero(whole) < 20:
        return 0.0
    d_mu, d_s = (second_difference(x, apart)[whole] for x in (mu, slip))
    real = float(np.mean(d_mu * d_s)) / k
    return max(float(np.mean(d_mu * d_mu)) - max(real, 0.0), 0.0) / 6.0


def lag_of_slip(mu: FloatArray, slip: FloatArray, is_used: BoolArray, dt: float) -> float:
    """Return the delay of the slip against the traction [s]: the shift with the best correlation, good to 0.05 s.

    Of samples (n,) [-] every `dt` [s], of which `is_used` are compared, 20,000 at most. NaN where nothing moves
    together within half a second.
    """
    step = max(1, round(0.02 / dt))
    shifts = np.arange(-int(LAG_MAX / dt / step), int(LAG_MAX / dt / step) + 1) * step
    index = np.flatnonzero(is_used)
    index = index[(index >= -shifts[0]) & (index < mu.size - shifts[-1])]
    index = index[:: max(1, -(-index.size // LAG_SAMPLES))]
    good = np.ones(index.size, dtype=bool)
    for shift in shifts:
        good &= np.isfinite(mu[index - shift])
    index = index[good]
    if index.size < 20:
        return math.nan
    y = slip[index] - slip[index].mean()
    r = np.array([_correlation(mu[index - shift], y) for shift in shifts])
    k = int(np.argmax(r))
    if not 0 < k < r.size - 1 or r[k] < 0.5:
        return math.nan
    bend = float(r[k - 1] - 2.0 * r[k] + r[k + 1])
    peak = 0.5 * float(r[k - 1] - r[k + 1]) / bend if bend < 0.0 else 0.0
    return float(dt * (shifts[k] + step * peak))


def _correlation(x: FloatArray, y: FloatArray) -> float:
    """Correlate x with y, whose mean is 0; 0 where one of them is constant."""
    x = x - x.mean()
    size = math.sqrt(float(x @ x) * float(y @ y))
    return float(x @ y) / size if size > 1e-30 else 0.0
