"""Files that no reader of settings can take: each is one line of a ConfigError."""

import os
from pathlib import Path

import pytest

from aqualog.config.campaign import load_campaign
from aqualog.config.model import load_model
from aqualog.config.reader import Faults, Key, Row
from aqualog.config.scenario import load_scenario
from aqualog.config.signal_map import load_signal_map
from aqualog.config.thresholds import load_thresholds
from aqualog.config.vehicle import load_vehicle
from aqualog.core.errors import ConfigError

NINES = "9" * 400


@pytest.mark.parametrize(
    ("load", "text", "said"),
    [
        (load_vehicle, "mass = ", "TOML"), (load_vehicle, "\x00", "TOML"), (load_vehicle, "mass = nan", "not a number"),
        (load_vehicle, 'drivetrain = ["rwd"]', "drivetrain"), (load_vehicle, "drivetrain = {}", "drivetrain"),
        (load_vehicle, f"mass = {NINES}", "64 bits"), (load_vehicle, f"mass = {'9' * 6000}", "TOML"),
        (load_vehicle, "[tie_rod]\nc0 = nan", "c0"), (load_vehicle, f"[tie_rod]\nc_y = [{NINES}]", "64 bits"),
        (load_vehicle, f"x = {'[' * 3000}{']' * 3000}", "deeper than 100 levels"),
        (load_vehicle, "mass = " + "[" * 5000, "x.toml: vehicle file is nested deeper than 100 levels"),
        (load_vehicle, "mass = " + "{a = " * 5000 + "1" + "}" * 5000, "file is nested deeper than 100 levels"),
        (load_scenario, "seed = 0x" + "f" * 5000, "64 bits"),
        (load_scenario, "speed_kmh = 92233720368547758070", "64 bits"),
        (load_scenario, "tyre = {a = [0x" + "f" * 9000 + "]}", "64 bits"),
        (load_model, "term = 3", "list of tables"), (load_model, "[term]\neffect = 'head_wind'", "list of tables"),
        (load_model, "term = [3]", "list of tables"), (load_model, "[[term]]\neffect = []", "effect"),
        (load_model, "=", "TOML"),
        (load_signal_map, "[time]\nchannel = 3", "channel"), (load_signal_map, "[time]\nchannel = []", "channel"),
        (load_signal_map, f'[signals]\na_x = {{ channel = "x", invalid = [{NINES}] }}', "64 bits"),
    ],
)  # fmt: skip
def test_absurd_files_are_configuration_errors(tmp_path, load, text, said):
    (tmp_path / "x.toml").write_text(text + "\n", encoding="utf-8")
    with pytest.raises(ConfigError) as error:
        load(tmp_path / "x.toml")
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_what_is_no_file(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "s.toml").write_text('vehicle = "pipe"\nspeed_kmh = 80.0\n')
    for load, name, said in (
        (load_vehicle, "none.toml", "not found"), (load_vehicle, "", "folder"), (load_scenario, "s.toml", "pipe"),
    ):  # fmt: skip
        with pytest.raises(ConfigError, match=said):
            load(tmp_path / name)


@pytest.mark.parametrize(
    ("text", "said"),
    [('[signals]\n\na_x = { channel = "x", scale = "minus 1" }', "line 3: signals.a_x.scale = 'minus 1' is not"),
     ('[signals]\na_x.channel = "x"\na_x.scale = [1]', "line 3: signals.a_x.scale = [1] is not a number"),
     ('[signals.a_x]\nchannel = "x"\nscale = 1e13', "line 3: signals.a_x.scale = 1e+13 is outside"),
     ('[signals]\na_x = { channel = "x", scale = minus 1 }', 'line 2, column 32): a_x = { channel = "x", scale = minus')],
)  # fmt: skip
def test_a_fault_has_its_line_and_its_key(tmp_path, text, said):
    (tmp_path / "m.toml").write_text(text + "\n")
    with pytest.raises(ConfigError) as error:
        load_signal_map(tmp_path / "m.toml")
    assert said in str(error.value)


def test_equal_faults_of_many_lines_are_one():
    faults = Faults(Path("runs.csv"))
    for line in range(2, 12):
        Row({"depth": "deep"}, faults, line).number("depth", Key("", "depth", "number", "mm", None, ""))
    Row({"depth": "wet"}, faults, 12).number("depth", Key("", "depth", "number", "mm", None, ""))
    with pytest.raises(ConfigError) as error:
        faults.raise_if_any()
    first, second = error.value.line().removeprefix("runs.csv: ").split("; ")
    assert first == "lines 2, 3, 4, 5, 6, 7 and 4 more: depth = 'deep' is not a number"
    assert second == "line 12: depth = 'wet' is not a number"


_FILES = {
    "campaign file": (load_campaign, 'vehicle = "car.toml"\nsignals = "map.toml"\n[[run]]\nlog = "a.mf4"\n'),
    "vehicle file": (load_vehicle, 'name = "car"\nmass = 1650.0\n[wheels]\nr_e_f = 0.31\n'),
    "signal map": (load_signal_map, '[signals]\nv_x = "Speed"\n'),
    "model file": (load_model, '[[term]]\neffect = "head_wind"\n'),
    "scenario file": (load_scenario, 'vehicle = "car.toml"\nspeed_kmh = 98.0\n'),
    "thresholds file": (load_thresholds, "[thresholds]\nspin_down = 0.5\n"),
}  # fmt: skip


@pytest.mark.parametrize("given", _FILES)
@pytest.mark.parametrize("expected", _FILES)
def test_a_file_in_the_place_of_another_says_what_it_is(tmp_path, given, expected):
    (tmp_path / "x.toml").write_text(_FILES[given][1], encoding="utf-8")
    if given != expected:
        with pytest.raises(ConfigError) as error:
            _FILES[expected][0](tmp_path / "x.toml")
        assert str(error.value) == f"{tmp_path / 'x.toml'}: this is a {given}; expected a {expected}"


def test_a_word_of_a_vehicle_file_has_a_nearest_name(tmp_path):
    (tmp_path / "x.toml").write_text('drivetrane = "rwd"\nmass = 1650.0\n', encoding="utf-8")
    with pytest.raises(ConfigError, match=r'unknown key "drivetrane" \(did you mean "drivetrain"\?\)'):
        load_vehicle(tmp_path / "x.toml")
