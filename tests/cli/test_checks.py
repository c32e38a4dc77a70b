"""Commands say what does not fit among the signals, and take off offsets where they are asked to."""

import json
from pathlib import Path

import numpy as np
import pytest

import aqualog as aq
from aqualog.align.load import load_drive
from aqualog.core.vehicle import vehicle_toml
from aqualog.detect.long import detect_long
from aqualog.diagnose import run
from tests import commands
from tests.checks.made import CAR, DT, made, signals
from tests.diagnose.stand_in import Engine

SAMPLES = Path(__file__).parents[2] / "sample_logs"
BRAKES = np.zeros(round(600.0 / DT))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """`drive.csv` with a turned a_y and an offset of a_x, and `car.toml`."""
    path = tmp_path_factory.mktemp("checks")
    frame = signals(
        {
            **made(seconds=600.0, v=28.0, turning=0.02, accelerating=0.6, stops=3, a_x_offset=-1.5),
            "brake_pressure": BRAKES,
        },
        turned=("a_y",),
    ).frame
    frame = frame.insert_column(0, (frame["v_x"].cum_count() - 1).cast(float).alias("t [s]") * DT)
    frame.write_csv(path / "drive.csv")
    (path / "car.toml").write_text(vehicle_toml(CAR), encoding="utf-8")
    return path


@pytest.fixture
def engine(monkeypatch):
    """The diagnosis itself takes minutes."""
    monkeypatch.setattr(run, "diagnose", Engine())


def document(folder, command, *more):
    code, text, err = commands.run(command, folder / "drive.csv", "--vehicle", folder / "car.toml", "--json", *more)
    assert code in (0, 3), err
    return json.loads(text), err


def found(checks):
    return {(c["kind"], *c["signals"]): c for c in checks}


@pytest.mark.parametrize("command", ["detect", "slip-slope", "calibrate", "diagnose"])
def test_every_command_says_it_alike(folder, command, engine):
    result, err = document(folder, command)
    own = found(result["checks"])
    assert own["sign", "a_y"]["lines"] == ['a_y = { channel = "a_y", scale = -1.0 }']
    assert own["offset", "a_x"]["value"] == pytest.approx(-1.5, abs=0.2)  # with the slope where it stands
    notes = result["quality"]["notes"] if "quality" in result else result["notes"]
    for check in own.values():
        assert sum(check["what"] in n for n in notes) == 1
        assert check["what"] in err
    if command in ("calibrate", "diagnose"):
        assert {c["drive"] for c in result["checks"]} == {"drive.csv"}


def test_doubts_stand_with_the_verdict(folder, engine, tmp_path):
    on, page = (folder / "drive.csv", "--vehicle", folder / "car.toml"), tmp_path / "d.html"
    first = commands.run("detect", *on)[1].splitlines()[0]
    assert first.endswith("; doubtful, check the inputs first")
    assert first in aq.detect(on[0], on[2]).headline()
    for said in (commands.run("diagnose", *on, "--page", page)[1].lower(), page.read_text(encoding="utf-8").lower()):
        head = said.index("check the inputs first")
        assert head < said.index("a_y", head) < said.index("payload", head)
        assert "a_x (offset)" not in said  # an effect of its own


def test_doctor_names_file_and_channel(folder):
    result, _ = document(folder, "doctor")
    (sign,) = (f for f in result["findings"] if f["kind"] == "sign")
    assert (sign["level"], sign["file"], sign["channel"]) == ("doubt", "drive.csv", "a_y")
    assert 'a_y = { channel = "a_y", scale = -1.0 }' in sign["advice"]
    assert not any(f["kind"] == "signal" and "a_y" in f["what"] for f in result["findings"])


@pytest.mark.parametrize("command", ["detect", "slip-slope", "calibrate", "diagnose"])
def test_offsets_are_taken_off_where_asked(folder, command, engine):
    result, err = document(folder, command, "--correct-offsets")
    assert ("offset", "a_x") not in found(result["checks"])
    assert "is taken off, as it shows at standstill" in err


def test_a_map_that_speaks_of_another_file_is_refused(folder, tmp_path):
    path = tmp_path / "map.toml"
    path.write_text('[signals]\nv_x = "v_x"\n[sources."drive2.csv"]\noffset_s = 0.2\n', encoding="utf-8")
    for command in ("detect", "slip-slope", "calibrate", "evaluate", "doctor"):
        result = commands.run(command, folder / "drive.csv", "--vehicle", folder / "car.toml", "--signals", path)
        assert result[0] == 2
        assert 'map.toml: line 3: [sources."drive2.csv"] fits no file (did you mean "drive.csv"?)' in result[2]


