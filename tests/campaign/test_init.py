"""From a folder of logs to a campaign file: names, drives, signals, and files that load at once."""

import csv
import itertools
import json
import os
import shutil

import numpy as np
import pytest
from typer.testing import CliRunner

from aqualog.align.load import load_signals
from aqualog.campaign.propose_drives import drive_name, group_drives, is_run_table, kinds_of, scan
from aqualog.campaign.propose_names import read_names
from aqualog.campaign.store import MARK
from aqualog.cli.campaign import campaign_app
from aqualog.cli.main import app
from aqualog.config.campaign import load_campaign
from aqualog.config.signal_map import load_signal_map
from aqualog.config.vehicle import load_vehicle
from aqualog.core.errors import ConfigError
from tests.can_log import CanMessage, write_can_mf4
from tests.conftest import ROOT

SAMPLE = ROOT / "sample_logs" / "lane_drive.mf4"
CAR = ROOT / "sample_logs" / "vehicle.toml"
WHEELS_OF = ("FL", "FR", "RL", "RR")
LOADED = ("loaded_monday.parquet", "loaded_friday.parquet")


def first(name, other="zzz.mf4"):
    """What one name says, besides words that are not known."""
    table = read_names([name, other])
    return {c: v[0] for c, v in table.columns.items() if v[0] and not c.startswith("x_part")}


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("2.2bar", {"pressure_front_bar": "2.2", "pressure_rear_bar": "2.2"}),
        ("p19", {"pressure_front_bar": "1.9", "pressure_rear_bar": "1.9"}),
        ("1,9bar", {"pressure_front_bar": "1.9", "pressure_rear_bar": "1.9"}),
        ("1_9bar", {"pressure_front_bar": "1.9", "pressure_rear_bar": "1.9"}),
        ("190kPa", {"pressure_front_bar": "1.9", "pressure_rear_bar": "1.9"}),
        ("29psi", {"pressure_front_bar": "1.999", "pressure_rear_bar": "1.999"}),
        ("va2.2bar_ha2.4bar", {"pressure_front_bar": "2.2", "pressure_rear_bar": "2.4"}),
        ("90bar", {}),
        ("1.3mm", {"water_depth_mm": "1.3"}),
        ("h08", {"water_depth_mm": "0.8"}),
        ("1p3mm", {"water_depth_mm": "1.3"}),
        ("Wassertiefe 1,3 mm", {"water_depth_mm": "1.3"}),
        ("profil1.6mm_2mm", {"tread_depth_mm": "1.6", "water_depth_mm": "2"}),
        ("80kmh", {"x_speed_kmh": "80"}),
        ("v098", {"x_speed_kmh": "98"}),
        ("80 km/h".replace("/", ""), {"x_speed_kmh": "80"}),
        ("50mph", {"x_speed_kmh": "80.467"}),
        ("hinten200kg", {"load_rear_kg": "200"}),
        ("270kg_vorne", {"load_front_kg": "270"}),
        ("200kg", {"x_load_kg": "200"}),
        ("Konst", {"manoeuvre": "constant"}),
        ("Beschleunigung", {"manoeuvre": "acceleration"}),
        ("brake", {"manoeuvre": "braking"}),
        ("a-0.4", {"x_acceleration": "-0.4", "manoeuvre": "deceleration"}),
        ("DryConst80", {"x_surface": "dry", "water_depth_mm": "0", "manoeuvre": "constant"}),
        ("trocken", {"x_surface": "dry", "water_depth_mm": "0"}),
        ("nass_1.3mm", {"x_surface": "wet", "water_depth_mm": "1.3"}),
        ("very_worn_summer", {"wear": "very_worn", "tyre": "very_worn_summer"}),
        ("Winter neu", {"wear": "new", "tyre": "winter_neu"}),
        ("Reifen_A", {"tyre": "reifen_a"}),
        ("tyreB2", {"tyre": "tyre_b2"}),
        ("2024-05-01_1015", {"x_date": "2024-05-01", "x_time": "10:15"}),
        ("20240501T101502", {"x_date": "2024-05-01", "x_time": "10:15:02"}),
        ("01.05.2024", {"x_date": "2024-05-01"}),
        ("20240501_080kmh", {"x_date": "2024-05-01", "x_speed_kmh": "80"}),
        ("Wdh03", {"x_repeat": "3"}),
        ("Lauf12", {"x_run": "12"}),
        ("WR", {"tyre": "winter"}),
        ("SR_neu", {"tyre": "summer_neu", "wear": "new"}),
        ("WR2_GJR", {"tyre": "winter_2_all-season"}),
        ("WH2.0", {"water_depth_mm": "2"}),
        ("WT2", {"water_depth_mm": "2"}),
        ("WH08", {"water_depth_mm": "0.8"}),
        ("WT13mm", {"water_depth_mm": "13"}),
        ("070 km-h", {"x_speed_kmh": "70"}),
        ("070km-h", {"x_speed_kmh": "70"}),
        ("beschl1,0", {"x_acceleration": "1", "manoeuvre": "acceleration"}),
        ("a1.0", {"x_acceleration": "1", "manoeuvre": "acceleration"}),
        ("sommer/neu/v080", {"tyre": "sommer_neu", "wear": "new", "x_speed_kmh": "80"}),
    ],
)
def test_words_of_names(name, expected):
    got = first(f"{name}.mf4")
    assert got == expected
    assert first(f"Messung_{name}_x.csv") == expected


