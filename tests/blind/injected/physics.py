"""What an effect would have done to the measured signals of a drive, were the same road driven at the same speed.

The motion is kept: velocity, yaw rate and lateral acceleration stay as measured, and the driver gives what torque that
motion needs. So each effect touches:

| effect | signals | approximation |
|---|---|---|
| payload_mass | torque, wheel speeds | torque += dm (f + g r_w) r / k; f: accelerometer over 0.4 s, so a slope counts; slip by the new traction over the slip slope times the new load; the place of the load is the centre of mass |
| aero_drag, head_wind | torque, wheel speeds | 0.5 rho dA v^2; 0.5 rho A ((v + w)^2 - v^2) |
| rolling_resistance | torque, wheel speeds | the driven wheels pull for all; every wheel's contact loses its own share |
| brake_drag | torque, wheel speeds | as rolling resistance, of one wheel or of all; not in the reported torque of that wheel |
| road_grade | accelerometer, torque, wheel speeds | constant, or hills over the way (`rms`, `wavelength`, `phase`); no shift of the load by the slope |
| torque_gain | torque | reported torque over the gain; the motion, so the true torque, stays |
| signal_delay | the signal, or all of `omega`, `torque` | cubic between samples, held at the ends |
| accelerometer_bias, _gain, _drift | accelerometer | |
| accelerometer_position | accelerometer | less the distance times the square of the yaw rate over 0.4 s |
| velocity_scale | v_x | |
| tyre_radius | speed of that wheel, torque of its axle | speed / (1 + delta); the same force needs the torque of a larger wheel |
| slip_stiffness | wheel speeds | slip of rolling contact over the gain; static loads with the shift by acceleration |
| tone_ring | speed of that wheel | once per turn over the angle turned, sampled at the log's rate: at 10 Hz it aliases as a log that samples would |

Forms that no effect has: `force_hump` over v_x, `force_step` for a time, `accelerometer_speed` (gain over speed),
`force_wave` along the way. Forces act as air drag does.

k is the file's torque gain: a log's torque is multiplied by it on reading. Torque is shared among the axles as the car
drives them, under braking as the reported torques of the axles are. Without a torque in the log only the slip changes.
The motion at which a wheel stands is left alone: no force below 1 m/s.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.core.vehicle import Vehicle
from tests.blind.injected.drives import WHEELS, Columns, Drive, filled

__all__ = ["EFFECTS", "UNKNOWN", "Unknown", "inject", "position", "shifted"]

G = 9.80665
V_LEAST = 1.0  # [m/s]
SMOOTH_S = 0.4
Values = Mapping[str, float]


class Unknown(NamedTuple):
    """How a form acts and over what: the truth of a case."""

    mechanism: str
    depends_on: tuple[str, ...]
    also: tuple[tuple[str, ...], ...] = ()


UNKNOWN: dict[str, Unknown] = {
    "force_hump": Unknown("force", ("v_x",)),
    "force_step": Unknown("force", ("t",)),
    "accelerometer_speed": Unknown("accelerometer", ("v_x", "a_x"), (("v_x",),)),
    "force_wave": Unknown("force", ("position",)),
}


def inject(drive: Drive, effect: str, where: str | None, values: Values) -> Drive:
    """The drive with an effect in it. The original is left as it is."""
    columns = EFFECTS[effect](drive, values, where)
    return Drive(drive.car, drive.trip, {**drive.columns, **columns}, drive.vehicle, drive.vehicle_file)


def speed(drive: Drive) -> FloatArray:
    """Speed of the car [m/s]: the reference, or the mean of the wheels that are not driven."""
    if "v_x" in drive.columns:
        return filled(drive.columns["v_x"])
    axle = "r" if drive.vehicle.drivetrain == "fwd" else "f"
    return np.mean([filled(drive.columns[f"omega_{w}"]) * drive.vehicle.r_e(w) for w in WHEELS if w[0] == axle], axis=0)


def position(drive: Drive) -> FloatArray:
    """Way driven [m]."""
    return np.concatenate([[0.0], np.cumsum(speed(drive))[:-1] * drive.dt])


def shifted(x: FloatArray, by: float) -> FloatArray:
    """Values `by` samples later: a cubic through four samples, held beyond the ends; a gap spreads by two samples."""
    place = np.clip(np.arange(x.size) - by, 0.0, x.size - 1.0)
    i = np.clip(place.astype(np.intp), 0, x.size - 2)
    u = place - i
    a, b, c, d = x[np.maximum(i - 1, 0)], x[i], x[i + 1], x[np.minimum(i + 2, x.size - 1)]
    out: FloatArray = b + 0.5 * u * (c - a + u * (2.0 * a - 5.0 * b + 4.0 * c - d + u * (3.0 * (b - c) + d - a)))
    return np.where(u == 0.0, b, out)


def _felt(drive: Drive) -> FloatArray:
    """Specific force along the car without the accelerometer's fastest noise [m/s²]."""
    return _quiet(drive, "a_x")


