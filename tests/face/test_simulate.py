"""`aq.simulate` does what `aqualog simulate` does."""

import json
import os

import pytest

import aqualog as aq
from aqualog.config.scenario import load_scenario
from aqualog.model import campaign as programmes
from aqualog.model.campaign import CampaignOutcome
from tests.both_ways import check_shown, command
from tests.cli.test_simulate import CAR
from tests.cli.test_simulate import SCENARIO as ONE_LANE

SCENARIO = ONE_LANE + "[[lane]]\nstart_s = 8.0\nend_s = 9.0\nwater_depth_mm = 2\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("simulated")
    (place / "wet.toml").write_text(SCENARIO)
    (place / "model.toml").write_text('[[term]]\neffect = "head_wind"\nspeed = 2.0\n')
    return place


def without_speed(text):
    return {**json.loads(text), "real_time_factor": None}


def test_face_and_command_agree(folder, tmp_path):
    sim = aq.simulate(folder / "wet.toml", model=folder / "model.toml", seed=7)
    for suffix in ("mf4", "mcap", "csv", "parquet"):
        by_command = tmp_path / f"wet.{suffix}"
        args = ("simulate", folder / "wet.toml", "--model", folder / "model.toml", "--seed", 7, "-o", by_command)
        shown, notes = command(*args, "--json")
        assert sim.write(tmp_path / f"face.{suffix}").read_bytes() == by_command.read_bytes()
        assert without_speed(sim.naming(by_command).to_json()) == without_speed(shown)
        assert all(f"note: {n}\n" in notes for n in sim.notes)
    assert command(*args, "--force")[0] == sim.text()
    assert len(sim.notes) == 1
    with pytest.raises(aq.AqualogError, match="exists already"):
        sim.write(by_command)


def test_saved(folder, tmp_path):
    sim = aq.simulate(str(folder / "wet.toml"))
    assert [p.name for p in sim.save(tmp_path)] == ["wet.mf4", "simulation.json"]
    assert json.loads((tmp_path / "simulation.json").read_text())["log"] == str(tmp_path / "wet.mf4")
    with pytest.raises(aq.AqualogError, match="exists already"):
        sim.save(tmp_path)


def test_the_drive_is_that_of_the_log(folder, tmp_path):
    sim = aq.simulate(folder / "wet.toml")
    check_shown(sim)
    log = aq.read(sim.write(tmp_path / "wet.mf4"))
    assert sim.signals.frame.equals(log.frame)
    assert dict(sim.signals.origins) == dict(log.signals.origins)
    in_memory, written = aq.detect(sim.drive), aq.detect(log, CAR)
    assert {**in_memory.document, "log": ""} == {**written.document, "log": ""}
    assert not [c for c in sim.signals.symbols if c.startswith("true_")]


def test_truth(folder):
    sim = aq.simulate(folder / "wet.toml")
    truth = sim.tables["truth"]
    assert truth.columns[0] == "t"
    assert all(c.startswith("true_") for c in truth.columns[1:])
    assert truth.height == 300
    assert truth["true_contact_fl"].min() < 0.9 < truth["true_contact_fl"][0]


def test_a_scenario_as_a_record(folder):
    of_file = aq.simulate(folder / "wet.toml", seed=3)
    scenario = load_scenario(folder / "wet.toml")
    of_record = aq.simulate(scenario, model=aq.Model(), seed=3)
    assert of_record.signals.frame.equals(of_file.signals.frame)
    assert of_record.name == "simulated"
    assert not aq.simulate(scenario).signals.frame.equals(of_file.signals.frame)
    with pytest.raises(aq.AqualogError, match="seed = -1"):
        aq.simulate(scenario, seed=-1)


def test_a_programme(monkeypatch, tmp_path):
    calls = []

    def run(programme, folder, *, jobs, force, report):
        calls.append((programme, folder, jobs, force))
        report(1, 2)
        return CampaignOutcome(1, 0, {"wet": "no car"})

    monkeypatch.setattr(programmes, "simulate_campaign", run)
    heard = []
    result = aq.Campaign.simulate("thesis", str(tmp_path / "c"), jobs=2, progress=heard.append)
    assert calls == [("thesis", tmp_path / "c", 2, False)]
    assert result.has_loss
    assert result.path == tmp_path / "c" / "campaign.toml"
    assert "1 drives simulated in 0 s, 1 failed" in repr(result)
    assert "error: wet: no car" in heard
    assert aq.Campaign.simulate("thesis", tmp_path / "c", force=True).outcome.made == 1
    assert calls[-1][2:] == (os.cpu_count(), True)
    with pytest.raises(aq.AqualogError, match="is the name of a log"):
        aq.Campaign.simulate("thesis", tmp_path / "c.mf4")
