"""Gain of an extended model over the base, on drives that it was not fitted to."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from aqualog.core.errors import FitError
from aqualog.core.intervals import widened
from aqualog.core.records import BoolArray, FloatArray
from aqualog.diagnose.channels import CHANNELS, block_means, block_step
from aqualog.diagnose.drive import Drive, led_by
from aqualog.diagnose.hypotheses import residual
from aqualog.diagnose.noise import Noise, bridged, for_mask, whitened
from aqualog.diagnose.records import ChannelGain, Consequence, Gain
from aqualog.diagnose.threads import beside
from aqualog.model.follow import follow
from aqualog.model.term import Model

__all__ = [
    "BLOCK_S", "KEPT", "block_scores", "gains_by_burst", "log_score_gain", "measured_gain", "rms_of_both", "scope",
]  # fmt: skip

# least share of the promised gain that held-out drives keep, which is 0 for an effect of half the size: 58 right names
# kept 0.13 to 1.8 of it, two wrong ones beside measured noise -0.3 and 0.0 (S)
KEPT = 0.1
BLOCK_S = 20.0  # [s] longer than the noise of any channel remembers
DRIVES_AS_UNITS = 5  # with fewer drives their spread cannot be estimated
DRAWS = 2000
FREE_RATE = 1.0 / 30.0  # [1/s] free simulation forgets errors after half a minute, so that one gust does not dominate
SPEED = "speed"


class LogScoreGain(NamedTuple):
    """Gain over all drives together, with its 95 % interval. [nats (natural logarithm)]"""

    value: float
    low: float
    high: float


def measured_gain(
    drives: Sequence[Drive], models: tuple[Model, Model, Model], noise: Noise, *, seed: int, in_sample: bool,
    consequences: tuple[Consequence, ...] = (),
) -> Gain:  # fmt: skip
    """Error and log score of models on drives with the channels that the noise was fitted on.

    `models`: as the file has it, the same at the car's likeliest values, and extended at its likeliest values. Errors
    fall from the first to the last; the log score is gained over the better of the first two, so that it is the
    effects' alone. Right effects gain half of what they change squared, on average. `noise`: of the diagnosed drive
    after its best set; `in_sample`: these are the diagnosed drives themselves. The channel `speed` is the error of a
    simulation that runs free for half a minute [m/s].
    """
    masks, names = [d.mask for d in drives], tuple(d.name for d in drives)
    x, y, before, after, promised = _compared(drives, models, noise)
    channels = [
        ChannelGain(name, CHANNELS[name].unit, *rms_of_both([r[i] for r in x], [r[i] for r in y], masks))
        for i, name in enumerate(drives[0].channels)
    ]
    if not drives[0].untorqued:
        then, now = beside(lambda m: [_free_speed(d, m) for d in drives], models[::2])
        channels.append(ChannelGain(SPEED, "m/s", math.nan, math.nan, *rms_of_both(then, now, masks)))
    won = log_score_gain(before, after, seed=seed)
    notes, burst = scope(names, before, after, won, in_sample=in_sample), _is_burst(before, after, promised)
    return Gain(
        tuple(channels), *won, () if in_sample else names, in_sample, consequences, notes, promised, in_sample and burst
    )


def gains_by_burst(drives: Sequence[Drive], models: tuple[Model, Model, Model], noise: Noise) -> bool:
    """Whether of the diagnosed drives one block alone gains, and the rest loses; `models` and `noise` as above."""
    *_, before, after, promised = _compared(drives, models, noise)
    return _is_burst(before, after, promised)


class _Compared(NamedTuple):
    """Residuals (C, n) of each drive with the first and the last model, log scores of blocks, and what is promised."""

    x: list[FloatArray]
    y: list[FloatArray]
    before: list[FloatArray]
    after: list[FloatArray]
    promised: float


def _compared(drives: Sequence[Drive], models: tuple[Model, Model, Model], noise: Noise) -> _Compared:
    # each model has its own target speed with which it meets the measured speed
    x, alone, y = beside(lambda m: [residual(led_by(d, m), m) for d in drives], models)

    def unit(residuals: list[FloatArray]) -> list[FloatArray]:
        own = [(r, bridged(r, d.mask), for_mask(noise, d.mask)) for d, r in zip(drives, residuals, strict=True)]
        return [whitened(b[None], n).reshape(r.shape) for r, b, n in own]

    def scores_of(z: list[FloatArray]) -> list[FloatArray]:
        return [block_scores(own, block_step(d.dt)) for d, own in zip(drives, z, strict=True)]

    z = min(unit(x), unit(alone), key=lambda own: sum(float(np.square(a).sum()) for a in own))
    extended = unit(y)
    promised = sum(0.5 * float(np.square(a - b).sum()) for a, b in zip(z, extended, strict=True))
    return _Compared(x, y, scores_of(z), scores_of(extended), promised)


def _is_burst(before: Sequence[FloatArray], after: Sequence[FloatArray], promised: float) -> bool:
    gains = np.concatenate([b - a for a, b in zip(before, after, strict=True)])
    least, most = KEPT * promised, float(gains.max())
    return bool(most > least and float(gains.sum()) - most < -least)


def rms_of_both(
    before: Sequence[FloatArray], after: Sequence[FloatArray], masks: Sequence[BoolArray]
) -> tuple[float, float]:
    """Root mean squares of a channel (n,) over all drives, of samples that both have; NaN without any."""
    squares, count = np.zeros(2), 0
    for x, y, mask in zip(before, after, masks, strict=True):
        known = mask & np.isfinite(x) & np.isfinite(y)
        squares += [float(np.square(x[known]).sum()), float(np.square(y[known]).sum())]
        count += int(known.sum())
    rms = np.sqrt(squares / count) if count else np.full(2, math.nan)
    return float(rms[0]), float(rms[1])


def _free_speed(d: Drive, model: Model) -> FloatArray:
    # the measured speed, not the target speed, which belongs to another model
    shown = follow(d.vehicle, replace(d.course, v_x=d.speed), model.of(d.name), rate=FREE_RATE)
    return block_means(shown["v_x"] - d.speed, d.dt)


def block_scores(z: FloatArray, dt: float) -> FloatArray:
    """Log score (b,) of unit innovations (C, n) at steps `dt` [s], by blocks of 20 s; 0 where they are masked. It is
    -z² / 2 without its constant. [nats (natural logarithm)] A remainder at the end belongs to the last whole block."""
    score = -0.5 * np.square(z).sum(axis=0)
    length = max(1, round(BLOCK_S / dt))
    return np.asarray(np.add.reduceat(score, np.arange(max(1, score.size // length)) * length))


def log_score_gain(before: Sequence[FloatArray], after: Sequence[FloatArray], *, seed: int) -> LogScoreGain:
    """Gain of the log score with its interval, from the scores (b,) of the same blocks of each drive; FitError if they
    are not the same ones, or not finite.

    With `DRIVES_AS_UNITS` drives or more, or where a drive has a single block, whole drives are drawn again and the
    interval holds for another set of such drives. Else blocks of each drive are, and it holds for these drives.
    Deviations are widened by Student's t for few units. The interval is NaN with fewer than two units.
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
    deviation = np.zeros(DRAWS)
    for s in strata:
        if s.size > 1:
            drawn = s[rng.integers(s.size, size=(DRAWS, s.size))].sum(axis=1) - s.sum()
            deviation += math.sqrt(s.size / (s.size - 1.0)) * drawn
    return LogScoreGain(value, *widened(value, value + deviation, freedom))


def _drives_are_units(blocks: Sequence[FloatArray]) -> bool:
    return len(blocks) >= DRIVES_AS_UNITS or (len(blocks) > 1 and any(b.size < 2 for b in blocks))


def scope(
    names: Sequence[str], before: Sequence[FloatArray], after: Sequence[FloatArray], won: LogScoreGain, *,
    in_sample: bool,
) -> tuple[str, ...]:  # fmt: skip
    """Notes on what the interval holds for, on which drives the model is worse, and whether there is no gain."""
    own = "the gain is that on the drives to which the model was fitted; other drives may gain less"
    reach = "the interval of the log score holds for the drives named; they are too few for a wider statement"
    if math.isnan(won.low):
        reach = f"no interval: the log score has a single block of {BLOCK_S:g} s"
    elif _drives_are_units(after):
        reach = f"the interval of the log score holds for {len(names)} other drives of this kind"
    notes = [own, reach] if in_sample else [reach]
    worse = [n for n, x, y in zip(names, before, after, strict=True) if float((y - x).sum()) < 0.0]
    if worse and len(names) > 1:
        notes.append(f"the model predicts {', '.join(worse)} worse than before")
    if not won.low > 0.0:
        notes.append("no measurable gain")
    return tuple(notes)
