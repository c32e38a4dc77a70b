"""Effects that begin at an unknown moment of a drive: where, and how fast, they explain most."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.diagnose.channels import block_step, contrasts
from aqualog.diagnose.drive import Drive
from aqualog.diagnose.hypotheses import Hypothesis
from aqualog.diagnose.noise import white_noise
from aqualog.diagnose.steps import OUTLIER, begun
from aqualog.model.effects import EFFECTS

__all__ = ["moments"]

SHORTEST_S = 1.0  # of a change; a faster one looks the same in blocks of 0.1 s


def moments(
    drive: Drive, residual: FloatArray, asked: Sequence[Hypothesis], signatures: Sequence[FloatArray]
) -> tuple[Hypothesis, ...]:
    """Each effect that begins during the drive at each wheel, with the begin and duration that explain most.

    The response of the effect that `DriveSearch.begins_like` names, times a ramp, stands for it: no simulation of each
    moment is needed. The noise is taken as white, for what is slow must not count as noise here.

    Parameters
    ----------
    drive : Drive
    residual : array (C, n)
    asked, signatures : sequences
        Of the other hypotheses, (k, C, n) each.
    """
    used = drive.mask
    white = white_noise(residual, used, contrasts(drive.channels)).rotation
    left = white @ residual
    most = OUTLIER * np.median(np.abs(left[:, used]), axis=1, keepdims=True)
    left = np.clip(left, -most, most)
    dt = block_step(drive.dt)
    out = []
    for effect in EFFECTS.values():
        like = effect.drive.begins_like
        for h, signature in zip(asked, signatures, strict=True) if like else ():
            if h.effect.name != like or h.where is None or len(h.where) == 1:
                continue
            response = white @ signature[0]
            weight = np.where(used, (response**2).sum(axis=0), 0.0)
            score = np.where(used, (response * left).sum(axis=0), 0.0)
            if weight.sum() <= 0.0:
                continue
            low, rise = begun(weight, score)
            duration = max(rise * dt, SHORTEST_S)
            fixed = {"start": max(low * dt - 0.5 * duration, 0.0), "duration": duration}
            out.append(Hypothesis(effect, h.where, tuple(p.name for p in effect.parameters[:1]), fixed))
    return tuple(out)