def test_a_drive_in_windows_has_the_same_remarks(folder, monkeypatch):
    whole, _ = document(folder, "detect")
    monkeypatch.setattr(load_drive, "__kwdefaults__", {**load_drive.__kwdefaults__, "least": 1})
    monkeypatch.setattr("aqualog.detect.long.detect_long", lambda *a, **k: detect_long(*a, **k, rows=777))
    assert document(folder, "detect")[0]["checks"] == whole["checks"] != []


def test_a_map_of_a_campaign_may_speak_of_the_files_of_any_run(folder, tmp_path):
    text = 'name = "c"\nvehicle = "car.toml"\nsignals = "map.toml"\n[[run]]\nlog = "a.csv"\n[[run]]\nlog = "b.csv"\n'
    (tmp_path / "campaign.toml").write_text(text, encoding="utf-8")
    (tmp_path / "car.toml").write_text((folder / "car.toml").read_text(encoding="utf-8"), encoding="utf-8")
    for name in ("a.csv", "b.csv"):
        (tmp_path / name).write_text("t [s],v_x [m/s]\n0,1\n1,1\n", encoding="utf-8")
    for name, fits in (("b.csv", True), ("c.csv", False)):
        (tmp_path / "map.toml").write_text(f'[sources."{name}"]\noffset_s = 0.2\n', encoding="utf-8")
        code, _, err = commands.run("inspect", tmp_path / "campaign.toml")
        found = commands.run("evaluate", tmp_path / "campaign.toml")
        assert ("fits no file" in found[2]) != fits, (code, err)
        assert found[0] == 2 or fits


@pytest.mark.parametrize(("command", "after"), [("detect", "Signals"), ("slip-slope", "Over the session")])
def test_text_and_page_name_the_inputs_before_the_numbers(folder, command, after, tmp_path):
    out = tmp_path / "out"
    code, text, _ = commands.run(command, folder / "drive.csv", "--vehicle", folder / "car.toml", "-o", out)
    assert code == 0
    assert "check the inputs first\n  a_y (sign); a_x (offset)" in text
    page = next(out.glob("*.html")).read_text(encoding="utf-8")
    body = page[page.index("<main") if "<main" in page else 0 :]
    assert body.index("Check the inputs first") < body.index(after)
    assert body.count("<b>a_y</b> has the opposite sign of") == 1


def test_align_takes_a_map_with_the_clocks_of_other_files(folder, tmp_path):
    path = tmp_path / "map.toml"
    path.write_text('[sources."gps.csv"]\noffset_s = 0.2\n', encoding="utf-8")
    other = tmp_path / "copy.csv"
    other.write_bytes((folder / "drive.csv").read_bytes())
    code, _, err = commands.run("align", folder / "drive.csv", other, "--signals", path)
    assert (code, "fits no file" in err) == (0, False), err
    with pytest.raises(aq.AqualogError, match=r'\[sources\."gps\.csv"\] fits no file; the files are drive\.csv'):
        aq.read(folder / "drive.csv", map=path)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda head, rows: (head.replace("[s]", "[ms]"), rows),
            "time stamps are 1.0e-05 s apart; expected 5e-05 s or more",
        ),
        (
            lambda head, rows: (head, [f"0,0;{r.partition(';')[2]}" for r in rows]),
            "no signal has two samples at different times",
        ),
        (lambda head, rows: (head, rows[::100]), "(the log has 1 Hz); expected"),
        (
            lambda head, rows: (head.replace("U/min", "rad/s"), rows),
            "are left out: all of them, its unit or its sign is wrong",
        ),
    ],
    ids=["unit of time", "one time", "1 Hz", "unit of wheels"],
)
def test_what_no_car_logs_is_said(tmp_path, change, words):
    head, *rows = (SAMPLES / "lane_drive.csv").read_text(encoding="utf-8").splitlines()
    head, rows = change(head, rows)
    (tmp_path / "odd.csv").write_text("\n".join([head, *rows]), encoding="utf-8")
    given = ("--signals", SAMPLES / "map_csv.toml", "--vehicle", SAMPLES / "vehicle.toml")
    found = commands.run("detect", tmp_path / "odd.csv", *given)
    said = found.stdout + found.stderr
    assert words in said
    assert "odd.csv" in said


def test_units_that_nobody_knows_are_named(tmp_path):
    rows = "\n".join(f"{i / 100},{i},{i},0" for i in range(99))
    (tmp_path / "odd.csv").write_text(f"t [s],v_x [banana],omega_fl [banana],on_water\n{rows}\n")
    assert 'omega_fl: unknown unit "banana"' in commands.one_error_line(commands.run("detect", tmp_path / "odd.csv"))
