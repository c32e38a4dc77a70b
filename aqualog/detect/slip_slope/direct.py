"""Estimate the slip slope of the driven wheels of one drive by regression: choose samples, fit lines, compare parts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aqualog.checks.driven import no_drivetrain
from aqualog.core.errors import ConfigError, FitError, SignalError
from aqualog.core.notation import AXLES, WHEELS
from aqualog.core.records import BoolArray, FloatArray, Signals
from aqualog.core.vehicle import Vehicle
from aqualog.detect.braking import BrakeWatch
from aqualog.detect.slip_slope import direct_inputs as inputs
from aqualog.detect.slip_slope import estimator
from aqualog.detect.slip_slope.direct_records import DirectResult, PlaceSlope, Recursion, notes_on, refuse
from aqualog.detect.slip_slope.estimator import BLIND, K_MAX, K_MIN, Estimate
from aqualog.detect.slip_slope.regression import Late, Line, fit_line, lag_of_slip, noise_of_traction
from aqualog.detect.slip_slope.stability import block_labels, judge_stability, make_segments
from aqualog.detect.slip_slope.tuning import TUNING, Params
from aqualog.detect.slip_slope.watch import SlipSlopeWatch, pairs
from aqualog.features.smoothing import earlier
from aqualog.features.stream import FeatureStream

__all__ = ["MU_MAX", "slip_slopes"]

MU_MAX = 0.3  # [-] beyond, the tyre's curve bends: a brush with 1.0 of friction has lost 11 % of its slope there
SMOOTHING = 0.3  # [s] slip and traction alike: sensors' noise and a tenth of a second between their clocks count less
MIN_RATE = 5.0  # [Hz]
DELAY_MAX = 1.0  # [s] of v_x; more is another clock
DELAY_STEP = 0.002  # [s] what is left of it when the search ends
ROUNDS = 8

_ASTRAY = f"v_x is more than {DELAY_MAX:g} s late or early, or its delay changes"
_ALIGN = "`aqualog align`, [sources] offset_s in the map"
_READ = ("v_x_hat", "a_kin_slow", "a_y_slow", "yaw_rate_slow", "v_line_", "a_w_delta_", *(f"mu_{w}" for w in WHEELS))


def slip_slopes(
    signals: Signals,
    vehicle: Vehicle,
    *,
    method: str = "auto",
    traction: str = "auto",
    mu_max: float = MU_MAX,
    delay: float | None = None,
) -> DirectResult:
    """Estimate the slip slope C_s / F_z of every driven wheel.

    Parameters
    ----------
    vehicle : Vehicle
        Drivetrain, radii, mass and its distribution.
    method, traction : str
        As in `choose_way`.
    mu_max : float
        Largest traction coefficient used. [-]
    delay : float, optional
        Delay of v_x against the wheels, if known; else it is estimated with the slope. [s]

    Raises
    ------
    ConfigError, SignalError
        As `choose_way`; SignalError if the vehicle does not say which axle is driven.
    FitError
        If no wheel's slope can be estimated, with the reason.

    Thesis: the direct approach of section 2.3 and reference [15] with Eq. (3.14). All-wheel drive without a reference
    velocity: section 3.2, the recursive estimate alone; the section asks to take delays of the reference into account.
    """
    where = ", ".join(signals.files)
    present = [s for s in signals.symbols if signals.frame[s].null_count() < signals.frame.height]
    if not vehicle.knows_drivetrain:
        torques = {s: signals.array(s) for s in present if s.startswith("torque_")}
        raise no_drivetrain(vehicle, torques, "no slip slope", where=where)
    way = inputs.choose_way(vehicle, present, method=method, traction=traction, where=where)
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
        f |= inputs.accelerometer_traction(f, columns["a_x"], vehicle)
    if way.method == "axle":
        f |= inputs.over_free_wheels(f, vehicle, signals.dt)
    braking = BrakeWatch(vehicle, signals.dt).push(f, columns)
    if way.method != "differential":
        f = {n: x for n, x in f.items() if n.startswith(_READ)}  # long drives: the others are half of the memory
    smooth = {n: inputs.smoothed(x, width) if n.startswith(("v_line_", "mu_")) else x for n, x in f.items()}
    del f
    if way.traction == "torque" and way.method == "velocity":
        smooth |= inputs.torque_traction(smooth, columns, vehicle, signals.dt, width)
    reference = None
    if way.method == "velocity":
        reference = inputs.reference_of(inputs.smoothed(columns["v_x"], width), smooth, vehicle, signals.dt, delay)
    positive_only = way.traction == "accelerometer" and "brake_pressure" not in present
    drive = _Drive(smooth, reference, braking, vehicle, signals.dt, width, mu_max, positive_only)
    places = tuple(_estimate(place, drive) for place in _places(vehicle, way.method))
    recursions: tuple[Recursion, ...] = ()
    if way.method == "differential":
        recursions = tuple(
            # for a car with two driven axles, as the detector does
            _course(
                SlipSlopeWatch(vehicle, pair, signals.dt).push(smooth, braking, smooth["yaw_rate_slow"]).estimate,
                pair.place,
                pair.wheel,
                signals.dt,
            )
            for pair in (*pairs(vehicle), *pairs(vehicle, per_axle=True))
        )
    refuse(places, recursions, where, signals.frame.height * signals.dt)
    return DirectResult(
        vehicle.name, way.method, way.traction, mu_max, signals.frame.height * signals.dt, rate, places, recursions,
        (*way.notes, *notes_on(places, vehicle, way, has_brake="brake_pressure" in present)),
    )  # fmt: skip


def _places(vehicle: Vehicle, method: inputs.Method) -> list[inputs.Place]:
    if method == "differential":
        return []
    if method == "velocity":
        return [inputs.Place(w, (w,), ()) for w in vehicle.driven]
    axle = vehicle.driven[0][0]
    free = [w for w in WHEELS if w not in vehicle.driven]
    wheels = [inputs.Place(i, (i,), (j,)) for i, j in zip(vehicle.driven, free, strict=True)]
    name = {"f": "front axle", "r": "rear axle"}[axle]
    return [*wheels, inputs.Place(name, AXLES[axle], tuple(free))]


# --- estimates -----------------------------------------------------------------------------------------------------


class _Drive(NamedTuple):
    """What all places of a drive share; `f` smooth features, `width` of the smoothing in samples."""

    f: Mapping[str, FloatArray]
    reference: inputs.Reference | None
    braking: Mapping[str, BoolArray]
    vehicle: Vehicle
    dt: float
    width: int
    mu_max: float
    positive_only: bool  # without brakes in the log only a car that is driven is surely not braked


class _Samples(NamedTuple):
    mu: FloatArray  # (n,) of the drive
    slip: FloatArray
    reason: FloatArray  # as `left_out`
    label: NDArray[np.int64]  # of the used ones, as all below
    t: FloatArray
    x: FloatArray
    y: FloatArray
    late: Late | None


def _estimate(place: inputs.Place, drive: _Drive) -> PlaceSlope:
    reference, dt = drive.reference, drive.dt
    shift = 0.0 if reference is None or reference.delay is None else reference.delay
    doubt = ("", "")
    for _ in range(ROUNDS):
        s = _samples(place, drive, None if reference is None else earlier(reference.v_x, shift, dt))
        # a delay goes into this k and into the fast changes of the slip alike, so the noise does not depend on it
        k = fit_line(s.x, s.y, s.label).k
        noise = noise_of_traction(s.mu, s.slip, s.reason == 0, apart=drive.width, k=k)
        line = fit_line(s.x, s.y, s.label, noise=noise, late=s.late)
        doubt = doubt if doubt[0] else (line.reason or _ASTRAY, line.hint or _ALIGN)
        rest = line.delay
        if not _goes_on(line, shift):
            break
        shift += rest
    is_astray = s.late is not None and (abs(rest) >= DELAY_STEP or abs(shift) > DELAY_MAX)
    if is_astray and line.told:
        # the first round gives the reason, if it could not separate the delay
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
    counts = np.bincount(s.reason.astype(np.int64), minlength=1 + len(inputs.LEFT_OUT))
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
        recursion=_recursion(place, line, s.mu, slip, is_used, drive),
        left_out={name: float(n * dt) for name, n in zip(inputs.LEFT_OUT, counts[1:], strict=True)},
        t=s.t,
        mu=s.x,
        slip=y,
    )


def _samples(place: inputs.Place, drive: _Drive, v_x: FloatArray | None) -> _Samples:
    f, reference, dt = drive.f, drive.reference, drive.dt
    mu, slip = inputs.mean_of(f, "mu", place.i), inputs.slip_of(place, f, v_x, drive.vehicle)
    reason = inputs.left_out(
        place, f, mu, slip, drive.braking, width=drive.width, mu_max=drive.mu_max, positive_only=drive.positive_only
    )
    is_open = reference is not None and reference.delay is None
    if reference is not None and is_open:
        reason[(reason == 0) & np.isnan(reference.a_over_v)] = 1 + inputs.LEFT_OUT.index(inputs.BESIDE)
    which = np.flatnonzero(reason == 0)
    t = dt * which.astype(np.float64)
    late = Late(reference.a_over_v[which], reference.noise[which]) if reference is not None and is_open else None
    return _Samples(mu, slip, reason, block_labels(t), t, mu[which], slip[which], late)


def _goes_on(line: Line, shift: float) -> bool:
    """Return whether to move the velocity by the delay found: v(t - tau) is linear in tau for small tau only."""
    low, high = line.delay_ci
    if not (math.isfinite(line.delay) and high - low < DELAY_MAX) or abs(line.delay) < DELAY_STEP:
        return False
    return abs(shift + line.delay) <= DELAY_MAX


def _recursion(
    place: inputs.Place, line: Line, mu: FloatArray, slip: FloatArray, is_used: BoolArray, drive: _Drive
) -> Recursion:
    """Run the recursive estimator over the samples of the regression, with the noise of this drive.

    The tuning's noise density of the slip holds for good wheel speeds. Coarser ones (0.1 km/h at 10 Hz have ten times
    as much) would look like changes of the road.
    """
    tuning = TUNING
    if line.told:
        zeta = max(TUNING.zeta, line.scatter)
        density = 2.0 * SMOOTHING * line.scatter**2  # twice that of white noise before the smoothing
        tuning = TUNING._replace(r=max(TUNING.r, density), zeta=zeta, h=TUNING.h / TUNING.zeta * zeta)
    prior = drive.vehicle.slip_slope_f if place.i[0][0] == "f" else drive.vehicle.slip_slope_r
    start = estimator.initial_state(tuning, slope=prior)
    estimate, _ = estimator.scan(Params.make(tuning, drive.dt), start, slip, mu, np.zeros_like(mu), is_used)
    return _course(estimate, place.name, place.i[0] if len(place.i) == 1 else None, drive.dt)


def _course(estimate: Estimate, place: str, wheel: str | None, dt: float) -> Recursion:
    works = estimate.status <= BLIND
    learns = estimate.status == estimator.ESTIMATING
    last = int(np.flatnonzero(works)[-1]) if learns.any() else -1
    if last >= 0 and not 1.01 * K_MIN < 1.0 / estimate.slope[last] < 0.99 * K_MAX:
        last = -1  # it stands at its bound: no tyre is like that
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
