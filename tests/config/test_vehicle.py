from dataclasses import replace

import pytest

from aqualog.config.vehicle import load_vehicle
from aqualog.core.errors import ConfigError
from aqualog.core.provenance import TYPICAL, provenance_of, uncertainty
from aqualog.core.vehicle import KEYS, SOURCES, Known, Provenance, Vehicle, vehicle_toml
from tests.config.test_signal_map import write

CONTRACT = """
name = "sedan RWD"
drivetrain = "rwd"
mass = 1680.0
l_f = 1.32
l_r = 1.48
h_cg = 0.54
track = 1.55
drag_area = 0.66
air_density = 1.204
rolling_resistance = 0.0105
torque_split_rear = 1.0
steering_ratio = 15.0
[wheels]
r_e_f = 0.317
r_e_r = 0.317
r_l_f = 0.309
r_l_r = 0.309
inertia_f = 1.15
inertia_r = 1.15
[tyre]
slip_slope_f = 31.0
slip_slope_r = 31.0
mu_max = 1.02
[tie_rod]
c0 = 0.0
c_y = [0.11, 1e-6]
c_x = 0.06
"""


def test_vehicle_of_the_contract(tmp_path):
    car = load_vehicle(write(tmp_path, CONTRACT))
    assert (car.name, car.mass, car.r_e("fl"), car.r_l("rr"), car.inertia("rl")) == (
        "sedan RWD",
        1680.0,
        0.317,
        0.309,
        1.15,
    )
    assert car.tie_rod == {"c0": (0.0,), "c_y": (0.11, 1e-6), "c_x": (0.06,)}
    assert car.driven == ("rl", "rr")
    assert "mass" in car.given


def test_left_out_keys_take_defaults_and_are_not_given(tmp_path):
    car = load_vehicle(write(tmp_path, 'drivetrain = "fwd"\n[wheels]\nr_e_f = 0.4'))
    assert car.mass == KEYS["mass"].default
    assert "mass" not in car.given
    assert car.r_l_f == pytest.approx(0.39)
    assert car.torque_split_rear == 0.0
    assert car.watched_axle == "r"


def test_all_faults_in_one_message(tmp_path):
    text = 'drivetrain = "4x4"\nmas = 1680.0\nl_f = "long"\ntrack = 99.0\n[whels]\nr_e_f = 0.3\n[tyre]\nmu_may = 1.0'
    with pytest.raises(ConfigError) as error:
        load_vehicle(write(tmp_path, text))
    line = str(error.value)
    for part in ("line 1", "4x4", "line 2", '"mass"', "l_f", "99", '"wheels"', '"mu_max"'):
        assert part in line
    assert "\n" not in line


def test_spread_from_drive_to_drive(tmp_path):
    car = load_vehicle(write(tmp_path, "mass = 1500.0\n[spread]\nmass = 20\ntorque_gain = 0.01"))
    assert car.spread == {"mass": 20.0, "torque_gain": 0.01}
    assert load_vehicle(write(tmp_path, vehicle_toml(car))).spread == car.spread
    assert load_vehicle(write(tmp_path, "mass = 1500.0")).spread == {}
    for wrong in ("l_f = 0.1", "mass = -1.0", 'drag_area = "x"'):
        with pytest.raises(ConfigError):
            load_vehicle(write(tmp_path, f"[spread]\n{wrong}"))
    with pytest.raises(ConfigError, match="spread"):
        load_vehicle(write(tmp_path, "spread = 3.0"))


def test_every_vehicle_key_says_what_it_is():
    for key in KEYS.values():
        assert key.low <= key.default <= key.high
        assert key.meaning
        assert key.source


def vehicle_faults(tmp_path, text):
    with pytest.raises(ConfigError) as error:
        load_vehicle(write(tmp_path, text))
    return str(error.value)


