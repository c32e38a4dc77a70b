"""Passes of one tyre through the trough: curves over speed, the speeds read from them, one number with an interval."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from aqualog.core.intervals import NOWHERE, Interval, widened
from aqualog.core.records import FloatArray
from aqualog.trade.concave import area_under, concave_fit, falls_to
from aqualog.trade.control import Estimate, satterthwaite
from aqualog.trade.curve import KMH, CurvePass
from aqualog.trade.limits import CurveLimits

__all__ = ["RESULTS", "CurveResult", "CurveSet", "common_speeds", "curve_set"]

CurveResult = Literal["min", "mean", "area"]
RESULTS: dict[CurveResult, tuple[str, str]] = {
    "min": ("m/s^2", "least lateral acceleration in the trough, mean over the common speeds"),
    "mean": ("m/s^2", "mean lateral acceleration in the trough, mean over the common speeds"),
    "area": ("m/s^2 km/h", "area under the mean lateral acceleration in the trough between the common speeds"),
}
"""Unit and meaning of the number that is compared between sets."""
DRAWS = 400
SEED = 4_711
_OFF = 0.02  # [m/s²] less changes no index by a point
_DELAY_S = 0.03  # [s] of the filter in a series sensor (K), as an example


@dataclass(frozen=True, slots=True)
class CurveSet:
    """Curves of a set over the entry speed, and what is read from them.

    Attributes
    ----------
    v : array (m,)
        Mean entry speed of each step. [m/s]
    least, mean, dry : array (m,)
        Concave fits of least and mean lateral acceleration in the trough, and means of the dry one. [m/s²] The fits end
        at the first step at which the least one is 0; beyond it the steps' means stand.
    result, ci, estimate
        The number of `RESULTS` with its interval, and the same with its variance.
    v_greatest, v_half, v_zero : (value, interval)
        Speed of the greatest mean acceleration, speeds at which the least one is half of the dry one, and 0. [m/s] NaN
        where the passes do not reach that; an end of `v_greatest` is infinite where it lies beyond the speeds driven.
    passes, valid : int
    notes : tuple of str
    """

    v: FloatArray
    least: FloatArray
    mean: FloatArray
    dry: FloatArray
    result: float = math.nan
    ci: Interval = NOWHERE
    estimate: Estimate = field(default=Estimate(math.nan, math.nan, 0.0))
    v_greatest: tuple[float, Interval] = (math.nan, NOWHERE)
    v_half: tuple[float, Interval] = (math.nan, NOWHERE)
    v_zero: tuple[float, Interval] = (math.nan, NOWHERE)
    passes: int = 0
    valid: int = 0
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class _Steps:
    """Valid passes, by the step of speed and the log that each belongs to."""

    step: FloatArray
    v: FloatArray
    least: FloatArray
    mean: FloatArray
    dry: FloatArray
    log: NDArray[np.int64]

    @property
    def drives(self) -> int:
        """Number of logs."""
        return int(np.unique(self.log).size)

    @property
    def is_clustered(self) -> bool:
        """Whether logs with several passes can be drawn as a whole."""
        return 1 < self.drives < self.log.size

    def means(self, x: FloatArray) -> FloatArray:
        return np.array([x[self.step == s].mean() for s in np.unique(self.step)])


def common_speeds(sets: Sequence[Sequence[CurvePass]], limits: CurveLimits) -> Interval:
    """Return the speeds that all sets have driven. [m/s] NaN without any."""
    ends = [(float(v[0]), float(v[-1])) for v in (_speeds(p, limits) for p in sets) if v.size]
    low, high = max((e[0] for e in ends), default=math.nan), min((e[1] for e in ends), default=math.nan)
    return (low, high) if low <= high else NOWHERE


def curve_set(
    passes: Sequence[CurvePass], limits: CurveLimits, *, result: CurveResult, between: Interval, level: float = 0.95,
    logs: Sequence[str] = (),
) -> CurveSet:  # fmt: skip
    """Summarise the passes of a set.

    Parameters
    ----------
    passes : sequence of CurvePass
        All of the set; those that are not valid do not count.
    result : str
        `min`, `mean` or `area`.
    between : (float, float)
        Common speeds over which `result` is taken. [m/s]
    level : float
        Confidence.
    logs : sequence of str
        Of each pass the log that it is in; empty: each in its own.

    Notes
    -----
    Passes whose speeds round to the same multiple of `limits.speed_step` are one step. The interval is from 400
    bootstrap draws of the passes of each step, widened by Student's t: degrees of freedom are the passes less the
    steps. Deviations from a step's mean of n passes grow by sqrt(n / (n - 1)), since its mean is its own. A step of one
    pass takes the deviations of the others.

    Passes of one log have its water and its sensor in common. Where two logs and more have several passes, whole logs
    are drawn, each with its deviations in all steps; degrees of freedom are those of the sum of the scatter between
    logs and within them [satterthwaite1946].
    """
    names = logs or [str(k) for k in range(len(passes))]
    good = _steps([p for p in passes if p.valid], limits, [n for n, p in zip(names, passes, strict=True) if p.valid])
    empty = np.zeros(0)
    if not good.v.size:
        return CurveSet(empty, empty, empty, empty, passes=len(passes), notes=("no pass is valid",))
    v = good.means(good.v)
    curves = _curves(good, v, good.least, good.mean, limits.a_y_zero)
    own = _read(v, *curves, good.means(good.dry), limits, result, between)
    draws = _draws(good, v, limits, result, between)
    spread = draws.std(axis=0, ddof=1) if draws.size else np.full(4, np.nan)
    dof = _freedom(good, v.size)

    def interval(k: int) -> Interval:
        seen = draws[np.isfinite(draws[:, k]), k] if draws.size else draws
        if not draws.size or not math.isfinite(own[k]) or seen.size < 0.5 * DRAWS:
            return NOWHERE
        return widened(own[k], seen, dof, level)

    return CurveSet(
        v, *curves, good.means(good.dry), own[0], interval(0), Estimate(own[0], float(spread[0]) ** 2, dof),
        _within(v, own[1], interval(1)), (own[2], interval(2)), (own[3], interval(3)), len(passes), int(good.v.size),
        (
            *_notes(good, v, own, between, limits, is_low=bool(curves[0][0] <= 0.5 * good.means(good.dry)[0])),
            *_sensor_notes([p for p in passes if p.valid]),
        ),
    )  # fmt: skip


def _freedom(good: _Steps, steps: int) -> float:
    """Degrees of freedom of the mean: between logs there are the logs less one, within them what is left."""
    free = float(good.v.size - steps)
    if not good.is_clustered:
        return free
    away = good.mean - good.means(good.mean)[np.searchsorted(np.unique(good.step), good.step)]
    own = [away[good.log == k] for k in range(good.drives)]
    within = max(free - (good.drives - 1.0), 1.0)
    inner = sum(float(((x - x.mean()) ** 2).sum()) for x in own) / within
    outer = sum(x.size * float(x.mean()) ** 2 for x in own) / (good.drives - 1.0)
    each = max(outer - inner, 0.0) / (good.v.size / good.drives)  # variance of a log
    return satterthwaite([each / good.drives, inner / good.v.size], [good.drives - 1.0, within])


def _steps(passes: Sequence[CurvePass], limits: CurveLimits, logs: Sequence[str] = ()) -> _Steps:
    def of(name: str) -> FloatArray:
        return np.array([float(getattr(p, name)) for p in passes])

    steps = np.array([round(p.v_entry / KMH / limits.speed_step) * limits.speed_step for p in passes])
    _, log = np.unique(np.array(logs or [str(k) for k in range(len(passes))]), return_inverse=True)
    return _Steps(steps, of("v_entry"), of("a_y_least"), of("a_y_mean"), of("a_y_dry"), log.astype(np.int64))


def _speeds(passes: Sequence[CurvePass], limits: CurveLimits) -> FloatArray:
    good = _steps([p for p in passes if p.valid], limits)
    return good.means(good.v) if good.v.size else good.v


def _curves(
    good: _Steps, v: FloatArray, least: FloatArray, mean: FloatArray, zero: float
) -> tuple[FloatArray, FloatArray]:
    """Fit both curves up to the step at which the least acceleration is 0: from there on it need not be concave.

    The passes stand at their step's mean speed, so that no fit looks beyond its ends.
    """
    means = [good.means(x) for x in (least, mean)]
    gone = np.flatnonzero(means[0] <= zero)
    end = int(gone[0]) + 1 if gone.size else v.size
    place = np.searchsorted(np.unique(good.step), good.step)
    is_fitted = place < end
    fits = [concave_fit(v[place[is_fitted]], x[is_fitted], v[:end]) for x in (least, mean)]
    found = [np.concatenate([f, m[end:]]) for f, m in zip(fits, means, strict=True)]
    return found[0], found[1]


def _read(
    v: FloatArray, least: FloatArray, mean: FloatArray, dry: FloatArray, limits: CurveLimits, result: CurveResult,
    between: Interval,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Return the result, and the speeds of the greatest, the half and no lateral acceleration."""
    low, high = between
    curve = least if result == "min" else mean
    if not math.isfinite(low + high):
        value = math.nan
    elif result == "area":
        value = area_under(v, curve, low, high) / KMH
    elif high > low:
        value = area_under(v, curve, low, high) / (high - low)
    else:
        value = float(np.interp(low, v, curve))
    return value, _top(v, mean), falls_to(v, least, 0.5 * dry), falls_to(v, least, limits.a_y_zero)


