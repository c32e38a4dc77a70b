"""Slip slopes of one drive by regression: the records."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from aqualog.detect.slip_slope.regression import Line
from aqualog.detect.slip_slope.stability import Segment, Stability
from aqualog.detect.slip_slope.ways import Method, TractionSource
from aqualog.types import FloatArray

__all__ = ["DirectResult", "PlaceSlope", "Recursion"]


@dataclass(frozen=True, slots=True)
class Recursion:
    """The recursive estimator at one place.

    `slope` with its standard deviation `slope_sd` at the end (NaN where it never worked), `alarms` of its change
    detection, `seconds` in which it learnt the slope; `t`, `slopes` (n,) its course, NaN where it rests.
    """

    place: str
    wheel: str | None
    slope: float
    slope_sd: float
    alarms: int
    seconds: float
    t: FloatArray
    slopes: FloatArray


@dataclass(frozen=True, slots=True)
class PlaceSlope:
    """Slip slope at one place: a driven wheel, or the driven axle.

    `seconds` used; `mu_range` 5 and 95 % of the traction used [-]; `lag_s` by how much the slip is late against the
    traction (NaN where the data do not tell); `left_out` seconds by reason; `t`, `mu`, `slip` (n,) the used samples, a
    delay of the reference velocity (`line.delay`) taken out.
    """

    place: str
    wheel: str | None
    line: Line
    seconds: float
    mu_range: tuple[float, float]
    lag_s: float
    segments: tuple[Segment, ...]
    stability: Stability
    recursion: Recursion
    left_out: Mapping[str, float]
    t: FloatArray
    mu: FloatArray
    slip: FloatArray


@dataclass(frozen=True, slots=True)
class DirectResult:
    """What `slip_slopes` found in one drive.

    With the method `differential` there are no `places`, only `recursions`; else those of the places are meant.
    """

    vehicle_name: str
    method: Method
    traction: TractionSource
    mu_max: float
    duration_s: float
    rate_hz: float
    places: tuple[PlaceSlope, ...]
    recursions: tuple[Recursion, ...]
    notes: tuple[str, ...]