@pytest.mark.parametrize(
    ("line", "said"),
    [("c_y = [0.1, 0, 0, 0, 0, 0]", "has 6 values; expected at most 5 powers"),
     ("c0 = 1e5", "c0 = 100000.0 is outside -10000 ... 10000"),
     ("c0 = [1.0, 2.0]", "c0 = [1.0, 2.0] has 2 values; expected one"),
     ("sigma = [1.0, 2.0]", "has 2 values; expected one"),
     ("sigma = 0", "sigma = 0 is outside 0 ... 10000, 0 excluded"), ("sigma = 1e300", "is outside 0 ... 10000"),
     ("c_x = 101", "c_x = 101 is outside -100 ... 100"), ("c_y = [0.1, -0.2]", "is outside -0.1 ... 0.1 in power 2"),
     ("c_y = 1e300", "is outside -100 ... 100"), ("c_y = []", "is not a number or a list of numbers"),
     ("c_y = true", "is not a number or a list of numbers"), ("c_z = 1", 'unknown key "c_z"')],
)  # fmt: skip
def test_polynomials_have_bounds_and_faults_their_table_and_line(tmp_path, line, said):
    told = vehicle_faults(
        tmp_path, f"[tie_rod]\nc0 = 1.0\nc_y = 0.1\nc_x = 0.1\nsigma = 3.0\n[steering_torque]\n{line}\n"
    )
    assert "line 7: " in told
    assert said in told
    assert "[steering_torque]" in told or "unknown" in told


def test_largest_polynomial(tmp_path):
    text = "[tie_rod]\nc0 = -1e4\nc_y = [100, 0.1, 1e-4, 1e-7, 1e-10]\nsigma = 1e4\n"
    assert load_vehicle(write(tmp_path, text)).tie_rod["c_y"] == (100.0, 0.1, 1e-4, 1e-7, 1e-10)


def test_a_key_in_the_wrong_table_is_told_with_the_table(tmp_path):
    told = vehicle_faults(tmp_path, "[wheels]\nr_e_f = 0.3\n[tyre]\nslip_slope_f = 31.0\ntie_rod = 3\nmass = 1500\n")
    assert "line 5: tie_rod stands in [tyre]; expected [tie_rod], a table of its own" in told
    assert "line 6: mass stands in [tyre]; expected above all tables" in told
    assert "line 1: tie_rod is not a table; write [tie_rod]" in vehicle_faults(tmp_path, "tie_rod = 3\n")


@pytest.mark.parametrize("value", ["1e300", "-1e308", "inf", "9000000000000000000"])
def test_a_number_beyond_all_bounds_is_told_with_the_bounds(tmp_path, value):
    told = vehicle_faults(tmp_path, f"mass = {value}\n")
    assert "is outside 200 ... 60000 kg" in told
    assert "not a number" not in told
    assert "mass = nan is not a number" in vehicle_faults(tmp_path, "mass = nan\n")


FILE = """
mass = 1500.0
l_f = 1.2
drag_area = 0.7
[wheels]
r_e_f = 0.31
r_e_r = 0.32
[provenance]
mass = "measured"
"drag_area" = { source = "measured", sd = 0.01 }
wheels.r_e_f = { source = "calibrated", sd = 0.0004 }
"wheels.r_e_r" = "calibrated"
torque_gain = { source = "guess", sd = 0.1 }
"""


def test_where_values_come_from_and_how_sure_they_are(tmp_path):
    car = load_vehicle(write(tmp_path, FILE))
    assert car.provenance == {
        "mass": Provenance("measured"),
        "drag_area": Provenance("measured", 0.01),
        "wheels.r_e_f": Provenance("calibrated", 0.0004),
        "wheels.r_e_r": Provenance("calibrated"),
        "torque_gain": Provenance("guess", 0.1),
    }
    sds = {
        "mass": 10.0,  # not a share of it
        "drag_area": 0.01,
        "wheels.r_e_f": 0.0004,
        "wheels.r_e_r": 0.0003 * 0.32,
        "torque_gain": 0.1,
        "l_f": 0.03 * 1.2,  # set, and nothing said: a data sheet
        "h_cg": 0.1 * 0.54,  # not set: a guess
        "torque_split_rear": 0.15,
    }
    assert {path: uncertainty(replace(car, drivetrain="awd"), path) for path in sds} == pytest.approx(sds)
    assert uncertainty(car, "torque_split_rear") == 0.0  # rwd
    without = replace(car, given=car.given - {"wheels.r_e_f", "mass"})  # what is not set is no calibrated value
    assert uncertainty(without, "wheels.r_e_f") == pytest.approx(0.015 * 0.31)
    assert provenance_of(without, "mass") == Provenance("guess")
    with pytest.raises(KeyError):
        uncertainty(car, "r_e_f")


@pytest.mark.parametrize(
    "text", [FILE, CONTRACT, "mass = 1500.0", '[wheels]\nr_e_f = 0.4\n[provenance]\nmass = "guess"']
)
def test_a_written_file_gives_the_same_record(tmp_path, text):
    car = load_vehicle(write(tmp_path, text))
    assert load_vehicle(write(tmp_path, vehicle_toml(car))) == car
    assert set(KEYS) <= load_vehicle(write(tmp_path, vehicle_toml(Vehicle()))).given  # made in code: all of it counts


