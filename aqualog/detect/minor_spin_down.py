"""Detect minor spin-downs of one side by the variance of the wheel acceleration difference, front against rear."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from aqualog.core.compiled import compiled
from aqualog.core.notation import SIDES
from aqualog.core.records import BoolArray, FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.detect.detector import Detector, Needs, Output, Scene, Setup, missing_drivetrain, missing_wheels, too_slow
from aqualog.detect.ewvar import EwvarParams, from_seconds
from aqualog.detect.ewvar import step as ewvar_step
from aqualog.detect.spin import wheel_evidence

__all__ = [
    "A_Y_MINOR", "MINOR_SPIN_DOWN", "MIN_RATE", "VAR_MIN", "MinorParams", "MinorState", "MinorWatch", "initial_state",
    "scan",
]  # fmt: skip

THRESHOLD = 1.0  # [(m/s^2)^2]
VAR_MIN = 1.2  # of the threshold: the wheel's own variance
MIN_RATE = 20.0  # [Hz] a minor spin-down lasts 50 to 300 ms; slower wheel speeds show kerbs and noise only
A_Y_MINOR = 4.0  # [m/s^2] beyond, the inner wheels lose load enough to slow down on dry road too


class MinorParams(NamedTuple):
    """Tuning in physical units; defaults in `make`."""

    ew: EwvarParams
    var_min: float  # [(m/s^2)^2] of the watched wheel itself
    delta_min: float  # [(m/s^2)^2] of the difference to the other axle
    share: float  # of the wheel's variance that the other axle must not have: bumps shake both (C33)
    off_share: float  # ends when the difference or the one-sidedness falls below this share of its limit
    one_sided: float  # mean square of the speed difference below zero over that above: bumps swing a wheel both ways
    v_noise: float  # [m/s] added to the latter, so that noise alone is not one-sided
    v_min: float  # [m/s]
    warm_up: float  # [s] after braking, until the moments mean something
    quiet: float  # [s] ends after this time without an acceleration difference beyond sqrt(delta_min)
    dt: float  # [s]

    @staticmethod
    def make(dt: float, threshold: float = THRESHOLD) -> MinorParams:
        """Return defaults: 0.5 s of memory, 1.2 (m/s²)² of the wheel, 1.0 of the difference, 8 to 1 below zero."""
        return MinorParams(
            from_seconds(0.5, 0.5, dt), VAR_MIN * threshold, threshold, 0.7, 0.5, 8.0, 0.035, 8.0, 0.5, 0.6, dt
        )


class MinorState(NamedTuple):
    """Moving moments of both wheels' accelerations, mean squares of the speed difference below and above zero, ages."""

    mean: float
    var: float
    mean_other: float
    var_other: float
    below: float
    above: float
    age: float
    still: float
    active: bool


RADIUS_KNOWN = 2.5  # [s] more after the start: until the radius correction has found the wheels' offsets


def initial_state() -> MinorState:
    """Return the state without samples. The age starts below zero: a constant offset of the speed is one-sided too."""
    return MinorState(math.nan, 0.0, math.nan, 0.0, 0.0, 0.0, -RADIUS_KNOWN, math.inf, active=False)


@compiled
def _anew(age):  # type: ignore[no-untyped-def]
    return MinorState(math.nan, 0.0, math.nan, 0.0, 0.0, 0.0, min(age, 0.0), math.inf, False)  # noqa: FBT003


@compiled
def _step(p, s, a, a_other, dv, v, allowed):  # type: ignore[no-untyped-def]
    if math.isnan(a) or math.isnan(a_other) or math.isnan(dv) or math.isnan(v):
        return s, math.nan, math.nan, False
    if not allowed or v < p.v_min:
        # a brake makes its own variance on the front wheels; what it leaves must not count after its release
        return _anew(s.age), 0.0, 0.0, False
    still = 0.0 if a * a > p.delta_min else s.still + p.dt
    mean, var = ewvar_step(p.ew, s.mean, s.var, a)
    mean_other, var_other = ewvar_step(p.ew, s.mean_other, s.var_other, a_other)
    beta = p.ew.beta
    below = (1.0 - beta) * s.below + beta * min(dv, 0.0) ** 2
    above = (1.0 - beta) * s.above + beta * max(dv, 0.0) ** 2
    one_sided = below / (above + p.v_noise * p.v_noise)
    shown, delta = var, var - var_other
    active = s.active
    if active:
        is_on = delta > p.off_share * p.delta_min and one_sided > p.off_share * p.one_sided
        if not is_on or still > p.quiet:
            # one large spin-down leaves moments that take seconds to fade; the wheel itself is calm again
            active = False
            mean, var, below, above = a, 0.0, 0.0, 0.0
    elif s.age > p.warm_up and still < p.quiet:
        active = var > p.var_min and delta > max(p.delta_min, p.share * var) and one_sided > p.one_sided
    state = MinorState(mean, var, mean_other, var_other, below, above, s.age + p.dt, still, active)
    return state, delta, shown, active


