"""Mean and spread of normal values of which some are only known to lie above a bound."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from aqualog.core.intervals import NOWHERE, Interval, student_quantile
from aqualog.core.records import FloatArray

__all__ = ["Censored", "censored_mean", "log_upper_tail"]

_WIDE = 12.0  # how far beyond all values the mean is looked for, in spans of these
_FINE = 1e-9  # relative precision
_STEPS = 100
_LOG_ROOT = 0.5 * math.log(2.0 * math.pi)


class Censored(NamedTuple):
    """Estimate of a mean, its interval, and the standard deviation of one value; all in the unit of the values."""

    mean: float
    ci: Interval
    sd: float


def censored_mean(values: FloatArray, bounds: FloatArray, *, level: float = 0.95) -> Censored:
    """Mean of a normal distribution from values, and from runs that lie above bounds, by likelihood.

    Parameters
    ----------
    values : array (m,)
        Seen values, finite.
    bounds : array (k,)
        Censored runs: the value lies above.
    level : float
        Confidence of the interval.

    Returns
    -------
    found : Censored
        `sd` has the factor sqrt(m / (m - 1)) on its likelihood's estimate. NaN where the data do not determine it: no
        value, one value, or (of the mean) one value and bounds above it.

    Notes
    -----
    log L = sum log phi((x - mu) / s) / s + sum log(1 - Phi((c - mu) / s)). The interval holds the means whose profile
    likelihood ratio 2 (log L_max - log L(mu)) is at most m log(1 + t^2 / (m - 1)), t the quantile of Student's t with
    m - 1 degrees of freedom. Without bounds that is the t-interval exactly, and mean and sd are the usual ones.

    Source: [tobin1958] for the likelihood; the threshold of the ratio is derived.
    """
    x, c = np.asarray(values, dtype=np.float64), np.asarray(bounds, dtype=np.float64)
    m = x.size
    if not c.size:
        if not m:
            return Censored(math.nan, NOWHERE, math.nan)
        if m == 1:
            return Censored(float(x[0]), NOWHERE, math.nan)
        if float(np.ptp(x)) == 0.0:  # the mean of equal floats need not be that float
            return Censored(float(x[0]), (float(x[0]), float(x[0])), 0.0)
        mean = float(x.mean())
        sd = float(x.std(ddof=1))
        half = student_quantile(0.5 + level / 2.0, m - 1.0) * sd / math.sqrt(m)
        return Censored(mean, (mean - half, mean + half), sd)
    if m < 2:
        return Censored(math.nan, NOWHERE, math.nan)
    if float(np.ptp(x)) == 0.0 and c.max() <= x[0]:  # the likelihood grows without limit as the spread vanishes
        return Censored(float(x[0]), (float(x[0]), float(x[0])), 0.0)
    scale = float(max(np.ptp(x), c.max() - x.min()))
    low, high = float(x.min()), float(max(x.max(), c.max())) + _WIDE * scale
    mean = _highest(lambda mu: _profile(x, c, mu, scale)[0], low, high)
    top, sigma = _profile(x, c, mean, scale)
    t = student_quantile(0.5 + level / 2.0, m - 1.0)
    limit = top - 0.5 * m * math.log1p(t * t / (m - 1.0))

    def falls(mu: float) -> bool:
        return _profile(x, c, mu, scale)[0] < limit

    down = _edge(falls, mean, -sigma)
    up = _edge(falls, mean, sigma)
    return Censored(mean, (down, up), sigma * math.sqrt(m / (m - 1.0)))


def log_upper_tail(z: FloatArray) -> FloatArray:
    """Return log(1 - Phi(z)) of the normal distribution; far out by the continued fraction's first terms."""
    out = np.empty_like(z)
    for i, x in enumerate(z):
        if x < 30.0:
            out[i] = math.log(0.5 * math.erfc(x / math.sqrt(2.0)))
        else:
            out[i] = -0.5 * x * x - math.log(x) - _LOG_ROOT - 1.0 / (x * x)
    return out


def _profile(x: FloatArray, c: FloatArray, mu: float, scale: float) -> tuple[float, float]:
    """Return the greatest log-likelihood of a mean, and its standard deviation: by Newton, concave in tau = 1 / s."""
    squares, away = float(((x - mu) ** 2).sum()), c - mu
    tau = 1.0 / scale
    for _ in range(_STEPS):
        z = tau * away
        hazard = np.exp(-0.5 * z * z - _LOG_ROOT - log_upper_tail(z))
        slope = x.size / tau - tau * squares - float(away @ hazard)
        bend = x.size / tau**2 + squares + float((away * away) @ (hazard * np.maximum(hazard - z, 0.0)))
        new = max(tau + slope / bend, 0.1 * tau)
        if abs(new - tau) <= _FINE * tau:
            break
        tau = new
    best = x.size * math.log(tau) - 0.5 * tau * tau * squares + float(log_upper_tail(tau * away).sum())
    return best, 1.0 / tau


def _highest(of, low: float, high: float) -> float:  # type: ignore[no-untyped-def]
    """Return the place of the only maximum, by golden sections."""
    golden = 0.5 * (math.sqrt(5.0) - 1.0)
    a, b = low, high
    p, q = b - golden * (b - a), a + golden * (b - a)
    f_p, f_q = of(p), of(q)
    while b - a > _FINE * (high - low):
        if f_p >= f_q:
            b, q, f_q = q, p, f_p
            p = b - golden * (b - a)
            f_p = of(p)
        else:
            a, p, f_p = p, q, f_q
            q = a + golden * (b - a)
            f_q = of(q)
    return 0.5 * (a + b)


def _edge(falls, start: float, step: float) -> float:  # type: ignore[no-untyped-def]
    """Return where a condition begins to hold beyond a start; infinite where it does not within reach."""
    inside, outside = start, start + step
    for _ in range(60):
        if falls(outside):
            break
        inside, outside = outside, start + 1.6 * (outside - start)
    else:
        return math.copysign(math.inf, step)
    for _ in range(60):
        middle = 0.5 * (inside + outside)
        if falls(middle):
            outside = middle
        else:
            inside = middle
    return 0.5 * (inside + outside)
