"""Read scenario files: what is driven, where, and how it is measured."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

from aqualog.config.toml_file import TableFaults, is_number, is_real, load_toml
from aqualog.config.vehicle import load_vehicle
from aqualog.core.errors import ConfigError
from aqualog.core.vehicle import Vehicle
from aqualog.model.faults import FAULT_KINDS, SensorFault
from aqualog.model.scenario import Excitation, Kick, Lane, Profile, Scenario, Steering
from aqualog.model.sensors import SENSORS, Sensors
from aqualog.model.surface import SURFACES
from aqualog.model.tyre import TYRE_KEYS, TYRES, Tyre

__all__ = ["SAMPLE_RATES_HZ", "SCENARIO_KEYS", "ScenarioKey", "load_scenario", "vehicle_of"]

SAMPLE_RATES_HZ = (10, 20, 25, 40, 50, 100, 125, 200, 250, 500, 1000)  # whole milliseconds
LONGEST_S = 7200.0  # an hour takes a gigabyte of memory
LATERAL_LIMIT = 12.0  # [m/s^2] no tyre of a road car gives more
_DAY, _FAR = 86400.0, 1e7  # [s], [m]
_WAVEFORMS = ("triangle", "sine", "ramp", "step")
_AMPLITUDES = {"amplitude_n": "force", "amplitude_mu": "mu", "amplitude_relative": "relative"}


@dataclass(frozen=True, slots=True)
class ScenarioKey:
    """One key of a scenario file.

    `table` is the TOML table, empty for the top level. `default` None: required, or without effect if left out. `low`
    and `high` bound numbers, and the values of profiles.
    """

    table: str
    name: str
    unit: str
    default: float | str | None
    low: float
    high: float
    meaning: str

    @property
    def path(self) -> str:
        """`lane.start_s`."""
        return f"{self.table}.{self.name}" if self.table else self.name


def _text(table: str, name: str, default: str | None, meaning: str) -> ScenarioKey:
    return ScenarioKey(table, name, "", default, -math.inf, math.inf, meaning)


_ALL = [
    _text("", "vehicle", None, "vehicle file, relative to the scenario file; must be given"),
    _text("", "tyre", "worn_summer", f"{', '.join(TYRES)}, or a table: a `base` and what differs from it, SI"),
    _text("", "tyre_front", None, "tyre of the front axle, in place of `tyre`"),
    _text("", "tyre_rear", None, "tyre of the rear axle, in place of `tyre`"),
    ScenarioKey("", "pressure_bar", "bar", 1.9, 0.5, 10.0, "inflation pressure"),
    ScenarioKey("", "pressure_front_bar", "bar", None, 0.5, 10.0, "of the front axle, in place of `pressure_bar`"),
    ScenarioKey("", "pressure_rear_bar", "bar", None, 0.5, 10.0, "of the rear axle, in place of `pressure_bar`"),
    ScenarioKey("", "load_front_kg", "kg", 0.0, 0.0, 20000.0, "load over the front axle, at most the car's own mass"),
    ScenarioKey("", "load_rear_kg", "kg", 0.0, 0.0, 20000.0, "load over the rear axle, at most the car's own mass"),
    ScenarioKey("", "duration_s", "s", 20.0, 0.1, LONGEST_S, "length of the drive"),
    ScenarioKey("", "sample_rate_hz", "Hz", 100.0, 10.0, 1000.0, f"one of {', '.join(map(str, SAMPLE_RATES_HZ))}"),
    ScenarioKey("", "seed", "-", 1.0, 0.0, 2.0**63 - 1.0, "whole number: the same gives the same drive"),
    ScenarioKey("", "speed_kmh", "km/h", None, 0.0, 300.0, "constant speed; this or `profile` must be given"),
    ScenarioKey("", "profile", "s, km/h", None, 0.0, 300.0, "speed over time, [[t, v], ...]"),
    _text("", "sensors", "esc", "esc: noise, quantisation and delays of series sensors; ideal: none of these"),
    ScenarioKey("", "head_wind_kmh", "km/h", 0.0, -150.0, 150.0, "wind against the car"),
    ScenarioKey("", "grade_percent", "%", 0.0, -40.0, 40.0, "slope, uphill positive"),
    ScenarioKey("", "grade_profile", "m, %", None, -40.0, 40.0, "slope over the way, [[s, percent], ...]"),
    ScenarioKey("", "brake_profile", "s, N*m", None, 0.0, 50000.0, "brake torque of all wheels, [[t, M], ...]"),
    ScenarioKey("", "torque_profile", "s, N*m", None, -20000.0, 20000.0, "drive torque on top of the driver's"),
    ScenarioKey("", "split_profile", "s, -", None, 0.0, 1.0, "rear share of the drive torque (awd), [[t, share], ...]"),
    ScenarioKey("", "wind_profile", "s, km/h", None, -150.0, 150.0, "head wind over time, on top of `head_wind_kmh`"),
    ScenarioKey("", "drive_share_profile", "s, -", None, 0.0, 2.0, "share of the driver's torque that arrives"),
    _text("", "brakes", "plain", "plain, antilock"),
    ScenarioKey("", "water_scatter", "-", 1.0, 0.0, 3.0, "scales how the contact varies on water; 0: even"),
    ScenarioKey("lane", "start_s", "s", None, 0.0, _DAY, "time at which the lane begins; or `start_m`"),
    ScenarioKey("lane", "end_s", "s", None, 0.0, _DAY, "time at which it ends, also beyond the drive; or `end_m`"),
    ScenarioKey("lane", "start_m", "m", None, 0.0, _FAR, "way of the front axle at which the lane begins"),
    ScenarioKey("lane", "end_m", "m", None, 0.0, _FAR, "way at which it ends"),
    ScenarioKey("lane", "water_depth_mm", "mm", 0.0, 0.0, 20.0, "water in both tracks"),
    ScenarioKey("lane", "water_depth_left_mm", "mm", 0.0, 0.0, 20.0, "water in the left track"),
    ScenarioKey("lane", "water_depth_right_mm", "mm", 0.0, 0.0, 20.0, "water in the right track"),
    ScenarioKey("lane", "irregularity_left", "-", 0.05, 0.0, 1.0, "rms of the depth along the lane, over its mean"),
    ScenarioKey("lane", "irregularity_right", "-", 0.05, 0.0, 1.0, "as left"),
    _text("lane", "surface", "asphalt", ", ".join(SURFACES)),
    _text("lane", "surface_right", None, "under the right wheels, if it is another one than under the left"),
    ScenarioKey("kick", "at_m", "m", None, 0.0, _FAR, "way of the front axle at a kerb or hole; must be given"),
    ScenarioKey("kick", "length_m", "m", 0.5, 0.1, 10.0, "length of the blow; the load rebounds for twice as long"),
    _text("kick", "side", "both", "left, right, both"),
    ScenarioKey("kick", "torque_nm", "N*m", 0.0, 0.0, 5000.0, "torque against the wheel at its height"),
    ScenarioKey("kick", "load_n", "N", 0.0, -20000.0, 20000.0, "load on the wheel at its height"),
    _text("fault", "signal", None, "signal or bus message that fails; must be given"),
    ScenarioKey("fault", "start_s", "s", None, 0.0, _DAY, "begin; must be given"),
    ScenarioKey("fault", "end_s", "s", None, 0.0, _DAY, "end; must be given"),
    _text("fault", "kind", "missing", ", ".join(FAULT_KINDS)),
    _text("steering", "kind", "sine", "sine"),
    ScenarioKey(
        "steering",
        "amplitude_deg",
        "deg",
        None,
        -45.0,
        45.0,
        "mean road-wheel angle; first half a lobe to the left",
    ),
    ScenarioKey("steering", "steering_wheel_amplitude_deg", "deg", None, -720.0, 720.0, "over the `steering_ratio`"),
    ScenarioKey("steering", "period_s", "s", None, 0.2, 3600.0, "period; must be given"),
    ScenarioKey("steering", "start_s", "s", 1.0, 0.0, _DAY, "begin"),
    _text("excitation", "kind", None, f"{', '.join(_WAVEFORMS)}; all-wheel drive only; must be given"),
    ScenarioKey("excitation", "amplitude_n", "N", None, 1.0, 5000.0, "force from axle to axle"),
    ScenarioKey("excitation", "amplitude_mu", "-", None, 0.001, 0.4, "as traction coefficient; one of the three"),
    ScenarioKey("excitation", "amplitude_relative", "-", None, 0.001, 1.0, "as share of the nominal axle force"),
    ScenarioKey("excitation", "period_s", "s", None, 0.05, 3600.0, "period; must be given"),
]

SCENARIO_KEYS: dict[str, ScenarioKey] = {k.path: k for k in _ALL}


def load_scenario(path: Path) -> Scenario:
    """Read and check a scenario file.

    Keys, units, bounds and defaults: see `SCENARIO_KEYS`. An empty `[steering]` or `[excitation]` has no effect.

    Raises
    ------
    ConfigError
        With all faults of the file, and of the vehicle file that it names, in one message.
    """
    document, text = load_toml(path, what="scenario file")
    return _Reader(path, document, TableFaults(path, text)).read()


def vehicle_of(path: Path) -> list[Path]:
    """Return the vehicle file that a scenario names, if any, so that a result does not overwrite it."""
    named = load_toml(path, what="scenario file")[0].get("vehicle")
    return [path.parent / named] if isinstance(named, str) and "\0" not in named else []


class _Reader:
    def __init__(self, path: Path, document: dict[str, Any], faults: TableFaults) -> None:
        self._path = path
        self._document = document
        self._faults = faults

    def read(self) -> Scenario:
        top, faults = self._document, self._faults
        self._check_names("", top, extra=("lane", "kick", "fault", "steering", "excitation"))
        vehicle = self._vehicle()
        car = vehicle or Vehicle()  # so that the rest of the file is checked too; never returned
        tyre = self._tyre("tyre") or TYRES["worn_summer"]
        self._not_all(top, "tyre", ("tyre_front", "tyre_rear"))
        self._not_all(top, "pressure_bar", ("pressure_front_bar", "pressure_rear_bar"))
        bar = self._number("", top, "pressure_bar")
        loads = [self._load(f"load_{axle}_kg", vehicle) for axle in ("front", "rear")]
        duration = self._number("", top, "duration_s")
        speed = self._speed()
        scenario = Scenario(
            vehicle=car,
            tyre_front=self._tyre("tyre_front") or tyre,
            tyre_rear=self._tyre("tyre_rear") or tyre,
            p_front=self._number("", top, "pressure_front_bar", bar) * 1e5,
            p_rear=self._number("", top, "pressure_rear_bar", bar) * 1e5,
            load_front=loads[0],
            load_rear=loads[1],
            duration_s=duration,
            rate_hz=self._rate(),
            seed=self._seed(),
            speed=speed,
            lanes=self._lanes(),
            steering=self._steering(vehicle, speed, duration),
            excitation=self._excitation(vehicle),
            brake_torque=self._profile("brake_profile", "t [s]", _DAY),
            extra_torque=self._profile("torque_profile", "t [s]", _DAY),
            split_rear=self._split(vehicle),
            grade=self._grade(),
            head_wind=self._number("", top, "head_wind_kmh") / 3.6,
            water_scatter=self._number("", top, "water_scatter"),
            wind=tuple((t, v / 3.6) for t, v in self._profile("wind_profile", "t [s]", _DAY)),
            drive_share=self._profile("drive_share_profile", "t [s]", _DAY),
            antilock=self._choice("", top, "brakes", ("plain", "antilock")) == "antilock",
            kicks=self._kicks(),
            sensors=self._sensors(),
        )
        faults.raise_if_any()
        return scenario

    # names and plain values

    def _check_names(self, table: str, values: Mapping[str, Any], *, extra: Collection[str] = ()) -> None:
        known = [k.name for k in SCENARIO_KEYS.values() if k.table == table]
        for name in values:
            if name not in known and name not in extra:
                self._faults.unknown(name, [*known, *extra])

    def _number(self, table: str, values: Mapping[str, Any], name: str, default: float | None = None) -> float:
        """Return the number of a key, or its default; after a fault a value that lets the reading go on."""
        key = SCENARIO_KEYS[f"{table}.{name}" if table else name]
        usual = default if default is not None else key.default if isinstance(key.default, float) else key.low
        if name not in values:
            return usual
        number = self._faults.number(values, name, low=key.low, high=key.high, unit=key.unit)
        return usual if number is None else number

    def _required(self, table: str, values: Mapping[str, Any], name: str) -> float:
        if name not in values:
            self._faults.add(table, f"{table}: {name} is missing")
        return self._number(table, values, name)

    def _choice(self, table: str, values: Mapping[str, Any], name: str, known: Collection[str]) -> str:
        key = SCENARIO_KEYS[f"{table}.{name}" if table else name]
        usual = key.default if isinstance(key.default, str) else next(iter(known))
        if name not in values and key.default is None:
            self._faults.add(table, f"{table}: {name} is missing; one of {_quoted(known)}")
        value = values.get(name, usual)
        if isinstance(value, str) and value in known:
            return value
        self._faults.add(name, f"{name} = {repr(value)[:40]} is not one of {_quoted(known)}")
        return usual

    def _one_of(self, table: str, values: Mapping[str, Any], names: Collection[str]) -> str | None:
        """Return which one of several keys is given; no key or more than one is a fault."""
        given = [n for n in names if n in values]
        if len(given) == 1:
            return given[0]
        where = f"{table}: " if table else ""
        if given:
            self._faults.add(given[1], f"{where}{' and '.join(given)} exclude each other")
        else:
            self._faults.add(table, f"{where}{' or '.join(names)} is missing")
        return None

    def _not_all(self, values: Mapping[str, Any], common: str, own: tuple[str, str]) -> None:
        if common in values and all(n in values for n in own):
            self._faults.add(common, f"{common} says nothing beside {own[0]} and {own[1]}")

    def _table(self, name: str) -> dict[str, Any]:
        table = self._document.get(name, {})
        if isinstance(table, dict):
            return table
        self._faults.add(name, f"{name} is not a table; write [{name}]")
        return {}

    def _profile(self, name: str, over: str, end: float, *, values: str = "") -> Profile:
        """Return pairs of a strictly increasing number and a value, as they stand in the file."""
        if name not in self._document:
            return ()
        key, points = SCENARIO_KEYS[name], self._document[name]
        if not isinstance(points, list) or not points:
            self._faults.add(name, f"{name} is not a list of pairs such as [[0.0, 1.0], [10.0, 2.0]]")
            return ()
        unit = key.unit.rsplit(", ", maxsplit=1)[-1]
        pairs: list[tuple[float, float]] = []
        for n, point in enumerate(points, 1):
            if not isinstance(point, list) or len(point) != 2 or not all(is_real(x) for x in point):
                pair = f"{over}, {values or f'value [{unit}]'}"
                self._faults.add(name, f"{name}: point {n} is not a pair of numbers [{pair}]")
                return ()
            x, y = float(point[0]), float(point[1])
            if not 0.0 <= x <= end:
                self._faults.add(name, f"{name}: point {n}: {over} = {x:g} is outside 0 ... {end:g}")
            elif pairs and x <= pairs[-1][0]:
                self._faults.add(name, f"{name}: point {n}: {over} = {x:g} does not come after {pairs[-1][0]:g}")
            if not key.low <= y <= key.high:
                self._faults.add(name, f"{name}: point {n}: {y:g} is outside {key.low:g} ... {key.high:g} {unit}")
            pairs.append((x, y))
        return tuple(pairs)

    # car

    def _vehicle(self) -> Vehicle | None:
        name = self._document.get("vehicle")
        if name is None:
            self._faults.add("vehicle", 'vehicle is missing; expected vehicle = "vehicle.toml"')
            return None
        if not isinstance(name, str) or not name or "\0" in name:
            self._faults.add("vehicle", f"vehicle = {repr(name)[:40]} is not the name of a vehicle file")
            return None
        try:
            return load_vehicle(self._path.parent / name)
        except ConfigError as error:
            self._faults.add("vehicle", f"vehicle: {error.line()}")
            return None

    def _tyre(self, name: str) -> Tyre | None:
        given = self._document.get(name)
        if given is None:
            return None
        if isinstance(given, dict):
            with self._faults.inside(name):
                return self._tyre_of(given)
        if isinstance(given, str) and given in TYRES:
            return TYRES[given]
        self._faults.add(name, f"{name} = {repr(given)[:40]} is not one of {_quoted(TYRES)}, or a table")
        return None

    def _tyre_of(self, table: Mapping[str, Any]) -> Tyre | None:
        base = table.get("base", "worn_summer")
        if not isinstance(base, str) or base not in TYRES:
            self._faults.add("base", f"base = {repr(base)[:40]} is not one of {_quoted(TYRES)}")
            return None
        values: dict[str, float] = {}
        for name in table:
            if name == "base":
                continue
            if name not in TYRE_KEYS:
                self._faults.unknown(name, ["base", *TYRE_KEYS])
                continue
            key = TYRE_KEYS[name]
            number = self._faults.number(table, name, low=key.low, high=key.high, unit=key.unit)
            if number is not None:
                values[name] = number
        changed: dict[str, Any] = {"name": f"{base}, changed" if values else base, **values}
        return replace(TYRES[base], **changed)

    def _load(self, name: str, vehicle: Vehicle | None) -> float:
        load = self._number("", self._document, name)
        if vehicle is not None and load > vehicle.mass:
            self._faults.add(name, f"{name} = {load:g} is more than the vehicle's own mass, {vehicle.mass:g} kg")
        return load

    # drive

    def _rate(self) -> float:
        rate = self._document.get("sample_rate_hz", SCENARIO_KEYS["sample_rate_hz"].default)
        if is_number(rate) and rate in SAMPLE_RATES_HZ:
            return float(rate)
        rates = ", ".join(map(str, SAMPLE_RATES_HZ))
        self._faults.add("sample_rate_hz", f"sample_rate_hz = {str(rate)[:40]} is not one of {rates}")
        return 100.0

    def _seed(self) -> int:
        seed = self._document.get("seed", 1)
        if isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < 2**63:
            self._faults.add("seed", f"seed = {str(seed)[:40]} is not a whole number from 0 to 2^63 - 1")
            return 1
        return seed

    def _speed(self) -> Profile:
        self._one_of("", self._document, ("speed_kmh", "profile"))
        points = self._profile("profile", "t [s]", _DAY, values="v [km/h]")
        if "speed_kmh" not in self._document:
            return tuple((t, v / 3.6) for t, v in points)
        if isinstance(self._document.get("speed_kmh"), list):
            self._faults.add("speed_kmh", "speed_kmh is one number; a speed that changes is profile = [[t, km/h], ...]")
            return ()
        return ((0.0, self._number("", self._document, "speed_kmh") / 3.6),)

    def _split(self, vehicle: Vehicle | None) -> Profile:
        if "split_profile" in self._document and vehicle is not None and vehicle.drivetrain != "awd":
            self._faults.add(
                "split_profile", f'split_profile needs an "awd" car; the vehicle is "{vehicle.drivetrain}"'
            )
        return self._profile("split_profile", "t [s]", _DAY)

    def _grade(self) -> Profile:
        if "grade_percent" in self._document and "grade_profile" in self._document:
            self._faults.add("grade_profile", "grade_percent and grade_profile exclude each other")
        percent = self._number("", self._document, "grade_percent")
        points = self._profile("grade_profile", "s [m]", _FAR) or (((0.0, percent),) if percent else ())
        return tuple((s, math.atan(p / 100.0)) for s, p in points)

    # lanes

    def _tables(self, name: str) -> list[dict[str, Any]]:
        tables = self._document.get(name, [])
        if isinstance(tables, list) and all(isinstance(t, dict) for t in tables):
            return tables
        self._faults.add(name, f"{name} is not a list of tables; write [[{name}]]")
        return []

    def _lanes(self) -> tuple[Lane, ...]:
        lanes: dict[int, Lane] = {}
        for index, table in enumerate(self._tables("lane")):
            with self._faults.inside("lane", index):
                lane = self._lane(table)
                if lane is None:
                    continue
                other = next((n for n, k in lanes.items() if _overlap(k, lane)), None)
                if other is not None:
                    unit = "m" if lane.in_metres else "s"
                    self._faults.add(
                        f"start_{unit}",
                        f"lane {index + 1} ({lane.start:g} ... {lane.end:g} {unit}) overlaps lane {other + 1} "
                        f"({lanes[other].start:g} ... {lanes[other].end:g} {unit})",
                    )
                lanes[index] = lane
        return tuple(lanes.values())

    def _lane(self, table: Mapping[str, Any]) -> Lane | None:
        self._check_names("lane", table)
        water = ("water_depth_mm", "water_depth_left_mm", "water_depth_right_mm")
        if water[0] in table and any(n in table for n in water[1:]):
            self._faults.add(water[0], f"{water[0]} excludes {water[1]} and {water[2]}")
        if not any(n in table for n in (*water, "surface")):
            self._faults.add("lane", "lane has neither water_depth_mm nor a surface")
        both = self._number("lane", table, water[0])
        left, right = (self._number("lane", table, n, both) for n in water[1:])
        left_rms, right_rms = (self._number("lane", table, f"irregularity_{side}") for side in ("left", "right"))
        surface = SURFACES[self._choice("lane", table, "surface", SURFACES)]
        right_surface = None
        if "surface_right" in table:
            right_surface = SURFACES[self._choice("lane", table, "surface_right", SURFACES)]
        first, last = (self._one_of("lane", table, (f"{e}_s", f"{e}_m")) for e in ("start", "end"))
        if first is None or last is None:
            return None
        start, end = self._number("lane", table, first), self._number("lane", table, last, math.inf)
        in_metres = first == "start_m"
        if in_metres != (last == "end_m"):
            self._faults.add(last, f"lane: {first} and {last} do not go together; both in s or both in m")
            return None
        if start >= end:
            self._faults.add(last, f"lane: {last} = {end:g} does not come after {first} = {start:g}")
            return None
        return Lane(start, end, in_metres, left / 1e3, right / 1e3, left_rms, right_rms, surface, right_surface)

    # kerbs and faults

    def _kicks(self) -> tuple[Kick, ...]:
        kicks = []
        for index, table in enumerate(self._tables("kick")):
            with self._faults.inside("kick", index):
                self._check_names("kick", table)
                at = self._required("kick", table, "at_m")
                side: Any = self._choice("kick", table, "side", ("both", "left", "right"))
                length, torque, load = (self._number("kick", table, n) for n in ("length_m", "torque_nm", "load_n"))
                kicks.append(Kick(at, length, side, torque, load))
        return tuple(kicks)

    def _sensors(self) -> Sensors:
        sensors = SENSORS[self._choice("", self._document, "sensors", tuple(SENSORS))]
        known = {n for g in sensors.groups for n in (g.name, *g.signals)}
        faults = []
        for index, table in enumerate(self._tables("fault")):
            with self._faults.inside("fault", index):
                self._check_names("fault", table)
                where = self._choice("fault", table, "signal", sorted(known))
                start, end = (self._required("fault", table, n) for n in ("start_s", "end_s"))
                if start >= end:
                    self._faults.add("end_s", f"fault: end_s = {end:g} does not come after start_s = {start:g}")
                kind: Any = self._choice("fault", table, "kind", FAULT_KINDS)
                faults.append(SensorFault(where, start, end, kind))
        return replace(sensors, faults=tuple(faults)) if faults else sensors

    # steering and excitation

    def _steering(self, vehicle: Vehicle | None, speed: Profile, duration: float) -> Steering | None:
        table = self._table("steering")
        if not table:
            return None
        with self._faults.inside("steering"):
            self._check_names("steering", table)
            self._choice("steering", table, "kind", ("sine",))
            period = self._required("steering", table, "period_s")
            start = self._number("steering", table, "start_s")
            name = self._one_of("steering", table, ("amplitude_deg", "steering_wheel_amplitude_deg"))
            if name is None:
                return None
            degrees = self._number("steering", table, name, 0.0)
            if vehicle is None:
                return None
            is_road_wheel = name == "amplitude_deg"
            angle = math.radians(degrees if is_road_wheel else degrees / vehicle.steering_ratio)
            v = _top_speed(speed, duration)
            lateral = v * v * abs(angle) / vehicle.wheelbase
            if lateral > LATERAL_LIMIT:
                hint = ""
                if is_road_wheel:
                    hint = "; this is the angle of the road wheels, that of the steering wheel is " + (
                        f"steering_wheel_amplitude_deg = {degrees:g}"
                    )
                self._faults.add(
                    name,
                    f"{name} = {degrees:g} asks for {lateral:.3g} m/s² to the side at {v * 3.6:.3g} km/h, more than "
                    f"{LATERAL_LIMIT:g}{hint}",
                )
            return Steering(angle, period, start)

    def _excitation(self, vehicle: Vehicle | None) -> Excitation | None:
        table = self._table("excitation")
        if not table:
            return None
        with self._faults.inside("excitation"):
            self._check_names("excitation", table)
            kind = self._choice("excitation", table, "kind", _WAVEFORMS)
            period = self._required("excitation", table, "period_s")
            name = self._one_of("excitation", table, tuple(_AMPLITUDES))
            amplitude = 0.0 if name is None else self._number("excitation", table, name)
            if vehicle is not None and (vehicle.drivetrain != "awd" or not 0.0 < vehicle.torque_split_rear < 1.0):
                self._faults.add(
                    "excitation",
                    f'excitation needs both axles driven; the vehicle is "{vehicle.drivetrain}" with '
                    f"torque_split_rear = {vehicle.torque_split_rear:g}",
                )
            kinds: Any = (kind, _AMPLITUDES.get(name or "", "force"))  # both checked against their lists
            return Excitation(kinds[0], amplitude, kinds[1], period)


def _quoted(names: Collection[str]) -> str:
    return ", ".join(f'"{n}"' for n in names)


def _overlap(a: Lane, b: Lane) -> bool:
    return a.in_metres == b.in_metres and a.start < b.end and b.start < a.end


def _top_speed(speed: Profile, duration: float) -> float:
    """Return the highest speed that the profile reaches within the drive. [m/s]"""
    seen = [v for t, v in speed if t <= duration] or [v for _, v in speed[:1]]
    for (t0, v0), (t1, v1) in pairwise(speed):
        if t0 <= duration < t1:
            seen.append(v0 + (duration - t0) / (t1 - t0) * (v1 - v0))
    return max(seen, default=0.0)
