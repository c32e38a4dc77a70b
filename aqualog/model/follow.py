"""Run the simulation along a measured drive: reported torque and steering in, simulated sensor signals out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from aqualog.core.errors import ConfigError
from aqualog.core.notation import WHEELS
from aqualog.core.records import FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.model import kernel
from aqualog.model.plant import Plant, build_plant
from aqualog.model.road import build_road
from aqualog.model.scenario import Lane, Scenario
from aqualog.model.sensors import ESC, Channel, Group, Sensors, Truth, measure
from aqualog.model.simulate import steering_columns
from aqualog.model.state import DRIVE, column, resistance_at, rolling_state, wheel_columns
from aqualog.model.term import Model, Setup
from aqualog.physics.load import G

__all__ = ["FOLLOW_RATE", "Course", "follow", "led_truth", "setup_along", "shown"]

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
    scenario = Scenario(
        vehicle, duration_s=float(course.t[-1]), rate_hz=1.0 / float(course.t[1] - course.t[0]), lanes=course.lanes,
        water_scatter=0.0, sensors=PERFECT,
    )  # fmt: skip
    plant = build_plant(vehicle, scenario.tyre_front, scenario.tyre_rear)
    return model.apply(Setup(plant, PERFECT, scenario))


def follow(vehicle: Vehicle, course: Course, model: Model, *, rate: float = FOLLOW_RATE) -> dict[str, FloatArray]:
    """Return the sensor signals of a measured drive for a car that is that of the file and the model.

    Parameters
    ----------
    vehicle : Vehicle
    course : Course
    model : Model
        Its terms act on car, road and sensors. The effect of a term on the sensors of torque, steering and velocity
        is undone before they drive the simulation: a torque that is reported late is applied earlier.
    rate : float
        Rate at which the speed is drawn to the measured one. [1/s] 0: it runs free from the first speed on.

    Returns
    -------
    columns : dict of array (n,)
        Canonical signals on the grid of the course, without noise; `nudge` [m/s²] is the acceleration that drew the
        speed to the measured one, `nudge_seen` the same as the accelerometer would measure it, `position` [m].

    Raises
    ------
    ConfigError
        If the simulation diverges.
    """
    setup = setup_along(vehicle, course, model)
    return shown(led_truth(setup, course, rate=rate), setup.sensors, course)


def shown(truth: Truth, sensors: Sensors, course: Course) -> dict[str, FloatArray]:
    """Return the output of `sensors` for a truth, on the course's grid; a column without a sensor stays as it is."""
    step = float(course.t[1] - course.t[0])
    out: dict[str, FloatArray] = {}
    for group in measure(truth, _bare(sensors), rate_hz=1.0 / step, seed=0):
        for name, x in group.columns.items():
            same = group.t.size == course.t.size and abs(group.t[-1] - course.t[-1]) < 1e-9
            out[name] = x if same else _at(group.t, x, course.t)
    for name in ("nudge", "position"):
        out[name] = _at(truth.t, truth.columns[name], course.t)
    # the accelerometer's delay and gain: a car whose signals are all late is the same car
    channel = sensors.channels.get("a_x", Channel())
    true_t = course.t / (1.0 + _skew(sensors, "a_x")) - channel.delay_s - channel.latency_s
    out["nudge_seen"] = channel.gain * _at(truth.t, truth.columns["nudge"], true_t)
    return {n: x if x.size == course.t.size else np.resize(x, course.t.size) for n, x in out.items()}


def _at(t: FloatArray, x: FloatArray, at: FloatArray) -> FloatArray:
    return np.interp(at, t, x)


def _bare(sensors: Sensors) -> Sensors:
    """Return the sensors of this run, without the tone ring: a log does not share its phase."""
    return replace(sensors, teeth=0)


