"""Commands say what does not fit among the signals, and take off offsets where they are asked to."""

import json

import numpy as np
import pytest

from aqualog.core.vehicle import vehicle_toml
from aqualog.diagnose import run
from tests import commands
from tests.checks.made import CAR, DT, made, signals
from tests.diagnose.stand_in import Engine

BRAKES = np.zeros(round(600.0 / DT))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """`drive.csv` with a turned a_y and an offset of a_x, and `car.toml`."""
    path = tmp_path_factory.mktemp("checks")
    frame = signals(
        {
            **made(seconds=600.0, v=28.0, turning=0.02, accelerating=0.6, stops=3, a_x_offset=-1.5),
            "brake_pressure": BRAKES,
        },
        turned=("a_y",),
    ).frame
    frame = frame.insert_column(0, (frame["v_x"].cum_count() - 1).cast(float).alias("t [s]") * DT)
    frame.write_csv(path / "drive.csv")
    (path / "car.toml").write_text(vehicle_toml(CAR), encoding="utf-8")
    return path


@pytest.fixture
def engine(monkeypatch):
    """The diagnosis itself takes minutes."""
    monkeypatch.setattr(run, "diagnose", Engine())


def document(folder, command, *more):
    code, text, err = commands.run(command, folder / "drive.csv", "--vehicle", folder / "car.toml", "--json", *more)
    assert code in (0, 3), err
    return json.loads(text), err


def found(checks):
    return {(c["kind"], *c["signals"]): c for c in checks}


@pytest.mark.parametrize("command", ["detect", "slip-slope", "calibrate", "diagnose"])
def test_every_command_says_it_alike(folder, command, engine):
    result, err = document(folder, command)
    own = found(result["checks"])
    assert own["sign", "a_y"]["lines"] == ['a_y = { channel = "a_y", scale = -1.0 }']
    assert own["offset", "a_x"]["value"] == pytest.approx(-1.5, abs=0.2)  # with the slope where it stands
    notes = result["quality"]["notes"] if "quality" in result else result["notes"]
    for check in own.values():
        assert sum(check["what"] in n for n in notes) == 1
        assert check["what"] in err
    if command in ("calibrate", "diagnose"):
        assert {c["drive"] for c in result["checks"]} == {"drive.csv"}


def test_doctor_names_file_and_channel(folder):
    result, _ = document(folder, "doctor")
    (sign,) = (f for f in result["findings"] if f["kind"] == "sign")
    assert (sign["level"], sign["file"], sign["channel"]) == ("doubt", "drive.csv", "a_y")
    assert 'a_y = { channel = "a_y", scale = -1.0 }' in sign["advice"]
    assert not any(f["kind"] == "signal" and "a_y" in f["what"] for f in result["findings"])


@pytest.mark.parametrize("command", ["detect", "slip-slope", "calibrate", "diagnose"])
def test_offsets_are_taken_off_where_asked(folder, command, engine):
    result, err = document(folder, command, "--correct-offsets")
    assert ("offset", "a_x") not in found(result["checks"])
    assert "is taken off, as it shows at standstill" in err


def test_a_map_that_speaks_of_another_file_is_refused(folder, tmp_path):
    path = tmp_path / "map.toml"
    path.write_text('[signals]\nv_x = "v_x"\n[sources."drive2.csv"]\noffset_s = 0.2\n', encoding="utf-8")
    for command in ("detect", "slip-slope", "calibrate", "evaluate", "doctor"):
        result = commands.run(command, folder / "drive.csv", "--vehicle", folder / "car.toml", "--signals", path)
        assert result[0] == 2
        assert 'map.toml: line 3: [sources."drive2.csv"] fits no file (did you mean "drive.csv"?)' in result[2]
