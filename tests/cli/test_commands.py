"""What the commands print, write and refuse."""

import json
import os
import tomllib

import numpy as np
import polars as pl
import pytest

from tests.commands import one_error_line, run
from tests.conftest import ROOT

SAMPLES = ROOT / "sample_logs"
CAR = str(SAMPLES / "vehicle.toml")
MF4 = str(SAMPLES / "lane_drive.mf4")


def test_table_of_events():
    result = run("detect", MF4, "--vehicle", CAR)
    assert result.exit_code == 0, result.stderr
    assert "Minor spin-down" in result.stdout
    assert "not judged" in result.stdout


def test_json_of_the_contract():
    result = run("detect", MF4, "--vehicle", CAR, "--json")
    assert result.exit_code == 0
    document = json.loads(result.stdout, parse_constant=lambda c: pytest.fail(f"{c} is no JSON"))
    assert document["schema_version"] == 1
    assert document["sample_rate_hz"] == 100.0
    assert document["duration_s"] == pytest.approx(24.0)
    assert document["signals"]["omega_fl"]["unit"] == "rad/s"
    assert document["signals"]["omega_fl"]["missing_fraction"] == 0.0
    event = next(e for e in document["events"] if e["detector"] == "minor_spin_down")
    assert set(event) >= {"detector", "wheel", "side", "start_s", "end_s", "severity", "peak", "threshold", "evidence"}
    assert (event["wheel"], event["side"], event["severity"]) == ("fr", "right", "partial")
    assert event["evidence"]["slip_min"] < 0
    assert {u["detector"] for u in document["unavailable"]} == {"tie_rod"}
    assert set(document["quality"]) >= {"dropped_samples", "time_jumps", "truncated"}


@pytest.mark.parametrize("write", ["out.parquet", "no/such/folder/x.parquet"])
def test_a_second_result_that_cannot_be_written_leaves_no_first(tmp_path, write):
    (tmp_path / "no").write_text("a file")
    result = run("detect", MF4, "--vehicle", CAR, "-o", tmp_path / "out.parquet", "--write", tmp_path / write)
    assert result.exit_code in (1, 2)
    assert not (tmp_path / "out.parquet").exists()


def test_results_folder_and_refusal_to_overwrite(tmp_path):
    out = tmp_path / "out"
    assert run("detect", MF4, "--vehicle", CAR, "-o", out).exit_code == 0
    assert sorted(p.name for p in out.iterdir()) == ["events.json", "report.html", "signals.parquet"]
    assert json.loads((out / "events.json").read_text())["events"]
    frame = pl.read_parquet(out / "signals.parquet")
    assert {"t", "omega_fl", "minor_spin_down_fr", "minor_spin_down_fr_bit"} <= set(frame.columns)
    again = run("detect", MF4, "--vehicle", CAR, "-o", out)
    assert again.exit_code == 2
    assert "--force" in one_error_line(again)
    assert run("detect", MF4, "--vehicle", CAR, "-o", out, "--force").exit_code == 0


@pytest.mark.parametrize("suffix", [".mf4", ".mcap", ".csv", ".parquet"])
def test_written_log_gives_the_same_events_again(tmp_path, suffix):
    path = tmp_path / f"again{suffix}"
    first = run("detect", MF4, "--vehicle", CAR, "--write", path, "--json")
    assert first.exit_code == 0, first.stderr
    assert f"note: written: {path}\n" in first.stderr
    second = run("detect", path, "--vehicle", CAR, "--json")
    assert second.exit_code == 0, second.stderr
    a, b = (json.loads(r.stdout)["events"] for r in (first, second))
    assert [(e["detector"], e["wheel"]) for e in a] == [(e["detector"], e["wheel"]) for e in b]
    assert [e["start_s"] for e in a] == pytest.approx([e["start_s"] for e in b], abs=0.0101)


def test_bits_and_statistics_are_channels_that_asammdf_opens(tmp_path):
    import asammdf

    path = tmp_path / "again.mf4"
    run("detect", MF4, "--vehicle", CAR, "--write", path)
    with asammdf.MDF(path) as mdf:
        bit = mdf.get("minor_spin_down_fr_bit")
        statistic = mdf.get("minor_spin_down_fr")
    assert set(np.unique(bit.samples)) == {0.0, 1.0}
    assert np.nanmax(statistic.samples) > 1.0