def test_what_is_not_known_becomes_a_column_and_what_is_always_there_is_left_out():
    table = read_names(["Test_north_car7_01.mf4", "Test_south_car8_01.mf4", "Test_south_car8_02.mf4"])
    assert table.columns == {
        "x_repeat": ["1", "1", "2"],
        "x_part1": ["north", "south", "south"],
        "x_car": ["7", "8", "8"],
    }
    assert table.dropped == ("Test",)
    assert set(table.rules) == set(table.columns)
    uneven = read_names(["a_b_1.mf4", "a_c_d_2.mf4"])
    assert uneven.columns == {"x_repeat": ["1", "2"], "x_part1": ["b", "c"], "x_part2": ["", "d"]}
    assert read_names(["brand_new_log.mf4"]).columns == {"wear": ["new"]}


def test_a_number_that_may_be_a_decimal_is_doubted():
    assert read_names(["run_1_3mm.mf4", "x.mf4"]).notes == ('"1_3mm": read as 3, not as a decimal number; check it',)


def table(path, heading, columns, separator=","):
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, delimiter=separator)
        writer.writerow(heading)
        cells = [[f"{v:.4f}".replace(".", "," if separator == ";" else ".") for v in c] for c in columns]
        writer.writerows(zip(*cells, strict=True))


T = np.arange(0.0, 20.0, 0.05)
COUNT = itertools.count(1)
SPEED = 20.0 + 3.0 * np.sin(0.5 * T)
WHEELS = ("Raddrehzahl_VL", "Raddrehzahl_VR", "Raddrehzahl_HL", "Raddrehzahl_HR")


def unlike():
    """Added to samples: of two files that are made none is a copy of the other."""
    return np.append(np.zeros(T.size - 1), 1e-4 * next(COUNT))


def wheels(path, names=WHEELS, unit="U/min", factor=60.0 / (2.0 * np.pi)):
    omega = SPEED / 0.317 * factor + unlike()
    table(path, ["Zeit [s]", *(f"{n} [{unit}]" for n in names)], [T, omega, omega, omega, omega], ";")


def imu(path):
    table(path, ["Zeit [s]", "Laengsbeschl [g]"], [T, 1.5 * np.cos(0.5 * T) / 9.80665 + unlike()], ";")


def drives(folder):
    logs = scan(folder).logs
    kinds, count = kinds_of(logs)
    is_wheels = ["Raddrehzahl" in str(logs[kinds.index(k)].channels) for k in range(count)]
    found, notes = group_drives(logs, kinds, lambda a, b: is_wheels[a] and is_wheels[b])
    return [[f.name for f in d.files] for d in found], notes, [drive_name(d) for d in found]


@pytest.mark.parametrize(
    "pattern", ["d{0}/{1}.csv", "d{0}_{1}.csv", "{1}_d{0}.csv", "{1}/{1}_d{0}.csv", "x/d{0}/log_{1}.csv"]
)
def test_files_of_one_drive_go_together(tmp_path, pattern):
    for i in range(3):
        wheels(tmp_path / pattern.format(i, "rad"))
        imu(tmp_path / pattern.format(i, "imu"))
    found, notes, names = drives(tmp_path)
    assert sorted(sorted(f) for f in found) == [sorted(pattern.format(i, k) for k in ("imu", "rad")) for i in range(3)]
    assert notes == ()
    assert all(f"d{i}" in n and "rad" not in n and "imu" not in n for i, n in enumerate(names)), names


