"""Estimate offset, drift and scale between two sources that carry the same quantity on clocks of their own.

Model, with t the stamp of the other source and s the same instant on the reference's clock:

    x(t) = scale * x_ref(s) + bias + noise,    s = t - offset - drift * (t - t_mid)

The offset is estimated from the smoothed rates of change, not from the levels. The rate removes bias, slow changes of
the rolling radius and slow noise; a constant scale is a free gain there. Scale and bias follow from the levels.
Intervals come from leaving out one block of several seconds after the other (cluster jackknife, CR3), so neighbouring
residuals may depend on each other. Nothing is random.

The offset is the total delay of one signal against the other: of the clock, and of the run time and the filter of a
sensor. One pair of signals cannot distinguish the two. Tyre slip in proportion to acceleration, k v dv/dt, looks like a
wheel speed that is early by k v (0.05 s and more on a race track). The fit with slip removes it where the speed varies
enough to distinguish slip from delay.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from aqualog.align.clock_search import BLOCK_S, LEAST_BLOCKS, Match, Options, Peak, Smoothed, match
from aqualog.core.errors import FitError
from aqualog.core.intervals import NOWHERE, Interval, half_width
from aqualog.core.records import FloatArray, TimeArray

__all__ = ["ClockFit", "estimate_clock"]

_RATE_BLOCKS = 40  # at most so many blocks for the offset; longer drives get longer blocks
_SLOW_BLOCKS = 8  # for drift and levels: driving style, slip, grade and warm tyres stay alike for minutes
_HUBER = 1.345


@dataclass(frozen=True, slots=True)
class ClockFit:
    """How the clock and the values of one source stand against a reference.

    All intervals hold 95 % and cover noise, not the run time or filter of a sensor.

    Attributes
    ----------
    offset_s, offset_ci95
        Positive: the source is LATE, an event bears a stamp that is `offset_s` larger than the reference's.
        Holds at `mid_ns`, a stamp of the source in the middle of the overlap.
    slip_offset_s, slip_offset_ci95
        Offset if x - x_ref may also hold tyre slip k v dv/dt; NaN unless the quantity is a speed. Where its interval
        and that of `offset_s` do not overlap, part of `offset_s` is slip and not time.
    drift_ppm, drift_ppm_ci95
        Growth of the offset in microseconds per second of the source's clock. `drift_significant`: its 99 % interval
        excludes 0; only then `to_reference` uses it.
    scale, bias, scale_ci95, bias_ci95
        x = scale * x_ref + bias, at the same instant; bias in the unit of x.
    ratio, ratio_ci95
        Scale if there is no bias, as between two speeds: x = ratio * x_ref.
    peak, peak_limit, runner_up
        Correlation of the rates of change at the best lag, -1 to 1; the limit that it had to reach to be more than
        chance; the best correlation outside the main peak, -1 if that fills the search range.
    overlap_s, n
        Time in which both sources were usable after alignment, and samples of the source in it.
    rms : float
        Residual of the smoothed levels, unit of x.
    """

    offset_s: float
    offset_ci95: Interval
    slip_offset_s: float
    slip_offset_ci95: Interval
    drift_ppm: float
    drift_ppm_ci95: Interval
    drift_significant: bool
    scale: float
    scale_ci95: Interval
    bias: float
    bias_ci95: Interval
    ratio: float
    ratio_ci95: Interval
    peak: float
    peak_limit: float
    runner_up: float
    overlap_s: float
    n: int
    rms: float
    mid_ns: int

    @property
    def sharpness(self) -> float:
        """Return how far the peak stands above the second best, relative to the peak: 0 ambiguous, 1 and more clear."""
        return (self.peak - self.runner_up) / self.peak

    @property
    def has_slip(self) -> bool:
        """Return whether part of `offset_s` is tyre slip and no time: the intervals of both offsets do not overlap."""
        low, high = self.slip_offset_ci95
        return bool(low > self.offset_ci95[1] or high < self.offset_ci95[0])

    @property
    def taken_s(self) -> float:
        """Return the offset to use: that with tyre slip in the model where slip is seen, else `offset_s`. [s]"""
        return self.slip_offset_s if self.has_slip else self.offset_s

    @property
    def taken_because(self) -> str:
        """Return why this one of two offsets is taken; empty where there is one only."""
        if np.isnan(self.slip_offset_s):
            return ""
        if self.has_slip:
            return "tyre slip is part of the plain offset: the two intervals do not overlap"
        return "no tyre slip is seen, the two intervals overlap; the plain fit has the fewer unknowns"

    def to_reference(self, t_ns: TimeArray) -> TimeArray:
        """Return stamps (n,) on the reference's clock, a new array: t - offset - drift * (t - t_mid). int64"""
        shift = np.full(t_ns.shape, self.taken_s)
        if self.drift_significant:
            shift += self.drift_ppm * 1e-6 * ((t_ns - self.mid_ns) * 1e-9)
        return t_ns - np.rint(shift * 1e9).astype(np.int64)


