"""A programme into a folder: whole, resumable, and what the thesis' programme holds."""

import csv
import json
import shutil
import tomllib
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from aqualog.config.vehicle import load_vehicle
from aqualog.core.errors import ConfigError
from aqualog.core.vehicle import Vehicle, vehicle_toml
from aqualog.io.open_log import open_log
from aqualog.model import campaign
from aqualog.model.campaign import simulate_campaign
from aqualog.model.programme import APPROACH_S, PROGRAMMES, RUN_OUT_S, thesis

CONTRACT = {
    "log", "tyre", "tread_depth_mm", "wear", "pressure_front_bar", "pressure_rear_bar", "water_depth_mm",
    "water_depth_left_mm", "load_front_kg", "load_rear_kg", "manoeuvre", "vehicle", "lane_start_s", "lane_end_s", "labels",
}  # fmt: skip


def small():
    runs = [r for r in thesis() if r.name.endswith("_1")][:3]
    return tuple(replace(r, scenario=replace(r.scenario, duration_s=5.0)) for r in runs)


@pytest.fixture
def programme(monkeypatch):
    monkeypatch.setitem(PROGRAMMES, "small", small)


@pytest.fixture(scope="module")
def complete(tmp_path_factory):
    """A folder in which the small programme is complete, and its outcome; not to be changed."""
    folder = tmp_path_factory.mktemp("small") / "c"
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(PROGRAMMES, "small", small)
        return folder, run(folder, jobs=2)


@pytest.fixture
def copied(complete, tmp_path):
    """The same to work on."""
    shutil.copytree(complete[0], tmp_path / "c")
    return tmp_path / "c"


def run(folder, jobs=1, force=False, seen=None):
    return simulate_campaign("small", folder, jobs=jobs, force=force, report=lambda *x: (seen or []).append(x))


def test_programme_of_the_thesis():
    runs = thesis()
    assert len(runs) >= 300
    assert len({r.name for r in runs}) == len(runs)
    assert len({r.scenario.seed for r in runs}) == len(runs)
    assert {r.scenario.tyre_front.name for r in runs} == {"very_worn_summer", "worn_summer", "new_summer", "new_winter"}
    assert min(v for r in runs for _, v in r.scenario.speed) > 0.0  # a car does not come backward
    assert {r.scenario.p_front for r in runs} == {1.9e5, 2.3e5, 2.8e5}
    assert {round(r.water_depth * 1e3, 1) for r in runs} >= {0.6, 0.8, 1.1, 1.2, 1.3, 2.0}
    assert {(r.scenario.load_front, r.scenario.load_rear) for r in runs} == {(0, 0), (270, 0), (0, 270)}
    assert {r.scenario.vehicle.drivetrain for r in runs} == {"rwd", "awd"}
    assert {r.manoeuvre for r in runs} == {"constant", "acceleration", "deceleration", "slalom"}
    shown = {f for r in runs for f in r.figures.split(",")}
    # 2.1 is a drawing, 2.2 is analytic, 2.24 a diagram, 2.18 and 2.20 are regressions of the same drives
    assert {f"2.{n}" for n in range(3, 26)} - {"2.24"} <= shown


