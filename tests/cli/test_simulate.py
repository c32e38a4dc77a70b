"""`aqualog simulate`: what is in the logs, and what is said when it cannot be done."""

import json
import os
import time
from pathlib import Path

import asammdf
import numpy as np
import polars as pl
import pytest
from typer.testing import CliRunner

from aqualog.cli.console import Console, Heard
from aqualog.cli.main import app
from aqualog.config.scenario import load_scenario
from aqualog.core.errors import ConfigError
from aqualog.core.notation import SYMBOLS
from aqualog.io.open_log import DriveLog
from aqualog.io.reader import ReadOptions
from aqualog.model import campaign as programmes
from aqualog.model.campaign import CampaignOutcome
from aqualog.model.log import START_NS, _onto
from aqualog.model.simulate import TRUTH_SYMBOLS
from aqualog.model.simulate import simulate as simulated
from tests.commands import one_error_line, run
from tests.conftest import ROOT

CAR = ROOT / "sample_logs" / "vehicle.toml"
FORMATS = ("mf4", "mcap", "csv", "parquet")
SCENARIO = f"""vehicle = "{CAR}"
speed_kmh = 110
duration_s = 3
sample_rate_hz = 100
[[lane]]
start_s = 0.8
end_s = 2.0
water_depth_mm = 1.3
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A scenario and its logs in all formats."""
    place = tmp_path_factory.mktemp("logs")
    (place / "wet.toml").write_text(SCENARIO)
    for suffix in FORMATS:
        result = run("simulate", place / "wet.toml", "-o", place / f"wet.{suffix}")
        assert result.exit_code == 0, result.stderr
    return place


@pytest.fixture(scope="module")
def expected(folder):
    """Measured groups as the library gives them."""
    return simulated(load_scenario(folder / "wet.toml")).measured


def channels(path):
    with DriveLog([path], ReadOptions()) as log:
        infos = log.channels()
        read = log.read(infos)
    return {i.name: read[i.file, i.path] for i in infos}


@pytest.mark.parametrize("suffix", ["mf4", "mcap"])
def test_groups_keep_their_own_stamps_and_all_digits(folder, expected, suffix):
    found = channels(folder / f"wet.{suffix}")
    assert set(found) == {n for g in expected for n in g.columns}
    assert len({g.t.size for g in expected}) > 2
    for group in expected:
        for name, x in group.columns.items():
            channel = found[name]
            np.testing.assert_array_equal(channel.values, x, err_msg=name)
            np.testing.assert_array_equal(channel.t_ns, START_NS + np.rint(group.t * 1e9).astype(int))
            assert channel.absolute
            symbol = SYMBOLS.get(name)
            assert channel.info.unit == (symbol.unit if symbol else TRUTH_SYMBOLS[name][0])
            assert channel.info.path != name  # group or topic stands before it


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_tables_hold_all_groups_on_the_grid_of_the_scenario(folder, expected, suffix):
    found = channels(folder / f"wet.{suffix}")
    grid = np.arange(300) * 0.01
    assert set(found) - {"t"} == {n for g in expected for n in g.columns}
    for group in expected:
        for name, x in group.columns.items():
            channel = found[name]
            seconds = (channel.t_ns - (START_NS if channel.absolute else 0)) * 1e-9
            covered = grid[grid < group.t[-1] + 1e-9]  # a slower bus ends before the table does
            if np.isnan(x).any():  # empty cells are read as no samples
                there = np.isfinite(x)
                np.testing.assert_allclose(seconds, group.t[there], atol=1e-9)
                np.testing.assert_array_equal(channel.values, x[there], err_msg=name)
                continue
            np.testing.assert_allclose(seconds, covered, atol=1e-9, err_msg=name)
            if group.t.size == grid.size:
                np.testing.assert_array_equal(channel.values, x, err_msg=name)
            else:
                np.testing.assert_allclose(channel.values, np.interp(covered, group.t, x), rtol=1e-12, atol=1e-12)
    assert {g.t.size for g in expected} >= {300, 150, 60}


