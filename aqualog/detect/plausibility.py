"""Check whether the signals of a drive fit each other: wrong units and signs give impossible numbers."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping

import numpy as np

from aqualog.core.notation import AXLES, WHEELS
from aqualog.core.records import FloatArray
from aqualog.core.vehicle import Vehicle

__all__ = ["Plausibility"]

WINDOW = 0.5  # [s] over which changes are compared: longer than latencies, shorter than manoeuvres
SAMPLE = 0.1  # [s] between the samples of which a median is taken
LEAST_CORRELATION = 0.6
LEAST_WINDOWS = 40
LEAST_SAMPLES = 50
MOST = 1 << 17  # samples of which a median is taken
RATIO = 1.8  # between twice the noise of such a ratio and the 2.2 of mph, the 3.6 of km/h, the 9.81 of g
MOVING = 3.0  # [m/s] from which a ratio of speeds means something
LEAST_DRIVE = 50.0  # [N m] of an axle, nine tenths of the drive below it: less shows no drivetrain
RESISTANCE = 0.3  # [m/s^2] median over a drive: more than any stretch of dry road makes


class _Sampled:
    """Return every k-th value of a signal, with k such that a drive of any length leaves at most `MOST` of them."""

    def __init__(self) -> None:
        self._stride = 1
        self._n = 0
        self._parts: list[FloatArray] = []

    def push(self, x: FloatArray) -> None:
        self._parts.append(x[-self._n % self._stride :: self._stride].copy())
        self._n += x.size
        while -(-self._n // self._stride) > MOST:
            self._stride *= 2
            self._parts = [np.concatenate(self._parts)[::2].copy()]

    def finite(self) -> FloatArray:
        x = np.concatenate(self._parts) if self._parts else np.zeros(0)
        return np.asarray(x[np.isfinite(x)])


class Plausibility:
    """Gather the values of a drive that are compared: a few for each half second, piece by piece.

    Parameters
    ----------
    available : collection of str
        Symbols of the drive.
    dt : float
        [s]
    """

    def __init__(self, available: Collection[str], vehicle: Vehicle, dt: float) -> None:
        self._vehicle = vehicle
        self._dt = dt
        self._step = max(1, round(WINDOW / dt))
        self._every = max(1, round(SAMPLE / dt))
        self._available = frozenset(available)
        self._n = 0
        self._rest: FloatArray = np.zeros(0)
        self._kept: dict[str, list[FloatArray]] = {}
        self._sampled: defaultdict[str, _Sampled] = defaultdict(_Sampled)

    def push(self, columns: Mapping[str, FloatArray], features: Mapping[str, FloatArray]) -> None:
        """Take the signals and features of the next piece, arrays (n,)."""
        n = next(iter(columns.values())).size
        own = [s for s in (*(f"omega_{w}" for w in WHEELS), "yaw_rate", "v_x") if s in self._available]
        for s in own:
            self._keep(s, columns[s][-self._n % self._step :: self._step])
        if "a_x" in self._available:
            a_x = np.concatenate([self._rest, columns["a_x"]])
            whole = a_x.size // self._step * self._step
            self._keep("a_x", a_x[:whole].reshape(-1, self._step).mean(axis=1))
            self._rest = a_x[whole:].copy()
        every = slice(-self._n % self._every, None, self._every)
        for axle, wheels in AXLES.items():
            known = [columns[f"torque_{w}"][every] for w in wheels if f"torque_{w}" in self._available]
            if known:
                self._sampled[f"torque_{axle}"].push(np.sum(known, axis=0))
        if "delta_a_x" in features:
            x, v, a = (features[f][every] for f in ("delta_a_x", "v_x_hat", "a_kin_slow"))
            with np.errstate(invalid="ignore"):
                self._sampled["delta_a_x"].push(np.where((v > 14.0) & (a > -1.0), x, np.nan))
        self._n += n

    def _keep(self, name: str, x: FloatArray) -> None:
        self._kept.setdefault(name, []).append(x.copy())

    def _whole(self, name: str) -> FloatArray:
        parts = self._kept.get(name)
        return np.concatenate(parts) if parts else np.zeros(0)

    def notes(self) -> tuple[str, ...]:
        """Return sentences on what does not fit, for the user to check; empty if all fits or too little moved."""
        wheels = {
            w: self._whole(f"omega_{w}") * self._vehicle.r_e(w) for w in WHEELS if f"omega_{w}" in self._available
        }
        drive = {a: self._sampled[f"torque_{a}"].finite() for a in AXLES}
        return (
            *_speeds(self._whole("v_x"), wheels),
            *_acceleration(self._whole("a_x"), wheels, self._step * self._dt),
            *_yaw(self._whole("yaw_rate"), wheels),
            *_resistance(self._sampled["delta_a_x"].finite()),
            *_drivetrain(drive, self._vehicle),
        )


def _speeds(v_x: FloatArray, wheels: Mapping[str, FloatArray]) -> list[str]:
    """Report wheels that always turn at another speed than the others, else all of them against the car's speed."""
    if not wheels:
        return []
    with np.errstate(invalid="ignore"):
        common = np.median(list(wheels.values()), axis=0)
    ratios = {w: _ratio(x, common) for w, x in wheels.items()} if len(wheels) > 2 else {}
    odd = [f"omega_{w} is {r:.2g} times" for w, r in ratios.items() if not 1 / RATIO < r < RATIO]
    if odd:
        return [f"{', '.join(odd)} the speed of the other wheels: check its unit (km/h, m/s, rad/s) and scale"]
    ratio = _ratio(common, v_x) if v_x.size else 1.0
    if 1 / RATIO < ratio < RATIO:
        return []
    return [f"wheel speeds times radius are {ratio:.2g} times v_x: check the units of both (km/h, m/s, rad/s)"]


