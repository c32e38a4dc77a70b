"""`aqualog slip-slope` as a user calls it."""

import csv
import io
import json

import numpy as np
import polars as pl
import pytest

from aqualog.core.vehicle import vehicle_toml
from tests import commands
from tests.commands import one_error_line
from tests.straight_drive import AWD, RWD, C, drive


def run(*args):
    return commands.run("slip-slope", *args)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("slip_slope")
    for car in (RWD, AWD):
        (path / f"{car.name}.toml").write_text(vehicle_toml(car), encoding="utf-8")
    drive(RWD).frame.write_csv(path / "drive.csv")
    drive(RWD, torque=False).frame.write_csv(path / "no_torque.csv")
    drive(AWD).frame.drop("v_x").write_csv(path / "awd.csv")
    drive(RWD, even=True, grade=0.0).frame.write_csv(path / "even.csv")
    drive(AWD, speeds=(12.0, 38.0), late_v=0.1, noise=2e-3).frame.write_csv(path / "late.csv")
    drive(AWD, late_v=0.1, grade=0.0).frame.write_csv(path / "one_speed.csv")
    for n in (1, 2, 4):
        drive(RWD, seconds=n / 20.0).frame.write_csv(path / f"short{n}.csv")
    return path


@pytest.fixture(scope="module")
def written(folder):
    out = folder / "out"
    return run(folder / "drive.csv", "--vehicle", folder / "rwd.toml", "-o", out), out


def test_table_tells_slopes_and_stability(written):
    result, _ = written
    assert result.exit_code == 0, result.stderr
    row = next(line.split() for line in result.stdout.splitlines() if line.startswith("RL "))
    assert float(row[1]) == pytest.approx(C, rel=0.03)
    assert float(row[2]) <= C <= float(row[4])
    assert "traction from the wheel torques" in result.stdout
    assert "RL: stable: " in result.stdout
    assert "left out: " in result.stdout


def test_results_say_the_same(written):
    result, out = written
    assert sorted(p.name for p in out.iterdir()) == ["slip_slope.csv", "slip_slope.html", "slip_slope.json"]
    document = json.loads((out / "slip_slope.json").read_text(), parse_constant=lambda c: pytest.fail(c))
    assert document["schema_version"] == 1
    assert document["tool_version"]
    assert (document["method"], document["traction"]) == ("axle", "torque")
    place = document["slip_slope"][0]
    assert place["place"] == "rl"
    assert f"{place['slope']:.1f}" in result.stdout
    assert place["slope_ci95"][0] < C < place["slope_ci95"][1]
    assert place["stability"]["verdict"] == "stable"
    rows = list(csv.DictReader(io.StringIO((out / "slip_slope.csv").read_text())))
    own = [r for r in rows if r["place"] == "rl"]
    assert len(own) == 1 + len(place["segments"])
    assert float(own[0]["slope"]) == pytest.approx(place["slope"])
    assert [float(r["slope"]) for r in own[1:]] == pytest.approx([s["slope"] for s in place["segments"]])


def test_json_is_one_document(folder, written):
    result = run(folder / "drive.csv", "--vehicle", folder / "rwd.toml", "--json")
    assert result.exit_code == 0
    assert (
        json.loads(result.stdout)["slip_slope"]
        == json.loads((written[1] / "slip_slope.json").read_text())["slip_slope"]
    )


def test_results_are_not_overwritten(folder, written):
    again = run(folder / "drive.csv", "--vehicle", folder / "rwd.toml", "-o", written[1])
    assert again.exit_code == 2
    assert "--force" in one_error_line(again)
    assert run(folder / "drive.csv", "--vehicle", folder / "rwd.toml", "-o", written[1], "--force").exit_code == 0


def test_accelerometer_is_taken_and_said(folder):
    result = run(folder / "no_torque.csv", "--vehicle", folder / "rwd.toml", "--json")
    assert result.exit_code == 0, result.stderr
    assert json.loads(result.stdout)["traction"] == "accelerometer"
    assert "accelerometer" in result.stderr


def test_all_wheel_drive_without_velocity(folder):
    result = run(folder / "awd.csv", "--vehicle", folder / "awd.toml", "--json")
    assert result.exit_code == 0, result.stderr
    document = json.loads(result.stdout)
    assert document["method"] == "differential"
    assert document["slip_slope"] == []
    assert document["recursive"][0]["slope"] == pytest.approx(C, rel=0.25)
    assert "no regression" in result.stderr
    text = run(folder / "awd.csv", "--vehicle", folder / "awd.toml", "-o", folder / "awd_out")
    assert "left" in text.stdout
    assert (folder / "awd_out" / "slip_slope.html").stat().st_size > 1_000_000


