"""Read scenario files: what is driven, where, and how it is measured."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

from aqualog.config.reader import Key, Table, is_number, is_real, quoted, read
from aqualog.config.vehicle import load_vehicle
from aqualog.core.errors import ConfigError
from aqualog.core.vehicle import Vehicle
from aqualog.model.scenario import SURFACES, Excitation, Kick, Lane, Profile, Scenario, Steering
from aqualog.model.sensors import FAULT_KINDS, SENSORS, SensorFault, Sensors
from aqualog.model.tyre import TYRE_KEYS, TYRES, Tyre

__all__ = ["SAMPLE_RATES_HZ", "SCENARIO_KEYS", "load_scenario", "vehicle_of"]

SAMPLE_RATES_HZ = (10, 20, 25, 40, 50, 100, 125, 200, 250, 500, 1000)  # whole milliseconds
LONGEST_S = 7200.0  # an hour takes a gigabyte of memory
LATERAL_LIMIT = 12.0  # [m/s^2] no tyre of a road car gives more
_DAY, _FAR = 86400.0, 1e7  # [s], [m]
_TABLES = ("lane", "kick", "fault", "steering", "excitation")
_WAVEFORMS = ("triangle", "sine", "ramp", "step")
_AMPLITUDES = {"amplitude_n": "force", "amplitude_mu": "mu", "amplitude_relative": "relative"}


def _number(
    table: str, name: str, unit: str, default: float | None, low: float, high: float, meaning: str
) -> Key:  # fmt: skip
    return Key(table, name, "number", unit, default, meaning, low, high)


def _text(table: str, name: str, default: str | None, meaning: str) -> Key:
    return Key(table, name, "text", "", default, meaning)


_ALL = [
    _text("", "vehicle", None, "vehicle file, relative to the scenario file; must be given"),
    _text("", "tyre", "worn_summer", f"{', '.join(TYRES)}, or a table: a `base` and what differs from it, SI"),
    _text("", "tyre_front", None, "tyre of the front axle, in place of `tyre`"),
    _text("", "tyre_rear", None, "tyre of the rear axle, in place of `tyre`"),
    _number("", "pressure_bar", "bar", 1.9, 0.5, 10.0, "gauge pressure of the tyres"),
    _number("", "pressure_front_bar", "bar", None, 0.5, 10.0, "of the front axle, in place of `pressure_bar`"),
    _number("", "pressure_rear_bar", "bar", None, 0.5, 10.0, "of the rear axle, in place of `pressure_bar`"),
    _number("", "load_front_kg", "kg", 0.0, 0.0, 20000.0, "load over the front axle, at most the car's own mass"),
    _number("", "load_rear_kg", "kg", 0.0, 0.0, 20000.0, "load over the rear axle, at most the car's own mass"),
    _number("", "duration_s", "s", 20.0, 0.1, LONGEST_S, "length of the drive"),
    _number("", "sample_rate_hz", "Hz", 100.0, 10.0, 1000.0, f"one of {', '.join(map(str, SAMPLE_RATES_HZ))}"),
    _number("", "seed", "-", 1.0, 0.0, 2.0**63 - 1.0, "whole number: the same gives the same drive"),
    _number("", "speed_kmh", "km/h", None, 0.0, 300.0, "constant speed; this or `profile` must be given"),
    _number("", "profile", "s, km/h", None, 0.0, 300.0, "speed over time, [[t, v], ...]"),
    _text("", "sensors", "esc", "esc: noise, quantisation and delays of series sensors; ideal: none of these"),
    _number("", "head_wind_kmh", "km/h", 0.0, -150.0, 150.0, "wind against the car"),
    _number("", "grade_percent", "%", 0.0, -40.0, 40.0, "slope, uphill positive"),
    _number("", "grade_profile", "m, %", None, -40.0, 40.0, "slope over the way, [[s, percent], ...]"),
    _number("", "brake_profile", "s, N*m", None, 0.0, 50000.0, "brake torque of all wheels, [[t, M], ...]"),
    _number("", "torque_profile", "s, N*m", None, -20000.0, 20000.0, "drive torque on top of the driver's"),
    _number("", "vectoring_profile", "s, N*m", None, -5000.0, 5000.0, "torque from the left to the right wheel of the "
        "driven axle, of awd the rear one, [[t, M], ...]"),
    _number("", "split_profile", "s, -", None, 0.0, 1.0, "rear share of the drive torque (awd), [[t, share], ...]"),
    _number("", "wind_profile", "s, km/h", None, -150.0, 150.0, "head wind over time, on top of `head_wind_kmh`"),
    _number("", "drive_share_profile", "s, -", None, 0.0, 2.0, "share of the driver's torque that arrives"),
    _text("", "brakes", "plain", "plain, antilock"),
    _number("", "unevenness_cm3", "cm^3", 0.0, 0.0, 1024.0, "of the road, G_d(n_0) of [iso8608_2016]: 16 very good, 64 "
        "good, 256 average"),
    _number("", "steering_friction_n", "N", 0.0, 0.0, 1000.0, "dry friction of the rack: 100-200 on cars (K)"),
    _number("", "water_scatter", "-", 1.0, 0.0, 3.0, "scales how the contact varies on water; 0: even"),
    _number("lane", "start_s", "s", None, 0.0, _DAY, "time at which the lane begins; or `start_m`"),
    _number("lane", "end_s", "s", None, 0.0, _DAY, "time at which it ends, also beyond the drive; or `end_m`"),
    _number("lane", "start_m", "m", None, 0.0, _FAR, "way of the front axle at which the lane begins"),
    _number("lane", "end_m", "m", None, 0.0, _FAR, "way at which it ends"),
    _number("lane", "water_depth_mm", "mm", 0.0, 0.0, 20.0, "water in both tracks"),
    _number("lane", "water_depth_left_mm", "mm", 0.0, 0.0, 20.0, "water in the left track"),
    _number("lane", "water_depth_right_mm", "mm", 0.0, 0.0, 20.0, "water in the right track"),
    _number("lane", "irregularity_left", "-", 0.05, 0.0, 1.0, "rms of the depth along the lane, over its mean"),
    _number("lane", "irregularity_right", "-", 0.05, 0.0, 1.0, "as left"),
    _text("lane", "surface", "asphalt", ", ".join(SURFACES)),
    _text("lane", "surface_right", None, "under the right wheels, if it is another one than under the left"),
    _number("kick", "at_m", "m", None, 0.0, _FAR, "way of the front axle at a kerb or hole; must be given"),
    _number("kick", "length_m", "m", 0.5, 0.1, 10.0, "length of the blow; the load rebounds for twice as long"),
    _text("kick", "side", "both", "left, right, both"),
    _number("kick", "torque_nm", "N*m", 0.0, 0.0, 5000.0, "torque against the wheel at its height"),
    _number("kick", "load_n", "N", 0.0, -20000.0, 20000.0, "load on the wheel at its height"),
    _text("fault", "signal", None, "signal or bus message that fails; must be given"),
    _number("fault", "start_s", "s", None, 0.0, _DAY, "begin; must be given"),
    _number("fault", "end_s", "s", None, 0.0, _DAY, "end; must be given"),
    _text("fault", "kind", "missing", ", ".join(FAULT_KINDS)),
    _text("steering", "kind", "sine", "sine; hold: the angle rises within half a period and stays; "
          "lane_change: a period to one side, one straight ahead, one back"),
    _number("steering", "amplitude_deg", "deg", None, -45.0, 45.0, "mean road-wheel angle; first half a lobe to the "
            "left"),
    _number("steering", "steering_wheel_amplitude_deg", "deg", None, -720.0, 720.0, "over the `steering_ratio`"),
    _number("steering", "period_s", "s", None, 0.2, 3600.0, "period; must be given"),
    _number("steering", "start_s", "s", 1.0, 0.0, _DAY, "begin"),
    _text("excitation", "kind", None, f"{', '.join(_WAVEFORMS)}; all-wheel drive only; must be given"),
    _number("excitation", "amplitude_n", "N", None, 1.0, 5000.0, "force from axle to axle"),
    _number("excitation", "amplitude_mu", "-", None, 0.001, 0.4, "as traction coefficient; one of the three"),
    _number("excitation", "amplitude_relative", "-", None, 0.001, 1.0, "as share of the nominal axle force"),
    _number("excitation", "period_s", "s", None, 0.05, 3600.0, "period; must be given"),
]  # fmt: skip

SCENARIO_KEYS: dict[str, Key] = {k.path: k for k in _ALL}


def load_scenario(path: Path) -> Scenario:
    """Read and check a scenario file.

    Keys, units, bounds and defaults: see `SCENARIO_KEYS`. An empty `[steering]` or `[excitation]` has no effect.

    Raises
    ------
    ConfigError
        With all faults of the file, and of the vehicle file that it names, in one message.
    """
    file = read(path, "scenario file")
    _check_names(file, "", *_TABLES)
    vehicle = _vehicle(file, path.parent)
    car = vehicle or Vehicle()  # so that the rest of the file is checked too; never returned
    tyre = _tyre(file, "tyre", car) or TYRES["worn_summer"].as_fitted(car)
    _not_all(file, "tyre", ("tyre_front", "tyre_rear"))
    _not_all(file, "pressure_bar", ("pressure_front_bar", "pressure_rear_bar"))
    bar = _value(file, "pressure_bar")
    loads = {name: _value(file, name) for name in ("load_front_kg", "load_rear_kg")}
    for name, load in loads.items():
        if vehicle is not None and load > vehicle.mass:
            file.add(name, f"{name} = {load:g} is more than the vehicle's own mass, {vehicle.mass:g} kg")
    duration = _value(file, "duration_s")
    speed = _speed(file)
    if "split_profile" in file and car.drivetrain != "awd" and vehicle is not None:
        file.add("split_profile", f'split_profile needs an "awd" car; the vehicle is "{car.drivetrain}"')
    scenario = Scenario(
        vehicle=car,
        tyre_front=_tyre(file, "tyre_front", car) or tyre,
        tyre_rear=_tyre(file, "tyre_rear", car) or tyre,
        p_front=_value(file, "pressure_front_bar", bar) * 1e5,
        p_rear=_value(file, "pressure_rear_bar", bar) * 1e5,
        load_front=loads["load_front_kg"],
        load_rear=loads["load_rear_kg"],
        duration_s=duration,
        rate_hz=_rate(file),
        seed=_seed(file),
        speed=speed,
        lanes=_lanes(file),
        steering=_steering(file.table("steering"), vehicle, speed, duration),
        excitation=_excitation(file.table("excitation"), vehicle),
        brake_torque=_profile(file, "brake_profile"),
        extra_torque=_profile(file, "torque_profile"),
        vectoring=_profile(file, "vectoring_profile"),
        split_rear=_profile(file, "split_profile"),
        grade=_grade(file),
        head_wind=_value(file, "head_wind_kmh") / 3.6,
        unevenness=_value(file, "unevenness_cm3") * 1e-6,
        steering_friction=_value(file, "steering_friction_n"),
        water_scatter=_value(file, "water_scatter"),
        wind=tuple((t, v / 3.6) for t, v in _profile(file, "wind_profile")),
        drive_share=_profile(file, "drive_share_profile"),
        antilock=_choice(file, "brakes", ("plain", "antilock")) == "antilock",
        kicks=tuple(_kick(table) for table in file.tables("kick")),
        sensors=_sensors(file),
    )
    file.faults.raise_if_any()
    return scenario


def vehicle_of(path: Path) -> list[Path]:
    """Return the vehicle file that a scenario names, if any, so that a result does not overwrite it."""
    named = read(path, "scenario file").get("vehicle")
    return [path.parent / named] if isinstance(named, str) and "\0" not in named else []


# --- names and plain values


def _key(table: Table, name: str) -> Key:
    return SCENARIO_KEYS[f"{table.name}.{name}" if table.name else name]


def _check_names(table: Table, name: str, *extra: str) -> None:
    table.check_names(*(k.name for k in SCENARIO_KEYS.values() if k.table == name), *extra)


def _value(table: Table, name: str, default: float | None = None) -> float:
    """Return the number of a key, or its default; after a fault a value that lets the reading go on."""
    key = _key(table, name)
    usual = default if default is not None else key.default if isinstance(key.default, float) else key.low
    number = table.number(name, key)
    return usual if number is None else number


def _required(table: Table, name: str) -> float:
    if name not in table:
        table.add("", f"{table.name}: {name} is missing")
    return _value(table, name)


def _choice(table: Table, name: str, known: Collection[str]) -> str:
    key = _key(table, name)
    if name not in table and key.default is None:
        table.add("", f"{table.name}: {name} is missing; one of {quoted(known)}")
    return table.choice(name, known, key.default if isinstance(key.default, str) else next(iter(known)))


def _one_of(table: Table, names: Collection[str]) -> str | None:
    """Return which one of several keys is given; no key or more than one is a fault."""
    given = [n for n in names if n in table]
    if len(given) == 1:
        return given[0]
    where = f"{table.name}: " if table.name else ""
    if given:
        table.add(given[1], f"{where}{' and '.join(given)} exclude each other")
    else:
        table.add("", f"{where}{' or '.join(names)} is missing")
    return None


def _not_all(table: Table, common: str, own: tuple[str, str]) -> None:
    if common in table and all(n in table for n in own):
        table.add(common, f"{common} says nothing beside {own[0]} and {own[1]}")


def _profile(file: Table, name: str, *, over: str = "t [s]", end: float = _DAY, values: str = "") -> Profile:
    """Return pairs of a strictly increasing number and a value, as they stand in the file."""
    if name not in file:
        return ()
    key, points = SCENARIO_KEYS[name], file.get(name)
    if not isinstance(points, list) or not points:
        file.add(name, f"{name} is not a list of pairs such as [[0.0, 1.0], [10.0, 2.0]]")
        return ()
    unit = key.unit.rsplit(", ", maxsplit=1)[-1]
    pairs: list[tuple[float, float]] = []
    for n, point in enumerate(points, 1):
        if not isinstance(point, list) or len(point) != 2 or not all(is_real(x) for x in point):
            pair = f"{over}, {values or f'value [{unit}]'}"
            file.add(name, f"{name}: point {n} is not a pair of numbers [{pair}]")
            return ()
        x, y = float(point[0]), float(point[1])
        if not 0.0 <= x <= end:
            file.add(name, f"{name}: point {n}: {over} = {x:g} is outside 0 ... {end:g}")
        elif pairs and x <= pairs[-1][0]:
            file.add(name, f"{name}: point {n}: {over} = {x:g} does not come after {pairs[-1][0]:g}")
        if not key.low <= y <= key.high:
            file.add(name, f"{name}: point {n}: {y:g} is outside {key.low:g} ... {key.high:g} {unit}")
        pairs.append((x, y))
    return tuple(pairs)


# --- car


def _vehicle(file: Table, base: Path) -> Vehicle | None:
    name = file.get("vehicle")
    if name is None:
        file.add("vehicle", 'vehicle is missing; expected vehicle = "vehicle.toml"')
        return None
    if not isinstance(name, str) or not name or "\0" in name:
        file.add("vehicle", f"vehicle = {repr(name)[:40]} is not the name of a vehicle file")
        return None
    try:
        return load_vehicle(base / name)
    except ConfigError as error:
        file.add("vehicle", f"vehicle: {error.line()}")
        return None


def _tyre(file: Table, name: str, car: Vehicle) -> Tyre | None:
    given = file.get(name)
    if given is None:
        return None
    if isinstance(given, str) and given in TYRES:
        return TYRES[given].as_fitted(car)
    if not isinstance(given, dict):
        file.add(name, f"{name} = {repr(given)[:40]} is not one of {quoted(TYRES)}, or a table")
        return None
    table = file.table(name)
    base = table.choice("base", TYRES, "worn_summer")
    values = table.numbers(TYRE_KEYS, "base")
    changed: dict[str, Any] = {"name": f"{base}, changed" if values else base, **values}
    return replace(TYRES[base], **changed).as_fitted(car, values)


# --- drive


def _rate(file: Table) -> float:
    rate = file.get("sample_rate_hz", SCENARIO_KEYS["sample_rate_hz"].default)
    if is_number(rate) and rate in SAMPLE_RATES_HZ:
        return float(rate)
    rates = ", ".join(map(str, SAMPLE_RATES_HZ))
    file.add("sample_rate_hz", f"sample_rate_hz = {str(rate)[:40]} is not one of {rates}")
    return 100.0


def _seed(file: Table) -> int:
    seed = file.get("seed", 1)
    if isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < 2**63:
        file.add("seed", f"seed = {str(seed)[:40]} is not a whole number from 0 to 2^63 - 1")
        return 1
    return seed


def _speed(file: Table) -> Profile:
    _one_of(file, ("speed_kmh", "profile"))
    points = _profile(file, "profile", values="v [km/h]")
    if "speed_kmh" not in file:
        return tuple((t, v / 3.6) for t, v in points)
    if isinstance(file.get("speed_kmh"), list):
        file.add("speed_kmh", "speed_kmh is one number; a speed that changes is profile = [[t, km/h], ...]")
        return ()
    return ((0.0, _value(file, "speed_kmh") / 3.6),)


def _grade(file: Table) -> Profile:
    if "grade_percent" in file and "grade_profile" in file:
        file.add("grade_profile", "grade_percent and grade_profile exclude each other")
    percent = _value(file, "grade_percent")
    points = _profile(file, "grade_profile", over="s [m]", end=_FAR) or (((0.0, percent),) if percent else ())
    return tuple((s, math.atan(p / 100.0)) for s, p in points)


# --- lanes, kerbs and faults


def _lanes(file: Table) -> tuple[Lane, ...]:
    lanes: dict[int, Lane] = {}
    for index, table in enumerate(file.tables("lane")):
        lane = _lane(table)
        if lane is None:
            continue
        same = ((n, k) for n, k in lanes.items() if k.in_metres == lane.in_metres)
        other = next((n for n, k in same if k.start < lane.end and lane.start < k.end), None)
        if other is not None:
            unit = "m" if lane.in_metres else "s"
            table.add(
                f"start_{unit}",
                f"lane {index + 1} ({lane.start:g} ... {lane.end:g} {unit}) overlaps lane {other + 1} "
                f"({lanes[other].start:g} ... {lanes[other].end:g} {unit})",
            )
        lanes[index] = lane
    return tuple(lanes.values())


def _lane(table: Table) -> Lane | None:
    _check_names(table, "lane")
    water = ("water_depth_mm", "water_depth_left_mm", "water_depth_right_mm")
    if water[0] in table and any(n in table for n in water[1:]):
        table.add(water[0], f"{water[0]} excludes {water[1]} and {water[2]}")
    if not any(n in table for n in (*water, "surface")):
        table.add("", "lane has neither water_depth_mm nor a surface")
    both = _value(table, water[0])
    left, right = (_value(table, n, both) for n in water[1:])
    left_rms, right_rms = (_value(table, f"irregularity_{side}") for side in ("left", "right"))
    surface = SURFACES[_choice(table, "surface", SURFACES)]
    right_surface = SURFACES[_choice(table, "surface_right", SURFACES)] if "surface_right" in table else None
    first, last = (_one_of(table, (f"{e}_s", f"{e}_m")) for e in ("start", "end"))
    if first is None or last is None:
        return None
    start, end = _value(table, first), _value(table, last, math.inf)
    in_metres = first == "start_m"
    if in_metres != (last == "end_m"):
        table.add(last, f"lane: {first} and {last} do not go together; both in s or both in m")
        return None
    if start >= end:
        table.add(last, f"lane: {last} = {end:g} does not come after {first} = {start:g}")
        return None
    return Lane(start, end, in_metres, left / 1e3, right / 1e3, left_rms, right_rms, surface, right_surface)


def _kick(table: Table) -> Kick:
    _check_names(table, "kick")
    at = _required(table, "at_m")
    side: Any = _choice(table, "side", ("both", "left", "right"))
    length, torque, load = (_value(table, n) for n in ("length_m", "torque_nm", "load_n"))
    return Kick(at, length, side, torque, load)


def _sensors(file: Table) -> Sensors:
    sensors = SENSORS[_choice(file, "sensors", tuple(SENSORS))]
    known = {n for g in sensors.groups for n in (g.name, *g.signals)}
    faults = []
    for table in file.tables("fault"):
        _check_names(table, "fault")
        where = _choice(table, "signal", sorted(known))
        start, end = (_required(table, n) for n in ("start_s", "end_s"))
        if start >= end:
            table.add("end_s", f"fault: end_s = {end:g} does not come after start_s = {start:g}")
        kind: Any = _choice(table, "kind", FAULT_KINDS)
        faults.append(SensorFault(where, start, end, kind))
    return replace(sensors, faults=tuple(faults)) if faults else sensors


# --- steering and excitation


def _steering(table: Table, vehicle: Vehicle | None, speed: Profile, duration: float) -> Steering | None:
    if not table.values:
        return None
    _check_names(table, "steering")
    kind: Any = _choice(table, "kind", ("sine", "hold", "lane_change"))
    period = _required(table, "period_s")
    start = _value(table, "start_s")
    name = _one_of(table, ("amplitude_deg", "steering_wheel_amplitude_deg"))
    if name is None:
        return None
    degrees = _value(table, name, 0.0)
    if vehicle is None:
        return None
    is_road_wheel = name == "amplitude_deg"
    angle = math.radians(degrees if is_road_wheel else degrees / vehicle.steering_ratio)
    v = _top_speed(speed, duration)
    lateral = v * v * abs(angle) / vehicle.wheelbase
    if lateral > LATERAL_LIMIT:
        other = f"steering_wheel_amplitude_deg = {degrees:g}"
        hint = f"; this is the angle of the road wheels, that of the steering wheel is {other}" if is_road_wheel else ""
        table.add(
            name,
            f"{name} = {degrees:g} asks for {lateral:.3g} m/s² to the side at {v * 3.6:.3g} km/h, more than "
            f"{LATERAL_LIMIT:g}{hint}",
        )
    return Steering(angle, period, start, kind)


def _excitation(table: Table, vehicle: Vehicle | None) -> Excitation | None:
    if not table.values:
        return None
    _check_names(table, "excitation")
    kind = _choice(table, "kind", _WAVEFORMS)
    period = _required(table, "period_s")
    name = _one_of(table, tuple(_AMPLITUDES))
    amplitude = 0.0 if name is None else _value(table, name)
    if vehicle is not None and (vehicle.drivetrain != "awd" or not 0.0 < vehicle.torque_split_rear < 1.0):
        table.add(
            "",
            f'excitation needs both axles driven; the vehicle is "{vehicle.drivetrain}" with '
            f"torque_split_rear = {vehicle.torque_split_rear:g}",
        )
    kinds: Any = (kind, _AMPLITUDES.get(name or "", "force"))  # both checked against their lists
    return Excitation(kinds[0], amplitude, kinds[1], period)


def _top_speed(speed: Profile, duration: float) -> float:
    """Return the highest speed that the profile reaches within the drive. [m/s]"""
    seen = [v for t, v in speed if t <= duration] or [v for _, v in speed[:1]]
    for (t0, v0), (t1, v1) in pairwise(speed):
        if t0 <= duration < t1:
            seen.append(v0 + (duration - t0) / (t1 - t0) * (v1 - v0))
    return max(seen, default=0.0)
