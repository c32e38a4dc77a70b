"""`aqualog test`: what it prints, writes and refuses."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from aqualog.core.vehicle import vehicle_toml
from aqualog.io.write_log import LogGroup, write_log
from tests.commands import one_error_line, run
from tests.conftest import ROOT
from tests.trade.made import FWD, straight

LOG, CAR = ROOT / "sample_logs" / "lane_drive.mf4", ROOT / "sample_logs" / "vehicle.toml"
UNITS = {
    "omega": "rad/s", "torque": "N*m", "v": "m/s", "a": "m/s^2", "yaw": "rad/s", "water": "m", "on": "", "gear": "",
}  # fmt: skip


def write(path, columns, rate=100.0):
    n = len(columns["omega_fl"])
    group = LogGroup("log", {k: (UNITS[k.split("_")[0]], "", np.asarray(x, float)) for k, x in columns.items()}, None)
    t_ns = np.rint(np.arange(n) * 1e9 / rate).astype(np.int64)
    write_log(path, t_ns, [group], suffix=path.suffix, start_ns=1_700_000_000_000_000_000, comment="", written_ns=0)


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """Control SRTT, tyre A 5 km/h better, control again; one run with a shift, one that ends before 15 %, one lost."""
    folder = tmp_path_factory.mktemp("trade")
    (folder / "car.toml").write_text(vehicle_toml(FWD))
    speeds = [("SRTT", v) for v in (78.0, 78.6, 77.8)] + [("A", v) for v in (83.0, 83.4, 82.6, 83.2, 82.8, 83.0)]
    speeds += [("SRTT", v) for v in (77.0, 77.6, 76.8)]
    rows = ["log,tyre,water_depth_mm,water_depth_left_mm"]
    for k, (tyre, v) in enumerate(speeds):
        columns = straight(v_15=v, side="right")
        if k == 3:
            columns["gear"] = np.where(columns["v_x"] > v / 3.6, 4.0, 3.0)
        if k == 4:
            columns = {n: x[:720] for n, x in columns.items()}  # at 83.7 km/h, and 15 % are at 83.4: 0.1 s are missing
        write(folder / f"run_{k}.mf4", columns)
        rows.append(f"run_{k}.mf4,{tyre},7,0")
    rows.append("gone.mf4,A,7,0")
    (folder / "runs.csv").write_text("\n".join(rows) + "\n")
    (folder / "campaign.toml").write_text('name = "week"\nvehicle = "car.toml"\nruns = "runs.csv"\n')
    return folder


def test_campaign(campaign, tmp_path):
    done = run("test", "straight", campaign / "campaign.toml", "--control", "SRTT", "--jobs", 1, "-o", tmp_path / "out",
               "--csv", tmp_path / "sets.csv")  # fmt: skip
    assert done.exit_code == 3, done.stderr  # one log is not there
    assert "gone.mf4" in done.stderr
    assert "straight aquaplaning: 11 of 12 runs valid, 2 sets" in done.stdout
    assert "the gear changes within 0.3 s of the crossing" in done.stdout
    assert "points above SRTT: index" in done.stdout
    assert "straight.slip 0.15, straight.slip_mean 0.1 s, " in done.stdout
    assert "straight.entry 0.5 s," in done.stdout
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == [
        "straight.html", "straight.json", "straight_runs.csv", "straight_sets.csv",
    ]  # fmt: skip
    page = (tmp_path / "out" / "straight.html").read_text()
    assert "speed of 15 % slip" in page
    rows = list(csv.DictReader((tmp_path / "out" / "straight_runs.csv").open()))
    assert len(rows) == 12
    assert float(rows[0]["v_15_kmh"]) == pytest.approx(78.0, abs=0.05)
    assert rows[3]["valid"] == "false"
    assert rows[4]["censored"] == "true"
    sets = list(csv.DictReader((tmp_path / "sets.csv").open()))
    assert [s["tyre"] for s in sets] == ["SRTT", "A"]
    assert float(sets[1]["index"]) > 105.0
    assert (tmp_path / "sets_runs.csv").exists()


def test_json_of_the_contract(campaign):
    done = run(
        "test", "straight", campaign / "campaign.toml", "--control", "SRTT", "--index", 110, "--jobs", 1, "--json"
    )
    document = json.loads(done.stdout, parse_constant=lambda c: pytest.fail(f"{c} is no JSON"))
    first = document["runs"][0]
    assert {"log", "v_15_kmh", "censored", "valid", "reason"} <= set(first)
    assert (first["valid"], first["censored"], first["reason"]) == (True, False, None)
    a = next(s for s in document["sets"] if s["tyre"] == "A")
    assert set(a) >= {"tyre", "runs", "mean_kmh", "ci95", "cv", "index", "index_ci95"}
    assert (a["runs"], a["valid"], a["censored"]) == (6, 5, 1)
    assert a["index"] > 110.0 * 1.05
    assert document["failed"][0]["log"] == "gone.mf4"
    assert document["controls"][0]["drift"] == pytest.approx(-1.0 / 78.133, abs=0.002)


def test_logs_without_a_campaign(campaign, tmp_path):
    logs = [campaign / f"run_{k}.mf4" for k in (0, 1, 2)]
    done = run("test", "straight", *logs, "--vehicle", campaign / "car.toml", "--page", tmp_path / "p.html")
    assert done.exit_code == 0, done.stderr
    assert "3 of 3 runs valid, 1 set" in done.stdout
    assert "78.1" in done.stdout  # the mean
    assert (tmp_path / "p.html").read_text().startswith("<!DOCTYPE html>")
    again = run("test", "straight", *logs, "--vehicle", campaign / "car.toml", "--page", tmp_path / "p.html")
    assert again.exit_code == 2
    assert "--force" in one_error_line(again)


def test_a_log_without_the_v_x_of_the_map_is_measured_by_the_free_wheel(tmp_path):
    columns = straight()
    del columns["v_x"]
    write(tmp_path / "a.mf4", columns)
    (tmp_path / "car.toml").write_text(vehicle_toml(FWD))
    (tmp_path / "map.toml").write_text('[signals]\nv_x = "GNSS_Speed"\n')
    own = (tmp_path / "a.mf4", "--vehicle", tmp_path / "car.toml", "--signals", tmp_path / "map.toml", "--json")
    done = run("test", "straight", *own)
    assert done.exit_code == 0, done.stderr
    (found,) = json.loads(done.stdout)["runs"]
    assert (found["v_15_kmh"], found["reference"]) == (pytest.approx(78.0, abs=0.05), "omega_rr")
    said = "no v_x in the log: the speed is that of the free wheel omega_rr, with the vehicle file's radius"
    assert said in found["notes"]
    for needs_it in (("test", "curve"), ("test", "braking"), ("detect",)):
        assert 'v_x: no channel "GNSS_Speed"' in run(*needs_it, *own).stderr


@pytest.mark.parametrize("test", ["straight", "curve", "braking"])
def test_a_log_without_such_a_run_says_so(test, tmp_path):
    done = run("test", test, LOG, "--vehicle", CAR, "--json", "-o", tmp_path / "out")
    assert done.exit_code == 4
    document = json.loads(done.stdout)
    assert not document["runs"][0]["valid"]
    reason = {
        "straight": "no side is dry beside a wet one",
        "curve": "no curve",
        "braking": "no stop from 80 to 20 km/h",
    }
    assert reason[test] in document["runs"][0]["reason"]
    assert (tmp_path / "out" / f"{test}.html").exists()


@pytest.mark.real
@pytest.mark.parametrize("test", ["straight", "curve", "braking"])
@pytest.mark.parametrize("car", ["porsche", "toyota"])
def test_measured_drives_hold_no_such_run(car, test, real_logs, tmp_path):
    here = Path(__file__).parents[1] / "real"
    logs = (
        sorted((real_logs / "porsche_981").glob("*.csv"))
        if car == "porsche"
        else [real_logs / "toyota_rav4/can_bus.mf4"]
    )
    more = ["--dbc", real_logs / "toyota_rav4" / "toyota_2017.dbc"] if car == "toyota" else []
    campaign = tmp_path / "campaign.toml"
    campaign.write_text(
        f'vehicle = "{here / car}.toml"\nsignals = "{here / car}_map.toml"\n[[run]]\nlog = {[str(p) for p in logs]}\n'
    )
    done = run("test", test, campaign, *more)
    assert done.exit_code == 4, done.stderr
    assert "valid; the list below says why" in done.stdout
    why = {
        "straight": "no watered lane in the log",
        "curve": "no watered lane in the log",
        "braking": "v_x is not in the log",
    }
    assert why[test] in done.stdout


@pytest.mark.parametrize(
    ("arguments", "words"),
    [(("straight", LOG), "no vehicle"),
     (("straight", "CAMPAIGN", "--control", "SRT"), 'no run has the control tyre "SRT"'),
     (("straight", "CAMPAIGN", "--index", "50"), "an index without a control"),
     (("straight", "CAMPAIGN", "--by", "tire"), 'did you mean "tyre"'),
     (("curve", "CAMPAIGN", "--result", "most"), "min, mean, area"),
     (("braking", "CAMPAIGN", "--from", "20", "--to", "80"), "from a higher to a lower speed"),
     (("straight", "CAMPAIGN", "--limits", CAR), "unknown key"),
     (("braking", "CAMPAIGN", "--coefficients", CAR), "unknown key"),
     (("straight", "CAMPAIGN", "--csv", "table.txt"), "is no CSV")],
)  # fmt: skip
def test_what_is_refused(campaign, arguments, words):
    done = run("test", *(campaign / "campaign.toml" if a == "CAMPAIGN" else a for a in arguments))
    assert done.exit_code == 2
    assert words in one_error_line(done)


def test_sources_are_not_overwritten(campaign):
    done = run("test", "straight", campaign / "campaign.toml", "--page", campaign / "runs.csv", "--force")
    assert done.exit_code == 2
    assert "source" in one_error_line(done)
