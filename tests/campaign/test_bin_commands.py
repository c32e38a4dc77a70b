"""`bin-slipslope` and `bin-resistance`: from a campaign file to tables, JSON and files."""

import csv
import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import typer
from typer.testing import CliRunner

import aqualog as aq
from aqualog.cli.campaign import bin_resistance, bin_slipslope
from aqualog.core.vehicle import vehicle_toml
from aqualog.model.log import write_simulation
from aqualog.model.programme import SEDAN
from aqualog.model.scenario import Lane, Scenario
from aqualog.model.simulate import simulate
from aqualog.model.tyre import TYRES
from tests.campaign.made import make_campaign
from tests.margin.passes import KMH, own_full

app = typer.Typer()
app.command("bin-slipslope", no_args_is_help=True)(bin_slipslope)
app.command("bin-resistance", no_args_is_help=True)(bin_resistance)

SLOPE_KEYS = {"runs", "samples", "slope", "slope_ci95", "intercept", "r2", "wheel", "v_low_kmh", "v_high_kmh"}


def invoke(*args):
    return CliRunner().invoke(app, [str(a) for a in args])


def drive(a, seed, kmh=85.0):
    v, duration = kmh / 3.6, 10.0
    speed = ((0.0, v - 5.0 * a), (duration, v + 5.0 * a))
    return Scenario(
        SEDAN, duration_s=duration, seed=seed, speed=speed, lanes=(Lane(3.0, 7.5, depth_left=8e-4, depth_right=1.3e-3),)
    )


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    folder = tmp_path_factory.mktemp("c")
    (folder / "car.toml").write_text(vehicle_toml(SEDAN))
    rows = ["log,tyre,water_depth_mm,water_depth_left_mm,pressure_front_bar,pressure_rear_bar,lane_start_s,lane_end_s"]
    for seed, a in enumerate((0.0, 0.2, 0.4, 0.6, 0.8, 1.0), start=1):
        name = f"a{a:.1f}.parquet"
        write_simulation(folder / name, simulate(drive(a, seed)), suffix=".parquet", comment="made")
        rows.append(f"{name},worn_summer,1.3,0.8,1.9,1.9,3.0,7.5")
    (folder / "runs.csv").write_text("\n".join(rows) + "\n")
    (folder / "campaign.toml").write_text('name = "made"\nvehicle = "car.toml"\nruns = "runs.csv"\n')
    return folder / "campaign.toml"


def test_slopes_as_the_contract_says(campaign):
    done = invoke("bin-slipslope", campaign, "--by", "tyre,pressure,water-depth", "--json", "--jobs", 1, "-q")
    assert done.exit_code == 0, done.stderr
    document = json.loads(done.stdout)
    assert document["by"] == ["tyre", "pressure_front_bar", "pressure_rear_bar", "water_depth_mm"]
    rows = document["rows"]
    assert all(SLOPE_KEYS | set(document["by"]) <= set(r) for r in rows)
    assert {r["wheel"] for r in rows} == {"rl", "rr"}
    (row,) = (r for r in rows if r["wheel"] == "rr" and r["v_low_kmh"] == 80.0)
    assert row["runs"] == 6
    assert row["reliable"]
    low, high = row["slope_ci95"]
    assert low < row["slope"] < high
    # the brush's chord at the contact that is left; the contact fluctuates and lowers its mean
    assert row["slope"] == pytest.approx(row["expected_slope"], rel=0.2)
    assert row["slope"] < row["slope_dry"]
    (delay,) = document["delays"]
    assert delay["delay_s"] == pytest.approx(0.09, abs=0.02)  # 0.1 s of v_x, less what the wheels' own path takes
    assert {"slip_slope", "minor_spin_down", "spin_down", "margin"} == {f["way"] for f in document["full_aquaplaning"]}
    assert all(f["reason"] for f in document["full_aquaplaning"] if f["v_full_kmh"] is None)
    assert document["minor_spin_downs"]
    (foretold,) = (f for f in document["full_aquaplaning"] if f["way"] == "margin")
    low, high = foretold["v_full_ci95_kmh"]
    full = own_full(TYRES["worn_summer"], SEDAN, 1.3e-3, 1.9e5) / KMH
    assert low < full < high < 1.5 * full


