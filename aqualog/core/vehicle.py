"""The vehicle as a record of SI floats, and the dictionary of its keys.

Each key carries its default and where that comes from; `V` read in the source named, `D` derived, `K` general
knowledge, not verified.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from aqualog.core.notation import WHEELS

__all__ = [
    "COEFFICIENTS", "KEYS", "POLYNOMIALS", "SOURCES", "SPLIT", "SPREAD", "WATER", "Drivetrain", "Key", "Known",
    "Provenance", "Source", "TorqueArm", "Vehicle", "WaterNumber", "arm_lines", "known_lines", "provenance_lines",
    "spread_lines", "usual", "vehicle_toml", "water_lines",
]  # fmt: skip

Drivetrain = Literal["rwd", "fwd", "awd"]
TorqueArm = Literal["effective", "loaded"]
Source = Literal["measured", "calibrated", "data_sheet", "guess"]


@dataclass(frozen=True, slots=True)
class Key:
    """One key of a vehicle file. `section` is the TOML table, empty for the top level."""

    section: str
    name: str
    unit: str
    default: float
    low: float
    high: float
    meaning: str
    source: str

    @property
    def path(self) -> str:
        """`wheels.r_e_f`."""
        return f"{self.section}.{self.name}" if self.section else self.name


_MID = "mid-size car (K)"

_ALL = [
    Key("", "mass", "kg", 1650.0, 200.0, 60000.0, "mass as driven, with driver and rig", _MID),
    Key("", "l_f", "m", 1.40, 0.3, 10.0, "centre of mass to front axle", _MID),
    Key("", "l_r", "m", 1.41, 0.3, 10.0, "centre of mass to rear axle", _MID),
    Key("", "h_cg", "m", 0.54, 0.1, 3.0, "height of the centre of mass", _MID),
    Key("", "track", "m", 1.55, 0.5, 3.0, "track width, mean of both axles", _MID),
    Key("", "drag_area", "m^2", 0.66, 0.0, 15.0, "drag coefficient times frontal area", "2.2 m^2 * 0.30 (K)"),
    Key("", "air_density", "kg/m^3", 1.204, 0.5, 1.6, "air density", "ISA at 20 degC, sea level"),
    Key("", "rolling_resistance", "-", 0.0105, 0.0, 0.1, "coefficient r_w, dry", "0.007-0.017 (V, [trb2006])"),
    Key("", "torque_split_rear", "-", 0.5, 0.0, 1.0, "rear share of drive torque", "1 rwd, 0 fwd, 0.5 awd"),
    Key("", "torque_gain", "-", 1.0, 0.1, 100.0, "torque at the wheels over the one that the log says", "none"),
    Key(
        "", "driveline_inertia", "kg*m^2", 0.0, 0.0, 100.0, "engine or motor and gears, at all driven wheels",
        "0: torque at the half shafts; engine 1-3, electric axle 3-6 (K)",
    ),
    Key("", "steering_ratio", "-", 15.0, 5.0, 40.0, "steering wheel angle over road-wheel angle", _MID),
    Key("wheels", "r_e_f", "m", 0.317, 0.1, 1.0, "effective rolling radius, front", "205/55R16 (D)"),
    Key("wheels", "r_e_r", "m", 0.317, 0.1, 1.0, "effective rolling radius, rear", "205/55R16 (D)"),
    Key("wheels", "r_l_f", "m", 0.309, 0.1, 1.0, "loaded radius, front", "0.975 r_e (D)"),
    Key("wheels", "r_l_r", "m", 0.309, 0.1, 1.0, "loaded radius, rear", "0.975 r_e (D)"),
    Key("wheels", "inertia_f", "kg*m^2", 1.15, 0.05, 50.0, "wheel inertia, front", "1.0-1.2 per wheel (K)"),
    Key("wheels", "inertia_r", "kg*m^2", 1.15, 0.05, 50.0, "wheel inertia, rear", "1.0-1.2 per wheel (K)"),
    Key(
        "tyre", "slip_slope_f", "-", 31.0, 1.0, 200.0, "C_s / F_z on dry road, front",
        "guess (K): 26 to 42 in the parts of one drive [gustafsson2000]",
    ),
    Key("tyre", "slip_slope_r", "-", 31.0, 1.0, 200.0, "C_s / F_z on dry road, rear", "as front"),
    Key("tyre", "mu_max", "-", 1.02, 0.05, 3.0, "friction of tyre and dry road", "dry asphalt (K)"),
]  # fmt: skip

POLYNOMIALS = {
    "tie_rod": "tie-rod force [N] over a front wheel's lateral (outward) and longitudinal force",
    "steering_torque": "steering torque [N·m] over the front axle's lateral force and the difference of its drive",
}
"""Sections of polynomials: c0, and c_y, c_x with powers from the first on; `sigma` is what they leave on dry road."""

SPREAD = ("mass", "drag_area", "rolling_resistance", "torque_gain")
"""Keys of the table `spread`: the standard deviation by which one more drive differs from the file's value, in the
key's unit. Wind, surface, temperature, fuel and all else that a balance of forces does not know."""