def test_a_table_holds_states_and_averages_what_is_faster():
    grid = np.arange(5) * 100_000_000
    fast = np.arange(41) * 10_000_000
    step = (np.arange(41) >= 15).astype(float)
    assert _onto(grid, fast, {"on_water": step})["on_water"].tolist() == [0.0, 0.0, 1.0, 1.0, 1.0]
    slow = np.arange(3) * 150_000_000
    assert _onto(grid, slow, {"on_water": np.array([0.0, 1.0, 0.0])})["on_water"].tolist() == [0.0, 0.0, 1.0, 0.0, 0.0]
    noisy = np.where(np.arange(41) % 2, 1.0, -1.0) + 7.0
    np.testing.assert_allclose(_onto(grid, fast, {"a_x": noisy})["a_x"][1:-1], 7.0)
    ramp = _onto(grid, slow, {"a_x": np.array([0.0, 3.0, 6.0])})["a_x"]
    np.testing.assert_allclose(ramp[:4], [0.0, 2.0, 4.0, 6.0])
    assert np.isnan(ramp[4])


def test_units_meaning_and_comment(folder):
    with asammdf.MDF(folder / "wet.mf4") as mdf:
        assert "simulated by aqualog" in mdf.header.comment
        assert "wet" in mdf.header.comment
        assert mdf.get("omega_fl").unit == "rad/s"
        assert SYMBOLS["omega_fl"].meaning in mdf.get("omega_fl").comment
        assert "simulated truth" in mdf.get("true_contact_fl").comment
        assert mdf.header.abs_time == START_NS
    from mcap.reader import make_reader

    with (folder / "wet.mcap").open("rb") as file:
        metadata = {m.name: m.metadata for m in make_reader(file).iter_metadata()}
    assert "simulated by aqualog" in metadata["aqualog"]["comment"]
    header = (folder / "wet.csv").read_text().splitlines()[0]
    assert header.startswith("t [s],")
    assert "true_grade [rad]" in header


@pytest.mark.parametrize("suffix", FORMATS)
def test_the_same_seed_gives_the_same_bytes_and_another_one_does_not(folder, tmp_path, suffix):
    before = (folder / f"wet.{suffix}").read_bytes()
    for name, extra in (("again", []), ("one", ["--seed", 1])):
        assert run("simulate", folder / "wet.toml", "-o", tmp_path / f"{name}.{suffix}", *extra).exit_code == 0
        assert (tmp_path / f"{name}.{suffix}").read_bytes() == before
    assert run("simulate", folder / "wet.toml", "-o", tmp_path / f"two.{suffix}", "--seed", 2).exit_code == 0
    old, new = channels(folder / f"wet.{suffix}"), channels(tmp_path / f"two.{suffix}")
    assert not np.array_equal(old["omega_fl"].values, new["omega_fl"].values)
    assert not np.array_equal(old["true_contact_fl"].values, new["true_contact_fl"].values)


def test_seed_of_the_file(folder, tmp_path):
    assert run("simulate", folder / "wet.toml", "-o", tmp_path / "zero.csv", "--seed", 0).exit_code == 0
    assert (tmp_path / "zero.csv").read_bytes() != (folder / "wet.csv").read_bytes()
    (tmp_path / "s.toml").write_text("seed = 5\n" + SCENARIO)
    run("simulate", tmp_path / "s.toml", "-o", tmp_path / "a.csv")
    run("simulate", folder / "wet.toml", "-o", tmp_path / "b.csv", "--seed", 5)
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()
    assert (tmp_path / "a.csv").read_bytes() != (folder / "wet.csv").read_bytes()