def test_tables_and_files(campaign, tmp_path):
    done = invoke("bin-slipslope", campaign, "--road", "both", "--robust", "-o", tmp_path / "s.csv", "--jobs", 1)
    assert done.exit_code == 0, done.stderr
    assert "speed of full aquaplaning" in done.stdout
    assert "v_x is late by" in done.stdout
    rows = list(csv.DictReader((tmp_path / "s.csv").open()))
    assert {r["road"] for r in rows} == {"wet", "dry"}
    assert {"slope_low", "slope_high", "contact_ratio_low"} <= set(rows[0])
    again = invoke("bin-slipslope", campaign, "-o", tmp_path / "s.csv", "--jobs", 1)
    assert again.exit_code == 2
    assert "exists already" in again.stderr
    done = invoke("bin-slipslope", campaign, "--by", "side", "-o", tmp_path / "s.parquet", "--jobs", 1)
    assert done.exit_code == 0, done.stderr
    assert set(pl.read_parquet(tmp_path / "s.parquet")["side"]) == {"left", "right"}


def test_resistance_as_the_contract_says(campaign, tmp_path):
    done = invoke("bin-resistance", campaign, "--json", "--jobs", 1, "-o", tmp_path / "r.csv", "-q")
    assert done.exit_code == 0, done.stderr
    document = json.loads(done.stdout)
    (row,) = (r for r in document["rows"] if r["v_low_kmh"] == 80.0)
    low, high = row["delta_a_x_ci95"]
    assert low < row["delta_a_x"] < high
    assert 0.05 < row["delta_a_x"] < 0.4
    assert document["less_own_dry_level"]
    assert (tmp_path / "r.csv").read_text().count("\n") == len(document["rows"]) + 1
    text = invoke("bin-resistance", campaign, "--road", "both", "--as-measured", "--jobs", 1)
    assert text.exit_code == 0
    assert "Resistance measure" in text.stdout


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (["--by", "tire"], "no run has this key"),
        (["--road", "damp"], 'road "damp"'),
        (["-o", "x.xlsx"], "no format of a table"),
    ],
)
def test_faults_are_told_before_any_work(campaign, args, said):
    for command in ("bin-slipslope", "bin-resistance"):
        done = invoke(command, campaign, *args)
        assert done.exit_code == 2
        assert said in done.stderr
        assert not Path("x.xlsx").exists()


def test_water_that_nobody_tells_is_told(campaign, tmp_path):
    logs = sorted(campaign.parent.glob("a*.parquet"))
    bare = tmp_path / "bare"
    bare.mkdir()
    for log in logs[:2]:
        frame = pl.read_parquet(log)
        frame.select([c for c in frame.columns if not c.startswith(("on_water", "true_", "water_"))]).write_parquet(
            bare / log.name
        )
    car = tmp_path / "car.toml"
    car.write_text(vehicle_toml(SEDAN))
    done = invoke("bin-resistance", *sorted(bare.iterdir()), "--vehicle", car, "--store", tmp_path / "s", "--jobs", 1)
    assert "no samples: on or off the water is not known\ntry: water_depth_mm = 0" in done.stdout


@pytest.fixture(scope="module")
def no_wheels(tmp_path_factory):
    """Two dry runs of a car whose log has a speed and a torque, and no wheel speeds; one of a road that is not known."""
    folder = tmp_path_factory.mktemp("n")
    (folder / "car.toml").write_text(vehicle_toml(SEDAN))
    t = np.arange(0.0, 30.0, 0.05)
    v = 20.0 + 4.0 * np.sin(0.4 * t)
    a = 1.6 * np.cos(0.4 * t)
    for name in ("a", "b", "c"):
        torque = 540.0 * a + 120.0 + 1e-3 * len(name)
        pl.DataFrame({"t": t, "v_x": v, "a_x": a, "torque_r": torque}).write_csv(folder / f"{name}.csv")
    dry = "".join(f'[[run]]\nlog = "{n}.csv"\nwater_depth_mm = 0.0\n' for n in ("a", "b"))
    head = 'name = "n"\nvehicle = "car.toml"\n'
    (folder / "dry.toml").write_text(head + dry)
    (folder / "some.toml").write_text(f'{head}{dry}[[run]]\nlog = "c.csv"\nx_weather = "rain"\n')
    return folder