def _top(v: FloatArray, mean: FloatArray) -> float:
    """Return the speed at which a curve is greatest: the vertex of a parabola through the highest step and its
    neighbours, which are half a step away at the most; at an end the step itself.
    """
    k = int(np.argmax(mean))
    if not 0 < k < v.size - 1:
        return float(v[k])
    bend, slope, _ = np.polyfit(v[k - 1 : k + 2] - v[k], mean[k - 1 : k + 2], 2)
    ends = 0.5 * (v[k - 1] - v[k]), 0.5 * (v[k + 1] - v[k])
    return float(v[k] + np.clip(-0.5 * slope / bend, *ends)) if bend < 0.0 else float(v[k])


def _within(v: FloatArray, top: float, ci: Interval) -> tuple[float, Interval]:
    """Return the speed of the greatest acceleration and its interval: what lies at an end of the speeds is open there.

    The greatest of the driven speeds is at an end where the curve still rises beyond it: a bound, and no speed.
    """
    low, high = ci
    ends = -math.inf if low <= v[0] else low, math.inf if high >= v[-1] else high
    return (top if v[0] < top < v[-1] else math.nan), ends


def _draws(good: _Steps, v: FloatArray, limits: CurveLimits, result: CurveResult, between: Interval) -> FloatArray:
    """Return what is read from each bootstrap draw (b, 4); empty where no step has two passes."""
    steps = np.unique(good.step)
    members = [np.flatnonzero(good.step == s) for s in steps]
    if not any(m.size > 1 for m in members):
        return np.zeros((0, 4))
    away = {name: np.zeros(good.v.size) for name in ("least", "mean")}
    for name, x in away.items():
        y = getattr(good, name)
        for m in (m for m in members if m.size > 1):
            x[m] = (y[m] - y[m].mean()) * math.sqrt(m.size / (m.size - 1.0))
    several = np.concatenate([m for m in members if m.size > 1])
    rng = np.random.default_rng(SEED)
    of_log = {(int(k), int(s)): np.flatnonzero((good.log == k) & (good.step == s)) for k in good.log for s in steps}
    dry = good.means(good.dry)
    found = []
    for _ in range(DRAWS):
        own = np.concatenate(members)
        drawn = np.concatenate([rng.choice(m if m.size > 1 else several, m.size) for m in members])
        if good.is_clustered:
            donor = rng.integers(good.drives, size=good.drives)[good.log[own]]
            theirs = [of_log[int(k), int(s)] for k, s in zip(donor, good.step[own], strict=True)]
            drawn = np.array([
                x if not t.size else t[0] if t.size == 1 else rng.choice(t)
                for x, t in zip(drawn, theirs, strict=True)
            ])  # fmt: skip
        made = {n: np.zeros(good.v.size) for n in away}
        for name in away:
            y = getattr(good, name)
            level = np.concatenate([np.full(m.size, y[m].mean()) for m in members])
            made[name][own] = level + away[name][drawn]
        found.append(
            _read(v, *_curves(good, v, made["least"], made["mean"], limits.a_y_zero), dry, limits, result, between)
        )
    return np.array(found)