def test_json(folder, tmp_path):
    result = run("simulate", folder / "wet.toml", "-o", tmp_path / "x.parquet", "--json", "--seed", 9)
    document = json.loads(result.stdout)
    assert document["schema_version"] == 1
    assert document["log"] == str(tmp_path / "x.parquet")
    assert (document["duration_s"], document["sample_rate_hz"], document["seed"]) == (3.0, 100.0, 9)
    assert document["signals"] == [n for n in pl.read_parquet(tmp_path / "x.parquet").columns if n != "t"]
    assert document["real_time_factor"] > 0
    assert "x.parquet" in result.stderr
    assert "times as fast" in result.stderr


def test_without_json_stdout_is_empty_and_quiet_is_quiet(folder, tmp_path):
    result = run("simulate", folder / "wet.toml", "-o", tmp_path / "x.csv")
    assert result.stdout == ""
    assert "(seed 1)" in result.stderr
    result = run("simulate", folder / "wet.toml", "-o", tmp_path / "y.csv", "-q", "--progress", "plain")
    assert (result.stdout, result.stderr) == ("", "")
    result = run("simulate", folder / "wet.toml", "-o", tmp_path / "z.mf4", "-v", "--progress", "plain")
    assert "esc: 150 samples" in result.stderr
    assert "simulating 3 s" in result.stderr


@pytest.mark.parametrize("suffix", FORMATS)
def test_detect_reads_such_logs_without_a_map(folder, expected, suffix):
    result = run("detect", folder / f"wet.{suffix}", "--vehicle", CAR, "--json")
    assert result.exit_code == 0, result.stderr
    assert "true_" not in result.stdout + result.stderr
    document = json.loads(result.stdout)
    assert set(document["signals"]) == {n for g in expected for n in g.columns if not n.startswith("true_")}
    missing = {name: s["missing_fraction"] for name, s in document["signals"].items()}
    assert missing["omega_fl"] == 0.0
    assert missing["torque_fl"] == pytest.approx(1 / 300)  # the last sample, of a bus at half the rate
    assert max(missing.values()) <= 4 / 300 + 1e-9
    assert document["sample_rate_hz"] == 100.0
    assert document["quality"]["notes"] == []


def test_detectors_do_not_see_the_truth(folder, tmp_path):
    frame = pl.read_csv(folder / "wet.csv")
    blind = frame.select(c for c in frame.columns if not c.startswith("true_"))
    assert blind.width < frame.width
    blind.write_csv(tmp_path / "blind.csv")
    events = [
        json.loads(run("detect", p, "--vehicle", CAR, "--json").stdout)["events"]
        for p in (folder / "wet.csv", tmp_path / "blind.csv")
    ]
    assert events[0] == events[1]
    assert events[0]


def test_nothing_is_overwritten_without_force(folder, tmp_path):
    target = tmp_path / "x.csv"
    target.write_text("mine")
    result = run("simulate", folder / "wet.toml", "-o", target)
    assert result.exit_code == 2
    assert "--force" in one_error_line(result)
    assert target.read_text() == "mine"
    assert run("simulate", folder / "wet.toml", "-o", target, "--force").exit_code == 0
    assert target.read_bytes() == (folder / "wet.csv").read_bytes()


def test_a_source_is_never_the_target(tmp_path):
    for name in ("scenario.csv", "model.csv"):
        (tmp_path / name).write_text(SCENARIO if name == "scenario.csv" else "")
        extra = ["--model", tmp_path / name] if name == "model.csv" else []
        result = run("simulate", tmp_path / "scenario.csv", *extra, "-o", tmp_path / name, "--force")
        assert result.exit_code == 2
        assert "source" in one_error_line(result)
    assert (tmp_path / "scenario.csv").read_text() == SCENARIO


def test_a_wrong_suffix_is_refused_before_anything_is_read(tmp_path):
    result = run("simulate", tmp_path / "none.toml", "-o", tmp_path / "x.xls")
    assert result.exit_code == 2
    assert ".mf4 .mcap .csv .parquet" in one_error_line(result)