MISSING = "no slip: wheel speeds are missing (omega_rl, omega_rr)"


@pytest.mark.parametrize(
    ("file", "road", "said"),
    [
        ("dry.toml", "dry", (f"all samples on dry road are left out, most of them because: {MISSING}",)),
        ("dry.toml", "wet", ("no samples on wet road",)),
        ("some.toml", "dry", (f"most of them because: {MISSING}\nsome samples: on or off the water is not known",)),
    ],
)
def test_a_table_without_a_row_says_what_is_missing_and_sends_nobody_in_a_circle(no_wheels, file, road, said):
    done = invoke("bin-slipslope", no_wheels / file, "--road", road, "--jobs", 1, "-q")
    assert all(s in done.stdout for s in said), done.stdout
    assert f"no dry slope, so no contact ratio; of the dry driving: {MISSING}" in done.stdout
    assert "neither v_x" not in done.stdout
    assert "no dry driving" not in done.stdout
    assert "--road" not in done.stdout


def test_another_road_is_proposed_where_it_has_rows(no_wheels):
    done = invoke("bin-resistance", no_wheels / "dry.toml", "--road", "wet", "--jobs", 1, "-q")
    assert "no samples on wet road\ntry: --road dry\n" in done.stdout
    assert "try:" not in invoke("bin-resistance", no_wheels / "dry.toml", "--road", "dry", "--jobs", 1, "-q").stdout


def without_drivetrain(folder):
    car = folder / "car.toml"
    car.write_text("\n".join(x for x in car.read_text().splitlines() if not x.startswith("drivetrain")) + "\n")


def test_no_axle_is_taken_for_the_driven_one(tmp_path):
    made = make_campaign(tmp_path, speeds=(), repeats=0)
    lanes = (Lane(10.0, 14.0, depth_left=8e-4, depth_right=1.3e-3),)
    scenario = Scenario(SEDAN, duration_s=30.0, speed=((0.0, 20.0), (30.0, 26.0)), lanes=lanes)
    write_simulation(tmp_path / "long.parquet", simulate(scenario), suffix=".parquet", comment="made")
    with (tmp_path / "runs.csv").open("a") as rows:
        rows.write("long.parquet,worn_summer,1.3,1.9,1.9,10,14\n")
    without_drivetrain(tmp_path)
    done = invoke("bin-slipslope", made, "--jobs", 1)
    assert done.exit_code == 4, done.stderr
    said = " ".join(done.stderr.split())
    assert "car.toml: no slip slopes for 1 of 1 runs: no file says which axle is driven" in said
    assert 'expected drivetrain = "rwd", "fwd" or "awd" in the vehicle file' in said
    assert 'torque_r moves, torque_f does not: in the vehicle file drivetrain = "rwd"?' in said
    runs = aq.Campaign(made).run(jobs=1)
    (note,) = (n for n in runs.notes if "driven" in n)
    assert note.startswith("car.toml: what depends on the driven axle is not judged for 1 of 1 runs")
    assert "slip slopes and speeds of full aquaplaning are not estimated" in runs.report(tmp_path / "page").read_text()


def test_a_car_without_drivetrain_does_not_stop_the_others(tmp_path):
    made = make_campaign(tmp_path)
    (tmp_path / "other.toml").write_text((tmp_path / "car.toml").read_text())
    without_drivetrain(tmp_path)
    head, *rows = (tmp_path / "runs.csv").read_text().splitlines()
    lines = [f"{head},vehicle", *(f"{r},{'other' if '_0' in r else 'car'}.toml" for r in rows)]
    (tmp_path / "runs.csv").write_text("\n".join(lines) + "\n")
    done = invoke("bin-slipslope", made, "--json", "--jobs", 1)
    assert done.exit_code == 0, done.stderr
    assert "no slip slopes for 2 of 4 runs" in " ".join(done.stderr.split())
    found = json.loads(done.stdout)
    assert {r["vehicle"] for r in found["rows"]} == {"other"}
    assert {r["vehicle"] for r in found["minor_spin_downs"]} <= {"other"}
    assert found["left_out_samples"]["the vehicle file does not say which axle is driven"] > 0
