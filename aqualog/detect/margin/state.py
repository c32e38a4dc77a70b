"""Features, tuning, inputs, learnt tables and state of the filter of the distance to full aquaplaning."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aqualog.core.records import FloatArray

__all__ = [
    "COLUMNS", "COVARIATES", "FEATURES", "FULL_SPEEDS", "LOG_STEP", "NODES", "OUTPUTS", "REAR", "ROWS", "TAIL",
    "Emissions", "Filter", "FilterParams", "Inputs",
]  # fmt: skip

LOG_STEP = 0.05
FULL_SPEEDS: FloatArray = 40.0 / 3.6 * np.exp(LOG_STEP * np.arange(34, dtype=np.float64))
"""Cells of the speed of full aquaplaning, 40 to 208 km/h. [m/s]"""
NODES: FloatArray = LOG_STEP * np.arange(-5.0, 17.0)
"""Log of the speed of full aquaplaning over the car's, for which the emissions are known. [-]"""
FEATURES = ("drag", "slip_more", "slip_less", "shake_more", "shake_less")
"""Of 0.6 s, less what the same car showed on dry road: resistance, slip of the front axle less that of the rear on the
side that deviates more and on the other one, log variance of both. [-]"""
REAR = ("rear", "rear_shake")
"""The same of the rear axle alone: slip of the side that deviates more less that of the other one, log variance. [-]"""
TAIL = 6.0  # degrees of freedom of Student's law: how rare what was not drawn is
COVARIATES = 3  # 1, log of the speed, traction

OUTPUTS = ("p_water", "p_near", "low", "q25", "median", "q75", "high", "contact", "shows", "v_full")
"""Rows of what a scan returns: probabilities [-], quantiles of the distance [m/s], contact share [-], whether
drag, shake or the slip of both sides is more than that of the dry road (1 or 0), speed [m/s]."""
ROWS = 6  # steps of the window
COLUMNS = 20  # means of a step: inputs, variances of slips and specific force, the slips of dry wheels by the traction


class FilterParams(NamedTuple):
    """Tuning in physical units."""

    block: int  # samples of one step
    dt: float  # [s] of a step
    near: float  # [m/s] distance of the warning
    slope_f: float  # [-] dry slip slope over load
    slope_r: float
    rolling: float
    friction: float
    grade: float = 0.0  # [-] of a slip: what an unknown grade makes of it, where no torque says how hard wheels pull
    v_least: float = 11.0  # [m/s] slower, water does nothing that counts
    scale_R: float = 0.1  # [m/s^2] below it a feature is linear, above it logarithmic
    scale_D: float = 5.0e-4  # [-] the same of a slip
    noise_R: float = 0.15  # [m/s^2] of a step; steps in a row err alike
    noise_D: float = 4.0e-4  # [-] of a step, beside what its samples scatter
    noise_M: float = 1.0  # [-] of a log variance
    offset_R: float = 0.15  # [m/s^2] before anything is known
    share_a: float = 0.3  # [-] of what the torques make: an unknown trailer or load
    area: float = 0.2  # [m/s^2] at `pace`: drag area of an unknown trailer or roof box, wind (K)
    pace: float = 30.0  # [m/s]
    offset_D: float = 5.0e-2  # [-] worn beside new tyres, a spare wheel
    share_D: float = 0.25  # [-] of the slips of both axles: the file's slopes are not the tyres'
    shake: float = -14.0  # [-] log variance of a slip
    shock: float = -6.0  # [-] log variance of the specific force
    offset_M: float = 2.0  # [-]
    walk_R: float = 0.01  # [m/s^2 / sqrt(s)]
    walk_a: float = 0.003  # [1 / sqrt(s)]
    walk_D: float = 5.0e-5  # [1 / sqrt(s)]
    walk_share: float = 0.002  # [1 / sqrt(s)]
    walk_M: float = 0.03  # [1 / sqrt(s)]
    to_water: float = 1.0 / 225.0  # [1/s] 1/300 under both sides, a quarter of the whole under one alone (K)
    to_other: float = 1.0 / 10000.0  # [1/s] to snow, ice, gravel: in doubt a warning does less harm than none
    to_side: float = 1.0 / 900.0  # the same under one side alone: as often as water there (K)
    to_dry: float = 1.0 / 10.0
    mistaken: float = 1.0 / 100.0  # of water to another surface and back
    sides: float = 1.0 / 20.0  # of snow under both sides to snow under one, and back (K)
    among: float = 1.0 / 5.0  # of one kind of dry or wet road to another
    start: tuple[float, float, float, float] = (0.955, 0.02, 0.02, 0.005)  # of roads; with 0.15 wet trailers were rain
    drags: float = 0.05  # [m/s^2] that water near full aquaplaning takes at least
    shakes: float = 2.0  # [-] log variance that it adds where it takes less
    both: float = 1.0  # [-] slip of the side that deviates less, where it does neither
    brave: float = 20.0 / 3.6  # [m/s] who drives into water is rarely so far beyond full aquaplaning
    doubt: float = 0.5  # [-] of the slips of both axles, where no resistance counts: by which they may be off there
    probable: float = 0.5  # [-] probability of water from which slips count that are known roughly
    heard: float = 2e-3  # [-] probability of water from which its distances are compared
    weight: float = 0.12  # [-] of the evidence of a step: windows overlap, and tyre and road stay
    law_R: float = 0.5  # [-] by which the laws of resistance may differ beyond what was drawn
    law_M: float = 1.4  # [-] the same of the log variances
    calm: float = 0.3  # [-] of water so even, or of wheels that a control holds so still, that none shakes (K)
    calm_road: float = 0.05  # [-] the same among wet roads: water far from full aquaplaning shakes none anyway
    vague: float = 9.0  # variance of a slip that says nothing: thrice the scale
    keep_s: float = 0.8  # [s] memory of the evidence on the full speed
    most_u: float = 2.8  # [-] asinh of the traction over 0.02: beyond, no drive on snow was learnt from