SOURCES: Mapping[Source, str] = {
    "measured": "weighed or measured on this car",
    "calibrated": "estimated from drives of this car",
    "data_sheet": "read in papers of its type",
    "guess": "taken from another car, or as good as that",
}
"""Where a value of the table `provenance` may come from, the surest first."""

SPLIT: Mapping[str, float] = {"rwd": 1.0, "fwd": 0.0, "awd": 0.5}
"""Rear share of the drive torque where a file does not set it."""

WATER: Mapping[str, str] = {
    "v_anchor": "m/s", "contact_exponent": "-",
}  # fmt: skip
"""Numbers of the law of water that this car's passes can show, with units; they are keys of a tyre in the simulator."""

COEFFICIENTS = ("c0", "c_y", "c_x", "sigma")

KEYS: dict[str, Key] = {k.path: k for k in _ALL}


def _default(path: str) -> float:
    return KEYS[path].default


@dataclass(frozen=True, slots=True)
class Provenance:
    """Where a value comes from, and its standard deviation in the key's unit; None: what is usual for the source."""

    source: Source
    sd: float | None = None


@dataclass(frozen=True, slots=True)
class Known:
    """A known fault of the car: values of an effect's parameters, and the standard deviation of the first one."""

    values: Mapping[str, float]
    spread: float = 0.0


@dataclass(frozen=True, slots=True)
class WaterNumber:
    """A number of the law of water, its standard deviation in the same unit (0: exact), and where it comes from."""

    value: float
    sd: float = 0.0
    source: Source = "calibrated"


