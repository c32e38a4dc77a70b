"""The functions that right answers find for forms over one coordinate: units, meaning and signs of a diagnosis.

Forces act against the motion; of a slip it is the relative change of the slip slope. What waves, comes in intervals, belongs
to a turn, lags or depends on two coordinates is no such function.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from .car import gradients
from .driver import ENGINE_HOLDS, MOTOR_HOLDS
from .dynamics import G, odd_force, odd_slope
from .hidden import KINDS, Setup
from .sensors import WHEELS, Error, Message, hardly_read, misread

__all__ = ["points_of"]

COUNT, LONGEST = 100, 60.0  # points; [s] since braking
STEEPEST = 3.0  # of the slip slope: beyond, it would soon be infinite
UNITS = {"force_balance": "N", "slip": "-", "lateral": "m/s^2", "accelerometer": "m/s^2"}
Function = Callable[[Setup, np.ndarray, int], np.ndarray]  # of setup, points and wheel


def points_of(name: str, setup: Setup, drive: Sequence[Message]) -> dict[str, object] | None:
    """`x` [SI] over the range of a drive, `f` there in `unit`, of wheels the mean of the driven ones; else None.

    `slip_f` and `slip_r` are those of the axles.
    """
    if name not in FUNCTIONS:
        return None
    kind = KINDS[name]
    x = np.linspace(*_range(kind.depends_on[0], drive), COUNT)
    each = np.array([FUNCTIONS[name](setup, x, wheel) for wheel in range(4)])
    known = np.isfinite(each).all(axis=0)
    lines = {"x": _read(setup, x) if kind.depends_on == ("torque",) else x, "f": each[list(setup.driven)].mean(axis=0)}
    if kind.channel == "slip":
        lines |= {"slip_f": each[0], "slip_r": each[2]}
    unit = "-" if len(kind.depends_on) > 1 else UNITS[kind.channel]  # a gain goes with its signal, too
    return {"unit": unit, **{n: [float(f"{v:.5g}") for v in y[known]] for n, y in lines.items()}}


def _range(coordinate: str, drive: Sequence[Message]) -> tuple[float, float]:
    if coordinate == "time since braking":
        return 0.0, LONGEST
    x = {"time": drive[0].t, **{s: y for m in drive for s, y in m.columns.items()}}
    x["torque"] = np.sum([x[f"torque_{w}"] for w in WHEELS], axis=0)
    return float(x[coordinate].min()), float(x[coordinate].max())


def _force(coordinate: str) -> Function:
    at = {"t": 0.0, "share": 0.5, "v": 20.0, "way": 0.0, "steer": 0.0, "torque": 0.0, "a_side": 0.0, "yaw": 0.0}
    at |= {"a_x": 0.0, "is_open": 0.0}
    return lambda s, x, _: np.array([odd_force(*(at | {coordinate: y}).values(), s.odd) for y in x])


def _slope(coordinate: str) -> Function:
    at = {"torque": 0.0, "yaw": 0.0, "v": 20.0, "way": 0.0, "linger": 0.0, "slip": 0.0}
    return lambda s, x, i: np.array([odd_slope(i, *(at | {coordinate: y}).values(), s.odd) - 1.0 for y in x])


def _torques(s: Setup, total: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Torques of the shafts and of all that is at the wheels (4, n) [N m]: what shafts do not hold, brakes do."""
    car = s.car
    holds = (MOTOR_HOLDS if car.is_electric > 0.5 else ENGINE_HOLDS) * car.mass * G * car.r_e[0]
    driven, braked = (0.5 * np.repeat([1.0 - x, x], 2)[:, None] for x in (car.split_rear, 1.0 - car.brake_front))
    shaft = np.maximum(total, -holds)
    return driven * shaft, driven * shaft + braked * (total - shaft)


def _read_in_speed(s: Setup, x: np.ndarray, i: int) -> np.ndarray:
    rate = s.errors.get(f"omega_{WHEELS[i]}", Error()).by_torque
    less = 1.0 + 1e-6 * rate * s.car.r_e[i] * s.car.slope[i] * s.car.static[i] * _torques(s, x)[1][i]
    return 1.0 / np.where(less > 1.0 / STEEPEST, less, np.nan) - 1.0


def _read(s: Setup, total: np.ndarray) -> np.ndarray:
    """What the log has of a torque of all wheels."""
    dead = np.array([s.errors.get(f"torque_{w}", Error()).dead for w in WHEELS])
    return np.asarray(hardly_read(_torques(s, total)[1], dead[:, None]).sum(axis=0))


FUNCTIONS: Mapping[str, Function] = {
    "speed_hump": _force("v"), "steering_drag": _force("steer"), "basalt": _force("a_side"), "agate": _force("yaw"),
    "garnet": _force("a_x"), "calcite": lambda s, x, i: _force("torque")(s, _torques(s, x)[0].sum(axis=0), i),
    "odd_hours": lambda s, x, i: _force("share")(s, x / x[-1], i),
    "lingering_brake": lambda s, x, _: 2.0 * s.odd.linger[0] / s.car.r_e[2] * np.exp(-x / s.odd.linger[1]),
    "gneiss": _slope("v"), "yawing_slip": _slope("yaw"),
    "slate": lambda s, x, i: _slope("linger")(s, np.exp(-x / s.odd.linger[1]), i),
    "torque_saddle": lambda s, x, i: _slope("torque")(s, _torques(s, x)[0][i], i),
    "rutile": lambda s, x, i: _slope("slip")(
        s, _torques(s, x)[1][i] / (s.car.r_e[i] * s.car.slope[i] * s.car.static[i]), i),
    "torque_read_in_speed": _read_in_speed, "chalk": lambda s, x, _: (_read(s, x) - x) / s.car.r_e.mean(),
    "speed_dependent_gain": lambda s, x, _: misread(1.0, s.errors["a_x"], x) - 1.0,
    "feldspar": lambda s, x, _: misread(x, s.errors["a_x"], 15.0) - x,
    "dolomite": lambda s, x, _: misread(0.0, s.errors["a_y"], x),
    "olivine": lambda s, x, _: misread(0.0, s.errors["a_y"], 15.0, x),
    "fluorite": lambda s, x, _: s.errors["a_x"].fresh[0] * np.exp(-x / s.errors["a_x"].fresh[1]),
    # less what the sensor takes for its own pitch
    "zircon": lambda s, x, _: G * s.odd.zircon[0] * np.exp(-x / s.odd.linger[1]) / (1.0 + G * gradients(s.car)[0]),
}  # fmt: skip
