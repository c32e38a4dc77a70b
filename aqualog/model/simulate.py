"""Turn a scenario and a model into a simulated drive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aqualog.core.errors import ConfigError
from aqualog.core.notation import WHEELS
from aqualog.core.records import FloatArray
from aqualog.model import kernel
from aqualog.model.excitation import AMPLITUDE_KINDS, waveform
from aqualog.model.plant import F_Z_HALF_LENGTH, P_HALF_LENGTH, Plant, build_plant, with_mass_at
from aqualog.model.road import GRADE, HEIGHT, build_road
from aqualog.model.scenario import Profile, Scenario
from aqualog.model.sensors import Measured, Truth, measure
from aqualog.model.state import COLUMNS, LIFT, column, resistance_at, rolling_state, wheel_columns
from aqualog.model.term import Model, Setup
from aqualog.physics.contact import contact_half_length
from aqualog.physics.load import G
from aqualog.physics.slip import slip_of_wheel_speed
from aqualog.physics.steering import STEERING, kingpin_moment, steering_torque, tie_rod_force

__all__ = [
    "STEP_S", "TRUTH_SYMBOLS", "Simulation", "assemble", "drive_truth", "run_kernel", "simulate", "steering_columns",
]  # fmt: skip

BASE = Model()
STEP_S = 1e-3
LARGEST_RECORD = 4e9  # [byte] of memory while a drive is made
FINE_RATE_HZ = 1000.0  # of the record that sensors sample
FINE_LIMIT_S = 300.0  # longer drives are recorded more coarsely, to keep memory in bounds
NO_WEDGE = 1e4  # [m/s] from here on the physics means: no aquaplaning at any speed
PRESSURE_PER_TORQUE = 1.5e3  # [Pa/(N m)] brake pressure over the sum of the brake torques (K)

_WHEEL_TRUTH = {
    "contact": ("contact", "-", "remaining share of the contact length L"),
    "s_x": ("slip", "-", "longitudinal slip (omega r_e - v) / v, -1 for a wheel that stands"),
    "F_x": ("force_x", "N", "longitudinal tyre force"),
    "F_y": ("force_y", "N", "lateral tyre force"),
    "F_z": ("load", "N", "wheel load"),
    "slope": ("slip_slope", "-", "slip slope C_s / F_z of the remaining contact"),
    "mu_max": ("mu_max", "-", "friction of the remaining contact over the wheel load"),
    "film": ("film", "m", "water in front of the wheel"),
    "v_full": ("full_speed", "m/s", "speed of full aquaplaning of this wheel here and now; none without a wedge"),
    "torque": ("torque", "N*m", "net wheel torque"),
    "water_torque": ("water_torque", "N*m", "torque of the water against the wheel: shifted load and film"),
}
TRUTH_SYMBOLS: dict[str, tuple[str, str]] = {
    **{
        f"true_{name}_{w}": (unit, f"simulated truth: {meaning}, {w}")
        for name, unit, meaning in _WHEEL_TRUTH.values()
        for w in WHEELS
    },
    "true_grade": ("rad", "simulated truth: slope angle, uphill positive"),
    "true_v_x": ("m/s", "simulated truth: longitudinal velocity"),
    "true_v_y": ("m/s", "simulated truth: lateral velocity, left positive"),
    "true_position": ("m", "simulated truth: way of the front axle"),
    "true_wave_drag": ("N", "simulated truth: force of the water on the wheels' centres, against the motion, sum"),
}


@dataclass(frozen=True, slots=True)
class Simulation:
    """A simulated drive: the sensor signals, and the truth on a fine grid."""

    measured: tuple[Measured, ...]
    truth: Truth
    setup: Setup
    seed: int


def simulate(scenario: Scenario, model: Model = BASE, *, dt: float = STEP_S) -> Simulation:
    """Simulate a drive.

    Parameters
    ----------
    scenario : Scenario
        What is driven and how it is measured.
    model : Model
        Terms on top of the base simulation.
    dt : float
        Step of the integration, at most 2 ms. [s]

    Returns
    -------
    simulation : Simulation
        The same scenario, model and step give the same bits.

    Raises
    ------
    ConfigError
        If the car cannot do what scenario or model ask for.
    """
    setup = assemble(scenario, model)
    truth = drive_truth(setup, dt=dt)
    measured = measure(truth, setup.sensors, rate_hz=setup.scenario.rate_hz, seed=setup.scenario.seed)
    return Simulation(tuple(measured), truth, setup, setup.scenario.seed)


def assemble(scenario: Scenario, model: Model = BASE) -> Setup:
    """Return plant, sensors and scenario with all terms of the model in them."""
    plant = build_plant(
        scenario.vehicle, scenario.tyre_front, scenario.tyre_rear, p_front=scenario.p_front, p_rear=scenario.p_rear
    )
    plant = plant._replace(head_wind=scenario.head_wind)
    plant = with_mass_at(plant, scenario.load_front, 0.0)
    plant = with_mass_at(plant, scenario.load_rear, scenario.vehicle.wheelbase)
    return model.apply(Setup(plant, scenario.sensors, scenario))


def drive_truth(setup: Setup, *, dt: float = STEP_S) -> Truth:
    """Return the drive without sensors, on a fine grid; see `Truth` and `TRUTH_SYMBOLS`."""
    scenario, plant = setup.scenario, setup.plant
    rate = FINE_RATE_HZ if scenario.duration_s <= FINE_LIMIT_S else max(scenario.rate_hz, 200.0)
    every = max(1, round(1.0 / (rate * dt)))
    rows = run_kernel(setup, dt=dt, every=every)
    t: FloatArray = np.arange(rows.shape[0], dtype=np.float64) * (every * dt)
    return Truth(t, _columns(rows, t, plant, scenario))


def run_kernel(setup: Setup, *, dt: float, every: int) -> FloatArray:
    """Raw record (n, columns of `state.COLUMNS`) of every `every`-th step."""
    scenario, plant = setup.scenario, setup.plant
    n = round(scenario.duration_s / dt)
    bytes_needed = 8.0 * (n / every) * 2.5 * len(COLUMNS) * 3.0
    if bytes_needed > LARGEST_RECORD:
        raise ConfigError(
            f"{scenario.duration_s:g} s at {scenario.rate_hz:g} Hz would need {bytes_needed / 1e9:.0f} GB of memory",
            hint="a shorter drive or a lower sample rate",
        )
    controls = _controls(scenario, n, dt)
    road = build_road(scenario, float(np.max(controls.v_target)) * 1.3 * scenario.duration_s + 50.0)
    start = _start(plant, controls, float(road.fields[0, GRADE]))
    start[LIFT : LIFT + 4] = np.tile(road.fields[0, HEIGHT : HEIGHT + 2], 2)
    rows = kernel.run(n, dt, every, start, plant, road, controls, _vectored(scenario, n, dt))
    if not np.isfinite(rows).all():
        raise ConfigError("the simulation diverged", hint="less extreme parameters of car, tyre, lane or model")
    return rows


def _vectored(scenario: Scenario, n: int, dt: float) -> FloatArray:
    """Torque on top at each wheel. (n + 1, 4) [N·m]"""
    if not scenario.vectoring:
        return kernel.NO_TORQUE
    moved = _profile(scenario.vectoring, np.arange(n + 1, dtype=np.float64) * dt)
    applied = np.zeros((n + 1, 4))
    left = 0 if scenario.vehicle.drivetrain == "fwd" else 2
    applied[:, left], applied[:, left + 1] = -moved, moved
    return applied


def _profile(pairs: Profile, t: FloatArray) -> FloatArray:
    if not pairs:
        return np.zeros_like(t)
    return np.interp(t, [p[0] for p in pairs], [p[1] for p in pairs])


def _controls(scenario: Scenario, n: int, dt: float) -> kernel.Controls:
    t: FloatArray = np.arange(n + 1, dtype=np.float64) * dt
    steering, exc = scenario.steering, scenario.excitation
    steer = np.zeros(n + 1)
    if steering is not None:
        phase = np.maximum(t - steering.start_s, 0.0) * (2.0 * np.pi / steering.period_s)
        # half a lobe of half the height first, so that the heading swings about straight ahead
        steer = steering.amplitude * np.sin(phase) * np.where(phase < np.pi, 0.5, 1.0)
        if steering.kind == "hold":
            steer = steering.amplitude * 0.5 * (1.0 - np.cos(np.minimum(phase, np.pi)))
        elif steering.kind == "lane_change":
            part = np.floor(phase / (2.0 * np.pi))
            steer = steering.amplitude * np.sin(phase) * ((part == 0.0) * 1.0 - (part == 2.0) * 1.0)
    split = (
        _profile(scenario.split_rear, t) if scenario.split_rear else np.full(n + 1, scenario.vehicle.torque_split_rear)
    )
    if exc is not None and scenario.vehicle.drivetrain != "awd":
        raise ConfigError("excitation needs a car with both axles driven", where="drivetrain")
    v_target = _profile(scenario.speed, t)
    return kernel.Controls(
        v_target=v_target,
        a_target=np.gradient(v_target, dt) if v_target.size > 1 else np.zeros(1),
        drive=_profile(scenario.extra_torque, t),
        brake=_profile(scenario.brake_torque, t),
        split_rear=split,
        steer=steer,
        exc=np.zeros(n + 1) if exc is None else np.asarray(waveform(exc.waveform, t, period=exc.period_s)),
        grade=np.zeros(n + 1),
        wind=_profile(scenario.wind, t),
        gain=_profile(scenario.drive_share, t) if scenario.drive_share else np.ones(n + 1),
        has_driver=True,
        keeps_lane=steering is None,
        exc_kind=0 if exc is None else AMPLITUDE_KINDS[exc.amplitude_kind],
        exc_amplitude=0.0 if exc is None else float(exc.amplitude),
        scatter=float(scenario.water_scatter),
        antilock=scenario.antilock,
        kicks=bool(scenario.kicks),
        is_uneven=scenario.unevenness > 0.0,
        steering_friction=scenario.steering_friction,
    )


def _start(plant: Plant, controls: kernel.Controls, theta: float) -> FloatArray:
    """Return the state of rolling in balance at the first speed, acceleration and slope angle: no transient."""
    v, rear = float(controls.v_target[0]), float(controls.split_rear[0])
    a = float(controls.a_target[0]) + G * float(np.sin(theta))  # specific force
    drag, rolling = resistance_at(plant, v, a)
    arm = 0.5 * ((1.0 - rear) * plant.r_e[:2].sum() + rear * plant.r_e[2:].sum())
    drive = ((plant.mass + plant.towed_mass) * a + rolling.sum() + drag) * arm
    return rolling_state(plant, v=v, a=a, drive=float(drive), split_rear=rear)


def _columns(rows: FloatArray, t: FloatArray, plant: Plant, scenario: Scenario) -> dict[str, FloatArray]:
    wheels = {name: wheel_columns(rows, name) for name in ("omega", "angle", "torque", *_WHEEL_TRUTH)}
    columns = {name: column(rows, name) for name in ("v_x", "a_x", "a_y", "yaw_rate", "steer_angle")}
    columns["brake_pressure"] = column(rows, "brake_torque") * PRESSURE_PER_TORQUE
    for i, w in enumerate(WHEELS):
        columns[f"omega_{w}"] = wheels["omega"][i]
        columns[f"angle_{w}"] = wheels["angle"][i]
        columns[f"torque_{w}"] = wheels["torque"][i] / plant.torque_gain[i]
    rod_wheels = {n: wheel_columns(rows, n) for n in ("aligning", "braking", "wave_drag", "climb")}
    columns |= steering_columns(wheels | rod_wheels, plant, scenario)
    # the friction of the rack lies between the rods and the torque that holds it
    columns["steering_torque"] -= STEERING.ratio * STEERING.stiffness * STEERING.arm * column(rows, "held")
    if scenario.lanes:
        columns |= _labels(scenario, column(rows, "lane_front").astype(int), column(rows, "lane_rear").astype(int))
    v_w = np.array(wheels["omega"]) * np.array(wheel_columns(rows, "r_e"))
    wheels["s_x"] = list(slip_of_wheel_speed(v_w, np.array(wheel_columns(rows, "v_along"))))
    wheels["v_full"] = [np.where(x < NO_WEDGE, x, np.nan) for x in wheels["v_full"]]
    for name, (label, _, _) in _WHEEL_TRUTH.items():
        columns |= {f"true_{label}_{w}": wheels[name][i] for i, w in enumerate(WHEELS)}
    columns |= {f"true_{name}": column(rows, name) for name in ("grade", "v_x", "v_y", "position")}
    return columns | {"true_wave_drag": np.sum(wheel_columns(rows, "wave_drag"), axis=0)}


def steering_columns(wheels: dict[str, list[FloatArray]], plant: Plant, scenario: Scenario) -> dict[str, FloatArray]:
    """Return forces in the tie rods and torque at the steering.

    A polynomial in the vehicle file gives the forces of the dry car; the effect of the water is added.
    """
    given = scenario.vehicle.tie_rod
    rods = []
    for i, outward in enumerate((1.0, -1.0)):
        F_x = wheels["F_x"][i] - wheels["wave_drag"][i] - wheels["climb"][i]
        F_y = outward * wheels["F_y"][i]
        aligning, braking = outward * wheels["aligning"][i], wheels["braking"][i]
        if given:
            c0, c_y, c_x = (given.get(n, (0.0,)) for n in ("c0", "c_y", "c_x"))
            wet = wheels["contact"][i] < 1.0
            half = contact_half_length(
                wheels["F_z"][i], p=float(plant.p[i]), a_ref=float(plant.half_length[i]), F_z_ref=F_Z_HALF_LENGTH,
                p_ref=P_HALF_LENGTH,
            )  # fmt: skip
            trail = np.where(wet, aligning + half / 3.0 * F_y, 0.0)
            rods.append(tie_rod_force(F_x, F_y, c0=c0, c_y=c_y, c_x=c_x) + trail / STEERING.arm)
        else:
            moment = kingpin_moment(F_x, F_y, wheels["F_z"][i], aligning, braking, r_l=float(plant.r_l[i]))
            rods.append(moment / STEERING.arm)
    return {"tie_rod_fl": rods[0], "tie_rod_fr": rods[1], "steering_torque": steering_torque(rods[0], rods[1])}


def _labels(scenario: Scenario, front: FloatArray, rear: FloatArray) -> dict[str, FloatArray]:
    """Return water depths of the stretch under the front axle, and whether any axle is on water."""
    left = np.array([0.0, *(lane.depth_left for lane in scenario.lanes)])
    right = np.array([0.0, *(lane.depth_right for lane in scenario.lanes)])
    wet = (left > 0.0) | (right > 0.0)
    return {
        "on_water": (wet[front + 1] | wet[rear + 1]).astype(np.float64),
        "water_depth_left": left[front + 1],
        "water_depth_right": right[front + 1],
    }
