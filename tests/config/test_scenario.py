"""Scenario files: what they mean, and what is said of those that are wrong."""

import json
import math
from dataclasses import fields, replace

import pytest

from aqualog.config.scenario import SAMPLE_RATES_HZ, SCENARIO_KEYS, load_scenario
from aqualog.config.vehicle import load_vehicle
from aqualog.core.errors import ConfigError
from aqualog.model.scenario import SURFACES, Kick, Lane, Scenario
from aqualog.model.sensors import ESC, IDEAL, SensorFault
from aqualog.model.tyre import TYRE_KEYS, TYRES

# letter by letter, with its comments
CONTRACT = """
vehicle = "vehicle.toml"
tyre = "worn_summer"             # very_worn_summer | worn_summer | new_summer | new_winter, or a table of its parameters
pressure_bar = 1.9               # or pressure_front_bar, pressure_rear_bar
duration_s = 20.0
sample_rate_hz = 100.0
seed = 1
speed_kmh = 98.0                 # constant speed, or profile = [[0.0, 60.0], [20.0, 130.0]]  (t [s], v [km/h])
load_front_kg = 0.0
sensors = "esc"                  # esc (noise, quantisation, delays of series sensors) | ideal
[[lane]]                         # any number; start and end in s or m
start_s = 6.0
end_s = 14.0
water_depth_mm = 1.3             # or water_depth_left_mm, water_depth_right_mm; surface = "snow" | "ice" | "gravel" for other surfaces
[steering]                       # optional: kind = "sine", amplitude_deg, period_s
[excitation]                     # optional: kind = triangle | sine | ramp | step, amplitude_n | amplitude_mu | amplitude_relative, period_s
"""
VEHICLE = 'name = "sedan"\ndrivetrain = "rwd"\nmass = 1680.0\nl_f = 1.3\nl_r = 1.5\nsteering_ratio = 16.0\n'
SHORT = 'vehicle = "vehicle.toml"\nspeed_kmh = 36.0\n'
LANE = "[[lane]]\nwater_depth_mm = 1.0\n"


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "vehicle.toml").write_text(VEHICLE)
    (tmp_path / "awd.toml").write_text(VEHICLE.replace("rwd", "awd"))
    return tmp_path


def load(folder, text):
    (folder / "scenario.toml").write_text(text, encoding="utf-8")
    return load_scenario(folder / "scenario.toml")


def told(folder, text):
    """What is said against a file, in one line; nothing against a sound one."""
    said = ""
    try:
        load(folder, text)
    except ConfigError as error:
        said = str(error)
    assert "\n" not in said
    return said


def test_scenario_of_the_contract(folder):
    car = load_vehicle(folder / "vehicle.toml")
    lane = Lane(6.0, 14.0, depth_left=1.3e-3, depth_right=1.3e-3)
    assert load(folder, CONTRACT) == Scenario(car, lanes=(lane,))
    assert CONTRACT.count("#") == 8


def test_what_is_left_out_is_the_default_of_the_record(folder):
    found = load(folder, 'vehicle = "vehicle.toml"\nspeed_kmh = 98.0')
    plain = Scenario(load_vehicle(folder / "vehicle.toml"))
    for f in fields(Scenario):
        assert getattr(found, f.name) == getattr(plain, f.name), f.name


def test_listed_defaults_are_those_that_are_taken(folder):
    bare = SHORT + "[[lane]]\nstart_s = 1\nend_s = 2\nwater_depth_mm = 0\n[steering]\namplitude_deg = 1\nperiod_s = 2\n"
    bare = bare.replace("vehicle.toml", "awd.toml") + '[excitation]\nkind = "sine"\namplitude_n = 100\nperiod_s = 2\n'
    bare += '[[kick]]\nat_m = 5\n[[fault]]\nsignal = "a_x"\nstart_s = 1\nend_s = 2\n'
    before = load(folder, bare)
    for key in SCENARIO_KEYS.values():
        if key.default is None or key.name == "water_depth_mm":
            continue
        value = int(key.default) if key.name == "seed" else key.default
        line = f"{key.name} = {json.dumps(value)}\n"
        header = {"": "", "steering": "[steering]\n", "excitation": "[excitation]\n"}.get(
            key.table, f"[[{key.table}]]\n"
        )
        text = bare.replace(header, header + line, 1) if header else line + bare
        if "water_depth" in key.name:
            text = text.replace("water_depth_mm = 0\n", 'surface = "asphalt"\n')
        assert load(folder, text) == before, key.path


