"""Detect large spin-downs and spin-ups of one wheel: CUSUM of the acceleration difference with the sign of the speed
difference.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from aqualog.core.compiled import compiled
from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.detect.cusum import CusumParams
from aqualog.detect.cusum import step as cusum_step
from aqualog.detect.detector import (
    Detector,
    Needs,
    Output,
    Scene,
    Setup,
    missing_wheels,
    too_slow,
    traction,
)
from aqualog.features.stream import Features
from aqualog.physics.slip import slip_of_wheel_speed

__all__ = [
    "HELD_BACK", "HELD_S", "LOST_S", "MIN_RATE", "MU_FULL", "MU_SPIN_UP", "SLIP_FULL", "SPIN_DOWN", "SpinParams",
    "SpinState", "SpinWatch", "has_lost_traction", "initial_state", "scan", "spins_round", "wheel_evidence",
]  # fmt: skip

THRESHOLD = 0.6  # [m/s]
MIN_RATE = 5.0  # [Hz] a full spin-down lasts half a second and more
HELD_S = 0.15  # [s] for which the traction stays below that: on snow it passes there for a moment (K)
MU_SPIN_UP = 0.07  # [-] thesis 2.1: above it, spin-up is that of another slippery road (C27)
SIDEWAYS = 3.0  # [m/s^2] of drift: a car that spins round, whose tyres hold it sideways and so little ahead (K)
SLIP_FULL = -0.25  # [-] a wheel that has lost a quarter of its speed has lost the road
HELD_BACK = "held_back"  # where something holds the car back, as later detectors find it
MU_FULL = 0.02  # [-] what a spinning driven wheel still transmits at full aquaplaning
LOST_S = 0.06 - 1e-9  # [s] for so long, twice the memory of wheel accelerations (C67)


class SpinParams(NamedTuple):
    """Tuning in physical units; the defaults of `make` are those of both detectors.

    `sign` is -1 for spin-down, +1 for spin-up. The speed difference must exceed max(v_abs, v_rel v_x).
    """

    cusum: CusumParams  # of sign * a_w_delta; threshold in m/s
    sign: float
    v_abs: float  # [m/s]
    v_rel: float
    v_min: float  # [m/s] below this speed wheel speed sensors and slip mean little
    slip_deep: float  # a wheel this far off begins an event without acceleration too, if it stays there
    t_deep: float  # [s] for so long: the acceleration may have been in a gap
    a_calm: float  # [m/s^2] a wheel that is but slightly off and does not accelerate for t_calm has a wrong radius
    t_calm: float  # [s]
    t_held: float  # [s] for which an alarm has to be allowed before it begins

    @staticmethod
    def make(sign: float, dt: float, threshold: float = THRESHOLD) -> SpinParams:
        """Return defaults: 3 m/s² drift, 0.6 m/s threshold, speed difference beyond 0.5 m/s and 3 %."""
        # the clamp does not follow a low threshold: joint detector 2 takes the sum up to 1.5 m/s
        sums = CusumParams(3.0, threshold, max(5.0 * threshold, 3.0), dt)
        return SpinParams(sums, sign, 0.5, 0.03, 5.0, 0.25, 0.1, 1.0, 1.0, HELD_S if sign > 0.0 else 0.0)


class SpinState(NamedTuple):
    """The sum [m/s], times of being far off, calm and allowed [s], and the detection bit."""

    g: float
    deep: float
    calm: float
    held: float
    active: bool


def initial_state() -> SpinState:
    """Nothing summed up."""
    return SpinState(0.0, 0.0, 0.0, 0.0, active=False)


@compiled
def _step(p, s, a, dv, v, allowed):  # type: ignore[no-untyped-def]
    """Process one sample; `a` and `dv` are positive in the direction of the event."""
    if math.isnan(a) or math.isnan(dv) or math.isnan(v):
        return s, math.nan, False
    if v < p.v_min:
        return SpinState(0.0, 0.0, 0.0, 0.0, False), 0.0, False  # noqa: FBT003
    limit = max(p.v_abs, p.v_rel * v)
    g = cusum_step(p.cusum, s.g, a)
    if dv < -0.25 * limit:
        # the wheel is on the other side of the vehicle's speed: this acceleration ends another event (thesis 2.4)
        g = 0.0
    deep = s.deep + p.cusum.dt if dv > p.slip_deep * v else 0.0
    calm = s.calm + p.cusum.dt if dv < 3.0 * limit and abs(a) < p.a_calm else 0.0
    held = s.held + p.cusum.dt if allowed else 0.0
    statistic = g
    active = s.active
    if active:
        if dv < 0.5 * limit or calm > p.t_calm:
            active = False
            g = 0.0
    elif allowed and held >= p.t_held and dv > limit and (g > p.cusum.h or deep > p.t_deep):
        active = True
    return SpinState(g, deep, calm, held, active), statistic, active


@compiled
def _scan(p, s, a, dv, v, allowed):  # type: ignore[no-untyped-def]
    out = np.empty_like(a)
    bits = np.zeros(a.size, dtype=np.bool_)
    for i in range(a.size):
        s, out[i], bits[i] = _step(p, s, p.sign * a[i], p.sign * dv[i], v[i], allowed[i])
    return out, bits, s


def scan(
    p: SpinParams, state: SpinState, a_w_delta: FloatArray, v_w_delta: FloatArray, v_x: FloatArray, allowed: BoolArray
) -> tuple[FloatArray, BoolArray, SpinState]:
    """Run the spin detector of one wheel over a drive or a piece of one.

    Parameters
    ----------
    a_w_delta : array (n,)
        Acceleration difference of wheel and vehicle. [m/s²]
    v_w_delta : array (n,)
        Speed difference of wheel and vehicle. [m/s]
    v_x : array (n,)
        Velocity; a coarse one suffices, since it only decides the sign. [m/s]
    allowed : bool array (n,)
        Where an alarm may begin, once that has held for `t_held` (spin-up: traction coefficient below 0.07, something
        holds the car back, and the car does not spin round).

    Returns
    -------
    g : array (n,)
        Sum of the acceleration difference beyond the drift: the speed lost (or gained) faster than a healthy wheel
        can. [m/s]
    active : bool array (n,)
        Begins when g > h and the speed difference exceeds its limit, or when a quarter of the speed has been missing
        for 0.1 s. Ends when the speed difference has fallen to half its limit, or stays within three limits without
        acceleration for 1 s (a wrong radius); then the sum restarts. NaN in any input: state held, statistic NaN,
        no detection.
    state : SpinState

    Thesis: Eq. (2.3), (2.4) and the text below them (C24-C27).
    """
    g, bits, last = _scan(p, state, a_w_delta, v_w_delta, v_x, allowed)
    final: SpinState = last._replace(active=bool(last.active))
    return g, bits, final


class SpinWatch:
    """Spin-downs of all wheels (`sign` -1), or spin-ups of the driven ones (+1)."""

    def __init__(self, setup: Setup, *, sign: float) -> None:
        self._setup = setup
        self._is_up = sign > 0.0
        self._wheels = setup.vehicle.driven if self._is_up else WHEELS
        self._params = SpinParams.make(sign, setup.dt, setup.threshold)
        self._states = {w: initial_state() for w in self._wheels}

    def push(self, scene: Scene) -> Output:
        """Take the next piece: a track per wheel. [m/s]"""
        f = scene.f
        found = []
        for wheel in (w for w in scene.wheels if w in self._wheels):
            # only a spinning driven wheel has the water's resistance booked on it
            mu = traction(f, wheel) if self._is_up else f.get(f"mu_{wheel}")
            allowed = np.ones(scene.size, dtype=bool)
            if self._is_up:
                allowed = has_lost_traction(f, wheel) & scene.shared.get(HELD_BACK, allowed)
            g, bits, self._states[wheel] = scan(
                self._params, self._states[wheel], f[f"a_w_delta_{wheel}"], f[f"v_w_delta_{wheel}"], f["v_x_hat"],
                allowed,
            )  # fmt: skip
            found.append((self._setup.track(g, bits, wheel=wheel), wheel_evidence(scene, wheel, mu)))
        return Output(tuple(found))


def has_lost_traction(f: Features, wheel: str) -> BoolArray:
    """Where a spin-up of a driven wheel may be water's (n,): little traction (C27), and no spinning car.

    Without torque every spin-up counts: cars on a dry track spin their wheels while they drift.
    """
    mu = traction(f, wheel)
    with np.errstate(invalid="ignore"):
        return np.ones(f["v_x_hat"].size, dtype=bool) if mu is None else ~spins_round(f) & (mu < MU_SPIN_UP)


def spins_round(f: Features, *, beyond: float = SIDEWAYS) -> BoolArray:
    """Where the car drifts (n,): a_y - v_x yaw_rate, the rate of its lateral velocity, is large. [m/s²]

    Beyond `G` no tyre turns the car: it rotates, and its wheels roll as they lie across the road. A yaw rate of exactly
    zero was never measured.
    """
    drift = f["a_y_slow"] - f["v_x_hat"] * f["yaw_rate_slow"]
    with np.errstate(invalid="ignore"):
        return np.asarray((np.abs(drift) > beyond) & (f["yaw_rate_slow"] != 0.0))


def wheel_evidence(scene: Scene, wheel: str, mu: FloatArray | None) -> dict[str, Any]:
    """Return evidence for an event of one wheel; `mu` its traction coefficient (n,), None if not known."""
    f, braking = scene.f, scene.braking[wheel]
    slip = slip_of_wheel_speed(f[f"v_w_{wheel}"], f["v_x_hat"])
    evidence: dict[str, Any] = {
        "v_x": ("first", f["v_x_hat"]),
        "slip_min": ("min", slip),
        "slip_max": ("max", slip),
        "a_w_delta_min": ("min", f[f"a_w_delta_{wheel}"]),
        "a_w_delta_max": ("max", f[f"a_w_delta_{wheel}"]),
        "braking": ("any", braking),
        "braking_at_start": ("at_start", braking),
    }
    if mu is None:
        return evidence
    lost = np.where(np.isnan(mu), np.nan, mu < MU_FULL)
    return {**evidence, "mu": ("first", mu), "mu_min": ("min", mu), "mu_lost": ("share", lost)}


def _needs_down(vehicle: Vehicle, have: Collection[str], rate_hz: float) -> Needs:
    omega = missing_wheels(have)
    # a single wheel has nothing to be compared with, unless there is a reference
    is_blind = len(omega) == len(WHEELS) or (len(omega) == len(WHEELS) - 1 and "v_x" not in have)
    return Needs((*(omega if is_blind else ()), *too_slow(rate_hz, MIN_RATE)), tuple(omega))


SPIN_DOWN = Detector(
    name="spin_down",
    title="Spin-down",
    unit="m/s",
    meaning="speed that a wheel loses faster than a healthy one can",
    statistic="speed a wheel lost faster than a healthy one can",
    threshold=THRESHOLD,
    needs=_needs_down,
    start=partial(SpinWatch, sign=-1.0),
    severity=lambda evidence: "full" if evidence.get("slip_min", 0.0) < SLIP_FULL else "partial",
)
