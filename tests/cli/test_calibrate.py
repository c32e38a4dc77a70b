"""`aqualog calibrate` as a user runs it."""

import json

import pytest
import typer
from typer.testing import CliRunner

from aqualog.cli.calibrate import calibrate
from aqualog.config.vehicle import load_vehicle
from aqualog.core.vehicle import vehicle_toml
from tests.calibrate.dry_drives import believed, campaign

app = typer.Typer(rich_markup_mode=None, pretty_exceptions_enable=False)
app.command()(calibrate)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("drives")
    signals, true, _ = campaign(41, 2, seconds=260.0, rate=50.0)
    for name, s in zip("ab", signals, strict=True):
        s.frame.select(c for c in s.frame.columns if not c.startswith("true_")).write_parquet(path / f"{name}.parquet")
    (path / "car.toml").write_text(vehicle_toml(believed(true)), encoding="utf-8")
    return path


def run(*args):
    result = CliRunner().invoke(app, [str(a) for a in args])
    return result.exit_code, result.stdout, result.stderr


def test_table_file_and_page(folder, tmp_path):
    out, page = tmp_path / "calibrated.toml", tmp_path / "page.html"
    code, text, err = run(
        folder / "a.parquet", folder / "b.parquet", "--vehicle", folder / "car.toml", "-o", out, "--page", page
    )
    assert code == 0, err
    assert "2 drives" in text
    assert "not determined by these drives" in text
    assert "one ratio" in text
    car = load_vehicle(out)
    assert f"{car.mass:.5g}" in text
    html = page.read_text(encoding="utf-8")
    assert "residual over speed" in html
    assert 'http-equiv="Content-Security-Policy"' in html
    assert "one ratio" in html
    again = run(folder / "a.parquet", folder / "b.parquet", "--vehicle", folder / "car.toml", "-o", out)
    assert again[0] == 2
    assert "exists already" in again[2]


def test_json_with_what_is_given(folder):
    code, text, _ = run(
        folder / "a.parquet", folder / "b.parquet", "--vehicle", folder / "car.toml", "--fix", "mass=1500", "--json"
    )
    assert code == 0
    document = json.loads(text)
    found = {p["name"]: p for p in document["parameters"]}
    assert found["mass"]["ci95"] == [1500.0, 1500.0]
    assert found["torque_gain"]["identified"]
    assert document["fixed"] == {"mass": 1500.0}
    assert [d["name"] for d in document["drives"]] == ["a.parquet", "b.parquet"]
    assert document["drives"][0]["against_others"]["value"] is None


def test_a_folder_is_one_drive_and_a_file_counts_once(folder, tmp_path):
    (tmp_path / "one").mkdir()
    (tmp_path / "one" / "x.parquet").write_bytes((folder / "a.parquet").read_bytes())
    code, text, err = run(
        tmp_path / "one", folder / "b.parquet", folder / "b.parquet", "--vehicle", folder / "car.toml", "--json"
    )
    assert code == 0, err
    assert [d["name"] for d in json.loads(text)["drives"]] == ["one", "b.parquet"]


@pytest.mark.parametrize(
    ("fix", "said"),
    [("mass", "KEY=VALUE"), ("mass=heavy", "KEY=VALUE"), ("wheel=1", "not known"), ("mass=1", "between")],
)
def test_wrong_fix(folder, fix, said):
    code, _, err = run(folder / "a.parquet", "--vehicle", folder / "car.toml", "--fix", fix)
    assert code == 2
    assert said in err


def test_no_vehicle(folder):
    code, _, err = run(folder / "a.parquet")
    assert code == 2
    assert "no --vehicle" in err


def test_nothing_usable(folder, tmp_path):
    short = tmp_path / "short.csv"
    short.write_text("t [s],v_x [m/s],a_x [m/s^2]\n" + "".join(f"{i / 10},20,0\n" for i in range(50)))
    code, _, err = run(short, "--vehicle", folder / "car.toml")
    assert code == 4
    assert err.count("error:") == 1
    assert "torque_" in err


SHORT = "t [s],v_x [m/s],a_x [m/s^2]\n"


def bad_logs(folder):
    """One sample, not a log, and a log without torques."""
    (folder / "q_one.csv").write_text(SHORT + "0,20,0\n")
    (folder / "broken.mf4").write_bytes(b"MDF     4.10" + b"\0" * 90)
    (folder / "poor.csv").write_text(SHORT + "".join(f"{i / 10},20,0\n" for i in range(50)))
    return [folder / "q_one.csv", folder / "broken.mf4", folder / "poor.csv"]


def test_a_bad_log_is_told_and_the_others_are_used(folder, tmp_path):
    out = tmp_path / "calibrated.toml"
    first, second, third = bad_logs(tmp_path)
    code, text, err = run(
        first,
        folder / "a.parquet",
        second,
        third,
        folder / "b.parquet",
        "--vehicle",
        folder / "car.toml",
        "--json",
        "-o",
        out,
    )
    assert code == 3, err
    assert [d["name"] for d in json.loads(text)["drives"]] == ["a.parquet", "b.parquet"]
    lines = [line for line in err.splitlines() if line.startswith("error:")]
    assert len(lines) == 3
    for path in (first, second, third):
        assert sum(line.count(path.name) for line in lines) == 1
    assert lines[0].startswith("error: q_one.csv: ")
    assert load_vehicle(out).mass > 0.0


def test_bad_logs_alone(folder, tmp_path):
    code, text, err = run(*bad_logs(tmp_path), "--vehicle", folder / "car.toml", "-o", tmp_path / "x.toml")
    assert code == 4
    assert err.count("error:") == 3
    assert "q_one.csv" in err
    assert text == ""
    assert not (tmp_path / "x.toml").exists()


def test_fix_of_one_key_twice(folder):
    code, _, err = run(
        folder / "a.parquet", "--vehicle", folder / "car.toml", "--fix", "mass=1500", "--fix", "mass=1600"
    )
    assert code == 2
    assert "--fix mass is given twice" in err


def test_a_note_bears_the_name_of_its_file_once(folder, tmp_path):
    import polars as pl

    frame = pl.read_parquet(folder / "a.parquet")
    lines = frame.write_csv().splitlines()
    (tmp_path / "back.csv").write_text("\n".join([*lines[:3000], *lines[2990:]]) + "\n")
    code, text, err = run(folder / "b.parquet", tmp_path / "back.csv", "--vehicle", folder / "car.toml", "--json")
    assert code in (0, 3), err
    notes = [n for n in json.loads(text)["notes"] if "back.csv" in n]
    assert notes
    assert all(n.count("back.csv") == 1 for n in notes)
