"""Records of a calibration: parameters with intervals, results of each drive, and what could not be identified."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from aqualog.core.records import FloatArray

__all__ = ["Calibration", "DriveFit", "Parameter", "PassFit", "TieRodFit"]


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter, SI.

    `ci95` is its interval, NaN without one. `identified`: whether the drives identify it (with what was fixed and the
    named assumptions). `why_not` says what they lack, empty where identified; `remark` what the interval rests on.
    `file_value` is that of the vehicle file, NaN where the file has no such key. `kept`: the user gave that value, the
    interval excludes it, and nobody has accepted the estimate: the file's value stays. `shared`: standard deviation by
    errors of the file's inertias and radii, which is in the interval.
    """

    name: str
    value: float
    ci95: tuple[float, float]
    unit: str
    identified: bool
    why_not: str = ""
    remark: str = ""
    file_value: float = float("nan")
    kept: bool = False
    shared: float = 0.0


@dataclass(frozen=True, slots=True)
class DriveFit:
    """Results of one drive by itself, with the drag area of all drives.

    `mass` by this drive alone [kg] with the standard deviation `mass_sd` within the drive. `against_others`: how much
    it is heavier than the other drives, with the 95 % interval for one more drive like them (NaN with fewer than three
    drives) [kg]. `offset` of the accelerometer [m/s²] with `offset_sd`, its `drift` [m/s³] (with it: warming tyres).
    `torque_lag_s`, `v_lag_s`: delay of torque and velocity against the accelerometer [s]. `used_s`, `driven_s` seconds;
    `left_out` seconds by reason. `rmse_before`, `rmse_after` of the balance [m/s²]. `v`, `force`, `before`, `after`
    (n,): windows used, speed [m/s], wheel force [N] and residuals [m/s²].
    """

    name: str
    mass: float
    mass_sd: float
    against_others: tuple[float, float, float]
    offset: float
    offset_sd: float
    drift: float
    torque_lag_s: float
    v_lag_s: float
    used_s: float
    driven_s: float
    left_out: Mapping[str, float]
    rmse_before: float
    rmse_after: float
    v: FloatArray
    force: FloatArray
    before: FloatArray
    after: FloatArray


@dataclass(frozen=True, slots=True)
class TieRodFit:
    """Transfer to tie rods or steering: coefficients and intervals by key; `sigma` rms of the residual [N, N·m].

    `explained` share of the variance; `seconds` used.
    """

    coefficients: Mapping[str, tuple[float, ...]]
    ci95: Mapping[str, tuple[tuple[float, float], ...]]
    sigma: float
    explained: float
    seconds: float


@dataclass(frozen=True, slots=True)
class PassFit:
    """A pass over water: `v` mean speed and that at which a wheel was lost, NaN if none [m/s]; `h_w` water [m]; windows
    of half a second; `why` it does not count, empty if it does."""

    name: str
    v: float
    v_lost: float
    h_w: float
    windows: int
    why: str = ""


@dataclass(frozen=True, slots=True)
class Calibration:
    """Result over all drives. `fixed` are the values given from outside; `cannot_tell` are sentences.

    `transfers` are polynomials by section of the vehicle file: `tie_rod`, `steering_torque`. `spread` is the standard
    deviation by which one more drive differs from a parameter, in its unit; empty with too few drives. `passes` are
    those over water, where the numbers of the law of water were fitted.
    """

    vehicle_name: str
    parameters: tuple[Parameter, ...]
    drives: tuple[DriveFit, ...]
    fixed: Mapping[str, float]
    cannot_tell: tuple[str, ...]
    notes: tuple[str, ...]
    transfers: Mapping[str, TieRodFit] = field(default_factory=dict)
    spread: Mapping[str, float] = field(default_factory=dict)
    passes: tuple[PassFit, ...] = ()

    def get(self, name: str) -> Parameter:
        """Return the parameter of this name; KeyError without one."""
        for p in self.parameters:
            if p.name == name:
                return p
        raise KeyError(name)