def test_each_configuration_of_the_slope_figures_has_five_passes_a_bin():
    """Figs 2.17-2.20: passes whose speed over the lane's middle is in the middle of a bin, at different accelerations."""
    passes = Counter()
    for r in thesis():
        s = r.scenario
        over_lane = 0.5 * (s.duration_s + APPROACH_S - RUN_OUT_S)
        middle = np.interp(over_lane, [p[0] for p in s.speed], [p[1] for p in s.speed]) * 3.6
        if s.vehicle.drivetrain == "rwd" and r.water_depth and abs(middle % 10.0 - 5.0) < 0.5:
            case = (s.tyre_rear.name, s.p_rear, round(r.water_depth * 1e3, 1), s.load_front, s.load_rear)
            passes[case, int(middle // 10)] += 1
    depths = [("worn_summer", 1.9e5, h, 0.0, 0.0) for h in (0.6, 0.8, 1.1, 1.2, 1.3, 2.0)]
    pressures = [("worn_summer", p, 1.2, 0.0, 0.0) for p in (2.3e5, 2.8e5)]
    winter = [("new_winter", 1.9e5, h, 0.0, 0.0) for h in (1.3, 2.0)]
    loads = [("worn_summer", p, 1.2, *x) for p in (1.9e5, 2.3e5) for x in ((270.0, 0.0), (0.0, 270.0))]
    for case in depths + pressures + winter + loads:
        for speed_bin in range(6, 12):
            assert passes[case, speed_bin] >= 5, (case, speed_bin)


def test_names_tell_drives_apart_and_old_ones_stay():
    names = [r.name for r in thesis()]
    assert names[0] == "rwd_worn_summer_low_1.3mm_060kmh_const_1"
    assert "rwd_worn_summer_low_1.2mm_rear270_060kmh_a+0.5_1" in names
    assert "rwd_worn_summer_low_1.2mm_rear270_065kmh_a+0.25_1" in names
    assert 387 < len(names) < 1000


def test_campaign_is_what_the_contract_says(complete):
    folder, outcome = complete
    assert (outcome.made, outcome.kept, outcome.failed) == (3, 0, {})
    document = tomllib.loads((folder / "campaign.toml").read_text())
    assert set(document) == {"name", "vehicle", "runs"}
    rows = list(csv.DictReader((folder / document["runs"]).open()))
    assert len(rows) == 3
    for row in rows:
        assert {c for c in row if not c.startswith("x_")} <= CONTRACT
        assert (folder / row["log"]).is_file()
        assert load_vehicle(folder / row["vehicle"]).name == "sedan RWD"
        assert 3.9 < float(row["lane_start_s"]) < 4.1
    with open_log(folder / rows[0]["log"]) as log:
        names = {c.name for c in log.channels()}
    assert {"omega_fl", "torque_rr", "on_water", "true_contact_fl"} <= names
    lines = [json.loads(x) for x in (folder / campaign.STATE).read_text().splitlines()]
    assert {x["name"] for x in lines} == {r.name for r in small()}


def test_a_broken_run_goes_on_where_it_stopped(copied, programme):
    folder = copied
    logs = sorted((folder / "logs").iterdir())
    before = {p.name: p.stat().st_mtime_ns for p in logs}
    logs[0].unlink()
    with (folder / campaign.STATE).open("a") as file:
        file.write('{"name": "torn')  # a line that a power cut left
    seen = []
    outcome = run(folder, seen=seen)
    assert (outcome.made, outcome.kept) == (1, 2)
    after = {p.name: p.stat().st_mtime_ns for p in (folder / "logs").iterdir()}
    assert set(after) == set(before)
    assert sorted(n for n in after if after[n] == before[n]) == [p.name for p in logs[1:]]
    assert run(folder).kept == 3
    assert run(folder, force=True).made == 3


def test_another_scenario_is_made_again(copied, monkeypatch):
    changed = tuple(
        replace(r, scenario=replace(r.scenario, load_rear=50.0)) if i == 0 else r for i, r in enumerate(small())
    )
    monkeypatch.setitem(PROGRAMMES, "small", lambda: changed)
    assert run(copied).made == 1


def test_a_run_that_fails_leaves_the_others_alone(tmp_path, monkeypatch):
    runs = small()
    bad = replace(runs[0], scenario=replace(runs[0].scenario, extra_torque=((0.0, float("nan")),)))
    monkeypatch.setitem(PROGRAMMES, "small", lambda: (bad, *runs[1:]))
    outcome = run(tmp_path / "c", jobs=2)
    assert outcome.made == 2
    assert list(outcome.failed) == [bad.name]
    assert "diverged" in outcome.failed[bad.name]
    rows = (tmp_path / "c/runs.csv").read_text()
    assert bad.name not in rows
    assert runs[1].name in rows


def test_foreign_folders_are_left_alone(tmp_path, programme):
    (tmp_path / "mine.txt").write_text("x")
    with pytest.raises(ConfigError, match="holds other files"):
        run(tmp_path)
    with pytest.raises(ConfigError, match="no programme"):
        simulate_campaign("thesi", tmp_path / "c", jobs=1, force=False, report=lambda *x: None)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["mine.txt"]


def test_vehicle_file_comes_back(tmp_path):
    car = Vehicle(name='the "car"', drivetrain="awd", torque_split_rear=0.6, mass=1900.0, tie_rod={"c_y": (0.1, 1e-5)})
    (tmp_path / "v.toml").write_text(vehicle_toml(car))
    back = load_vehicle(tmp_path / "v.toml")
    assert back.name == "the car"
    assert back.tie_rod == car.tie_rod
    for name in ("mass", "l_f", "torque_split_rear", "r_l_r", "mu_max", "inertia_f"):
        assert getattr(back, name) == getattr(car, name)


def test_a_damaged_log_or_state_is_made_again(copied, programme):
    folder = copied
    log = sorted((folder / "logs").iterdir())[0]
    log.write_bytes(log.read_bytes()[:1000])
    assert run(folder).made == 1
    assert log.stat().st_size > 1000
    with (folder / campaign.STATE).open("ab") as file:
        file.write(b"\xff\xfe\n" + b"[" * 100_000 + b'\n{"name": 1}\n[]\n7\n')
    assert run(folder).kept == 3
