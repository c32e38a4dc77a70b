"""Do the signals of a drive fit each other? Wrong units and signs show as numbers that cannot be."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from aqualog.notation import AXLES, WHEELS
from aqualog.types import FloatArray, Signals
from aqualog.vehicle import Vehicle

__all__ = ["implausible"]

WINDOW = 0.5  # [s] over which changes are compared: longer than latencies, shorter than manoeuvres
LEAST_CORRELATION = 0.6
LEAST_WINDOWS = 40
RATIO = 1.8  # between twice the noise of such a ratio and the 2.2 of mph, the 3.6 of km/h, the 9.81 of g
LEAST_DRIVE = 50.0  # [N m] of an axle, nine tenths of the drive below it: less tells no drivetrain
RESISTANCE = 0.3  # [m/s^2] median over a drive: more than any stretch of dry road makes


def implausible(signals: Signals, features: Mapping[str, FloatArray], vehicle: Vehicle) -> tuple[str, ...]:
    """Sentences on what does not fit, for the user to check.

    Parameters
    ----------
    signals : Signals
    features : mapping name -> array (n,)
        Of the whole drive.
    vehicle : Vehicle

    Returns
    -------
    tuple of str
        Empty where all fits or too little moved to tell.
    """
    step = max(1, round(WINDOW / signals.dt))
    wheels = {
        w: signals.array(f"omega_{w}")[::step] * vehicle.r_e(w) for w in WHEELS if f"omega_{w}" in signals.symbols
    }
    notes = [
        *_acceleration(signals, wheels, step), *_yaw(signals, wheels, step), *_resistance(features),
        *_drivetrain(signals, vehicle),
    ]  # fmt: skip
    return tuple(notes)


def _acceleration(signals: Signals, wheels: Mapping[str, FloatArray], step: int) -> list[str]:
    a_x = _means(signals.array("a_x"), step)
    if not wheels or a_x.size < LEAST_WINDOWS:
        return []
    speed = np.mean(list(wheels.values()), axis=0)
    change = np.diff(speed) / (step * signals.dt)
    n = min(change.size, a_x.size)
    good = np.isfinite(change[:n]) & np.isfinite(a_x[:n])
    x, y = a_x[:n][good], change[:n][good]
    r = _correlation(x, y)
    if abs(r) < LEAST_CORRELATION:
        return []
    if r < 0:
        return ["a_x has the opposite sign of the wheels' acceleration: scale = -1 in the signal map?"]
    ratio = float(y.std() / x.std())
    if 1 / RATIO < ratio < RATIO:
        return []
    return [f"wheel speeds change {ratio:.1f} times as much as a_x says: check the units of both (km/h, g)"]


def _yaw(signals: Signals, wheels: Mapping[str, FloatArray], step: int) -> list[str]:
    yaw_rate = signals.array("yaw_rate")[::step]
    found = [
        _correlation(*_both(yaw_rate, wheels[right] - wheels[left]))
        for left, right in (("fl", "fr"), ("rl", "rr"))
        if left in wheels and right in wheels
    ]
    strongest = max(found, key=abs, default=0.0)
    if strongest > -LEAST_CORRELATION:
        return []
    return ["yaw_rate has the opposite sign of the wheels' difference: scale = -1 in the signal map?"]


def _resistance(features: Mapping[str, FloatArray]) -> list[str]:
    if "delta_a_x" not in features:
        return []
    measure = features["delta_a_x"]
    with np.errstate(invalid="ignore"):
        measure = measure[np.isfinite(measure) & (features["v_x_hat"] > 14.0) & (features["a_kin_slow"] > -1.0)]
    if measure.size < 500 or abs(float(np.median(measure))) < RESISTANCE:
        return []
    return [
        f"the resistance measure lies at {np.median(measure):+.2f} m/s^2 in the middle of this drive: check mass, "
        "wheel torque (gear ratio, sign, unit) and the offset of a_x before believing the resistance detector"
    ]


def _drivetrain(signals: Signals, vehicle: Vehicle) -> list[str]:
    """Which axles the torques drive, against which the vehicle file says."""
    drive = {}
    for axle, wheels in AXLES.items():
        known = [signals.array(f"torque_{w}") for w in wheels if f"torque_{w}" in signals.symbols]
        sums = np.sum(known, axis=0) if known else np.zeros(0)
        sums = sums[np.isfinite(sums)]
        drive[axle] = float(np.quantile(sums, 0.9)) if sums.size >= 500 else float("nan")
    most = max((v for v in drive.values() if v == v), default=0.0)
    if most < LEAST_DRIVE:
        return []
    name = {"f": "front", "r": "rear"}
    for axle, torque in drive.items():
        is_driven = f"{axle}l" in vehicle.driven
        if not is_driven and torque > 0.1 * most:
            return [
                f"the vehicle file says {vehicle.drivetrain}, but the {name[axle]} wheels are driven with up to "
                f'{torque:.0f} N m: drivetrain = "awd"?'
            ]
        if is_driven and torque < 0.02 * most:
            return [
                f"the vehicle file says {vehicle.drivetrain}, but the {name[axle]} wheels are never driven: "
                f'drivetrain = "{"rwd" if axle == "f" else "fwd"}"?'
            ]
    return []


def _means(x: FloatArray, step: int) -> FloatArray:
    whole = x[: x.size // step * step].reshape(-1, step)
    return np.asarray(whole.mean(axis=1), dtype=np.float64)


def _both(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    good = np.isfinite(x) & np.isfinite(y)
    return x[good], y[good]


def _correlation(x: FloatArray, y: FloatArray) -> float:
    if x.size < LEAST_WINDOWS or x.std() == 0.0 or y.std() == 0.0:
        return 0.0
    return float(np.corrcoef(x, y)[0, 1])
