from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aqualog.align.load import read_options
from aqualog.align.mapping import Entry, SignalMap, SourceClock
from aqualog.align.mapping import map_text as map_key
from aqualog.config.signal_map import check_files, load_signal_map, map_text
from aqualog.core.errors import ConfigError
from aqualog.io.reader import CsvFormat, format_of


def write(tmp_path, text, name="x.toml"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def test_signal_map_of_the_contract(tmp_path):
    text = """
[signals]
omega_fl = { channel = "ESP_19.ESP_VL_Radgeschw_02", unit = "km/h" }
a_x      = { channel = "/imu/data.linear_acceleration.x", scale = 1.0, offset = 0.0 }
torque_r = { channel = "MotTq", unit = "N*m", scale = 9.1 }
"""
    found = load_signal_map(write(tmp_path, text))
    assert found.entries["torque_r"] == Entry("torque_r", ("MotTq",), "N*m", 9.1)
    assert found.entries["omega_fl"].unit == "km/h"


def test_faults_of_a_map_come_together(tmp_path):
    text = (
        '[signals]\nomgea_fl = "x"\na_x = { chanel = "y" }\nv_x = { channel = "z", unit = "warp" }\n[tim]\nunit = "s"'
    )
    with pytest.raises(ConfigError) as error:
        load_signal_map(write(tmp_path, text))
    for part in ('"omega_fl"', "a_x names no channel", "warp", '"time"'):
        assert part in str(error.value)


@pytest.mark.parametrize(
    ("first", "other"),
    [('"A"', '"A"'), ('{ channel = "A", unit = "km/h" }', '{ channel = "A", scale = 1.01 }'),
     ('{ channel = ["A", "B"], offset = 1.0 }', '{ channel = ["A", "B"] }')],
)  # fmt: skip
def test_one_channel_for_two_signals_is_refused_with_both_lines(tmp_path, first, other):
    path = write(tmp_path, f'[signals]\nomega_fl = {first}\na_x = "C"\nomega_fr = {other}\n')
    told = r"x\.toml: line 4: omega_fr names channel \"A\", as omega_fl does in line 2"
    with pytest.raises(ConfigError, match=told) as error:
        load_signal_map(path)
    assert error.value.exit_code == 2


def test_one_torque_for_both_wheels_and_one_channel_in_two_scales_are_no_slip(tmp_path):
    lines = ['torque_rl = { channel = "M", scale = 4.5 }', 'torque_rr = { channel = "M", scale = 4.5 }',
             'pressure_fl = "P"', 'pressure_fr = "P"', 'omega_rl = { channel = "N" }',
             'v_x = { channel = "N", scale = 0.3 }']  # fmt: skip
    assert len(load_signal_map(write(tmp_path, "[signals]\n" + "\n".join(lines))).entries) == 6


@pytest.mark.parametrize(
    ("one", "other"), [("torque_f", "torque_r"), ("torque_r", "torque_rl"), ("torque_fl", "torque_rl")]
)
def test_a_torque_is_that_of_one_axle_unless_a_scale_gives_each_its_part(tmp_path, one, other):
    with pytest.raises(ConfigError, match=f"{other} names channel"):
        load_signal_map(write(tmp_path, f'[signals]\n{one} = "M"\n{other} = "M"\n'))
    half = '{ channel = "M", scale = 0.5 }'
    assert len(load_signal_map(write(tmp_path, f"[signals]\n{one} = {half}\n{other} = {half}\n")).entries) == 2


def test_how_csv_files_are_written(tmp_path):
    text = '[csv]\nseparator = "tab"\nencoding = "latin-1"\n[csv."gps*.csv"]\ndecimal = ","\n[signals]\n'
    found = load_signal_map(write(tmp_path, text))
    assert format_of(found.csv, "a.csv") == CsvFormat("\t", "", "latin-1")
    assert format_of(found.csv, "gps_1.csv") == CsvFormat("\t", ",", "latin-1")
    assert read_options(found).csv == found.csv
    assert map_key(found) != map_key(SignalMap())


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ('seperator = ";"', '"separator"'), ('separator = ";;"', "separates no cells"), ("separator = 3", "is no text"),
        ('separator = "."', "separates no cells"), ('decimal = ";"', "use . or ,"), ('encoding = "utf-9"', "not known"),
        ('encoding = "base64"', "not known"), ('encoding = "rot13"', "not known"), ('encoding = "a\\u0000b"', "not known"),
    ],
)  # fmt: skip
def test_faults_of_how_csv_files_are_written(tmp_path, line, says):
    with pytest.raises(ConfigError, match=says) as error:
        load_signal_map(write(tmp_path, f"[csv]\n{line}\n"))
    assert "line 2" in str(error.value)
    with pytest.raises(ConfigError, match=says) as error:
        load_signal_map(write(tmp_path, f'[csv."gps.csv"]\n{line}\n'))


names = st.text(st.characters(codec="utf-8", exclude_characters="\x00"), min_size=1, max_size=20)
numbers = st.floats(-1e6, 1e6, allow_nan=False).filter(bool)


@given(names=st.lists(names, min_size=1, max_size=3), scale=numbers, offset=numbers, remark=names, source=names)
def test_written_maps_read_back(tmp_path_factory, names, scale, offset, remark, source):
    entry = Entry("a_x", tuple(names), "g", scale, offset, (1023.0, -64.0))
    csv = {f"{source}.csv": CsvFormat("\t", ",", "cp1252"), "*": CsvFormat("|")}
    before = SignalMap({"a_x": entry}, {source: SourceClock(0.2, 50.0, 12.5)}, "t_ms", "ms", csv=csv)
    path = tmp_path_factory.mktemp("map") / "m.toml"
    path.write_text(map_text(before, comments=[remark], remarks={"a_x": remark}), encoding="utf-8")
    after = load_signal_map(path)
    assert after.entries == before.entries
    assert after.clocks == before.clocks
    assert (after.time_channel, after.time_unit) == ("t_ms", "ms")
    assert after.csv == csv


IDLE = '[signals]\nv_x = "v"\n\n[sources."gps_20Hz.csv"]\noffset_s = 0.2\n\n[csv."imu*.csv"]\ndecimal = ","\n'


def test_what_is_said_of_a_file_that_is_not_there_is_refused(tmp_path):
    found = load_signal_map(write(tmp_path, IDLE, "map.toml"))
    with pytest.raises(ConfigError) as error:
        check_files(found, [Path("a/gps_10Hz.csv"), Path("a/wheels.csv")])
    assert error.value.where.endswith("map.toml")
    assert 'line 4: [sources."gps_20Hz.csv"] fits no file (did you mean "gps_10Hz.csv"?)' in error.value.what
    assert 'line 7: [csv."imu*.csv"] fits no file; the files are gps_10Hz.csv, wheels.csv' in error.value.what
    with pytest.raises(ConfigError, match="fits no file"):
        check_files(replace(found, path=""), [Path("a.csv")])


@pytest.mark.parametrize("name", ["gps_20Hz.csv", "gps_20Hz", "gps*"])
def test_what_is_said_of_one_of_the_files_is_not(tmp_path, name):
    found = load_signal_map(write(tmp_path, f'[csv]\nseparator = ";"\n[sources."{name}"]\noffset_s = 0.2\n'))
    check_files(found, [Path("gps_20Hz.csv"), Path("b.mf4")])
    check_files(SignalMap(), [])