def test_usage_and_configuration_errors(folder, tmp_path):
    out = tmp_path / "x.csv"
    good = folder / "wet.toml"
    bad = tmp_path / "bad.toml"
    bad.write_text(SCENARIO.replace("speed_kmh", "sped_kmh").replace("water_depth_mm = 1.3", "water_depth_mm = 130"))
    result = run("simulate", bad, "-o", out)
    assert result.exit_code == 2
    for part in ("line 2", '"speed_kmh"', "line 8", "water_depth_mm = 130"):
        assert part in one_error_line(result)
    model = tmp_path / "model.toml"
    model.write_text('[[term]]\neffect = "hed_wind"\n')
    result = run("simulate", good, "-o", out, "--model", model)
    assert result.exit_code == 2
    assert '"head_wind"' in one_error_line(result)
    assert run("simulate", tmp_path / "none.toml", "-o", out).exit_code == 2
    assert run("simulate", good).exit_code == 2
    assert run("simulate", "-o", out).exit_code == 2
    assert run("simulate", good, "-o", out, "--seed", -1).exit_code == 2
    assert run("simulate", good, "-o", out, "--progress", "loud").exit_code == 2
    assert "one at a time" in one_error_line(run("simulate", good, bad, "-o", out))
    assert "--jobs" in one_error_line(run("simulate", good, "-o", out, "--jobs", 2))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bad.toml", "model.toml"]


def test_a_log_that_cannot_be_written_leaves_nothing(folder, tmp_path):
    (tmp_path / "file").write_text("")
    result = run("simulate", folder / "wet.toml", "-o", tmp_path / "file" / "x.csv")
    assert result.exit_code == 2
    one_error_line(result)
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_a_writer_that_fails_leaves_the_old_log(folder, tmp_path, monkeypatch):
    target = tmp_path / "x.mf4"
    target.write_text("old")
    monkeypatch.setattr("aqualog.io.write_mdf.write_mf4", lambda *a, **_: a[0].write_text("half") and 1 / 0)
    result = CliRunner().invoke(app, ["simulate", str(folder / "wet.toml"), "-o", str(target), "--force"])
    assert result.exit_code == 1
    assert target.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["x.mf4"]


def test_model(folder, tmp_path):
    (tmp_path / "none.toml").write_text("")
    assert (
        run("simulate", folder / "wet.toml", "-o", tmp_path / "n.csv", "--model", tmp_path / "none.toml").exit_code == 0
    )
    assert (tmp_path / "n.csv").read_bytes() == (folder / "wet.csv").read_bytes()
    (tmp_path / "heavy.toml").write_text('[[term]]\neffect = "payload_mass"\ndelta_mass = 300\n')
    result = run("simulate", folder / "wet.toml", "-o", tmp_path / "h.mf4", "--model", tmp_path / "heavy.toml")
    assert result.exit_code == 0, result.stderr
    old, new = channels(folder / "wet.mf4"), channels(tmp_path / "h.mf4")
    before, after = (sum(c[f"true_load_{w}"].values[0] for w in ("fl", "fr", "rl", "rr")) for c in (old, new))
    assert after - before == pytest.approx(300 * 9.81, rel=0.01)
    with asammdf.MDF(tmp_path / "h.mf4") as mdf:
        assert "heavy" in mdf.header.comment


@pytest.mark.parametrize(("duration", "rate"), [(0.1, 10), (0.1, 1000), (0.25, 20)])
def test_shortest_drives(tmp_path, duration, rate):
    text = SCENARIO.split("[[lane]]")[0].replace("duration_s = 3", f"duration_s = {duration}")
    (tmp_path / "s.toml").write_text(text.replace("sample_rate_hz = 100", f"sample_rate_hz = {rate}"))
    for suffix in ("csv", "mf4"):
        result = run("simulate", tmp_path / "s.toml", "-o", tmp_path / f"x.{suffix}")
        assert result.exit_code == 0, result.stderr
    assert pl.read_csv(tmp_path / "x.csv").height == max(round(duration * rate), 2)


