"""All that the score takes from the engine's inside: residuals of a log, their noise, signatures of the library."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from aqualog.diagnose.channels import contrasts
from aqualog.diagnose.drive import Drive, prepare
from aqualog.diagnose.hypotheses import hypotheses, residual, signatures
from aqualog.diagnose.noise import Noise, bridged, fit_noise, whitened
from aqualog.model.term import Model

__all__ = ["Drive", "Noise", "noise_of", "prepare", "residual", "shapes", "unit_innovations"]


def noise_of(drive: Drive, x: np.ndarray) -> Noise:
    """Noise of a residual (C, n) in which nothing else is."""
    return fit_noise(x, drive.mask, contrasts(drive.channels))


def unit_innovations(drive: Drive, noise: Noise, x: np.ndarray) -> np.ndarray:
    """A residual-shaped array (C, n), finite, as unit innovations (N,)."""
    return np.asarray(whitened(bridged(x, drive.mask)[None], noise)[0])


def shapes(drive: Drive) -> Mapping[str, np.ndarray]:
    """What one unit of each effect with one free parameter does to the residual: key -> (C, n)."""
    asked, _ = hypotheses([drive], Model())
    found = zip(asked, signatures(drive, Model(), asked, base=residual(drive, Model())), strict=True)
    counts: dict[str, int] = {}
    for h in asked:
        counts[h.key] = counts.get(h.key, 0) + 1
    return {h.key: x[0] for h, x in found if len(h.free) == 1 and counts[h.key] == 1}
