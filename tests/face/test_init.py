"""A start for one drive: map, vehicle file, what is next; questions only where nothing else says it."""

import json
import shlex

import numpy as np
import pytest

import aqualog as aq
from aqualog.cli.console import Console
from aqualog.config.signal_map import load_signal_map
from aqualog.core.errors import AqualogError, ConfigError, SignalError
from aqualog.core.provenance import uncertainty
from aqualog.core.vehicle import Provenance
from tests.both_ways import check_saved, check_shown, command
from tests.commands import run
from tests.conftest import ROOT

GERMAN = ROOT / "sample_logs" / "lane_drive.csv"
CANONICAL = ROOT / "sample_logs" / "lane_drive.mf4"
CAR = ROOT / "sample_logs" / "vehicle.toml"
T = np.arange(0.0, 60.0, 0.1)
V = 60.0 + 20.0 * np.sin(0.3 * T)  # [km/h]


def ev(path, speed="v [km/h]"):
    """A log of an electric car: speed, acceleration, torque of its motor."""
    rows = zip(T, V, np.gradient(V / 3.6, T), 50.0 * np.cos(0.3 * T), strict=True)
    lines = [f"t [s],{speed},a_x [m/s^2],Motor Torque [Nm]", *(",".join(f"{x:.5f}" for x in r) for r in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_face_and_command_agree_and_the_files_work(tmp_path):
    out = tmp_path / "new" / "work"
    result = aq.init(GERMAN, out)
    assert not out.parent.exists()
    check_shown(result)
    check_saved(result, tmp_path / "saved", ("map.toml", "vehicle.toml"))
    printed, _ = command("init", GERMAN, "-o", out, "--json")
    assert printed == result.to_json() + "\n"
    assert sorted(p.name for p in out.iterdir()) == ["map.toml", "vehicle.toml"]
    assert (out / "map.toml").read_bytes() == (tmp_path / "saved" / "map.toml").read_bytes()
    assert aq.Vehicle.read(out / "vehicle.toml").given == {"name"}
    document = json.loads(printed)
    assert document["set"] == ["drivetrain", "mass", "l_f", "l_r", "wheels.r_e_f", "wheels.r_e_r"]
    assert [c.split()[1] for c in document["next"]] == ["doctor", "detect", "calibrate"]
    assert run(*shlex.split(document["next"][0])[1:]).exit_code == 0
    vehicle = (out / "vehicle.toml").read_text()
    assert "# r_e_f = 0.3172" in vehicle  # the wheels turn, and v_x is there
    assert "guessed: v_x over the wheel speeds of this log" in vehicle
    radii = {f"wheels.r_e_{axle}": Provenance("guess") for axle in "fr"}
    assert aq.Vehicle.read(out / "vehicle.toml").provenance == radii
    assert '# mass = ""                   # "measured", "calibrated", "data_sheet", "guess"' in vehicle
    filled = (
        vehicle.replace("# r_e_f", "r_e_f")
        .replace("# mass =  ", "mass = 1500.0")
        .replace('# mass = ""', 'mass = "measured"')
    )
    (tmp_path / "car.toml").write_text(filled)
    car = aq.Vehicle.read(tmp_path / "car.toml")
    assert (uncertainty(car, "mass"), uncertainty(car, "wheels.r_e_f")) == pytest.approx((10.0, 0.015 * car.r_e_f))


def test_canonical_names_need_no_map_and_a_vehicle_file_none_to_fill(tmp_path):
    done = run("init", CANONICAL, "-o", tmp_path / "a")
    assert done.exit_code == 0, done.stderr
    assert [p.name for p in (tmp_path / "a").iterdir()] == ["vehicle.toml"]
    assert "--signals" not in done.stdout
    given = aq.init(GERMAN, tmp_path / "b", CAR)
    assert list(given.files()) == ["map.toml"]
    assert given.to_set == ()
    assert f"--vehicle {CAR}" in given.next_commands[1]


def test_nothing_is_overwritten_and_what_fails_leaves_nothing(tmp_path, monkeypatch):
    (tmp_path / "vehicle.toml").write_text("mine")
    done = run("init", GERMAN, "-o", tmp_path)
    assert done.exit_code == 2
    assert "exists already" in done.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["vehicle.toml"]
    assert run("init", GERMAN, "-o", tmp_path, "--force").exit_code == 0
    assert "SET" in (tmp_path / "vehicle.toml").read_text()

    def fails(*_):
        raise OSError(28, "no room")

    start = aq.init(GERMAN, tmp_path / "new")
    monkeypatch.setattr("aqualog.campaign.propose_files.vehicle_text", fails)
    with pytest.raises(AqualogError, match="no room"):
        start.write_files()
    assert not (tmp_path / "new").exists()


def asked(answers):
    questions = []

    def ask(question):
        questions.append(question.key)
        return answers[question.key]

    return questions, ask


def test_what_cannot_be_known_is_asked_and_the_answers_are_in_the_files(tmp_path):
    log = ev(tmp_path / "ev.csv")
    questions, ask = asked({"vehicle.drivetrain": "rwd", "map.torque_r.scale": "9.665"})
    start = aq.init(log, tmp_path / "work", ask=ask)
    assert questions == ["vehicle.drivetrain", "map.torque_r.scale"]
    start.write_files()
    entry = load_signal_map(tmp_path / "work" / "map.toml").entries["torque_r"]
    assert (entry.channel, entry.scale) == (("Motor Torque",), 9.665)
    assert aq.Vehicle.read(tmp_path / "work" / "vehicle.toml").given == {"name", "drivetrain"}
    assert "drivetrain" not in start.to_set
    assert start.unmapped == ()


def test_without_an_answer_the_place_is_marked(tmp_path):
    start = aq.init(ev(tmp_path / "ev.csv"), tmp_path / "work", ask=lambda _: "")
    assert "torque_r" not in start.proposals
    assert [c.split()[1] for c in start.next_commands] == ["doctor", "diagnose", "convert"]
    del start.proposals["a_x"]
    assert [c.split()[1] for c in start.next_commands] == ["doctor", "convert"]
    start.write_files()
    assert "(a driveline torque with its scale: Motor Torque [Nm])" in start.text()
    text = (tmp_path / "work" / "map.toml").read_text()
    line = '# SET torque_r = { channel = "Motor Torque", scale = ... }\n'
    assert line in text
    filled = tmp_path / "filled.toml"
    filled.write_text(text.replace(line, line.removeprefix("# SET ").replace("...", "9.7")))
    assert load_signal_map(filled).entries["torque_r"].scale == 9.7


def test_a_unit_in_doubt_comes_before_the_ratio_and_two_questions_are_the_most(tmp_path):
    log = ev(tmp_path / "ev.csv", speed="Velocity")
    log.write_text(log.read_text().replace("a_x [m/s^2]", "noise"))
    questions, ask = asked({"vehicle.drivetrain": "fwd", "map.v_x.unit": "mph"})
    start = aq.init(log, tmp_path / "work", ask=ask)
    assert questions == ["vehicle.drivetrain", "map.v_x.unit"]
    assert start.proposals["v_x"].entry.unit == "mph"
    assert not start.proposals["v_x"].doubt


def test_the_command_asks_on_a_terminal_until_the_answer_is_one(tmp_path, monkeypatch):
    log, answers, shown = ev(tmp_path / "ev.csv"), ["4x4", "fwd", ""], []
    monkeypatch.setattr(Console, "ask", lambda _, text: (shown.append(text), answers.pop(0))[1])
    assert run("init", log, "-o", tmp_path / "a").exit_code == 0
    assert not shown  # nobody is there
    monkeypatch.setattr(Console, "can_ask", lambda _: True)
    done = run("init", log, "-o", tmp_path / "b")
    assert done.exit_code == 0, done.stderr
    assert shown[0] == "Which axle is driven? (rwd, fwd, awd; empty: not known)"
    assert shown[1].startswith("'4x4' is no answer")
    assert not answers
    assert 'drivetrain = "fwd"' in (tmp_path / "b" / "vehicle.toml").read_text()


def test_what_is_no_single_drive_or_no_drive_at_all(tmp_path):
    (tmp_path / "copy.csv").write_bytes(GERMAN.read_bytes())
    with pytest.raises(SignalError, match="campaign init"):
        aq.init([GERMAN, tmp_path / "copy.csv"], tmp_path / "work")
    (tmp_path / "a.csv").write_text("t,foo\n" + "".join(f"{0.1 * i},{i % 7}\n" for i in range(100)))
    assert run("init", tmp_path / "a.csv", "-o", tmp_path / "work").exit_code == 4
    with pytest.raises(ConfigError):
        aq.init(GERMAN, tmp_path / "work", tmp_path / "no.toml")
    assert not (tmp_path / "work").exists()
