"""Run the simulation by measured inputs: along a drive, torque and steering in, signals out; or by a torque alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from aqualog.core.errors import ConfigError
from aqualog.core.notation import WHEELS
from aqualog.core.records import FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.model import kernel
from aqualog.model.plant import Plant, build_plant
from aqualog.model.road import DRY, build_road
from aqualog.model.scenario import Lane, Scenario
from aqualog.model.sensors import ESC, Channel, Group, Sensors, Truth, measure
from aqualog.model.simulate import steering_columns
from aqualog.model.state import DRIVE, column, resistance_at, rolling_state, wheel_columns
from aqualog.model.term import Model, Setup
from aqualog.model.tyre import TYRES
from aqualog.physics.load import G

__all__ = [
    "FOLLOW_RATE", "STEP_S", "Course", "Led", "Replay", "follow", "led_along", "led_truth", "replay", "setup_along",
    "shown",
]  # fmt: skip

STEP_S = 5e-3
RECORD_S = 1e-2
FOLLOW_RATE = 0.3  # [1/s] fast against a wrong resistance, slow against the noise of a measured speed
V_START = 0.5  # [m/s]
# perfect sensors on the buses of a series car: a clock that drifts shifts its whole bus
PERFECT = Sensors("perfect", tuple(Group(g.name, g.signals) for g in ESC.groups))


@dataclass(frozen=True, slots=True)
class Course:
    """Inputs of the car according to its log; arrays on an even grid `t` (n,) from 0 [s], finite.

    `torque` (4, n) reported net wheel torques [N·m], `steer` (n,) road-wheel angle [rad], `v_x` (n,) reference
    velocity [m/s], `lanes` the water on the way.
    """

    t: FloatArray
    torque: FloatArray
    steer: FloatArray
    v_x: FloatArray
    lanes: tuple[Lane, ...] = field(default=())
    has_rods: bool = False
    position: FloatArray | None = None


def setup_along(vehicle: Vehicle, course: Course, model: Model) -> Setup:
    """Return plant, sensors and road of a drive along `course`: the car of the file, perfect sensors, and all terms."""
    tyre = TYRES["worn_summer"].as_fitted(vehicle)
    scenario = Scenario(
        vehicle, tyre, tyre, duration_s=float(course.t[-1]), rate_hz=1.0 / float(course.t[1] - course.t[0]),
        lanes=course.lanes, water_scatter=0.0, sensors=PERFECT,
    )  # fmt: skip
    plant = build_plant(vehicle, scenario.tyre_front, scenario.tyre_rear)
    return model.apply(Setup(plant, PERFECT, scenario))


def follow(
    vehicle: Vehicle, course: Course, model: Model, *, rate: float = FOLLOW_RATE, step: float = STEP_S
) -> dict[str, FloatArray]:  # fmt: skip
    """Return the sensor signals of a measured drive for a car that is that of the file and the model.

    Parameters
    ----------
    model : Model
        Its terms act on car, road and sensors. The effect of a term on the sensors of torque, steering and velocity
        is undone before they drive the simulation: a torque that is reported late is applied earlier.
    rate : float
        Rate at which the speed is drawn to the measured one, 16 times that at rest. [1/s] 0: it runs free. At any
        other rate a car whose rear axle slides is turned back.
    step : float
        Step of the integration, at most 10 ms. [s]

    Returns
    -------
    columns : dict of array (n,)
        Canonical signals on the grid of the course, without noise; `nudge` [m/s²] is the acceleration that drew the
        speed to the measured one, `nudge_seen` the same as the accelerometer would measure it, `slides` the share (0 to
        1) by which it is turned back, `position` [m].

    Raises
    ------
    ConfigError
        If the simulation diverges.
    """
    led = led_along(vehicle, course, model, rate=rate, step=step)
    return shown(led.truth, led.setup.sensors, course)


class Led(NamedTuple):
    """A simulated drive along a course without sensors, and the setup that drove it."""

    setup: Setup
    truth: Truth


def led_along(
    vehicle: Vehicle, course: Course, model: Model, *, rate: float = FOLLOW_RATE, step: float = STEP_S,
    like: Led | None = None,
) -> Led:  # fmt: skip
    """Simulate the drive of `follow` without sensors. Where car, road and inputs are those of `like`, which must be of
    the same course, rate and step, that is the drive: an effect on a sensor alone moves no car."""
    setup = setup_along(vehicle, course, model)
    if like is not None and _is_driven_alike(setup, like.setup):
        return Led(setup, like.truth)
    return Led(setup, led_truth(setup, course, rate=rate, step=step))


def _is_driven_alike(a: Setup, b: Setup) -> bool:
    inputs = (*(f"torque_{w}" for w in WHEELS), "v_x", "steer_angle")

    def given(s: Sensors) -> list[tuple[Channel, float]]:
        return [(s.channels.get(n, Channel()), _skew(s, n)) for n in inputs]

    return (
        a.scenario == b.scenario
        and given(a.sensors) == given(b.sensors)
        and all(np.array_equal(np.asarray(x), np.asarray(y)) for x, y in zip(a.plant, b.plant, strict=True))
    )


def shown(truth: Truth, sensors: Sensors, course: Course) -> dict[str, FloatArray]:
    """Return the output of `sensors` for a truth, on the course's grid; a column without a sensor stays as it is."""
    step = float(course.t[1] - course.t[0])
    out: dict[str, FloatArray] = {}
    bare = replace(sensors, teeth=0)  # a log does not share the phase of the tone ring
    for group in measure(truth, bare, rate_hz=1.0 / step, seed=0):
        for name, x in group.columns.items():
            n = group.t.size  # the last sample of an open interval is held
            same = 0 <= course.t.size - n <= 1 and abs(group.t[-1] - course.t[n - 1]) < 1e-9
            out[name] = np.append(x, x[n - 1 : course.t.size - 1]) if same else np.interp(course.t, group.t, x)
    for name in ("nudge", "slides", "position"):
        out[name] = np.interp(course.t, truth.t, truth.columns[name])
    # the accelerometer's delay and gain: a car whose signals are all late is the same car
    channel = sensors.channels.get("a_x", Channel())
    true_t = course.t / (1.0 + _skew(sensors, "a_x")) - channel.delay_s - channel.latency_s
    out["nudge_seen"] = channel.gain * np.interp(true_t, truth.t, truth.columns["nudge"])
    return {n: x if x.size == course.t.size else np.resize(x, course.t.size) for n, x in out.items()}