def test_a_lane_after_the_drive_is_told(tmp_path):
    (tmp_path / "s.toml").write_text(
        SCENARIO.replace("start_s = 0.8", "start_s = 5").replace("end_s = 2.0", "end_s = 9")
    )
    result = run("simulate", tmp_path / "s.toml", "-o", tmp_path / "x.csv")
    assert result.exit_code == 0
    assert "begins after the drive" in result.stderr


def test_compiling_is_told_only_where_it_takes_long(monkeypatch, capsys):
    monkeypatch.setattr("aqualog.cli.console.SLOW_S", 0.05)
    with Heard(Console(), "off").slow("the simulation"):
        pass
    time.sleep(0.15)
    assert capsys.readouterr().err == ""
    with Heard(Console(), "off").slow("the simulation"):
        time.sleep(0.4)
    assert "compiling" in capsys.readouterr().err


@pytest.fixture
def campaign(monkeypatch):
    calls = []

    def run(programme, folder, *, jobs, force, report):
        calls.append((programme, folder, jobs, force))
        if programme == "wrong":
            raise ConfigError("no such programme")
        return CampaignOutcome(3, 0, {"wet": "no car"} if programme == "partly" else {})

    monkeypatch.setattr(programmes, "simulate_campaign", run)
    return calls


def test_campaign(campaign, tmp_path):
    runner = CliRunner()
    args = ["simulate", "campaign", "thesis", "-o", str(tmp_path / "out")]
    result = runner.invoke(app, args)
    assert result.exit_code == 0
    assert "3 drives simulated" in result.stderr
    assert runner.invoke(app, [*args, "-q"]).stderr == ""
    assert campaign.pop()
    assert runner.invoke(app, [*args, "--jobs", "2", "--force"]).exit_code == 0
    cores = os.cpu_count()
    assert campaign == [("thesis", Path(tmp_path / "out"), cores, False), ("thesis", Path(tmp_path / "out"), 2, True)]
    partly = runner.invoke(app, [*args[:2], "partly", *args[3:]])
    assert partly.exit_code == 3
    assert partly.stderr.startswith("error: wet: no car\n")
    assert runner.invoke(app, [*args[:2], "wrong", *args[3:]]).exit_code == 2


def test_usage_of_campaigns(campaign, tmp_path):
    out = ["-o", str(tmp_path / "out")]
    for args in (["campaign"], ["campaign", "a", "b"], ["campaign", "a", "--seed", "3"], ["campaign", "a", "--json"]):
        result = CliRunner().invoke(app, ["simulate", *args, *out])
        assert result.exit_code == 2, args
    assert campaign == []
    assert not list(tmp_path.iterdir())


def test_a_scenario_named_campaign(tmp_path):
    (tmp_path / "campaign").write_text(SCENARIO)
    result = run("simulate", "./campaign", "-o", "x.csv", cwd=tmp_path)
    assert result.exit_code == 0, result.stderr
    assert "./campaign" in one_error_line(run("simulate", "campaign", "-o", "y.csv", cwd=tmp_path))


def test_the_vehicle_file_is_not_written_over(tmp_path):
    car = tmp_path / "car.csv"
    car.write_bytes(CAR.read_bytes())
    (tmp_path / "s.toml").write_text('vehicle = "car.csv"\nspeed_kmh = 80.0\nduration_s = 1.0\n')
    result = run("simulate", tmp_path / "s.toml", "--force", "-o", car)
    assert result.exit_code == 2
    assert "source" in one_error_line(result)
    assert car.read_bytes() == CAR.read_bytes()


def test_a_campaign_is_no_log(tmp_path):
    result = run("simulate", "campaign", "thesis", "-o", tmp_path / "c.mf4")
    assert result.exit_code == 2
    assert not (tmp_path / "c.mf4").exists()
