"""Stretches of water on a drive, by blocks of its residual."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from aqualog.diagnose.channels import block_step
from aqualog.diagnose.drive import Drive

__all__ = ["stretches"]

BESIDE_S = 1.0  # [s] after a stretch, in which the rear axle and the speed still have it


def stretches(drive: Drive) -> npt.NDArray[np.int64]:
    """Number of the stretch of water under the car or just behind it, from 1 on; 0 on dry road. (m,)"""
    wet = drive.coordinates.get("water_depth", np.zeros(drive.mask.size))[: drive.mask.size] > 0.0
    k = round(BESIDE_S / block_step(drive.dt))
    late = np.convolve(wet.astype(np.float64), np.ones(k + 1), "full")[: wet.size] > 0.5
    begins = np.diff(late.astype(np.int64), prepend=0) > 0
    return np.where(late, np.cumsum(begins), 0)
