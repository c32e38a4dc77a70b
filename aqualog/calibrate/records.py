"""What a calibration says: parameters with intervals, what each drive showed, and what could not be told."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from aqualog.types import FloatArray

__all__ = ["Calibration", "DriveFit", "Parameter", "TieRodFit"]


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter, SI.

    `ci95` is its interval, NaN where there is none; `identified` whether the drives tell it (with what was fixed and
    the named assumptions); `why_not` says what they lack, empty where identified; `remark` what the interval rests on.
    `file_value` is the vehicle file's, NaN where the file has no such key.
    """

    name: str
    value: float
    ci95: tuple[float, float]
    unit: str
    identified: bool
    why_not: str = ""
    remark: str = ""
    file_value: float = float("nan")


@dataclass(frozen=True, slots=True)
class DriveFit:
    """What one drive showed by itself, the drag area taken from all.

    `mass` by this drive alone [kg] with the standard deviation `mass_sd` within the drive; `against_others` by how much
    it is heavier than the other drives, with the 95 % interval for one more drive like them (NaN with less than
    three drives) [kg]; `offset` of the accelerometer [m/s^2] with `offset_sd`, its `drift` [m/s^3] (with it: warming
    tyres); `torque_lag_s`, `v_lag_s` by how much torque and velocity are late against the accelerometer [s]; `used_s`,
    `driven_s` seconds; `left_out` seconds by reason; `rmse_before`, `rmse_after` of the balance [m/s^2]; `v`, `force`,
    `before`, `after` (n,): windows used, speed [m/s], wheel force [N] and residuals [m/s^2].
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
    """Transfer to tie rods or steering: coefficients and intervals by key; `sigma` rms of what it leaves [N, N m].

    `explained` share of the variance; `seconds` used.
    """

    coefficients: Mapping[str, tuple[float, ...]]
    ci95: Mapping[str, tuple[tuple[float, float], ...]]
    sigma: float
    explained: float
    seconds: float


@dataclass(frozen=True, slots=True)
class Calibration:
    """Result over all drives. `fixed` are the values given from outside; `cannot_tell` are sentences.

    `transfers` are polynomials by section of the vehicle file: `tie_rod`, `steering_torque`. `spread` is the standard
    deviation by which one more drive differs from a parameter, in its unit; empty where too few drives show it.
    """

    vehicle_name: str
    parameters: tuple[Parameter, ...]
    drives: tuple[DriveFit, ...]
    fixed: Mapping[str, float]
    cannot_tell: tuple[str, ...]
    notes: tuple[str, ...]
    transfers: Mapping[str, TieRodFit] = field(default_factory=dict)
    spread: Mapping[str, float] = field(default_factory=dict)

    def get(self, name: str) -> Parameter:
        """Parameter by name; KeyError if there is none."""
        for p in self.parameters:
            if p.name == name:
                return p
        raise KeyError(name)
