"""What is driven, where, and how it is measured: records of a scenario file."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from aqualog.core.vehicle import Vehicle
from aqualog.model.sensors import ESC, Sensors
from aqualog.model.tyre import P_REFERENCE, TYRES, Tyre

__all__ = ["SURFACES", "Excitation", "Kick", "Lane", "Scenario", "Steering", "Surface", "Waveform"]

Waveform = Literal["triangle", "sine", "ramp", "step"]
AmplitudeKind = Literal["force", "mu", "relative"]
Profile = tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True)
class Surface:
    """One surface.

    `mu` is the friction of a tyre on it [-], None for the vehicle's own on dry asphalt; `compliance` the inverse slip
    slope of a layer that yields [-]; `rolling` extra rolling resistance coefficient [-]; `roughness` rms of the wheel
    torque that unevenness makes [N·m]; `source` where the values come from (K: general knowledge).
    """

    name: str
    mu: float | None = None
    compliance: float = 0.0
    rolling: float = 0.0
    roughness: float = 0.0
    source: str = ""


SURFACES: dict[str, Surface] = {
    s.name: s
    for s in (
        Surface("asphalt"),
        Surface("damp", mu=0.85, source="wet without a layer of water: least effect on the slope (V, [carlson2005])"),
        # slope 30 -> 10 on low friction (thesis 3.3): 1/10 = 1/30 + 1/15
        Surface("snow", mu=0.30, compliance=1.0 / 15.0, rolling=0.012, roughness=15.0, source="snow on asphalt (K)"),
        Surface("snow_on_ice", mu=0.29, compliance=1.0 / 30.0, rolling=0.008, roughness=8.0, source="Fig. 3.1 (D)"),
        Surface("deep_snow", mu=0.30, compliance=1.0 / 12.0, rolling=0.035, roughness=25.0, source="fresh (K)"),
        Surface("ice", mu=0.12, source="dry ice: slope as on asphalt (thesis 3.1)"),
        Surface("wet_ice", mu=0.06, compliance=1.0 / 60.0, source="thesis Fig. 3.1 (D)"),
        Surface("gravel", mu=0.60, compliance=1.0 / 25.0, rolling=0.015, roughness=60.0, source="(K)"),
        Surface("rough", roughness=60.0, source="broken asphalt (K)"),
    )
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Lane:
    """A stretch of road that is not dry asphalt, between two times [s] or two positions [m] (`in_metres`).

    `depth_left`, `depth_right`: mean water [m]; `irregularity_left`, `irregularity_right`: rms of the depth along the
    lane, relative to its mean [-]; `surface_right` where the right wheels run on another surface than the left ones.
    """

    start: float
    end: float
    in_metres: bool = False
    depth_left: float = 0.0
    depth_right: float = 0.0
    irregularity_left: float = 0.05
    irregularity_right: float = 0.05
    surface: Surface = SURFACES["asphalt"]
    surface_right: Surface | None = None


@dataclass(frozen=True, slots=True)
class Kick:
    """A kerb, joint or hole that the wheels of a side meet, front ones first, rear ones a wheelbase later.

    `at`: way of the front axle [m]; `length` of the blow [m]; `torque` against the wheel [N·m] and `load` on it [N] at
    its height; the load rebounds to minus half of it. `side`: left, right or both.
    """

    at: float
    length: float = 0.5
    side: Literal["left", "right", "both"] = "both"
    torque: float = 0.0
    load: float = 0.0


@dataclass(frozen=True, slots=True)
class Steering:
    """Steering by an angle over time: amplitude of the mean road-wheel angle [rad], period [s], start [s].

    `sine` swings about straight ahead. `hold` rises within half a period and stays: a circle. `lane_change`: a
    period to one side, a period straight ahead, a period back.
    """

    amplitude: float
    period_s: float
    start_s: float = 1.0
    kind: Literal["sine", "hold", "lane_change"] = "sine"


@dataclass(frozen=True, slots=True)
class Excitation:
    """Active excitation of the axle forces (thesis 3.3).

    `amplitude` is a force [N], a traction coefficient or a share of the nominal axle force [-], by `amplitude_kind`.
    """

    waveform: Waveform
    amplitude: float
    amplitude_kind: AmplitudeKind
    period_s: float


@dataclass(frozen=True, slots=True)
class Scenario:
    """One drive, SI throughout. Profiles are (t [s], value) pairs, linear between and constant beyond."""

    vehicle: Vehicle
    tyre_front: Tyre = TYRES["worn_summer"]
    tyre_rear: Tyre = TYRES["worn_summer"]
    p_front: float = P_REFERENCE  # [Pa]
    p_rear: float = P_REFERENCE
    load_front: float = 0.0  # [kg] over the front axle
    load_rear: float = 0.0
    duration_s: float = 20.0
    rate_hz: float = 100.0
    seed: int = 1
    speed: Profile = ((0.0, 98.0 / 3.6),)  # [m/s] what the driver wants
    lanes: tuple[Lane, ...] = ()
    steering: Steering | None = None
    excitation: Excitation | None = None
    brake_torque: Profile = ()  # [N m] sum of all wheels
    extra_torque: Profile = ()  # [N m] drive torque on top of the driver's, sum of the driven wheels
    vectoring: Profile = ()  # [N m] from the left to the right wheel of the (rear) driven axle
    split_rear: Profile = ()  # rear share of the drive torque over time; empty: the vehicle's
    grade: Profile = ()  # (s [m], slope angle [rad]) over the position
    head_wind: float = 0.0  # [m/s]
    wind: Profile = ()  # [m/s] head wind over time, on top of `head_wind`
    drive_share: Profile = ()  # share of the driver's torque that reaches the wheels over time; empty: all of it
    antilock: bool = False  # brakes with an antilock system
    kicks: tuple[Kick, ...] = ()
    unevenness: float = 0.0  # [m³] of the whole road, G_d(n_0) of [iso8608_2016]; 0: even
    steering_friction: float = 0.0  # [N] dry friction of the rack
    water_scatter: float = 1.0  # scales the fluctuation of contact and track film; 0: even
    sensors: Sensors = field(default=ESC)