def test_drives_of_one_kind_and_rivals_stay_apart(tmp_path):
    for i in range(3):
        wheels(tmp_path / f"d{i}.csv")
    wheels(tmp_path / "other" / "d1.csv", names=[f"{n}_neu" for n in WHEELS])
    assert len(drives(tmp_path)[0]) == 4


def test_a_drive_without_one_logger_is_still_with_its_own(tmp_path):
    for i in range(3):
        wheels(tmp_path / f"d{i}_rad.csv")
    imu(tmp_path / "d1_imu.csv")
    found, _, _ = drives(tmp_path)
    assert sorted(map(len, found)) == [1, 1, 2]


def test_strangers_among_others_are_no_drive_and_alone_they_are_told(tmp_path):
    wheels(tmp_path / "monday.csv")
    imu(tmp_path / "unrelated.csv")
    found, notes, _ = drives(tmp_path)
    assert sorted(map(len, found)) == [2]
    assert "treated as one drive because of their channels" in notes[0]
    for i in range(3):  # of a kind of their own, so that nothing in the two names tells them apart
        wheels(tmp_path / f"d{i}.csv", names=[f"{n}_neu" for n in WHEELS])
    found, notes, _ = drives(tmp_path)
    assert sorted(map(len, found)) == [1, 1, 1, 1, 1]
    assert notes == ()


def test_one_name_in_two_folders_cannot_be_one_drive(tmp_path):
    for i in range(2):
        wheels(tmp_path / "rad" / f"d{i}.csv")
        imu(tmp_path / "imu" / f"d{i}.csv")
    found, notes, _ = drives(tmp_path)
    assert len(found) == 4
    assert len(notes) == 2
    assert "have one name: rename them" in notes[0]


def run(*args):
    return CliRunner().invoke(campaign_app, ["init", *map(str, args)])


def rows_of(path):
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_own_names_and_units_become_a_campaign_that_loads_and_signals_that_are_right(tmp_path):
    logs = tmp_path / "Messung"
    for pressure, depth in itertools.product(("19", "22"), ("08", "13")):
        wheels(logs / f"ReifenA_p{pressure}_h{depth}_v080_01" / "raeder.csv")
        imu(logs / f"ReifenA_p{pressure}_h{depth}_v080_01" / "imu.csv")
    before = {p: p.read_bytes() for p in logs.rglob("*.csv")}
    out = tmp_path / "work" / "campaign.toml"
    result = run(logs, "-o", out)
    assert result.exit_code == 0, result.output
    assert sorted(p.name for p in out.parent.iterdir()) == ["campaign.toml", "map.toml", "runs.csv", "vehicle.toml"]
    assert {p: p.read_bytes() for p in logs.rglob("*.csv")} == before
    campaign = load_campaign(out)
    assert len(campaign.runs) == 4
    assert all(len(r.logs) == 2 and all(p.is_file() for p in r.logs) for r in campaign.runs)
    assert {r.values["water_depth_mm"] for r in campaign.runs} == {0.8, 1.3}
    assert {r.values["pressure_rear_bar"] for r in campaign.runs} == {1.9, 2.2}
    signals = load_signals(
        list(campaign.runs[0].logs), vehicle=load_vehicle(CAR), signal_map=load_signal_map(campaign.signals)
    )
    omega = signals.frame["omega_fl"].to_numpy()
    assert abs(np.nanmean(omega) - SPEED.mean() / 0.317) < 0.01
    assert abs(np.nanmax(np.abs(signals.frame["a_x"].to_numpy())) - 1.5) < 0.01
    assert load_vehicle(out.parent / "vehicle.toml").given == {"name"}
    for part in ("drives: 4, 4 of several files", "p and two digits: tenths of bar", "every line marked SET",
                 "aqualog inspect", "no torque of wheels"):  # fmt: skip
        assert part in result.output, result.output


