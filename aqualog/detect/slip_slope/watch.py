"""Estimate the slip slope of a whole drive: choose the wheels, and run the chain from features to detections."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from aqualog.core.notation import AXLES, SIDES
from aqualog.core.records import BoolArray, FloatArray, SlopeSummary, Track
from aqualog.core.vehicle import Vehicle
from aqualog.detect import ewvar
from aqualog.detect.braking import hold_on
from aqualog.detect.detector import Detector, Needs, Output, Scene, Setup, missing_torques, missing_wheels, too_slow
from aqualog.detect.slip_slope import activation, drop, estimator
from aqualog.detect.slip_slope.drop import THRESHOLD
from aqualog.detect.slip_slope.estimator import BLIND, ESTIMATING, FROZEN, INACTIVE, STATUS, Estimate
from aqualog.detect.slip_slope.history import Memory
from aqualog.detect.slip_slope.tuning import TUNING, Params, Tuning
from aqualog.detect.spin import MIN_RATE
from aqualog.features.smoothing import UNSET, derivative, lowpass
from aqualog.physics.differential import beta_of_ratio, differential_slip, slope_ratio

__all__ = ["SLIP_SLOPE_DROP", "DropWatch", "Memory", "Pair", "SlipSlopeWatch", "Watched", "pairs", "remarks"]

VARIANCE_MAX = 3.0  # [(m/s^2)^2] "wheel acceleration variance below a threshold" (C68); teeth below 0.1, gravel 2.5-5
TAU_VARIANCE = 0.3  # [s]
# slip and traction alike: noise of the traction (a wheel's acceleration is in it) would flatten slip over traction
TAU_SMOOTH = 0.15  # [s]
STIFF = 150.0  # [-] three times a stiff tyre: the slip does not fit the traction
AFTER_JUMP = 0.5  # [s] a jump of the torque, late by up to 0.3 s, has passed the low-pass

Form = Literal["f", "r"]


@dataclass(frozen=True, slots=True)
class Pair:
    """Wheels whose speeds are compared: `i` at the axle of the formulation, `j` opposite; means of several wheels."""

    place: str  # left, right, or axle
    wheel: str | None  # the one that is driven and judged, where it is one
    i: tuple[str, ...]
    j: tuple[str, ...]


def pairs(vehicle: Vehicle, *, form: Form | None = None, per_axle: bool = False) -> tuple[Pair, ...]:
    """Return the pairs of a car: one per side, or the two axles.

    With one driven axle the formulation is at that axle, and the differential slip is its slip (C87). An all-wheel
    drive is formulated at the front axle by default; the rear form is the same equation solved for the rear slope.
    """
    axle = {"fwd": "f", "rwd": "r", "awd": form or "f"}[vehicle.drivetrain]
    other = "r" if axle == "f" else "f"
    if per_axle:
        return (Pair("axle", None, AXLES[axle], AXLES[other]),)
    one = vehicle.drivetrain != "awd"
    found = []
    for side, wheels in SIDES.items():
        i = next(w for w in wheels if w[0] == axle)
        j = next(w for w in wheels if w[0] == other)
        found.append(Pair(side, i if one else None, (i,), (j,)))
    return tuple(found)


@dataclass(frozen=True, slots=True)
class Watched:
    """One piece of a drive at one pair, arrays (n,).

    `loss` = 1 - C / C_ref, `active` the detection bit, `reference` the dry slope, `mu` the traction coefficient of the
    wheels judged, `slip` their differential slip.
    """

    estimate: Estimate
    loss: FloatArray
    active: BoolArray
    reference: FloatArray
    mu: FloatArray
    slip: FloatArray


class SlipSlopeWatch:
    """The estimator of one pair with its state.

    Parameters
    ----------
    dt : float
        [s]
    loss : float
        Share of the dry slope that must be lost. [-]
    """

    def __init__(
        self,
        vehicle: Vehicle,
        pair: Pair,
        dt: float,
        memory: Memory | None = None,
        tuning: Tuning = TUNING,
        loss: float = THRESHOLD,
    ) -> None:
        memory = memory or Memory()
        self.pair = pair
        self._two_driven = vehicle.drivetrain == "awd"
        front = pair.i[0][0] == "f"
        ratio = float(slope_ratio(np.array(vehicle.slip_slope_f), np.array(vehicle.slip_slope_r)))
        slope = vehicle.slip_slope_f if front else vehicle.slip_slope_r
        periods = memory.history.of(memory.name(vehicle), pair.place)
        key = "tyre.slip_slope_f" if front else "tyre.slip_slope_r"
        fallback = slope if key in vehicle.given else np.nan
        self._params = Params.make(tuning, dt)
        self._state = estimator.initial_state(tuning, slope=slope, beta=beta_of_ratio(ratio, front=front))
        self._source = "history" if periods else "vehicle file" if fallback == fallback else "this drive"
        self._drop_params = drop.DropParams.make(dt, memory.rule, loss)
        self._drop = drop.initial_state(periods, rule=memory.rule, fallback=fallback)
        self._variance = ewvar.from_seconds(TAU_VARIANCE, TAU_VARIANCE, dt)
        # of the judged wheels: the others may dip while the slope of these is lost (C72, C74)
        judged = (*pair.i, *pair.j) if self._two_driven else pair.i
        self._variances = {w: ewvar.initial_state() for w in judged}
        self._smoothed: dict[str, float] = {}
        self._after_jump = 0
        self._dt = dt
        self._counts = np.zeros(len(STATUS))
        self._reasons = np.zeros(len(activation.REASONS))
        self._last = (np.nan, np.nan, np.nan)
        self._alarms = 0
        self._judged = self._dropped = self._stiff = 0

    def push(self, f: Mapping[str, FloatArray], braking: Mapping[str, BoolArray], yaw_rate: FloatArray) -> Watched:
        """Take the features of the next piece."""
        i, j = self.pair.i, self.pair.j
        slip = differential_slip(_mean(f, "v_line", i), _mean(f, "v_line", j))
        s_delta = self._smooth("s_delta", slip)
        mu_i = self._smooth("mu_i", _mean(f, "mu", i))
        # a free wheel's own rolling resistance is a slip that never changes: it goes to the offset
        rho_mu_j = self._smooth("mu_j", (1.0 - slip) * _mean(f, "mu", j)) if self._two_driven else 0.0 * mu_i
        rates = []
        for w in (*i, *j) if self._two_driven else i:
            name = f"mu_rate_{w}"
            rate, self._smoothed[name] = derivative(
                f[f"mu_{w}"], self._smoothed.get(name, UNSET), tau=TAU_SMOOTH, dt=self._dt
            )
            rates.append(np.nan_to_num(rate))
        reason = activation.inactive_reason(
            v_x=f["v_x_hat"], a_x=f["a_kin_slow"], a_y=f["a_y_slow"], yaw_rate=yaw_rate,
            a_w_delta=np.max([np.abs(f[f"a_w_delta_{w}"]) for w in (*i, *j)], axis=0),
            is_braking=np.any([braking[w] for w in (*i, *j)], axis=0), mu_rate=np.max(np.abs(rates), axis=0),
        )  # fmt: skip
        jumping, self._after_jump = hold_on(
            reason == activation.JUMPING, self._after_jump, seconds=AFTER_JUMP, dt=self._dt
        )
        reason = np.where(jumping & (reason == activation.ACTIVE), activation.JUMPING, reason)
        estimate, self._state = estimator.scan(self._params, self._state, s_delta, mu_i, rho_mu_j, reason == 0)
        is_valid = (estimate.status == ESTIMATING) | (estimate.status == FROZEN)
        for wheel, state in self._variances.items():
            _, variance, self._variances[wheel] = ewvar.scan(self._variance, state, f[f"a_w_delta_{wheel}"])
            with np.errstate(invalid="ignore"):
                is_valid &= ~(variance > VARIANCE_MAX)
        loss, active, refs, self._drop = drop.scan(
            self._drop_params, self._drop, estimate.slope, estimate.slope_sd, is_valid, estimate.alarm
        )
        self._count(estimate, reason, loss)
        return Watched(estimate, loss, active, refs, mu_i, s_delta)

    @property
    def drop_threshold(self) -> float:
        """Return the loss of slope from which a detection begins. [-]"""
        return 1.0 - self._drop_params.drop

    def summary(self) -> SlopeSummary:
        """Return how the drive's samples were used, and the last estimate."""
        seconds = self._counts * self._dt
        slope, sd, offset = self._last
        source = "this drive" if self._drop.new > 0 and self._source != "history" else self._source
        return SlopeSummary(
            place=self.pair.place,
            wheel=self.pair.wheel,
            slope=slope,
            slope_sd=sd,
            reference=float(self._drop.reference),
            beta=float(self._state.belief.beta) if self._two_driven else None,
            offset=offset,
            alarms=self._alarms,
            seconds={name: float(s) for name, s in zip(_STATUS_NAMES, seconds, strict=True)},
            inactive={
                name: float(n * self._dt) for name, n in zip(activation.REASONS[1:], self._reasons[1:], strict=True)
            },
            reference_from=source if np.isfinite(self._drop.reference) else "",
            judged_s=self._judged * self._dt,
            dropped_s=self._dropped * self._dt,
            stiff_s=self._stiff * self._dt,
            periods=tuple((p.largest, p.mean, p.seconds) for p in drop.completed(self._drop)),
        )

    def _smooth(self, name: str, x: FloatArray) -> FloatArray:
        y, self._smoothed[name] = lowpass(x, self._smoothed.get(name, UNSET), tau=TAU_SMOOTH, dt=self._dt)
        return y

    def _count(self, estimate: Estimate, reason: FloatArray, loss: FloatArray) -> None:
        judged = ~np.isnan(loss)
        self._judged += int(np.count_nonzero(judged))
        self._dropped += int(np.count_nonzero(loss[judged] > self.drop_threshold))
        self._stiff += int(np.count_nonzero((estimate.status <= FROZEN) & (estimate.slope > STIFF)))
        self._counts += np.bincount(estimate.status.astype(np.int64), minlength=len(STATUS))
        missing = (reason == 0) & (estimate.status == INACTIVE)  # of the signals only the traction or a speed
        told = np.where(missing, activation.MISSING, reason).astype(np.int64)
        self._reasons += np.bincount(told, minlength=self._reasons.size)
        self._alarms += int(np.count_nonzero(estimate.alarm))
        used = np.flatnonzero(estimate.status <= BLIND)
        if used.size:
            k = used[-1]
            self._last = (float(estimate.slope[k]), float(estimate.slope_sd[k]), float(estimate.offset[k]))


