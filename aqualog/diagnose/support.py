"""Effects that act everywhere must also show off the water.

On water, errors of the water laws shape the residual. A wheel with little contact amplifies any slip, and two dry
effects that cancel on dry road could replace a wrong water law. Neither is possible off the water.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aqualog.core.records import BoolArray
from aqualog.diagnose.bench import Bench, gram_of, tolerant
from aqualog.diagnose.channels import block_step, contrasts
from aqualog.diagnose.drive import Drive
from aqualog.diagnose.noise import fit_noise
from aqualog.diagnose.subsets import gains_on_top

__all__ = ["supported"]

SHOWN = 4.0  # of twice the log-likelihood off the water: two standard deviations
BESIDE_S = 1.0  # [s] after a stretch, in which the rear axle and the speed still have it
LEAST = 300  # samples off the water that the check needs at the least


def supported(bench: Bench) -> Bench:
    """The bench without effects that have no gain off the water; the same bench on dry drives.

    Effects of water are exempt, and so are drives that are wet nearly all the time.
    """
    if not any(d.course.lanes for d in bench.drives):
        return bench
    dry = [_off_water(d) for d in bench.drives]
    if sum(int(m.sum()) for m in dry) < LEAST or any(m.sum() < LEAST // 4 for m in dry):
        return bench
    noises = [
        fit_noise(r, m, contrasts(d.channels)) for r, m, d in zip(bench.residuals, dry, bench.drives, strict=True)
    ]
    gains = gains_on_top(bench, tolerant(bench, gram_of(bench, noises, bench.residuals)), ())
    of_water = np.array([h.of_water for h in bench.asked])
    sizes = np.array([len(c) for c in bench.columns])
    return replace(bench, barred=(gains < SHOWN * sizes) & ~of_water)


def _off_water(drive: Drive) -> BoolArray:
    """Usable samples without water, nor shortly after it. (m,)"""
    wet = drive.coordinates.get("water_depth", np.zeros(drive.mask.size))[: drive.mask.size] > 0.0
    k = round(BESIDE_S / block_step(drive.dt))
    late = np.convolve(wet.astype(np.float64), np.ones(k + 1), "full")[: wet.size] > 0.5
    return drive.mask & ~late