def estimate_clock(
    t_ref_ns: TimeArray,
    x_ref: FloatArray,
    t_ns: TimeArray,
    x: FloatArray,
    *,
    max_offset_s: float = 10.0,
    start_offset_s: float = 0.0,
    quantity: str = "v_x",
    min_overlap_s: float = 30.0,
    min_peak: float = 0.5,
) -> ClockFit:
    """Estimate offset, drift and scale of a source against a reference that carries the same quantity.

    Parameters
    ----------
    t_ref_ns, t_ns : int64 arrays (n,), (m,)
        Stamps of the reference and of the other source, not decreasing; of equal stamps the later sample counts.
    x_ref, x : arrays (n,), (m,)
        Samples; NaN and infinite ones are left out. Rates, gaps and units may differ.
    max_offset_s : float
        Search range on either side of `start_offset_s`, > 0. [s]
    start_offset_s : float
        Known rough offset, e.g. of clocks hours apart; sign as `ClockFit.offset_s`. [s]
    quantity : str
        Name of the quantity, for messages. `v_x`, `yaw_rate` and `omega_*` (SI) also set the least rate of change,
        `v_x` and `omega_*` the fit with slip.
    min_overlap_s : float
        Usable common time that is needed, at least 20. [s]
    min_peak : float
        Least correlation of the rates of change. The limit is higher where chance alone reaches it.

    Valid range: drifts up to about 1000 ppm; rates of 1 Hz and more. A value that is logged faster than it is measured
    looks late by half its true sample time.

    Raises
    ------
    FitError
        Too little overlap, a source without variation, a weak or ambiguous peak, a peak at the edge of the search
        range, opposite signs, or stamps that run backwards.

    References: Padfield 2012 [padfield2012] for the masked correlation; Cameron and Miller 2015 [cameron2015],
    section VI, for few clusters.
    """
    o = Options(max_offset_s, start_offset_s, min_overlap_s, min_peak, quantity, f"clock fit on {quantity}")
    found = match(t_ref_ns, x_ref, t_ns, x, o)
    k = np.flatnonzero(found.b.good)
    k = k[_at(found.a.good.astype(np.float64), np.asarray(k - found.peak.lag / found.step, dtype=np.float64)) > 0.999]
    mid = found.start + found.step * 0.5 * float(k[0] + k[-1])
    pair = _Pair(found.a, found.b, found.start, found.step, mid, max(BLOCK_S, 10 * found.smoothing))
    return _fit(pair, found, o)


class _Pair(NamedTuple):
    a: Smoothed
    b: Smoothed
    start: float
    step: float
    mid: float  # of the common time, on the other source's clock
    block_s: float


class _Rows(NamedTuple):
    t: FloatArray
    design: FloatArray  # (n, p)
    residual: FloatArray
    weight: FloatArray


class _Estimate(NamedTuple):
    value: FloatArray
    sigma: FloatArray
    dof: FloatArray

    def interval(self, i: int, *, level: float = 0.95) -> Interval:
        half = half_width(float(self.sigma[i]), float(self.dof[i]), level)
        return float(self.value[i]) - half, float(self.value[i]) + half


def _at(y: FloatArray, k: FloatArray) -> FloatArray:
    """Interpolate linearly at fractional grid indices; 0 outside."""
    return np.interp(k, np.arange(y.size), y, left=0.0, right=0.0)


def _common(pair: _Pair, offset: float, drift: float) -> tuple[TimeArray, FloatArray, FloatArray]:
    """Return grid indices of the other source that have a usable partner, their times, and the partners' indices."""
    k = np.flatnonzero(pair.b.good)
    t: FloatArray = pair.start + pair.step * k.astype(np.float64)
    partner: FloatArray = (t - pair.start - offset - drift * (t - pair.mid)) / pair.step
    both = _at(pair.a.good.astype(np.float64), partner) > 0.999
    return k[both].astype(np.int64), t[both], partner[both]