_STATUS_NAMES = ("estimating", "slope_frozen", "blind", "traction_too_large", "spinning", "inactive")


def _mean(f: Mapping[str, FloatArray], stem: str, wheels: tuple[str, ...]) -> FloatArray:
    total = f[f"{stem}_{wheels[0]}"]
    for wheel in wheels[1:]:
        total = total + f[f"{stem}_{wheel}"]
    return total / len(wheels)


class DropWatch:
    """A lost slip slope at the pairs of a car; features `slip_slope_left` ... and `slip_slope_ref_left` ... [-]"""

    def __init__(self, setup: Setup) -> None:
        self._setup = setup
        car = setup.vehicle
        self.watches = tuple(
            SlipSlopeWatch(car, pair, setup.dt, setup.memory, loss=setup.threshold) for pair in pairs(car)
        )

    def push(self, scene: Scene) -> Output:
        """Take the next piece: a track per pair, the lost share of the dry slope. [-]"""
        f = scene.f
        found = []
        features: dict[str, FloatArray] = {}
        for watch in self.watches:
            seen = watch.push(f, scene.braking, f["yaw_rate_slow"])
            place = watch.pair.place
            features[f"slip_slope_{place}"] = np.where(seen.estimate.status < INACTIVE, seen.estimate.slope, np.nan)
            features[f"slip_slope_ref_{place}"] = seen.reference
            evidence: dict[str, Any] = {
                "v_x": ("first", f["v_x_hat"]),
                "slope_min": ("min", seen.estimate.slope),
                "slope_ref": ("first", seen.reference),
                "mu": ("first", seen.mu),
                "slip_max": ("max", np.abs(seen.slip)),
            }
            name, unit = self._setup.detector.name, self._setup.detector.unit
            track = Track(name, watch.pair.wheel, place, unit, seen.loss, watch.drop_threshold, seen.active)
            found.append((track, evidence))
        return Output(tuple(found), features)


