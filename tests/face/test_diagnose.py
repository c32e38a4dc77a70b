"""`aq.diagnose` does what `aqualog diagnose` does; the diagnosis itself is made by hand."""

import json
from dataclasses import replace

import polars as pl
import pytest

import aqualog as aq
from aqualog.core.vehicle import vehicle_toml
from aqualog.diagnose import campaign as campaign_diagnosis
from aqualog.diagnose import run as engine
from tests.both_ways import check_shown, command
from tests.report.diagnosis_case import cases, views_of

FILES = ("diagnosis.json", "model.toml", "diagnosis.html")


@pytest.fixture
def folder(tmp_path):
    n = 200
    frame = pl.DataFrame(
        {"t": [i / 10 for i in range(n)], "v_x": [20.0] * n, "a_x": [0.0] * n}
        | {f"omega_{w}": [63.0] * n for w in ("fl", "fr", "rl", "rr")}
    )
    for name in "abc":
        frame.write_parquet(tmp_path / f"{name}.parquet")
    (tmp_path / "car.toml").write_text(vehicle_toml(aq.Vehicle(name="car")), encoding="utf-8")
    (tmp_path / "campaign.toml").write_text(
        'name = "c"\nvehicle = "car.toml"\n[[run]]\nlog = "a.parquet"\nwater_depth_mm = 1.3\n', encoding="utf-8"
    )
    return tmp_path


@pytest.fixture(autouse=True)
def asked(monkeypatch):
    """What the engine is asked; it answers with the verdict of the case that the seed counts."""
    calls = []

    def run(drives, vehicle, *, model=None, holdout=(), options=None, progress=None):
        calls.append(([n for n, _ in drives], [n for n, _ in holdout], vehicle.name, model, options))
        verdict = list(cases())[options.seed - 1]
        progress("searching", 0.5)
        found = replace(cases()[verdict], drives=tuple(n for n, _ in drives))
        return replace(found, views=views_of(verdict) if options.views else ())

    monkeypatch.setattr(engine, "diagnose", run)
    return calls


@pytest.mark.parametrize("seed", range(1, len(cases()) + 1))
def test_face_and_command_agree(folder, seed):
    logs, car = (folder / "a.parquet", folder / "b.parquet"), folder / "car.toml"
    args = ("diagnose", *logs, "--vehicle", car, "--seed", seed)
    result = aq.diagnose(logs, car, seed=seed, views=False)
    assert result.to_json() + "\n" == command(*args, "--json")[0]
    assert result.text() == command(*args)[0]
    assert result.verdict == list(cases())[seed - 1]
    assert result.model == result.found.model
    drawn = aq.diagnose([aq.read(p) for p in logs], aq.Vehicle.read(car), seed=seed)
    check_shown(drawn)
    out = folder / "out"
    written = drawn.save(out)
    assert [p.name for p in written] == list(FILES)
    with pytest.raises(aq.AqualogError, match="exists already"):
        drawn.save(out)
    before = {p: p.read_bytes() for p in written}
    shown = command(*args, "-o", out / "model.toml", "--page", out / "diagnosis.html", "--force", "--json")[0]
    assert {p: p.read_bytes() for p in written} == before
    assert before[out / "diagnosis.json"].decode() == shown
    assert aq.Model.read(out / "model.toml") == drawn.model
    assert drawn.write_model(folder / "m.toml").read_bytes() == before[out / "model.toml"]
    assert drawn.write_page(str(folder / "p.html")).exists()
    with pytest.raises(aq.AqualogError, match="source of this very run"):
        drawn.write_page(logs[0], force=True)


def test_tables(folder):
    result = aq.diagnose(folder / "a.parquet", folder / "car.toml", seed=1 + list(cases()).index("named"))
    causes = result.tables["causes"]
    assert causes.columns == ["effect", "where", "parameter", "value", "low", "high", "unit"]
    assert causes.row(0)[0] == "payload_mass"
    assert causes["low"][0] < causes["value"][0] < causes["high"][0]
    assert {"gain", "limits", "unexplained", "alternatives"} < set(result.tables)


def test_inputs(folder, asked):
    (folder / "one").mkdir()
    (folder / "a.parquet").rename(folder / "one" / "a.parquet")
    car, c = aq.Vehicle.read(folder / "car.toml"), folder / "c.parquet"
    result = aq.diagnose([folder / "one", c, c], car, holdout=[], surrogates=9, level=0.05)
    assert asked[-1][:3] == (["one", "c.parquet"], [], "car")
    assert (asked[-1][4].surrogates, asked[-1][4].level, asked[-1][4].views) == (9, 0.05, True)
    assert result.notes[0] == "1 of 3 logs given more than once: each counts once"
    aq.diagnose([aq.read(c, vehicle=car)], holdout=str(folder / "one"), surrogates=0)
    assert asked[-1][:3] == (["c.parquet"], ["one"], "car")
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

    def fake(campaign, data, *, seed, level, model, progress, **drawn):
        calls.append((campaign.name, len(data.runs), seed, level, drawn))
        return replace(cases()["named"], drives=("c",))

    monkeypatch.setattr(campaign_diagnosis, "diagnose_campaign", fake)
    path = folder / "campaign.toml"
    shown = command("diagnose", path, "--seed", 3, "--json")[0]
    results = [aq.diagnose(given, seed=3) for given in (path, str(path), aq.Campaign(path), aq.Campaign(path).run())]
    assert {c[:4] for c in calls} == {("c", 1, 3, 0.01)}
    assert len({r.to_json() for r in results}) == 1
    assert results[0].to_json() + "\n" == shown
    assert json.loads(shown)["logs"] == [str(path)]
    check_shown(results[0])
    with pytest.raises(aq.AqualogError, match="beside a campaign"):
        aq.diagnose(path, aq.Vehicle())
    with pytest.raises(aq.AqualogError, match="holdout beside a campaign"):
        aq.diagnose(path, holdout=folder / "a.parquet")
