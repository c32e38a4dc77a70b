"""The test matrix: what was driven, and what is missing."""

import json
import time
from pathlib import Path

import polars as pl
import pytest

from aqualog.campaign.definition import Campaign, Run, log_states, missing_lines
from aqualog.campaign.matrix import campaign_matrix
from tests.commands import run


def campaign(*rows, vehicle="car.toml"):
    runs = []
    for i, row in enumerate(rows):
        lane = row.pop("lane", None)
        values = {k: float(v) if isinstance(v, int | float) else v for k, v in row.items()}
        runs.append(Run((Path(f"{i}.mf4"),), Path(vehicle), None, lane, values))
    return Campaign("c", Path("campaign.toml"), None, tuple(runs))


def crossed(tyres, pressures, depths, without=(), times=1):
    return campaign(*(
        {"tyre": t, "pressure_front_bar": p, "pressure_rear_bar": p, "water_depth_mm": d, "lane": (1.0, 2.0)}
        for t in tyres for p in pressures for d in depths if (t, p, d) not in without for _ in range(times)
    ))  # fmt: skip


def test_keys_are_sorted_into_constants_factors_and_those_that_go_with_one():
    rows = [
        {"tyre": t, "wear": w, "tread_depth_mm": d, "water_depth_mm": h, "load_rear_kg": 0, "x_driver": x}
        for t, w, d in (("a", "new", 8), ("b", "worn", 2), ("c", "worn", 3))
        for h in (1.3, 0.8)
        for x in "pq"
    ]
    matrix = campaign_matrix(campaign(*rows))
    assert dict(matrix.constants) == {"vehicle": "car", "load_rear_kg": "0"}
    assert [f.key for f in matrix.factors] == ["tyre", "water_depth_mm"]
    assert matrix.factors[1].values == ("0.8", "1.3")
    assert matrix.factors[1].runs == (6, 6)
    assert dict(matrix.together) == {"wear": "tyre", "tread_depth_mm": "tyre"}
    assert dict(matrix.others) == {"x_driver": 2}
    assert len(matrix.configurations) == 6
    assert all(len(c.runs) == 2 for c in matrix.configurations)


def test_what_is_hidden_behind_another_key():
    rows = [
        {"tyre": t, "wear": w, "pressure_rear_bar": p}
        for t, w, p in (("a", "new", 2), ("b", "new", 2), ("c", "worn", 3))
    ]
    matrix = campaign_matrix(campaign(*rows, *[{"tyre": "d", "wear": "worn", "pressure_rear_bar": 3}]))
    assert dict(matrix.together) == {"wear": "tyre"}  # pressures too, but they were chosen
    assert [f.key for f in matrix.factors] == ["tyre", "pressure_rear_bar"]
    both = campaign(
        *({"tyre": t, "tread_depth_mm": d, "pressure_rear_bar": p} for t, d, p in (("a", 8, 2), ("b", 2, 3)))
    )
    assert dict(campaign_matrix(both).together) == {"tread_depth_mm": "tyre", "pressure_rear_bar": "tyre"}


def test_two_keys_that_are_not_crossed_but_independent_both_stay():
    matrix = campaign_matrix(crossed("ab", (1.9, 2.3), (0.8,)))
    assert [f.key for f in matrix.factors] == ["tyre", "pressure_rear_bar"]
    assert dict(matrix.together) == {"pressure_front_bar": "pressure_rear_bar"}


