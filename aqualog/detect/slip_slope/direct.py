"""Slip slope of the driven wheels of one drive by regression: samples chosen, lines fitted, parts compared."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aqualog.detect.negative_force import HOLD as BRAKE_HOLD
from aqualog.detect.negative_force import hold_on, is_braking
from aqualog.detect.slip_slope import activation, estimator
from aqualog.detect.slip_slope.activation import Limits
from aqualog.detect.slip_slope.estimator import BLIND, K_MAX, K_MIN, Estimate
from aqualog.detect.slip_slope.regression import Late, Line, fit_line, lag_of_slip, noise_of_traction
from aqualog.detect.slip_slope.stability import Segment, Stability, block_labels, judge_stability, make_segments
from aqualog.detect.slip_slope.tuning import TUNING, Params
from aqualog.detect.slip_slope.watch import SlipSlopeWatch, pairs
from aqualog.detect.slip_slope.ways import Method, TractionSource, Way, choose_way
from aqualog.errors import ConfigError, FitError, SignalError
from aqualog.features.stream import FeatureStream
from aqualog.notation import AXLES, WHEELS
from aqualog.physics.differential import differential_slip
from aqualog.physics.load import G, wheel_loads
from aqualog.physics.slip import V_MIN, wheel_slip
from aqualog.physics.traction import traction_coefficient, traction_of_one_axle
from aqualog.types import BoolArray, FloatArray, Signals
from aqualog.vehicle import Vehicle

__all__ = ["LEFT_OUT", "LIMITS", "MU_MAX", "DirectResult", "PlaceSlope", "Recursion", "slip_slopes"]

MU_MAX = 0.3  # [-] beyond, the tyre's curve bends: a brush with 1.0 of friction has lost 11 % of its slope there
LIMITS = Limits(a_x_max=6.0, a_y_max=1.0, yaw_rate_max=0.05)  # straighter than the estimator, which has less to lose
SMOOTHING = 0.3  # [s] slip and traction alike: sensors' noise and a tenth of a second between their clocks count less
S_MAX = 0.05  # [-] slip about its median beyond which a wheel spins
LAG_NOTED = 0.1  # [s] twice what the lag is good to
MIN_RATE = 5.0  # [Hz]
DELAY_MAX = 1.0  # [s] of v_x; more is another clock
DELAY_STEP = 0.002  # [s] what is left of it when the search ends
ROUNDS = 8
DELAY_NOTED = 0.01  # [s]
SHARED_NOTED = 0.8  # share of the traction that goes with a / v, from which the delay widens the interval 2.2 times
MEDIAN_SQUARE = 0.455  # of a normal variable with variance 1; single bumps do not move it
OFFSET_NOTED = 0.03  # [-] tyres of one size and different wear differ by less

_TOO_LARGE, _NEGATIVE, _BESIDE = "traction beyond the limit", "brakes not known", "beside a stretch left out"
_ASTRAY = f"v_x is more than {DELAY_MAX:g} s late or early, or its delay changes"
_ALIGN = "`aqualog align`, [sources] offset_s in the map"
_READ = ("v_x_hat", "a_kin_slow", "a_y_slow", "yaw_rate_slow", "v_line_", "a_w_delta_", *(f"mu_{w}" for w in WHEELS))
LEFT_OUT = (*activation.REASONS[1 : activation.SPINNING + 1], _TOO_LARGE, _NEGATIVE, _BESIDE)
"""Why a sample was not used, in this order."""


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


class _Place(NamedTuple):
    name: str
    i: tuple[str, ...]  # driven
    j: tuple[str, ...]  # free, () against a velocity


class _Reference(NamedTuple):
    v_x: FloatArray
    a_over_v: FloatArray  # [1/s]
    noise: FloatArray  # of a_over_v, standard deviation
    delay: float | None  # [s] known


def slip_slopes(
    signals: Signals,
    vehicle: Vehicle,
    *,
    method: str = "auto",
    traction: str = "auto",
    mu_max: float = MU_MAX,
    delay: float | None = None,
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
    delay : float, optional
        By which v_x is late against the wheels, where it is known; else it is estimated with the slope. [s]

    Raises
    ------
    ConfigError, SignalError
        As `ways.choose_way`.
    FitError
        If no wheel's slope can be told, with the reason.

    Thesis: the direct approach of section 2.3 and reference [15] with Eq. (3.14); all-wheel drive without a reference
    velocity: section 3.2, the recursive estimate alone. It asks there to take delays of the reference into account.
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
    width = max(1, 2 * round(0.5 * (SMOOTHING / signals.dt - 1.0)) + 1)
    if signals.frame.height < 2 * width:
        raise FitError(
            f"too short: {signals.frame.height} samples, {signals.frame.height * signals.dt:.2g} s", where=where,
            expected="a minute or more",
        )  # fmt: skip
    if delay is not None and way.method != "velocity":
        raise ConfigError(f"--delay with --method {way.method}", expected="velocity: it is the delay of v_x")
    columns = {s: signals.array(s) for s in present}
    f = dict(FeatureStream(vehicle, signals.dt, present).push(columns))
    if way.traction == "accelerometer":
        f |= _accelerometer_traction(f, columns["a_x"], vehicle)
    braking = _braking(f, columns, vehicle, signals.dt)
    if way.method != "differential":
        f = {n: x for n, x in f.items() if n.startswith(_READ)}  # long drives: the others are half of the memory
    smooth = {n: _smoothed(x, width) if n.startswith(("v_line_", "mu_")) else x for n, x in f.items()}
    del f
    if way.traction == "torque" and way.method == "velocity":
        smooth |= _torque_traction(smooth, columns, vehicle, signals.dt, width)
    reference = None
    if way.method == "velocity":
        reference = _reference(_smoothed(columns["v_x"], width), smooth, vehicle, signals.dt, delay)
    places = tuple(
        _estimate(
            place, smooth, reference, braking, vehicle, dt=signals.dt, width=width, mu_max=mu_max,
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


def _torque_traction(
    f: Mapping[str, FloatArray], columns: Mapping[str, FloatArray], vehicle: Vehicle, dt: float, width: int
) -> dict[str, FloatArray]:
    """As in the features, but without their filters' delays: those are not to be taken for one of v_x."""
    a_x = columns["a_x"] if "a_x" in columns else f["a_kin_slow"]
    loads = wheel_loads(
        _smoothed(a_x, width), f["a_y_slow"], mass=vehicle.mass, l_f=vehicle.l_f, l_r=vehicle.l_r, h_cg=vehicle.h_cg,
        track=vehicle.track,
    )  # fmt: skip
    found = {}
    for w, load in zip(WHEELS, loads, strict=True):
        if w in vehicle.driven:
            found[f"mu_{w}"] = traction_coefficient(
                _smoothed(columns[f"torque_{w}"], width), load, np.gradient(f[f"v_line_{w}"], dt) / vehicle.r_e(w),
                r_l=vehicle.r_l(w), inertia=vehicle.inertia(w), r_w=vehicle.rolling_resistance,
            )  # fmt: skip
    return found


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
    good = np.isfinite(x)
    level = float(x[good].mean()) if good.any() else 0.0
    half = width // 2
    mean = np.full(x.size, np.nan)
    mean[half : x.size - half] = _sums(np.where(good, x - level, 0.0), width) / width + level
    mean[_near(~good, width)] = np.nan
    return mean


