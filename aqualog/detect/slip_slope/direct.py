"""Slip slope of the driven wheels of one drive by regression: samples chosen, lines fitted, parts compared."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from aqualog.detect.negative_force import HOLD as BRAKE_HOLD
from aqualog.detect.negative_force import hold_on, is_braking
from aqualog.detect.slip_slope import activation, estimator
from aqualog.detect.slip_slope.activation import Limits
from aqualog.detect.slip_slope.estimator import BLIND, Estimate
from aqualog.detect.slip_slope.regression import Line, fit_line, noise_of_traction
from aqualog.detect.slip_slope.stability import Segment, Stability, block_labels, judge_stability, make_segments
from aqualog.detect.slip_slope.tuning import TUNING, Params
from aqualog.detect.slip_slope.watch import SlipSlopeWatch, pairs
from aqualog.detect.slip_slope.ways import Method, TractionSource, Way, choose_way
from aqualog.errors import FitError, SignalError
from aqualog.features.stream import FeatureStream
from aqualog.notation import AXLES, WHEELS
from aqualog.physics.differential import differential_slip
from aqualog.physics.load import G, wheel_loads
from aqualog.physics.slip import wheel_slip
from aqualog.physics.traction import traction_of_one_axle
from aqualog.types import BoolArray, FloatArray, Signals
from aqualog.vehicle import Vehicle

__all__ = ["LEFT_OUT", "LIMITS", "MU_MAX", "DirectResult", "PlaceSlope", "Recursion", "slip_slopes"]

MU_MAX = 0.3  # [-] beyond, the tyre's curve bends: a brush with 1.0 of friction has lost 11 % of its slope there
LIMITS = Limits(a_x_max=6.0, a_y_max=1.0, yaw_rate_max=0.05)  # straighter than the estimator, which has less to lose
SMOOTHING = 0.3  # [s] slip and traction alike: sensors' noise and a tenth of a second between their clocks count less
S_MAX = 0.05  # [-] slip about its median beyond which a wheel spins
LAG_MAX = 0.5  # [s]
LAG_NOTED = 0.05  # [s]
MIN_RATE = 5.0  # [Hz]

_TOO_LARGE, _NEGATIVE, _BESIDE = "traction beyond the limit", "brakes not known", "beside a stretch left out"
LEFT_OUT = (*activation.REASONS[1:], _TOO_LARGE, _NEGATIVE, _BESIDE)
"""Why a sample was not used, in this order."""

_HINTS = {
    "fewer": "a longer drive with straight stretches, or a larger --mu-max",
    "even": "a drive that accelerates and coasts on a straight road",
}


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
    traction (NaN where the data do not tell); `left_out` seconds by reason; `t`, `mu`, `slip` (n,) the used samples.
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


class _Place(NamedTuple):
    name: str
    i: tuple[str, ...]  # driven
    j: tuple[str, ...]  # free, () against a velocity


def slip_slopes(
    signals: Signals, vehicle: Vehicle, *, method: str = "auto", traction: str = "auto", mu_max: float = MU_MAX
) -> DirectResult:
    """Slip slope C_s / F_z of every driven wheel.

    Parameters
    ----------
    signals : Signals
    vehicle : Vehicle
        Drivetrain, radii, mass and its distribution.
    method, traction : str
        As in `ways.choose_way`.
    mu_max : float
        Largest traction coefficient used. [-]

    Raises
    ------
    ConfigError, SignalError
        As `ways.choose_way`.
    FitError
        If no wheel's slope can be told, with the reason.

    Thesis: the direct approach of section 2.3 and reference [15] with Eq. (3.14); all-wheel drive without a reference
    velocity: section 3.2, the recursive estimate alone.
    """
    where = ", ".join(signals.files)
    present = [s for s in signals.symbols if signals.frame[s].null_count() < signals.frame.height]
    way = choose_way(vehicle, present, method=method, traction=traction, where=where)
    rate = 1e9 / signals.dt_ns
    if rate < MIN_RATE:
        raise SignalError(
            f"wheel speeds at {rate:.3g} Hz", where=where, expected=f"{MIN_RATE:g} Hz or more",
            hint="the log before it was thinned; check the unit of its time",
        )  # fmt: skip
    columns = {s: signals.array(s) for s in present}
    f = dict(FeatureStream(vehicle, signals.dt, present).push(columns))
    if way.traction == "accelerometer":
        f |= _accelerometer_traction(f, columns["a_x"], vehicle)
    braking = _braking(f, columns, vehicle, signals.dt)
    width = max(1, 2 * round(0.5 * (SMOOTHING / signals.dt - 1.0)) + 1)
    smooth = {n: _smoothed(x, width) if n.startswith(("v_line_", "mu_")) else x for n, x in f.items()}
    v_x = _smoothed(columns["v_x"], width) if way.method == "velocity" else None
    places = tuple(
        _estimate(
            place, smooth, v_x, braking, vehicle, dt=signals.dt, width=width, mu_max=mu_max,
            positive_only=way.traction == "accelerometer" and "brake_pressure" not in present,
        )
        for place in _places(vehicle, way.method)
    )  # fmt: skip
    recursions: tuple[Recursion, ...] = ()
    if way.method == "differential":
        recursions = tuple(
            _watched(SlipSlopeWatch(vehicle, pair, signals.dt), smooth, braking, signals.dt) for pair in pairs(vehicle)
        )
    _refuse(places, recursions, where, signals.frame.height * signals.dt)
    return DirectResult(
        vehicle.name, way.method, way.traction, mu_max, signals.frame.height * signals.dt, rate, places, recursions,
        (*way.notes, *_notes(places, vehicle, way, has_brake="brake_pressure" in present)),
    )  # fmt: skip


def _places(vehicle: Vehicle, method: Method) -> list[_Place]:
    if method == "differential":
        return []
    if method == "velocity":
        return [_Place(w, (w,), ()) for w in vehicle.driven]
    axle = vehicle.driven[0][0]
    free = [w for w in WHEELS if w not in vehicle.driven]
    wheels = [_Place(i, (i,), (j,)) for i, j in zip(vehicle.driven, free, strict=True)]
    name = {"f": "front axle", "r": "rear axle"}[axle]
    return [*wheels, _Place(name, AXLES[axle], tuple(free))]


# --- samples -------------------------------------------------------------------------------------------------------


def _accelerometer_traction(f: Mapping[str, FloatArray], a_x: FloatArray, vehicle: Vehicle) -> dict[str, FloatArray]:
    loads = wheel_loads(
        a_x, f["a_y_slow"], mass=vehicle.mass, l_f=vehicle.l_f, l_r=vehicle.l_r, h_cg=vehicle.h_cg, track=vehicle.track
    )
    driven = [i for i, w in enumerate(WHEELS) if w in vehicle.driven]
    free = [i for i, w in enumerate(WHEELS) if w not in vehicle.driven]
    one = WHEELS[free[0]]
    mu = traction_of_one_axle(
        a_x, f["a_kin_slow"], f["v_x_hat"], loads[driven], loads[free], mass=vehicle.mass,
        r_w=vehicle.rolling_resistance, drag_area=vehicle.drag_area, air_density=vehicle.air_density,
        free_wheel_mass=2.0 * vehicle.inertia(one) / vehicle.r_e(one) ** 2,
    )  # fmt: skip
    return {f"mu_{WHEELS[i]}": mu[row] for row, i in enumerate(driven)}


def _braking(
    f: Mapping[str, FloatArray], columns: Mapping[str, FloatArray], vehicle: Vehicle, dt: float
) -> dict[str, BoolArray]:
    weight = 0.25 * vehicle.mass * G
    found = {}
    for w in WHEELS:
        torque = columns[f"torque_{w}"] / (vehicle.r_l(w) * weight) if f"torque_{w}" in columns else None
        bits = is_braking(f["a_kin_slow"], f.get("brake_pressure"), torque)
        found[w], _ = hold_on(bits, 0, seconds=BRAKE_HOLD, dt=dt)
    return found


def _smoothed(x: FloatArray, width: int) -> FloatArray:
    """Centred mean; NaN where one of its samples is. No delay: slip and traction stay together."""
    if x.size < width:
        return np.full_like(x, np.nan)
    half = width // 2
    mean = np.lib.stride_tricks.sliding_window_view(x, width).mean(axis=1)
    return np.concatenate([np.full(half, np.nan), mean, np.full(half, np.nan)])


def _mean(f: Mapping[str, FloatArray], stem: str, wheels: Sequence[str]) -> FloatArray:
    mean: FloatArray = np.mean([f[f"{stem}_{w}"] for w in wheels], axis=0)
    return mean


def _slip(place: _Place, f: Mapping[str, FloatArray], v_x: FloatArray | None, vehicle: Vehicle) -> FloatArray:
    v_i = _mean(f, "v_line", place.i)
    if v_x is None:
        return differential_slip(v_i, _mean(f, "v_line", place.j))
    r_e = vehicle.r_e(place.i[0])
    return wheel_slip(v_i / r_e, v_x, r_e)


def _left_out(
    place: _Place,
    f: Mapping[str, FloatArray],
    mu: FloatArray,
    slip: FloatArray,
    braking: Mapping[str, BoolArray],
    *,
    width: int,
    mu_max: float,
    positive_only: bool,
) -> FloatArray:
    """0 where a sample is used, else 1 + index into `LEFT_OUT`."""
    wheels = (*place.i, *place.j)
    reason = activation.inactive_reason(
        v_x=f["v_x_hat"], a_x=f["a_kin_slow"], a_y=f["a_y_slow"], yaw_rate=f["yaw_rate_slow"],
        a_w_delta=np.max([np.abs(f[f"a_w_delta_{w}"]) for w in wheels], axis=0),
        is_braking=np.any([braking[w] for w in wheels], axis=0), limits=LIMITS,
    )  # fmt: skip
    with np.errstate(invalid="ignore"):
        reason[(reason == 0) & (np.abs(mu) > mu_max)] = 1 + LEFT_OUT.index(_TOO_LARGE)
        if positive_only:
            reason[(reason == 0) & (mu < 0.0)] = 1 + LEFT_OUT.index(_NEGATIVE)
        level = float(np.nanmedian(slip[reason == 0])) if np.isfinite(slip[reason == 0]).any() else 0.0
        reason[(reason == 0) & (np.abs(slip - level) > S_MAX)] = activation.SPINNING
    reason[(reason == 0) & np.isnan(mu + slip)] = activation.MISSING
    # what goes into a mean must all be usable driving; the traction limit is that of the mean itself
    bad = (reason > 0) & (reason <= activation.SPINNING)
    near = np.convolve(bad, np.ones(width), "same") > 0.0
    reason[(reason == 0) & near] = 1 + LEFT_OUT.index(_BESIDE)
    return reason


# --- estimates -----------------------------------------------------------------------------------------------------


def _estimate(
    place: _Place,
    f: Mapping[str, FloatArray],
    v_x: FloatArray | None,
    braking: Mapping[str, BoolArray],
    vehicle: Vehicle,
    *,
    dt: float,
    width: int,
    mu_max: float,
    positive_only: bool,
) -> PlaceSlope:
    mu, slip = _mean(f, "mu", place.i), _slip(place, f, v_x, vehicle)
    reason = _left_out(place, f, mu, slip, braking, width=width, mu_max=mu_max, positive_only=positive_only)
    is_used = reason == 0
    time: FloatArray = dt * np.arange(mu.size, dtype=np.float64)
    t, x, y = time[is_used], mu[is_used], slip[is_used]
    label = block_labels(t)
    line = fit_line(x, y, label)
    noise = noise_of_traction(mu, slip, is_used, apart=width, k=line.k)
    line = fit_line(x, y, label, noise=noise)
    segments = make_segments(t, x, y, label, dt=dt, noise=noise)
    counts = np.bincount(reason.astype(np.int64), minlength=1 + len(LEFT_OUT))
    low, high = np.quantile(x, (0.05, 0.95)) if x.size else (math.nan, math.nan)
    return PlaceSlope(
        place=place.name,
        wheel=place.i[0] if len(place.i) == 1 else None,
        line=line,
        seconds=x.size * dt,
        mu_range=(float(low), float(high)),
        lag_s=_lag(mu, slip, is_used, dt) if line.told else math.nan,
        segments=segments,
        stability=judge_stability(t, x, y, label, whole=line, segments=segments, noise=noise),
        recursion=_recursion(place, line, mu, slip, is_used, vehicle, dt),
        left_out={name: float(n * dt) for name, n in zip(LEFT_OUT, counts[1:], strict=True)},
        t=t,
        mu=x,
        slip=y,
    )


def _lag(mu: FloatArray, slip: FloatArray, is_used: BoolArray, dt: float) -> float:
    """Time by which the slip is late against the traction: the shift with the best correlation. [s]"""
    step = max(1, round(0.02 / dt))
    shifts = np.arange(-int(LAG_MAX / dt / step), int(LAG_MAX / dt / step) + 1) * step
    index = np.flatnonzero(is_used)
    index = index[(index >= -shifts[0]) & (index < mu.size - shifts[-1])]
    moved = mu[index[:, None] - shifts[None, :]]
    good = np.isfinite(moved).all(axis=1)
    if np.count_nonzero(good) < 20:
        return math.nan
    x, y = moved[good] - moved[good].mean(axis=0), slip[index[good]] - slip[index[good]].mean()
    r = (x * y[:, None]).sum(axis=0) / np.sqrt((x * x).sum(axis=0) * (y @ y))
    k = int(np.argmax(r))
    if not 0 < k < r.size - 1 or r[k] < 0.5:
        return math.nan
    bend = float(r[k - 1] - 2.0 * r[k] + r[k + 1])
    return float(dt * step * (shifts[k] / step + 0.5 * float(r[k - 1] - r[k + 1]) / bend))


def _recursion(
    place: _Place, line: Line, mu: FloatArray, slip: FloatArray, is_used: BoolArray, vehicle: Vehicle, dt: float
) -> Recursion:
    """The recursive estimator over the samples of the regression, told of the noise that this drive has.

    The tuning's density of the slip's noise is of good wheel speeds; coarser ones (0.1 km/h at 10 Hz have ten times as
    much) would be taken for changes of the road.
    """
    tuning = TUNING
    if line.told:
        zeta = max(TUNING.zeta, line.scatter)
        density = 2.0 * SMOOTHING * line.scatter**2  # twice that of white noise before the smoothing
        tuning = TUNING._replace(r=max(TUNING.r, density), zeta=zeta, h=TUNING.h / TUNING.zeta * zeta)
    prior = vehicle.slip_slope_f if place.i[0][0] == "f" else vehicle.slip_slope_r
    start = estimator.initial_state(tuning, slope=prior)
    estimate, _ = estimator.scan(Params.make(tuning, dt), start, slip, mu, np.zeros_like(mu), is_used)
    return _course(estimate, place.name, place.i[0] if len(place.i) == 1 else None, dt)


def _watched(
    watch: SlipSlopeWatch, f: Mapping[str, FloatArray], braking: Mapping[str, BoolArray], dt: float
) -> Recursion:
    """Both axles driven: the estimator as the detector has it."""
    return _course(watch.push(f, braking, f["yaw_rate_slow"]).estimate, watch.pair.place, watch.pair.wheel, dt)


def _course(estimate: Estimate, place: str, wheel: str | None, dt: float) -> Recursion:
    works = estimate.status <= BLIND
    learns = estimate.status == estimator.ESTIMATING
    last = int(np.flatnonzero(works)[-1]) if learns.any() else -1
    return Recursion(
        place=place,
        wheel=wheel,
        slope=float(estimate.slope[last]) if last >= 0 else math.nan,
        slope_sd=float(estimate.slope_sd[last]) if last >= 0 else math.nan,
        alarms=int(np.count_nonzero(estimate.alarm)),
        seconds=float(np.count_nonzero(learns) * dt),
        t=np.arange(works.size, dtype=np.float64) * dt,
        slopes=np.where(works, estimate.slope, np.nan),
    )


# --- what is said about it -----------------------------------------------------------------------------------------


def _refuse(places: Sequence[PlaceSlope], recursions: Sequence[Recursion], where: str, duration: float) -> None:
    """Stop with one line if nothing can be told."""
    if any(p.line.told for p in places):
        return
    if not places:
        if any(r.seconds > 0.0 for r in recursions):
            return
        raise FitError(
            "both axles slip alike or the traction is too even: the recursive estimator could not work", where=where,
            hint="a drive with changing speed and another torque split, or a log with v_x",
        )  # fmt: skip
    best = max(places, key=lambda p: p.seconds)
    most = sorted(best.left_out.items(), key=lambda item: -item[1])[:3]
    out = ", ".join(f"{name} {seconds:.0f} s" for name, seconds in most if seconds >= 0.5)
    too_few = best.line.reason.startswith("too few")
    low, high = best.mu_range
    text = f"{best.seconds:.1f} s of {duration:.0f} s can be used" + (f" (left out: {out})" if out else "")
    if not too_few:
        text += f", traction {low:.3f} to {high:.3f} there"
    raise FitError(
        f"cannot tell the slip slope: {best.line.reason}; {text}", where=where,
        hint=_HINTS["fewer"] if too_few else _HINTS["even"],
    )  # fmt: skip


def _notes(places: Sequence[PlaceSlope], vehicle: Vehicle, way: Way, *, has_brake: bool) -> list[str]:
    notes = []
    if way.traction == "accelerometer" and not has_brake:
        notes.append("no brake_pressure: braking and engine drag look alike, so only driving (mu > 0) is used")
    keys = ("mass", "l_f", "l_r") if way.traction == "torque" else ("l_f", "l_r")
    lacking = [k for k in keys if k not in vehicle.given]
    if lacking:
        notes.append(f"{', '.join(lacking)} not in the vehicle file: wheel loads, and the slope with them, are a guess")
    if way.method == "differential":
        notes.append("differential slip only: recursive estimate, no regression and no interval from the data")
    corrected = [p for p in places if p.line.is_corrected]
    if corrected:
        shares = ", ".join(f"{p.place} {100 * p.line.attenuation:.1f} %" for p in corrected)
        notes.append(f"noise of the traction takes away from 1 / slope, given back: {shares}")
    late = [p for p in places if abs(p.lag_s) > LAG_NOTED]
    if late:
        shares = ", ".join(f"{p.place} {p.lag_s:+.2f} s" for p in late)
        notes.append(
            f"the slip follows the traction best when it is taken as late by {shares}: check the clocks of wheels and "
            "traction (`aqualog align`, [sources] offset_s in the map)"
        )
    changed = [p for p in places if p.recursion.alarms]
    if changed:
        counts = ", ".join(f"{p.place} {p.recursion.alarms}" for p in changed)
        notes.append(f"the recursive estimator found sudden changes of the slope: {counts}")
    return notes