def test_a_hole_is_told_and_what_is_far_from_all_is_not():
    full = crossed("ab", (1.9, 2.3, 2.8), (0.8, 1.3, 2.0))
    assert campaign_matrix(full).gaps == ()
    hole = campaign_matrix(crossed("ab", (1.9, 2.3, 2.8), (0.8, 1.3, 2.0), without={("a", 2.3, 1.3)}))
    assert [(g.values, g.beside) for g in hole.gaps] == [(("a", "2.3", "1.3"), 5)]
    # tyre b on one depth and pressure alone: its next neighbours only, no corner of the cross
    sparse = {("b", p, d) for p in (1.9, 2.3, 2.8) for d in (0.8, 1.3, 2.0)} - {("b", 1.9, 0.8)}
    gaps = {g.values for g in campaign_matrix(crossed("ab", (1.9, 2.3, 2.8), (0.8, 1.3, 2.0), without=sparse)).gaps}
    assert gaps == {("b", "2.3", "0.8"), ("b", "1.9", "1.3")}
    # levels that were never neighbours: 0.8 and 2.0 are not next to each other
    line = campaign(*({"tyre": "a", "water_depth_mm": d} for d in (0.8, 1.3)), {"tyre": "b", "water_depth_mm": 2.0})
    assert {g.values for g in campaign_matrix(line).gaps} == {("b", "1.3"), ("a", "2")}


def test_values_that_are_not_told_are_no_neighbours():
    matrix = campaign_matrix(
        campaign(
            {"tyre": "a", "water_depth_mm": 1},
            {"tyre": "b"},
            {"water_depth_mm": 2, "tyre": "a"},
            {"tyre": "b", "water_depth_mm": 1},
        )
    )
    assert matrix.factors[1].values == ("1", "2", "")
    assert all("" not in g.values for g in matrix.gaps)


def test_speeds_and_manoeuvres():
    c = campaign(
        {"x_speed_kmh": "80", "manoeuvre": "constant"},
        {"x_speed_kmh": "60,5", "manoeuvre": "constant"},
        {"x_speed_kmh": "fast"},
    )
    (only,) = campaign_matrix(c).configurations
    assert only.speeds == (60.5, 80.0)
    assert dict(only.manoeuvres) == {"": 1, "constant": 2}
    (measured,) = campaign_matrix(c, lambda index, _: (10.0 * index,)).configurations
    assert measured.speeds == (0.0, 10.0, 20.0)


def test_notes_on_dry_runs_lanes_and_blanks():
    def notes(*rows):
        return " | ".join(campaign_matrix(campaign(*rows)).notes)

    wet = {"tyre": "a", "water_depth_mm": 1.3}
    assert "no dry run of a on car" in notes(dict(wet))
    assert "no dry run of b on car" in notes(dict(wet), {"tyre": "a", "water_depth_mm": 0}, {**wet, "tyre": "b"})
    assert notes({**wet, "lane": (1.0, 2.0)}, {"tyre": "a", "water_depth_mm": 0}) == ""
    assert "1 of 2 runs without lane times and labels" in notes(dict(wet), {"tyre": "a", "water_depth_mm": 0})
    assert "all runs without tyre" in notes({"water_depth_mm": 0})
    assert "1 of 2 runs without water_depth_mm" in notes({"tyre": "a", "water_depth_mm": 0}, {"tyre": "a"})


def test_logs_that_are_missing_are_told_with_their_line_and_a_similar_name(tmp_path):
    (tmp_path / "drive_12.mf4").write_bytes(b"1234")
    runs = tuple(Run((tmp_path / n,), Path("car.toml"), None, None, {}) for n in ("drive_12.mf4", "drive_21.mf4"))
    states = log_states(Campaign("c", tmp_path / "campaign.toml", None, runs), ("runs.csv: line 2", "runs.csv: line 3"))
    assert [s.size for s in states] == [4, None]
    (line,) = missing_lines(states)
    assert line.startswith("runs.csv: line 3: no such log ")
    assert line.endswith('drive_21.mf4 (did you mean "drive_12.mf4"?)')
    many = tuple(Run((tmp_path / f"{i}.mf4",), Path("car.toml"), None, None, {}) for i in range(15))
    assert (
        missing_lines(log_states(Campaign("c", tmp_path / "c.toml", None, many)))[-1] == "and 5 more logs are missing"
    )


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "car.toml").write_text('name = "car"\nmass = 1500.0\n')
    (tmp_path / "campaign.toml").write_text('name = "wet"\nvehicle = "car.toml"\nruns = "runs.csv"\n')
    rows = [f"{t}{d}{i}.mf4,{t},{d},80" for t, d, n in (("a", 0, 1), ("a", 1.3, 5), ("b", 0, 3)) for i in range(n)]
    (tmp_path / "runs.csv").write_text("\n".join(["log,tyre,water_depth_mm,x_speed_kmh", *rows]) + "\n")
    return tmp_path