@compiled
def _scan(p, s, a, a_other, dv, v, allowed):  # type: ignore[no-untyped-def]
    delta = np.empty_like(a)
    var = np.empty_like(a)
    bits = np.zeros(a.size, dtype=np.bool_)
    for i in range(a.size):
        s, delta[i], var[i], bits[i] = _step(p, s, a[i], a_other[i], dv[i], v[i], allowed[i])
    return delta, var, bits, s


def scan(
    p: MinorParams,
    state: MinorState,
    a_w_delta: FloatArray,
    a_w_delta_other: FloatArray,
    v_w_delta: FloatArray,
    v_x: FloatArray,
    allowed: BoolArray,
) -> tuple[FloatArray, FloatArray, BoolArray, MinorState]:
    """Run the minor spin-down detector of one vehicle side over a drive or a piece of one.

    Parameters
    ----------
    a_w_delta, a_w_delta_other : array (n,)
        Acceleration differences of the watched (non-driven) wheel and of the other one on the same side. [m/s²]
    v_w_delta : array (n,)
        Speed difference of the watched wheel, less the slow part that all wheels share. [m/s]
    v_x : array (n,)
        Velocity. [m/s]
    allowed : bool array (n,)
        False while a negative (braking) force acts on the watched wheel.

    Returns
    -------
    delta_var : array (n,)
        Variance of the watched wheel minus that of the other one. The road's roughness acts on both wheels and drops
        out. [(m/s²)²]
    var : array (n,)
        Variance of the watched wheel. [(m/s²)^2]
    active : bool array (n,)
        Begins when variance and difference exceed their limits (the difference also 0.7 of the variance) and the
        wheel's speed lies eight times more below the vehicle's than above it (mean squares over the same memory).
        Ends when the difference or that ratio falls below half its limit, 0.6 s after the last acceleration
        difference beyond 1 m/s², or on braking. After braking the moments restart and no detection begins for 0.5 s,
        after the start for 3 s. NaN in any input: state held, statistic NaN, no detection.
    state : MinorState

    Thesis: Eq. (2.5), (2.6), (2.8) (C30-C33, E4); criterion 2 of section 2.5 (C66).
    """
    delta, var, bits, last = _scan(p, state, a_w_delta, a_w_delta_other, v_w_delta, v_x, allowed)
    final: MinorState = last._replace(active=bool(last.active))
    return delta, var, bits, final


class MinorWatch:
    """Minor spin-downs of the watched axle, side by side.

    Features: the variances of all wheels that are compared, `variance_fl` ... [(m/s²)^2].
    """

    def __init__(self, setup: Setup) -> None:
        self._setup = setup
        self._axle = setup.vehicle.watched_axle
        self._params = MinorParams.make(setup.dt, setup.threshold)
        self._states = {s: initial_state() for s in SIDES}

    def push(self, scene: Scene) -> Output:
        """Take the next piece: a track per side. [(m/s²)^2]"""
        f = scene.f
        found = []
        features: dict[str, FloatArray] = {}
        with np.errstate(invalid="ignore"):
            is_upright = ~(np.abs(f["a_y_slow"]) > A_Y_MINOR)
        for side, pair in SIDES.items():
            watched = next(w for w in pair if w[0] == self._axle)
            other = next(w for w in pair if w[0] != self._axle)
            if watched not in scene.wheels or other not in scene.wheels:
                continue
            delta, var, bits, self._states[side] = scan(
                self._params, self._states[side], f[f"a_w_delta_{watched}"], f[f"a_w_delta_{other}"],
                f[f"v_w_delta_{watched}"] - f["v_w_delta_common"], f["v_x_hat"],
                ~scene.braking[watched] & is_upright,
            )  # fmt: skip
            features |= {f"variance_{watched}": var, f"variance_{other}": var - delta}
            evidence = {**wheel_evidence(scene, watched, f.get(f"mu_{watched}")), "variance_max": ("max", var)}
            found.append((self._setup.track(delta, bits, wheel=watched), evidence))
        return Output(tuple(found), features)


def _needs(vehicle: Vehicle, have: Collection[str], rate_hz: float) -> Needs:
    omega = missing_wheels(have)
    has_side = any(not missing_wheels(have, wheels) for wheels in SIDES.values())
    wheels = () if has_side else omega
    return Needs((*wheels, *missing_drivetrain(vehicle), *too_slow(rate_hz, MIN_RATE)), tuple(omega))


MINOR_SPIN_DOWN = Detector(
    name="minor_spin_down",
    title="Minor spin-down",
    unit="(m/s^2)^2",
    meaning="variance of a wheel's acceleration difference beyond that of the other axle",
    statistic="variance of wheel acceleration, watched axle minus the other one",
    threshold=THRESHOLD,
    needs=_needs,
    start=MinorWatch,
)
