"""Slip slopes of one drive by regression: the records."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from aqualog.core.records import FloatArray
from aqualog.detect.slip_slope.regression import Line
from aqualog.detect.slip_slope.stability import Segment, Stability
from aqualog.detect.slip_slope.ways import Method, TractionSource

__all__ = ["DirectResult", "PlaceSlope", "Recursion"]


@dataclass(frozen=True, slots=True)
class Recursion:
    """The recursive estimator at one place.

    `slope` with its standard deviation `slope_sd` at the end (NaN where it never worked); `alarms` of its change
    detection; `seconds` in which the slope was updated; `t`, `slopes` (n,) its course, NaN where it rests.
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

    `seconds` used; `mu_range` 5 and 95 % of the traction used [-]; `lag_s` delay of the slip against the traction (NaN
    where it cannot be determined); `left_out` seconds by reason; `t`, `mu`, `slip` (n,) the used samples, corrected by
    a delay of the reference velocity (`line.delay`).
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
    """Result of `slip_slopes` for one drive.

    The method `differential` gives no `places`, only `recursions`; else the recursions are those of the places.
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