@pytest.mark.parametrize("suffix", [".mf4", ".mcap", ".csv", ".parquet"])
def test_convert(tmp_path, suffix):
    path = tmp_path / f"c{suffix}"
    source = SAMPLES / "lane_drive.csv"
    made = run("convert", source, "--signals", SAMPLES / "map_csv.toml", "--vehicle", CAR, "-o", path)
    assert made.exit_code == 0, made.stderr
    seen = json.loads(run("inspect", path, "--json").stdout)
    assert {"omega_fl", "torque_rr", "steer_angle"} <= {c["name"] for c in seen["channels"]}
    assert seen["proposed"]["omega_fl"]["reason"] == "its canonical name"
    wheel = next(c for c in seen["channels"] if c["name"] == "omega_fl")
    assert wheel["unit"] == "rad/s"
    assert wheel["high"] == pytest.approx(89.4, abs=1.0)  # 102 km/h at 0.317 m


def test_convert_tells_of_the_radius_that_nobody_gave(tmp_path):
    rows = "\n".join(f"{0.01 * k:.2f},{80.0 + 0.01 * k:.2f},{250.0 + 0.01 * k:.2f}" for k in range(300))
    (tmp_path / "d.csv").write_text(f"t [s],omega_fl [km/h],omega_fr [rad/s]\n{rows}\n")
    told = run("convert", tmp_path / "d.csv", "-o", tmp_path / "a.csv")
    assert told.exit_code == 0, told.stderr
    assert "became rad/s with a default car's radius of 0.317 m" in told.stderr
    named = run("convert", tmp_path / "d.csv", "-o", tmp_path / "b.csv", "--vehicle", CAR)
    assert named.exit_code == 0, named.stderr
    assert "default car" not in named.stderr


def test_a_page_has_the_name_of_a_page(tmp_path):
    told = run("doctor", MF4, "-o", tmp_path / "page.txt")
    assert told.exit_code == 2
    assert '".txt" is no page; expected a name that ends in .html' in " ".join(told.stderr.split())
    assert run("doctor", MF4, "-o", tmp_path / "page").exit_code == 0
    assert [p.name for p in tmp_path.iterdir()] == ["page.html"]
    model = run("diagnose", MF4, "-o", tmp_path / "model.html")
    assert model.exit_code == 2
    assert "the model is a TOML file; the page is --page" in " ".join(model.stderr.split())


def test_convert_with_decimal_comma(tmp_path):
    path = tmp_path / "c.csv"
    assert run("convert", MF4, "-o", path, "--decimal-comma").exit_code == 0
    assert ";" in path.read_text(encoding="utf-8").splitlines()[0]
    assert run("detect", path, "--vehicle", CAR).exit_code == 0


def test_inspect_proposes_a_map_that_works(tmp_path):
    german = SAMPLES / "lane_drive.csv"
    made = run("inspect", german, "--write-map", tmp_path / "map.toml")
    assert made.exit_code == 0, made.stderr
    text = (tmp_path / "map.toml").read_text()
    for symbol in ("omega_fl", "omega_rr", "a_x", "yaw_rate", "steering_wheel_angle", "v_x", "torque_r"):
        assert symbol in text
    result = run("detect", german, "--vehicle", CAR, "--signals", tmp_path / "map.toml", "--json")
    assert {e["detector"] for e in json.loads(result.stdout)["events"]} >= {"joint_criteria", "minor_spin_down"}


def test_the_verdict_is_the_first_line_and_in_the_document():
    assert run("detect", MF4, "--vehicle", CAR).stdout.startswith("Aquaplaning: 8.0-16.1 s, 101 km/h, front right, ")
    document = json.loads(run("detect", MF4, "--vehicle", CAR, "--json").stdout)
    assert (document["verdict"], document["missing"]) == ("aquaplaning", [])
    (episode,) = document["episodes"]
    assert (episode["kind"], episode["wheels"], episode["axle"]) == ("aquaplaning", ["fr", "fl"], "f")
    assert (episode["start_s"], episode["end_s"]) == (pytest.approx(8.0, abs=0.3), pytest.approx(16.0, abs=0.3))
    assert sorted(episode["events"]) == [i for i, e in enumerate(document["events"]) if e["detector"] != "margin"]


def test_gate_on_an_event():
    """An episode of aquaplaning trips it; a drive that could not be judged does not pass, and is written whole."""
    assert run("detect", MF4, "--vehicle", CAR, "--fail-on-event").exit_code == 5
    assert run("detect", MF4, "--json").exit_code == 0
    told = run("detect", MF4, "--fail-on-event", "--json")
    assert told.exit_code == 4, told.stderr
    (line,) = [x for x in told.stderr.splitlines() if x.startswith("error: ")]
    assert "--fail-on-event" in line
    assert "no drivetrain in a vehicle file, no mass" in line
    assert "Try: " in line
    document = json.loads(told.stdout)
    assert document["verdict"] == "cannot_be_judged"
    assert document["missing"] == ["vehicle.drivetrain", "vehicle.mass"]
    assert {e["detector"] for e in document["events"]} == {"spin_down"}


