"""Held-out drives, simulated with the model before and after."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.diagnose.channels import CHANNELS, block_means, block_step
from aqualog.diagnose.drive import Drive, led_by
from aqualog.diagnose.gain import HeldOut, block_scores, gain
from aqualog.diagnose.hypotheses import residual
from aqualog.diagnose.noise import Noise, bridged, for_mask, spectra, whitened
from aqualog.diagnose.records import Consequence, Gain
from aqualog.model.follow import follow
from aqualog.model.term import Model

__all__ = ["measured_gain"]

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
        rows = [whitened(spectra(bridged(r, d.mask)[None]), own)[0].reshape(r.shape) for r in residuals]
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
