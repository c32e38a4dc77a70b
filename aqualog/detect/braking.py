"""Find where a braking force acts on a wheel, from the best signals in the log."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from aqualog.core.compiled import compiled, plain
from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.features.smoothing import UNSET, gain
from aqualog.physics.load import G

__all__ = [
    "A_BRAKING", "BRAKE_PRESSURE", "HOLD", "LIGHT", "TRACTION", "UNLOGGED", "BrakeWatch", "began_free", "hold_on",
    "is_braking", "lasting",
]  # fmt: skip

A_BRAKING = -2.0  # [m/s^2] neither rolling, air nor water resistance decelerates a car more than that
BRAKE_PRESSURE = 3e5  # [Pa] above the offset and residual pressure of a released brake
TRACTION = -0.10  # [-] wheel torque over radius and load; lifting off stays above: it is what a driver does on water
ONE_SIDED, RELEASED = -0.05, -0.02  # [-] of one wheel of an axle and of the other one where stability control brakes
UNLOGGED = "unlogged"  # beside the wheels: a light braking that the torques do not know
LIGHT = 0.5e5  # [Pa] above what the released brake of this car shows
HOLDS = 0.7  # of what slows the car down by pressure: a torque that knows the brakes explains that much (K)
KNOWN = 1e10  # [Pa^2 s] one second of braking with 1 bar more tells whether torques know the brakes
TAU_RELEASED = 1.0  # [s]
HOLD = 0.3  # [s] brakes and wheels need this long to settle after release


def is_braking(
    a_kin: FloatArray, brake_pressure: FloatArray | None, torque_coefficient: FloatArray | None
) -> BoolArray:
    """Flag samples with a negative force: by brake pressure if the log has it, else by deceleration and torque. (n,)

    `a_kin` is the kinematic acceleration, low-passed [m/s²], `brake_pressure` [Pa], `torque_coefficient` the net wheel
    torque over radius and load [-]. NaN compares as not braking.

    Thesis: "without negative tyre forces" of criteria 1 and 2 in section 2.5 (C65, C66).
    """
    with np.errstate(invalid="ignore"):
        braking = a_kin < A_BRAKING
        if torque_coefficient is not None:
            braking |= torque_coefficient < TRACTION
        if brake_pressure is not None:
            # the brake's own sensor decides where it has a value
            braking = np.where(np.isnan(brake_pressure), braking, brake_pressure > BRAKE_PRESSURE)
    return braking


@compiled
def _hold_on(samples, left, x):  # type: ignore[no-untyped-def]
    out = np.empty_like(x)
    for i in range(x.size):
        left = samples if x[i] else max(left - 1, 0)
        out[i] = x[i] or left > 0
    return out, left


def hold_on(x: BoolArray, state: int, *, seconds: float, dt: float) -> tuple[BoolArray, int]:
    """Keep a bit (n,) on for so many seconds after it goes off; `dt` is the sample time. [s]

    `state`, samples left: 0, or the return value of the call before. Returns the bits and the state.
    """
    y, left = _hold_on(max(1, round(seconds / dt)), state, x)
    return y, int(left)


@compiled
def _lasting(least, run, x, stays):  # type: ignore[no-untyped-def]
    out = np.empty_like(x)
    for i in range(x.size):
        if x[i]:
            run += 1
        elif run < least or not stays[i]:
            run = 0
        out[i] = run >= least
    return out, run


def lasting(x: BoolArray, state: int, *, least: int, stays: BoolArray | None = None) -> tuple[BoolArray, int]:
    """Keep a bit off until it has been on for `least` samples in a row, then on while it is or `stays` (n,) is.

    Arguments and result else as `hold_on`.
    """
    y, run = _lasting(least, state, x, x if stays is None else stays)
    return y, int(run)


@compiled
def _began_free(was_active, free, active, braking):  # type: ignore[no-untyped-def]
    out = np.zeros_like(active)
    for i in range(active.size):
        if active[i] and not was_active:
            free = not braking[i]
        was_active = active[i]
        out[i] = was_active and free
    return out, was_active, free


def began_free(active: BoolArray, braking: BoolArray, state: tuple[bool, bool]) -> tuple[BoolArray, tuple[bool, bool]]:
    """Keep detections (n,) that began without a braking force; braking after that does not undo them.

    `state` is active before and began free: (False, False), or the return value of the call before.
    """
    y, was_active, free = _began_free(*state, active, braking)
    return y, (bool(was_active), bool(free))


@compiled
def _unlogged(rolling, gain, dt, s, pressure, push, left):  # type: ignore[no-untyped-def]
    out = np.zeros(pressure.size, np.bool_)
    for i in range(pressure.size):
        p, a, r = pressure[i], push[i], left[i]
        if math.isnan(p + a + r):
            continue
        if a > rolling:  # nobody brakes who drives
            s[0] = p if math.isnan(s[0]) else s[0] + gain * (p - s[0])
        p -= s[0]
        if a < 0.0 and not math.isnan(p):
            s[1] += dt
            s[2] += dt * p
            s[3] += dt * p * p
            for k, x in ((4, a), (6, r)):
                s[k] += dt * x
                s[k + 1] += dt * p * x
        square = s[3] * s[1] - s[2] * s[2]
        by_torque, beside = s[2] * s[4] - s[1] * s[5], s[1] * s[7] - s[2] * s[6]
        holds = square > KNOWN * s[1] and by_torque > HOLDS * (by_torque + beside)
        out[i] = p > LIGHT and not holds
    return out


class BrakeWatch:
    """Find the wheels with a braking force, with its after-effects."""

    def __init__(self, vehicle: Vehicle, dt: float) -> None:
        self._vehicle = vehicle
        self._dt = dt
        self._left = dict.fromkeys((*WHEELS, UNLOGGED), 0)
        # pressure of the released brake; of the overrun: time, pressure, its square; push, resistance, both by pressure
        self._pressed = np.array([UNSET, *[0.0] * 7])

    def push(self, f: Mapping[str, FloatArray], columns: Mapping[str, FloatArray]) -> dict[str, BoolArray]:
        """Return bits (n,) by wheel, and of `UNLOGGED`; `columns` holds the torques that the drive has."""
        weight = 0.25 * self._vehicle.mass * G
        known = [w for w in WHEELS if f"torque_{w}" in columns]
        shares = {w: columns[f"torque_{w}"] / (self._vehicle.arm(w) * weight) for w in known}
        alone = _one_sided(shares) if len(shares) == len(WHEELS) else None
        result = {}
        for wheel in WHEELS:
            bits = is_braking(f["a_kin_slow"], f.get("brake_pressure"), shares.get(wheel))
            if alone is not None:
                bits = bits & ~(alone & (shares[wheel] > RELEASED))
            result[wheel], self._left[wheel] = hold_on(bits, self._left[wheel], seconds=HOLD, dt=self._dt)
        result[UNLOGGED], self._left[UNLOGGED] = hold_on(
            self._light(f, columns), self._left[UNLOGGED], seconds=HOLD, dt=self._dt
        )
        return result

    def _light(self, f: Mapping[str, FloatArray], columns: Mapping[str, FloatArray]) -> BoolArray:
        """Where more than the pressure of the released brake slows the car down, and maybe no torque says so. (n,)

        On the overrun the torques fall with the pressure if they know the brakes; else the resistance grows with it.
        """
        vehicle, pressure = self._vehicle, f.get("brake_pressure")
        if pressure is None or "delta_a_x" not in f:
            return np.zeros(f["a_kin_slow"].size, dtype=bool)
        push = sum(columns[f"torque_{w}"] / vehicle.arm(w) for w in WHEELS if f"torque_{w}" in columns) / vehicle.mass
        self._pressed = self._pressed.copy()
        found = _unlogged(
            vehicle.rolling_resistance * G, gain(TAU_RELEASED, self._dt), self._dt, self._pressed,
            *plain(pressure, push, f["delta_a_x"]),
        )  # fmt: skip
        return np.asarray(found)


def _one_sided(shares: Mapping[str, FloatArray]) -> BoolArray:
    """Where one wheel of an axle is braked and the other one is not (n,).

    A driver brakes both: this is stability control, whose own pressure a log may have, and torques that know brakes.
    """
    axles = ((shares[f"{axle}l"], shares[f"{axle}r"]) for axle in "fr")
    found = [(np.minimum(*pair) < ONE_SIDED) & (np.maximum(*pair) > RELEASED) for pair in axles]
    return np.asarray(found[0] | found[1])
