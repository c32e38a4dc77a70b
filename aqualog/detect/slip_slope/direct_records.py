"""Slip slopes of one drive by regression: the records, remarks on them, and the refusal without any slope."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from aqualog.core.errors import FitError
from aqualog.core.records import FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.detect.slip_slope.direct_inputs import Method, TractionSource, Way
from aqualog.detect.slip_slope.regression import Line
from aqualog.detect.slip_slope.stability import Segment, Stability

__all__ = ["DirectResult", "PlaceSlope", "Recursion", "notes_on", "refuse"]

LAG_NOTED = 0.1  # [s] twice what the lag is good to
DELAY_NOTED = 0.01  # [s]
SHARED_NOTED = 0.8  # share of the traction that goes with a / v, from which the delay widens the interval 2.2 times
OFFSET_NOTED = 0.03  # [-] tyres of one size and different wear differ by less


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


def refuse(places: Sequence[PlaceSlope], recursions: Sequence[Recursion], where: str, duration: float) -> None:
    """Stop with one line if no slope can be estimated."""
    if any(p.line.told for p in places):
        return
    if not places:
        if any(math.isfinite(r.slope) for r in recursions):
            return
        if any(r.seconds > 0.0 for r in recursions):
            raise FitError(
                "the recursive estimate ends at a slope that no tyre has (1 or 300)", where=where,
                hint="check radii, drivetrain, wheel mapping, and the sign and unit of the torque",
            )  # fmt: skip
        raise FitError(
            "both axles slip alike or the traction is too even: the recursive estimator could not work", where=where,
            hint="a drive with changing speed and another torque split, or a log with v_x",
        )  # fmt: skip
    best = max(places, key=lambda p: p.seconds)
    most = sorted(best.left_out.items(), key=lambda item: -item[1])[:3]
    out = ", ".join(f"{name} {seconds:.0f} s" for name, seconds in most if seconds >= 0.5)
    low, high = best.mu_range
    text = f"{best.seconds:.1f} s of {duration:.0f} s can be used" + (f" (left out: {out})" if out else "")
    if math.isfinite(low) and not best.line.reason.startswith("too few"):
        text += f", traction {low:.3f} to {high:.3f} there"
    raise FitError(f"cannot estimate the slip slope: {best.line.reason}; {text}", where=where, hint=best.line.hint)


def notes_on(places: Sequence[PlaceSlope], vehicle: Vehicle, way: Way, *, has_brake: bool) -> list[str]:
    """Return sentences on what the slopes rest on, and what does not fit."""
    notes = []
    if way.traction == "accelerometer" and not has_brake:
        notes.append("no brake_pressure: braking and engine drag look alike, so only driving (mu > 0) is used")
    keys = ("mass", "l_f", "l_r") if way.traction == "torque" else ("l_f", "l_r")
    lacking = [k for k in keys if k not in vehicle.given]
    if lacking:
        notes.append(f"{', '.join(lacking)} not in the vehicle file: wheel loads, and the slope with them, are a guess")
    if way.method == "differential":
        notes.append("differential slip only: recursive estimate, no regression and no interval from the data")
    for applies, said, sentence in _ON_PLACES:
        found = [p for p in places if applies(p)]
        if found:
            notes.append(sentence.format(", ".join(said(p) for p in found)))
    return notes


def _has_delay(p: PlaceSlope) -> bool:
    low, high = p.line.delay_ci
    return p.line.told and abs(p.line.delay) > DELAY_NOTED and (low > 0.0 or high < 0.0)


# of which places, what is said of each, and the sentence
_ON_PLACES: tuple[tuple[Callable[[PlaceSlope], bool], Callable[[PlaceSlope], str], str], ...] = (
    (lambda p: p.line.is_corrected, lambda p: f"{p.place} {100 * p.line.attenuation:.1f} %",
     "noise of the traction lowers 1 / slope, which is corrected: {}"),
    (lambda p: abs(p.lag_s) > LAG_NOTED, lambda p: f"{p.place} {p.lag_s:+.2f} s",
     "the slip follows the traction best with a delay of {}: check the clocks of wheels and "
     "traction (`aqualog align`, [sources] offset_s in the map)"),
    (lambda p: p.line.told and abs(p.line.offset) > OFFSET_NOTED, lambda p: f"{p.place} {100 * p.line.offset:+.1f} %",
     "slip without traction: {}; the radii in the vehicle file do not fit"),
    (_has_delay, lambda p: f"{p.place} {p.line.delay:+.3f} s",
     "v_x is late against the wheels, which is corrected: {}"),
    (lambda p: p.line.told and p.line.shared > SHARED_NOTED, lambda p: p.place,
     "{}: traction and acceleration over speed go together, so the delay of v_x widens the "
     "interval of the slope; narrower with other speeds or grades, or --delay where it is known"),
    (lambda p: p.recursion.alarms > 0, lambda p: f"{p.place} {p.recursion.alarms}",
     "the recursive estimator found sudden changes of the slope: {}"),
)  # fmt: skip