def test_every_key_has_its_deviations_by_source():
    assert list(TYPICAL) == list(KEYS)
    for path, typical in TYPICAL.items():
        car = replace(Vehicle(), drivetrain="awd", given=frozenset(KEYS))
        sd = [uncertainty(replace(car, provenance={path: Provenance(source)}), path) for source in SOURCES]
        assert 0.0 < sd[0] < KEYS[path].high
        assert max(sd[:2]) <= sd[2] <= sd[3], path
        assert typical.why.endswith((" (K)", " (V)", " (D)"))


@pytest.mark.parametrize(
    ("line", "said"),
    [('mas = "measured"', 'line 6: unknown key "mas" (did you mean "mass"?)'),
     ('wheels.inerta_f = "guess"', 'line 6: unknown key "inerta_f" (did you mean "inertia_f"?)'),
     ('"tyre.mu_may" = "guess"', 'line 6: unknown key "tyre.mu_may" (did you mean "tyre.mu_max"?)'),
     ('name = "guess"', 'line 6: unknown key "name"'),
     ('mass = "weighed"', "line 6: provenance.mass = 'weighed' is no source; " 'expected one of "measured", "calibrated", "data_sheet", "guess"'),
     ("mass = 3", 'line 6: provenance.mass = 3 is no source; expected one of "measured"'),
     ("mass = { sd = 3 }", "line 6: provenance.mass has no source; expected one of"),
     ('mass = { source = "guess", sd = -3 }', "line 6: provenance.mass.sd = -3 is outside 0 ... 60000 kg"),
     ('wheels.r_e_f = { source = "guess", sd = -3 }', "line 6: provenance.wheels.r_e_f.sd = -3 is outside 0 ... 1 m"),
     ('mass = { source = "guess", std = 3 }', 'line 6: unknown key "std"'),
     ('wheels.r_e_r = "calibrated"', 'line 6: provenance.wheels.r_e_r = "calibrated", but the file sets no wheels.r_e_r; expected its value')],
)  # fmt: skip
def test_faults_of_the_provenance(tmp_path, line, said):
    text = f'mass = 1500.0\n[wheels]\nr_e_f = 0.3\n[provenance]\nwheels.r_e_f = "measured"\n{line}\n'
    if line.startswith("wheels.r_e_f"):
        text = text.replace('wheels.r_e_f = "measured"\n', "\n")
    assert said in vehicle_faults(tmp_path, text)
    assert "provenance is not a table" in vehicle_faults(tmp_path, "provenance = 3")


KNOWN = """
[known]
"signal_delay@torque" = { delay = 0.03, spread = 0.005 }
"velocity_scale" = { scale = 1.01 }
"""


def test_known_faults_with_their_usual_place(tmp_path):
    car = loaded(tmp_path, KNOWN)
    assert car.known == {
        "signal_delay@torque": Known({"delay": 0.03}, 0.005), "velocity_scale@v_x": Known({"scale": 1.01}),
    }  # fmt: skip
    again = loaded(tmp_path, vehicle_toml(car))
    assert again.known == car.known


@pytest.mark.parametrize(
    ("line", "fault"),
    [('"signal_dely@torque" = { delay = 0.03 }', 'unknown effect "signal_dely@torque" (did you mean "signal_delay"?)'),
     ('"signal_delay@moon" = { delay = 0.03 }', "signal_delay cannot sit at moon"),
     ('"signal_delay@torque" = { delay = 30.0 }', "known.signal_delay@torque.delay = 30 is outside -1 ... 2 s"),
     ('"signal_delay@torque" = { spread = 0.1 }', "has no value; expected { delay = ..., spread = ... }"),
     ('"signal_delay@torque" = 0.03', "has no value; expected { delay = ..., spread = ... }"),
     ('"signal_delay@torque" = { delay = 0.03, sd = 1.0 }', 'unknown key "sd"'),
     ('"signal_delay@torque" = { delay = 0.03, spread = -1.0 }', "spread = -1 is outside 0 ... 3 s")],
)  # fmt: skip
def test_a_fault_in_known_names_line_and_what_was_expected(tmp_path, line, fault):
    with pytest.raises(ConfigError) as error:
        loaded(tmp_path, f"mass = 1500.0\n[known]\n{line}\n")
    assert "line 3: " in str(error.value)
    assert fault in str(error.value)


def loaded(tmp_path, text):
    (tmp_path / "known.toml").write_text(text)
    return load_vehicle(tmp_path / "known.toml")
