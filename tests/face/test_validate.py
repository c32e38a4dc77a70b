"""`aq.validate` does what `aqualog validate` does."""

import json

import pytest

import aqualog as aq
from aqualog.diagnose import run as engine
from tests.book.test_documents import complaints
from tests.both_ways import check_result, command
from tests.conftest import ROOT
from tests.diagnose.stand_in import Engine

SAMPLES = ROOT / "sample_logs"
LOGS, CAR = (SAMPLES / "loaded_monday.parquet", SAMPLES / "loaded_friday.parquet"), SAMPLES / "vehicle.toml"
FILES = ("validation.json", "validation.html")


@pytest.fixture(autouse=True)
def made(monkeypatch):
    made = Engine()
    monkeypatch.setattr(engine, "diagnose", made)
    return made


@pytest.mark.parametrize(("method", "logs"), [("boundary", LOGS), ("18571", LOGS[:1])], ids=["boundary", "18571"])
def test_face_and_command_agree(tmp_path, made, method, logs):
    result = aq.validate(logs, CAR, method=method)
    check_result(result, tmp_path / "face", "validate", *logs, "--vehicle", CAR, "--method", method, files=FILES)
    assert made.asked[0][0] == [log.name for log in logs]
    d = result.document
    assert complaints("validate", json.loads(result.to_json())) == []
    assert d["diagnosis"]["verdict"] == "named"
    assert d["sentence"].startswith(f"By the method of {'ISO 19364' if method == 'boundary' else 'ISO/TS 18571'}, on ")
    command("validate", *logs, "--vehicle", CAR, "--method", method, "-o", tmp_path / "page.html")
    assert (tmp_path / "page.html").read_bytes() == (tmp_path / "face" / "validation.html").read_bytes()


def test_without_the_diagnosis(made, tmp_path):
    result = aq.validate(LOGS[0], CAR, why=False)
    assert made.asked == []
    assert result.document["diagnosis"] is None
    assert set(result.tables) == {"plots", "limits", "ratings", "drives"}
    command("validate", LOGS[0], "--vehicle", CAR, "--no-why", "--csv", tmp_path / "v.csv", "-q")
    assert {p.name for p in tmp_path.iterdir()} == {"v.csv", "v_limits.csv", "v_ratings.csv", "v_drives.csv"}


def test_a_diagnosis_that_fails_leaves_the_rest(made):
    made.faults[None] = aq.AqualogError("no luck")
    result = aq.validate(LOGS[0], CAR)
    assert result.why is None
    assert any(n.startswith("why: no luck") for n in result.notes)


BOUNDARIES = """
agreed = 0.9
[[plot]]
y = "a_x"
y_offset = 0.5
[[plot]]
y = "a_x"
x = "v_x"
x_offset = 1.0
y_gain = 0.1
"""


def test_boundaries_of_the_user(tmp_path):
    (tmp_path / "own.toml").write_text(BOUNDARIES)
    args = ("validate", *LOGS, "--vehicle", CAR, "--no-why", "--boundaries", tmp_path / "own.toml", "--json")
    d = json.loads(command(*args)[0])
    plots = {(r["y"], r["x"]): r for r in d["plots"]}
    assert d["agreed_share"] == 0.9
    assert (plots["a_x", "t"]["y_offset"], plots["a_x", "t"]["within_share"]) == (0.5, 1.0)
    assert (plots["a_x", "v_x"]["x_offset"], plots["a_x", "v_x"]["y_gain"]) == (1.0, 0.1)
    assert plots["a_x", "t"]["tolerance_from"] == "file"
    assert plots["slip_fl", "t"]["tolerance_from"] == "built in"
    (tmp_path / "own.toml").write_text("built_in = false\n" + BOUNDARIES)
    assert {(r["y"], r["x"]) for r in json.loads(command(*args)[0])["plots"]} == {("a_x", "t"), ("a_x", "v_x")}


@pytest.mark.parametrize(
    ("text", "told"),
    [('[[plot]]\ny = "a_z"\ny_offset = 1.0', "line 2: y = 'a_z' is not one of \"a_x\""),
     ('[[plot]]\ny = "a_x"', "plot a_x over t: neither y_offset nor y_gain is above 0"),
     ('[[plot]]\ny = "a_x"\ny_ofset = 1.0', 'unknown key "y_ofset" (did you mean "y_offset"?)'),
     ('[[plot]]\ny = "a_x"\ny_offset = 1\n[[plot]]\ny = "a_x"\ny_offset = 2', "a_x over t stands twice"),
     ("built_in = false", "leaves no plot"), ("agreed = 2", "agreed = 2 is outside 0.5 ... 1")],
)  # fmt: skip
def test_faults_of_the_boundaries_file(tmp_path, text, told):
    (tmp_path / "own.toml").write_text(text)
    with pytest.raises(aq.AqualogError) as caught:
        aq.validate(LOGS[0], CAR, boundaries=tmp_path / "own.toml")
    assert told in str(caught.value)


def test_errors():
    with pytest.raises(aq.AqualogError, match='method "iso"'):
        aq.validate(LOGS[0], CAR, method="iso")
    assert "no --vehicle" in command("validate", LOGS[0], code=2)[1]
