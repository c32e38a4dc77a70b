"""What a drive differs by as drives of this car do, taken off a residual before something new is looked for in it."""

from __future__ import annotations

import numpy as np

from aqualog.diagnose.bench import Bench
from aqualog.diagnose.channels import contrasts
from aqualog.diagnose.noise import bridged, fit_noise, spectra, whitened
from aqualog.types import FloatArray

__all__ = ["without_usual"]


def without_usual(bench: Bench, d: int, residual: FloatArray) -> FloatArray:
    """The residual (C, n) of drive `d` without its likeliest deviations from drive to drive.

    theta = (A A' + S^-2)^-1 A y with whitened signatures A, residual y, and the spread S of the vehicle file: no larger
    than the car's drives have been seen to differ. The residual itself where the file has no spread.
    """
    k = np.flatnonzero(bench.spread > 0.0).tolist()
    if not k:
        return residual
    drive = bench.drives[d]
    noise = fit_noise(residual, drive.mask, contrasts(drive.channels))
    A = whitened(bench.prepared[d].of(k), noise)
    y = whitened(spectra(bridged(residual, drive.mask)[None]), noise)[0]
    theta = np.linalg.solve(A @ A.T + np.diag(bench.spread[k] ** -2.0), A @ y)
    return np.asarray(residual - np.tensordot(theta, bench.signatures[d][k], axes=1))