def test_every_key_says_what_it_is():
    for path, key in SCENARIO_KEYS.items():
        assert path == key.path
        assert key.meaning
        assert key.low < key.high
        if isinstance(key.default, float):
            assert key.low <= key.default <= key.high


def test_units(folder):
    text = """
vehicle = "vehicle.toml"
profile = [[0, 36.0], [10, 72.0]]
pressure_front_bar = 2.5
pressure_bar = 2.1
load_rear_kg = 120
head_wind_kmh = 18.0
grade_percent = 100.0
brake_profile = [[1, 0], [2, 500]]
torque_profile = [[0, -20]]
water_scatter = 0.0
unevenness_cm3 = 64.0
steering_friction_n = 150.0
sensors = "ideal"
seed = 42
""".replace("grade_percent = 100.0", "grade_profile = [[0, 0.0], [50.0, 10.0]]")
    found = load(folder, text)
    assert found.speed == ((0.0, 10.0), (10.0, 20.0))
    assert (found.p_front, found.p_rear) == pytest.approx((2.5e5, 2.1e5))
    assert (found.load_front, found.load_rear) == (0.0, 120.0)
    assert found.head_wind == pytest.approx(5.0)
    assert found.grade == ((0.0, 0.0), (50.0, pytest.approx(math.atan(0.1))))
    assert found.brake_torque == ((1.0, 0.0), (2.0, 500.0))
    assert found.extra_torque == ((0.0, -20.0),)
    assert (found.water_scatter, found.unevenness, found.steering_friction) == (0.0, pytest.approx(64e-6), 150.0)
    assert found.sensors is IDEAL
    assert found.seed == 42
    assert load(folder, SHORT).sensors is ESC
    assert load(folder, SHORT + "grade_percent = -7.0").grade == ((0.0, pytest.approx(math.atan(-0.07))),)


def test_tyres(folder):
    table = '[tyre_front]\nbase = "new_winter"\ntread_depth = 0.004\n'
    found = load(folder, SHORT + 'tyre = "new_summer"\n' + table)
    assert found.tyre_front == replace(TYRES["new_winter"], name="new_winter, changed", tread_depth=0.004)
    assert found.tyre_rear == TYRES["new_summer"]
    inline = load(folder, SHORT + "tyre = { width = 0.225 }\n")
    assert inline.tyre_front.width == inline.tyre_rear.width == 0.225
    assert inline.tyre_rear.tread_depth == TYRES["worn_summer"].tread_depth
    assert load(folder, SHORT + 'tyre = { base = "new_winter" }\n').tyre_front == TYRES["new_winter"]


@pytest.mark.parametrize("key", list(TYRE_KEYS.values()), ids=lambda k: k.name)
def test_bounds_of_tyre_parameters(folder, key):
    assert load(folder, SHORT + f"[tyre]\n{key.name} = {key.high!r}").tyre_rear.name == "worn_summer, changed"
    line = told(folder, SHORT + f"[tyre]\n{key.name} = {key.high * 1.01!r}")
    assert "line 4" in line
    assert key.name in line


def test_tyre_faults(folder):
    assert '"new_winter"' in told(folder, SHORT + 'tyre = "winter"')
    assert '(did you mean "tread_depth"?)' in told(folder, SHORT + "[tyre]\ntread_dept = 0.004")
    assert "base" in told(folder, SHORT + "[tyre]\nbase = 3")
    both = 'tyre = "new_summer"\ntyre_front = "new_winter"\ntyre_rear = "new_winter"'
    assert "tyre says nothing" in told(folder, SHORT + both)
    both = "pressure_bar = 2\npressure_front_bar = 2\npressure_rear_bar = 2"
    assert "pressure_bar says nothing" in told(folder, SHORT + both)