def _quiet(drive: Drive, signal: str) -> FloatArray:
    a = filled(drive.columns[signal])
    n = max(round(SMOOTH_S / drive.dt), 1)
    window = np.hanning(n + 2)[1:-1]
    padded = np.pad(a, (n // 2, n - 1 - n // 2), mode="edge")
    return np.convolve(padded, window / window.sum(), "valid")


def _share_rear(drive: Drive) -> FloatArray:
    """Share of a change of torque that goes to the rear axle."""
    car, c = drive.vehicle, drive.columns
    split = {"rwd": 1.0, "fwd": 0.0}.get(str(car.drivetrain), car.torque_split_rear)
    driven = np.full(c["t"].size, split)
    if not {"torque_f", "torque_r"} <= set(c):
        return driven
    front, rear = filled(c["torque_f"]), filled(c["torque_r"])
    braked = (front + rear < 0.0) & (front <= 0.0) & (rear <= 0.0)
    return np.where(braked, rear / np.minimum(front + rear, -1e-9), driven)


def _loads(drive: Drive) -> dict[str, FloatArray]:
    """Wheel loads [N]: static, and the shift by the felt acceleration."""
    car, a = drive.vehicle, _felt(drive)
    base = car.l_f + car.l_r
    shift = car.mass * a * car.h_cg / base
    front, rear = car.mass * G * car.l_r / base - shift, car.mass * G * car.l_f / base + shift
    return {w: np.maximum(0.5 * (front if w[0] == "f" else rear), 200.0) for w in WHEELS}


def _slope(car: Vehicle, wheel: str) -> float:
    return float(car.slip_slope_f if wheel[0] == "f" else car.slip_slope_r)


def _traction(drive: Drive) -> dict[str, FloatArray]:
    """Force at each contact [N], from the reported torques, or where there are none from the felt acceleration."""
    car, c = drive.vehicle, drive.columns
    share, loads = _share_rear(drive), _loads(drive)
    total = car.mass * (_felt(drive) + G * car.rolling_resistance) + _air(car, speed(drive), car.drag_area)
    out = {}
    for w in WHEELS:
        axle = f"torque_{w[0]}"
        if axle in c:
            force = 0.5 * filled(c[axle]) * car.torque_gain / car.arm(w)
        elif any(n.startswith("torque_") for n in c):
            force = np.zeros(c["t"].size)
        else:
            force = 0.5 * (share if w[0] == "r" else 1.0 - share) * total
        out[w] = force - car.rolling_resistance * loads[w]
    return out


def _air(car: Vehicle, v: FloatArray, area: float) -> FloatArray:
    return 0.5 * car.air_density * area * v * np.abs(v)


def _pulled(drive: Drive, force: FloatArray, own: Mapping[str, FloatArray] | None = None, load: float = 1.0) -> Columns:
    """What changes where the wheels have to pull `force` [N] more: reported torque and slip.

    `own`: resistance at each contact that is part of it; `load`: factor on all wheel loads.
    """
    car, c = drive.vehicle, drive.columns
    force = np.where(speed(drive) >= V_LEAST, force, 0.0)
    rear = _share_rear(drive)
    out: Columns = {}
    for axle, share in (("f", 1.0 - rear), ("r", rear)):
        if f"torque_{axle}" in c:
            out[f"torque_{axle}"] = c[f"torque_{axle}"] + force * share * car.arm(f"{axle}l") / car.torque_gain
    if "omega_fl" not in c:
        return out
    before, loads = _traction(drive), _loads(drive)
    for w in WHEELS:
        share = rear if w[0] == "r" else 1.0 - rear
        added = 0.5 * share * force - (own[w] if own is not None else 0.0)
        stiff = _slope(car, w) * loads[w]
        slip = (before[w] + added) / (stiff * load) - before[w] / stiff
        out[f"omega_{w}"] = c[f"omega_{w}"] * (1.0 + slip)
    return out


def _payload(d: Drive, v: Values, _: str | None) -> Columns:
    dm = v["delta_mass"]
    rolling = dm * G * d.vehicle.rolling_resistance
    own = {w: x / (d.vehicle.mass * G) * rolling for w, x in _loads(d).items()}
    return _pulled(d, dm * _felt(d) + rolling, own, load=1.0 + dm / d.vehicle.mass)


def _drag(d: Drive, v: Values, _: str | None) -> Columns:
    return _pulled(d, _air(d.vehicle, speed(d), v["delta_drag_area"]))


def _wind(d: Drive, v: Values, _: str | None) -> Columns:
    x, area = speed(d), d.vehicle.drag_area
    return _pulled(d, _air(d.vehicle, x + v["speed"], area) - _air(d.vehicle, x, area))


def _rolling(d: Drive, v: Values, _: str | None) -> Columns:
    own = {w: v["delta_r_w"] * x for w, x in _loads(d).items()}
    return _pulled(d, np.sum(list(own.values()), axis=0), own)


def _brake(d: Drive, v: Values, where: str | None) -> Columns:
    n = d.columns["t"].size
    at = WHEELS if where is None else (where,)
    own = {w: np.full(n, v["torque"] / d.vehicle.arm(w) if w in at else 0.0) for w in WHEELS}
    return _pulled(d, np.sum(list(own.values()), axis=0), own)


def _grade(d: Drive, v: Values, _: str | None) -> Columns:
    theta = np.full(d.columns["t"].size, v.get("grade", 0.0))
    if "rms" in v:
        s = position(d)
        waves = [np.sin(2.0 * np.pi * (s / (v["wavelength"] * k) + v["phase"] * k)) for k in (1.0, 0.618, 1.7)]
        hills = np.sum(waves, axis=0)
        theta = theta + v["rms"] * hills / np.sqrt(np.mean(hills**2))
    climb = np.sin(theta)
    return {"a_x": d.columns["a_x"] + G * climb, **_pulled(d, d.vehicle.mass * G * climb)}


def _gain_of_torque(d: Drive, v: Values, _: str | None) -> Columns:
    return {n: d.columns[n] / v["gain"] for n in d.columns if n.startswith("torque_")}


def _delay(d: Drive, v: Values, where: str | None) -> Columns:
    names = [n for n in d.columns if n == where or (where in ("omega", "torque") and n.startswith(f"{where}_"))]
    return {n: shifted(d.columns[n], v["delay"] / d.dt) for n in names}


def _accelerometer(d: Drive, v: Values, where: str | None) -> Columns:
    x = d.columns[where or "a_x"]
    turned = v["ahead"] * _quiet(d, "yaw_rate") ** 2 if "ahead" in v else 0.0
    return {where or "a_x": v.get("gain", 1.0) * x + v.get("bias", 0.0) + v.get("drift", 0.0) * d.columns["t"] - turned}


def _radius(d: Drive, v: Values, where: str | None) -> Columns:
    wheels = [w for w in WHEELS if where in (w, w[0])] if where else list(WHEELS)
    out = {f"omega_{w}": d.columns[f"omega_{w}"] / (1.0 + v["delta"]) for w in wheels}
    for axle in "fr":
        n, name = sum(w[0] == axle for w in wheels), f"torque_{axle}"
        if n and name in d.columns:
            out[name] = d.columns[name] * (1.0 + 0.5 * n * v["delta"])
    return out


def _stiffness(d: Drive, v: Values, where: str | None) -> Columns:
    traction, loads = _traction(d), _loads(d)
    out = {}
    for w in WHEELS:
        if where in (None, w, w[0]):
            slip = traction[w] / (_slope(d.vehicle, w) * loads[w])
            out[f"omega_{w}"] = d.columns[f"omega_{w}"] * (1.0 + slip * (1.0 / v["gain"] - 1.0))
    return out


def _ring(d: Drive, v: Values, where: str | None) -> Columns:
    out = {}
    for i, w in enumerate(WHEELS):
        if where in (None, w, w[0]):
            angle = np.cumsum(filled(d.columns[f"omega_{w}"])) * d.dt
            out[f"omega_{w}"] = d.columns[f"omega_{w}"] * (1.0 + v["amplitude"] * np.sin(angle + 1.3 * i))
    return out


def _hump(d: Drive, v: Values, _: str | None) -> Columns:
    return _pulled(d, v["force"] * np.exp(-0.5 * ((speed(d) - v["centre"]) / v["width"]) ** 2))


def _step(d: Drive, v: Values, _: str | None) -> Columns:
    t = d.columns["t"]
    return _pulled(d, np.where((t >= v["start"]) & (t < v["start"] + v["duration"]), v["force"], 0.0))


def _over_speed(d: Drive, v: Values, _: str | None) -> Columns:
    return {"a_x": d.columns["a_x"] * (1.0 + v["rate"] * (speed(d) - 15.0))}


def _wave(d: Drive, v: Values, _: str | None) -> Columns:
    return _pulled(d, v["force"] * np.sin(2.0 * np.pi * position(d) / v["wavelength"]))


EFFECTS: dict[str, Callable[[Drive, Values, str | None], Columns]] = {
    "payload_mass": _payload, "aero_drag": _drag, "head_wind": _wind, "rolling_resistance": _rolling, "brake_drag": _brake,
    "road_grade": _grade, "torque_gain": _gain_of_torque, "signal_delay": _delay, "accelerometer_bias": _accelerometer,
    "accelerometer_gain": _accelerometer, "accelerometer_drift": _accelerometer, "accelerometer_position": _accelerometer,
    "velocity_scale": lambda d, v, _: {"v_x": v["scale"] * d.columns["v_x"]}, "tyre_radius": _radius,
    "slip_stiffness": _stiffness, "tone_ring": _ring,
    "force_hump": _hump, "force_step": _step, "accelerometer_speed": _over_speed, "force_wave": _wave,
}  # fmt: skip
"""By name: (drive, values, where) -> the columns that change."""