def test_canonical_names_need_no_map_and_a_vehicle_file_none_to_fill(tmp_path):
    for i in (1, 2):
        (tmp_path / "logs").mkdir(exist_ok=True)
        (tmp_path / "logs" / f"drive_{i}.mf4").write_bytes(SAMPLE.read_bytes() + b"\0" * 8 * i)
    out = tmp_path / "campaign.toml"
    result = run(tmp_path / "logs", "-o", out, "--vehicle", CAR, "--json")
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    assert document["signals"] == {}
    assert "omega_fl" in document["canonical"]
    assert [d["values"] for d in document["drives"]] == [{"x_run": "1"}, {"x_run": "2"}]
    assert not (tmp_path / "map.toml").exists()
    assert not (tmp_path / "vehicle.toml").exists()
    campaign = load_campaign(out)
    assert campaign.runs[0].vehicle.resolve() == CAR
    assert rows_of(tmp_path / "runs.csv")[0]["tyre"] == ""


def test_other_channel_names_in_some_logs_stand_behind_the_usual_ones(tmp_path):
    for i in range(3):
        wheels(tmp_path / f"d{i}.csv")
    wheels(
        tmp_path / "d9.csv",
        names=[f"Wheel_Speed_{w}" for w in ("FL", "FR", "RL", "RR")],
        unit="km/h",
        factor=0.317 * 3.6,
    )
    out = tmp_path / "c.toml"
    result = run(tmp_path, "-o", out)
    entry = load_signal_map(tmp_path / "map.toml").entries["omega_fl"]
    assert entry.channel == ("Raddrehzahl_VL", "Wheel_Speed_FL")
    assert entry.unit is None  # each log's own
    assert "the drives have 2 different sets of channels; 3 as d0.csv, 1 as d9.csv" in result.output
    for log in ("d0.csv", "d9.csv"):
        signals = load_signals(
            [tmp_path / log], vehicle=load_vehicle(CAR), signal_map=load_signal_map(tmp_path / "map.toml")
        )
        # the rim speed of 20 m/s is turned with the vehicle's own radius
        assert 55.0 < np.nanmean(signals.frame["omega_fl"].to_numpy()) < 70.0


def test_a_signal_that_few_drives_hold_is_left_out_of_the_map(tmp_path):
    for i in range(3):
        wheels(tmp_path / f"d{i}_rad.csv")
    imu(tmp_path / "d1_imu.csv")
    assert run(tmp_path, "-o", tmp_path / "c.toml").exit_code == 0
    assert set(load_signal_map(tmp_path / "map.toml").entries) == {f"omega_{w}" for w in ("fl", "fr", "rl", "rr")}
    assert "not in all drives, so left out: a_x = Laengsbeschl" in (tmp_path / "map.toml").read_text()


def test_bad_files_are_told_and_left_out(tmp_path):
    logs = tmp_path / "logs"
    shutil.copytree(
        ROOT / "sample_logs", logs, ignore=lambda *_: {"report.png", "lane_drive.mcap", "lane_drive.parquet", *LOADED}
    )
    (logs / "empty.mf4").write_bytes(b"")
    (logs / "junk.mf4").write_bytes(b"\x01\x02" * 99)
    (logs / "cut.mf4").write_bytes(SAMPLE.read_bytes()[:5000])
    (logs / "a;b.mf4").write_bytes(SAMPLE.read_bytes())
    (logs / "notes.csv").write_text("hello\n")
    (logs / "lane_drive.labels.csv").write_text("start_s,end_s,effect,wheel\n1,2,water,\n")
    (logs / ".hidden").mkdir()
    shutil.copy(SAMPLE, logs / ".hidden" / "x.mf4")
    (logs / "loop").symlink_to(logs)
    out = tmp_path / "campaign.toml"
    result = run(logs, "-o", out)
    assert result.exit_code == 3, result.output
    for name in ("a;b.mf4", "notes.csv"):
        assert f"left out: {name}: " in result.output, result.output
    broken = ("cut.mf4", "empty.mf4", "junk.mf4")
    for name in broken:
        assert f"cannot be read, but is in runs.csv (failed in a batch): {name}: " in result.output, result.output
    assert "lane_drive.csv is left out: it looks like a copy of lane_drive.mf4" in result.output
    *failed, only = load_campaign(out).runs
    assert tuple(r.logs[0].name for r in failed) == broken
    assert only.logs[0].name == "lane_drive.mf4"
    assert only.labels is not None


