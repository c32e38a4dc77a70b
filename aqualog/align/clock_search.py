"""Search the lag at which the rates of change of two sources match best, within a range.

Both pass one filter, the same for both. The limit that the peak must reach is what unrelated signals reach by chance.
"""

from __future__ import annotations

import math
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from aqualog.core.errors import FitError
from aqualog.core.records import BoolArray, FloatArray, TimeArray

__all__ = ["BLOCK_S", "LEAST_BLOCKS", "Match", "Options", "Peak", "Smoothed", "match"]

_SMOOTHING_S = 0.4  # Gaussian; its slope passes 0.05 to 1 Hz, where cars accelerate and turn
_STEPS_PER_SMOOTHING = 16
_REACH = 3.5  # half-width of the filter in standard deviations
BLOCK_S = 5.0
LEAST_BLOCKS = 4
_CHANCE = 1e-3  # probability that unrelated Gaussian signals reach the limit of the peak
_SURE = 0.9  # unrelated drives do not reach it by chance once they hold some events:
_EVENTS = 5.0
_AMBIGUOUS = 0.9  # a second peak this close to the first may be the true one
_MOST_POINTS = 30_000_000
# Rates of change that noise alone reaches: below, a source shows nothing that could be matched.
_LEAST_CHANGE = {"v_x": 0.02, "yaw_rate": 0.002, **{f"omega_{w}": 0.07 for w in ("fl", "fr", "rl", "rr")}}


class Options(NamedTuple):
    """Parameters of `estimate_clock`; `where` begins each message."""

    max_offset_s: float
    start_offset_s: float
    min_overlap_s: float
    min_peak: float
    quantity: str
    where: str

    @property
    def has_slip(self) -> bool:
        """Return whether the quantity is a speed of a wheel or of the car."""
        return self.quantity == "v_x" or self.quantity.startswith("omega_")


class _Series(NamedTuple):
    t: FloatArray  # seconds from the first sample
    x: FloatArray
    period: float
    origin_ns: int


class Smoothed(NamedTuple):
    """A source on the grid (n,), in its unit and per second; `good`: behind no gap."""

    level: FloatArray
    rate: FloatArray
    bend: FloatArray  # rate of the rate
    good: BoolArray


class Peak(NamedTuple):
    """Lag [s] and correlation of the best match, the second best, and the limit that was to be reached."""

    lag: float
    height: float
    runner_up: float
    limit: float


class Match(NamedTuple):
    """Two sources behind one filter on a grid of the reference's clock, and the peak of their correlation.

    `origin_ns`: the first stamp of the other source, on its own clock; `times` (m,) of its samples on the grid's clock;
    `lead`: time of the first one there. [s]
    """

    a: Smoothed
    b: Smoothed
    start: float
    step: float
    smoothing: float
    peak: Peak
    times: FloatArray
    lead: float
    origin_ns: int


def match(t_ref_ns: TimeArray, x_ref: FloatArray, t_ns: TimeArray, x: FloatArray, o: Options) -> Match:
    """Search the best lag; parameters and errors as of `estimate_clock`."""
    if not (math.isfinite(o.max_offset_s) and o.max_offset_s > 0.0):
        raise FitError(f"search range {o.max_offset_s} s", where=o.where, expected="a positive number of seconds")
    if not math.isfinite(o.start_offset_s):
        raise FitError(f"start offset {o.start_offset_s} s", where=o.where, expected="a number of seconds")
    if not o.min_overlap_s >= (least := LEAST_BLOCKS * BLOCK_S):
        raise FitError(f"least overlap {o.min_overlap_s} s", where=o.where, expected=f"{least:g} s or more")
    ref = _series(t_ref_ns, x_ref, where=f"{o.where}, reference")
    other = _series(t_ns, x, where=f"{o.where}, other source")
    # integers are subtracted before they become seconds: epoch nanoseconds do not fit a double
    lead = (other.origin_ns - round(o.start_offset_s * 1e9) - ref.origin_ns) * 1e-9
    other = other._replace(t=other.t + lead)
    smoothing = max(_SMOOTHING_S, ref.period, other.period)
    step = smoothing / _STEPS_PER_SMOOTHING
    start, count = _grid(ref, other, step, o)
    a = _smooth(ref, start, step, count, smoothing)
    b = _smooth(other, start, step, count, smoothing)
    _check_variation(a, o.quantity, where=f"{o.where}, reference")
    _check_variation(b, o.quantity, where=f"{o.where}, other source")
    return Match(a, b, start, step, smoothing, _search(a, b, step, o), other.t, lead, other.origin_ns)