def led_truth(setup: Setup, course: Course, *, rate: float = FOLLOW_RATE, step: float = STEP_S) -> Truth:
    """Return the simulated drive without sensors, every 10 ms."""
    plant, scenario = setup.plant, setup.scenario
    n = max(2, math.ceil(float(course.t[-1]) / step - 1e-9))
    fine: FloatArray = np.arange(n + 1, dtype=np.float64) * step
    torque = np.array([
        _undone(course.t, course.torque[i], setup.sensors, f"torque_{w}", fine) for i, w in enumerate(WHEELS)
    ])  # fmt: skip
    speed = np.maximum(_undone(course.t, course.v_x, setup.sensors, "v_x", fine), 0.0)
    # the car is where the measured one was: another resistance must not move it along its road
    grade = np.zeros_like(fine)
    if scenario.grade:
        way = np.cumsum(course.v_x) * float(course.t[1] - course.t[0]) if course.position is None else course.position
        grade = np.asarray(np.interp(np.interp(fine, course.t, way), *np.array(scenario.grade).T))
    steer = _undone(course.t, course.steer, setup.sensors, "steer_angle", fine)
    controls = _undriven(n + 1, v_target=speed, steer=steer, grade=grade, follow=rate, motion_only=not course.has_rods)
    road = build_road(replace(scenario, grade=()), float(speed.sum()) * step * 1.02 + 50.0)
    v, theta = float(max(speed[0], V_START)), float(grade[0])
    drag, rolling = resistance_at(plant, v, G * math.sin(theta))
    force = float((torque[:, 0] * plant.torque_gain).sum()) / float(plant.r_e.mean()) - float(rolling.sum()) - drag
    start = rolling_state(plant, v=v, a=force / (plant.mass + plant.towed_mass), drive=0.0, split_rear=0.5)
    start[DRIVE] = 0.0
    every = round(RECORD_S / step)
    rows = kernel.run(n, step, every, start, plant, road, controls, np.ascontiguousarray(torque.T))
    if not np.isfinite(rows).all():
        raise ConfigError("the simulation along the drive diverged", hint="less extreme parameters of car or model")
    t: FloatArray = np.arange(rows.shape[0], dtype=np.float64) * RECORD_S
    return Truth(t, _columns(rows, plant, scenario, rods=course.has_rods))


def _undriven(n: int, **given: Any) -> kernel.Controls:
    """Return controls of `n` time steps without a driver: nothing acts but what is given."""
    still = np.zeros(n)
    names = ("v_target", "a_target", "drive", "brake", "steer", "exc", "grade", "wind")
    fields: dict[str, Any] = dict.fromkeys(names, still) | {"split_rear": still + 0.5, "gain": still + 1.0}
    fields |= {"has_driver": False, "keeps_lane": False, "exc_kind": 0, "exc_amplitude": 0.0, "scatter": 0.0}
    return kernel.Controls(**fields | given)