def test_nothing_is_overwritten_without_force_and_no_log_even_with_it(tmp_path):
    wheels(tmp_path / "logs" / "d1.csv")
    out = tmp_path / "campaign.toml"
    (tmp_path / "runs.csv").write_text("log\nmine.mf4\n")
    result = run(tmp_path / "logs", "-o", out)
    assert result.exit_code == 2
    assert "runs.csv: exists already" in result.output
    assert not out.exists()
    assert (tmp_path / "runs.csv").read_text() == "log\nmine.mf4\n"
    assert run(tmp_path / "logs", "-o", out, "--force").exit_code == 0
    assert len(load_campaign(out).runs) == 1
    wheels(tmp_path / "logs" / "runs.csv")
    before = (tmp_path / "logs" / "runs.csv").read_bytes()
    result = run(tmp_path / "logs", "-o", tmp_path / "logs" / "campaign.toml", "--force")
    assert result.exit_code == 2
    assert "is no table of runs" in result.output
    assert (tmp_path / "logs" / "runs.csv").read_bytes() == before


def test_a_second_start_in_the_same_folder_takes_its_own_files_for_no_logs(tmp_path):
    wheels(tmp_path / "d1.csv")
    for _ in range(2):
        result = run(tmp_path, "-o", tmp_path / "campaign.toml", "--force")
        assert result.exit_code == 0, result.output
        assert len(load_campaign(tmp_path / "campaign.toml").runs) == 1


@pytest.mark.parametrize(
    ("args", "part"),
    [
        (("gone",), "is no folder"),
        ((".", "-o", "c.csv"), "-o is no .toml"),
        ((".", "--vehicle", "gone.toml"), "vehicle file not found"),
        ((".",), "no log that can be read"),
    ],
)
def test_what_cannot_be_done_is_told(tmp_path, monkeypatch, args, part):
    monkeypatch.chdir(tmp_path)
    result = run(*args)
    assert result.exit_code == 2
    assert part in result.output
    assert list(tmp_path.iterdir()) == []


def test_results_of_a_batch_are_no_logs(tmp_path):
    wheels(tmp_path / "d1.csv")
    (tmp_path / "campaign.store" / "samples").mkdir(parents=True)
    (tmp_path / "campaign.store" / MARK).write_text("{}")
    wheels(tmp_path / "campaign.store" / "samples" / "x.csv")
    (tmp_path / "runs.csv").write_text("log,tyre,x_a\nd1.csv,a,1\n")
    assert [log.name for log in scan(tmp_path).logs] == ["d1.csv"]
    assert scan(tmp_path).bad == ()
    table(tmp_path / "d2.csv", ["t [s]", "log", "omega_fl [rad/s]"], [T, T, T])  # a channel may be called so too
    assert [log.name for log in scan(tmp_path).logs] == ["d1.csv", "d2.csv"]


def test_real_logs(real_logs, tmp_path):
    out = tmp_path / "campaign.toml"
    result = run(real_logs / "bmw_i3", "-o", out)
    assert result.exit_code == 0, result.output
    assert "no channel looks like omega_fl, omega_fr, omega_rl, omega_rr" in result.output
    assert len(load_campaign(out).runs) == len(list((real_logs / "bmw_i3").glob("*.csv")))
    folder = real_logs / "canedge"
    result = run(folder, "-o", out, "--force")
    assert result.exit_code == 2
    assert "raw CAN frames with 11 ids on buses 1, 2; give --dbc FILE to decode them" in result.output
    result = run(folder, "-o", out, "--force", "--dbc", folder / "canmod-gps.dbc")
    assert load_signal_map(tmp_path / "map.toml").entries["v_x"].channel == ("gnss_speed.Speed",)
    assert f"report {out} --dbc" in result.output
    assert "0 ids (0 frames) are in canmod-gps.dbc" in result.output  # the third log is of another bus