def test_lanes(folder):
    text = f"""{SHORT}
[[lane]]
start_s = 1
end_s = 2
water_depth_left_mm = 2.0
irregularity_right = 0.3
[[lane]]
start_s = 2
end_s = 900
surface = "snow"
[[lane]]
start_m = 0.0
end_m = 55.5
water_depth_mm = 0.6
surface = "rough"
"""
    assert load(folder, text).lanes == (
        Lane(1.0, 2.0, depth_left=2e-3, irregularity_right=0.3),
        Lane(2.0, 900.0, surface=SURFACES["snow"]),
        Lane(0.0, 55.5, True, pytest.approx(6e-4), pytest.approx(6e-4), surface=SURFACES["rough"]),
    )


@pytest.mark.parametrize(
    ("text", "part"),
    [
        (LANE + "start_s = 1\nend_s = 5\n" + LANE + "start_s = 4\nend_s = 6", "line 9: lane 2 (4 ... 6 s) overlaps lane 1"),
        (LANE + "start_m = 1\nend_m = 5\n" + LANE + "start_m = 0\nend_m = 9", "overlaps lane 1 (1 ... 5 m)"),
        (LANE + "start_s = 1\nend_m = 5", "do not go together"),
        (LANE + "start_s = 5\nend_s = 5", "line 6: lane: end_s = 5 does not come after start_s = 5"),
        (LANE + "start_s = 5", "end_s or end_m is missing"),
        (LANE + "start_s = 5\nstart_m = 5\nend_s = 6", "start_s and start_m exclude each other"),
        (LANE + "start_s = 1\nend_s = 2\nwater_depth_left_mm = 1", "water_depth_mm excludes"),
        ("[[lane]]\nstart_s = 1\nend_s = 2", "line 3: lane has neither water_depth_mm nor a surface"),
        ("[[lane]]\nstart_s = 1\nend_s = 2\nsurface = 'sand'", "\"gravel\""),
        ("[[lane]]\nstart_s = 1\nend_s = 2\nsurfac = 'ice'", '(did you mean "surface"?)'),
        ("[lane]\nstart_s = 1\nend_s = 2", "write [[lane]]"),
        ("[[lanes]]\nstart_s = 1\nend_s = 2", 'line 3: unknown key "lanes" (did you mean "lane"?)'),
        ('[[lane]]\nstart_s = 1\nend_s = 2\nsurface = "ice"\nsurface_right = "sand"', "surface_right"),
        ('brakes = "abs"', "brakes"),
        ('[[fault]]\nsignal = "omega"\nstart_s = 1\nend_s = 2', "signal"),
        ('[[fault]]\nsignal = "a_x"\nstart_s = 2\nend_s = 1', "does not come after"),
        ('[[fault]]\nsignal = "a_x"\nstart_s = 2', "end_s is missing"),
        ("[[kick]]\nload_n = 100", "at_m is missing"),
        ('[[kick]]\nat_m = 1\nside = "front"', "side"),
        ("[kick]\nat_m = 1", "list of tables"),
        ("split_profile = [[0.0, 0.5]]", 'needs an "awd" car'),
        *((f"{text}", text.split()[0]) for text in (
            "lane = 3", "lane = [3]", "steering = 3", "excitation = 'sine'", "tyre = [1]",
        )),
        *((f"seed = {seed}", "whole number") for seed in ("-1", "1.0", "true", "'1'")),
        *((f"sample_rate_hz = {rate}", "10, 20, 25, 40, 50, 100, 125, 200, 250, 500, 1000")
          for rate in (9, 30, 99.5, 2000)),
    ],
)  # fmt: skip
def test_faults(folder, text, part):
    assert part in told(folder, SHORT + text)


def test_the_line_is_that_of_the_right_table(folder):
    good = LANE + "start_s = {}\nend_s = {}\n"
    text = SHORT + good.format(1, 2) + good.format(3, 4) + good.format(5, "'x'")
    assert "line 14: end_s = 'x' is not a number" in told(folder, text)
    text = 'vehicle = "awd.toml"\nspeed_kmh = 36\n[steering]\namplitude_deg = 1\nperiod_s = 2\n'
    text += '[excitation]\nkind = "sine"\namplitude_mu = 0.1\nperiod_s = 0\n'
    assert "line 9: excitation.period_s = 0 is outside" in told(folder, text)
    assert "line 3: steering.period_s = 0" in told(folder, SHORT + "steering = { amplitude_deg = 1, period_s = 0 }")
    front = 'tyre_front = "new_winter"\ntyre = "x"'
    assert "line 4: tyre = 'x'" in told(folder, SHORT + front)
    points = "brake_profile = [\n[0, 1],\n[1, 2],\n]\nsed = 3"
    assert 'line 7: unknown key "sed" (did you mean "seed"?)' in told(folder, SHORT + points)


