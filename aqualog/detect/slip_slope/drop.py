"""Criterion 4: compare the slope with its history, on a driven, calm wheel."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from aqualog.core.compiled import compiled, plain
from aqualog.core.records import BoolArray, FloatArray
from aqualog.detect.slip_slope.history import KEPT_PERIODS, Period, Rule

__all__ = ["THRESHOLD", "DropParams", "DropState", "completed", "initial_state", "scan"]

THRESHOLD = 0.5  # [-] lost share of the dry slope


class DropParams(NamedTuple):
    """Bounds of the criterion; made by `DropParams.make`."""

    drop: float  # [-] share of the reference below which the slope has dropped
    recovered: float  # [-] share above which it has come back
    sd_max: float  # [-] relative standard deviation up to which an estimate is valid
    settle: int  # samples after an alarm of the change detection before an estimate goes into the history
    hold: int  # samples that a detection outlasts the last valid estimate
    period: float  # [s] of valid estimates
    provisional: float  # [s] of valid estimates after which the current period is a reference, if there is no other
    is_max: bool
    dt: float

    @staticmethod
    def make(dt: float, rule: Rule, loss: float = THRESHOLD) -> DropParams:
        """Return half of the reference (thesis: C68); back above 0.6 of it, so that the detection does not flicker."""
        left = 1.0 - loss
        back = min(1.2 * left, 0.5 * (1.0 + left))
        return DropParams(left, back, 0.2, round(5.0 / dt), round(2.0 / dt), 30.0, 5.0, rule == "max", dt)


class DropState(NamedTuple):
    """Running period, kept periods (newest last, as many as `n_kept`), reference, and the detection bit."""

    seconds: float
    largest: float
    mean: float
    kept: FloatArray  # (KEPT_PERIODS, 3): largest, mean, seconds
    n_kept: int
    new: int  # periods completed in this drive
    reference: float
    settling: int
    held: int
    active: bool


def initial_state(periods: tuple[Period, ...], *, rule: Rule, fallback: float = math.nan) -> DropState:
    """Return the state before the first sample; `fallback`: reference without a history (vehicle file), or NaN."""
    kept = np.zeros((KEPT_PERIODS, 3))
    count = min(len(periods), KEPT_PERIODS)
    for i, p in enumerate(periods[-KEPT_PERIODS:]):
        kept[i] = (p.largest, p.mean, p.seconds)
    reference = _reference(kept, count, rule == "max") if count else fallback
    return DropState(0.0, 0.0, 0.0, kept, count, 0, reference, 0, 0, active=False)


def completed(state: DropState) -> tuple[Period, ...]:
    """Return the newest periods that this drive added; a last one of 5 s or more counts."""
    new = min(state.new, state.n_kept)
    periods = [
        Period(float(row[0]), float(row[1]), float(row[2])) for row in state.kept[state.n_kept - new : state.n_kept]
    ]
    if state.seconds >= 5.0:
        periods.append(Period(state.largest, state.mean, state.seconds))
    return tuple(periods)


@compiled
def _reference(kept, count, is_max):  # type: ignore[no-untyped-def]
    """Return what `history.reference` does. Loops: numba's quantile and maximum load a good part of numba."""
    ordered = np.empty(count)
    for i in range(count):
        x, j = kept[i, 0 if is_max else 1], i
        while j > 0 and ordered[j - 1] > x:
            ordered[j] = ordered[j - 1]
            j -= 1
        ordered[j] = x
    at = (1.0 if is_max else 0.75) * (count - 1)
    low = int(at)
    share = at - low
    return ordered[low] * (1.0 - share) + ordered[min(low + 1, count - 1)] * share


@compiled
def _scan(p, s, slope, slope_sd, is_valid, alarm, rel, bits, refs):  # type: ignore[no-untyped-def]
    seconds, largest, mean, count, new = s.seconds, s.largest, s.mean, s.n_kept, s.new
    reference, settling, held, active = s.reference, s.settling, s.held, s.active
    kept = s.kept.copy()
    has_own = count > 0
    for i in range(slope.size):
        settling = p.settle if alarm[i] != 0.0 else max(settling - 1, 0)
        rel[i] = math.nan
        if alarm[i] < 0.0:
            active = False  # the slope has risen; if it is still low, the next valid estimate shows it
        if is_valid[i] and slope_sd[i] < p.sd_max * slope[i]:
            share = slope[i] / reference  # NaN without a reference: never a drop
            rel[i] = 1.0 - share
            active = share < (p.recovered if active else p.drop)
            held = p.hold
            if not active and settling == 0:
                seconds += p.dt
                mean += (slope[i] - mean) * p.dt / seconds
                largest = max(largest, slope[i])
                if not has_own and math.isnan(reference) and seconds >= p.provisional:
                    reference = largest if p.is_max else mean
                if seconds >= p.period:
                    if count == KEPT_PERIODS:
                        for j in range(3 * (KEPT_PERIODS - 1)):
                            kept[j // 3, j % 3] = kept[j // 3 + 1, j % 3]
                        count -= 1
                    kept[count, 0], kept[count, 1], kept[count, 2] = largest, mean, seconds
                    count += 1
                    new += 1
                    has_own = True
                    seconds, largest, mean = 0.0, 0.0, 0.0
                    reference = _reference(kept, count, p.is_max)
        else:
            held = max(held - 1, 0)
            active = active and held > 0
        bits[i] = active
        refs[i] = reference
    return DropState(seconds, largest, mean, kept, count, new, reference, settling, held, active)


def scan(
    p: DropParams, state: DropState, slope: FloatArray, slope_sd: FloatArray, is_valid: BoolArray, alarm: FloatArray
) -> tuple[FloatArray, BoolArray, FloatArray, DropState]:
    """Compare the slope with its history, and update the history with it.

    Parameters
    ----------
    state : DropState
        From `initial_state` or the piece before; not changed.
    slope, slope_sd : array (n,)
        Estimate and its standard deviation. [-]
    is_valid : bool array (n,)
        The tyre is driven, its wheel calm, and the estimate is of this moment.
    alarm : array (n,)
        Alarms of the change detection; for 5 s after one the estimate settles and stays out of the history.

    Returns
    -------
    loss : array (n,)
        1 - C / C_ref; NaN where not valid or without a reference. [-]
    active : bool array (n,)
        From a loss above 0.5 until it is below 0.4, the slope rises, or 2 s after the last valid estimate.
    reference : array (n,)
        Dry slope that was compared with; NaN without one. [-]
    state : DropState

    A slope that has dropped does not enter the history, so a long snow drive after a dry one stays detected.
    Thesis: criterion 4 of section 2.5 (C68), history of 2.3 (C56).
    """
    loss, refs = np.empty_like(slope), np.empty_like(slope)
    bits = np.zeros(slope.size, dtype=np.bool_)
    last = _scan(p, state, *plain(slope, slope_sd, is_valid, alarm), loss, bits, refs)
    return loss, bits, refs, last