@pytest.mark.parametrize(
    ("log", "options", "code", "text"),
    [
        ("even.csv", (), 4, "cannot estimate the slip slope"),
        ("no_torque.csv", ("--traction", "torque"), 4, "missing torque_rl"),
        ("drive.csv", ("--method", "best"), 2, "method"),
        ("missing.csv", (), 1, "missing.csv"),
    ],
)
def test_what_cannot_be_done_is_one_line(folder, log, options, code, text):
    result = run(folder / log, "--vehicle", folder / "rwd.toml", *options, "-o", folder / "nothing")
    assert result.exit_code == code, result.stderr
    assert text in one_error_line(result)
    assert result.stdout == ""
    assert not (folder / "nothing").exists()


def test_delay_of_the_velocity_is_told(folder):
    out = folder / "late_out"
    result = run(folder / "late.csv", "--vehicle", folder / "awd.toml", "-o", out)
    assert result.exit_code == 0, result.stderr
    assert "FL: v_x is late by +0.1" in result.stdout
    place = json.loads((out / "slip_slope.json").read_text())["slip_slope"][0]
    assert place["delay_s"] == pytest.approx(0.1, abs=0.005)
    assert place["delay_ci95"][0] < 0.1 < place["delay_ci95"][1]
    assert place["slope_ci95"][0] < C < place["slope_ci95"][1]
    assert "v_x is late by +0.1" in (out / "slip_slope.html").read_text()
    given = run(folder / "one_speed.csv", "--vehicle", folder / "awd.toml", "--delay", "0.1", "--json")
    assert json.loads(given.stdout)["slip_slope"][0]["slope"] == pytest.approx(C, rel=0.05)
    refused = run(folder / "one_speed.csv", "--vehicle", folder / "awd.toml")
    assert refused.exit_code == 4
    assert "delay of v_x cannot be distinguished" in one_error_line(refused)


def test_no_figure_per_hour_of_a_short_session(written):
    result, out = written
    assert "per hour" not in result.stdout
    stability = json.loads((out / "slip_slope.json").read_text())["slip_slope"][0]["stability"]
    assert stability["change_per_hour"] is None
    assert stability["change_per_hour_ci95"] == [None, None]


@pytest.mark.parametrize("n", [1, 2, 4])
def test_short_logs_are_one_line(folder, n):
    result = run(folder / f"short{n}.csv", "--vehicle", folder / "rwd.toml")
    assert result.exit_code == 4, result.stderr
    one_error_line(result)


@pytest.mark.parametrize(
    ("out", "text"),
    [("drive.csv", "is no folder"), ("drive.csv/below/it", "is no folder"), ("", "is empty"), (" ", "is empty")],
)
def test_folder_for_results_is_checked_first(folder, out, text):
    target = folder / out if out.strip() else out
    for force in ((), ("--force",)):
        result = run(folder / "even.csv", "--vehicle", folder / "rwd.toml", "-o", target, *force)
        assert result.exit_code == 2, result.stderr
        assert text in one_error_line(result)
    assert (folder / "drive.csv").is_file()


def test_vehicle_must_be_given(folder):
    result = run(folder / "drive.csv")
    assert result.exit_code == 2
    assert "--vehicle" in one_error_line(result)


def test_a_failure_shows_first_what_does_not_fit_among_the_inputs(tmp_path, folder):
    """A channel that is no acceleration shows no slope: the user must see why."""
    x = drive(RWD, torque=False).frame
    noise = np.convolve(np.random.default_rng(0).standard_normal(x.height), np.ones(41) / 6.4, "same")
    x.with_columns(a_x=pl.Series(noise)).write_csv(tmp_path / "other.csv")
    result = run(tmp_path / "other.csv", "--vehicle", folder / "rwd.toml", "--traction", "accelerometer")
    assert result.exit_code == 4, result.stdout
    *notes, error = result.stderr.strip().splitlines()
    assert error.startswith("error: ")
    assert any(n.startswith("note: ") and "a_x does not follow the change of the speed" in n for n in notes), (
        result.stderr
    )