def _series(t_ns: TimeArray, x: FloatArray, *, where: str) -> _Series:
    """Return finite samples with strictly increasing time, in seconds from the first."""
    if t_ns.shape != x.shape or t_ns.ndim != 1:
        raise FitError(f"{t_ns.shape} stamps for {x.shape} samples", where=where, expected="two vectors of one length")
    good = np.isfinite(x)
    t, values = t_ns[good], np.asarray(x[good], dtype=np.float64)
    steps = np.diff(t)
    if (steps < 0).any():
        raise FitError(
            "time stamps run backwards", where=where, expected="rising stamps", hint="repair the clock resets first"
        )
    last = np.append(steps != 0, True)[: t.size]
    t, values = t[last], values[last]
    if t.size < 10:
        raise FitError(f"{t.size} finite samples", where=where, expected="at least 10", hint="another signal")
    seconds = (t - t[0]) * 1e-9
    return _Series(seconds, values, float(np.median(np.diff(seconds))), int(t[0]))


def _grid(ref: _Series, other: _Series, step: float, o: Options) -> tuple[float, int]:
    """Return start and number of points of a grid on the reference's clock, wide enough for every lag."""
    reach = o.max_offset_s
    ref_low, ref_high = max(ref.t[0], other.t[0] - reach), min(ref.t[-1], other.t[-1] + reach)
    low, high = max(other.t[0], ref.t[0] - reach), min(other.t[-1], ref.t[-1] + reach)
    possible = min(ref_high - ref_low, high - low)
    expected = f"{o.min_overlap_s:g} s of common time within an offset of {reach:g} s"
    if possible <= 0.0:
        began = o.start_offset_s + float(other.t[0] - ref.t[0])
        hint = f"start_offset_s = {began:.1f} if both began together"
        raise FitError("the sources do not overlap in time", where=o.where, expected=expected, hint=hint)
    if possible < o.min_overlap_s:
        hint = "a longer drive, a larger max_offset_s or a start_offset_s"
        raise FitError(f"the sources share at most {possible:.1f} s", where=o.where, expected=expected, hint=hint)
    start, end = min(ref_low, low), max(ref_high, high)
    count = math.ceil((end - start) / step) + 1
    if count > _MOST_POINTS:
        raise FitError(f"a common time of {end - start:.0f} s", where=o.where, expected="a few days at most")
    return float(start), count


def _thin(series: _Series, step: float) -> tuple[FloatArray, FloatArray]:
    """Average samples much faster than the grid over one step: time and value alike, so that nothing is delayed."""
    if series.period > 0.6 * step:
        return series.t, series.x
    bins = np.floor((series.t - series.t[0]) / step).astype(np.int64)
    first = np.flatnonzero(np.diff(bins, prepend=-1))
    sizes = np.diff(np.append(first, bins.size))
    return np.add.reduceat(series.t, first) / sizes, np.add.reduceat(series.x, first) / sizes


def _smooth(series: _Series, start: float, step: float, count: int, smoothing: float) -> Smoothed:
    """Return level and rate of change behind one symmetric filter, the same for both sources."""
    t, x = _thin(series, step)
    grid: FloatArray = start + step * np.arange(count, dtype=np.float64)
    centre = float(np.mean(x))
    values = np.interp(grid, t, x - centre)
    half = math.ceil(4.5 * smoothing / step)
    u = np.arange(-half, half + 1) * step
    bell = np.exp(-0.5 * (u / smoothing) ** 2)
    bell /= bell.sum()
    slope = u * bell / float(np.sum(u * u * bell))  # a ramp comes out with its exact slope
    padded = np.pad(values, half, mode="edge")
    level = np.convolve(padded, bell, mode="valid") + centre
    rate = np.convolve(padded, slope[::-1], mode="valid")
    return Smoothed(level, rate, np.gradient(rate, step), _usable(t, grid, series.period, smoothing))