def led_truth(setup: Setup, course: Course, *, rate: float = FOLLOW_RATE) -> Truth:
    """Return the simulated drive without sensors, every 10 ms."""
    plant, scenario = setup.plant, setup.scenario
    n = max(2, math.ceil(float(course.t[-1]) / STEP_S - 1e-9))
    fine: FloatArray = np.arange(n + 1, dtype=np.float64) * STEP_S
    torque = np.array([
        _undone(course.t, course.torque[i], setup.sensors, f"torque_{w}", fine) for i, w in enumerate(WHEELS)
    ])  # fmt: skip
    speed = np.maximum(_undone(course.t, course.v_x, setup.sensors, "v_x", fine), 0.0)
    # the car is where the measured one was: another resistance must not move it along its road
    grade = _grade_along(course, scenario, fine)
    steer = _undone(course.t, course.steer, setup.sensors, "steer_angle", fine)
    controls = _controls(speed, steer, grade, rate)
    road = build_road(replace(scenario, grade=()), float(speed.sum()) * STEP_S * 1.02 + 50.0)
    start = _start(plant, torque[:, 0], float(max(speed[0], V_START)), float(grade[0]))
    every = round(RECORD_S / STEP_S)
    rows = kernel.run(n, STEP_S, every, start, plant, road, controls, np.ascontiguousarray(torque.T))
    if not np.isfinite(rows).all():
        raise ConfigError("the simulation along the drive diverged", hint="less extreme parameters of car or model")
    t: FloatArray = np.arange(rows.shape[0], dtype=np.float64) * RECORD_S
    return Truth(t, _columns(rows, plant, scenario, rods=course.has_rods))


def _grade_along(course: Course, scenario: Scenario, at: FloatArray) -> FloatArray:
    """Return the slope angle of the road where the measured car was. [rad]"""
    if not scenario.grade:
        return np.zeros_like(at)
    position = course.position
    if position is None:
        position = np.cumsum(course.v_x) * float(course.t[1] - course.t[0])
    s, theta = np.array(scenario.grade).T
    return np.asarray(np.interp(np.interp(at, course.t, position), s, theta))


def _controls(speed: FloatArray, steer: FloatArray, grade: FloatArray, rate: float) -> kernel.Controls:
    still = np.zeros_like(speed)
    return kernel.Controls(
        v_target=speed,
        a_target=still,
        drive=still,
        brake=still,
        split_rear=still + 0.5,
        steer=steer,
        exc=still,
        grade=grade,
        wind=still,
        gain=still + 1.0,
        has_driver=False,
        keeps_lane=False,
        exc_kind=0,
        exc_amplitude=0.0,
        scatter=0.0,
        follow=rate,
    )


def _undone(t: FloatArray, x: FloatArray, sensors: Sensors, name: str, at: FloatArray) -> FloatArray:
    """Return the input of a sensor from its report: the inverse of `Channel` without noise and lag."""
    channel = sensors.channels.get(name, Channel())
    skew = _skew(sensors, name)
    reported = np.interp((at + channel.delay_s + channel.latency_s) * (1.0 + skew), t, x)
    return (reported - channel.bias - channel.drift * at) / channel.gain


def _skew(sensors: Sensors, name: str) -> float:
    return sum(g.skew_ppm for g in sensors.groups if name in g.signals) * 1e-6


def _start(plant: Plant, torque: FloatArray, v: float, theta: float) -> FloatArray:
    drive = float(torque.sum()) * plant.torque_gain
    drag, rolling = resistance_at(plant, v, G * math.sin(theta))
    a = (drive / float(plant.r_l.mean()) - float(rolling.sum()) - drag) / (plant.mass + plant.towed_mass)
    state = rolling_state(plant, v=v, a=a, drive=0.0, split_rear=0.5)
    state[DRIVE] = 0.0
    return state


_SCALARS = ("v_x", "a_x", "a_y", "yaw_rate", "steer_angle", "position", "nudge")


def _columns(rows: FloatArray, plant: Plant, scenario: Scenario, *, rods: bool) -> dict[str, FloatArray]:
    columns = {n: column(rows, n) for n in _SCALARS}
    omega, angle, torque = (wheel_columns(rows, n) for n in ("omega", "angle", "torque"))
    for i, w in enumerate(WHEELS):
        columns[f"omega_{w}"] = omega[i]
        columns[f"angle_{w}"] = angle[i]
        columns[f"torque_{w}"] = torque[i] / plant.torque_gain
    if rods:
        names: Sequence[str] = ("F_x", "F_y", "F_z", "wave_drag", "aligning", "braking", "contact")
        columns |= steering_columns({n: wheel_columns(rows, n) for n in names}, plant, scenario)
    return columns