class Inputs(NamedTuple):
    """Arrays (n,): speed [m/s]; acceleration that the torques make on a level dry road and resistance [m/s²]; of sides
    slip front less rear; of the rear axle left less right; traction [-]; specific force along the car [m/s²]; 1 where
    the torque jumps or a wheel transmits so much that the dry road's slip is known roughly, else 0.

    NaN where a value is unknown or not to be trusted.
    """

    v: FloatArray
    a: FloatArray
    R: FloatArray
    D_l: FloatArray
    D_r: FloatArray
    D_rear: FloatArray
    u_fl: FloatArray
    u_fr: FloatArray
    u_rl: FloatArray
    u_rr: FloatArray
    a_x: FloatArray
    rough: FloatArray


class Emissions(NamedTuple):
    """Mean by covariates (laws, nodes, features, covariates) and covariance (laws, nodes, features, features) at each
    distance, by laws of lost contact with shares `law` (laws,): each of front wheels that slip ahead, then of others.

    `contact` (laws, nodes) [-] of the front axle; `ways` (laws, nodes) log share of those wheels; `prior` (full
    speeds,). `kind_` the same of kinds of road: `road` 0 dry, 1 wet, 2 snow, ice or gravel, 3 these under
    one side alone; shares of each sum to 1. `rear` (last kinds, rear features, covariates and features) is the mean of
    what the rear axle shows, `rear_scatter` its covariance: of those under one side alone, which are the last.
    """

    mean: FloatArray
    scatter: FloatArray
    contact: FloatArray
    ways: FloatArray
    law: FloatArray
    prior: FloatArray
    kind_mean: FloatArray
    kind_scatter: FloatArray
    kind_prior: FloatArray
    road: FloatArray
    rear: FloatArray
    rear_scatter: FloatArray

    def in_columns(self) -> Emissions:
        """Return the same with laws and nodes as one last index, and kinds as the last one."""
        tables = {n: getattr(self, n) for n in ("mean", "scatter", "kind_mean", "kind_scatter")}
        flat = {n: np.moveaxis(x.reshape(-1, *x.shape[-2:]), 0, -1) for n, x in tables.items()}
        return self._replace(**{n: np.ascontiguousarray(x) for n, x in flat.items()})


class Filter(NamedTuple):
    """State: evidence on the full speeds, what a dry road shows, and the steps of the window.

    `R` (4, 3): offset of the resistance [m/s²], its share of what the torques make (an unknown load or trailer), what
    the air adds at `pace` [m/s²], and their covariance.
    `sides` (3, 7), the third of the rear axle: offset of the slip, share of the axles' slips that it is off by,
    covariance, log variance and its variance.
    """

    evidence: FloatArray  # (laws, full speeds) log
    kinds: FloatArray  # (kinds,) probabilities of kinds of road
    R: FloatArray
    sides: FloatArray
    body: FloatArray  # (3,) log variance of the specific force within a step, its variance, and the window's beyond it
    window: FloatArray  # (ROWS, COLUMNS)
    sums: FloatArray  # (3, inputs) sums, counts and sums of squares of the running step
    samples: FloatArray  # (3,) of the running step; steps so far; variance of their resistance [(m/s²)²]
    x: FloatArray  # (2, features and rear ones) of the last window, and variances of what they are compared with
    out: FloatArray  # (len(OUTPUTS),)

    @staticmethod
    def new(p: FilterParams, t: Emissions) -> Filter:
        """Return the state before the first sample."""
        side = np.array([0.0, 0.0, p.offset_D**2, 0.0, p.share_D**2, p.shake, p.offset_M**2])
        return Filter(
            evidence=np.zeros((t.law.size, FULL_SPEEDS.size)),
            kinds=t.kind_prior * np.array(p.start)[t.road.astype(int)],
            R=np.vstack([np.zeros(3), np.diag([p.offset_R**2, p.share_a**2, p.area**2])]),
            sides=np.stack([side, side, side]),
            body=np.array([p.shock, p.offset_M**2, 0.0]),
            window=np.full((ROWS, COLUMNS), np.nan),
            sums=np.zeros((3, len(Inputs._fields))),
            samples=np.zeros(3),
            x=np.full((2, len(FEATURES) + len(REAR)), np.nan),
            out=np.full(len(OUTPUTS), np.nan),
        )

    def copy(self) -> Filter:
        """Return a state of its own."""
        return Filter(*(x.copy() for x in self))
