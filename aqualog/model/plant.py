"""The vehicle on its tyres as numbers that the compiled simulation reads; terms of a model act on it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from aqualog.core.errors import ConfigError
from aqualog.core.notation import WHEELS
from aqualog.core.records import FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.model.tyre import P_REFERENCE, Tyre
from aqualog.physics.load import G, centre_shift
from aqualog.physics.rolling import pressure_factor

__all__ = ["FRONT_COMPLIANCE", "Plant", "build_plant", "flat", "records", "understeer_gradient", "with_mass_at"]

P_NOMINAL = 2.2e5  # [Pa] nominal pressure of the MF6.1 pressure law
P_HALF_LENGTH, F_Z_HALF_LENGTH = 2.2e5, 4000.0  # [Pa, N] reference of a tyre's half_length
BRAKE_SHARE_FRONT = 0.64  # of the brake torque (K)
POWER_PER_MASS = 110.0  # [W/kg] a lively car (K)
FRONT_COMPLIANCE = 0.8  # the steering yields: cornering slope of the front axle over the tyre's, understeer (K)


class Plant(NamedTuple):
    """SI floats, and arrays (4,) in the order fl, fr, rl, rr. Neutral values leave a drive the same to the bit."""

    mass: float
    l_f: float
    l_r: float
    h_cg: float
    track: float
    I_zz: float
    drag_area: float
    air_density: float
    head_wind: float
    cornering_drag: float
    roll_time: float
    brake_split: FloatArray
    power: float  # [W] of the engine, bounds the driver's torque
    torque_gain: FloatArray  # torque at each wheel over the torque that the car reports
    r_e: FloatArray
    r_l: FloatArray
    radius_growth: FloatArray
    radius_loss: FloatArray  # relative, per relative change of the load
    inertia: FloatArray  # [kg·m²] of the rim, and of the belt too if they turn as one
    belt_inertia: FloatArray  # [kg·m²] 0: rim and belt turn as one
    torsion_stiffness: FloatArray
    torsion_damping: FloatArray
    driveline: FloatArray  # [kg·m²] turns with the mean of both wheels of an axle
    preload: FloatArray  # [N·m] friction of the differential, without torque and [-] per torque of the wheel
    locking: FloatArray
    r_w: FloatArray
    warmup_extra: float
    warmup_time: float
    brake_drag: FloatArray
    slip_slope: FloatArray
    slip_slope_drift: FloatArray
    cornering_slope: FloatArray
    load_sensitivity: FloatArray
    F_z_ref: FloatArray
    mu: FloatArray
    relaxation_length: FloatArray
    wet_friction: FloatArray
    p: FloatArray
    tread_depth: FloatArray
    tread_capacity: FloatArray
    half_length: FloatArray
    width: FloatArray
    v_anchor: FloatArray
    pressure_exponent: FloatArray
    thin_gain: FloatArray
    h_bulk: FloatArray
    h_onset: FloatArray
    tread_gain: FloatArray
    contact_exponent: FloatArray
    aspect_exponent: FloatArray
    contact_gain: FloatArray  # multiplies the lost contact
    wedge_arm: FloatArray
    h_film: FloatArray
    groove_relief: FloatArray
    h_wave: FloatArray
    water_drag_gain: FloatArray
    h_track: FloatArray
    track_irregularity: FloatArray
    contact_scatter: FloatArray
    towed_mass: float  # [kg] of a trailer: pulled along, carried by its own wheels
    leak_start: float  # [s] a tyre loses its air from here on
    leak_time: float  # [s] for so long
    leak_radius: FloatArray  # share of the radius that is lost by then
    leak_slope: FloatArray  # relative change of the slip slope by then
    drag_over_v: FloatArray  # (k, 2) knots: v [m/s], extra force against the motion [N]


def understeer_gradient(cornering_slope: float) -> float:
    """Road-wheel angle per lateral acceleration beyond that of rolling around the curve. [1/rad] to [rad/(m/s²)]

    Difference of the axles' slip angles, a_y / (g c) each, where the front axle's slope is `FRONT_COMPLIANCE` c.
    """
    return (1.0 / (FRONT_COMPLIANCE * cornering_slope) - 1.0 / cornering_slope) / G


# what a plant takes as it is from vehicle and tyres, and what is added to it, neutral at first
_OF_CAR = ("mass", "l_f", "l_r", "h_cg", "track", "drag_area", "air_density")
_OF_TYRES = (
    "load_sensitivity", "wet_friction", "tread_depth", "tread_capacity", "half_length", "width", "v_anchor",
    "pressure_exponent", "thin_gain", "h_bulk", "h_onset", "tread_gain", "contact_exponent", "aspect_exponent",
    "wedge_arm", "h_film", "groove_relief", "h_wave", "h_track", "track_irregularity", "contact_scatter",
)  # fmt: skip
_ADDED = ("head_wind", "cornering_drag", "warmup_extra", "towed_mass", "leak_start")
_ADDED_AT_WHEELS = (
    "preload", "locking", "radius_growth", "radius_loss", "brake_drag", "slip_slope_drift",
    "relaxation_length", "leak_radius", "leak_slope",
)  # fmt: skip


def build_plant(
    vehicle: Vehicle, front: Tyre, rear: Tyre, *, p_front: float = P_REFERENCE, p_rear: float = P_REFERENCE
) -> Plant:
    """Build a plant without extra load.

    Parameters
    ----------
    vehicle : Vehicle
        Car; its slip slope and friction hold for a worn summer tyre at `P_REFERENCE` and the static load.
    p_front, p_rear : float
        Inflation pressures. [Pa]
    """
    tyres = (front, front, rear, rear)
    p = np.array([p_front, p_front, p_rear, p_rear])
    slope = np.array([vehicle.slip_slope_f, vehicle.slip_slope_f, vehicle.slip_slope_r, vehicle.slip_slope_r])
    brake_f = BRAKE_SHARE_FRONT
    front_axle = vehicle.mass * G * vehicle.l_r / vehicle.wheelbase
    rear_axle = vehicle.mass * G * vehicle.l_f / vehicle.wheelbase

    def of(name: str) -> FloatArray:
        return np.array([float(getattr(t, name)) for t in tyres])

    as_they_are: dict[str, Any] = {name: getattr(vehicle, name) for name in _OF_CAR}
    as_they_are |= {
        name: np.array([getattr(vehicle, name)(w) for w in WHEELS]) for name in ("r_e", "r_l", "inertia", "driveline")
    }
    belt = np.where(of("torsion_frequency") > 0.0, of("belt_share"), 0.0)
    whole, swing = as_they_are["inertia"], 2.0 * np.pi * of("torsion_frequency")
    as_they_are["inertia"] = rim = whole * (1.0 - belt)
    as_they_are |= {name: of(name) for name in _OF_TYRES}
    nothing: dict[str, Any] = dict.fromkeys(_ADDED, 0.0) | {name: np.zeros(4) for name in _ADDED_AT_WHEELS}
    return Plant(
        **as_they_are,
        **nothing,
        I_zz=vehicle.mass * vehicle.l_f * vehicle.l_r,  # radius of gyration sqrt(l_f l_r) (K)
        belt_inertia=whole * belt,
        torsion_stiffness=rim * swing**2,
        torsion_damping=2.0 * of("torsion_damping") * rim * swing,
        roll_time=0.08,  # [s] pitch and roll of a car settle in about a tenth of a second (K)
        brake_split=0.5 * np.array([brake_f, brake_f, 1.0 - brake_f, 1.0 - brake_f]),
        power=POWER_PER_MASS * vehicle.mass,
        torque_gain=np.ones(4),
        r_w=np.full(4, vehicle.rolling_resistance),
        warmup_time=600.0,
        slip_slope=slope * of("slip_slope_factor") * pressure_factor(p, p_ref=P_REFERENCE, p_nominal=P_NOMINAL),
        cornering_slope=of("cornering_slope") * np.array([FRONT_COMPLIANCE, FRONT_COMPLIANCE, 1.0, 1.0]),
        F_z_ref=0.5 * np.array([front_axle, front_axle, rear_axle, rear_axle]),
        mu=vehicle.mu_max * of("mu_factor"),
        p=p,
        contact_gain=np.ones(4),
        water_drag_gain=np.ones(4),
        leak_time=1.0,
        drag_over_v=np.array([[0.0, 0.0], [100.0, 0.0]]),
    )


def with_mass_at(plant: Plant, delta_mass: float, x: float) -> Plant:
    """Add a mass at a distance from the front axle. [kg, m]

    The centre of mass moves along; its height stays. A mass of zero leaves every bit unchanged.

    Raises
    ------
    ConfigError
        If too little of the car would be left, or its centre of mass would leave the wheelbase.
    """
    if plant.mass + delta_mass < 0.3 * plant.mass:
        raise ConfigError(
            f"a mass of {delta_mass:g} kg on a car of {plant.mass:g} kg", expected="at least 30 % of the car to be left"
        )
    moved = centre_shift(plant.mass, plant.l_f, delta_mass, x)
    inertia = delta_mass * (x - plant.l_f) * (x - plant.l_f) * plant.mass / (plant.mass + delta_mass)
    if not (plant.l_f + moved > 0.05 and plant.l_r - moved > 0.05 and plant.I_zz + inertia > 0.0):
        raise ConfigError(
            f"a mass of {delta_mass:g} kg at {x:g} m moves the centre of mass out of the wheelbase",
            expected="a smaller mass",
        )
    return plant._replace(
        mass=plant.mass + delta_mass, l_f=plant.l_f + moved, l_r=plant.l_r - moved, I_zz=plant.I_zz + inertia
    )


def flat(plant: Plant, **scalars: float) -> tuple[Any, Any, FloatArray]:
    """Pack the plant for the compiled simulation: one record of the car, four of the wheels, the table of drag.

    `scalars` of the run go into the record of the car. Records are plain memory; a tuple of arrays would cost reference
    counting at every access.
    """
    fields = [(name, x, getattr(x, "shape", ())) for name, x in plant._asdict().items()]
    wheels = {name: x for name, x, shape in fields if shape == (4,)}
    car = {name: x for name, x, shape in fields if not shape} | scalars
    return records(car, 1), records(wheels, 4), np.ascontiguousarray(plant.drag_over_v)


def records(columns: Mapping[str, Any], n: int) -> Any:
    """Return `n` records of these float columns."""
    out = np.empty((n, len(columns)))
    for i, x in enumerate(columns.values()):
        out[:, i] = x
    return out.view([(name, np.float64) for name in columns]).reshape(n)
