"""`aqualog detect --model`: what a model's terms change for the user."""

import json

import pytest

from aqualog.config.model import dump_model
from aqualog.config.vehicle import load_vehicle
from aqualog.model.effects import EFFECTS
from aqualog.model.log import write_simulation
from aqualog.model.scenario import Scenario
from aqualog.model.simulate import simulate
from aqualog.model.term import Model, Term
from tests.cli.test_commands import CAR, MF4, SAMPLES
from tests.commands import one_error_line, run


@pytest.fixture(scope="module")
def loaded_car(tmp_path_factory):
    """A log of the sample car with 350 kg that its vehicle file does not know of, on dry road; and the model file."""
    folder = tmp_path_factory.mktemp("loaded")
    model = Model((Term(EFFECTS["payload_mass"], {"delta_mass": 350.0}, "r"),))
    speed = ((0.0, 8.0), (8.0, 8.0), (16.0, 32.0), (24.0, 32.0), (34.0, 12.0), (36.0, 12.0), (43.0, 32.0), (48.0, 32.0))
    vehicle = load_vehicle(SAMPLES / "vehicle.toml")
    result = simulate(Scenario(vehicle, duration_s=48.0, speed=speed, seed=5), model)
    write_simulation(folder / "dry.mf4", result, suffix=".mf4", comment="")
    (folder / "model.toml").write_text(dump_model(model))
    return folder


def events(*args):
    result = run("detect", *args, "--vehicle", CAR, "--json")
    assert result.exit_code == 0, result.stderr
    return json.loads(result.stdout)


def test_a_hidden_payload_raises_false_alarms_that_the_model_takes_away(loaded_car):
    before = events(loaded_car / "dry.mf4")
    after = events(loaded_car / "dry.mf4", "--model", loaded_car / "model.toml")
    assert [e for e in before["events"] if e["detector"] == "resistance"]
    assert after["events"] == []
    assert before["model"] is None
    assert after["model"] == [{"effect": "payload_mass", "where": "r", "parameters": {"delta_mass": 350.0}}]


def test_an_empty_model_changes_nothing(tmp_path):
    (tmp_path / "model.toml").write_text("")
    before, after = events(MF4), events(MF4, "--model", tmp_path / "model.toml")
    assert after.pop("model") == []
    assert before.pop("model") is None
    assert before == after


def test_what_the_detectors_do_not_use_is_told(tmp_path):
    (tmp_path / "model.toml").write_text('[[term]]\neffect = "tone_ring"\namplitude = 0.004\n')
    result = run("detect", MF4, "--vehicle", CAR, "--model", tmp_path / "model.toml", "-o", tmp_path / "out")
    assert result.exit_code == 0, result.stderr
    assert "tone_ring: no detector uses this quantity" in result.stderr
    document = json.loads((tmp_path / "out" / "events.json").read_text())
    assert any("tone_ring" in n for n in document["quality"]["notes"])
    assert document["model"][0]["effect"] == "tone_ring"


@pytest.mark.parametrize(("car", "is_noted"), [("van", True), (load_vehicle(SAMPLES / "vehicle.toml").name, False)])
def test_a_model_of_another_car_is_noted(tmp_path, car, is_noted):
    (tmp_path / "model.toml").write_text(dump_model(Model(car=car)))
    result = run("detect", MF4, "--vehicle", CAR, "--model", tmp_path / "model.toml")
    assert result.exit_code == 0, result.stderr
    assert ('the model was found on "van"' in " ".join(result.stderr.split())) == is_noted


def test_faults_of_the_model_file(tmp_path):
    (tmp_path / "model.toml").write_text('[[term]]\neffect = "payload"\n')
    result = run("detect", MF4, "--vehicle", CAR, "--model", tmp_path / "model.toml")
    assert result.exit_code == 2
    assert "payload_mass" in one_error_line(result)
    assert run("detect", MF4, "--model", tmp_path / "none.toml").exit_code == 2


def test_the_model_file_is_not_overwritten(tmp_path):
    path = tmp_path / "model.csv"
    path.write_text("")
    result = run("detect", MF4, "--vehicle", CAR, "--model", path, "--write", path, "--force")
    assert result.exit_code == 2
    assert path.read_text() == ""