SLIP_SLOPE_DROP = Detector(
    name="slip_slope_drop",
    title="Slip-slope drop",
    unit="-",
    meaning="lost share of the dry slip slope",
    statistic="share of the dry slip slope that is lost",
    threshold=THRESHOLD,
    needs=lambda car, have, rate: Needs(
        (*missing_wheels(have), *missing_torques(car, have), *too_slow(rate, MIN_RATE))
    ),
    start=DropWatch,
    highest=1.0,
)


LEAST = 10.0  # [s] of driving before anything is said
MOST = 0.5  # share of it
RESTLESS = 12.0  # changes in ten minutes: roads change less often
TOO_STIFF = 0.1  # share of the driving
ALWAYS = 0.9  # share of the drive below half of the dry slope


def remarks(slopes: Sequence[SlopeSummary]) -> tuple[str, ...]:
    """Return notes for places where the estimator saw little; one sentence for places alike.

    Thesis: section 3.2 on equal slips (C95) and 3.3 on constant driving (C96); E10.
    """
    said: dict[str, list[str]] = {}
    for slope in slopes:
        for text in _remarks(slope):
            said.setdefault(text, []).append(slope.place)
    return tuple(f"slip slope ({', '.join(places)}): {text}" for text, places in said.items())


def _remarks(slope: SlopeSummary) -> Iterator[str]:
    seconds = slope.seconds
    driven = seconds["estimating"] + seconds["slope_frozen"]
    judged = driven + seconds["blind"]
    if judged >= LEAST:
        if seconds["blind"] > MOST * judged and slope.beta is not None:
            yield (
                "blind for most of the drive, both axles slip alike: another torque split or an active excitation of "
                "the axle forces would show it"
            )
        elif seconds["blind"] > MOST * judged:
            yield "blind for most of the drive: hardly any traction on the driven wheels"
        elif seconds["estimating"] < (1.0 - MOST) * judged:
            yield (
                "traction too even for most of the drive to distinguish slope from radius; only sudden changes under a "
                "traction of 0.03 and more are found"
            )
    # more changes than a road has: something else is in the slip or in the torque
    if slope.alarms >= 4 and driven >= 60.0 and slope.alarms * 600.0 > RESTLESS * driven:
        yield (
            f"{slope.alarms} changes in {driven / 60.0:.0f} min of driving, more than a road has: brake torque that is "
            "not in the log, late or wrongly shared torque, wheel speeds that are noisy or swapped?"
        )
    # a slope that is low from end to end: then the reference is in doubt, not the road
    if slope.judged_s >= 2.0 * LEAST and slope.dropped_s >= ALWAYS * slope.judged_s:
        yield (
            f"below half of the dry slope of {slope.reference:.0f} for {slope.dropped_s / slope.judged_s:.0%} of the "
            "time judged: is this the tyre that the vehicle file or the history means?"
        )
    # slip that hardly grows with the traction: then no drop can be found either
    if slope.stiff_s >= max(LEAST, TOO_STIFF * driven):
        yield (
            f"stiffer than any tyre for {slope.stiff_s:.0f} s, so that no drop can be found there: braking that "
            "neither torque nor brake_pressure shows, a wrong drivetrain, or swapped wheels?"
        )
    # a drive that is its own reference cannot know what it began on
    if slope.reference_from == "this drive" and slope.judged_s >= LEAST:
        yield (
            f"the dry slope of {slope.reference:.0f} is this drive's own: if it began on a slippery road, nothing "
            "shows. A --history of other drives of this car would show it"
        )
