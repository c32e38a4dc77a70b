"""`aq.slip_slope` does what `aqualog slip-slope` does."""

import polars as pl
import pytest

import aqualog as aq
from aqualog.core.vehicle import vehicle_toml
from tests.both_ways import check_result, check_shown, command
from tests.straight_drive import AWD, RWD, C, drive

FILES = ("slip_slope.json", "slip_slope.csv", "slip_slope.html")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("slip_slope")
    for car in (RWD, AWD):
        (path / f"{car.name}.toml").write_text(vehicle_toml(car), encoding="utf-8")
    drive(RWD).frame.write_csv(path / "drive.csv")
    drive(AWD).frame.drop("v_x").write_csv(path / "awd.csv")
    return path


def test_face_and_command_agree(folder, tmp_path):
    log, car = folder / "drive.csv", folder / "rwd.toml"
    result = aq.slip_slope(aq.read(log), aq.Vehicle.read(car))
    check_result(result, tmp_path / "face", "slip-slope", log, "--vehicle", car, files=FILES)
    command("slip-slope", log, "--vehicle", car, "-o", tmp_path / "command")
    for name in FILES:
        assert (tmp_path / "face" / name).read_bytes() == (tmp_path / "command" / name).read_bytes()
    slopes = result.tables["slopes"]
    assert slopes.columns == pl.read_csv(tmp_path / "face" / "slip_slope.csv").columns
    assert slopes["slope"][0] == pytest.approx(C, rel=0.03)
    assert result.tables["segments"].height == sum(len(p.segments) for p in result.slopes.places)
    assert set(result.tables["samples"]["place"]) == set(slopes["place"])


def test_options_and_kinds_of_input(folder):
    log, car = folder / "drive.csv", folder / "rwd.toml"
    result = aq.slip_slope(str(log), str(car), traction="accelerometer", mu_max=0.2)
    args = ("--traction", "accelerometer", "--mu-max", "0.2", "--json")
    assert result.to_json() + "\n" == command("slip-slope", log, "--vehicle", car, *args)[0]
    assert car in result.sources
    assert aq.slip_slope(aq.read([log], vehicle=car)).document["traction"] == "torque"
    assert aq.slip_slope(drive(RWD), RWD).document["log"]


def test_without_regression(folder):
    result = aq.slip_slope(folder / "awd.csv", folder / "awd.toml")
    assert result.tables["slopes"].is_empty()
    assert result.tables["recursive"]["slope"][0] == pytest.approx(C, rel=0.25)
    check_shown(result)


@pytest.mark.parametrize("wrong", [{"mu_max": 2.0}, {"delay": 5.0}, {"method": "best"}, {"vehicle": None}])
def test_wrong_arguments(folder, wrong):
    with pytest.raises(aq.AqualogError) as error:
        aq.slip_slope(folder / "drive.csv", **{"vehicle": folder / "rwd.toml", **wrong})
    assert error.value.exit_code == 2