def _sensor_notes(passes: Sequence[CurvePass]) -> list[str]:
    """What the lateral accelerometer may add to all values."""
    notes, off = [], float(np.median([p.off for p in passes]))
    if abs(off) >= _OFF:
        notes.append(f"a_y is {off:+.2f} m/s² off v_x times yaw_rate on the dry circle: an offset, or body roll")
    most = _DELAY_S * max(abs(p.per_delay) for p in passes)
    if most >= _OFF:
        notes.append(f"a filter of {1e3 * _DELAY_S:.0f} ms in a_y would make means too large by up to {most:.2f} m/s²")
    return notes


def _notes(
    good: _Steps, v: FloatArray, own: tuple[float, float, float, float], between: Interval, limits: CurveLimits,
    *, is_low: bool,
) -> tuple[str, ...]:  # fmt: skip
    """What a reader must know; `is_low`: the slowest passes have less than half of the dry lateral acceleration."""
    notes, (slow, fast) = [], (f"{3.6 * x:.0f} km/h" for x in (v[0], v[-1]))
    few = [f"{s:g} km/h" for s in np.unique(good.step) if (good.step == s).sum() < limits.passes]
    if few:
        notes.append(f"fewer than {limits.passes:g} passes at {', '.join(few)}")
    if not math.isfinite(between[0]):
        notes.append("the sets have no speed in common")
    elif between[1] <= between[0]:
        notes.append("the sets have one speed in common: no area")
    if v.size > 1 and own[1] in (v[0], v[-1]):
        where = f"slowest passes, {slow}: slower" if own[1] == v[0] else f"fastest passes, {fast}: faster"
        notes.append(f"the mean lateral acceleration is greatest in the {where} ones may have more")
    if is_low:
        notes.append(f"the least lateral acceleration is below half of the dry one from {slow} on")
    if not math.isfinite(own[3]):
        notes.append(f"the least lateral acceleration does not reach 0 up to {fast}")
    return tuple(notes)