def test_the_command_shows_the_matrix(folder):
    for name in ("a00", *(f"a1.3{i}" for i in range(5)), *(f"b0{i}" for i in range(3))):
        (folder / f"{name}.mf4").write_bytes(b"x" * 1000)
    out = run("inspect", folder / "campaign.toml")
    assert out.exit_code == 0, out.output
    for part in (
        "wet: 9 runs in 3 configurations", "all there, 0.0 MB", "car, rwd, 1500 kg", "same in all runs: vehicle = car",
        "! 1 of 3 configurations with fewer than 3 runs", "~ 1 of 3 configurations with fewer than 5 runs",
        "5 of 9 runs without lane times", "    b, 1.3\n", "car.toml does not give drivetrain, l_f, l_r, wheels.r_e_f",
    ):  # fmt: skip
        assert part in out.output, out.output
    document = json.loads(run("inspect", folder / "campaign.toml", "--json").stdout)
    assert [c["interval"] for c in document["configurations"]] == ["none", "usable", "wide"]
    assert document["gaps"] == [{"values": {"tyre": "b", "water_depth_mm": "1.3"}, "beside": 2}]
    assert document["logs"] == {"files": 9, "bytes": 9000, "missing": []}


def test_the_command_tells_missing_logs_by_its_code(folder):
    path = str(folder / "campaign.toml")
    assert run("inspect", path).exit_code == 4
    (folder / "a00.mf4").write_bytes(b"x")
    out = run("inspect", path)
    assert out.exit_code == 3
    assert "1 of 9 logs there" in out.output
    assert "runs.csv: line 3: no such log" in out.output
    assert run("inspect", path, "other.mf4").exit_code == 2
    assert run("inspect", path, "--write-map", "m.toml").exit_code == 2
    assert run("inspect", folder / "gone.toml").exit_code == 2


def test_thousands_of_runs_take_a_second_or_two(folder):
    rows = [f"{i}.mf4,t{i % 9},{i % 7},{60 + i % 70}" for i in range(5000)]
    (folder / "runs.csv").write_text("\n".join(["log,tyre,water_depth_mm,x_speed_kmh", *rows]) + "\n")
    began = time.process_time()
    out = run("inspect", folder / "campaign.toml", "--json")
    assert len(json.loads(out.stdout)["configurations"]) == 63
    assert time.process_time() - began < 5.0


def test_what_a_batch_has_measured_is_used(folder):
    def rows(state, reason, duration):
        return {"name": ["a00.mf4", "b00.mf4", "old.mf4"], "state": ["done", state, "done"], "reason": [None, reason, None],
                "v_min_kmh": [60.0, None, 1.0], "v_max_kmh": [82.5, None, 2.0], "duration_s": [duration, None, 1.0]}  # fmt: skip

    store = folder / "campaign.store"
    store.mkdir()
    pl.DataFrame(rows("failed", "b00.mf4: is cut", 20.0)).write_parquet(store / "runs.parquet")
    (folder / "runs.csv").write_text("log,tyre,lane_start_s,lane_end_s\na00.mf4,a,5,25\nb00.mf4,b,5,25\n")
    (folder / "a00.mf4").write_bytes(b"x")
    out = run("inspect", folder / "campaign.toml").output
    for part in (
        "measured by a batch: 1 of 2 runs", "60 82.5", "not measured: b00.mf4: is cut",
        "runs.csv: line 2: lane_end_s = 25 is after the log's end at 20.0 s",
    ):  # fmt: skip
        assert part in out, out
    assert "line 3: lane_end_s" not in out
    (store / "runs.parquet").write_bytes(b"junk")
    out = run("inspect", folder / "campaign.toml")
    assert out.exit_code == 2
    assert "is not a table of runs" in out.output