def _usable(t: FloatArray, grid: FloatArray, period: float, smoothing: float) -> BoolArray:
    """Return the grid points whose filter touches neither a gap nor an end."""
    reach = _REACH * smoothing
    gaps = np.flatnonzero(np.diff(t) > max(3.0 * period, smoothing))
    opens = np.concatenate([t[:1], t[gaps + 1]]) + reach
    closes = np.concatenate([t[gaps], t[-1:]]) - reach
    long = closes > opens
    edges = np.column_stack([opens[long], closes[long]]).ravel()
    return np.asarray(np.searchsorted(edges, grid) % 2 == 1)


def _check_variation(source: Smoothed, quantity: str, *, where: str) -> None:
    if not source.good.any():
        raise FitError(
            "no stretch without gaps", where=where, expected="a few seconds in one piece", hint="another signal"
        )
    change = float(np.std(source.rate[source.good]))
    size = float(np.max(np.abs(source.level[source.good])))
    if change > max(_LEAST_CHANGE.get(quantity, 0.0), 1e-9 * size):
        return
    raise FitError(
        f"no variation: the rate of change is {change:.2g}/s rms",
        where=where,
        expected=f"more than {_LEAST_CHANGE.get(quantity, 0.0):g}/s",
        hint="a stretch with braking or turning, or another signal",
    )


def _correlation(a: Smoothed, b: Smoothed, lags: TimeArray) -> tuple[FloatArray, FloatArray]:
    """Correlate (Pearson) a(t) with b(t + lag) over the points where both are usable; return also their number."""
    size = 1 << (a.rate.size + int(np.max(np.abs(lags)))).bit_length()

    def cross(p: FloatArray, q: FloatArray) -> FloatArray:
        return np.asarray(np.fft.irfft(np.conj(np.fft.rfft(p, size)) * np.fft.rfft(q, size), size)[lags])

    ma, mb = a.good.astype(np.float64), b.good.astype(np.float64)
    pa, pb = np.where(a.good, a.rate, 0.0), np.where(b.good, b.rate, 0.0)
    pa, pb = pa / np.sqrt(np.sum(pa**2) / ma.sum()), pb / np.sqrt(np.sum(pb**2) / mb.sum())
    count = np.maximum(np.rint(cross(ma, mb)), 1.0)
    mean_a, mean_b = cross(pa, mb) / count, cross(ma, pb) / count
    var_a = cross(pa**2, mb) / count - mean_a**2
    var_b = cross(ma, pb**2) / count - mean_b**2
    product = var_a * var_b
    # where one side hardly varies the quotient is rounding noise
    known = (var_a > 1e-6) & (var_b > 1e-6)
    r = np.where(known, (cross(pa, pb) / count - mean_a * mean_b) / np.sqrt(np.where(known, product, 1.0)), 0.0)
    return np.clip(r, -1.0, 1.0), count


def _search(a: Smoothed, b: Smoothed, step: float, o: Options) -> Peak:
    reach = math.ceil(o.max_offset_s / step)
    lags = np.arange(-reach, reach + 1)
    r, count = _correlation(a, b, lags)
    enough = count * step >= o.min_overlap_s
    if not enough.any():
        raise FitError(
            f"at most {float(np.max(count)) * step:.1f} s are usable in both sources",
            where=o.where,
            expected=f"{o.min_overlap_s:g} s",
            hint="a drive with fewer gaps, a larger max_offset_s or a start_offset_s",
        )
    r = np.where(enough, r, -1.0)
    top = int(np.argmax(r))
    low, high = _main_peak(r, top)
    outside = np.concatenate([r[:low], r[high + 1 :]])
    runner_up = float(outside.max()) if outside.size else -1.0
    limit = max(o.min_peak, _chance_limit(a, b, step, float(count[top]), 2.0 * o.max_offset_s))
    _check_peak(r, top, enough, limit, runner_up, float(lags[top] * step), where=o.where)
    bent = r[top - 1] - 2.0 * r[top] + r[top + 1]
    share = 0.5 * (r[top - 1] - r[top + 1]) / bent if bent < 0.0 else 0.0
    return Peak(float((lags[top] + share) * step), float(r[top]), runner_up, limit)


