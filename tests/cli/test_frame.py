"""What all commands share: tables as CSV."""

import errno

import polars as pl
import pytest

import aqualog as aq
from tests.commands import one_error_line, run
from tests.conftest import ROOT

SAMPLES = ROOT / "sample_logs"
LOG, CAR = SAMPLES / "lane_drive.mf4", SAMPLES / "vehicle.toml"


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """A small log."""
    path = tmp_path_factory.mktemp("log") / "a.csv"
    rows = [f"{i / 100},{20 + i / 100},{60 + i / 100}" for i in range(300)]
    path.write_text("t [s],v_x [m/s],omega_fl [rad/s]\n" + "\n".join(rows) + "\n")
    return path


def test_the_printed_tables(tmp_path):
    done = run("detect", LOG, "--vehicle", CAR, "--csv", "e.csv", "--decimal-comma", cwd=tmp_path)
    assert "note: tables: e.csv, e_events.csv, e_slip_slope.csv, e_not_judged.csv\n" in done.stderr
    episodes, events, slopes = (
        pl.read_csv(tmp_path / f"{n}.csv", separator=";", decimal_comma=True) for n in ("e", "e_events", "e_slip_slope")
    )
    assert episodes["kind"].to_list() == ["aquaplaning"]
    assert done.stdout.count("\n") > events.height > 5
    rows = done.stdout.split("\ndetector ")[1].split("\n\n")[0].splitlines()[1:]
    assert len(rows) == events.height  # one line each: the first phrases of the evidence
    assert events["start_s"].is_sorted()
    assert events["v_x_kmh"].is_between(95, 105).all()
    assert events["evidence"].str.contains("slip").any()
    assert slopes["seconds_estimating"].dtype == pl.Float64


def test_one_line_says_why_no_table_is_written(table, tmp_path):
    folder = table.parent
    run("inspect", table, "--csv", "c", cwd=tmp_path)
    before = (tmp_path / "c.csv").read_bytes()
    refused = {
        ("--csv", "c.csv"): "c.csv: exists already",
        ("--csv", "c.txt"): '".txt" is no CSV',
        ("--csv", table, "--force"): "is a source",
        ("--csv", folder / "b.csv", "--signals", folder / "b.csv", "--force"): "is a source",
        ("--decimal-comma",): "--decimal-comma without --csv",
    }
    for options, expected in refused.items():
        done = run("inspect", table, *options, cwd=tmp_path)
        assert (done.exit_code, done.stdout) == (2, "")
        assert expected in one_error_line(done)
    assert (tmp_path / "c.csv").read_bytes() == before
    assert run("inspect", table, "--csv", "c.csv", "--force", "--json", cwd=tmp_path).exit_code == 0


def test_a_table_beside_is_not_overwritten(table, tmp_path):
    (tmp_path / "c_proposed.csv").write_text("mine")
    done = run("inspect", table, "--csv", "c.csv", cwd=tmp_path)
    assert done.exit_code == 2
    assert not (tmp_path / "c.csv").exists()
    assert "c_proposed.csv: exists already" in one_error_line(done)


def test_files_that_were_asked_for_are_written_together_or_none(table, tmp_path, monkeypatch):
    def full(path):
        path.write_text("a part")
        if not path.name.startswith(".runs-"):
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("aqualog.face.result.methodcaller", lambda *_: full)
    for command, option in (("inspect", "--write-map"), ("doctor", "-o"), ("init", "-o")):
        done = run(command, table, option, "new/a", "--csv", "c.csv", cwd=tmp_path)
        assert done.exit_code == 1
        assert one_error_line(done).startswith("error: c.csv: cannot be written (No space left on device)")
    monkeypatch.setattr("aqualog.face.propose.text_file", lambda _: full)
    assert "vehicle.toml: cannot" in one_error_line(run("campaign", "init", table.parent, "-o", "c.toml", cwd=tmp_path))
    assert not list(tmp_path.iterdir())


def test_layouts_stand_beside_the_written_log(tmp_path):
    given = ("detect", LOG, "--vehicle", CAR, "-q", "--layouts")
    assert run(*given, "--write", "a.mcap", cwd=tmp_path).exit_code == 0
    assert {p.name for p in tmp_path.iterdir()} == {"a.mcap", "a.plotjuggler.xml", "a.foxglove.json"}
    (tmp_path / "a.mcap").unlink()
    assert "a.plotjuggler.xml: exists already" in one_error_line(run(*given, "--write", "a.mcap", cwd=tmp_path))
    assert "--layouts without --write" in one_error_line(run(*given, cwd=tmp_path))
    assert "opens .mf4" in one_error_line(run(*given, "--write", "a.mf4", cwd=tmp_path))
    with pytest.raises(aq.AqualogError, match="exists already"):
        aq.detect(str(LOG), str(CAR)).write(tmp_path / "a.mcap", layouts=True)
    assert not (tmp_path / "a.mcap").exists()
