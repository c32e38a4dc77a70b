"""`aq.diagnose` does what `aqualog diagnose` does; the diagnosis itself is made by hand."""

import importlib
import json
from dataclasses import replace

import numpy as np
import pytest

import aqualog as aq
from aqualog.core.notation import SYMBOLS
from aqualog.diagnose import campaign as campaign_diagnosis
from aqualog.diagnose import run as engine
from aqualog.face.listener import listener
from aqualog.io.write_table import TableColumn, write_parquet
from tests.both_ways import check_saved, check_shown, command
from tests.checks.made import DT, signals
from tests.checks.made import made as kinematic
from tests.diagnose.stand_in import Engine, write_drives
from tests.report.diagnosis_case import cases

FILES = ("diagnosis.json", "model.toml", "diagnosis.html")


@pytest.fixture
def folder(tmp_path):
    return write_drives(tmp_path)


@pytest.fixture(autouse=True)
def made(monkeypatch):
    made = Engine()
    monkeypatch.setattr(engine, "diagnose", made)
    return made


@pytest.mark.parametrize("verdict", cases())
def test_face_and_command_agree(folder, made, verdict):
    made.verdict = verdict
    logs, car = (folder / "a.parquet", folder / "b.parquet"), folder / "car.toml"
    result = aq.diagnose(logs, car, seed=7, views=False)
    assert result.to_json() + "\n" == command("diagnose", *logs, "--vehicle", car, "--seed", 7, "--json")[0]
    assert result.text() == command("diagnose", *logs, "--vehicle", car, "--seed", 7)[0]
    assert result.verdict == verdict
    assert result.model == result.found.model


def test_files_are_those_of_the_command(folder):
    logs, car, out = (folder / "a.parquet", folder / "b.parquet"), folder / "car.toml", folder / "out"
    drawn = aq.diagnose([aq.read(p) for p in logs], aq.Vehicle.read(car))
    check_shown(drawn)
    check_saved(drawn, out, FILES)
    before = {n: (out / n).read_bytes() for n in FILES}
    args = ("diagnose", *logs, "--vehicle", car, "-o", out / "model.toml", "--page", out / "diagnosis.html", "--force")
    assert before["diagnosis.json"].decode() == command(*args, "--json")[0]
    assert {n: (out / n).read_bytes() for n in FILES} == before
    assert aq.Model.read(out / "model.toml") == drawn.model
    assert aq.Model.read(out / "model.toml").car == drawn.vehicle_name
    assert drawn.write_model(folder / "m.toml").read_bytes() == before["model.toml"]
    assert drawn.write_page(str(folder / "p.html")).exists()
    with pytest.raises(aq.AqualogError, match="source of this very run"):
        drawn.write_page(logs[0], force=True)


def test_tables(folder):
    result = aq.diagnose(folder / "a.parquet", folder / "car.toml")
    causes = result.tables["causes"]
    assert causes.columns == ["effect", "where", "drives", "parameter", "value", "low", "high", "unit"]
    assert causes.row(0)[0] == "payload_mass"
    assert causes["low"][0] < causes["value"][0] < causes["high"][0]
    assert {"gain", "limits", "unexplained", "alternatives"} < set(result.tables)


def test_inputs(folder, made):
    asked = made.asked
    (folder / "one").mkdir()
    (folder / "a.parquet").rename(folder / "one" / "a.parquet")
    car, c = aq.Vehicle.read(folder / "car.toml"), folder / "c.parquet"
    result = aq.diagnose([folder / "one", c, c], car, holdout=[], surrogates=9, level=0.05)
    assert asked[-1][:3] == (["one", "c.parquet"], [], car)
    assert (asked[-1][4].surrogates, asked[-1][4].level, asked[-1][4].views) == (9, 0.05, True)
    assert result.notes[0] == "1 of 3 logs given more than once: each counts once"
    aq.diagnose([aq.read(c, vehicle=car)], holdout=str(folder / "one"), surrogates=0)
    assert asked[-1][:2] == (["c.parquet"], ["one"])
    assert asked[-1][2].name == "car"
    aq.diagnose([aq.read(c).signals, aq.read(c).signals], car)
    assert asked[-1][0] == ["c.parquet", "c.parquet (2)"]
    with pytest.raises(aq.AqualogError, match="is diagnosed and held out"):
        aq.diagnose(c, car, holdout=c)
    with pytest.raises(aq.AqualogError, match="no vehicle"):
        aq.diagnose(c)
    with pytest.raises(aq.AqualogError, match=r"level = 2"):
        aq.diagnose(c, car, level=2.0)


def test_a_campaign(folder, monkeypatch):
    calls = []

    def fake(data, model, *, options, progress):
        calls.append((data.name, len(data.runs), options.seed, options.level))
        return replace(cases()["named"], drives=("c",))

    monkeypatch.setattr(campaign_diagnosis, "diagnose_campaign", fake)
    path = folder / "campaign.toml"
    shown = command("diagnose", path, "--seed", 3, "--json")[0]
    results = [aq.diagnose(given, seed=3) for given in (path, str(path), aq.Campaign(path), aq.Campaign(path).run())]
    assert set(calls) == {("c", 1, 3, 0.01)}
    assert len({r.to_json() for r in results}) == 1
    assert results[0].to_json() + "\n" == shown
    assert json.loads(shown)["logs"] == [str(path)]
    check_shown(results[0])
    with pytest.raises(aq.AqualogError, match="beside a campaign"):
        aq.diagnose(path, aq.Vehicle())
    with pytest.raises(aq.AqualogError, match="holdout beside a campaign"):
        aq.diagnose(path, holdout=folder / "a.parquet")


def test_the_checks_of_a_campaign_stand_once_with_their_logs(tmp_path, monkeypatch):
    for k, turned in enumerate((("a_y",), ("a_y",), ())):
        columns = signals(kinematic(seconds=120.0, seed=k), turned=turned).frame
        table = [TableColumn("t", "s", DT * np.arange(columns.height))]
        table += [TableColumn(n, SYMBOLS[n].unit, columns[n].to_numpy()) for n in columns.columns]
        write_parquet(tmp_path / f"log{k}.parquet", table)
    (tmp_path / "car.toml").write_text('drivetrain = "rwd"\nmass = 1650.0\n')
    runs = "".join(f'[[run]]\nlog = "log{k}.parquet"\n' for k in range(3))
    (tmp_path / "campaign.toml").write_text(f'name = "c"\nvehicle = "car.toml"\n{runs}')
    found = replace(cases()["named"], drives=("c",))
    monkeypatch.setattr(campaign_diagnosis, "diagnose_campaign", lambda *args, **kw: found)
    result = aq.diagnose(tmp_path / "campaign.toml")
    (row,) = (r for r in json.loads(result.to_json())["checks"] if "a_y" in r["signals"])
    assert row["kind"] == "sign"
    assert row["drive"] == "log0.parquet"
    assert row["logs"] == ["log0.parquet", "log1.parquet"]
    assert row["lines"]
    assert any(n.startswith("log0.parquet") and n.endswith("(and in 1 more)") for n in result.notes)


def test_the_time_left_follows_from_the_share(monkeypatch):
    said, clock = [], iter([0.0, 0.5, 10.0])
    face = importlib.import_module("aqualog.face.diagnose")
    monkeypatch.setattr(face.time, "monotonic", lambda: next(clock))
    report = face._shares(listener(said.append))
    report("a", 0.0)
    report("b", 0.25)
    assert said == ["a, 0 %", "b, 25 %, about 30 s left"]