def test_a_gate_on_an_event_passes_a_dry_drive(tmp_path):
    scenario = tmp_path / "dry.toml"
    scenario.write_text(f'vehicle = "{CAR}"\nduration_s = 20.0\nspeed_kmh = 90.0\nseed = 1\n')
    assert run("simulate", scenario, "-o", tmp_path / "dry.parquet").exit_code == 0
    passed = run("detect", tmp_path / "dry.parquet", "--vehicle", CAR, "--fail-on-event")
    assert passed.exit_code == 0, passed.stderr


def test_missing_signals_end_with_4_and_one_line(tmp_path):
    path = tmp_path / "gps.csv"
    t = np.arange(100) * 0.1
    pl.DataFrame({"t [s]": t, "latitude [deg]": 48 + t * 1e-4}).write_csv(path)
    result = run("detect", path)
    assert result.exit_code == 4
    assert "omega_fl" in one_error_line(result)
    (tmp_path / "map.toml").write_text('[signals]\nlatitude = "latitude"\n')
    told = one_error_line(run("detect", path, "--signals", tmp_path / "map.toml"))
    assert "Hz" not in told  # a rate of what is not there is no news
    assert told.endswith("`aqualog inspect LOG` lists what the log has; the signal map must name these")


def test_usage_and_configuration_errors(tmp_path):
    bad = tmp_path / "car.toml"
    bad.write_text("mas = 1\n")
    result = run("detect", MF4, "--vehicle", bad)
    assert result.exit_code == 2
    assert '"mass"' in one_error_line(result)
    assert run("detect", MF4, "--vehicle", tmp_path / "none.toml").exit_code == 2
    assert run("detect", MF4, "--no-such-option").exit_code == 2
    assert run("detect", "nothing*.mf4", cwd=tmp_path).exit_code == 2
    assert run("convert", MF4, "-o", tmp_path / "x.xls").exit_code == 2
    assert run("detect", MF4, "--progress", "loud").exit_code == 2


def test_unreadable_logs(tmp_path):
    assert run("detect", tmp_path / "none.mf4").exit_code == 1
    junk = tmp_path / "junk.mf4"
    junk.write_bytes(bytes(range(256)) * 10)
    result = run("detect", junk)
    assert result.exit_code == 1
    assert "unknown format" in one_error_line(result)
    (tmp_path / "empty.csv").write_bytes(b"")
    assert "empty" in one_error_line(run("detect", tmp_path / "empty.csv"))


def test_damaged_log_ends_with_3(tmp_path):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes((SAMPLES / "lane_drive.mcap").read_bytes()[:300_000])
    result = run("detect", cut, "--vehicle", CAR, "--signals", SAMPLES / "map_mcap.toml", "--json")
    assert result.exit_code == 3, result.stderr
    assert json.loads(result.stdout)["quality"]["truncated"] is True


def test_sources_are_never_touched(tmp_path):
    source = tmp_path / "drive.mf4"
    source.write_bytes((SAMPLES / "lane_drive.mf4").read_bytes())
    source.chmod(0o444)
    before = (source.read_bytes(), source.stat().st_mtime_ns)
    run("detect", source, "--vehicle", CAR, "-o", tmp_path / "out")
    run("inspect", source)
    assert (source.read_bytes(), source.stat().st_mtime_ns) == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["drive.mf4", "out"]


def test_two_files_with_the_same_signal_are_refused():
    result = run("detect", MF4, SAMPLES / "lane_drive.parquet", "--vehicle", CAR)
    assert result.exit_code == 4
    assert "several channels" in one_error_line(result)


def test_list_file_and_folder(tmp_path):
    (tmp_path / "list.txt").write_text(f"# one drive\n{MF4}\n")
    assert run("detect", f"@{tmp_path / 'list.txt'}", "--vehicle", CAR).exit_code == 0
    folder = tmp_path / "logs"
    folder.mkdir()
    (folder / "a.mf4").write_bytes((SAMPLES / "lane_drive.mf4").read_bytes())
    (folder / "notes.txt").write_text("nothing")
    assert run("detect", folder, "--vehicle", CAR).exit_code == 0


def test_results_are_whole_or_not_at_all(tmp_path):
    target = tmp_path / "no" / "such"
    target.parent.mkdir()
    target.parent.chmod(0o500)
    result = run("convert", MF4, "-o", target / "x.parquet")
    target.parent.chmod(0o700)
    if os.geteuid() == 0:
        pytest.skip("root may write anywhere")
    assert result.exit_code == 1
    assert not list(target.parent.iterdir())


def test_hostile_names_do_not_reach_the_terminal_raw(tmp_path):
    path = tmp_path / "x.csv"
    t = np.arange(100) * 0.01
    pl.DataFrame({"t [s]": t, "\x1b[31mred": t, "[bold]x": t}).write_csv(path)
    result = run("inspect", path)
    assert "\x1b" not in result.stdout
    assert "[bold]x" in result.stdout


