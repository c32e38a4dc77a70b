"""Tuning, inputs and state of the filter of the distance to full aquaplaning."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.detect.margin.laws import DEPTHS, FULL_SPEEDS, Tables

__all__ = ["OUTPUTS", "Filter", "FilterParams", "Inputs"]

OUTPUTS = ("p_water", "p_near", "low", "q25", "median", "q75", "high", "contact", "v_full")
"""Rows of what a scan returns: probabilities [-], quantiles of the distance [m/s], contact share [-], speed [m/s]."""


class FilterParams(NamedTuple):
    """Tuning in physical units; noise as learnt on dry drives of the simulator."""

    block: int  # samples of one step
    dt: float  # [s] of a step
    near: float  # [m/s] distance of the warning
    slope_f: float  # [-] dry slip slope over load
    slope_r: float
    rolling: float
    friction: float
    noise_R: float = 0.06  # [m/s^2] of a step
    noise_D: float = 3.0e-4  # [-] of a step
    scale_D: float = 5.0e-4  # [-] slips below it are read on a linear scale, above it on a logarithmic one
    share_D: float = 0.15  # of the slip of the drive: the file's slope is not the tyre's
    shake: float = 0.25  # [-] log of a wet slip from step to step
    share_axle: float = 0.08  # the same of what both axles share
    walk_share: float = 0.002  # [1 / sqrt(s)]
    share_F: float = 0.25  # [-] log of a wet slip, beside the tyres' spread
    most: float = 2.5  # of standard deviations by which a tyre differs from the mean of all
    floats: float = 0.8  # [-] the same from step to step
    stopped: float = 1.0  # [-] log of the slip of a wheel that no longer holds
    brave: float = 8.0 / 3.6  # [m/s] who drives into water is rarely so far beyond full aquaplaning
    offset_R: float = 0.12  # [m/s^2] before anything is known
    offset_D: float = 5.0e-2  # [-] worn beside new tyres, a spare wheel
    walk_R: float = 0.006  # [m/s^2 / sqrt(s)]
    walk_D: float = 3.0e-5  # [1 / sqrt(s)]
    bias_s: float = 8.0  # [s] correlation of what the laws do not know
    to_water: float = 1.0 / 300.0  # [1/s]
    to_dry: float = 1.0 / 4.0
    to_other: float = 1.0 / 60.0
    from_other: float = 1.0 / 3.0
    other_wets: float = 0.2  # share of what else ends in water
    other_s: float = 60.0  # [s] correlation of what else disturbs
    share_a: float = 0.3  # [-] of the specific force: an unknown trailer or load
    walk_a: float = 0.003  # [1 / sqrt(s)]
    anew_R: float = 0.05  # [m/s^2 / sqrt(s)] another wind, a trailer
    slip_s: float = 5.0  # [s] correlation of what a dry slip has beyond offset and slope
    noisy: float = 1.5  # [-] noise of a step's mean over its samples' own scatter
    anew_D: float = 1.0e-3  # [1 / sqrt(s)] another wheel, a tyre that loses air
    drift_V: float = 0.8  # [m/s / sqrt(s)] of the full speed along the road
    other_R: float = 0.3  # [m/s^2] of what else disturbs
    other_y: float = 2.0
    slip_most: float = 0.02  # [-] no dry road takes so much of a wheel's speed without a brake
    anew_most: float = 5.0e-3  # [-] to which the offset's deviation grows again
    sure: float = 0.65  # [-] share of the water's resistance that a tyre may lack, for a warning
    noise_s: float = 5.0  # [s] memory of the noise of the dry slip
    clip: float = 12.0  # of a squared deviation: no single step decides
    start_water: float = 0.01  # probability of water at the start


class Inputs(NamedTuple):
    """Arrays (n,): speed [m/s]; specific force and resistance [m/s²]; of sides slip front less rear; traction. [-]

    NaN where a value is unknown or not to be trusted.
    """

    v: FloatArray
    a: FloatArray
    R: FloatArray
    D_l: FloatArray
    D_r: FloatArray
    u_fl: FloatArray
    u_fr: FloatArray
    u_rl: FloatArray
    u_rr: FloatArray


class Filter(NamedTuple):
    """State: by cell weight and offsets with variances; the same of what else disturbs; the dry road's own.

    `dry`: weight; offset of the resistance, its share of the specific force (an unknown load or trailer), and their
    covariance; deviation of the slip and its variance. `sides` (2, 7): offset of the slip, share by which its slope is
    off, their covariance, last deviation, variance from step to step. `others` (3, 5): weight, then offsets with
    variances of resistance and slip.
    """

    w: FloatArray  # (full speeds, waters)
    b_R: FloatArray
    P_R: FloatArray
    b_y: FloatArray
    P_y: FloatArray
    dry: FloatArray
    sides: FloatArray
    others: FloatArray
    sums: FloatArray  # (3, 9) sums, counts and sums of squares of the running step
    samples: FloatArray  # (1,) of the running step
    out: FloatArray  # (len(OUTPUTS),)

    @staticmethod
    def new(p: FilterParams, tables: Tables) -> Filter:
        """Return the state before the first sample."""
        shape = (FULL_SPEEDS.size, DEPTHS.size)
        side = np.array([0.0, 0.0, p.offset_D**2, 0.0, p.share_D**2, np.nan, 0.0])
        dry = np.array([1.0 - p.start_water, 0.0, 0.0, p.offset_R**2, 0.0, p.share_a**2, 0.0, 0.0])
        return Filter(
            w=p.start_water * tables.prior.copy(),
            b_R=np.zeros(shape),
            P_R=np.full(shape, p.offset_R**2),
            b_y=np.zeros(shape),
            P_y=np.ones(shape),
            dry=dry,
            sides=np.stack([side, side]),
            others=np.zeros((3, 5)),
            sums=np.zeros((3, 9)),
            samples=np.zeros(1),
            out=np.full(len(OUTPUTS), np.nan),
        )

    def copy(self) -> Filter:
        """Return a state of its own."""
        return Filter(*(x.copy() for x in self))