def _undone(t: FloatArray, x: FloatArray, sensors: Sensors, name: str, at: FloatArray) -> FloatArray:
    """Return the input of a sensor from its report: the inverse of `Channel` without noise and lag."""
    channel = sensors.channels.get(name, Channel())
    skew = _skew(sensors, name)
    reported = np.interp((at + channel.delay_s + channel.latency_s) * (1.0 + skew), t, x)
    return (reported - channel.bias - channel.drift * at) / channel.gain


def _skew(sensors: Sensors, name: str) -> float:
    return sum(g.skew_ppm for g in sensors.groups if name in g.signals) * 1e-6


_SCALARS = ("v_x", "a_x", "a_y", "yaw_rate", "steer_angle", "position", "nudge", "slides")


def _columns(rows: FloatArray, plant: Plant, scenario: Scenario, *, rods: bool) -> dict[str, FloatArray]:
    columns = {n: column(rows, n) for n in _SCALARS}
    omega, angle, torque = (wheel_columns(rows, n) for n in ("omega", "angle", "torque"))
    for i, w in enumerate(WHEELS):
        columns[f"omega_{w}"] = omega[i]
        columns[f"angle_{w}"] = angle[i]
        columns[f"torque_{w}"] = torque[i] / plant.torque_gain[i]
    if rods:
        names: Sequence[str] = ("F_x", "F_y", "F_z", "wave_drag", "climb", "aligning", "braking", "contact")
        columns |= steering_columns({n: wheel_columns(rows, n) for n in names}, plant, scenario)
    return columns


@dataclass(frozen=True, slots=True)
class Replay:
    """Result of a torque: `t` [s], `v_x` [m/s], specific force `a_x` [m/s²], `omega` (4, n) [rad/s]."""

    t: FloatArray
    v_x: FloatArray
    a_x: FloatArray
    omega: FloatArray


def replay(
    plant: Plant,
    t: FloatArray,
    torque: FloatArray,
    *,
    split_rear: float,
    v_0: float,
    grade: FloatArray | None = None,
    dt: float = 2e-3,
) -> Replay:
    """Drive a dry straight road with a given torque, free from the first speed on.

    Parameters
    ----------
    plant : Plant
        The car; its `torque_gain` scales the torque.
    t : array (n,)
        Even time base of the inputs, from any start. [s]
    torque : array (n,)
        Sum of the net wheel torques, drive minus brake. [N·m] Finite.
    split_rear : float
        Rear share of the torque. [-]
    v_0 : float
        Speed at the first sample, > 0. [m/s]
    grade : array (n,), optional
        Slope angle at each sample, uphill positive. [rad]
    dt : float
        Step of the integration. [s]

    Returns
    -------
    replay : Replay
        On the samples of `t`. Where the car has come to a standstill, resistance fades out below 1 rad/s and it stays
        about there.

    Raises
    ------
    ConfigError
        If the inputs are not finite or not even in time.
    """
    step = float(t[1] - t[0])
    every = round(step / dt)
    if every < 1 or abs(every * dt - step) > 1e-6 or not np.allclose(np.diff(t), step, rtol=0.0, atol=1e-6):
        raise ConfigError(f"a replay needs an even time base in steps of {dt:g} s")
    if not (np.isfinite(torque).all() and np.isfinite(v_0)):
        raise ConfigError("a replay needs finite torque and speed")
    n = every * (t.size - 1)
    fine = np.arange(n + 1) * dt
    given = {} if grade is None else {"grade": np.interp(fine, t - t[0], grade)}
    controls = _undriven(
        n + 1, drive=np.interp(fine, t - t[0], torque), split_rear=np.full(n + 1, split_rear), motion_only=True, **given
    )  # fmt: skip
    gain = (1.0 - split_rear) * plant.torque_gain[0] + split_rear * plant.torque_gain[2]
    drive = float(torque[0] * gain)
    drag, rolling = resistance_at(plant, v_0, 0.0)
    a_0 = (drive / float(plant.r_e.mean()) - rolling.sum() - drag) / plant.mass
    start = rolling_state(plant, v=v_0, a=a_0, drive=drive, split_rear=split_rear)
    rows = kernel.run(n, dt, every, start, plant, DRY, controls)
    return Replay(t, column(rows, "v_x"), column(rows, "a_x"), np.array(wheel_columns(rows, "omega")))