def test_all_faults_in_one_message(folder):
    text = """vehicle = "vehicle.toml"
tyre = "worn_sumer"
pressure_bar = 29
duration_s = 0
sample_rate_hz = 300
seed = 1.5
speed_kmh = 98
profile = [[0.0, 60.0], [0.0, 1300]]
sensors = "ecs"
durationn = 3
[[lane]]
start_s = 6.0
end_s = 5.0
water_depth_mm = 30
[steering]
kind = "square"
amplitude_deg = 1
[excitation]
kind = "sinus"
amplitude_n = 100
amplitude_mu = 0.1
"""
    line = told(folder, text)
    assert line.startswith(str(folder / "scenario.toml"))
    for part in (
        "line 2: tyre = 'worn_sumer'", "line 3: pressure_bar = 29", "line 4: duration_s = 0", "line 5: sample_rate_hz = 300",
        "125, 200, 250", "line 6: seed = 1.5", "line 8: speed_kmh and profile exclude", "line 8: profile: point 2: t [s] = 0",
        "line 8: profile: point 2: 1300 is outside 0 ... 300 km/h", "line 9: sensors = 'ecs'",
        'line 10: unknown key "durationn" (did you mean "duration_s"?)', "line 13: lane: end_s = 5", "line 14: water_depth_mm = 30",
        "line 16: kind = 'square'", "line 15: steering: period_s is missing", "line 19: kind = 'sinus'",
        "line 18: excitation: period_s is missing", "line 21: excitation: amplitude_n and amplitude_mu exclude",
        "line 18: excitation needs both axles driven",
    ):  # fmt: skip
        assert part in line


def _with(key, value):
    """A scenario in which one key has a value; whatever else must stand beside it is sound."""
    top = {"vehicle": "awd.toml", "speed_kmh": 10.0}
    tables = {
        "lane": {"start_s": 1.0, "end_s": 2.0, "water_depth_mm": 1.0},
        "steering": {"amplitude_deg": 1.0, "period_s": 5.0},
        "excitation": {"kind": "sine", "amplitude_n": 100.0, "period_s": 5.0},
        "kick": {"at_m": 5.0},
        "fault": {"signal": "a_x", "start_s": 1.0, "end_s": 2.0},
    }
    table = tables[key.table] if key.table else top
    for rival in (("speed_kmh", "profile"), ("amplitude_deg", "steering_wheel_amplitude_deg")):
        if key.name in rival:
            table.pop(rival[0], None)
    if key.table == "lane" and key.name.endswith("_m"):
        table.update({"start_m": table.pop("start_s"), "end_m": table.pop("end_s")})
    if "_depth_left" in key.name or "_depth_right" in key.name:
        table.pop("water_depth_mm")
    if key.table == "excitation" and "amplitude" in key.name:
        table.pop("amplitude_n")
    table[key.name] = value
    lines = [f"{n} = {_toml(v)}" for n, v in top.items()]
    if key.table:
        header = f"[[{key.table}]]" if key.table in ("lane", "kick", "fault") else f"[{key.table}]"
        lines += [header, *(f"{n} = {_toml(v)}" for n, v in table.items())]
    return "\n".join(lines) + "\n"