def _ratio(x: FloatArray, y: FloatArray) -> float:
    """Return the median of x over y where both are known and the faster one moves; 1 where too few do."""
    with np.errstate(invalid="ignore"):
        good = (np.maximum(x, y) > MOVING) & (np.minimum(x, y) > 0.0)
    return float(np.median(x[good] / y[good])) if int(good.sum()) >= LEAST_WINDOWS else 1.0


def _acceleration(a_x: FloatArray, wheels: Mapping[str, FloatArray], step_s: float) -> list[str]:
    if not wheels or a_x.size < LEAST_WINDOWS:
        return []
    speed = np.mean(list(wheels.values()), axis=0)
    change = np.diff(speed) / step_s
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
    return [f"wheel speeds change {ratio:.1f} times as fast as a_x says: check the units of both (km/h, g)"]


def _yaw(yaw_rate: FloatArray, wheels: Mapping[str, FloatArray]) -> list[str]:
    found = [
        _correlation(*_both(yaw_rate, wheels[right] - wheels[left]))
        for left, right in (("fl", "fr"), ("rl", "rr"))
        if left in wheels and right in wheels and yaw_rate.size
    ]
    strongest = max(found, key=abs, default=0.0)
    if strongest > -LEAST_CORRELATION:
        return []
    return ["yaw_rate has the opposite sign of the wheels' difference: scale = -1 in the signal map?"]


def _resistance(measure: FloatArray) -> list[str]:
    if measure.size < LEAST_SAMPLES or abs(float(np.median(measure))) < RESISTANCE:
        return []
    return [
        f"the resistance measure lies at {np.median(measure):+.2f} m/s² in the middle of this drive: check mass, "
        "wheel torque (gear ratio, sign, unit) and the offset of a_x before believing the resistance detector"
    ]


def _drivetrain(sums: Mapping[str, FloatArray], vehicle: Vehicle) -> list[str]:
    """Compare the axles that the torques drive with those in the vehicle file."""
    drive = {a: float(np.quantile(x, 0.9)) if x.size >= LEAST_SAMPLES else float("nan") for a, x in sums.items()}
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


def _both(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    good = np.isfinite(x) & np.isfinite(y)
    return x[good], y[good]


def _correlation(x: FloatArray, y: FloatArray) -> float:
    if x.size < LEAST_WINDOWS or x.std() == 0.0 or y.std() == 0.0:
        return 0.0
    return float(np.corrcoef(x, y)[0, 1])