def _main_peak(r: FloatArray, top: int) -> tuple[int, int]:
    """Return first and last lag of the main peak: down to half its height and on to the next valley."""

    def walk(direction: int) -> int:
        i = top
        while 0 <= i + direction < r.size and (r[i + direction] < r[i] or r[i] > 0.5 * r[top] + 0.5 * r.min()):
            if r[i + direction] > r[i] and r[i] < 0.95 * r[top]:
                break  # a valley above half height: what follows is a peak of its own
            i += direction
        return i

    return walk(-1), walk(1)


def _chance_limit(a: Smoothed, b: Smoothed, step: float, count: float, width_s: float) -> float:
    """Return the correlation that unrelated signals with these spectra reach in the range once in a thousand cases."""
    reach = min(int(10.0 / step), a.rate.size - 1)
    lags = np.arange(-reach, reach + 1)
    own = _correlation(a, a, lags)[0] * _correlation(b, b, lags)[0]
    memory = max(float(own.sum()), 1.0)  # Bartlett [bartlett1946]: samples per independent one
    trials = 1.0 + width_s / (memory * step)
    z = NormalDist().inv_cdf(1.0 - _CHANCE / trials)
    bursts = math.sqrt(_burstiness(a, step) * _burstiness(b, step))
    limit = math.tanh(z / math.sqrt(max(count / memory / bursts - 3.0, 1.0)))
    events = count * step / BLOCK_S / bursts
    return min(limit, _SURE) if events >= _EVENTS else limit


def _burstiness(source: Smoothed, step: float) -> float:
    """Return blocks per effective block (1 or more): in stop and go a few pulls hold all energy and match by chance."""
    power = np.where(source.good, source.rate, 0.0) ** 2
    first = np.arange(0, power.size, max(round(BLOCK_S / step), 1))
    energy, used = np.add.reduceat(power, first), np.add.reduceat(source.good.astype(np.float64), first)
    energy = energy[used > 0.5 * used.max()]
    return float(energy.size * np.sum(energy**2) / np.sum(energy) ** 2)


def _check_peak(
    r: FloatArray, top: int, enough: BoolArray, limit: float, runner_up: float, lag_s: float, *, where: str
) -> None:
    found = f"correlation {r[top]:.3f} at {lag_s:+.2f} s"
    lowest = np.min(np.where(enough, r, 1.0))
    if r[top] < limit and -lowest > limit:
        raise FitError(
            f"the signals have opposite signs (correlation {lowest:.2f})",
            where=where,
            expected="one sign convention",
            hint="turn the sign of one signal in the signal map",
        )
    if r[top] < limit:
        raise FitError(
            f"weak peak: {found}",
            where=where,
            expected=f"at least {limit:.3f}: a search so wide over so few changes reaches less by chance",
            hint="a longer stretch with braking or turning, another max_offset_s, or check that both are one quantity",
        )
    if top in (0, r.size - 1) or not (enough[top - 1] and enough[top + 1]):
        raise FitError(
            f"the peak lies at the edge of the search range: {found}",
            where=where,
            expected="a peak inside the range",
            hint="a larger max_offset_s or a start_offset_s",
        )
    if runner_up > _AMBIGUOUS * r[top]:
        raise FitError(
            f"ambiguous: {found}, {runner_up:.2f} at another lag",
            where=where,
            expected=f"a second peak below {_AMBIGUOUS:.0%} of the first",
            hint="a smaller max_offset_s around a known start_offset_s, or a stretch that does not repeat",
        )