def _toml(value):
    if isinstance(value, dict):
        return "{" + ", ".join(f"{k} = {_toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return repr(value) if isinstance(value, float) else json.dumps(value)


NUMBERS = [k for k in SCENARIO_KEYS.values() if math.isfinite(k.low) and k.name not in ("seed", "sample_rate_hz")]


@pytest.mark.parametrize("key", NUMBERS, ids=lambda k: k.path)
def test_bounds(folder, key):
    is_profile = key.name.endswith("profile")
    for value, is_inside in (
        (key.low, True), (key.high, True), (key.low - 1e-3 * (1 + abs(key.low)), False), (key.high * 1.001, False)
    ):  # fmt: skip
        text = _with(key, [[0.0, value]] if is_profile else value)
        message = told(folder, text)
        assert ("is outside" not in message) == is_inside, (value, message)
        if not is_inside:
            assert key.name in message
            assert "line " in message


def test_a_key_at_a_sound_value_loads(folder):
    for key in SCENARIO_KEYS.values():
        if key.low == -math.inf or key.name in ("seed", "sample_rate_hz"):  # words, and special numbers
            continue
        middle = max(key.low, min(key.high, 3.0)) if "relative" not in key.name and "mu" not in key.name else 0.2
        if key.name == "end_m":
            middle = 50.0
        value = [[0.0, middle]] if key.name.endswith("profile") else middle
        if key.path in ("lane.start_s", "lane.start_m", "fault.start_s"):
            value = 0.5
        load(folder, _with(key, value))


ABSURD = [
    [], {}, "", "x", True, False, [[]], [{}], [[1]], [["a", 1]], [[0, 1], 3], [1, 2], math.nan, math.inf, 10**400, "\x00", -(10**9),
    {"a": 1}, [[0, math.nan]], [[0, 1, 2]],
]  # fmt: skip


@pytest.mark.parametrize("key", list(SCENARIO_KEYS.values()), ids=lambda k: k.path)
def test_absurd_values_are_configuration_errors(folder, key):
    for value in ABSURD:
        if isinstance(value, float):
            text = _with(key, 1.0).replace(f"{key.name} = 1.0", f"{key.name} = {value!r}")
        else:
            text = _with(key, value)
        message = told(folder, text)
        named = [part for part in (key.name, "TOML", "unknown key") if part in message]
        sound = key.name.startswith("tyre") and value == {}
        assert bool(named) != sound, (value, message)


def test_values_that_few_files_have(folder):
    assert [load(folder, SHORT + f"sample_rate_hz = {r}").rate_hz for r in SAMPLE_RATES_HZ] == list(SAMPLE_RATES_HZ)
    assert all(1000 % rate == 0 for rate in SAMPLE_RATES_HZ)
    split = SHORT.replace("vehicle.toml", "awd.toml") + "split_profile = [[0.0, 0.5]]\n"
    assert load(folder, split).split_rear == ((0.0, 0.5),)
    assert "profile = [[t, km/h], ...]" in told(folder, 'vehicle = "vehicle.toml"\nspeed_kmh = [[0, 10], [5, 20]]')
    assert "speed_kmh or profile is missing" in told(folder, 'vehicle = "vehicle.toml"')


def test_vehicle(folder):
    assert "vehicle is missing" in told(folder, "speed_kmh = 3")
    assert "vehicle file not found" in told(folder, SHORT.replace("vehicle.toml", "none.toml"))
    (folder / "car.toml").write_text("mas = 3\n")
    line = told(folder, SHORT.replace("vehicle.toml", "car.toml") + "sed = 3")
    assert "car.toml" in line
    assert '"mass"' in line
    assert '"seed"' in line
    assert "more than the vehicle's own mass, 1680 kg" in told(folder, SHORT + "load_rear_kg = 1700")
    (folder / "below").mkdir()
    (folder / "below" / "s.toml").write_text(SHORT.replace("vehicle.toml", "../vehicle.toml"))
    assert load_scenario(folder / "below" / "s.toml").vehicle.mass == 1680.0


def test_steering(folder):
    text = SHORT + "[steering]\n{}period_s = 4.0\n"
    found = load(folder, text.format('kind = "sine"\namplitude_deg = 2.0\n')).steering
    assert (found.amplitude, found.period_s, found.start_s) == (pytest.approx(math.radians(2.0)), 4.0, 1.0)
    wheel = load(folder, text.format("steering_wheel_amplitude_deg = 32.0\nstart_s = 3\n")).steering
    assert wheel.amplitude == pytest.approx(math.radians(2.0))
    assert wheel.start_s == 3.0
    assert "exclude" in told(folder, text.format("steering_wheel_amplitude_deg = 32.0\namplitude_deg = 2\n"))
    assert "is missing" in told(folder, text.format("start_s = 3\n"))


def test_steering_that_no_car_can_follow(folder):
    # v^2 delta / l at 108 km/h: 900 * delta / 2.8 = 12 m/s^2 at 2.139 deg
    fast = 'vehicle = "vehicle.toml"\nspeed_kmh = 108.0\n[steering]\nperiod_s = 4\n'
    load(folder, fast + "amplitude_deg = 2.13")
    line = told(folder, fast + "amplitude_deg = -2.15")
    assert "line 5" in line
    assert "steering_wheel_amplitude_deg = -2.15" in line
    load(folder, fast + "steering_wheel_amplitude_deg = 34.0")
    assert "12" in told(folder, fast + "steering_wheel_amplitude_deg = 34.4")
    late = 'vehicle = "vehicle.toml"\nduration_s = {}\nprofile = [[0, 36], [20, 180]]\n[steering]\nperiod_s = 4\namplitude_deg = 2'
    load(folder, late.format(10))
    assert "180 km/h" in told(folder, late.format(25))
    assert "144 km/h" in told(folder, late.format(15))


def test_excitation(folder):
    text = 'vehicle = "awd.toml"\nspeed_kmh = 90\n[excitation]\nkind = "{}"\n{} = 0.3\nperiod_s = 2\n'
    for waveform in ("triangle", "sine", "ramp", "step"):
        assert load(folder, text.format(waveform, "amplitude_mu")).excitation.waveform == waveform
    assert load(folder, text.format("ramp", "amplitude_mu")).excitation.amplitude_kind == "mu"
    assert load(folder, text.format("ramp", "amplitude_relative")).excitation.amplitude_kind == "relative"
    force = load(folder, text.format("ramp", "amplitude_n").replace("0.3", "300")).excitation
    assert (force.amplitude, force.amplitude_kind, force.period_s) == (300.0, "force", 2.0)
    rear = text.format("ramp", "amplitude_mu").replace("awd.toml", "vehicle.toml")
    assert "both axles driven" in told(folder, rear)
    (folder / "awd.toml").write_text(VEHICLE.replace('"rwd"', '"awd"\ntorque_split_rear = 1.0'))
    assert "torque_split_rear = 1" in told(folder, text.format("ramp", "amplitude_mu"))


def test_split_surface_wind_shifts_brakes_kerbs_and_faults(folder):
    text = f"""{SHORT}
wind_profile = [[0, 0], [5, 36]]
drive_share_profile = [[1, 1], [1.1, 0]]
brakes = "antilock"
[[lane]]
start_s = 1
end_s = 2
surface = "ice"
surface_right = "asphalt"
[[kick]]
at_m = 40
length_m = 0.4
side = "right"
torque_nm = 200
load_n = -3000
[[fault]]
signal = "wheels"
start_s = 2
end_s = 2.5
[[fault]]
signal = "a_x"
start_s = 3
end_s = 4
kind = "frozen"
"""
    scenario = load(folder, text)
    assert scenario.wind == ((0.0, 0.0), (5.0, pytest.approx(10.0)))
    assert scenario.drive_share == ((1.0, 1.0), (1.1, 0.0))
    assert scenario.antilock
    lane = scenario.lanes[0]
    assert (lane.surface.name, lane.surface_right.name) == ("ice", "asphalt")
    assert scenario.kicks == (Kick(40.0, 0.4, "right", 200.0, -3000.0),)
    assert scenario.sensors.faults == (SensorFault("wheels", 2.0, 2.5), SensorFault("a_x", 3.0, 4.0, "frozen"))
    assert replace(scenario.sensors, faults=()) == ESC


@pytest.mark.parametrize(
    ("name", "pair"),
    [
        ("wind_profile", "[t [s], value [km/h]]"), ("drive_share_profile", "[t [s], value [-]]"),
        ("grade_profile", "[s [m], value [%]]"), ("brake_profile", "[t [s], value [N*m]]"),
    ],
)  # fmt: skip
def test_a_point_of_a_profile_is_two_values(folder, name, pair):
    for point in ("[1.0]", "[1.0, 2.0, 3.0]", '[0.0, "x"]', "[0.0, nan]"):
        assert f"{name}: point 1 is not a pair of numbers {pair}" in told(folder, f"{SHORT}{name} = [{point}]\n")


def test_a_point_beyond_all_bounds_is_told_with_the_bounds(folder):
    line = told(folder, f"{SHORT}wind_profile = [[0.0, 1e300], [1e301, 0.0]]\n")
    assert "point 1: 1e+300 is outside -150 ... 150 km/h" in line
    assert "point 2: t [s] = 1e+301 is outside 0 ... 86400" in line
