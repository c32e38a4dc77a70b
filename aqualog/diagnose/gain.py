"""Gain of an extended model over the base, on drives that it was not fitted to."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from aqualog.core.errors import FitError
from aqualog.core.intervals import student_quantile
from aqualog.core.records import BoolArray, FloatArray
from aqualog.diagnose.channels import CHANNELS, block_means, block_step
from aqualog.diagnose.drive import Drive, led_by
from aqualog.diagnose.hypotheses import residual
from aqualog.diagnose.noise import Noise, bridged, for_mask, whitened
from aqualog.diagnose.records import ChannelGain, Consequence, Gain
from aqualog.model.follow import follow
from aqualog.model.term import Model

__all__ = [
    "BLOCK_S", "DRIVES_AS_UNITS", "HeldOut", "LogScoreGain", "block_scores", "channel_gain", "corridor_share", "gain",
    "log_score_gain", "measured_gain",
]  # fmt: skip

BLOCK_S = 20.0  # [s] longer than the noise of any channel remembers
DRIVES_AS_UNITS = 5  # with fewer drives their spread cannot be estimated
DRAWS = 2000
Z = 1.959964  # 97.5 % quantile of the normal distribution
CORRIDOR_INNER, CORRIDOR_OUTER = 0.05, 0.5  # of the largest reference (K: corridor score of [iso18571_2024])


@dataclass(frozen=True, slots=True)
class HeldOut:
    """One drive, without the terms of the extended model and with them.

    `before`, `after`: residual channel -> array (n,), one step ahead; `mask` (n,) where they count; `free_before`,
    `free_after`: the same of simulations that run free, where there are any. `scores_before`, `scores_after`: log
    scores (b,) of blocks of the drive [nats (natural logarithm)], as `block_scores` gives them.
    """

    name: str
    mask: BoolArray
    before: Mapping[str, FloatArray]
    after: Mapping[str, FloatArray]
    scores_before: FloatArray
    scores_after: FloatArray
    free_before: Mapping[str, FloatArray] = field(default_factory=dict)
    free_after: Mapping[str, FloatArray] = field(default_factory=dict)


class LogScoreGain(NamedTuple):
    """Gain of the log score over all drives together, with its 95 % interval. [nats (natural logarithm)]"""

    value: float
    low: float
    high: float


def channel_gain(
    channel: str,
    unit: str,
    before: Sequence[FloatArray],
    after: Sequence[FloatArray],
    *,
    masks: Sequence[BoolArray] | None = None,
    free_before: Sequence[FloatArray] = (),
    free_after: Sequence[FloatArray] = (),
) -> ChannelGain:
    """Root mean square of a residual channel over all drives, before and after.

    Parameters
    ----------
    channel, unit : str
    before, after : sequence of arrays (n,)
        One per drive, in the channel's unit; NaN does not count, and in either of the two it does not in the other.
    masks : sequence of bool arrays (n,), optional
        Samples that count.
    free_before, free_after : sequence of arrays (n,)
        The same of simulations that run free.

    Returns
    -------
    ChannelGain
        NaN where there is no sample.
    """
    masks = [np.ones(x.size, dtype=bool) for x in before] if masks is None else masks
    one_step = _rms_of_both(before, after, masks)
    free = _rms_of_both(free_before, free_after, masks) if free_before else (math.nan, math.nan)
    return ChannelGain(channel, unit, *one_step, *free)


def _rms_of_both(
    before: Sequence[FloatArray], after: Sequence[FloatArray], masks: Sequence[BoolArray]
) -> tuple[float, float]:
    squares, count = np.zeros(2), 0
    for x, y, mask in zip(before, after, masks, strict=True):
        known = mask & np.isfinite(x) & np.isfinite(y)
        squares += [float(np.square(x[known]).sum()), float(np.square(y[known]).sum())]
        count += int(known.sum())
    if count == 0:
        return math.nan, math.nan
    rms = np.sqrt(squares / count)
    return float(rms[0]), float(rms[1])


def block_scores(
    whitened: FloatArray, *, dt: float, seconds: float = BLOCK_S, log_scale: FloatArray | float = 0.0
) -> FloatArray:
    """Gaussian log score of whitened residuals, block by block.

    Parameters
    ----------
    whitened : array (C, n) or (n,)
        Innovations over their standard deviation; NaN where masked, with the same mask before and after.
    dt : float
        [s]
    seconds : float
        Length of a block; a remainder at the end belongs to the last whole block. [s]
    log_scale : array (C,) or float
        Logarithm of the innovations' standard deviation. It cancels in a gain where both models are judged with the
        same noise, and must be given where they are not.

    Returns
    -------
    scores : array (b,)
        Sum of -z^2 / 2 - log_scale over the samples of a block; at least one block. A constant, log(2 pi) / 2 a sample,
        is left out. [nats (natural logarithm)]
    """
    z = np.atleast_2d(np.asarray(whitened, dtype=np.float64))
    scale = np.broadcast_to(np.atleast_1d(np.asarray(log_scale, dtype=np.float64)), (z.shape[0],))
    known = np.isfinite(z)
    score = -np.where(known, 0.5 * np.square(np.where(known, z, 0.0)) + scale[:, None], 0.0).sum(axis=0)
    length = max(1, round(seconds / dt))
    starts = np.arange(max(1, score.size // length)) * length
    return np.asarray(np.add.reduceat(score, starts), dtype=np.float64)


def log_score_gain(
    before: Sequence[FloatArray], after: Sequence[FloatArray], *, seed: int, draws: int = DRAWS
) -> LogScoreGain:
    """Gain of the log score with its interval.

    Parameters
    ----------
    before, after : sequence of arrays (b,)
        Log scores of the same blocks of each drive. [nats (natural logarithm)]
    seed : int
        Of the bootstrap.
    draws : int

    Returns
    -------
    LogScoreGain
        With `DRIVES_AS_UNITS` drives or more, or where a drive has a single block, whole drives are drawn again and the
        interval holds for another set of such drives; else blocks of each drive, and it holds for these drives.
        Deviations are widened by Student's t for few units. NaN with fewer than two units.

    Raises
    ------
    FitError
        If the blocks before and after are not the same ones, or not finite.
    """
    if len(before) != len(after) or any(x.shape != y.shape for x, y in zip(before, after, strict=True)):
        raise FitError("log scores before and after are not of the same blocks")
    gains = [np.asarray(y - x, dtype=np.float64) for x, y in zip(before, after, strict=True)]
    value = float(sum(g.sum() for g in gains))
    if not math.isfinite(value):
        raise FitError("log scores are not finite")
    # blocks of one drive are drawn among themselves
    strata = [np.array([g.sum() for g in gains])] if _drives_are_units(gains) else gains
    freedom = sum(s.size - 1 for s in strata)
    if freedom < 1:
        return LogScoreGain(value, math.nan, math.nan)
    rng = np.random.default_rng(seed)
    deviation = np.zeros(draws)
    for s in strata:
        if s.size > 1:
            drawn = s[rng.integers(s.size, size=(draws, s.size))].sum(axis=1) - s.sum()
            deviation += math.sqrt(s.size / (s.size - 1.0)) * drawn
    wider = student_quantile(0.975, freedom) / Z
    low, high = np.quantile(deviation, [0.025, 0.975])
    return LogScoreGain(value, value + wider * float(low), value + wider * float(high))


def _drives_are_units(blocks: Sequence[FloatArray]) -> bool:
    return len(blocks) >= DRIVES_AS_UNITS or (len(blocks) > 1 and any(b.size < 2 for b in blocks))


def corridor_share(predicted: FloatArray, measured: FloatArray, mask: BoolArray | None = None) -> float:
    """Corridor score of a predicted signal: 1 within 5 % of the largest measured value, 0 beyond 50 %, a parabola
    between, and the mean of that over time; NaN without a sample. [-]
    """  # fmt: skip
    known = np.isfinite(predicted) & np.isfinite(measured)
    known = known if mask is None else known & mask
    largest = float(np.abs(measured[known]).max()) if known.any() else 0.0
    if largest == 0.0:
        return math.nan
    off = np.abs(predicted[known] - measured[known]) / largest
    score = np.clip((CORRIDOR_OUTER - off) / (CORRIDOR_OUTER - CORRIDOR_INNER), 0.0, 1.0) ** 2
    return float(score.mean())


def gain(
    drives: Sequence[HeldOut],
    units: Mapping[str, str],
    *,
    seed: int,
    in_sample: bool = False,
    consequences: tuple[Consequence, ...] = (),
) -> Gain:
    """The gain as a record.

    Parameters
    ----------
    drives : sequence of HeldOut
        At least one.
    units : mapping channel -> unit
        Names the channels, in the order of the report.
    seed : int
        Of the bootstrap.
    in_sample : bool
        The drives are those that the model was fitted to.
    consequences : tuple of Consequence

    Returns
    -------
    Gain
        `notes` state the scope of the interval, the drives on which the model is worse, and whether there is no gain.
    """
    if not drives:
        raise FitError("a gain needs a drive", expected="at least one")
    channels = tuple(c for name, unit in units.items() if (c := _channel(drives, name, unit)) is not None)
    score = log_score_gain([d.scores_before for d in drives], [d.scores_after for d in drives], seed=seed)
    return Gain(
        channels=channels,
        log_score=score.value,
        low=score.low,
        high=score.high,
        heldout=() if in_sample else tuple(d.name for d in drives),
        in_sample=in_sample,
        consequences=consequences,
        notes=tuple(_notes(drives, score, in_sample=in_sample)),
    )


def _channel(drives: Sequence[HeldOut], name: str, unit: str) -> ChannelGain | None:
    those = [d for d in drives if name in d.before and name in d.after]
    if not those:
        return None
    free = all(name in d.free_before and name in d.free_after for d in those)
    return channel_gain(
        name, unit, [d.before[name] for d in those], [d.after[name] for d in those], masks=[d.mask for d in those],
        free_before=[d.free_before[name] for d in those] if free else (),
        free_after=[d.free_after[name] for d in those] if free else (),
    )  # fmt: skip


def _notes(drives: Sequence[HeldOut], score: LogScoreGain, *, in_sample: bool) -> list[str]:
    notes = []
    if in_sample:
        notes.append("the gain is on the drives that the model was fitted to; it is no evidence for other drives")
    if math.isnan(score.low):
        notes.append(f"no interval: the log score has a single block of {BLOCK_S:g} s")
    elif _drives_are_units([d.scores_after for d in drives]):
        notes.append(f"the interval of the log score holds for {len(drives)} other drives of this kind")
    else:
        notes.append("the interval of the log score holds for the drives named; they are too few for a wider statement")
    worse = [d.name for d in drives if float((d.scores_after - d.scores_before).sum()) < 0.0]
    if worse and len(drives) > 1:
        notes.append(f"worse with the model: {', '.join(worse)}")
    if not score.low > 0.0:
        notes.append("no measurable gain")
    return notes


FREE_RATE = 1.0 / 30.0  # [1/s] free simulation forgets errors after half a minute, so that one gust does not dominate
SPEED = "speed"


def measured_gain(
    drives: Sequence[Drive],
    before: Model,
    after: Model,
    noise: Noise,
    *,
    seed: int,
    in_sample: bool,
    consequences: tuple[Consequence, ...] = (),
) -> Gain:
    """Error and log score with one model and the other.

    Parameters
    ----------
    drives : sequence of Drive
        With the channels that the noise was fitted on.
    before, after : Model
    noise : Noise
        Of the diagnosed drive after its best set: one measure for both models.
    in_sample : bool
        Whether these are the diagnosed drives themselves.

    The channel `speed` is the error of a simulation that runs free for half a minute [m/s].
    """
    held = []
    for d in drives:
        own = for_mask(noise, d.mask)
        # each model has its own target speed with which it meets the measured speed
        residuals = [residual(led_by(d, m), m) for m in (before, after)]
        rows = [whitened(bridged(r, d.mask)[None], own)[0].reshape(r.shape) for r in residuals]
        used = (own.weights > 0.0).any(axis=0)
        scores = [block_scores(np.where(used, w, np.nan), dt=block_step(d.dt)) for w in rows]
        free = [_free_speed(d, m) for m in (before, after)]
        named = [dict(zip(d.channels, r, strict=True)) for r in residuals]
        if not d.untorqued:
            for x, f in zip(named, free, strict=True):
                x[SPEED] = np.full_like(f, np.nan)
        held.append(
            HeldOut(
                d.name, d.mask, named[0], named[1], scores[0], scores[1],
                {} if d.untorqued else {SPEED: free[0]}, {} if d.untorqued else {SPEED: free[1]},
            )
        )  # fmt: skip
    units = {c: CHANNELS[c].unit for c in drives[0].channels} | {SPEED: "m/s"}
    return gain(held, units, seed=seed, in_sample=in_sample, consequences=consequences)


def _free_speed(d: Drive, model: Model) -> FloatArray:
    # the measured speed, not the target speed, which belongs to another model
    shown = follow(d.vehicle, replace(d.course, v_x=d.speed), model, rate=FREE_RATE)
    return block_means(shown["v_x"] - d.speed, d.dt)