def _lag_rows(pair: _Pair, value: FloatArray, terms: tuple[str, ...]) -> _Rows:
    """Residual and slopes of the rates at `value` = (offset, gain, *terms)."""
    more = dict(zip(terms, value[2:], strict=True))
    gain = float(value[1])
    k, t, partner = _common(pair, float(value[0]), float(more.get("drift", 0.0)))
    rate, delay = _at(pair.a.rate, partner), -gain * _at(pair.a.bend, partner)
    columns = {"offset": delay, "gain": rate, "drift": delay * (t - pair.mid)}
    residual = pair.b.rate[k] - gain * rate
    if "slip" in more:
        columns["slip"] = _at(np.gradient(pair.a.level * pair.a.rate, pair.step), partner)
        residual = residual - more["slip"] * columns["slip"]
    design = np.column_stack([columns[name] for name in ("offset", "gain", *terms)])
    return _Rows(t, design, residual, _huber(residual))


def _fit_lag(pair: _Pair, start: FloatArray, terms: tuple[str, ...] = ()) -> tuple[FloatArray, _Rows]:
    """Gauss-Newton over (offset, gain, *terms) with Huber weights [huber1981]; `terms` out of drift and slip."""
    value = np.append(start[:2], np.zeros(len(terms)))
    rows = _lag_rows(pair, value, terms)
    for _ in range(40):
        weighted = rows.design * rows.weight[:, None]
        change = np.linalg.lstsq(rows.design.T @ weighted, weighted.T @ rows.residual, rcond=None)[0]
        # beyond the smoothing time the linear step means nothing
        change *= min(1.0, 0.2 / max(abs(float(change[0])), 1e-300))
        value = value + change
        rows = _lag_rows(pair, value, terms)
        if rows.t.size < 10 or abs(float(change[0])) < 1e-8:
            break
    return value, rows


def _fit_level(pair: _Pair, offset: float, drift: float, *, with_bias: bool) -> tuple[FloatArray, _Rows]:
    """Fit scale and, on demand, bias. The rate is a column too, or an offset on a ramp would look like a bias."""
    k, t, partner = _common(pair, offset, drift)
    level = _at(pair.a.level, partner)
    constant = [np.ones(k.size)] if with_bias else []
    design = np.column_stack([level, *constant, _at(pair.a.rate, partner)])
    y, weight = pair.b.level[k], np.ones(k.size)
    beta = np.zeros(design.shape[1])
    for _ in range(50):
        weighted = design * weight[:, None]
        new = np.linalg.lstsq(design.T @ weighted, weighted.T @ y, rcond=None)[0]
        done = bool(np.max(np.abs(design @ (new - beta))) < 1e-9 * (1.0 + float(np.max(np.abs(y)))))
        beta = new
        weight = _huber(y - design @ beta)
        if done:
            break
    return beta, _Rows(t, design, y - design @ beta, weight)


def _huber(residual: FloatArray) -> FloatArray:
    spread = 1.4826 * float(np.median(np.abs(residual)))
    if spread == 0.0:
        return np.ones(residual.size)
    return np.minimum(1.0, _HUBER * spread / np.maximum(np.abs(residual), 1e-300))


def _jackknife(pair: _Pair, value: FloatArray, rows: _Rows, most_blocks: int) -> _Estimate:
    """Return standard errors from leaving out one block after the other, each by one Gauss-Newton step.

    The degrees of freedom count blocks by their information: one braking among quiet minutes is one observation.
    """
    unknown = _Estimate(value, np.full(value.size, math.inf), np.ones(value.size))
    if rows.t.size < 10:
        return unknown
    block_s = max(pair.block_s, float(np.ptp(rows.t)) / most_blocks)
    label = np.floor((rows.t - rows.t[0]) / block_s).astype(np.int64)
    first = np.flatnonzero(np.diff(label, prepend=-1))
    weighted = rows.design * rows.weight[:, None]
    # a clipped residual no longer answers to the parameters: it counts in the sum of scores, not in its slope
    inner = rows.design * (rows.weight == 1.0)[:, None]
    h = np.add.reduceat(inner[:, :, None] * rows.design[:, None, :], first, axis=0)
    g = np.add.reduceat(weighted * rows.residual[:, None], first, axis=0)
    blocks = g.shape[0]
    if blocks < LEAST_BLOCKS:
        return unknown
    # columns differ by orders of magnitude (drift against gain), which a relative pseudo-inverse would not forgive
    unit = np.sqrt(np.maximum(np.einsum("bii->i", h), 1e-300))
    h, g = h / (unit[:, None] * unit), g / unit
    inverse = np.linalg.pinv(h.sum(axis=0) - h, rcond=1e-9, hermitian=True)
    change = np.einsum("bij,bj->bi", inverse, g.sum(axis=0) - g) / unit
    variance = (blocks - 1) / blocks * np.sum((change - change.mean(axis=0)) ** 2, axis=0)
    inform = np.einsum("bii->bi", h)
    dof = np.maximum(inform.sum(axis=0) ** 2 / np.sum(inform**2, axis=0) - 1.0, 1.0)
    return _Estimate(value, np.sqrt(variance), dof)