@dataclass(frozen=True, slots=True)
class Vehicle:
    """One vehicle, SI.

    `given` are the keys that the user's file sets; a detector that needs a key which is not given says so instead of
    trusting a default. `provenance` is what the file says of its values; `core.provenance` knows the rest.
    `known`: faults by effect and place, as `signal_delay@torque`. `water`: numbers of the law of water by the names of
    `WATER`, for the tyres on this car.
    """

    name: str = "default car"
    drivetrain: Drivetrain = "rwd"
    torque_arm: TorqueArm = "effective"
    mass: float = _default("mass")
    l_f: float = _default("l_f")
    l_r: float = _default("l_r")
    h_cg: float = _default("h_cg")
    track: float = _default("track")
    drag_area: float = _default("drag_area")
    air_density: float = _default("air_density")
    rolling_resistance: float = _default("rolling_resistance")
    torque_split_rear: float = 1.0
    torque_gain: float = _default("torque_gain")
    driveline_inertia: float = _default("driveline_inertia")
    steering_ratio: float = _default("steering_ratio")
    r_e_f: float = _default("wheels.r_e_f")
    r_e_r: float = _default("wheels.r_e_r")
    r_l_f: float = _default("wheels.r_l_f")
    r_l_r: float = _default("wheels.r_l_r")
    inertia_f: float = _default("wheels.inertia_f")
    inertia_r: float = _default("wheels.inertia_r")
    slip_slope_f: float = _default("tyre.slip_slope_f")
    slip_slope_r: float = _default("tyre.slip_slope_r")
    mu_max: float = _default("tyre.mu_max")
    tie_rod: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    steering_torque: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    spread: Mapping[str, float] = field(default_factory=dict)
    provenance: Mapping[str, Provenance] = field(default_factory=dict)
    known: Mapping[str, Known] = field(default_factory=dict)
    water: Mapping[str, WaterNumber] = field(default_factory=dict)
    given: frozenset[str] = frozenset()

    @classmethod
    def read(cls, path: str | Path) -> Vehicle:
        """Read and check a vehicle file (TOML). A key that is left out takes its default; see `KEYS`.

        Raises
        ------
        ConfigError
            With all faults of the file in one message.
        """
        from aqualog.config.vehicle import load_vehicle

        return load_vehicle(Path(path))

    def r_e(self, wheel: str) -> float:
        """Effective rolling radius of a wheel. [m]"""
        return self.r_e_f if wheel[0] == "f" else self.r_e_r

    def r_l(self, wheel: str) -> float:
        """Loaded radius of a wheel. [m]"""
        return self.r_l_f if wheel[0] == "f" else self.r_l_r

    def arm(self, wheel: str) -> float:
        """Lever of a wheel's torque over its force: r_e, or r_l as Eq. (2.10) is printed, by `torque_arm`. [m]

        A wheel without slip loss that rolls on r_e gives T / r_e, since the power is the same (E24).
        """
        return self.r_e(wheel) if self.torque_arm == "effective" else self.r_l(wheel)

    def inertia(self, wheel: str) -> float:
        """Inertia of a wheel about its axis, without the driveline. [kg·m²]"""
        return self.inertia_f if wheel[0] == "f" else self.inertia_r

    def driveline(self, wheel: str) -> float:
        """Inertia of the driveline that turns with the mean of this wheel and the other of its axle. [kg·m²]"""
        return self.driveline_inertia * (self.torque_split_rear if wheel[0] == "r" else 1.0 - self.torque_split_rear)

    def turning_inertia(self, wheel: str) -> float:
        """Inertia that the torque of a wheel turns where both wheels of its axle turn alike. [kg·m²]"""
        return self.inertia(wheel) + 0.5 * self.driveline(wheel)

    @property
    def wheelbase(self) -> float:
        """Distance of the axles. [m]"""
        return self.l_f + self.l_r

    @property
    def knows_drivetrain(self) -> bool:
        """Whether the user's file says which axle is driven; without it nothing that depends on it is judged."""
        return "drivetrain" in self.given

    @property
    def driven(self) -> tuple[str, ...]:
        """Driven wheels."""
        return {"rwd": WHEELS[2:], "fwd": WHEELS[:2], "awd": WHEELS}[self.drivetrain]

    @property
    def driving(self) -> tuple[str, ...]:
        """Wheels whose torques together are all of the drive: the driven ones, all four where those are not known."""
        return self.driven if self.knows_drivetrain else WHEELS

    @property
    def watched_axle(self) -> str:
        """Axle on which minor spin-downs are looked for: the non-driven one, or the front one of an AWD car.

        On an AWD car the front wheels meet the water first and the rear wheels run in their tracks (thesis 2.8 as
        printed: front minus rear).
        """
        return "r" if self.drivetrain == "fwd" else "f"


def arm_lines(vehicle: Vehicle) -> list[str]:
    """The line of the torque's lever in a vehicle file; none for the usual one."""
    return [] if vehicle.torque_arm == "effective" else [f'torque_arm = "{vehicle.torque_arm}"']