def test_align_command(tmp_path):
    rng = np.random.default_rng(0)
    t = np.arange(0, 200, 0.02)
    v = 20 + 5 * np.sin(0.3 * t) + 3 * np.sin(0.11 * t + 1) + 2 * np.sin(0.71 * t)
    pl.DataFrame({"t [s]": t, "speed [m/s]": v + 0.02 * rng.normal(size=t.size)}).write_csv(tmp_path / "a.csv")
    late = np.arange(0, 200, 0.1)
    at = np.interp(late - 0.25, t, v) * 1.01
    pl.DataFrame({"t [s]": late, "speed [m/s]": at + 0.05 * rng.normal(size=late.size)}).write_csv(tmp_path / "b.csv")
    result = run("align", tmp_path / "a.csv", tmp_path / "b.csv", "--json", "--write-map", tmp_path / "map.toml")
    assert result.exit_code == 0, result.stderr
    source = json.loads(result.stdout)["sources"][0]
    assert source["offset_s"] == pytest.approx(0.25, abs=0.02)
    assert source["offset_ci95"][0] < 0.25 < source["offset_ci95"][1]
    assert source["ratio"] == pytest.approx(1.01, abs=0.003)
    written = tomllib.loads((tmp_path / "map.toml").read_text())
    assert written["sources"]["b.csv"]["offset_s"] == pytest.approx(0.25, abs=0.02)


def test_align_refuses_what_does_not_match(tmp_path):
    rng = np.random.default_rng(1)
    t = np.arange(0, 100, 0.1)
    for name in "ab":
        walk = 20 + np.cumsum(rng.normal(0, 0.1, t.size))
        pl.DataFrame({"t [s]": t, "speed [m/s]": walk}).write_csv(tmp_path / f"{name}.csv")
    result = run("align", tmp_path / "a.csv", tmp_path / "b.csv")
    assert result.exit_code == 4
    assert "refused" in result.stdout


def test_time_column_of_the_map(tmp_path):
    t = np.arange(0, 5, 0.01)
    frame = pl.DataFrame({"clk": np.rint(t * 1e3), "w [rad/s]": 90 + t, "v_x [m/s]": 28 + t})
    frame.write_csv(tmp_path / "x.csv")
    (tmp_path / "m.toml").write_text('[time]\nchannel = "clk"\nunit = "ms"\n[signals]\nomega_fl = "w"\n')
    result = run("detect", tmp_path / "x.csv", "--signals", tmp_path / "m.toml", "--json")
    assert result.exit_code == 0, result.stderr
    assert json.loads(result.stdout)["duration_s"] == pytest.approx(5.0)
    (tmp_path / "m.toml").write_text('[time]\nchannel = "clock"\n[signals]\nomega_fl = "w"\n')
    frame.rename({"clk": "t"}).write_csv(tmp_path / "x.csv")
    wrong = run("detect", tmp_path / "x.csv", "--signals", tmp_path / "m.toml")
    assert wrong.exit_code == 2
    assert '[time] channel: no column is called "clock"' in wrong.stderr


@pytest.mark.parametrize("extra", [[], ["--force"]])
def test_a_source_is_never_the_target(tmp_path, extra):
    source = tmp_path / "drive.mf4"
    source.write_bytes((SAMPLES / "lane_drive.mf4").read_bytes())
    before = source.read_bytes()
    assert run("detect", source, "--vehicle", CAR, "--write", source, *extra).exit_code == 2
    assert run("convert", source, "-o", source, *extra).exit_code == 2
    assert source.read_bytes() == before


def test_list_that_names_itself(tmp_path):
    (tmp_path / "l.txt").write_text("@l.txt\n")
    result = run("detect", f"@{tmp_path / 'l.txt'}")
    assert result.exit_code == 2
    one_error_line(result)


def test_names_that_look_like_patterns(tmp_path):
    for name in ("a[b.parquet", "drive[1].parquet"):
        path = tmp_path / name
        path.write_bytes((SAMPLES / "lane_drive.parquet").read_bytes())
        assert run("detect", path, "--vehicle", CAR).exit_code == 0


def test_a_pipe_is_no_log(tmp_path):
    os.mkfifo(tmp_path / "p.mf4")
    result = run("detect", tmp_path / "p.mf4")
    assert result.exit_code == 1
    assert "no regular file" in one_error_line(result)


def test_wrong_time_scale_is_refused(tmp_path):
    t = np.arange(0, 500)
    pl.DataFrame(
        {"t [s]": t * 10.0, **{f"omega_{w} [rad/s]": 90.0 + 0 * t for w in ("fl", "fr", "rl", "rr")}}
    ).write_csv(tmp_path / "slow.csv")
    result = run("detect", tmp_path / "slow.csv")
    assert result.exit_code == 4
    assert "Hz" in one_error_line(result)