def _fit(pair: _Pair, found: Match, o: Options) -> ClockFit:
    peak = found.peak
    plain, rows = _fit_lag(pair, np.array([peak.lag, 1.0]))
    _check_fit(float(plain[0]), peak, rows, pair.step, o)
    bent, bent_rows = _fit_lag(pair, plain, ("drift",))
    drifting = _jackknife(pair, bent, bent_rows, _SLOW_BLOCKS)
    low, high = drifting.interval(2, level=0.99)
    drift_low, drift_high = drifting.interval(2)
    significant = low > 0.0 or high < 0.0
    value, rows = (bent, bent_rows) if significant else (plain, rows)
    lag = _jackknife(pair, value, rows, _RATE_BLOCKS)
    offset, drift = float(value[0]), float(bent[2]) if significant else 0.0
    slip, slip_ci = _slip_offset(pair, value, o, with_drift=significant)
    beta, level_rows = _fit_level(pair, offset, drift, with_bias=True)
    level = _jackknife(pair, beta, level_rows, _SLOW_BLOCKS)
    ratio, ratio_rows = _fit_level(pair, offset, drift, with_bias=False)
    pure = _jackknife(pair, ratio, ratio_rows, _SLOW_BLOCKS)
    inside = (found.times >= level_rows.t[0]) & (found.times <= level_rows.t[-1])
    return ClockFit(
        offset_s=o.start_offset_s + offset,
        offset_ci95=_shifted(lag.interval(0), o.start_offset_s),
        slip_offset_s=slip,
        slip_offset_ci95=slip_ci,
        drift_ppm=float(bent[2]) * 1e6,
        drift_ppm_ci95=(1e6 * drift_low, 1e6 * drift_high),
        drift_significant=significant,
        scale=float(beta[0]),
        scale_ci95=level.interval(0),
        bias=float(beta[1]),
        bias_ci95=level.interval(1),
        ratio=float(ratio[0]),
        ratio_ci95=pure.interval(0),
        peak=peak.height,
        peak_limit=peak.limit,
        runner_up=peak.runner_up,
        overlap_s=level_rows.t.size * pair.step,
        n=int(np.count_nonzero(inside)),
        rms=float(np.sqrt(np.mean(level_rows.residual**2))),
        mid_ns=found.origin_ns + round((pair.mid - found.lead) * 1e9),
    )


def _slip_offset(pair: _Pair, value: FloatArray, o: Options, *, with_drift: bool) -> tuple[float, Interval]:
    if not o.has_slip:
        return math.nan, NOWHERE
    slip, rows = _fit_lag(pair, value, ("slip", "drift") if with_drift else ("slip",))
    estimate = _jackknife(pair, slip, rows, _RATE_BLOCKS)
    return o.start_offset_s + float(slip[0]), _shifted(estimate.interval(0), o.start_offset_s)


def _shifted(interval: Interval, by: float) -> Interval:
    return interval[0] + by, interval[1] + by


def _check_fit(offset: float, peak: Peak, rows: _Rows, step: float, o: Options) -> None:
    if not abs(offset) <= o.max_offset_s or abs(offset - peak.lag) > 1.0:
        raise FitError(
            f"the fit ran from {peak.lag:+.2f} s to {offset:+.2f} s",
            where=o.where,
            expected="an offset near the peak of the correlation",
            hint="a larger max_offset_s, or a longer stretch with braking or turning",
        )
    if rows.t.size * step < 0.9 * o.min_overlap_s:
        raise FitError(f"{rows.t.size * step:.1f} s in common", where=o.where, expected=f"{o.min_overlap_s:g} s")
