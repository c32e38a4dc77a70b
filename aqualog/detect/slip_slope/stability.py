"""Judge whether the slip slope stayed the same over a session."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from aqualog.core.intervals import Interval
from aqualog.core.records import FloatArray
from aqualog.detect.slip_slope.regression import TIMES_MAX, Late, Line, fit_line, fit_trend

__all__ = ["Segment", "Stability", "Verdict", "block_labels", "judge_stability", "make_segments", "percent"]

Verdict = Literal["stable", "drifts", "varies", "cannot tell"]

BLOCK_S = (10.0, 30.0)  # [s] noise of the slip is correlated over a second, its offset over some more
BLOCKS = 40  # of a long session
SEGMENT_BLOCKS = 6  # of one segment
MOST_SEGMENTS = 12
SAME = 0.20  # change of the slope up to which it is stable: a few tenths of a bar, some ten degrees
LEAST = 0.10  # change that is called a drift
HOUR = 3600.0  # [s]
LEAST_SPAN = 1800.0  # [s] less tells nothing of an hour
SURE = 2.0  # how many times its own interval a segment must lie off; of a dozen, one in thirty sessions does by chance


@dataclass(frozen=True, slots=True)
class Segment:
    """A part of the session: from first to last used sample [s], used time [s], and its own line."""

    start_s: float
    end_s: float
    seconds: float
    line: Line


@dataclass(frozen=True, slots=True)
class Stability:
    """`change` of the slope over `span_s` and `per_hour`, relative, with 95 % intervals.

    NaN where not estimated, which for `per_hour` is below half an hour; infinite beyond ten times, minus infinite below
    a tenth.
    """

    verdict: Verdict
    sentence: str
    span_s: float
    change: float
    change_ci: Interval
    per_hour: float
    per_hour_ci: Interval


def block_labels(t: FloatArray) -> NDArray[np.int64]:
    """Return the block of each sample; a block spans 10 to 30 s, so that a long session has about 40.

    Parameters
    ----------
    t : array (n,)
        Ascending. [s]
    """
    if t.size == 0:
        return np.zeros(0, dtype=np.int64)
    length = float(np.clip((t[-1] - t[0]) / BLOCKS, *BLOCK_S))
    label = np.empty(t.size, dtype=np.int64)
    begin, block = 0, 0
    while begin < t.size:
        end = int(np.searchsorted(t, t[begin] + length))
        label[begin:end] = block
        begin, block = end, block + 1
    return label


def make_segments(
    t: FloatArray,
    mu: FloatArray,
    slip: FloatArray,
    label: NDArray[np.int64],
    *,
    dt: float,
    noise: float,
    late: Late | None = None,
) -> tuple[Segment, ...]:
    """Cut the used samples into parts of six blocks and more, at most 12, each with a line of its own.

    The delay of the reference is that of the whole drive (`late` with its half width), already corrected.
    """
    blocks = int(label[-1]) + 1 if label.size else 0
    count = min(MOST_SEGMENTS, blocks // SEGMENT_BLOCKS)
    if count < 2:
        return ()
    which = label * count // blocks
    segments = []
    for p in (np.flatnonzero(which == i) for i in range(count)):
        line = fit_line(mu[p], slip[p], label[p], noise=noise, late=None if late is None else late.part(p))
        segments.append(Segment(float(t[p[0]]), float(t[p[-1]]) + dt, p.size * dt, line))
    return tuple(segments)


def judge_stability(
    t: FloatArray,
    mu: FloatArray,
    slip: FloatArray,
    label: NDArray[np.int64],
    *,
    whole: Line,
    segments: tuple[Segment, ...],
    noise: float,
    late: Late | None = None,
) -> Stability:
    """Judge whether the slope was stable.

    Parameters
    ----------
    t, mu, slip, label : array (n,)
        Used samples.
    whole : Line
        Of all of them.
    segments : tuple of Segment
    noise : float
        As in `fit_line`.
    late : Late, optional
        As in `fit_trend`.

    Returns
    -------
    Stability
        `drifts` where the interval of the trend does not hold 0, its middle is beyond 10 %, and the segments' own lines
        show the same; else `varies` where a segment lies off the median of all by more than 20 % and by twice its own
        interval; `stable` where the interval of the trend lies within ±20 %; else `cannot tell`.
    """
    span = float(t[-1] - t[0]) if t.size else 0.0
    nothing = (math.nan, math.nan)
    if not whole.told or len(segments) < 2:
        text = "cannot be determined: too few stretches of usable driving to compare parts of the session"
        return Stability("cannot tell", text, span, math.nan, nothing, math.nan, nothing)
    trend = fit_trend(t, mu, slip, label, noise=noise, late=late)
    low, high = trend.change_ci
    verdict, sentence = _verdict(trend.change, low, high, span, segments)
    rate, rate_low, rate_high = (_per_hour(x, span) for x in (trend.change, low, high))
    return Stability(verdict, sentence, span, trend.change, (low, high), rate, (rate_low, rate_high))


def _per_hour(change: float, span: float) -> float:
    """Return the relative change in an hour at the same rate; NaN where the session is too short."""
    if span < LEAST_SPAN:
        return math.nan
    if math.isinf(change):
        return change
    exponent = math.log1p(change) * HOUR / span
    limit = math.log(TIMES_MAX)
    return math.copysign(math.inf, exponent) if abs(exponent) >= limit else math.expm1(exponent)


def percent(change: float) -> str:
    """Return `+12 %`; words for changes beyond ten times."""
    if math.isinf(change):
        return f"more than {TIMES_MAX:g} times" if change > 0.0 else f"less than 1/{TIMES_MAX:g}"
    return f"{100 * change:+.0f} %"


def _verdict(change: float, low: float, high: float, span: float, segments: tuple[Segment, ...]) -> tuple[Verdict, str]:
    bounds = f"{percent(change)} over {span / 60.0:.1f} min (95 %: {percent(low)} ... {percent(high)})"
    is_drift = (low > 0.0 or high < 0.0) and abs(change) > LEAST
    if is_drift and _is_seen(segments, is_rise=change > 0.0):
        return "drifts", f"drifts: {bounds}"
    usual = float(np.nanmedian([s.line.k for s in segments]))
    odd = [s for s in segments if _lies_off(s.line, usual)]
    if odd:
        s = max(odd, key=lambda s: abs(s.line.k - usual))
        part = f"min {s.start_s / 60.0:.1f} to {s.end_s / 60.0:.1f}"
        return "varies", f"varies: {1.0 / s.line.k:.1f} from {part}, usually {1.0 / usual:.1f}"
    if low > -SAME and high < SAME:
        return "stable", f"stable: {bounds}"
    return "cannot tell", f"cannot be determined: {bounds}{', which the parts do not show' if is_drift else ''}"


def _is_seen(segments: tuple[Segment, ...], *, is_rise: bool) -> bool:
    """Return whether the lines of the parts, which the reader sees, have such a trend: its interval excludes 0."""
    ends = np.array([(s.start_s, s.end_s, s.line.k, *s.line.k_ci) for s in segments if s.line.told])
    if len(ends) < 2:
        return False
    weight = 4.0 / (ends[:, 4] - ends[:, 3]) ** 2
    away = ends[:, :2].mean(axis=1)
    away = away - np.average(away, weights=weight)
    fall = float(weight * away @ ends[:, 2] / np.sqrt(weight @ away**2))  # of the slope, in half widths
    return (-fall if is_rise else fall) > 1.0


def _lies_off(line: Line, usual: float) -> bool:
    reach = 0.5 * (line.k_ci[1] - line.k_ci[0])
    off = abs(line.k - usual)
    return off > SURE * reach and off > SAME * abs(usual)