def _sums(x: FloatArray, width: int) -> FloatArray:
    """Of `width` neighbours each; (n - width + 1,)."""
    total = np.concatenate([[0.0], np.cumsum(x)])
    sums: FloatArray = total[width:] - total[:-width]
    return sums


def _near(bad: BoolArray, width: int) -> BoolArray:
    """Where one of the samples of a centred mean is bad."""
    half = width // 2
    near: BoolArray = _sums(np.pad(bad.astype(np.float64), half), 2 * half + 1) > 0.5
    return near


def _reference(
    v_x: FloatArray, f: Mapping[str, FloatArray], vehicle: Vehicle, dt: float, delay: float | None
) -> _Reference:
    """The velocity, and what its delay would add: the acceleration of the driven wheels over their speed.

    The noise of the acceleration is half of what left and right wheels differ by.
    """
    axles = [(w, v) for w, v in AXLES.items() if v[0] in vehicle.driven]
    v = np.mean([_mean(f, "v_line", wheels) for _, wheels in axles], axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        fast = np.where(v > V_MIN, v, np.nan)
    apart = [np.gradient(f[f"v_line_{left}"] - f[f"v_line_{right}"], dt) for _, (left, right) in axles]
    calm = (np.abs(f["yaw_rate_slow"]) < LIMITS.yaw_rate_max) & np.isfinite(fast) & np.isfinite(np.sum(apart, axis=0))
    variance = sum(float(np.median(d[calm] ** 2)) for d in apart) / MEDIAN_SQUARE if calm.any() else 0.0
    sd = 0.5 * math.sqrt(variance) / len(axles)
    return _Reference(v_x, np.gradient(v, dt) / fast, sd / fast, delay)


def _earlier(v_x: FloatArray, delay: float, dt: float) -> FloatArray:
    """A velocity that is late, put where it belongs."""
    if delay == 0.0:
        return v_x
    k = np.arange(v_x.size, dtype=np.float64)
    moved: FloatArray = np.interp(k + delay / dt, k, v_x, left=math.nan, right=math.nan)
    return moved


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
    reason[(reason == 0) & _near(bad, width)] = 1 + LEFT_OUT.index(_BESIDE)
    return reason


# --- estimates -----------------------------------------------------------------------------------------------------


class _Samples(NamedTuple):
    mu: FloatArray  # (n,) of the drive
    slip: FloatArray
    reason: FloatArray  # as `_left_out`
    label: NDArray[np.int64]  # of the used ones, as all below
    t: FloatArray
    x: FloatArray
    y: FloatArray
    late: Late | None


def _estimate(
    place: _Place,
    f: Mapping[str, FloatArray],
    reference: _Reference | None,
    braking: Mapping[str, BoolArray],
    vehicle: Vehicle,
    *,
    dt: float,
    width: int,
    mu_max: float,
    positive_only: bool,
) -> PlaceSlope:
    shift = 0.0 if reference is None or reference.delay is None else reference.delay
    doubt = ("", "")
    for _ in range(ROUNDS):
        v_x = None if reference is None else _earlier(reference.v_x, shift, dt)
        s = _samples(
            place, f, v_x, reference, braking, vehicle, dt=dt, width=width, mu_max=mu_max, positive_only=positive_only
        )
        line, noise = _line(s, width)
        doubt = doubt if doubt[0] else (line.reason or _ASTRAY, line.hint or _ALIGN)
        rest = line.delay
        if not _goes_on(line, shift):
            break
        shift += rest
    is_astray = s.late is not None and (abs(rest) >= DELAY_STEP or abs(shift) > DELAY_MAX)
    if is_astray and line.told:
        # the first round says why, if it could not tell the delay
        line = replace(line, reason=doubt[0], hint=doubt[1])
    slip, y, late = s.slip, s.y, s.late
    if late is not None and reference is not None:
        # what the last round left of the delay
        slip = slip - rest * reference.a_over_v
        y = y - rest * late.column
        low, high = line.delay_ci
        line = replace(line, delay=shift + rest, delay_ci=(shift + low, shift + high))
    elif reference is not None:
        line = replace(line, delay=shift)
    is_used = s.reason == 0
    known = None if late is None else late._replace(half=0.5 * (line.delay_ci[1] - line.delay_ci[0]))
    segments = make_segments(s.t, s.x, y, s.label, dt=dt, noise=noise, late=known)
    counts = np.bincount(s.reason.astype(np.int64), minlength=1 + len(LEFT_OUT))
    low, high = np.quantile(s.x, (0.05, 0.95)) if s.x.size else (math.nan, math.nan)
    return PlaceSlope(
        place=place.name,
        wheel=place.i[0] if len(place.i) == 1 else None,
        line=line,
        seconds=s.x.size * dt,
        mu_range=(float(low), float(high)),
        lag_s=lag_of_slip(s.mu, slip, is_used, dt) if line.told else math.nan,
        segments=segments,
        stability=judge_stability(s.t, s.x, y, s.label, whole=line, segments=segments, noise=noise, late=late),
        recursion=_recursion(place, line, s.mu, slip, is_used, vehicle, dt),
        left_out={name: float(n * dt) for name, n in zip(LEFT_OUT, counts[1:], strict=True)},
        t=s.t,
        mu=s.x,
        slip=y,
    )


def _samples(
    place: _Place,
    f: Mapping[str, FloatArray],
    v_x: FloatArray | None,
    reference: _Reference | None,
    braking: Mapping[str, BoolArray],
    vehicle: Vehicle,
    *,
    dt: float,
    width: int,
    mu_max: float,
    positive_only: bool,
) -> _Samples:
    mu, slip = _mean(f, "mu", place.i), _slip(place, f, v_x, vehicle)
    reason = _left_out(place, f, mu, slip, braking, width=width, mu_max=mu_max, positive_only=positive_only)
    is_open = reference is not None and reference.delay is None
    if reference is not None and is_open:
        reason[(reason == 0) & np.isnan(reference.a_over_v)] = 1 + LEFT_OUT.index(_BESIDE)
    which = np.flatnonzero(reason == 0)
    t = dt * which.astype(np.float64)
    late = Late(reference.a_over_v[which], reference.noise[which]) if reference is not None and is_open else None
    return _Samples(mu, slip, reason, block_labels(t), t, mu[which], slip[which], late)


def _line(s: _Samples, width: int) -> tuple[Line, float]:
    """The line, and the noise of the traction that it takes into account."""
    # a delay goes into this k and into the fast changes of the slip alike, so the noise does not depend on it
    first = fit_line(s.x, s.y, s.label)
    noise = noise_of_traction(s.mu, s.slip, s.reason == 0, apart=width, k=first.k)
    return fit_line(s.x, s.y, s.label, noise=noise, late=s.late), noise


def _goes_on(line: Line, shift: float) -> bool:
    """Whether the velocity is to be moved by the delay found: v(t - tau) is linear in tau for small tau only."""
    low, high = line.delay_ci
    if not (math.isfinite(line.delay) and high - low < DELAY_MAX) or abs(line.delay) < DELAY_STEP:
        return False
    return abs(shift + line.delay) <= DELAY_MAX


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
    if last >= 0 and not 1.01 * K_MIN < 1.0 / estimate.slope[last] < 0.99 * K_MAX:
        last = -1  # it stands at its bound: that is no tyre
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
    raise FitError(f"cannot tell the slip slope: {best.line.reason}; {text}", where=where, hint=best.line.hint)


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
    notes += _notes_on_reference(places)
    changed = [p for p in places if p.recursion.alarms]
    if changed:
        counts = ", ".join(f"{p.place} {p.recursion.alarms}" for p in changed)
        notes.append(f"the recursive estimator found sudden changes of the slope: {counts}")
    return notes


def _notes_on_reference(places: Sequence[PlaceSlope]) -> list[str]:
    notes = []
    odd = [p for p in places if p.line.told and abs(p.line.offset) > OFFSET_NOTED]
    if odd:
        shares = ", ".join(f"{p.place} {100 * p.line.offset:+.1f} %" for p in odd)
        notes.append(f"slip without traction: {shares}; the radii in the vehicle file do not fit")
    delayed = [p for p in places if p.line.told and _is_noted(p.line)]
    if delayed:
        shares = ", ".join(f"{p.place} {p.line.delay:+.3f} s" for p in delayed)
        notes.append(f"v_x is late against the wheels, taken out: {shares}")
    wide = [p.place for p in places if p.line.told and p.line.shared > SHARED_NOTED]
    if wide:
        notes.append(
            f"{', '.join(wide)}: traction and acceleration over speed go together, so the delay of v_x widens the "
            "interval of the slope; narrower with other speeds or grades, or --delay where it is known"
        )
    return notes


def _is_noted(line: Line) -> bool:
    low, high = line.delay_ci
    return abs(line.delay) > DELAY_NOTED and (low > 0.0 or high < 0.0)