def test_the_step_told_next_works_for_raw_can_frames(tmp_path):
    dbc = tmp_path / "car.dbc"
    speeds = "".join(f' SG_ WHEEL_{w} : {16 * k}|16@1+ (0.01,0) [0|0] "km/h" ECU\n' for k, w in enumerate(WHEELS_OF))
    dbc.write_text(f'VERSION ""\n\nBU_: ECU\n\nBO_ 100 Wheels: 8 ECU\n{speeds}')
    (tmp_path / "logs").mkdir()
    found = CanMessage("Wheels", T, {f"WHEEL_{w}": 3.6 * SPEED + 0.01 * k for k, w in enumerate(WHEELS_OF)})
    write_can_mf4(tmp_path / "logs" / "drive.mf4", dbc, [found], 1_700_000_000 * 10**9, "")
    result = run(tmp_path / "logs", "-o", tmp_path / "campaign.toml", "--dbc", dbc)
    assert result.exit_code == 0, result.output
    step = next(line for line in result.output.splitlines() if "aqualog report" in line)
    words = step.split("aqualog ")[1].replace("-o report", f"-o {tmp_path / 'report'}").split()
    done = CliRunner().invoke(app, [*words, "--jobs", "1"])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "report" / "index.html").is_file()
    figure = ["figures", "2.1", "-o", str(tmp_path / "f"), "--campaign", words[1], "--dbc", str(dbc), "--jobs", "1"]
    assert CliRunner().invoke(app, figure).exit_code == 0
    lone = CliRunner().invoke(app, ["figures", "2.1", "-o", str(tmp_path / "g"), "--dbc", str(dbc)])
    assert lone.exit_code == 2
    assert "--dbc without --campaign" in lone.output


def test_folders_with_odd_names_and_links(tmp_path):
    odd = tmp_path / "a;b"
    wheels(odd / "d1, no *2 [x].csv")
    result = run(odd, "-o", tmp_path / "campaign.toml")
    assert result.exit_code == 2
    assert "-o in that folder" in result.output
    assert run(odd, "-o", odd / "campaign.toml").exit_code == 0
    assert load_campaign(odd / "campaign.toml").runs[0].logs[0].is_file()
    (tmp_path / "deep" / "er").mkdir(parents=True)
    (tmp_path / "link").symlink_to(tmp_path / "deep" / "er")
    wheels(tmp_path / "logs" / "d1.csv")
    assert run(tmp_path / "logs", "-o", tmp_path / "link" / "campaign.toml", "--vehicle", CAR).exit_code == 0
    (only,) = load_campaign(tmp_path / "link" / "campaign.toml").runs
    assert only.logs[0].is_file()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
def test_a_pipe_that_is_called_like_a_table_does_not_stop_it(tmp_path):
    os.mkfifo(tmp_path / "runs.csv")
    assert not is_run_table(tmp_path / "runs.csv")
    (tmp_path / "campaign.toml").write_text('vehicle = "c.toml"\n[[run]]\nlog = "runs.csv"\n')
    (tmp_path / "c.toml").write_text('name = "c"\n')
    with pytest.raises(ConfigError, match="device or a pipe"):
        load_campaign(tmp_path / "campaign.toml")


def german(path, wet):
    """A drive of a German logger with a lane, a brake that rests and channels that are no signal."""
    names = [f"{n} [U/min]" for n in WHEELS]
    omega = [SPEED / 0.317 * 60.0 / (2.0 * np.pi) + unlike()] * 4
    more = {"Nassbahn": wet, "Bremsdruck [bar]": 0.0 * T, "Spurstange_VL [kN]": np.sin(T), "Spurstange_VR [kN]": np.cos(T),
            "Oeltemperatur [degC]": 80.0 + T, "Zaehler": T}  # fmt: skip
    table(path, ["Zeit [s]", *names, *more], [T, *omega, *more.values()], ";")