def spread_lines(vehicle: Vehicle) -> list[str]:
    """The lines of the table `spread` in a vehicle file."""
    return [f"{n} = {vehicle.spread[n]!r}  # [{KEYS[n].unit}]" for n in SPREAD if n in vehicle.spread]


def provenance_lines(vehicle: Vehicle) -> list[str]:
    """The lines of the table `provenance` in a vehicle file."""
    said = ((k, vehicle.provenance[k.path]) for k in KEYS.values() if k.path in vehicle.provenance)
    return [
        f'{k.path} = "{p.source}"' if p.sd is None
        else f'{k.path} = {{ source = "{p.source}", sd = {p.sd!r} }}  # [{k.unit}]'
        for k, p in said
    ]  # fmt: skip


def known_lines(vehicle: Vehicle) -> list[str]:
    """The lines of the table `known` in a vehicle file."""
    return [
        f'"{key}" = {{ {", ".join(f"{n} = {v!r}" for n, v in {**fault.values, "spread": fault.spread}.items())} }}'
        for key, fault in vehicle.known.items()
    ]


def water_lines(vehicle: Vehicle) -> list[str]:
    """The lines of the table `water` in a vehicle file."""
    said = ((n, unit, vehicle.water[n]) for n, unit in WATER.items() if n in vehicle.water)
    return [
        f'{n} = {{ value = {w.value!r}, sd = {w.sd!r}, source = "{w.source}" }}  # [{unit}] 95 %: '
        f"{w.value - 1.96 * w.sd:.5g} ... {w.value + 1.96 * w.sd:.5g}"
        for n, unit, w in said
    ]


def usual(vehicle: Vehicle, key: Key) -> float:
    """The value that a key has where a file does not set it.

    A loaded radius follows the effective one, so that a truck does not get a car's; the torque's split follows the
    drivetrain.
    """
    if key.name == "torque_split_rear":
        return SPLIT[vehicle.drivetrain]
    name = key.name.replace("r_l_", "r_e_")
    is_led = name != key.name and f"{key.section}.{name}" in vehicle.given
    return 0.975 * float(getattr(vehicle, name)) if is_led else key.default


def vehicle_toml(vehicle: Vehicle) -> str:
    """The vehicle as the text of a vehicle file, every key with unit and meaning.

    Of a vehicle that comes from a file, what that file does not set stays behind #: reading the text gives the same
    record.
    """
    name = vehicle.name.replace("\\", "").replace('"', "")
    is_from_file = "name" in vehicle.given
    hidden = "# " if is_from_file and not vehicle.knows_drivetrain and vehicle.drivetrain == "rwd" else ""
    lines = [f'name = "{name}"', f'{hidden}drivetrain = "{vehicle.drivetrain}"', *arm_lines(vehicle)]
    section = ""
    for key in KEYS.values():
        if key.section != section:
            section = key.section
            lines += ["", f"[{section}]"]
        value = getattr(vehicle, key.name)
        hidden = "# " if is_from_file and key.path not in vehicle.given and value == usual(vehicle, key) else ""
        lines.append(f"{hidden}{key.name} = {value!r}  # [{key.unit}] {key.meaning}{'; not set' if hidden else ''}")
    if vehicle.spread:
        lines += ["", "[spread]", *spread_lines(vehicle)]
    if vehicle.provenance:
        lines += ["", "[provenance]", *provenance_lines(vehicle)]
    if vehicle.known:
        lines += ["", "[known]", *known_lines(vehicle)]
    if vehicle.water:
        lines += ["", "[water]", *water_lines(vehicle)]
    for section in POLYNOMIALS:
        table = getattr(vehicle, section)
        if table:
            lines += ["", f"[{section}]", *(f"{n} = {list(c)!r}" for n, c in table.items())]
    return "\n".join(lines) + "\n"
