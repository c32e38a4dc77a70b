"""`aqualog calibrate` as a user runs it."""

import json

import pytest

from aqualog.config.vehicle import load_vehicle
from tests import commands


def run(*args):
    return commands.run("calibrate", *args)


def test_table_file_and_page(dry_folder, tmp_path):
    out, page = tmp_path / "calibrated.toml", tmp_path / "page.html"
    code, text, err = run(
        dry_folder / "a.parquet", dry_folder / "b.parquet", "--vehicle", dry_folder / "car.toml", "-o", out, "--page",
        page,
    )  # fmt: skip
    assert code == 0, err
    assert "2 drives" in text
    assert "not determined by these drives" in text
    assert "one ratio" in text
    car = load_vehicle(out)
    assert f"mass {car.mass:.0f} " in " ".join(text.split())
    html = page.read_text(encoding="utf-8")
    assert "residual over speed" in html
    assert 'http-equiv="Content-Security-Policy"' in html
    assert "one ratio" in html
    again = run(dry_folder / "a.parquet", dry_folder / "b.parquet", "--vehicle", dry_folder / "car.toml", "-o", out)
    assert again[0] == 2
    assert "exists already" in again[2]


def test_json_with_what_is_given(dry_folder):
    code, text, _ = run(
        dry_folder / "a.parquet", dry_folder / "b.parquet", "--vehicle", dry_folder / "car.toml", "--fix",
        "mass=1500", "--json",
    )  # fmt: skip
    assert code == 0
    document = json.loads(text)
    found = {p["name"]: p for p in document["parameters"]}
    assert found["mass"]["ci95"] == [1500.0, 1500.0]
    assert found["torque_gain"]["identified"]
    assert document["fixed"] == {"mass": 1500.0}
    assert [d["name"] for d in document["drives"]] == ["a.parquet", "b.parquet"]
    assert document["drives"][0]["against_others"]["value"] is None


def test_a_folder_is_one_drive_and_a_file_counts_once(dry_folder, tmp_path):
    (tmp_path / "one").mkdir()
    (tmp_path / "one" / "x.parquet").write_bytes((dry_folder / "a.parquet").read_bytes())
    code, text, err = run(
        tmp_path / "one", dry_folder / "b.parquet", dry_folder / "b.parquet", "--vehicle", dry_folder / "car.toml",
        "--json",
    )  # fmt: skip
    assert code == 0, err
    assert [d["name"] for d in json.loads(text)["drives"]] == ["one", "b.parquet"]
    (tmp_path / "copy.parquet").write_bytes((dry_folder / "b.parquet").read_bytes())  # no second drive
    code, text, err = run(
        dry_folder / "b.parquet", tmp_path / "copy.parquet", "--vehicle", dry_folder / "car.toml", "--json"
    )
    assert [d["name"] for d in json.loads(text)["drives"]] == ["b.parquet"]
    assert "note: 1 of 2 logs given more than once: each counts once" in err


@pytest.mark.parametrize(
    ("fix", "said"),
    [("mass", "KEY=VALUE"), ("mass=heavy", "KEY=VALUE"), ("wheel=1", "not known"), ("mass=1", "between")],
)
def test_wrong_fix(dry_folder, fix, said):
    code, _, err = run(dry_folder / "a.parquet", "--vehicle", dry_folder / "car.toml", "--fix", fix)
    assert code == 2
    assert said in err


def test_no_vehicle(dry_folder):
    code, _, err = run(dry_folder / "a.parquet")
    assert code == 2
    assert "no --vehicle" in err


def test_nothing_usable(dry_folder, tmp_path):
    short = tmp_path / "short.csv"
    short.write_text("t [s],v_x [m/s],a_x [m/s^2]\n" + "".join(f"{i / 10},20,0\n" for i in range(50)))
    code, _, err = run(short, "--vehicle", dry_folder / "car.toml")
    assert code == 4
    assert err.count("error:") == 1
    assert "torque_" in err


SHORT = "t [s],v_x [m/s],a_x [m/s^2]\n"


def bad_logs(dry_folder):
    """One sample, not a log, and a log without torques."""
    (dry_folder / "q_one.csv").write_text(SHORT + "0,20,0\n")
    (dry_folder / "broken.mf4").write_bytes(b"MDF     4.10" + b"\0" * 90)
    (dry_folder / "poor.csv").write_text(SHORT + "".join(f"{i / 10},20,0\n" for i in range(50)))
    return [dry_folder / "q_one.csv", dry_folder / "broken.mf4", dry_folder / "poor.csv"]


def test_a_bad_log_is_told_and_the_others_are_used(dry_folder, tmp_path):
    out = tmp_path / "calibrated.toml"
    first, second, third = bad_logs(tmp_path)
    logs = (first, dry_folder / "a.parquet", second, third, dry_folder / "b.parquet")
    code, text, err = run(*logs, "--vehicle", dry_folder / "car.toml", "--json", "-o", out)
    assert code == 3, err
    assert [d["name"] for d in json.loads(text)["drives"]] == ["a.parquet", "b.parquet"]
    lines = [line for line in err.splitlines() if line.startswith("error:")]
    assert len(lines) == 3
    for path in (first, second, third):
        assert sum(line.count(path.name) for line in lines) == 1
    assert lines[0].startswith("error: q_one.csv: ")
    assert load_vehicle(out).mass > 0.0


def test_bad_logs_alone(dry_folder, tmp_path):
    code, text, err = run(*bad_logs(tmp_path), "--vehicle", dry_folder / "car.toml", "-o", tmp_path / "x.toml")
    assert code == 4
    assert err.count("error:") == 3
    assert "q_one.csv" in err
    assert text == ""
    assert not (tmp_path / "x.toml").exists()


def test_fix_of_one_key_twice(dry_folder):
    code, _, err = run(
        dry_folder / "a.parquet", "--vehicle", dry_folder / "car.toml", "--fix", "mass=1500", "--fix", "mass=1600"
    )
    assert code == 2
    assert "--fix mass is given twice" in err


def test_a_note_bears_the_name_of_its_file_once(dry_folder, tmp_path):
    import polars as pl

    frame = pl.read_parquet(dry_folder / "a.parquet")
    lines = frame.write_csv().splitlines()
    (tmp_path / "back.csv").write_text("\n".join([*lines[:3000], *lines[2990:]]) + "\n")
    code, text, err = run(
        dry_folder / "b.parquet", tmp_path / "back.csv", "--vehicle", dry_folder / "car.toml", "--json"
    )
    assert code in (0, 3), err
    notes = [n for n in json.loads(text)["notes"] if "back.csv" in n]
    assert notes
    assert all(n.count("back.csv") == 1 for n in notes)