def test_a_lane_a_brake_and_tie_rods_are_found_and_what_is_left_is_told(tmp_path):
    lane = ((T > 5.0) & (T < 8.0)).astype(float)
    german(tmp_path / "nass_1.csv", lane)
    german(tmp_path / "trocken_12.csv", 0.0 * T)
    result = run(tmp_path, "-o", tmp_path / "c.toml", "--vehicle", CAR)
    assert result.exit_code == 0, result.output
    text = (tmp_path / "map.toml").read_text()
    entries = load_signal_map(tmp_path / "map.toml").entries
    for symbol, channel, unit in (
        ("on_water", "Nassbahn", "bool"),
        ("brake_pressure", "Bremsdruck", "bar"),
        ("tie_rod_fl", "Spurstange_VL", "kN"),
        ("tie_rod_fr", "Spurstange_VR", "kN"),
    ):
        assert (entries[symbol].channel, entries[symbol].unit) == ((channel,), unit)
    assert text.endswith("# not mapped, 2 channels:\n#   Oeltemperatur [degC]\n#   Zaehler\n")
    assert "channels that are not mapped: 2, named at the end of map.toml" in result.output
    assert "no signal on_water" not in result.output
    signals = load_signals(
        [tmp_path / "nass_1.csv"], vehicle=load_vehicle(CAR), signal_map=load_signal_map(tmp_path / "map.toml")
    )
    assert abs(signals.frame["on_water"].cast(float).mean() - lane.mean()) < 0.01
    assert abs(signals.frame["tie_rod_fr"].to_numpy()).max() > 990.0


def test_a_channel_called_wet_that_is_not_0_or_1_is_no_lane(tmp_path):
    german(tmp_path / "d1.csv", 0.5 * T)
    result = run(tmp_path, "-o", tmp_path / "c.toml")
    assert "on_water" not in load_signal_map(tmp_path / "map.toml").entries
    assert "or map the channel that says it: on_water = ..." in result.output


def test_channels_without_a_signal_are_counted_and_named(tmp_path):
    heading = ["Zeit [s]", *(f"{n} [U/min]" for n in WHEELS), *(f"K{i}" for i in range(70))]
    table(tmp_path / "d1.csv", heading, [T, *[60.0 * SPEED] * 4, *[T] * 70], ";")
    assert run(tmp_path, "-o", tmp_path / "c.toml").exit_code == 0
    lines = (tmp_path / "map.toml").read_text().splitlines()
    assert "# not mapped, 70 channels:" in lines
    assert lines[-70:] == [f"#   K{i}" for i in range(70)]


def test_a_copy_byte_for_byte_is_left_out_whatever_it_is_called(tmp_path):
    wheels(tmp_path / "d1.csv")
    wheels(tmp_path / "d2.csv")
    shutil.copy(tmp_path / "d1.csv", tmp_path / "d1 - Kopie.csv")
    result = run(tmp_path, "-o", tmp_path / "c.toml")
    assert result.exit_code == 0, result.output
    assert "d1 - Kopie.csv is left out: byte for byte d1.csv" in result.output
    assert [r.logs[0].name for r in load_campaign(tmp_path / "c.toml").runs] == ["d1.csv", "d2.csv"]


def test_blanks_are_counted_and_a_broken_log_keeps_its_row(tmp_path):
    wheels(tmp_path / "ReifenA_1.3mm_1.csv")
    wheels(tmp_path / "ReifenA_2.csv")
    (tmp_path / "ReifenA_1.3mm_3.csv").write_text("Zeit [s];Raddrehzahl_VL [U/min]\n")
    result = run(tmp_path, "-o", tmp_path / "c.toml")
    assert result.exit_code == 3, result.output
    assert "\n  water_depth_mm: 1 of 3 blank\n  manoeuvre: 3 of 3 blank\n" in result.output, result.output
    assert "tyre: " not in result.output.partition("to fill in:")[2].partition("signals")[0]
    rows = rows_of(tmp_path / "runs.csv")
    assert [r["log"] for r in rows] == ["ReifenA_1.3mm_1.csv", "ReifenA_1.3mm_3.csv", "ReifenA_2.csv"]
    assert rows[1]["water_depth_mm"] == "1.3"


def test_a_position_without_a_unit_is_in_degrees_and_a_speed_without_one_is_named(tmp_path):
    heading = ["Zeit [s]", *(f"{n} [U/min]" for n in WHEELS), "GPS Latitude", "GPS Speed"]
    table(tmp_path / "d1.csv", heading, [T, *[60.0 * SPEED] * 4, 48.0 + 1e-3 * T, SPEED], ";")
    result = run(tmp_path, "-o", tmp_path / "c.toml")
    assert "latitude = GPS Latitude [deg]  (name; the file gives no unit: deg by its kind, check it)" in result.output
    assert "GPS Speed may be it, but the file gives no unit: map it with its unit" in result.output
